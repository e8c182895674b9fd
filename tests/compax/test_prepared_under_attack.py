"""
Prepared moves, groups and motions that nobody watches, attacked: at every turn of the loop, on bad lines, in bad order.

``COMPAX_TURNS=1`` attacks in every turn of the loop, instead of every sixth. A test that is expected to fail shows a
defect that is known.
"""

from __future__ import annotations

import asyncio
import gc
import os
from collections.abc import Callable, Coroutine, Iterator
from contextlib import suppress
from typing import Any

import pytest
from tests.compax.test_binary_transfer import MOTION, SETTINGS, on_a_bad_line
from tests.promises.bench import bench, ending, is_moving, lines, motions, now, received, scripted, stands, until

from compax_aio import (
    AnswerTimeoutError,
    CommandRejectedError,
    CompaxError,
    ConnectionLostError,
    Drive,
    DriveGroup,
    DriveSettings,
    MoveActiveError,
    MoveError,
    MoveStoppedError,
)
from compax_aio.compax.moves import PreparedMove, fetch_error
from compax_aio.simulator.clock import VirtualClockLoop
from compax_aio.simulator.compax import LogKind, SimulatedDrive
from compax_aio.simulator.server import drive_named


@pytest.fixture(autouse=True)
def _nothing_to_collect() -> Iterator[None]:
    """Collect what a test has left now: CPython 3.11 breaks down if it does so while pytest tells of a failure."""
    yield
    gc.collect()


left_nothing = pytest.mark.usefixtures("nothing_left_behind")


def defect(why: str) -> pytest.MarkDecorator:
    """Mark a test that shows a defect which is known."""
    return pytest.mark.xfail(strict=True, reason=why)


async def busy(drive: Drive, far: SimulatedDrive) -> asyncio.Task[float]:
    """Keep the line busy with a reading; what is sent next must wait for its turn."""
    reading = asyncio.ensure_future(drive.torque())
    await received(far, "S5")
    return reading


async def begun(*work: Coroutine[Any, Any, Any]) -> list[asyncio.Task[Any]]:
    """Let each begin, as far as it comes without an answer."""
    tasks = [asyncio.ensure_future(each) for each in work]
    for _ in range(3):
        await asyncio.sleep(0)
    return tasks


def hang_up(drive: Drive) -> None:
    """Let the line go away."""
    transport = drive._line.link._port.transport
    assert transport is not None
    transport.abort()


# At every turn of the loop --------------------------------------------------------------------------------------------


class AttackedLoop(VirtualClockLoop):
    """Counts its turns from a moment on, and lets something happen at the beginning of one of them."""

    def __init__(self, at: int | None) -> None:
        super().__init__()
        self.turns = 0
        self.counts = False
        self._at = at
        self.attack: Callable[[], None] = lambda: None

    def _run_once(self) -> None:
        if self.counts:
            self.turns += 1
            if self.turns == self._at:
                self.call_soon(self.attack)
        super()._run_once()  # type: ignore[misc]


async def keep_reading(drive: Drive, answers: list[float]) -> None:
    """Be somebody else on the same line; a reading waits a second at most, and is never lost."""
    while True:
        asked_at = now()
        answers.append(await drive.position())
        assert now() - asked_at < 1.5
        await asyncio.sleep(0.02)


Attack = Callable[[DriveGroup, Any], Any]

ATTACKS: dict[str, Attack] = {
    "cancel the group": lambda _, move: move.cancel(),
    "stop the group's move": lambda _, move: asyncio.ensure_future(move.stop()),
    "cancel one move": lambda _, move: move.moves["x"].cancel(),
    "stop one drive": lambda group, _: asyncio.ensure_future(group["y"].stop()),
    "fault": lambda _, __: drive_named("y").raise_fault(20),
    "hang up": lambda group, _: hang_up(group["y"]),
    "cancel who waits": lambda _, move: move.get_loop().waiter.cancel(),
}


