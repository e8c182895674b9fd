"""Stop is next: ahead of everything queued, repeated until acknowledged, over at standstill, and honest if it fails."""

from __future__ import annotations

import asyncio

import pytest
from tests.promises.bench import (
    bench,
    ending,
    is_moving,
    lines,
    motions,
    now,
    received,
    scripted,
    served_through,
    until,
)

import compax_aio
from compax_aio import (
    AnswerTimeoutError,
    CommandRejectedError,
    ConnectionLostError,
    DriveFaultError,
    DriveSettings,
    MoveInDoubtError,
    MoveStoppedError,
    MoveTimeoutError,
)
from compax_aio.compax.settings import Dialect
from compax_aio.simulator.compax import LogKind, SimulatedDrive

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


async def test_a_stop_returns_at_standstill_and_the_move_says_where() -> None:
    async with bench() as (drive, far):
        move = drive.move_to(1000)
        await asyncio.sleep(1)
        await drive.stop()
        assert not far.moving
        assert move.done()
        error = await ending(move)
        assert isinstance(error, MoveStoppedError)
        assert f"stopped at {far.position:.2f} units" in str(error)
        assert lines(far).count("STOP") == 1
        assert (await drive.status()).idle_after_stop
        await drive.move_to(0)
        assert far.position == 0


async def test_a_stop_waits_for_the_whole_stop_ramp() -> None:
    async with bench(stop_ramp_ms=5000) as (drive, far):
        move = drive.move_to(10_000)
        await asyncio.sleep(1)
        stopped_at = now()
        await move.stop()
        assert not far.moving
        assert now() - stopped_at > 4.9
        assert isinstance(await ending(move), MoveStoppedError)


async def test_a_stop_is_written_before_it_waits() -> None:
    async with bench() as (drive, _):
        move = drive.move_to(1000)
        await move.accepted
        before = drive.stats.bytes_sent
        stopping = drive.stop()
        stopping.send(None)
        assert drive.stats.bytes_sent - before == len("STOP\r")
        stopping.close()
        # Nobody waits for it, and it is carried through all the same.
        assert isinstance(await ending(move), MoveStoppedError)


async def test_a_stop_goes_before_a_thousand_queued_reads() -> None:
    async with bench(baudrate=9600) as (drive, far):
        move = drive.move_to(10_000)
        await move.accepted
        texts = [f"{kind}{number}" for kind in "SPVN" for number in range(1, 251)]
        reads = [asyncio.ensure_future(drive.query(text)) for text in texts]
        await received(far, "S5")
        received_before = len(lines(far))
        asked_at = now()
        await drive.stop()
        # One line was at work already; STOP is the very next.
        assert lines(far)[received_before] == "STOP"
        at = next(entry.at for entry in far.log if entry.text == "STOP")
        # What was left of the exchange in flight, and the five characters themselves.
        assert at - asked_at < 0.03 + 5 * 10 / 9600
        assert not far.moving
        assert len(lines(far)) < received_before + 10
        answers = await asyncio.gather(*reads, return_exceptions=True)
        assert all(
            str(answer).startswith(f"S{number:03d}: ") or isinstance(answer, CommandRejectedError)
            for number, answer in enumerate(answers[:250], 1)
        )
        assert isinstance(await ending(move), MoveStoppedError)


async def test_two_stops_at_once_are_one() -> None:
    async with bench() as (drive, far):
        move = drive.move_to(1000)
        await asyncio.sleep(1)
        await asyncio.gather(drive.stop(), move.stop(), drive.stop())
        assert lines(far).count("STOP") == 1
        assert isinstance(await ending(move), MoveStoppedError)


async def test_a_stop_of_a_drive_that_stands_is_harmless() -> None:
    async with bench() as (drive, far):
        await drive.stop()
        await drive.stop()
        assert lines(far).count("STOP") == 2
        await drive.move_to(10)


async def test_the_stop_of_a_move_that_has_ended_stops_nobody_elses() -> None:
    async with bench() as (drive, far):
        first = drive.move_to(10)
        await first
        second = drive.move_to(100)
        await first.stop()
        assert (await second).target == 100
        assert "STOP" not in lines(far)


async def test_a_move_that_is_stopped_at_its_target_has_reached_it() -> None:
    async with bench() as (drive, far):
        far.lose_position_reached = 1
        move = drive.move_to(10)
        await until(lambda: bool(far.log.texts(LogKind.MOTION_REACHED)))
        await drive.stop()
        result = await move
        assert result.confirmed_by == "status"
        assert result.last_position == 10


@pytest.mark.parametrize("at", ["S2", "SD50", "PR5 OT O1=1"])
async def test_a_stop_during_the_preparation_keeps_the_motion_from_being_sent(at: str) -> None:
    async with bench() as (drive, far):
        move = drive.move_by(10, speed_percent=50, comparators=[(5, 1)])
        await received(far, at)
        await drive.stop()
        error = await ending(move)
        assert isinstance(error, MoveStoppedError)
        assert "before it was sent" in str(error)
        with pytest.raises(MoveStoppedError):
            await move.accepted
        await asyncio.sleep(2)
        assert motions(far) == []


