"""A reset that nobody was told of: it is noticed, and what was meant for another place is not sent."""

from __future__ import annotations

import asyncio

import pytest
from tests.smc.bench import bench, motions, outcome, until

from compax_aio.errors import CompaxError, MoveError, MoveStoppedError, UnexpectedAnswerError
from compax_aio.simulator.smc import LogKind
from compax_aio.smc.events import AxesReset

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


async def test_a_motion_that_waits_while_a_chain_deals_its_names_anew_is_never_sent() -> None:
    async with bench(axes="AB", mode="daisy", baudrate=9600, fails_to_close=True) as (line, far, _):
        await line.axis("B").move_by(40)
        far.power_cycle()
        await asyncio.sleep(1)
        asking = asyncio.ensure_future(line.axis("A").position())
        await asyncio.sleep(0)
        assert isinstance(await outcome(line.axis("B").move_by(500)), CompaxError)
        await outcome(asking)
        await asyncio.sleep(5)
        assert [text for text in motions(far) if "500" in text] == []


async def test_a_reset_of_axes_that_nobody_has_named_has_gone_out_when_it_returns() -> None:
    async with bench(axes="AB", connects="") as (line, far, _):
        await line.reset()
        assert far.log.texts(LogKind.RESET)[-2:] == ["^C", "^C"]


async def test_a_position_that_was_asked_shows_a_reset_as_well() -> None:
    async with bench(axes="A", connects="", position=20000.0) as (line, far, _):
        axis = line.axis("A")
        assert await axis.position() == 20000
        far.axes["A"].reset()
        await asyncio.sleep(1)
        assert await axis.position() == 0
        assert axis.lost_reference is not None
        with pytest.raises(MoveError):
            axis.move_to(100)


async def test_a_move_that_a_reset_has_ended_at_its_target_is_not_told_as_arrived() -> None:
    """An axis may keep its count through a reset; who knows that it does?"""
    async with bench(axes="A", reset_keeps_position=True) as (line, far, _):
        move = line.axis("A").move_to(2000)
        await move.accepted
        await until(lambda: not far.axes["A"].moving)
        await line.reset()
        assert isinstance(await outcome(move), MoveStoppedError)
        assert far.axes["A"].position == 2000


async def test_the_first_reason_of_a_lost_reference_is_kept() -> None:
    async with bench(axes="A") as (line, _, _):
        axis = line.axis("A")
        axis.note_reset("first")
        axis.note_reset("second")
        assert axis.lost_reference == "first"


async def test_an_origin_that_is_not_taken_leaves_no_reference() -> None:
    async with bench(axes="A") as (line, far, cable):
        axis = line.axis("A")
        cable.at("AO0\n", lambda: far.axes["A"].jog(20_000))
        with pytest.raises(UnexpectedAnswerError, match="was told to count from here"):
            await axis.set_origin()
        assert axis.lost_reference is not None


async def test_a_raw_motion_is_not_sent_again_to_an_axis_that_was_reset_in_between() -> None:
    async with bench(axes="A", position=4000) as (line, far, cable):
        axis = line.axis("A")
        await axis.position()
        cable.at("AZ\n", lambda: cable.at("A", far.axes["A"].reset))
        with pytest.raises(MoveError, match="'R300' was not sent"):
            await axis.raw("R300")
        assert motions(far) == []


@pytest.mark.parametrize("mode", ["single", "daisy"])
async def test_a_reset_from_here_is_told_once(mode: str) -> None:
    async with bench(mode=mode) as (line, _, _):
        events = line.events()
        await line.reset()
        await line.close()
        told = [event.reason async for event in events if isinstance(event, AxesReset)]
        assert told == ["^C was sent"]


async def test_a_stop_looks_twice_before_it_says_that_the_axis_stands() -> None:
    async with bench(axes="A") as (line, far, _):
        before = far.log.texts(LogKind.COMMAND, axis="A").count("^")
        await line.axis("A").stop()
        assert far.log.texts(LogKind.COMMAND, axis="A").count("^") - before == 2


async def test_a_second_reset_keeps_a_raw_motion_back_as_the_first_did() -> None:
    async with bench(axes="A", position=4000) as (line, far, cable):
        axis = line.axis("A")
        axis.note_reset("an earlier one")
        await axis.position()
        cable.at("AZ\n", lambda: cable.at("A", far.axes["A"].reset))
        with pytest.raises(MoveError, match="'R300' was not sent"):
            await axis.raw("R300")
        assert motions(far) == []