async def a_group_attacked(loop: AttackedLoop, attack: Attack) -> None:
    """Let two drives start together while somebody reads, attack once, and look at what is left."""
    answers: list[float] = []
    async with bench("x", answer_time_s=0.003, store="until_next_line") as (x, far_x), bench("y") as (y, far_y):
        group = DriveGroup(x=x, y=y)
        readers = await begun(*(keep_reading(drive, answers) for drive in (x, y)))
        move = group.move_to(x=3, y=4.5, speed_percent=80)
        move.add_done_callback(fetch_error)

        async def wait() -> None:
            await move

        loop.waiter = asyncio.ensure_future(wait())  # type: ignore[attr-defined]
        loop.attack = lambda: attack(group, move)
        loop.counts = True
        done, _ = await asyncio.wait([move], timeout=20)
        loop.counts = False
        assert done
        await asyncio.gather(loop.waiter, return_exceptions=True)  # type: ignore[attr-defined]
        assert all(each.done() and each.accepted.done() for each in move.moves.values())
        if move.cancelled() or move.exception() is not None:
            await stands(far_x)
            if y.is_open:
                await stands(far_y)
        else:
            assert (far_x.position, far_y.position) == (3, 4.5)
        seen = len(answers)
        await asyncio.sleep(0.1)
        assert len(answers) > seen + 4 or not y.is_open
        for reader in readers:
            reader.cancel()
        endings = await asyncio.gather(*readers, return_exceptions=True)
        assert all(isinstance(error, asyncio.CancelledError | ConnectionLostError) for error in endings), endings
        assert motions(far_x) in ([], ["POSA 3.00"])
        assert motions(far_y) in ([], ["POSA 4.50"])
        await x.move_to(5)
        assert (x.stats.timeouts, x.stats.strays) == (0, 0)


def turns_of_a_group(attack: Attack, at: int | None) -> int:
    loop = AttackedLoop(at)
    with asyncio.Runner(loop_factory=lambda: loop) as runner:
        runner.run(a_group_attacked(loop, attack))
    return loop.turns


@pytest.mark.parametrize("attack", ATTACKS)
def test_a_group_attacked_in_any_turn_of_the_loop_moves_no_axis_unnoticed_and_costs_nobody_an_answer(
    attack: str,
) -> None:
    turns = turns_of_a_group(ATTACKS[attack], None)
    assert turns > 100
    for turn in range(1, turns, int(os.environ.get("COMPAX_TURNS", "6"))):
        try:
            turns_of_a_group(ATTACKS[attack], turn)
        except BaseException as error:
            error.add_note(f"{attack} in turn {turn}")
            raise


@pytest.mark.parametrize("store", ["until_executed", "until_next_line"])
@pytest.mark.parametrize("how", ["cancel", "stop", "another line", "fault"])
def test_a_prepared_move_attacked_in_any_turn_of_the_loop_starts_once_or_not_at_all(how: str, store: str) -> None:
    async def run(loop: AttackedLoop) -> None:
        async with bench(store=store) as (drive, far):
            move = drive.prepare_move_to(20, speed_percent=70, comparators=[(5, 1)])
            attacks: dict[str, Callable[[], Any]] = {
                "cancel": move.cancel,
                "stop": lambda: asyncio.ensure_future(move.stop()),
                "another line": lambda: asyncio.ensure_future(drive.output(7, 1)),
                "fault": lambda: far.raise_fault(55),
            }
            loop.attack = attacks[how]
            loop.counts = True
            futures: list[asyncio.Future[Any]] = [move, move.ready]
            await asyncio.wait(futures, return_when=asyncio.FIRST_COMPLETED)
            with suppress(MoveError):
                move.trigger()
            await asyncio.wait([move])
            loop.counts = False
            fetch_error(move)
            await stands(far)
            assert motions(far) in ([], ["POSA 20.00"])
            assert sum(line in {"!", "PA20$", "PA20"} for line in lines(far)) == move.is_on_wire
            if how == "another line":
                assert far.position == move.result().target == 20
            began_at = now()
            await drive.position()
            assert now() - began_at < 0.1
            if how == "fault":
                await drive.quit()
            await drive.home()
            await drive.move_to(5)

    def turns(at: int | None) -> int:
        loop = AttackedLoop(at)
        with asyncio.Runner(loop_factory=lambda: loop) as runner:
            runner.run(run(loop))
        return loop.turns

    for turn in range(1, turns(None), 5):
        turns(turn)


# The trigger and its answer -------------------------------------------------------------------------------------------


