"""Who is on a line that came back, whether it was switched off meanwhile, and what that means for a move."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from types import SimpleNamespace
from typing import Any, cast

import pytest
from tests.promises.bench import ScriptedDrive, ending, lines, now, scripted, until
from tests.promises.cable import Cable

import compax_aio
from compax_aio import CompaxError, Drive, DriveSettings, MoveInDoubtError, MoveTimeoutError
from compax_aio.compax.events import ConnectionRestored
from compax_aio.compax.identity import has_power_on_mark
from compax_aio.compax.transfer import Transfer
from compax_aio.simulator.compax import Knobs, SimulatedDrive
from compax_aio.transports.loopback import listen

MARK = 98


@pytest.mark.parametrize(
    ("before", "after", "is_new"),
    [
        ((), (), False),
        ((), (MARK,), True),
        ((MARK, 55, 0), (MARK, 55, 0), False),
        ((MARK, 55, 0), (56, MARK, 55), False),
        ((MARK, 55, 0), (MARK, 56, MARK), True),
        ((55, 0, 0), (MARK, 55, 0), True),
        ((1, 2, 3), (56, MARK, 57), True),
    ],
)
def test_only_a_power_on_mark_that_was_not_there_before_is_a_sign(
    before: tuple[int, ...], after: tuple[int, ...], is_new: bool
) -> None:
    assert has_power_on_mark(before, after) is is_new


def test_a_speed_that_nobody_knows_is_not_known_again_by_a_restart() -> None:
    transfer = Transfer(cast("Any", SimpleNamespace(name="x", protocol=SimpleNamespace(encode=None))))
    transfer.note_taken("SD50")
    transfer.motion_was_lost("PA50")
    transfer.forget_taken()
    assert transfer.speed_is_unknown


async def test_a_line_that_is_not_opened_again_is_not_asked_who_is_there() -> None:
    async with scripted(settings=DriveSettings(reconnect=False)) as (_, far):
        assert not {"S31", "S18"} & set(far.lines)
    async with scripted() as (_, far):
        assert {"S31", "S39", "S18"} <= set(far.lines)


@asynccontextmanager
async def two_connections(
    first: dict[str, str | None], second: dict[str, str | None]
) -> AsyncIterator[tuple[Drive, ScriptedDrive, ScriptedDrive]]:
    """Connect, lose the line, and give both far ends 10 s later."""
    fars = [ScriptedDrive(first), ScriptedDrive(second)]
    waiting = iter(fars)
    with await listen("identity", lambda: next(waiting, fars[1])) as listener:
        drive = await compax_aio.connect(listener.url, name="x", settings=DriveSettings(answer_timeout_s=0.5))
        fars[0].transport.abort()
        await asyncio.sleep(10)
        try:
            yield drive, fars[0], fars[1]
        finally:
            with suppress(CompaxError):
                await drive.close()


async def test_a_drive_that_refuses_to_say_who_it_is_is_not_asked_again_and_never_another_one() -> None:
    async with two_connections({"S31": "\x07E15"}, {"S31": "S031: NEW"}) as (drive, first, second):
        assert "S31" in first.lines
        assert not {"S31", "S32"} & set(second.lines)
        assert drive.is_open


async def test_a_drive_that_did_not_answer_who_it_is_is_asked_again() -> None:
    async with two_connections({"S31": None}, {}) as (drive, first, second):
        assert "S31" in first.lines
        assert "S31" in second.lines
        assert drive.is_open


async def test_a_drive_that_says_no_more_who_it_is_is_another_one() -> None:
    async with two_connections({}, {"S31": "\x07E15"}) as (drive, _, _):
        assert not drive.is_open


async def test_a_search_for_machine_zero_that_was_only_begun_is_no_sign_of_a_restart() -> None:
    async with connected(homed=True, position=2000) as (drive, far, cable):
        await drive.reconcile()
        events = drive.events()
        await drive.home(on_cancel="detach").accepted
        await cable.pull()
        await cable.plug(far)
        while not isinstance(event := await anext(events), ConnectionRestored):
            pass
        assert event.signs_of_restart == ()


# Moves ----------------------------------------------------------------------------------------------------------------


@asynccontextmanager
async def connected(
    settings: DriveSettings | None = None, **knobs: Any
) -> AsyncIterator[tuple[Drive, SimulatedDrive, Cable]]:
    far, cable = SimulatedDrive(Knobs(**knobs), name="x"), Cable("identity")
    await cable.plug(far)
    drive = await compax_aio.connect(cable.url, name="x", settings=settings)
    try:
        yield drive, far, cable
    finally:
        with suppress(CompaxError):
            await drive.close()
        await cable.pull()


async def test_a_motion_whose_answer_was_lost_with_the_drives_power_is_not_told_as_not_taken() -> None:
    async with connected(answer_time_s=0.01) as (drive, far, cable):
        await drive.home()
        move = drive.move_to(50)
        await until(lambda: "PA50$" in lines(far), to_the_tick=True)
        await cable.pull()
        far.power_cycle()
        await cable.plug(far)
        error = await ending(move)
        assert isinstance(error, MoveInDoubtError), error
        assert "switched off and on" in str(error)


async def test_a_move_of_a_drive_that_was_switched_off_is_in_doubt_at_once_and_nothing_is_stopped() -> None:
    async with connected() as (drive, far, cable):
        await drive.home()
        move = drive.move_to(5000)
        await move.accepted
        await cable.pull()
        far.power_cycle()
        await cable.plug(far)
        error = await ending(move)
        assert isinstance(error, MoveInDoubtError), error
        assert "STOP" not in lines(far)


async def test_a_restart_is_told_with_one_return_of_the_line_and_not_with_the_next() -> None:
    async with connected() as (drive, far, cable):
        await drive.home()
        events = drive.events()
        told: list[bool] = []
        for _ in range(2):
            await cable.pull()
            if not told:
                far.power_cycle()
            await cable.plug(far)
            while not isinstance(event := await anext(events), ConnectionRestored):
                pass
            told.append(bool(event.signs_of_restart))
        assert told == [True, False]


async def test_a_restart_is_remembered_when_the_line_is_lost_again_before_the_move_was_looked_at() -> None:
    async with connected(answer_time_s=0.01) as (drive, far, cable):
        await drive.home()
        move = drive.move_to(5000)
        await move.accepted
        await asyncio.sleep(1)
        await cable.pull()
        far.power_cycle()
        await cable.plug(far)
        await until(lambda: drive.is_open, to_the_tick=True)
        await cable.pull()
        assert not move.done()
        await cable.plug(far)
        error = await ending(move)
        assert isinstance(error, MoveInDoubtError), error
        assert "switched off and on" in str(error)


async def test_a_move_whose_end_came_while_the_line_was_lost_leaves_no_message_to_wait_for() -> None:
    async with connected() as (drive, far, cable):
        move = drive.move_to(100)
        await move.accepted
        await cable.pull()
        await asyncio.sleep(8)
        await cable.plug(far)
        assert (await move).confirmed_by == "status"
        assert (await drive.move_to(200)).confirmed_by == "message"


RUNNING: dict[str, str | None] = {"S1": "S001: 5.00", "S16": "S016: 11010000", "S17": "S017: 00100010"}


@asynccontextmanager
async def running_move() -> AsyncIterator[tuple[Drive, compax_aio.Move, list[ScriptedDrive]]]:
    """Give a drive whose move runs and gets nowhere, and every far end that it connects to."""
    fars: list[ScriptedDrive] = []

    def far() -> ScriptedDrive:
        far = ScriptedDrive(RUNNING if fars else None)
        far.on_line = lambda line: far.answers.update({"S17": "S017: 00000010"}) if line == "STOP" else None
        fars.append(far)
        return far

    with await listen("running", far) as listener:
        drive = await compax_aio.connect(listener.url, name="x")
        move = drive.move_to(50)
        await move.accepted
        fars[0].answers |= RUNNING
        try:
            yield drive, move, fars
        finally:
            with suppress(CompaxError):
                await drive.close()


async def test_an_axis_has_its_time_anew_to_get_on_when_the_line_is_back() -> None:
    async with running_move() as (drive, move, fars):
        await asyncio.sleep(6)
        fars[0].transport.abort()
        await until(lambda: len(fars) > 1 and drive.is_open)
        back_at = now()
        assert isinstance(await ending(move), MoveTimeoutError)
        assert now() - back_at >= DriveSettings().stall_timeout_s - 0.1


async def test_a_move_is_looked_at_as_soon_as_the_line_is_back() -> None:
    async with running_move() as (drive, _, fars):
        await asyncio.sleep(5)
        looks = fars[0].lines.count("S1")
        await until(lambda: fars[0].lines.count("S1") > looks, to_the_tick=True)
        await asyncio.sleep(0.01)  # it has been looked at just now
        fars[0].transport.abort()
        await until(lambda: len(fars) > 1 and drive.is_open, to_the_tick=True)
        greeted = len(fars[1].lines)
        await asyncio.sleep(0.01)
        assert "S1" in fars[1].lines[greeted - 1 :]
