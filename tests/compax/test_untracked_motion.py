"""Motions that nobody watches: raw commands and programs are stopped, taken back and told apart from what was sent."""

from __future__ import annotations

import asyncio
import gc

import pytest
from tests.promises.bench import bench, ending, is_moving, lines, motions, received, scripted

from compax_aio import (
    AnswerTimeoutError,
    CommandRejectedError,
    CompaxError,
    Dialect,
    Drive,
    DriveSettings,
    InvalidCommandError,
    MoveActiveError,
    MoveInDoubtError,
    MoveStoppedError,
)
from compax_aio.compax.events import Fault
from compax_aio.simulator.compax import SimulatedDrive

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


async def keep_the_line_busy(drive: Drive, far: SimulatedDrive) -> asyncio.Task[float]:
    reading = asyncio.ensure_future(drive.torque())
    await received(far, "S5")
    return reading


@pytest.mark.parametrize("line", ["PA1000", "START"])
async def test_a_motion_that_waits_for_its_turn_is_taken_back_by_a_stop(line: str) -> None:
    async with bench() as (drive, far):
        far.load_program(["POSA 1000", "END"])
        reading = await keep_the_line_busy(drive, far)
        telling = asyncio.ensure_future(drive.command(line))
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        await drive.stop()
        error = await ending(telling)
        assert isinstance(error, MoveStoppedError)
        assert "before it was sent" in error.what
        await reading
        await asyncio.sleep(10)
        assert motions(far) == []
        assert line not in lines(far)


async def test_a_motion_that_waits_for_its_turn_is_not_sent_when_the_block_is_left() -> None:
    async with bench() as (drive, far):
        reading = await keep_the_line_busy(drive, far)
        telling = asyncio.ensure_future(drive.command("PA1000"))
        await asyncio.sleep(0)
        await asyncio.sleep(0)
    assert isinstance(await ending(telling), MoveStoppedError)
    await asyncio.gather(reading, return_exceptions=True)
    assert motions(far) == []


async def test_a_motion_told_during_a_stop_comes_after_it() -> None:
    async with bench() as (drive, far):
        await drive.command("PA1000")
        await asyncio.sleep(1)
        stopping = asyncio.ensure_future(drive.stop())
        await asyncio.sleep(0)
        await drive.command("PA0")
        assert stopping.done()
        assert motions(far) == ["POSA 1000.00", "POSA 0.00"]
        assert lines(far).index("STOP") < lines(far).index("PA0")


async def test_cancelling_who_tells_a_motion_before_it_is_written_keeps_it_from_being_sent() -> None:
    async with bench() as (drive, far):
        reading = await keep_the_line_busy(drive, far)
        telling = asyncio.ensure_future(drive.command("PA1000"))
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        telling.cancel()
        with pytest.raises(asyncio.CancelledError):
            await telling
        await reading
        await asyncio.sleep(1)
        assert motions(far) == []
        await drive.stop()  # nothing is left to be taken back


async def test_leaving_the_block_stops_a_motion_that_nobody_watches() -> None:
    async with bench() as (drive, far):
        await drive.command("PA1000")
        await asyncio.sleep(1)
        assert is_moving(far)
    assert not is_moving(far)
    assert "STOP" in lines(far)


async def test_after_a_program_that_has_ended_the_block_is_left_without_a_stop() -> None:
    async with bench() as (drive, far):
        far.load_program(["POSA 10", "END"])
        await drive.program.start(1)
        await drive.program.wait_finished()
    assert "STOP" not in lines(far)
    assert motions(far) == ["POSA 10.00"]


async def test_a_stop_between_pointer_and_start_keeps_the_program_from_starting() -> None:
    async with bench(answer_time_s=0.05) as (drive, far):
        far.load_program(["POSA 1000", "END"])
        starting = asyncio.ensure_future(drive.program.start(1))
        await received(far, "GOTO 1")
        await drive.stop()
        assert isinstance(await ending(starting), MoveStoppedError)
        await asyncio.sleep(5)
        assert "START" not in lines(far)
        assert motions(far) == []


async def test_a_start_that_is_in_doubt_lets_nothing_move_until_somebody_has_looked() -> None:
    async with bench() as (drive, far):
        far.load_program(["POSA 1000", "END"])
        starting = asyncio.ensure_future(drive.program.start(1))
        await received(far, "START")
        far.silent = True
        assert isinstance(await ending(starting), MoveInDoubtError)
        with pytest.raises(MoveInDoubtError):
            drive.move_to(0)
        far.silent = False
        await drive.stop()
        await drive.reconcile()
        await drive.move_to(0)
        assert lines(far).count("START") == 1


async def test_while_a_move_runs_no_motion_is_told() -> None:
    async with bench() as (drive, far):
        move = drive.move_to(1000)
        await move.accepted
        with pytest.raises(MoveActiveError):
            await drive.command("PA0")
        assert "PA0" not in lines(far)
        await move.stop()
        assert isinstance(await ending(move), MoveStoppedError)


async def test_a_fault_is_told_even_if_who_noticed_it_first_was_cancelled() -> None:
    async with bench() as (drive, far):
        events = drive.events()
        far.raise_fault(55)
        looking = asyncio.ensure_future(drive.status())
        await received(far, "S30")
        looking.cancel()
        with pytest.raises(asyncio.CancelledError):
            await looking
        await drive.status()
        told = await anext(events)
        assert isinstance(told, Fault)
        assert told.error is not None
        assert told.error.code == 55