@left_nothing
@pytest.mark.parametrize("trouble", ["lost", "late", "doubled", "garbled"])
async def test_whatever_becomes_of_the_triggers_answer_it_is_sent_once_and_the_move_told_truly(trouble: str) -> None:
    async with bench() as (drive, far):
        move = drive.prepare_move_to(100)
        await move.ready
        move.trigger()
        match trouble:
            case "lost":
                far.lose_answers = 1
            case "late":
                far.extra_answer_delay_s = 1.3
                asyncio.get_running_loop().call_later(1.5, setattr, far, "extra_answer_delay_s", 0)
            case "doubled":
                await until(move.accepted.done, to_the_tick=True)
                far.inject(b"\r\n>")
            case "garbled":
                await received(far, "!")
                far.inject(b"\xa5#")
        result = await move
        assert result.confirmed_by == "status"
        assert far.position == result.target == 100
        assert lines(far).count("!") == 1
        assert motions(far) == ["POSA 100.00"]
        await drive.move_to(0)


@left_nothing
async def test_a_trigger_whose_answer_comes_twice_and_whose_move_was_refused_tells_no_success() -> None:
    async with bench(travel_max=50) as (drive, far):
        move = drive.prepare_move_to(100)  # stored, and refused when it is to be executed
        await move.ready
        move.trigger()
        assert isinstance(await ending(move), CommandRejectedError)
        assert motions(far) == []
        await drive.move_to(20)


@left_nothing
async def test_what_the_drive_forgot_meanwhile_is_refused_and_nothing_else_is_sent() -> None:
    async with bench() as (drive, far):
        move = drive.prepare_move_to(100)
        await move.ready
        far.power_cycle()
        move.trigger()
        assert isinstance(await ending(move), CommandRejectedError)
        told = lines(far)
        assert all(line.startswith("S") for line in told[told.index("!") + 1 :])
        assert motions(far) == []


@left_nothing
async def test_somebody_elses_motion_between_store_and_trigger_is_left_alone() -> None:
    async with bench() as (drive, far):
        move = drive.prepare_move_to(100)
        await move.ready
        far.receive(b"PA500\r", now())
        assert far.served_by is not None
        far.served_by.changed()
        await asyncio.sleep(0.1)
        move.trigger()
        assert isinstance(await ending(move), CompaxError)
        await until(lambda: not far.moving)
        assert motions(far) == ["POSA 500.00"]


@left_nothing
async def test_a_trigger_taken_back_in_the_same_breath_is_never_sent() -> None:
    async with bench() as (drive, far):
        move = drive.prepare_move_to(100)
        await move.ready
        move.trigger()
        move.cancel()
        await asyncio.sleep(1)
        assert "!" not in lines(far)
        assert motions(far) == []


@left_nothing
async def test_a_second_prepared_move_is_the_one_that_is_triggered() -> None:
    async with bench() as (drive, far):
        first = drive.prepare_move_to(1000)
        await first.ready
        first.cancel()
        second = drive.prepare_move_to(10)
        await second.ready
        second.trigger()
        assert (await second).target == far.position == 10
        assert motions(far) == ["POSA 10.00"]


@left_nothing
async def test_a_store_that_was_lost_is_told_and_what_was_stored_before_is_never_executed() -> None:
    async with bench() as (drive, far):
        first = drive.prepare_move_to(1000)
        await first.ready
        first.cancel()
        before = drive.stats.exchanges
        second = drive.prepare_move_to(10)
        await received(far, "S1")
        await until(lambda: drive.stats.exchanges == before + 3, to_the_tick=True)
        far.deaf = True
        error = await ending(second)
        far.deaf = False
        assert error.sent == "PA10,"
        with pytest.raises(MoveError):
            second.trigger()
        await drive.move_to(20)
        assert motions(far) == ["POSA 20.00"]
        assert "!" not in lines(far)


async def store_lost_and_a_stray_prompt(drive: Drive, far: SimulatedDrive) -> None:
    """Prepare a move whose store never arrives and seems to be acknowledged, and trigger it."""
    move = drive.prepare_move_to(10)
    await received(far, "S1")
    far.deaf = True
    sent = drive.stats.bytes_sent
    await until(lambda: drive.stats.bytes_sent > sent, to_the_tick=True)
    far.inject(b"\r\n>")
    await move.ready
    far.deaf = False
    move.trigger()
    await asyncio.wait([move])
    fetch_error(move)


