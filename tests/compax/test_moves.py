"""A move on a drive that does as it should: said at once, watched on its way, confirmed by the drive itself."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest
from tests.promises.bench import bench, ending, lines, motions, now, scripted, until

from compax_aio import (
    DriveSettings,
    InvalidCommandError,
    Move,
    MoveActiveError,
    MoveError,
    MoveResult,
    MoveStoppedError,
)
from compax_aio.compax.vocabulary import Comparator, SpeedStep
from compax_aio.simulator.compax import LogKind, SimulatedDrive

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


def when(far: SimulatedDrive, kind: LogKind, text: str | None = None) -> float:
    """Return when something happened at the far end for the last time."""
    return [entry.at for entry in far.log if entry.kind is kind and text in {None, entry.text}][-1]


async def test_a_move_ends_with_the_drives_message_and_nothing_more_is_asked() -> None:
    async with bench() as (drive, far):
        move = drive.move_to(100)
        await move.accepted
        assert far.moving
        assert move.sent == "PA100$"
        assert not move.done()
        result = await move
        assert far.position == 100
        assert result.confirmed_by == "message"
        assert result.finished_at == now() == when(far, LogKind.MESSAGE, "$")
        assert result.started_at < when(far, LogKind.MOTION_STARTED) < result.finished_at
        assert result.duration_s == pytest.approx(0.752)
        assert far.log[-1].text == "$"
        assert await move == result


async def test_a_result_names_its_drive_and_what_it_last_said() -> None:
    async with bench("left") as (drive, _):
        move = drive.move_to(100)
        await asyncio.sleep(0.5)
        seen = await drive.position()
        result = await move
        assert result == MoveResult(
            drive="left",
            target=100.0,
            confirmed_by="message",
            started_at=result.started_at,
            finished_at=result.finished_at,
            last_position=result.last_position,
        )
        assert result.last_position is not None
        assert seen <= result.last_position < 100


async def test_a_position_that_was_never_asked_is_not_invented() -> None:
    async with bench() as (drive, _):
        result = await drive.move_to(5)
        assert result.duration_s < 0.2
        assert (await drive.move_to(5.1)).last_position == result.last_position
    async with bench("y", settings=DriveSettings(poll_first_s=60, poll_slowest_s=60)) as (drive, _):
        assert (await drive.move_to(50)).last_position is None


async def test_a_target_is_rounded_to_the_drives_decimals_and_known_at_once() -> None:
    async with bench() as (drive, far):
        move = drive.move_to(12.3456)
        assert move.target == 12.35
        assert motions(far) == []
        assert (await move).target == 12.35
        assert motions(far) == ["POSA 12.35"]
    async with bench("inch", settings=DriveSettings(decimals=3, unit="inch"), decimals=3, unit="inch") as (drive, far):
        await drive.move_to(1.23456)
        assert motions(far) == ["POSA 1.235"]
        assert drive.unit == "inch"


async def test_a_relative_move_says_where_it_led() -> None:
    async with bench(position=10) as (drive, far):
        move = drive.move_by(-2.5)
        known_at_once = move.target
        await move.accepted
        assert (known_at_once, move.target) == (None, 7.5)
        assert (await move).target == 7.5
        assert far.position == 7.5
        assert (await drive.move_by(2.5)).target == 10
        assert motions(far) == ["POSR 7.50", "POSR 10.00"]


async def test_a_relative_move_asks_for_the_position_where_there_is_no_target_to_read() -> None:
    async with scripted({"S2": "E90", "S1": "S001: 3.00"}) as (drive, far):
        move = drive.move_by(4)
        await until(lambda: "PR4$" in far.lines)
        assert move.target == 7
        far.transport.write(b"$\r\n>")
        assert (await move).target == 7


@pytest.mark.parametrize("reports_home", [True, False])
async def test_machine_zero_is_found_and_confirmed_by_status(reports_home: bool) -> None:
    async with bench(position=30, machine_zero=-12.5, position_reached_on_home=reports_home) as (drive, far):
        assert not (await drive.status()).machine_zero_approached
        result = await drive.home()
        assert far.homed
        assert result.target is None
        assert result.confirmed_by == "status"
        assert await drive.position() == 0
        await drive.move_to(20)
        assert (await drive.home()).finished_at >= when(far, LogKind.MOTION_REACHED, "0.00")
        assert motions(far) == ["POSA HOME 17.50", "POSA 20.00", "POSA HOME 0.00"]


async def test_settings_are_said_in_order_before_the_motion() -> None:
    async with bench() as (drive, far):
        before = len(lines(far))
        await drive.move_to(5, speed_percent=33.3335, acceleration_ms=100, deceleration_ms=200)
        assert lines(far)[before : before + 4] == ["SD33.334", "AL100", "AL-200", "PA5$"]
        before = len(lines(far))
        await drive.move_to(6)
        assert lines(far)[before] == "PA6$"


async def test_speed_steps_change_the_speed_on_the_way() -> None:
    async with bench() as (drive, far):
        plain = await drive.move_to(200)
        stepped = await drive.move_to(0, steps=[(100, 50), SpeedStep(150, 10)])
        assert stepped.duration_s > plain.duration_s + 2
        assert far.position == 0


async def test_comparators_come_in_the_order_of_travel_with_the_numbers_of_programming() -> None:
    async with bench() as (drive, far):
        move = drive.move_to(300, comparators=[(200, 9), Comparator(100, 10), (250, 9, 0)])
        passed = [(number, far.outputs[9], far.outputs[10]) async for number in move.comparators()]
        assert passed == [(2, False, True), (1, True, True), (3, False, True)]
        assert not move.done()
        await move
        assert [number async for number in move.comparators()] == [2, 1, 3]


@pytest.mark.parametrize("form", ["number_first", "prompt_first"])
@pytest.mark.parametrize("messages", ["always", "with_sign"])
async def test_comparators_are_understood_in_every_form(form: str, messages: str) -> None:
    async with bench(comparator_form=form, comparator_messages=messages) as (drive, _):
        move = drive.move_to(100, comparators=[(50, 1), (20, 2)])
        assert [number async for number in move.comparators()] == [2, 1]
        assert (await move).confirmed_by == "message"
        assert drive.stats.timeouts == 0


async def test_comparators_end_with_a_move_that_does_not_pass_them() -> None:
    async with bench() as (drive, _):
        move = drive.move_to(100, comparators=[(20, 1), (90, 2)])
        passed = []
        async for number in move.comparators():
            passed.append(number)
            await move.stop()
        assert passed == [1]
        assert isinstance(await ending(move), MoveStoppedError)


async def test_positions_follow_the_axis_and_end_where_it_stands() -> None:
    async with bench() as (drive, far):
        move = drive.move_to(-100)
        seen = [(now(), position) async for position in move.positions(interval_s=0.1)]
        positions = [position for _, position in seen]
        assert positions == sorted(positions, reverse=True)
        assert positions[-1] == -100
        assert 6 < len(positions) < 12
        assert all(later - earlier >= 0.002 for (earlier, _), (later, _) in pairwise(seen))
        assert move.done()
        assert far.position == -100


async def test_positions_can_be_followed_by_several_at_once() -> None:
    async with bench() as (drive, _):
        move = drive.move_to(100, comparators=[(10, 1), (20, 2)])

        async def follow() -> float:
            return [position async for position in move.positions()][-1]

        async def count() -> int:
            return len([number async for number in move.comparators()])

        assert list(await asyncio.gather(follow(), follow(), count(), count())) == [100, 100, 2, 2]
        await move


async def test_positions_end_without_an_error_when_the_line_is_closed() -> None:
    async with bench() as (drive, _):
        move = drive.move_to(1000, on_cancel="detach")
        seen = []
        async for position in move.positions():
            seen.append(position)
            if len(seen) == 3:
                await drive.close()
        assert len(seen) == 3
        await ending(move)


async def test_a_drive_that_sends_nothing_but_the_message_is_confirmed_by_status_and_asked_no_more() -> None:
    async with bench(position_reached="final_only") as (drive, far):
        result = await drive.move_to(100)
        assert result.confirmed_by == "status"
        assert far.position == 100
        again = drive.move_to(50)
        await again
        assert again.sent == "PA50$", "one sample may have lost its prompt"
        assert drive.stats.timeouts == 0
        move = drive.move_to(1000)
        await move.accepted
        assert move.sent == "PA1000"
        await move
        assert far.position == 1000
        assert motions(far) == ["POSA 100.00", "POSA 50.00", "POSA 1000.00"]


async def test_a_long_move_of_a_drive_that_sends_nothing_but_the_message_is_accepted_by_its_status() -> None:
    async with bench(position_reached="final_only") as (drive, far):
        move = drive.move_to(1000)
        await move.accepted
        assert far.moving
        assert (await move).confirmed_by == "status"
        assert when(far, LogKind.MOTION_REACHED) <= now() < when(far, LogKind.MOTION_REACHED) + 1.1
        assert motions(far) == ["POSA 1000.00"]


async def test_a_lost_message_is_replaced_by_the_status() -> None:
    async with bench() as (drive, far):
        far.lose_position_reached = 1
        result = await drive.move_to(100)
        assert far.log.texts(LogKind.LOST) == ["$"]
        assert result.confirmed_by == "status"
        assert result.last_position == 100
        assert when(far, LogKind.MOTION_REACHED) < result.finished_at < when(far, LogKind.MOTION_REACHED) + 0.5


async def test_a_message_is_verified_where_that_is_wanted() -> None:
    async with bench(settings=DriveSettings(verify_messages=True)) as (drive, far):
        result = await drive.move_to(100)
        assert result.confirmed_by == "status"
        assert result.last_position == 100
        # It is the message that makes it look, not the next poll.
        assert result.finished_at < when(far, LogKind.MESSAGE, "$") + 0.01


async def test_a_late_message_of_an_earlier_move_completes_no_later_one() -> None:
    async with bench() as (drive, far):
        far.delay_position_reached_s = 1
        assert (await drive.move_to(10)).confirmed_by == "status"
        far.delay_position_reached_s = 0
        result = await drive.move_to(500)
        assert far.log.texts(LogKind.MESSAGE) == ["$", "$"]
        assert far.position == 500
        assert result.finished_at >= when(far, LogKind.MOTION_REACHED, "500.00")


async def test_a_message_after_a_stop_never_says_reached() -> None:
    async with bench(position_reached_on_stop=True) as (drive, far):
        move = drive.move_to(500)
        await asyncio.sleep(0.5)
        await drive.stop()
        assert far.log.texts(LogKind.MESSAGE) == ["$"]
        assert isinstance(await ending(move), MoveStoppedError)
        result = await drive.move_to(200)
        assert far.position == result.target == 200
        assert (await drive.move_to(300)).confirmed_by == "message"


async def test_messages_that_a_stopped_move_still_owes_are_not_credited_to_the_next() -> None:
    async with bench(position_reached_on_stop=True) as (drive, far):
        far.delay_position_reached_s = 1
        move = drive.move_to(500)
        await asyncio.sleep(0.5)
        await move.stop()
        assert isinstance(await ending(move), MoveStoppedError)
        far.delay_position_reached_s = 0
        result = await drive.move_to(0, speed_percent=1)
        assert far.position == 0
        assert result.finished_at >= when(far, LogKind.MOTION_REACHED, "0.00")


async def test_a_second_move_is_refused_here_and_told_which_one_runs() -> None:
    async with bench() as (drive, far):
        move = drive.move_to(1000, comparators=[(5, 1)])
        await move.accepted
        before = drive.stats.bytes_sent, len(lines(far))
        starts: list[Callable[[], Any]] = [
            lambda: drive.move_to(5, speed_percent=10), lambda: drive.move_by(1), drive.home,
        ]  # fmt: skip
        for start in starts:
            with pytest.raises(MoveActiveError, match=r"move_to\(1000\) is running, so"):
                start()
        assert (drive.stats.bytes_sent, len(lines(far))) == before
        await move
        await drive.move_to(5)
        assert motions(far) == ["POSA 1000.00", "POSA 5.00"]


async def test_the_next_move_may_begin_in_the_very_turn_in_which_the_last_one_ends() -> None:
    async with bench() as (drive, far):
        more: list[Move] = []
        move = drive.move_to(10)
        move.add_done_callback(lambda _: more.append(drive.move_to(20)))
        await move
        await more[0]
        assert far.position == 20


async def test_points_of_a_move_that_was_not_started_are_kept_from_the_next() -> None:
    async with bench(position=7) as (drive, far):
        move = drive.move_to(100, comparators=[(50, 1)], steps=[(20, 50)])
        await until(lambda: far.prepared_points == 2)
        assert not move.is_on_wire
        move.cancel()
        before = drive.stats.bytes_sent
        starts: list[Callable[[], Any]] = [lambda: drive.move_to(5), lambda: drive.move_by(5)]
        for start in starts:
            with pytest.raises(MoveError, match="2 speed steps or comparators"):
                start()
        assert drive.stats.bytes_sent == before
        await drive.home()
        await drive.move_to(100)
        assert not far.outputs[1]
        assert motions(far) == ["POSA HOME 7.00", "POSA 100.00"]


async def test_points_that_the_drive_refused_are_not_counted() -> None:
    async with scripted({"PR5 OT O1=1": "E95"}) as (drive, far):
        error = await ending(drive.move_to(10, comparators=[(5, 1)]))
        assert error.code == 95
        move = drive.move_to(10)
        await move.accepted
        far.transport.write(b"$\r\n>")
        await move
        assert [line for line in far.lines if line.startswith(("PR", "PA"))] == ["PR5 OT O1=1", "PA10$"]


@pytest.mark.parametrize("timeout_s", [2.0, None])
async def test_a_move_within_its_budget_is_not_disturbed_by_it(timeout_s: float | None) -> None:
    async with bench() as (drive, _):
        await drive.move_to(100, timeout_s=timeout_s)
        await asyncio.sleep(5)
        assert await drive.position() == 100


@pytest.mark.parametrize("slow", [0.5, 0.05])
async def test_a_slow_axis_is_not_taken_for_one_that_stands(slow: float) -> None:
    async with bench() as (drive, far):
        result = await drive.move_to(1, speed_percent=slow)
        assert far.position == result.target == 1


async def test_everything_works_at_the_speed_of_the_real_line() -> None:
    async with bench(baudrate=9600, ready_after_answer=True, reply_padding="blanks", status_bits_blank=True) as (
        drive,
        far,
    ):
        move = drive.move_to(100, speed_percent=50, comparators=[(30, 1)])
        assert [position async for position in move.positions()][-1] == 100
        assert (await move).confirmed_by == "message"
        assert (await drive.move_by(-40)).target == 60
        assert (await drive.home()).confirmed_by == "status"
        assert drive.stats.timeouts == drive.stats.strays == 0
        assert motions(far) == ["POSA 100.00", "POSR 60.00", "POSA HOME 0.00"]


@pytest.mark.parametrize("echo", [True, False])
@pytest.mark.parametrize("padding", ["none", "blanks", "unit"])
async def test_every_way_of_answering_is_understood(echo: bool, padding: str) -> None:
    async with bench(echo=echo, reply_padding=padding, fault_numbers="one", lower_case="error") as (drive, far):
        await drive.move_to(20, speed_percent=50, comparators=[(5, 3)])
        assert await drive.position() == 20
        assert far.outputs[3]
        assert drive.stats.timeouts == 0


@pytest.mark.parametrize(
    "refused",
    [
        {"position": float("nan")}, {"position": float("inf")}, {"position": -4_000_000.01}, {"position": "5"},
        {"position": True}, {"position": 5, "speed_percent": 0}, {"position": 5, "speed_percent": 100.01},
        {"position": 5, "speed_percent": 0.0004}, {"position": 5, "acceleration_ms": -1},
        {"position": 5, "acceleration_ms": 1.5}, {"position": 5, "deceleration_ms": 65_001},
        {"position": 5, "steps": [(0, 50)]}, {"position": 5, "steps": [(1, 50.5)]}, {"position": 5, "steps": [(-1, 5)]},
        {"position": 5, "steps": [(1, 2, 3)]}, {"position": 5, "comparators": [(1, 0)]},
        {"position": 5, "comparators": [(1, 17)]}, {"position": 5, "comparators": [(1, 1, 2)]},
        {"position": 5, "comparators": [(0.001, 1)]},
        {"position": 5, "comparators": [(each, 1) for each in range(1, 9)], "steps": [(1, 50)]},
    ],
)  # fmt: skip
async def test_what_the_drive_cannot_be_told_is_refused_before_a_byte_is_sent(refused: dict[str, object]) -> None:
    async with bench() as (drive, far):
        before = drive.stats.bytes_sent
        with pytest.raises(InvalidCommandError):
            drive.move_to(**refused)  # type: ignore[arg-type]
        relative = {"distance" if key == "position" else key: value for key, value in refused.items()}
        with pytest.raises(InvalidCommandError):
            drive.move_by(**relative)  # type: ignore[arg-type]
        await asyncio.sleep(1)
        assert drive.stats.bytes_sent == before
        assert motions(far) == []
        # The drive is free for a move that it can be told.
        await drive.move_to(5)
