"""A line that is lost comes back, and nothing is lost, doubled or made up on the way (P2, P3, P10)."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable
from typing import Any

import pytest

import compax_aio
from compax_aio import (
    AnswerTimeoutError,
    ConnectionLostError,
    DriveFaultError,
    DriveSettings,
    MoveInDoubtError,
    MoveStoppedError,
    UnexpectedAnswerError,
)
from compax_aio.compax.events import ConnectionLost, ConnectionRestored, DriveEvent, MoveAccepted, MoveEnded
from compax_aio.simulator.compax import SimulatedDrive

from .bench import ending, lines, motions, now, until
from .cable import Cable, connected, outage

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


async def seen(events: AsyncIterator[DriveEvent], count: int) -> list[DriveEvent]:
    return [await anext(events) for _ in range(count)]


async def took(work: Awaitable[Any]) -> float:
    begun_at = now()
    await work
    return now() - begun_at


# Moves ----------------------------------------------------------------------------------------------------------------


async def test_a_move_survives_a_pulled_cable_and_is_said_once() -> None:
    async with connected() as (drive, far, cable):
        move = drive.move_to(1000)
        await move.accepted
        await asyncio.sleep(1)
        await outage(cable, far, 2)
        assert not move.done()
        result = await move
        assert result.target == 1000
        assert far.position == 1000
        assert motions(far) == ["POSA 1000.00"]
        assert lines(far).count("PA1000$") == 1


async def test_a_move_that_ended_while_the_line_was_lost_is_told_as_reached() -> None:
    async with connected() as (drive, far, cable):
        move = drive.move_to(100)
        await move.accepted
        await outage(cable, far, 8)
        back_at = now()
        result = await move
        assert result.confirmed_by == "status"
        assert now() - back_at < 6


async def test_a_position_reached_message_that_comes_after_the_line_is_back_ends_the_move() -> None:
    async with connected() as (drive, far, cable):
        move = drive.move_to(2000)
        await move.accepted
        await outage(cable, far, 1)
        assert (await move).confirmed_by == "message"


@pytest.mark.parametrize("milliseconds", range(12))
async def test_a_line_that_is_lost_while_the_motion_is_said_never_moves_twice_and_the_fate_is_true(
    milliseconds: int,
) -> None:
    async with connected(answer_time_s=0.005) as (drive, far, cable):
        move = drive.move_to(50, speed_percent=100)
        await asyncio.sleep(milliseconds / 1000)
        await outage(cable, far, 1)
        outcome = (await asyncio.gather(move, return_exceptions=True))[0]
        begun = motions(far)
        if isinstance(outcome, ConnectionLostError):
            assert begun == []
            assert far.position == 0
        else:
            assert isinstance(outcome, compax_aio.MoveResult), outcome
            assert begun == ["POSA 50.00"]
            assert far.position == 50
        assert lines(far).count("PA50$") <= 1


async def test_a_move_that_was_stopped_by_others_while_the_line_was_lost_is_told_so() -> None:
    async with connected() as (drive, far, cable):
        move = drive.move_to(5000)
        await move.accepted
        await cable.pull()
        far.receive(b"STOP\r", now())
        await asyncio.sleep(1)
        await cable.plug(far)
        assert isinstance(await ending(move), MoveStoppedError)


async def test_a_fault_that_came_while_the_line_was_lost_is_told() -> None:
    async with connected() as (drive, far, cable):
        move = drive.move_to(5000)
        await move.accepted
        await cable.pull()
        far.raise_fault(55)
        await asyncio.sleep(1)
        await cable.plug(far)
        error = await ending(move)
        assert isinstance(error, DriveFaultError)
        assert error.code == 55


async def test_a_move_whose_line_stays_lost_is_in_doubt_and_motion_is_refused_until_reconciled() -> None:
    async with connected(DriveSettings(in_doubt_after_s=10)) as (drive, far, cable):
        move = drive.move_to(500)
        await move.accepted
        await cable.pull()
        lost_at = now()
        error = await ending(move)
        assert isinstance(error, MoveInDoubtError)
        assert 10 <= now() - lost_at < 11
        assert error.sent == "PA500$"
        assert isinstance(error.__cause__, ConnectionLostError)
        await cable.plug(far)
        await until(lambda: drive.is_open)
        with pytest.raises(MoveInDoubtError):
            drive.move_to(1)
        await drive.reconcile()
        await drive.move_to(1)
        assert motions(far) == ["POSA 500.00", "POSA 1.00"]


async def test_a_move_that_is_commanded_while_the_line_is_lost_is_never_sent() -> None:
    async with connected() as (drive, far, cable):
        await cable.pull()
        error = await ending(drive.move_to(5))
        assert isinstance(error, ConnectionLostError)
        assert "'PA5$' was not sent" in str(error)
        await cable.plug(far)
        await drive.position()
        assert motions(far) == []
        await drive.move_to(5)
        assert motions(far) == ["POSA 5.00"]


async def test_a_move_that_is_held_ready_when_the_line_is_lost_is_never_started() -> None:
    async with connected() as (drive, far, cable):
        move = drive.prepare_move_to(5)
        await move.ready
        await outage(cable, far, 1)
        assert isinstance(await ending(move), ConnectionLostError)
        await drive.position()
        assert motions(far) == []
        await drive.move_to(7)
        assert motions(far) == ["POSA 7.00"]


# Stopping -------------------------------------------------------------------------------------------------------------


async def test_a_stop_waits_for_the_line_and_goes_before_everything_when_it_is_back() -> None:
    async with connected() as (drive, far, cable):
        move = drive.move_to(5000)
        await move.accepted
        await cable.pull()
        stopping = asyncio.ensure_future(drive.stop())
        reading = asyncio.ensure_future(drive.position())
        await asyncio.sleep(1)
        before = len(lines(far))
        await cable.plug(far)
        await stopping
        assert lines(far)[before] == "STOP"
        assert not far.moving
        await reading
        assert isinstance(await ending(move), MoveStoppedError)


async def test_a_stop_that_cannot_be_said_tells_so_in_time_and_is_not_said_later() -> None:
    async with connected(DriveSettings(stop_timeout_s=5)) as (drive, far, cable):
        move = drive.move_to(10_000)
        await move.accepted
        await cable.pull()
        begun_at = now()
        error = await ending(drive.stop())
        assert isinstance(error, ConnectionLostError)
        assert "STOP was not acknowledged" in str(error)
        assert 5 <= now() - begun_at < 5.1
        assert isinstance(await ending(move), MoveInDoubtError)
        await cable.plug(far)
        await drive.reconcile()
        assert "STOP" not in lines(far)
        await drive.stop()


async def test_leaving_the_block_stops_an_axis_whose_line_comes_back_in_time() -> None:
    async with connected() as (drive, far, cable):
        move = drive.move_to(10_000)
        await move.accepted
        await cable.pull()
        closing = asyncio.ensure_future(drive.close())
        await asyncio.sleep(2)
        await cable.plug(far)
        await closing
        assert not far.moving
        assert isinstance(await ending(move), MoveStoppedError)


async def test_leaving_the_block_says_when_the_axis_may_go_on() -> None:
    far, cable = SimulatedDrive(), Cable()
    await cable.plug(far)
    drive = await compax_aio.connect(cable.url, name="x", settings=DriveSettings(stop_timeout_s=3))
    move = drive.move_to(10_000)
    await move.accepted
    await cable.pull()
    begun_at = now()
    error = await ending(drive.close())
    assert isinstance(error, ConnectionLostError)
    assert now() - begun_at < 4
    assert isinstance(await ending(move), MoveInDoubtError)
    assert far.moving


# Queries and writes ---------------------------------------------------------------------------------------------------


async def test_queries_wait_for_the_line_and_writes_fail_at_once() -> None:
    async with connected() as (drive, far, cable):
        far_answers = [drive.position(), drive.status(), drive.read_status(6)]
        reading = asyncio.gather(*far_answers)
        writing = asyncio.ensure_future(drive.variables.write(1, 3))
        await asyncio.sleep(0.001)
        await cable.pull()
        error = await ending(writing)
        assert isinstance(error, ConnectionLostError)
        later = asyncio.ensure_future(drive.target())
        await asyncio.sleep(1)
        assert not reading.done()
        await cable.plug(far)
        await reading
        await later
        assert lines(far).count("V1=3") <= 1


async def test_a_query_waits_for_a_lost_line_only_so_long_and_those_that_come_later_for_one_attempt() -> None:
    async with connected(DriveSettings(in_doubt_after_s=7)) as (drive, far, cable):
        await cable.pull()
        lost_at = now()
        assert isinstance(await ending(drive.position()), ConnectionLostError)
        assert now() - lost_at == pytest.approx(7)
        for _ in range(3):
            assert await took(ending(drive.position())) <= 5
        reading = asyncio.ensure_future(drive.position())
        await cable.plug(far)
        assert await reading == 0


async def test_a_watcher_goes_on_when_the_line_is_back_and_no_value_is_made_up_meanwhile() -> None:
    async with connected(DriveSettings(in_doubt_after_s=5), position=3) as (drive, far, cable):
        watch = drive.watch("position", interval_s=0.5)
        assert (await anext(watch))["position"] == 3
        await cable.pull()
        await asyncio.sleep(20)
        assert not (await anext(watch)).values
        await cable.plug(far)
        await until(lambda: drive.is_open)
        while not (reading := await anext(watch)).values:
            pass
        assert reading["position"] == 3
        watch.close()


# Events and attempts --------------------------------------------------------------------------------------------------


async def test_loss_and_return_are_told_with_how_long_it_took() -> None:
    async with connected() as (drive, far, cable):
        events = drive.events()
        await outage(cable, far, 3)
        lost, restored = await seen(events, 2)
        assert isinstance(lost, ConnectionLost)
        assert isinstance(restored, ConnectionRestored)
        assert restored.lost_for_s == pytest.approx(restored.at - lost.at)
        assert 3 <= restored.lost_for_s < 8
        assert restored.attempts >= 2
        assert restored.signs_of_restart == ()
        assert drive.stats.reconnects == 1


async def test_attempts_come_ever_more_rarely_and_never_end() -> None:
    async with connected() as (drive, far, cable):
        events = drive.events()
        await outage(cable, far, 900)
        restored = (await seen(events, 2))[1]
        assert isinstance(restored, ConnectionRestored)
        assert 900 / 5 <= restored.attempts <= 900 / 2.5 + 5


async def test_a_limited_number_of_attempts_ends_all_that_waits() -> None:
    async with connected(DriveSettings(reconnect_attempts=3)) as (drive, far, cable):
        events, watch = drive.events(), drive.watch("position")
        await anext(watch)
        move = drive.move_to(10_000)
        await move.accepted
        await cable.pull()
        assert isinstance(await ending(move), ConnectionLostError)
        assert isinstance(await ending(anext(watch)), ConnectionLostError)
        assert [type(event) for event in await seen(events, 4)] == [
            MoveAccepted, ConnectionLost, ConnectionLost, MoveEnded
        ]  # fmt: skip
        await cable.plug(far)
        await asyncio.sleep(60)
        assert not drive.is_open
        assert isinstance(await ending(drive.position()), ConnectionLostError)


async def test_drives_that_are_lost_together_are_not_all_tried_in_the_same_moment() -> None:
    cables = {name: Cable(name) for name in ("a", "b", "c")}
    fars = {name: SimulatedDrive(name=name) for name in cables}
    for name, cable in cables.items():
        await cable.plug(fars[name])
    drives = [await compax_aio.connect(cable.url, name=name) for name, cable in cables.items()]
    streams = [drive.events() for drive in drives]
    for cable in cables.values():
        await cable.pull()
    await asyncio.sleep(0.001)
    for name, cable in cables.items():
        await cable.plug(fars[name])
    restored_at = [(await seen(events, 2))[1].at for events in streams]
    assert len({round(at, 3) for at in restored_at}) == 3
    for drive in drives:
        await drive.close()
    for cable in cables.values():
        await cable.pull()


async def test_closing_ends_the_attempts() -> None:
    async with connected() as (drive, far, cable):
        await cable.pull()
        await asyncio.sleep(1)
        assert await took(drive.close()) < 0.01
        await cable.plug(far)
        opened = cable.opened
        await asyncio.sleep(100)
        assert cable.opened == opened


# Who is there ---------------------------------------------------------------------------------------------------------


async def test_another_drive_behind_the_same_name_is_refused_and_moves_nothing() -> None:
    async with connected() as (drive, far, cable):
        move = drive.move_to(3000)
        await move.accepted
        other = SimulatedDrive(name="other")
        await cable.pull()
        await cable.plug(other)
        error = await ending(drive.position())
        assert isinstance(error, UnexpectedAnswerError)
        assert "another drive is on the line" in str(error)
        await asyncio.sleep(5)
        assert not drive.is_open
        assert motions(other) == []
        assert "S1" not in lines(other)
        await cable.pull()
        await cable.plug(far)
        assert (await move).target == 3000
        assert motions(far) == ["POSA 3000.00"]


async def test_nothing_that_moves_is_sent_before_it_is_known_who_is_there() -> None:
    async with connected() as (drive, far, cable):
        await drive.move_to(1)
        before = len(lines(far))
        await outage(cable, far, 0.001)
        for _ in range(200):
            move = drive.move_to(2)
            if not isinstance((await asyncio.gather(move, return_exceptions=True))[0], ConnectionLostError):
                break
            await asyncio.sleep(0.005)
        new = lines(far)[before:]
        assert new.index("PA2$") > max(new.index("S31"), new.index("S16"))


# Drives that were switched off ----------------------------------------------------------------------------------------


async def test_settings_are_said_again_before_the_next_move_and_no_motion_is() -> None:
    async with connected() as (drive, far, cable):
        await drive.move_to(10, speed_percent=30, acceleration_ms=500)
        await cable.pull()
        far.power_cycle()
        await cable.plug(far)
        await until(lambda: drive.is_open)
        before = len(lines(far))
        await drive.move_to(20)
        new = lines(far)[before:]
        assert {"SD30", "AL500"} <= set(new[: new.index("PA20$")])
        assert motions(far) == ["POSA 10.00", "POSA 20.00"]
        again = len(lines(far))
        await drive.move_to(30)
        assert not {"SD30", "AL500"} & set(lines(far)[again:]), "once is enough"


async def test_settings_are_said_again_before_a_motion_that_is_sent_as_a_plain_line() -> None:
    async with connected() as (drive, far, cable):
        await drive.move_to(10, speed_percent=30)
        await outage(cable, far, 0.5)
        await until(lambda: drive.is_open)
        before = len(lines(far))
        await drive.command("PA20")
        assert lines(far)[before:] == ["SD30", "PA20"]
        await asyncio.sleep(5)


async def test_a_drive_that_was_switched_off_meanwhile_is_noticed_by_its_machine_zero() -> None:
    async with connected() as (drive, far, cable):
        await drive.home()
        events = drive.events()
        await cable.pull()
        far.power_cycle()
        await cable.plug(far)
        restored = (await seen(events, 2))[1]
        assert isinstance(restored, ConnectionRestored)
        assert "machine zero" in restored.signs_of_restart[0]


async def test_a_drive_that_was_switched_off_meanwhile_is_noticed_by_its_error_history() -> None:
    async with connected() as (drive, far, cable):
        far.raise_fault(55)
        events = drive.events()
        await cable.pull()
        far.power_cycle()
        await cable.plug(far)
        restored = (await seen(events, 2))[1]
        assert isinstance(restored, ConnectionRestored)
        assert "error history" in restored.signs_of_restart[0]


async def test_a_move_of_a_drive_that_was_switched_off_meanwhile_is_in_doubt() -> None:
    async with connected() as (drive, far, cable):
        await drive.home()
        move = drive.move_to(5000)
        await move.accepted
        await cable.pull()
        far.power_cycle()
        await cable.plug(far)
        error = await ending(move)
        assert isinstance(error, MoveInDoubtError)
        assert "switched off and on" in str(error)
        with pytest.raises(MoveInDoubtError):
            drive.move_to(1)


# Half open ------------------------------------------------------------------------------------------------------------


async def test_a_line_that_has_led_nowhere_for_long_is_opened_anew_when_it_is_used() -> None:
    async with connected(DriveSettings(in_doubt_after_s=30)) as (drive, _, cable):
        move = drive.move_to(3000)
        await move.accepted
        cable.go_half_open()
        begun_at = now()
        assert isinstance(await ending(drive.position()), AnswerTimeoutError)
        await until(lambda: drive.stats.reconnects == 1)
        assert now() - begun_at < 20
        assert cable.opened == 2
        assert await drive.position() > 0
        await move
