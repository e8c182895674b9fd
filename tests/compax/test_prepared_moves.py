"""Moves that the drive holds ready: stored with a comma, started with an exclamation mark, at most once, together."""

from __future__ import annotations

import asyncio
from contextlib import suppress

import pytest
from tests.promises.bench import bench, ending, lines, motions, now, received, scripted, until

import compax_aio
from compax_aio import (
    AnswerTimeoutError,
    CommandRejectedError,
    ConnectionLostError,
    DriveFaultError,
    DriveGroup,
    DriveSettings,
    InvalidCommandError,
    MoveActiveError,
    MoveError,
    MoveStoppedError,
    MoveTimeoutError,
)
from compax_aio.simulator.compax import LogKind
from compax_aio.simulator.server import drive_named

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


async def test_a_prepared_move_waits_in_the_drive_until_it_is_triggered() -> None:
    async with bench() as (drive, far):
        move = drive.prepare_move_to(100, speed_percent=50, comparators=[(30, 9)])
        await move.ready
        await asyncio.sleep(10)
        assert lines(far)[-3:] == ["SD50", "PR30 OT O9=1", "PA100,"]
        assert not far.moving
        assert not move.accepted.done()
        move.trigger()
        await move.accepted
        assert lines(far)[-1] == "!" == move.sent
        result = await move
        assert far.position == 100
        assert far.outputs[9]
        assert result.confirmed_by == "status"
        assert motions(far) == ["POSA 100.00"]


async def test_the_drive_may_be_asked_for_its_message_as_well() -> None:
    async with bench(settings=DriveSettings(message_when_prepared=True)) as (drive, far):
        move = drive.prepare_move_by(-20)
        await move.ready
        assert lines(far)[-1] == "PR-20$,"
        move.trigger()
        result = await move
        assert (result.confirmed_by, result.target) == ("message", -20)
        assert (await drive.move_to(0)).confirmed_by == "message"  # none is owed any more


@pytest.mark.parametrize("store", ["until_executed", "until_next_line"])
async def test_whatever_goes_over_the_line_in_between_the_move_still_starts(store: str) -> None:
    async with bench(store=store) as (drive, far):
        move = drive.prepare_move_to(100)
        await move.ready
        await drive.command("SD50")
        move.trigger()
        result = await move
        assert motions(far) == ["POSA 100.00"]
        assert "!" not in lines(far)
        assert result.confirmed_by == "message"


@pytest.mark.parametrize("store", ["until_executed", "until_next_line"])
async def test_readings_wait_a_moment_so_that_nothing_comes_between_store_and_trigger(store: str) -> None:
    async with bench(store=store) as (drive, far):
        readings = [asyncio.ensure_future(drive.position())]
        move = drive.prepare_move_to(100)
        readings.append(asyncio.ensure_future(drive.position()))
        await move.ready
        readings.append(asyncio.ensure_future(drive.torque()))
        await asyncio.sleep(0.3)
        move.trigger()
        await move.accepted
        assert lines(far)[lines(far).index("PA100,") + 1] == "!"
        await asyncio.gather(*readings)
        await move


async def test_readings_do_not_wait_longer_than_an_answer_may_take() -> None:
    async with bench() as (drive, far):
        move = drive.prepare_move_to(100)
        await move.ready
        began = now()
        await drive.position()
        assert now() - began < drive.settings.answer_timeout_s + 0.1
        move.trigger()
        await move
        assert motions(far) == ["POSA 100.00"]


async def test_readings_go_on_at_once_when_a_prepared_move_is_given_up() -> None:
    async with bench() as (drive, far):
        move = drive.prepare_move_to(100)
        await move.ready
        move.cancel()
        began = now()
        await drive.position()
        assert now() - began < 0.1
        assert motions(far) == []
        assert "STOP" not in lines(far)
        await drive.move_to(3)


async def test_a_trigger_counts_once_and_only_for_a_move_that_is_ready() -> None:
    async with bench() as (drive, far):
        move = drive.prepare_move_to(100)
        with pytest.raises(MoveError, match="does not hold it ready"):
            move.trigger()
        await move.ready
        move.trigger()
        with pytest.raises(MoveError, match="has been triggered"):
            move.trigger()
        await move
        with pytest.raises(MoveError, match="has ended"):
            move.trigger()
        assert lines(far).count("!") == 1