@left_nothing
async def test_a_store_that_was_lost_and_a_stray_prompt_do_not_execute_what_was_stored_before() -> None:
    async with bench() as (drive, far):
        first = drive.prepare_move_to(1000)
        await first.ready
        first.cancel()
        await asyncio.sleep(1)
        await store_lost_and_a_stray_prompt(drive, far)
        assert "POSA 1000.00" not in motions(far)


@left_nothing
async def test_a_store_whose_trigger_was_lost_is_not_executed_in_place_of_a_later_one() -> None:
    async with bench() as (drive, far):
        first = drive.prepare_move_to(1000)
        await first.ready
        far.deaf = True
        first.trigger()
        await asyncio.sleep(0.5)
        far.deaf = False
        assert "it was not taken" in str(await ending(first))
        await store_lost_and_a_stray_prompt(drive, far)
        assert "POSA 1000.00" not in motions(far)


@left_nothing
@defect("no page says how to empty the memory of what an earlier connection has stored: docs/decisions/0005")
async def test_what_an_earlier_connection_has_stored_is_not_executed_in_place_of_a_store_that_was_lost() -> None:
    async with bench() as (drive, far):
        await drive.prepare_move_to(1000).ready
    async with bench() as (drive, far):
        await store_lost_and_a_stray_prompt(drive, far)
        assert "POSA 1000.00" not in motions(far)


@left_nothing
async def test_a_drive_that_was_told_to_keep_quiet_about_errors_is_not_trusted_to_have_stored() -> None:
    async with bench() as (drive, far):
        await drive.parameters.unlock()
        await drive.parameters.write(20, 2)
        await drive.command("VP")
        move = drive.prepare_move_to(10)
        await move.ready
        assert "PA10," not in lines(far)
        move.trigger()
        await move


@left_nothing
@pytest.mark.parametrize("on_cancel", ["stop", "detach"])
async def test_who_awaits_a_prepared_move_and_is_cancelled_forgets_it(on_cancel: Any) -> None:
    async with bench() as (drive, far):
        move = drive.prepare_move_to(100, on_cancel=on_cancel)
        await move.ready
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(move, 0.5)
        await drive.position()
        assert motions(far) == []
        await drive.move_to(3)


@left_nothing
async def test_a_move_is_not_ready_because_somebody_gave_up_waiting_for_it() -> None:
    async with bench(answer_time_s=0.3) as (drive, _):
        move = drive.prepare_move_to(100)
        with suppress(TimeoutError):
            await asyncio.wait_for(move.ready, 0.1)
        try:
            with pytest.raises(MoveError, match="does not hold it ready yet"):
                move.trigger()
        finally:
            move.cancel()


@left_nothing
async def test_a_refused_prepared_move_leaves_its_points_and_says_so_to_the_next() -> None:
    async with scripted({"PA100,": "E90"}) as (drive, far):
        move = drive.prepare_move_to(100, comparators=[(10, 1)])
        assert isinstance(await ending(move), CommandRejectedError)
        with pytest.raises(MoveError, match="would act on this one"):
            drive.prepare_move_to(5)
        far.answers |= {"S16": "S016: 11100000"}
        far.answers["S1"] = "S001: 50.00"
        assert "!" not in far.lines


@left_nothing
async def test_points_of_a_withdrawn_prepared_move_keep_the_next_from_starting_until_they_are_cancelled() -> None:
    async with bench() as (drive, far):
        move = drive.prepare_move_to(100, comparators=[(10, 1)])
        await move.ready
        move.cancel()
        with pytest.raises(MoveError, match="would act on this one"):
            drive.prepare_move_to(5)
        assert far.prepared_points == 1
        await drive.home()
        assert far.prepared_points == 0
        await drive.move_to(5)
        assert not far.outputs[1]


@left_nothing
async def test_points_of_a_prepared_move_that_a_fault_met_before_its_trigger_stay_known() -> None:
    async with bench() as (drive, far):
        move = drive.prepare_move_to(100, comparators=[(10, 1)])
        await move.ready
        far.raise_fault(55)
        move.trigger()
        assert isinstance(await ending(move), CommandRejectedError)
        await drive.quit()
        with pytest.raises(MoveError, match="would act on this one"):
            drive.move_to(5)


