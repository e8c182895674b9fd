"""Moves on drives and lines in trouble: sent once, told truly, and in bounded time."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import pytest
from tests.promises.bench import (
    bench,
    ending,
    lines,
    motions,
    now,
    received,
    scripted,
    served_through,
    stands,
    strangers_order,
    until,
)

import compax_aio
from compax_aio import (
    AnswerTimeoutError,
    CommandRejectedError,
    CompaxError,
    ConnectionLostError,
    DriveFaultError,
    DriveSettings,
    Move,
    MoveInDoubtError,
    MoveStoppedError,
    MoveTimeoutError,
)
from compax_aio.compax.events import Fault
from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


# Refused by the drive -----------------------------------------------------------------------------------------------


async def test_a_drive_that_somebody_else_moves_rejects_with_e92() -> None:
    async with bench() as (drive, far):
        strangers_order(far, "PA1000")
        await until(lambda: far.moving)
        error = await ending(drive.move_to(5))
        assert isinstance(error, CommandRejectedError)
        assert error.code == 92
        assert error.sent == "PA5$"
        assert "already active" in str(error)
        assert any("E92" in line for line in error.exchanges)
        assert motions(far) == ["POSA 1000.00"]
        # The library does not interfere with what it has not started.
        assert far.moving


REFUSED_AS = {
    "code": CommandRejectedError,
    "text": CommandRejectedError,
    "prompt_only": MoveTimeoutError,
    "silent": AnswerTimeoutError,
}


@pytest.mark.parametrize("error_style", REFUSED_AS)
@pytest.mark.parametrize("relative", [False, True])
async def test_a_rejected_move_is_never_reported_as_reached(error_style: str, relative: bool) -> None:
    async with bench(error_style=error_style, travel_max=50) as (drive, far):
        error = await ending(drive.move_by(60) if relative else drive.move_to(60))
        assert type(error) is REFUSED_AS[error_style]
        assert motions(far) == []
        assert now() < 5
        if error_style == "silent":
            assert "was not taken" in str(error)
        elif error_style == "prompt_only":
            assert "ended at 0.00 units, not at its target" in str(error)
            assert "P20" in str(error)
        else:
            assert error.code == 93
        assert (await drive.move_to(40)).target == far.position == 40


@pytest.mark.parametrize("error_style", REFUSED_AS)
async def test_a_move_rejected_for_a_fault_is_never_reported_as_reached(error_style: str) -> None:
    async with bench(error_style=error_style) as (drive, far):
        await drive.move_to(10)
        far.raise_fault(55)
        starts: list[Callable[[], Move]] = [lambda: drive.move_to(10), lambda: drive.move_to(60), drive.home]
        for start in starts:
            move = start()
            error = await ending(move)
            if error_style in {"code", "text"}:
                assert isinstance(error, CommandRejectedError)
            else:
                assert isinstance(error, DriveFaultError)
                assert error.code == 55
            if error_style != "prompt_only":
                with pytest.raises(type(error)):
                    await move.accepted
        assert motions(far) == ["POSA 10.00"]
        await drive.quit()
        await drive.move_to(60)


@pytest.mark.parametrize("error_style", REFUSED_AS)
async def test_a_rejected_setting_keeps_the_motion_from_being_sent(error_style: str) -> None:
    dull = DriveSettings(speed_limit_percent=600)
    async with bench(error_style=error_style) as (drive, far):
        assert await drive.position() == 0
    async with (
        served_through(far, "bad", lambda data: data.replace(b"SD", b"SX")) as url,
        compax_aio.connect(url, name="x", settings=dull) as drive,
    ):
        move = drive.move_to(60, speed_percent=200)
        if error_style == "prompt_only":
            assert (await move).target == 60  # nobody can know
        else:
            assert isinstance(await ending(move), CommandRejectedError | AnswerTimeoutError)
            assert motions(far) == []


async def test_a_home_that_is_rejected_silently_is_not_reported_as_found() -> None:
    async with bench(error_style="prompt_only", position=30) as (drive, far):
        await drive.command("OT O0=1")
        error = await ending(drive.home())
        assert isinstance(error, MoveTimeoutError)
        assert motions(far) == []


# Faults, stops, stalls and time -----------------------------------------------------------------------------------


async def test_a_fault_on_the_way_ends_the_move_with_its_code() -> None:
    async with bench() as (drive, far):
        move = drive.move_to(1000)
        await asyncio.sleep(1)
        events = drive.events()
        far.raise_fault(55)
        error = await ending(move)
        assert isinstance(error, DriveFaultError)
        assert error.code == 55
        assert error.sent == "PA1000$"
        assert "emergency stop" in str(error)
        assert now() < 2
        await stands(far)
        event = await anext(events)
        assert isinstance(event, Fault)
        assert event.error is not None
        assert event.error.code == 55
        await drive.quit()
        await drive.move_to(1000)


async def test_a_fault_that_the_drive_does_not_name_is_still_a_fault() -> None:
    async with scripted({"S30": "E90"}) as (drive, far):
        move = drive.move_to(10)
        await move.accepted
        far.answers["S16"] = "S016: 01000000"
        error = await ending(move)
        assert isinstance(error, DriveFaultError)
        assert error.code is None
        assert "does not say which" in str(error)


async def test_a_fault_message_of_a_drive_that_sends_it_is_not_believed_where_messages_are_verified() -> None:
    async with bench(settings=DriveSettings(verify_messages=True), position_reached_on_stop=True) as (drive, far):
        move = drive.move_to(1000)
        await asyncio.sleep(1)
        far.raise_fault(55)
        assert isinstance(await ending(move), DriveFaultError)
        assert far.log.texts(LogKind.MESSAGE) in ([], ["$"])
        await drive.quit()
        move = drive.move_to(2000)
        await asyncio.sleep(1)
        strangers_order(far, "STOP")
        assert isinstance(await ending(move), MoveStoppedError)
        assert far.log.texts(LogKind.MESSAGE) == ["$", "$"]


async def test_a_move_that_somebody_else_stops_says_so_and_where() -> None:
    async with bench() as (drive, far):
        move = drive.move_to(1000)
        await asyncio.sleep(1)
        strangers_order(far, "STOP")
        error = await ending(move)
        assert isinstance(error, MoveStoppedError)
        assert f"stopped by somebody else at {far.position:.2f} units" in str(error)
        assert "STOP" not in lines(far)[lines(far).index("STOP") + 1 :]
        await drive.move_to(0)


async def test_a_stop_by_input_is_named() -> None:
    async with scripted() as (drive, far):
        move = drive.move_to(10)
        await move.accepted
        far.answers["S17"] = "S017: 00001010"
        error = await ending(move)
        assert isinstance(error, MoveStoppedError)
        assert "input I6" in str(error)


async def test_an_axis_that_stands_still_with_its_command_active_is_stopped() -> None:
    async with scripted({"S17": "S017: 00100010"}, settings=DriveSettings(stall_timeout_s=3)) as (drive, far):

        def on_line(line: str) -> None:
            if line == "STOP":
                far.answers |= {"S17": "S017: 00000010", "S16": "S016: 11010100"}

        far.on_line = on_line
        move = drive.move_to(10)
        error = await ending(move)
        assert isinstance(error, MoveTimeoutError)
        assert "stood still at 0.00 units for 3 s" in str(error)
        assert 3 <= now() < 4
        assert far.lines.count("STOP") == far.lines.count("PA10$") == 1


async def test_an_axis_that_moves_on_slowly_is_not_stalled() -> None:
    async with scripted({"S17": "S017: 00100010"}, settings=DriveSettings(stall_timeout_s=3)) as (drive, far):
        move = drive.move_to(10)
        for hundredths in range(10):
            far.answers["S1"] = f"S001: 0.0{hundredths}"
            await asyncio.sleep(2)
        assert not move.done()
        far.answers |= {"S17": "S017: 00000010", "S16": "S016: 11011000", "S1": "S001: 10.00"}
        assert (await move).confirmed_by == "status"
        assert "STOP" not in far.lines


@pytest.mark.parametrize("how", ["move_to", "move_by", "home"])
async def test_a_move_that_takes_longer_than_its_budget_is_stopped(how: str) -> None:
    async with bench(position=2000, machine_zero=-2000) as (drive, far):
        start = {"move_to": drive.move_to, "move_by": drive.move_by, "home": lambda _, timeout_s: drive.home(
            timeout_s=timeout_s)}[how]  # fmt: skip
        move = start(-1000, timeout_s=1.5)  # type: ignore[operator]
        error = await ending(move)
        assert isinstance(error, MoveTimeoutError)
        assert "1.5 s and was stopped" in str(error)
        assert not far.moving
        assert now() < 2
        await drive.move_to(2000)


async def test_a_move_whose_budget_is_used_up_before_it_was_sent_is_never_sent() -> None:
    async with bench() as (drive, far):
        far.extra_answer_delay_s = 0.5
        move = drive.move_to(100, speed_percent=50, timeout_s=0.2)
        error = await ending(move)
        assert isinstance(error, MoveTimeoutError)
        assert "was not sent" in str(error)
        assert move.sent is None
        await asyncio.sleep(5)
        assert motions(far) == []
        assert "STOP" not in lines(far)


async def test_a_target_within_the_drives_own_window_counts_as_reached() -> None:
    """P14 (UG p. 117): the drive says "reached" with some lag left."""
    done = {"S16": "S016: 11011000", "S1": "S001: 9.80", "S2": "S002: 10.00"}
    async with scripted(done) as (drive, _):
        result = await drive.move_to(10)
        assert result.confirmed_by == "status"
        assert result.last_position == 9.8


async def test_position_reached_alone_proves_nothing() -> None:
    """It may be that of an earlier move, on a drive that keeps quiet about errors."""
    async with scripted({"S16": "S016: 11011000", "S1": "S001: 0.00", "S2": "S002: 0.00"}) as (drive, far):
        assert isinstance(await ending(drive.move_to(10)), MoveTimeoutError)
        assert far.lines.count("PA10$") == 1


# Lost on the way, P2 ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("target", [10, 1000])
@pytest.mark.parametrize("relative", [False, True])
async def test_a_lost_acknowledgement_is_made_up_for_by_the_status(target: int, relative: bool) -> None:
    async with bench() as (drive, far):
        move = drive.move_by(target) if relative else drive.move_to(target)
        await until(lambda: move.is_on_wire)
        far.lose_answers = 1
        await move.accepted
        assert far.log.texts(LogKind.LOST) == [""]
        result = await move
        assert result.target == far.position == target
        assert result.confirmed_by == "status"
        assert len(motions(far)) == 1


async def test_a_lost_command_is_told_as_not_taken_and_not_repeated() -> None:
    async with bench() as (drive, far):
        far.deaf = True
        move = drive.move_to(100)
        await until(lambda: move.is_on_wire)
        await asyncio.sleep(0.1)
        far.deaf = False
        error = await ending(move)
        assert isinstance(error, AnswerTimeoutError)
        assert error.sent == "PA100$"
        assert "was not taken: it stands at 0.00 units" in str(error)
        with pytest.raises(AnswerTimeoutError):
            await move.accepted
        await asyncio.sleep(10)
        assert motions(far) == []
        assert not [line for line in lines(far) if line.startswith("PA")]
        await drive.move_to(100)
        assert motions(far) == ["POSA 100.00"]


async def test_points_of_a_move_that_was_lost_are_kept_from_the_next() -> None:
    async with bench() as (drive, far):
        move = drive.move_to(100, comparators=[(50, 1)])
        await received(far, "PR50 OT O1=1")
        await asyncio.sleep(0.0015)
        far.deaf = True
        await until(lambda: move.is_on_wire)
        await asyncio.sleep(0.1)
        far.deaf = False
        assert "was not taken" in str(await ending(move))
        assert far.prepared_points == 1
        with pytest.raises(CompaxError, match="1 speed steps or comparators"):
            drive.move_to(100)
        await drive.home()
        await drive.move_to(100)
        assert not far.outputs[1]


@pytest.mark.parametrize("remainder", ["PA100", "PR5$", "S1", "P", "STOP", "PH", "x" * 40, "PA 7,"])
async def test_half_a_line_that_stands_in_the_drives_buffer_is_never_executed(remainder: str) -> None:
    far = SimulatedDrive(Knobs(position=1))
    far.receive(remainder.encode(), now())
    async with served_through(far, "bad", bytes) as url, compax_aio.connect(url, name="x") as drive:
        assert motions(far) == []
        assert await drive.position() == 1
        await drive.move_to(3)
        assert motions(far) == ["POSA 3.00"]


@pytest.mark.parametrize("lost", [b"PA100$", b"\r", b"A100$\r", b"$\r", b"100$", b"PA1"])
async def test_a_motion_cut_on_its_way_is_started_at_most_once_and_told_truly(lost: bytes) -> None:
    """Whatever part of the line is lost, once."""
    cuts: list[bytes] = []

    def cut(data: bytes) -> bytes:
        if data == b"PA100$\r" and not cuts:
            cuts.append(data)
            return data.replace(lost, b"")
        return data

    far = SimulatedDrive()
    async with served_through(far, "bad", cut) as url, compax_aio.connect(url, name="x") as drive:
        error = await ending(drive.move_to(100))
        assert cuts
        started = motions(far)
        if lost == b"PA1":
            assert isinstance(error, CommandRejectedError)
        elif lost == b"$\r":
            # Half a line, which the next one completes to nonsense.
            assert "was not taken" in str(error)
        assert started == []
        assert lines(far).count("PA100$") == 0
        assert (await drive.move_to(20)).target == far.position == 20


async def test_an_answer_that_comes_late_is_that_of_its_own_command() -> None:
    async with bench() as (drive, far):
        far.extra_answer_delay_s = 1.5
        move = drive.move_to(400)
        await received(far, "PA400$")
        await asyncio.sleep(0.01)
        far.extra_answer_delay_s = 0
        await received(far, "S16")
        far.extra_answer_delay_s = 0
        await move
        assert far.position == 400
        assert motions(far) == ["POSA 400.00"]


@pytest.mark.parametrize("arrives", [True, False])
async def test_the_search_for_machine_zero_is_in_doubt_where_the_status_cannot_tell(arrives: bool) -> None:
    """It had been found before, and the drive stands: whether it was searched again, nobody can say."""
    lost: list[bytes] = []

    def lose_once(data: bytes) -> bytes:
        if data != b"PH\r" or lost:
            return data
        lost.append(data)
        far.lose_answers = arrives
        return data if arrives else b""

    far = SimulatedDrive(Knobs(homed=True))
    async with served_through(far, "bad", lose_once) as url, compax_aio.connect(url, name="x") as drive:
        error = await ending(drive.home())
        assert isinstance(error, MoveInDoubtError)
        assert "had been approached before" in str(error)
        assert motions(far) == ["POSA HOME 0.00"] * arrives
        before = drive.stats.bytes_sent
        with pytest.raises(MoveInDoubtError):
            drive.home()
        assert drive.stats.bytes_sent == before
        await drive.reconcile()
        await drive.home()
        assert motions(far) == ["POSA HOME 0.00"] * (1 + arrives)


async def test_a_search_for_machine_zero_whose_question_is_lost_is_not_sent() -> None:
    async with bench(homed=True) as (drive, far):
        far.deaf = True
        move = drive.home()
        await until(lambda: drive.stats.timeouts == 1)
        far.deaf = False
        assert isinstance(await ending(move), AnswerTimeoutError)
        assert move.sent is None
        assert motions(far) == []


async def test_a_lost_acknowledgement_of_the_search_for_machine_zero_is_made_up_for() -> None:
    async with bench(position=50) as (drive, far):
        move = drive.home()
        await until(lambda: move.is_on_wire)
        far.lose_answers = 1
        assert (await move).confirmed_by == "status"
        assert far.homed
        assert motions(far) == ["POSA HOME 50.00"]


# In doubt -----------------------------------------------------------------------------------------------------------


async def test_a_move_of_which_nothing_is_heard_is_in_doubt_and_no_motion_is_sent_until_reconciled() -> None:
    async with bench(settings=DriveSettings(in_doubt_after_s=20)) as (drive, far):
        move = drive.move_to(10_000)
        await move.accepted
        far.silent = True
        silent_since = now()
        error = await ending(move)
        assert isinstance(error, MoveInDoubtError)
        assert 20 <= now() - silent_since < 27
        assert error.sent == "PA10000$"
        assert error.exchanges
        before = drive.stats.bytes_sent
        starts: list[Callable[[], Move]] = [lambda: drive.move_to(5), lambda: drive.move_by(5), drive.home]
        for start in starts:
            with pytest.raises(MoveInDoubtError, match=r"is in doubt: the drive does not say"):
                start()
        assert drive.stats.bytes_sent == before
        # Who cannot be asked is not reconciled.
        assert isinstance(await ending(drive.reconcile()), AnswerTimeoutError | ConnectionLostError)
        with pytest.raises(MoveInDoubtError):
            drive.move_to(5)
        far.silent = False
        status = await drive.reconcile()
        assert status.command_active
        await drive.stop()
        await drive.move_to(20)
        assert far.position == 20
        assert len(motions(far)) == 2


async def test_a_silence_shorter_than_the_patience_harms_no_move() -> None:
    async with bench(settings=DriveSettings(in_doubt_after_s=20)) as (drive, far):
        move = drive.move_to(2000)
        await asyncio.sleep(1)
        far.silent = True
        await asyncio.sleep(18)
        far.silent = False
        result = await move
        assert far.position == 2000
        assert result.confirmed_by == "status"
        assert motions(far) == ["POSA 2000.00"]


async def test_a_line_that_is_lost_on_the_way_ends_the_move_at_once_and_sends_nothing() -> None:
    far = SimulatedDrive()
    async with served_through(far, "bad", bytes) as url:
        drive = await compax_aio.connect(url, name="x", settings=DriveSettings(reconnect=False))
        move = drive.move_to(5000)
        await asyncio.sleep(1)
        lost_at = now()
    error = await ending(move)
    assert isinstance(error, ConnectionLostError)
    assert "may go on" in str(error)
    assert now() - lost_at < 0.1
    assert far.moving
    assert isinstance(await ending(drive.move_to(5)), ConnectionLostError)
    await drive.close()
    assert motions(far) == ["POSA 5000.00"]


async def test_a_drive_that_lost_its_power_on_the_way_did_not_reach_its_target() -> None:
    async with bench(self_test_s=3) as (drive, far):
        move = drive.move_to(1000)
        await asyncio.sleep(1)
        far.power_off()
        await asyncio.sleep(2)
        far.power_on()
        assert isinstance(await ending(move), MoveTimeoutError | DriveFaultError)
        assert motions(far) == ["POSA 1000.00"]
        await asyncio.sleep(3)
        await drive.home()


async def test_a_motion_that_was_seen_to_run_is_not_told_as_never_taken_after_the_power_came_back() -> None:
    async with bench() as (drive, far):
        move = drive.move_to(1000)
        await received(far, "PA1000$")
        far.lose_answers = 1  # that of the motion
        await until(lambda: lines(far)[-1] != "PA1000$" and lines(far)[-2:] == ["S17", "S16"], to_the_tick=True)
        far.power_cycle()
        error = await ending(move)
        assert not isinstance(error, AnswerTimeoutError)
        assert "command it again" not in str(error)