async def test_while_a_move_is_prepared_the_drive_takes_no_other() -> None:
    async with bench() as (drive, _):
        move = drive.prepare_move_to(100)
        with pytest.raises(MoveActiveError):
            drive.move_to(1)
        with pytest.raises(MoveActiveError):
            drive.prepare_move_by(1)
        await move.stop()
        assert isinstance(await ending(move), MoveStoppedError)
        await drive.move_to(1)


async def test_leaving_the_block_forgets_a_prepared_move() -> None:
    async with bench() as (drive, far):
        move = drive.prepare_move_to(100)
        await move.ready
    assert isinstance(await ending(move), MoveStoppedError)
    await asyncio.sleep(5)
    assert motions(far) == []


async def test_what_cannot_be_said_is_refused_before_a_byte_is_sent() -> None:
    async with bench() as (drive, far):
        before = len(lines(far))
        with pytest.raises(InvalidCommandError):
            drive.prepare_move_to(float("nan"))
        with pytest.raises(InvalidCommandError):
            drive.prepare_move_to(1, timeout_s=-1)
        await asyncio.sleep(1)
        assert len(lines(far)) == before


async def test_a_drive_with_a_fault_stores_nothing() -> None:
    async with bench() as (drive, far):
        far.raise_fault(55)
        move = drive.prepare_move_to(100, comparators=[(10, 1)])
        error = await ending(move)
        assert isinstance(error, DriveFaultError)
        assert "forbids move_to(100)" in error.what
        assert error.code == 55
        assert isinstance(await ending(move.ready), DriveFaultError)
        assert "PA100," not in lines(far)
        await drive.quit()
        await drive.move_to(5)  # no point is left over


async def test_a_refused_store_is_told_and_nothing_is_triggered() -> None:
    async with scripted({"PA100,": "E90"}) as (drive, far):
        move = drive.prepare_move_to(100)
        assert isinstance(await ending(move.ready), CommandRejectedError)
        assert isinstance(await ending(move), CommandRejectedError)
        assert "!" not in far.lines


async def test_a_trigger_whose_answer_is_lost_is_not_repeated_and_the_status_decides() -> None:
    async with bench() as (drive, far):
        move = drive.prepare_move_to(100)
        await move.ready
        far.lose_answers = 1
        move.trigger()
        result = await move
        assert result.confirmed_by == "status"
        assert lines(far).count("!") == 1
        assert motions(far) == ["POSA 100.00"]


async def test_a_trigger_that_was_not_heard_moves_nothing_and_says_so() -> None:
    async with bench() as (drive, far):
        move = drive.prepare_move_to(100)
        await move.ready
        far.deaf = True
        move.trigger()
        await asyncio.sleep(0.5)
        far.deaf = False
        error = await ending(move)
        assert isinstance(error, AnswerTimeoutError)
        assert error.hint is not None
        assert "it was not taken" in error.hint
        assert motions(far) == []


async def test_the_budget_of_a_prepared_move_counts_from_its_trigger() -> None:
    async with bench() as (drive, far):
        move = drive.prepare_move_to(1000, timeout_s=2)
        await asyncio.sleep(50)
        assert not move.done()
        move.trigger()
        triggered = now()
        assert isinstance(await ending(move), MoveTimeoutError)
        assert 2 <= now() - triggered < 3
        assert not far.moving


async def test_a_drive_that_keeps_quiet_about_errors_is_not_trusted_to_have_stored() -> None:
    """It may have refused, and would then execute what it had stored before."""
    async with bench(error_style="prompt_only") as (drive, far):
        move = drive.prepare_move_to(100)
        await move.ready
        assert not any("," in line for line in lines(far))
        move.trigger()
        await move
        assert motions(far) == ["POSA 100.00"]


# Groups ---------------------------------------------------------------------------------------------------------------


async def test_a_group_stores_every_move_first_and_then_sends_only_triggers() -> None:
    async with bench("x") as (x, far_x), bench("y", answer_time_s=0.1) as (y, far_y), bench("z") as (z, far_z):
        move = DriveGroup(x=x, y=y, z=z).move_to(x=100, y=200, z=300, speed_percent=50)
        watching = asyncio.ensure_future(_keep_reading(x))
        await move.accepted
        far = (far_x, far_y, far_z)
        sent = [(entry.at, entry.text) for each in far for entry in each.log if entry.kind is LogKind.LINE]
        first_trigger = min(at for at, text in sent if text == "!")
        assert all(text == "!" for at, text in sent if at >= first_trigger and not text.startswith("S"))
        assert len({at for at, text in sent if text == "!"}) == 1
        for each in far:
            told = lines(each)
            assert told[told.index("!") - 1].endswith(",")
        await move
        watching.cancel()
        with suppress(asyncio.CancelledError):
            await watching