async def test_a_new_move_waits_for_the_standstill_and_then_runs() -> None:
    async with bench(stop_ramp_ms=2000) as (drive, far):
        first = drive.move_to(2000)
        await asyncio.sleep(1)
        first.cancel()
        second = drive.move_to(0)
        assert (await second).target == far.position == 0
        assert first.cancelled()
        entries = [entry for entry in far.log if entry.kind.startswith("motion")]
        assert [entry.kind for entry in entries] == [
            LogKind.MOTION_STARTED, LogKind.MOTION_STOPPED, LogKind.MOTION_STARTED, LogKind.MOTION_REACHED,
        ]  # fmt: skip


async def test_a_stop_while_a_new_move_waits_withdraws_it() -> None:
    async with bench(stop_ramp_ms=2000) as (drive, far):
        first = drive.move_to(2000)
        await asyncio.sleep(1)
        first.cancel()
        second = drive.move_to(0)
        await asyncio.sleep(0.1)
        await drive.stop()
        assert isinstance(await ending(second), MoveStoppedError)
        assert not far.moving
        await asyncio.sleep(5)
        assert len(motions(far)) == 1


async def test_a_stop_whose_caller_is_cancelled_is_carried_through() -> None:
    async with bench(stop_ramp_ms=2000) as (drive, far):
        move = drive.move_to(2000)
        await asyncio.sleep(1)
        stopping = asyncio.ensure_future(drive.stop())
        await asyncio.sleep(0.1)
        stopping.cancel()
        assert isinstance(await ending(move), MoveStoppedError)
        assert stopping.cancelled()
        assert not far.moving


async def test_a_stop_that_is_not_heard_at_first_is_repeated() -> None:
    async with bench() as (drive, far):
        move = drive.move_to(10_000)
        await asyncio.sleep(1)
        far.deaf = True
        stopping = asyncio.ensure_future(drive.stop())
        await asyncio.sleep(4)
        assert is_moving(far)
        assert not stopping.done()
        far.deaf = False
        await stopping
        assert not is_moving(far)
        assert isinstance(await ending(move), MoveStoppedError)


async def test_a_stop_whose_acknowledgement_is_lost_is_repeated() -> None:
    async with bench() as (drive, far):
        move = drive.move_to(10_000)
        await asyncio.sleep(1)
        stopping = asyncio.ensure_future(drive.stop())
        await received(far, "STOP")
        far.lose_answers = 1
        await stopping
        assert lines(far).count("STOP") == 2
        assert isinstance(await ending(move), MoveStoppedError)


async def test_a_stop_is_not_spoilt_by_half_a_line_in_the_drives_buffer() -> None:
    cuts: list[bytes] = []

    def cut(data: bytes) -> bytes:
        if data == b"S5\r":
            cuts.append(data)
            return b"S5"
        return data

    far = SimulatedDrive()
    async with served_through(far, "bad", cut) as url, compax_aio.connect(url, name="x") as drive:
        move = drive.move_to(10_000)
        await asyncio.sleep(1)
        reading = asyncio.ensure_future(drive.torque())
        await until(lambda: bool(cuts))
        await drive.stop()
        assert "S5STOP" in lines(far)
        assert lines(far).count("STOP") >= 1
        assert not far.moving
        assert isinstance(await ending(reading), AnswerTimeoutError)
        assert isinstance(await ending(move), MoveStoppedError)


async def test_a_stop_in_doubt_goes_ahead_of_getting_in_step() -> None:
    async with bench() as (drive, far):
        move = drive.move_to(10_000)
        await asyncio.sleep(1)
        far.silent = True
        await until(lambda: drive.stats.timeouts == 1)
        stopping = asyncio.ensure_future(drive.stop())
        await until(lambda: "STOP" in lines(far))
        await until(lambda: not far.moving)
        # One marker was under way; the stop came right after it.
        assert now() < 4
        assert not stopping.done()
        far.silent = False
        await stopping
        assert isinstance(await ending(move), MoveStoppedError)


async def test_a_stop_that_is_never_acknowledged_says_so_and_no_motion_is_sent_any_more() -> None:
    async with bench(settings=DriveSettings(stop_timeout_s=5)) as (drive, far):
        move = drive.move_to(10_000)
        await asyncio.sleep(1)
        far.silent = True
        begun_at = now()
        error = await ending(drive.stop())
        assert isinstance(error, AnswerTimeoutError)
        assert "STOP was not acknowledged" in str(error)
        assert "emergency stop" in str(error)
        assert 5 <= now() - begun_at < 12
        assert lines(far).count("STOP") > 1
        assert isinstance(await ending(move), MoveInDoubtError)
        with pytest.raises(MoveInDoubtError, match="a stop failed"):
            drive.move_to(5)
        far.silent = False
        await drive.reconcile()
        await drive.move_to(5)
        assert len(motions(far)) == 2