@pytest.mark.parametrize("how", ["status", "S16", "error"])
async def test_a_fault_that_any_reading_shows_becomes_one_event(how: str) -> None:
    async with bench() as (drive, far):
        events = drive.events()
        readings = {"status": drive.status, "S16": lambda: drive.read_status(16), "error": drive.error}
        await readings[how]()
        far.raise_fault(20)
        await readings[how]()
        await readings[how]()
        await drive.status()
        told = await anext(events)
        assert isinstance(told, Fault)
        assert told.error is not None
        assert told.error.code == 20
    assert [event async for event in events] == []


async def test_a_stop_takes_back_all_that_wait_not_only_the_last() -> None:
    async with bench() as (drive, far):
        reading = await keep_the_line_busy(drive, far)
        telling = [asyncio.ensure_future(drive.command(line)) for line in ("PA1000", "PA900")]
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        await drive.stop()
        for each in telling:
            assert isinstance(await ending(each), MoveStoppedError)
        await reading
        assert motions(far) == []


async def test_a_motion_told_while_an_older_one_is_waited_for_is_stopped_when_the_block_is_left() -> None:
    async with bench() as (drive, far):
        far.load_program(["POSA 10", "END"])
        await drive.program.start(1)
        waiting = asyncio.ensure_future(drive.program.wait_finished())
        await asyncio.sleep(0.3)
        telling = asyncio.ensure_future(drive.command("PA1000"))
        await asyncio.gather(waiting, telling, return_exceptions=True)
    assert not is_moving(far)


async def test_a_program_that_waits_is_still_stopped_after_somebody_has_looked() -> None:
    async with bench() as (drive, far):
        far.load_program(["WAIT 5000", "POSA 1000", "END"])
        await drive.program.start(1)
        await drive.reconcile()
    await asyncio.sleep(20)
    assert motions(far) == []


async def test_a_motion_nobody_watches_is_stopped_even_if_a_move_behind_it_was_never_sent() -> None:
    async with bench() as (drive, far):
        await drive.command("PA1000")
        reading = await keep_the_line_busy(drive, far)
        move = drive.move_to(5)
        await asyncio.sleep(0)
    assert isinstance(await ending(move), MoveStoppedError)
    await asyncio.gather(reading, return_exceptions=True)
    assert not is_moving(far)


async def test_another_speed_that_waits_for_its_turn_is_taken_back_by_a_stop() -> None:
    async with bench() as (drive, far):
        move = drive.move_to(1000)
        await move.accepted
        await asyncio.sleep(1)
        reading = await keep_the_line_busy(drive, far)
        changing = asyncio.ensure_future(move.change_speed(30))
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        await drive.stop()
        assert isinstance(await ending(changing), MoveStoppedError)
        assert isinstance(await ending(move), MoveStoppedError)
        await reading
        assert not any(line.startswith("PR0") for line in lines(far))


async def test_words_of_the_dialect_that_start_a_motion_are_motions() -> None:
    dialect = Dialect(start="RUN", home="HM", single_record="DO {n}")
    for line in ("RUN", "HM", "DO 7", "do7"):
        async with scripted(settings=DriveSettings(dialect=dialect)) as (drive, far):
            await drive.command(line)
            with pytest.raises(InvalidCommandError):
                await drive.query(line)
        assert far.lines.count("STOP") == 1


async def _just_wait(accepted: asyncio.Future[None]) -> None:
    await accepted


async def _wait_for(accepted: asyncio.Future[None]) -> None:
    await asyncio.wait_for(accepted, 5)


async def _gather(accepted: asyncio.Future[None]) -> None:
    await asyncio.gather(accepted)


@pytest.mark.parametrize("how", ["before", "after", "wait_for", "gather"])
async def test_who_awaits_the_acceptance_of_a_refused_move_has_learnt_its_error(
    how: str, caplog: pytest.LogCaptureFixture
) -> None:
    async with scripted({"PA10$": "E90"}) as (drive, _):
        move = drive.move_to(10)
        if how == "after":
            await asyncio.sleep(5)
        wait = {"wait_for": _wait_for, "gather": _gather}.get(how, _just_wait)
        with pytest.raises(CommandRejectedError):
            await wait(move.accepted)
        del move
        gc.collect()
    assert "never retrieved" not in caplog.text


async def test_a_move_whose_error_nobody_has_learnt_is_complained_about(caplog: pytest.LogCaptureFixture) -> None:
    asyncio.get_running_loop().set_exception_handler(None)
    async with scripted() as (drive, far):
        move = drive.move_to(10)
        await move.accepted  # which went well
        far.answers["S16"] = "S016: 01010000"
        await asyncio.sleep(5)
        assert move.done()
        del move
        gc.collect()
    assert "never retrieved" in caplog.text


async def test_after_a_motion_of_which_nobody_knows_what_became_no_other_is_taken_until_reconciled() -> None:
    async with bench() as (drive, far):
        far.lose_answers = 1
        error = await ending(drive.command("PA100"))
        assert isinstance(error, AnswerTimeoutError)
        assert "reconcile()" in str(error)
        with pytest.raises(MoveInDoubtError, match="'PA100' is unknown"):
            drive.move_to(5)
        assert isinstance(await ending(drive.command("PA7")), MoveInDoubtError)
        await drive.reconcile()
        await drive.stop()
        await drive.move_to(5)
        assert motions(far) == ["POSA 100.00", "POSA 5.00"]


async def test_a_motion_that_was_never_written_leaves_no_doubt() -> None:
    async with bench(settings=DriveSettings(answer_timeout_s=0.2)) as (drive, far):
        far.deaf = True
        reading, telling = asyncio.ensure_future(drive.position()), asyncio.ensure_future(drive.command("PA100"))
        assert isinstance(await ending(reading), CompaxError)
        assert isinstance(await ending(telling), CompaxError)
        far.deaf = False
        await drive.move_to(5)
        assert motions(far) == ["POSA 5.00"]