@left_nothing
async def test_points_are_used_up_by_a_prepared_move_that_started() -> None:
    async with bench() as (drive, far):
        for target in (50, 100):
            move = drive.prepare_move_to(target, comparators=[(10, 1)])
            await move.ready
            move.trigger()
            await move
        assert far.prepared_points == 0
        await drive.move_to(0)


@left_nothing
async def test_points_that_were_never_sent_keep_no_move_from_starting() -> None:
    async with bench() as (drive, far):
        reading = await busy(drive, far)
        move = drive.move_to(100, comparators=[(10, 1)])
        await begun()
        move.cancel()
        await reading
        assert far.prepared_points == 0
        await drive.move_to(5)


@left_nothing
async def test_points_of_a_trigger_that_was_not_heard_stay_known() -> None:
    async with bench() as (drive, far):
        move = drive.prepare_move_to(100, comparators=[(10, 1)])
        await move.ready
        far.deaf = True
        move.trigger()
        await asyncio.sleep(0.5)
        far.deaf = False
        assert "it was not taken" in str(await ending(move))
        with pytest.raises(MoveError, match="would act on this one"):
            drive.move_to(5)


@left_nothing
async def test_nothing_is_stored_while_somebody_else_moves_the_drive() -> None:
    async with bench() as (drive, far):
        await drive.command("PA500")
        assert isinstance(await ending(drive.prepare_move_to(100)), MoveActiveError)
        assert "PA100," not in lines(far)


@left_nothing
@pytest.mark.parametrize("travel_max", [1000, 50])
async def test_after_a_prepared_move_that_was_done_or_refused_the_message_of_the_next_is_believed(
    travel_max: int,
) -> None:
    async with bench(travel_max=travel_max) as (drive, _):
        for start in (drive.prepare_move_to, drive.move_to):
            move = start(100)
            if isinstance(move, PreparedMove):
                await move.ready
                move.trigger()
            await asyncio.gather(move, return_exceptions=True)
            assert (await drive.move_to(20)).confirmed_by == "message"


@left_nothing
@pytest.mark.parametrize("target", [200, 333, 512, 777])
async def test_a_move_without_a_message_is_looked_at_when_it_should_arrive(target: int) -> None:
    async with bench() as (drive, far):
        move = drive.prepare_move_to(target)
        await move.ready
        move.trigger()
        result = await move
        reached_at = next(entry.at for entry in far.log if entry.kind is LogKind.MOTION_REACHED)
        assert result.finished_at - reached_at < drive.settings.poll_first_s + 0.05


@left_nothing
async def test_a_setting_whose_text_was_lost_keeps_its_move_from_starting() -> None:
    async with on_a_bad_line(losing(b"SD50"), DriveSettings()) as (drive, far):
        assert isinstance(await ending(drive.move_to(10, speed_percent=50)), AnswerTimeoutError)
        assert motions(far) == []


# Lines that go away ---------------------------------------------------------------------------------------------------


@left_nothing
async def test_a_prepared_move_whose_line_goes_away_fails_at_once() -> None:
    async with bench() as (drive, _):
        move = drive.prepare_move_to(10)
        await move.ready
        hang_up(drive)
        await asyncio.sleep(1)
        assert isinstance(move.exception() if move.done() else None, ConnectionLostError)


@left_nothing
async def test_a_group_that_has_lost_a_line_while_it_gets_ready_moves_nobody() -> None:
    async with bench("x") as (x, _), bench("y", answer_time_s=0.3) as (y, far_y):
        move = DriveGroup(x=x, y=y).move_to(x=100, y=100)
        await move.moves["x"].ready
        hang_up(x)
        assert isinstance(await ending(move), ConnectionLostError)
        assert motions(far_y) == []


@left_nothing
async def test_a_prepared_move_whose_line_goes_away_is_told_when_it_is_triggered() -> None:
    async with bench() as (drive, _):
        move = drive.prepare_move_to(10)
        await move.ready
        hang_up(drive)
        await asyncio.sleep(1)
        with suppress(MoveError):
            move.trigger()
        assert isinstance(await ending(move), ConnectionLostError)


# Groups ---------------------------------------------------------------------------------------------------------------