async def test_a_word_for_stop_that_the_drive_does_not_know_is_told() -> None:
    settings = DriveSettings(stop_timeout_s=3, dialect=Dialect(stop="HALT"))
    async with bench(settings=settings) as (drive, far):
        await drive.stop()  # nothing moves: nothing to complain about
        move = drive.move_to(2000)
        await asyncio.sleep(1)
        error = await ending(drive.stop())
        assert isinstance(error, CommandRejectedError)
        assert error.sent == "HALT"
        assert "Dialect" in str(error) or "dialect" in str(error)
        assert far.moving
        in_doubt = await ending(move)
        assert isinstance(in_doubt, MoveInDoubtError)
        assert in_doubt.__cause__ is error
        with pytest.raises(MoveInDoubtError):
            drive.move_to(5)
        await until(lambda: not far.moving)
        await drive.reconcile()
        await drive.move_to(5)


async def test_an_axis_that_does_not_come_to_rest_after_an_acknowledged_stop_is_told() -> None:
    async with scripted({"S17": "S017: 00100010"}, settings=DriveSettings(standstill_timeout_s=2)) as (drive, far):
        move = drive.move_to(10)
        await move.accepted
        begun_at = now()
        error = await ending(drive.stop())
        assert isinstance(error, MoveTimeoutError)
        assert "still active, at 0.00 units" in str(error)
        assert 2 <= now() - begun_at < 3
        assert isinstance(await ending(move), MoveInDoubtError)
        far.answers["S17"] = "S017: 00000010"
        await drive.reconcile()


async def test_a_line_that_is_lost_during_a_stop_leaves_the_move_in_doubt() -> None:
    far = SimulatedDrive()
    async with served_through(far, "bad", bytes) as url:
        drive = await compax_aio.connect(url, name="x", settings=DriveSettings(reconnect=False))
        move = drive.move_to(10_000)
        await asyncio.sleep(1)
        far.deaf = True
        stopping = asyncio.ensure_future(drive.stop())
        await asyncio.sleep(0.1)
    assert isinstance(await ending(stopping), ConnectionLostError)
    assert isinstance(await ending(move), MoveInDoubtError)
    assert isinstance(await ending(drive.stop()), ConnectionLostError)
    await drive.close()


async def test_a_fault_found_when_stopping_is_told() -> None:
    async with bench() as (drive, far):
        move = drive.move_to(1000)
        await asyncio.sleep(1)
        far.raise_fault(10)
        await drive.stop()
        error = await ending(move)
        assert isinstance(error, DriveFaultError)
        assert error.code == 10


async def test_leaving_the_block_stops_what_was_started() -> None:
    async with bench() as (drive, far):
        move = drive.move_to(10_000)
        await asyncio.sleep(1)
    assert not far.moving
    assert isinstance(await ending(move), MoveStoppedError)
    assert far.log[-1].kind is LogKind.DISCONNECTED
    assert not drive.is_open


@pytest.mark.parametrize("line", ["PA10000", "POSA 10000", "P A10000", "posr 10000", "PR10000", "PH", "POSA HOME"])
async def test_leaving_the_block_stops_a_motion_that_was_started_by_a_plain_line(line: str) -> None:
    async with bench(position=9000, machine_zero=-9000) as (drive, far):
        await drive.command(line)
        assert is_moving(far)
    assert not is_moving(far)
    assert lines(far).count("STOP") == 1


async def test_leaving_the_block_does_not_stop_what_was_not_started_here() -> None:
    async with bench() as (drive, far):
        await drive.command("SD50")
        await drive.command("PR100 SD20")
        await drive.command("PR100 OT O1=1")
        await drive.move_to(10)
    assert "STOP" not in lines(far)


async def test_leaving_the_block_before_the_motion_was_sent_sends_nothing() -> None:
    async with bench() as (drive, far):
        move = drive.move_to(10, speed_percent=5)
    assert isinstance(await ending(move), MoveStoppedError)
    await asyncio.sleep(2)
    assert motions(far) == []


async def test_leaving_the_block_lets_a_detached_move_go_on() -> None:
    async with bench() as (drive, far):
        move = drive.move_to(1000, on_cancel="detach")
        await move.accepted
    error = await ending(move)
    assert isinstance(error, ConnectionLostError)
    assert "goes on unwatched" in str(error)
    assert "STOP" not in lines(far)
    await until(lambda: not far.moving)
    assert far.position == 1000


async def test_leaving_the_block_fails_if_the_axis_may_not_have_stopped() -> None:
    with pytest.raises(AnswerTimeoutError, match="STOP was not acknowledged"):  # noqa: PT012  # the block is tested
        async with bench(settings=DriveSettings(stop_timeout_s=3)) as (drive, far):
            move = drive.move_to(1000)
            await asyncio.sleep(1)
            far.deaf = True
    assert isinstance(await ending(move), MoveInDoubtError)
    assert not drive.is_open
    await until(lambda: not far.moving)