async def _keep_reading(drive: compax_aio.Drive) -> None:
    while True:
        await drive.position()


async def test_one_axis_that_has_a_fault_keeps_all_from_starting() -> None:
    async with bench("x") as (x, far_x), bench("y") as (y, far_y):
        far_y.raise_fault(20)
        move = DriveGroup(x=x, y=y).move_to(x=100, y=100, speed_percent=10)
        error = await ending(move)
        assert isinstance(error, DriveFaultError)
        assert error.device == "y"
        await asyncio.sleep(5)
        assert motions(far_x) == motions(far_y) == []


async def test_stopping_a_group_that_is_getting_ready_moves_nothing() -> None:
    async with bench("x") as (x, far_x), bench("y", answer_time_s=0.5) as (y, far_y):
        move = DriveGroup(x=x, y=y).move_to(x=100, y=100)
        await until(lambda: "PA100," in lines(far_x))
        await asyncio.gather(x.stop(), y.stop())
        assert isinstance(await ending(move), MoveStoppedError)
        await asyncio.sleep(5)
        assert motions(far_x) == motions(far_y) == []


async def test_cancelling_a_group_that_is_getting_ready_moves_nothing() -> None:
    async with bench("x") as (x, far_x), bench("y", answer_time_s=0.5) as (y, far_y):
        move = DriveGroup(x=x, y=y).move_to(x=100, y=100)
        await until(lambda: "PA100," in lines(far_x))
        move.cancel()
        await asyncio.sleep(5)
        assert motions(far_x) == motions(far_y) == []
        assert move.cancelled()


async def test_a_group_finds_machine_zero_together() -> None:
    async with bench("x") as (x, far_x), bench("y", answer_time_s=0.1) as (y, far_y):
        await DriveGroup(x=x, y=y).home()
        assert far_x.homed
        assert far_y.homed
        starts = [e.at for far in (far_x, far_y) for e in far.log if e.kind is LogKind.MOTION_STARTED]
        assert starts[1] - starts[0] == pytest.approx(0.1 - 0.002, abs=1e-6)  # each drive's own time for a line
        assert lines(far_x)[lines(far_x).index("!") - 1] == "PH,"
        assert drive_named("x").log.texts(LogKind.MOTION_STARTED) == ["POSA HOME 0.00"]


# What waits for ever otherwise, or would be told wrongly --------------------------------------------------------------


async def test_a_move_that_waits_for_its_trigger_learns_that_the_line_is_lost() -> None:
    async with bench() as (drive, _):
        move = drive.prepare_move_to(100)
        await move.ready
        drive._line.link._port.hang_up()
        assert isinstance(await ending(move), ConnectionLostError)


async def test_a_group_one_of_whose_moves_was_triggered_by_hand_still_starts() -> None:
    async with bench("x") as (x, far_x), bench("y", answer_time_s=0.1) as (y, far_y):
        move = DriveGroup(x=x, y=y).move_to(x=100, y=100)
        await move.moves["x"].ready
        move.moves["x"].trigger()
        results = await move
        assert [result.target for result in results.values()] == [100, 100]
        assert motions(far_x) == motions(far_y) == ["POSA 100.00"]


async def test_an_older_store_that_was_never_triggered_is_not_trusted_to_be_overwritten() -> None:
    async with bench() as (drive, far):
        old = drive.prepare_move_to(1000)
        await old.ready
        old.cancel()
        move = drive.prepare_move_to(100)
        await move.ready
        move.trigger()
        await move
        assert "!" not in lines(far)
        assert motions(far) == ["POSA 100.00"]


async def test_points_of_a_move_that_never_got_its_turn_are_not_counted() -> None:
    async with bench() as (drive, far):
        reading = asyncio.ensure_future(drive.torque())
        await received(far, "S5")
        move = drive.move_to(100, comparators=[(10, 1)])
        await asyncio.sleep(0)
        move.cancel()
        await reading
        await drive.move_to(50)
        assert motions(far) == ["POSA 50.00"]