async def test_a_group_one_of_whose_moves_was_triggered_by_hand_ends_and_stops_all() -> None:
    async with bench("x") as (x, far_x), bench("y", answer_time_s=0.3) as (y, _):
        move = DriveGroup(x=x, y=y).move_to(x=10_000, y=100)
        await move.moves["x"].ready
        move.moves["x"].trigger()
        done, _ = await asyncio.wait([move], timeout=60)
        assert done
        fetch_error(move)
        assert not far_x.moving


@left_nothing
@pytest.mark.parametrize("what", ["ready", "accepted"])
async def test_who_gives_up_waiting_for_one_axis_leaves_the_group_alone(what: str) -> None:
    async with bench("x") as (x, _), bench("y", answer_time_s=0.3) as (y, _):
        move = DriveGroup(x=x, y=y).move_to(x=100, y=100)
        with suppress(TimeoutError):
            await asyncio.wait_for(getattr(move.moves["y"], what), 0.1)
        assert (await move)["y"].target == 100


@left_nothing
async def test_a_trigger_that_one_drive_refuses_stops_the_others() -> None:
    async with bench("x") as (x, far_x), bench("y", travel_max=50) as (y, far_y):
        move = DriveGroup(x=x, y=y).move_to(x=10_000, y=100)
        error = await ending(move)
        assert isinstance(error, CommandRejectedError)
        assert error.device == "y"
        assert not far_x.moving
        assert motions(far_y) == []


# Motions that nobody watches ------------------------------------------------------------------------------------------


@left_nothing
async def test_a_stop_takes_back_every_motion_that_waits_for_its_turn() -> None:
    async with bench() as (drive, far):
        reading = await busy(drive, far)
        telling = await begun(drive.command("PA1000"), drive.command("PA900"))
        with suppress(CompaxError):
            await drive.stop()
        outcomes = await asyncio.gather(*telling, return_exceptions=True)
        await reading
        await asyncio.sleep(10)
        assert motions(far) == []
        assert all(isinstance(outcome, MoveStoppedError) for outcome in outcomes)


@left_nothing
@pytest.mark.parametrize("on_cancel", ["stop", "detach"])
async def test_leaving_the_block_stops_an_unwatched_motion_although_a_move_is_getting_ready(on_cancel: Any) -> None:
    async with bench(answer_time_s=0.05) as (drive, far):
        await drive.command("PA1000")
        move = drive.move_to(5, speed_percent=50, on_cancel=on_cancel)
        move.add_done_callback(fetch_error)
        await received(far, "SD50")
        assert is_moving(far)
    assert not is_moving(far)


@left_nothing
@pytest.mark.parametrize("looks", ["reconcile", "wait_finished"])
async def test_a_motion_told_while_somebody_looks_is_stopped_when_the_block_is_left(looks: str) -> None:
    async with bench(answer_time_s=0.05) as (drive, far):
        look = asyncio.ensure_future(drive.reconcile() if looks == "reconcile" else drive.program.wait_finished())
        await received(far, "S17")
        await drive.command("PA1000")
        await look
        assert is_moving(far)
    assert not is_moving(far)


@left_nothing
async def test_a_program_that_runs_while_somebody_reconciles_is_stopped_when_the_block_is_left() -> None:
    async with bench() as (drive, far):
        far.load_program(["WAIT 5000", "POSA 1000", "END"])
        await drive.program.start(1)
        await asyncio.sleep(1)
        await drive.reconcile()
    await asyncio.sleep(10)
    assert motions(far) == []


@left_nothing
async def test_a_detached_move_goes_on_although_a_motion_was_told_before() -> None:
    async with bench() as (drive, far):
        await drive.command("PA10")
        await asyncio.sleep(5)
        move = drive.move_to(1000, on_cancel="detach")
        await move.accepted
        move.cancel()
    assert is_moving(far)
    assert "STOP" not in lines(far)


@left_nothing
async def test_a_relative_move_begun_while_another_motion_ends_tells_no_target_that_it_never_had() -> None:
    async with bench(answer_time_s=0.05) as (drive, far):
        await drive.command("PA30")
        await until(lambda: far.position > 22, to_the_tick=True)
        move = drive.move_by(10)
        await asyncio.wait([move])
        assert isinstance(move.exception(), MoveActiveError) or move.result().target == far.position == 40


