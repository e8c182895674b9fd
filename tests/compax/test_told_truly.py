"""What went wrong once: each of these failed before the patches of the report."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from tests.promises.bench import bench, ending, is_moving, lines, motions, received, served_through, until

import compax_aio
from compax_aio import (
    DriveGroup,
    DriveSettings,
    InvalidCommandError,
    MoveActiveError,
    MoveError,
    MoveInDoubtError,
    MoveStoppedError,
    MoveTimeoutError,
)
from compax_aio.compax.events import Fault
from compax_aio.simulator.clock import VirtualClockLoop
from compax_aio.simulator.compax import LogKind, SimulatedDrive
from compax_aio.simulator.server import drive_named

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


async def test_a_late_message_of_an_earlier_move_is_not_the_end_of_a_search_for_machine_zero() -> None:
    async with bench(machine_zero=-500) as (drive, far):
        far.delay_position_reached_s = 1
        assert (await drive.move_to(1)).confirmed_by == "status"
        far.delay_position_reached_s = 0
        result = await drive.home()
        assert not far.moving
        assert far.homed
        assert result.confirmed_by == "status"


async def test_a_message_for_somebody_who_has_left_is_not_the_end_of_our_move() -> None:
    async with bench(error_style="prompt_only") as (drive, far):
        await drive.move_to(400, on_cancel="detach").accepted
    async with bench() as (drive, far):
        error = await ending(drive.move_to(500))
        assert isinstance(error, MoveTimeoutError)
        assert motions(far) == ["POSA 400.00"]


@pytest.mark.parametrize("fault", [False, True])
async def test_a_relative_move_after_a_stop_begins_where_the_axis_stands(fault: bool) -> None:
    async with bench() as (drive, far):
        move = drive.move_to(200)
        await asyncio.sleep(0.4)
        if fault:
            far.raise_fault(10)
        else:
            await drive.stop()
        await ending(move)
        await until(lambda: not is_moving(far))
        if fault:
            await drive.quit()
        stood_at = far.position
        result = await drive.move_by(10)
        assert result.target == pytest.approx(stood_at + 10, abs=0.006)
        assert far.position == pytest.approx(stood_at + 10)


async def test_a_lost_command_after_a_stopped_one_to_the_same_target_was_not_accepted() -> None:
    lost: list[bytes] = []

    def lose_second(data: bytes) -> bytes:
        if data == b"PA200$\r":
            lost.append(data)
        return b"" if len(lost) == 2 and data == lost[0] else data

    far = SimulatedDrive()
    async with served_through(far, "bad", lose_second) as url, compax_aio.connect(url, name="x") as drive:
        move = drive.move_to(200)
        await asyncio.sleep(0.4)
        await drive.stop()
        await ending(move)
        move = drive.move_to(200)
        error = await ending(move)
        assert move.accepted.exception() is error
        assert not isinstance(error, MoveStoppedError)
        assert len(motions(far)) == 1


async def test_a_lost_answer_while_finding_out_is_asked_again() -> None:
    async with bench() as (drive, far):
        move = drive.move_by(10)
        await until(lambda: move.is_on_wire)
        far.lose_answers = 1
        far.lose_position_reached = 1
        await until(lambda: lines(far)[-2:] == ["S1", "S2"] or move.done(), to_the_tick=True)
        far.lose_answers += not move.done()
        assert (await move).target == 10
        assert motions(far) == ["POSR 10.00"]


async def test_leaving_the_block_stops_a_move_that_is_in_doubt() -> None:
    async with bench(settings=DriveSettings(in_doubt_after_s=5)) as (drive, far):
        move = drive.move_to(1e6)
        await asyncio.sleep(0.4)
        far.silent = True
        assert isinstance(await ending(move), MoveInDoubtError)
        far.silent = False
        assert is_moving(far)
    assert not is_moving(far)


async def test_leaving_the_block_tries_once_more_what_could_not_be_stopped() -> None:
    async with bench(settings=DriveSettings(stop_timeout_s=2)) as (drive, far):
        move = drive.move_to(1e6)
        await asyncio.sleep(0.4)
        far.deaf = True
        await ending(drive.stop())
        await ending(move)
        far.deaf = False
    assert not far.moving


async def test_a_question_never_starts_a_motion() -> None:
    async with bench() as (drive, far):
        before = drive.stats.bytes_sent
        with pytest.raises(InvalidCommandError):
            await drive.query("PA5000")
        assert drive.stats.bytes_sent == before
        assert motions(far) == []


@pytest.mark.parametrize("timeout_s", ["5", float("nan"), float("inf"), 0, -1, True])
async def test_a_budget_that_cannot_be_meant_is_refused_before_anything_is_sent(timeout_s: Any) -> None:
    async with bench() as (drive, far):
        before = drive.stats.bytes_sent
        with pytest.raises(InvalidCommandError):
            drive.move_to(100, timeout_s=timeout_s)
        with pytest.raises(InvalidCommandError):
            DriveGroup(x=drive).home(timeout_s=timeout_s)
        await asyncio.sleep(2)
        assert drive.stats.bytes_sent == before
        await drive.move_to(5)
        assert motions(far) == ["POSA 5.00"]


async def test_a_way_of_cancelling_that_does_not_exist_is_refused() -> None:
    async with bench() as (drive, far):
        with pytest.raises(InvalidCommandError):
            drive.move_to(1000, on_cancel="Stop")  # type: ignore[arg-type]
        await asyncio.sleep(1)
        assert motions(far) == []


async def test_points_that_a_quiet_drive_may_have_kept_are_kept_from_the_next_move() -> None:
    async with bench(error_style="prompt_only", travel_max=50) as (drive, far):
        assert isinstance(await ending(drive.move_to(100, comparators=[(10, 1)])), MoveTimeoutError)
        assert far.prepared_points == 1
        with pytest.raises(MoveError, match="1 speed steps or comparators"):
            drive.move_to(20)
        await drive.home()
        await drive.move_to(20)
        assert not far.outputs[1]


@pytest.mark.parametrize("error_style", ["prompt_only", "silent"])
async def test_points_of_a_move_that_a_fault_kept_from_starting_are_kept_from_the_next_move(error_style: str) -> None:
    async with bench(error_style=error_style) as (drive, far):
        far.raise_fault(55)
        await ending(drive.move_to(100, comparators=[(10, 1)]))
        await drive.quit()
        with pytest.raises(MoveError, match="1 speed steps or comparators"):
            drive.move_to(20)


async def test_a_search_for_machine_zero_that_a_quiet_drive_refuses_was_not_successful() -> None:
    async with bench(error_style="prompt_only", homed=True, position=30) as (drive, far):
        await drive.command("OT O0=1")
        assert isinstance(await ending(drive.home()), MoveTimeoutError)
        assert motions(far) == []
        await drive.command("OT O0=0")
        await drive.home()
        await drive.home()
        assert motions(far) == ["POSA HOME 0.00"] * 2


async def test_a_search_for_machine_zero_is_not_sent_while_somebody_else_moves_the_drive() -> None:
    async with bench(error_style="prompt_only", homed=True, position=30) as (drive, far):
        await drive.command("PA100")
        error = await ending(drive.home())
        assert isinstance(error, MoveActiveError)
        assert "PH" not in lines(far)


async def test_a_stop_returns_only_when_the_ramp_of_a_fault_is_over() -> None:
    async with bench(stop_ramp_ms=3000) as (drive, far):
        move = drive.move_to(5000)
        await asyncio.sleep(1)
        far.raise_fault(10)
        await drive.stop()
        assert not far.moving
        await ending(move)


@pytest.mark.parametrize("nth", range(4))
async def test_one_lost_answer_does_not_make_a_stop_fail(nth: int) -> None:
    """STOP itself, and each of the three questions after it."""
    async with bench() as (drive, far):
        move = drive.move_to(5000)
        await asyncio.sleep(1)
        stopping = asyncio.ensure_future(drive.stop())
        await received(far, ["STOP", "S17", "S16", "S1"][nth])
        far.lose_answers = 1
        await stopping
        assert isinstance(await ending(move), MoveStoppedError)
        await drive.move_to(0)


async def test_a_stop_spoilt_by_half_a_line_is_repeated_although_the_next_answer_is_lost_too() -> None:
    spoilt: list[bytes] = []

    def spoil(data: bytes) -> bytes:
        if data == b"STOP\r" and not spoilt:
            spoilt.append(data)
            return b"XSTOP\r"
        return data

    far = SimulatedDrive()
    async with served_through(far, "bad", spoil) as url, compax_aio.connect(url, name="x") as drive:
        move = drive.move_to(5000)
        await asyncio.sleep(1)
        stopping = asyncio.ensure_future(drive.stop())
        await received(far, "XSTOP")
        await received(far, "S17")
        far.lose_answers = 1
        await stopping
        assert not far.moving
        assert isinstance(await ending(move), MoveStoppedError)


async def test_a_fault_is_told_although_the_drive_cannot_be_heard_to_name_it() -> None:
    async with bench() as (drive, far):
        events = drive.events()
        far.raise_fault(10)
        reading = asyncio.ensure_future(drive.status())
        await received(far, "S30")
        far.lose_answers = 1
        assert not (await reading).no_fault
        event = await asyncio.wait_for(anext(events), 1)
        assert isinstance(event, Fault)
        assert event.error is None


async def test_a_comparator_passed_on_the_ramp_of_a_stop_is_not_one_of_the_next_move() -> None:
    async with bench(stop_ramp_ms=5000) as (drive, far):
        first = drive.move_to(2000, comparators=[(200, 1)])
        await asyncio.sleep(0.6)
        first.cancel()
        second = drive.move_to(0, comparators=[(50, 2)])
        assert [(number, far.outputs[2]) async for number in second.comparators()] == [(1, True)]
        await second


async def test_one_drive_is_not_two_axes() -> None:
    async with bench() as (drive, far):
        with pytest.raises(InvalidCommandError):
            DriveGroup(x=drive, y=drive).move_to(x=10, y=20)
        await asyncio.sleep(1)
        assert motions(far) == []


async def test_no_motion_is_sent_as_a_plain_line_while_one_is_in_doubt() -> None:
    async with bench(settings=DriveSettings(in_doubt_after_s=5)) as (drive, far):
        move = drive.move_to(1000)
        await asyncio.sleep(0.4)
        far.silent = True
        assert isinstance(await ending(move), MoveInDoubtError)
        far.silent = False
        before = drive.stats.bytes_sent
        with pytest.raises(MoveInDoubtError):
            await drive.command("PA5")
        assert drive.stats.bytes_sent == before
        await drive.reconcile()


@pytest.mark.parametrize("turn", range(12))
def test_an_event_loop_that_ends_stops_the_drives_of_a_group_that_nobody_closed(turn: int) -> None:
    keep: list[Any] = []

    async def main() -> None:
        drives = {axis: await compax_aio.connect(f"sim://compax?name={axis}") for axis in "xyz"}
        move = DriveGroup(**drives).move_to(x=1e5, y=1e5, z=1e5)
        await move.accepted
        keep.append((drives, move, [drive_named(axis) for axis in "xyz"]))
        await asyncio.sleep(0.1 + turn / 2000)

    with asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
        runner.run(main())
    for far in keep[0][2]:
        assert far.log.texts(LogKind.MOTION_STOPPED)


async def test_a_search_for_machine_zero_from_machine_zero_is_still_found_at_once() -> None:
    async with bench(homed=True) as (drive, far):
        assert (await drive.home()).duration_s < 1
        assert motions(far) == ["POSA HOME 0.00"]