@left_nothing
async def test_a_motion_that_runs_although_an_error_came_is_not_told_to_be_refused() -> None:
    async with bench() as (drive, far):
        with suppress(CommandRejectedError):
            await drive.command("BAD")
        move = drive.move_to(100)
        await until(lambda: move.is_on_wire, to_the_tick=True)
        far.inject(b"E90\r\n>")  # the answer to BAD, doubled on the way
        assert (await move).target == far.position == 100
        assert motions(far) == ["POSA 100.00"]
        await drive.move_to(0)


@left_nothing
async def test_a_motion_that_was_stopped_is_not_stopped_again_when_the_block_is_left() -> None:
    async with bench() as (drive, far):
        await drive.command("PA1000")
        await drive.stop()
    assert lines(far).count("STOP") == 1


@left_nothing
async def test_leaving_the_block_stops_what_a_failed_stop_has_left_moving() -> None:
    async with bench(settings=DriveSettings(stop_timeout_s=2)) as (drive, far):
        await drive.command("PA100000")
        await asyncio.sleep(1)
        far.deaf = True
        assert isinstance(await ending(drive.stop()), AnswerTimeoutError)
        far.deaf = False
        assert is_moving(far)
    assert not is_moving(far)


@left_nothing
async def test_a_motion_that_was_written_is_not_told_to_have_been_taken_back() -> None:
    async with bench(answer_time_s=0.05) as (drive, far):
        telling = asyncio.ensure_future(drive.command("PA1000"))
        await received(far, "PA1000")
        await drive.stop()
        assert await telling == ""
        assert motions(far) == ["POSA 1000.00"]


@left_nothing
async def test_a_raw_motion_in_binary_whose_answer_was_lost_is_never_said_again() -> None:
    async with bench(settings=MOTION, p20=16) as (drive, far):
        far.lose_answers = 1
        assert isinstance(await ending(drive.command("PA100")), AnswerTimeoutError)
        await drive.stop()
        await drive.reconcile()
        await drive.move_to(10, speed_percent=50)
        assert motions(far) == ["POSA 100.00", "POSA 10.00"]
        assert "PA100" not in lines(far)


# Another speed, and settings ------------------------------------------------------------------------------------------


@left_nothing
async def test_a_speed_that_comes_behind_a_stop_is_not_told_to_be_taken() -> None:
    async with bench(answer_time_s=0.01) as (drive, far):
        move = drive.move_to(1000)
        await asyncio.sleep(1)
        reading = await busy(drive, far)
        changing = await begun(move.change_speed(30))
        await drive.stop()
        (outcome,) = await asyncio.gather(*changing, return_exceptions=True)
        await reading
        assert "PR0 SD30" not in lines(far) or isinstance(outcome, MoveError)
        fetch_error(move)


def losing(*beginnings: bytes) -> Callable[[bytes], bytes]:
    """Lose the first write that begins so, each."""
    left = list(beginnings)

    def spoil(data: bytes) -> bytes:
        for beginning in left:
            if data.startswith(beginning):
                left.remove(beginning)
                return b""
        return data

    return spoil


@left_nothing
async def test_an_old_speed_in_doubt_does_not_come_after_a_new_one() -> None:
    async with on_a_bad_line(losing(b"\x88S", b"SD50"), SETTINGS) as (drive, far):
        assert isinstance(await ending(drive.move_to(10, speed_percent=50)), CompaxError)
        await drive.move_to(100, speed_percent=20)
        told = lines(far)
        assert [line for line in told[: told.index("PA100$")] if line.startswith("SD")][-1] == "SD20"


@left_nothing
async def test_a_ramp_that_was_lost_as_text_is_told_although_a_speed_is_in_doubt() -> None:
    async with on_a_bad_line(losing(b"\x88S", b"AL1000"), SETTINGS) as (drive, far):
        move = drive.move_to(10, speed_percent=50, acceleration_ms=1000)
        await asyncio.wait([move])
        assert move.exception() is not None or "AL1000" in lines(far)


@left_nothing
async def test_a_setting_in_doubt_that_the_drive_refuses_does_not_keep_all_later_moves_from_starting() -> None:
    async with on_a_bad_line(losing(b"\x88S"), SETTINGS) as (drive, far):
        with pytest.raises(CompaxError):
            await drive.command("SD0")
        for _ in range(2):  # the first may well be refused
            await asyncio.gather(drive.move_to(10, speed_percent=50), return_exceptions=True)
        assert far.position == 10
