"""Cancelling is safe at every await: the drive stands, the line is in step, and nobody else loses an answer."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import types
from collections.abc import Callable, Coroutine, Generator
from typing import Any

import anyio
import pytest
from tests.promises.bench import bench, ending, lines, motions, now, scripted, stands, until

import compax_aio
from compax_aio import DriveGroup, DriveSettings, MoveStoppedError
from compax_aio.simulator.clock import VirtualClockLoop
from compax_aio.simulator.compax import Knobs, LogKind
from compax_aio.simulator.server import drive_named

# Ways to be cancelled ----------------------------------------------------------------------------------------------

Cancel = Callable[[asyncio.Task[Any], Any], None]


def while_waiting(task: asyncio.Task[Any], _: Any) -> None:
    """Cancel in the next turn of the loop."""
    asyncio.get_running_loop().call_soon(task.cancel)


def together_with_the_answer(task: asyncio.Task[Any], awaited: Any) -> None:
    """Cancel in the very turn in which what is awaited is done: its result is there and cannot be taken."""
    if awaited is None:
        while_waiting(task, None)
    else:
        awaited.add_done_callback(lambda _: task.cancel())
        # The task adds its own callback only after this one.


def twice(task: asyncio.Task[Any], awaited: Any) -> None:
    """Cancel, and again while that is being dealt with."""
    while_waiting(task, awaited)
    asyncio.get_running_loop().call_later(0.003, task.cancel)


class Stepper:
    """Runs a coroutine, counts its awaits, and lets something happen at one of them."""

    def __init__(self, at: int | None, cancel: Cancel) -> None:
        self.awaits = 0
        self._at = at
        self._cancel = cancel

    async def run(self, work: Coroutine[Any, Any, Any]) -> Any:
        return await self._steps(work)

    @types.coroutine
    def _steps(self, work: Coroutine[Any, Any, Any]) -> Generator[Any, Any, Any]:
        task = asyncio.current_task()
        assert task is not None
        resume: Callable[[], Any] = lambda: work.send(None)  # noqa: E731
        while True:
            try:
                awaited = resume()
            except StopIteration as stop:
                return stop.value
            self.awaits += 1
            if self.awaits == self._at:
                self._cancel(task, awaited)
            try:
                yield awaited
            except BaseException as error:
                resume = _thrower(work, error)
            else:
                resume = lambda: work.send(None)  # noqa: E731


def _thrower(work: Coroutine[Any, Any, Any], error: BaseException) -> Callable[[], Any]:
    return lambda: work.throw(error)


# Whole programs ----------------------------------------------------------------------------------------------------


async def one_drive() -> None:
    async with compax_aio.connect("sim://compax?name=x", name="x") as drive:
        move = drive.move_to(60, speed_percent=80, comparators=[(20, 1)])
        assert [number async for number in move.comparators()] == [1]
        assert [position async for position in move.positions(interval_s=0.1)][-1] == 60
        assert (await move).target == 60
        assert (await drive.status()).position_reached
        await drive.move_by(-30)
        stopped = drive.move_to(1000)
        await stopped.accepted
        await drive.stop()
        await asyncio.wait([stopped])
        assert isinstance(stopped.exception(), MoveStoppedError)


async def a_group() -> None:
    async with DriveGroup.connect({axis: f"sim://compax?name={axis}" for axis in "xy"}) as group:
        await group.home()
        move = group.move_to(x=60, y=90)
        await move.accepted
        await move
        assert await group.positions() == {"x": 60, "y": 90}


async def watchers_in_a_task_group() -> None:
    async with compax_aio.connect("sim://compax?name=x", name="x") as drive, asyncio.TaskGroup() as tasks:
        events = drive.events()
        move = drive.move_to(100)

        async def watch() -> None:
            async for _ in move.positions():
                pass

        tasks.create_task(watch())
        await anext(events)
        await asyncio.wait_for(move, 10)


class CountingLoop(VirtualClockLoop):
    """Counts its turns, and cancels a task at the beginning of one of them."""

    def __init__(self) -> None:
        super().__init__()
        self.turns = 0
        self.cancel_at: int | None = None
        self.victim: asyncio.Task[Any] | None = None

    def _run_once(self) -> None:
        if self.victim is not None:
            self.turns += 1
            if self.turns == self.cancel_at:
                self.victim.cancel()
        super()._run_once()  # type: ignore[misc]


class Run:
    """One run of a program in an event loop of its own, cancelled somewhere; and what it left behind."""

    def __init__(
        self,
        program: Callable[[], Coroutine[Any, Any, None]],
        *,
        at: int | None = None,
        cancel: Cancel = while_waiting,
        turn: int | None = None,
    ) -> None:
        self.stepper = Stepper(at, cancel)
        self.complaints: list[str] = []
        self.cancelled = False
        self.loop = CountingLoop()
        self.loop.cancel_at = turn
        with asyncio.Runner(loop_factory=lambda: self.loop) as runner:
            runner.run(self._run(program))

    def check(self, where: str) -> None:
        """Say what is wrong with what was left behind."""
        assert (self.moving, self.tasks) == ([], []), where
        assert not self.complaints, f"{where}: {self.complaints}"

    def _complain(self, _: object, context: dict[str, Any]) -> None:
        self.complaints.append(str(context))

    async def _run(self, program: Callable[[], Coroutine[Any, Any, None]]) -> None:
        loop = asyncio.get_running_loop()
        loop.set_exception_handler(self._complain)
        drives = [drive_named(axis, Knobs(position=-7)) for axis in "xy"]
        task: asyncio.Task[Any] = loop.create_task(self.stepper.run(program()))
        self.loop.victim = task
        try:
            await task
        except asyncio.CancelledError:
            self.cancelled = True
        self.loop.victim = None
        del task
        # The moment the program has ended, everything stands still, and stays so.
        self.moving = [far.name for far in drives if far.moving]
        motions_then = [motions(far) for far in drives]
        await asyncio.sleep(0.001)
        self.tasks = [each for each in asyncio.all_tasks() if each is not asyncio.current_task()]
        await asyncio.sleep(60)
        assert [motions(far) for far in drives] == motions_then
        # Nobody sits on the line, and it is in step for the next.
        for far in drives:
            async with bench(far.name) as (drive, _):
                assert await drive.position() == pytest.approx(far.position, abs=0.005)
                assert (await drive.read_status(7)).value == 24
                await drive.home()
                assert (await drive.move_to(5)).target == far.position == 5


PROGRAMS = [one_drive, a_group, watchers_in_a_task_group]


@pytest.mark.parametrize("cancel", [while_waiting, together_with_the_answer, twice])
@pytest.mark.parametrize("program", PROGRAMS)
def test_a_program_cancelled_at_any_await_leaves_its_drives_standing_and_their_lines_usable(
    program: Callable[[], Coroutine[Any, Any, None]], cancel: Cancel
) -> None:
    whole = Run(program)
    assert not whole.cancelled
    whole.check("not cancelled")
    cancelled = 0
    for at in range(1, whole.stepper.awaits + 1):
        run = Run(program, at=at, cancel=cancel)
        cancelled += run.cancelled
        run.check(f"cancelled at await {at} of {whole.stepper.awaits}")
    assert cancelled >= whole.stepper.awaits - 1


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_program_cancelled_in_any_turn_of_the_loop_leaves_its_drives_standing_and_their_lines_usable(
    program: Callable[[], Coroutine[Any, Any, None]],
) -> None:
    whole = Run(program)
    assert whole.loop.turns > 100
    cancelled = 0
    # Not the first: a task that never began has nothing to leave.
    turns = range(2, whole.loop.turns, max(1, whole.loop.turns // 60))
    for turn in turns:
        run = Run(program, turn=turn)
        cancelled += run.cancelled
        run.check(f"cancelled in turn {turn} of {whole.loop.turns}")
    assert cancelled > 0.9 * len(turns)
    gc.collect()


@pytest.mark.parametrize("cancel", [while_waiting, together_with_the_answer])
def test_a_caller_cancelled_at_any_await_costs_no_other_caller_an_answer(cancel: Cancel) -> None:
    async def victim(drive: compax_aio.Drive) -> None:
        for _ in range(2):
            await drive.position()
            await drive.command("SD50")
            await drive.status()
            await drive.read_status(8)
            await drive.query("P2")

    async def run(at: int | None) -> int:
        stepper = Stepper(at, cancel)
        async with bench(position=3) as (drive, _):
            task = asyncio.get_running_loop().create_task(stepper.run(victim(drive)))
            others: list[asyncio.Future[Any]] = [
                asyncio.ensure_future(asking)
                for _ in range(3)
                for asking in (drive.position(), drive.query("S7"), drive.query("P10"), drive.command("AL100"))
            ]
            await asyncio.wait([task, *others])
            assert [other.result() for other in others] == [3, "S007: 24.00", "P010: 100", ""] * 3
            assert task.cancelled() == (at is not None)
            assert list(await asyncio.gather(drive.position(), drive.target(), drive.torque())) == [3, 3, 0]
            assert drive.stats.timeouts == 0
        return stepper.awaits

    def in_a_loop_of_its_own(at: int | None) -> int:
        with asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
            return runner.run(run(at))

    for at in range(1, in_a_loop_of_its_own(None)):
        in_a_loop_of_its_own(at)


@pytest.mark.parametrize("delay_s", [n / 1000 for n in range(0, 26, 2)])
@pytest.mark.parametrize("on_cancel", ["stop", "detach"])
async def test_a_move_cancelled_at_any_time_has_stopped_or_was_never_sent(delay_s: float, on_cancel: Any) -> None:
    """At 9600 baud and with an eye on the very beginning: a millisecond is a character."""
    async with bench(baudrate=9600) as (drive, far):
        move = drive.move_to(1000, speed_percent=100, on_cancel=on_cancel)
        await asyncio.sleep(delay_s)
        assert move.cancel()
        assert not move.cancel()
        sent = move.sent
        assert await drive.position() >= 0
        with pytest.raises(asyncio.CancelledError):
            await move
        if on_cancel == "detach" and sent:
            assert "STOP" not in lines(far)
            assert motions(far) == ["POSA 1000.00"]
            await until(lambda: far.position == 1000)
        else:
            await stands(far)
            assert motions(far) == ["POSA 1000.00"] * (sent is not None)
            assert lines(far).count("STOP") == (sent is not None)
        assert (await drive.move_to(10)).target == far.position == 10


# The ways that programs are cancelled ------------------------------------------------------------------------------


async def by_timeout(move: compax_aio.Move) -> None:
    async with asyncio.timeout(1):
        await move


async def by_wait_for(move: compax_aio.Move) -> None:
    await asyncio.wait_for(move, 1)


async def by_move_on_after(move: compax_aio.Move) -> None:
    with anyio.move_on_after(1) as scope:
        await move
    assert scope.cancelled_caught


async def by_fail_after(move: compax_aio.Move) -> None:
    with anyio.fail_after(1):
        await move


async def by_gather(move: compax_aio.Move) -> None:
    both = asyncio.gather(move, asyncio.sleep(100))
    asyncio.get_running_loop().call_later(1, both.cancel)
    await both


async def by_a_failing_task_group(move: compax_aio.Move) -> None:
    async def await_it() -> None:
        await move

    async with asyncio.TaskGroup() as tasks:
        tasks.create_task(await_it())
        await asyncio.sleep(1)
        raise ZeroDivisionError


async def by_a_failing_anyio_task_group(move: compax_aio.Move) -> None:
    async def await_it() -> None:
        await move

    async with anyio.create_task_group() as tasks:
        tasks.start_soon(await_it)
        await asyncio.sleep(1)
        raise ZeroDivisionError


async def by_a_cancelled_task(move: compax_aio.Move) -> None:
    async def await_it() -> None:
        await move

    task = asyncio.ensure_future(await_it())
    await asyncio.sleep(1)
    task.cancel()
    await task


async def by_hand(move: compax_aio.Move) -> None:
    await asyncio.sleep(1)
    move.cancel()
    await move


WAYS = [
    by_timeout, by_wait_for, by_move_on_after, by_fail_after, by_gather, by_a_failing_task_group,
    by_a_failing_anyio_task_group, by_a_cancelled_task, by_hand,
]  # fmt: skip


@pytest.mark.usefixtures("nothing_left_behind")
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("on_cancel", ["stop", "detach"])
async def test_whatever_cancels_a_move_stops_the_drive_unless_it_is_detached(
    way: Callable[[compax_aio.Move], Coroutine[Any, Any, None]], on_cancel: Any
) -> None:
    async with bench() as (drive, far):
        move = drive.move_to(1000, on_cancel=on_cancel)
        with contextlib.suppress(TimeoutError, asyncio.CancelledError, ExceptionGroup):
            await way(move)
        assert move.cancelled()
        if on_cancel == "detach":
            assert far.moving
            assert "STOP" not in lines(far)
            await until(lambda: far.position == 1000)
        else:
            await stands(far)
            assert now() < 1.3
            assert lines(far).count("STOP") == 1
        await drive.move_to(0)


@pytest.mark.usefixtures("nothing_left_behind")
@pytest.mark.parametrize("way", WAYS)
async def test_whatever_cancels_a_group_stops_every_drive(
    way: Callable[[Any], Coroutine[Any, Any, None]],
) -> None:
    async with bench("x") as (x, far_x), bench("y") as (y, far_y):
        move = DriveGroup(x=x, y=y).move_to(x=1000, y=2000)
        with contextlib.suppress(TimeoutError, asyncio.CancelledError, ExceptionGroup):
            await way(move)
        assert move.cancelled()
        await stands(far_x)
        await stands(far_y)
        assert now() < 1.3


@pytest.mark.usefixtures("nothing_left_behind")
@pytest.mark.parametrize("error", [ZeroDivisionError, asyncio.CancelledError, KeyboardInterrupt, SystemExit])
async def test_a_block_that_is_left_by_an_error_has_stopped_its_drive(error: type[BaseException]) -> None:
    far = drive_named("x")
    with pytest.raises(error):  # noqa: PT012  # the block is tested
        async with bench() as (drive, _):
            move = drive.move_to(1000)
            await asyncio.sleep(1)
            raise error
    assert not far.moving
    assert isinstance(await ending(move), MoveStoppedError)


@pytest.mark.usefixtures("nothing_left_behind")
async def test_a_block_inside_a_cancelled_anyio_scope_is_left_with_its_drive_standing() -> None:
    far = drive_named("x", Knobs(stop_ramp_ms=2000))
    with anyio.move_on_after(1) as scope:
        async with bench() as (drive, _):
            async for _position in drive.move_to(1000).positions():
                pass
    assert scope.cancelled_caught
    assert not far.moving
    assert not drive.is_open


@pytest.mark.usefixtures("nothing_left_behind")
async def test_closing_is_carried_through_although_its_caller_is_cancelled_again_and_again() -> None:
    far = drive_named("x", Knobs(stop_ramp_ms=2000))
    async with bench() as (drive, _):
        move = drive.move_to(2000)
        await asyncio.sleep(1)
        closing = asyncio.ensure_future(drive.close())
        for _ in range(10):
            await asyncio.sleep(0.05)
            closing.cancel()
        with pytest.raises(asyncio.CancelledError):
            await closing
        assert not far.moving
        assert not drive.is_open
        assert isinstance(await ending(move), MoveStoppedError)


@pytest.mark.usefixtures("nothing_left_behind")
async def test_cancelling_in_doubt_stops_the_drive_as_soon_as_it_hears() -> None:
    async with bench(settings=DriveSettings(stop_timeout_s=30)) as (drive, far):
        move = drive.move_to(100_000)
        await asyncio.sleep(1)
        far.deaf = True
        await until(lambda: drive.stats.timeouts == 1)
        move.cancel()
        await asyncio.sleep(5)
        far.deaf = False
        await until(lambda: not far.moving, 3)
        assert "STOP" in lines(far)


@pytest.mark.usefixtures("nothing_left_behind")
async def test_a_read_that_is_cancelled_while_it_waits_is_not_sent() -> None:
    async with bench() as (drive, far):
        first = asyncio.ensure_future(drive.position())
        second = asyncio.ensure_future(drive.torque())
        await asyncio.sleep(0)
        second.cancel()
        await first
        assert await drive.speed() == 0
        assert "S5" not in lines(far)


@pytest.mark.usefixtures("nothing_left_behind")
async def test_one_of_those_who_share_a_read_can_leave() -> None:
    async with bench(position=3) as (drive, _):
        readers = [asyncio.ensure_future(drive.position()) for _ in range(5)]
        await asyncio.sleep(0)
        readers[0].cancel()
        readers[3].cancel()
        results = await asyncio.gather(*readers, return_exceptions=True)
        assert [result for result in results if not isinstance(result, BaseException)] == [3, 3, 3]


@pytest.mark.usefixtures("nothing_left_behind")
async def test_cancelling_a_move_that_is_over_changes_nothing() -> None:
    async with bench() as (drive, far):
        move = drive.move_to(10)
        result = await move
        assert not move.cancel()
        assert await move == result
        assert "STOP" not in lines(far)


@pytest.mark.usefixtures("nothing_left_behind")
async def test_waiting_for_the_acceptance_alone_can_be_given_up_without_the_move() -> None:
    async with scripted({"PA10$": None}) as (drive, far):
        move = drive.move_to(10)
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(move.accepted, 0.5)
        assert not move.done()
        far.answers |= {"S16": "S016: 11011000", "S1": "S001: 10.00"}
        assert (await move).target == 10
        assert far.lines.count("PA10$") == 1


# The end of the event loop --------------------------------------------------------------------------------------


@pytest.mark.parametrize("in_flight", [True, False])
def test_an_event_loop_that_ends_stops_a_drive_that_nobody_closed(in_flight: bool) -> None:

    async def main() -> None:
        drive = await compax_aio.connect("sim://compax?name=x")
        move = drive.move_to(100_000)
        await move.accepted
        keep.append((drive, move, drive_named("x")))
        if in_flight:
            keep.append(asyncio.ensure_future(drive.position()))
            await asyncio.sleep(0)

    # Kept, as by a program that forgets to close.
    keep: list[Any] = []
    with asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
        runner.run(main())
    far = keep[0][2]
    assert far.log.texts(LogKind.LINE).count("STOP") == 1
    assert far.log.texts(LogKind.MOTION_STOPPED)
    assert keep[0][1].cancelled()


def test_an_event_loop_that_ends_does_not_take_a_stop_back_that_waits_for_its_turn() -> None:
    keep: list[Any] = []

    async def main() -> None:
        drive = await compax_aio.connect("sim://compax?name=x")
        move = drive.move_to(100_000)
        await move.accepted
        reading = asyncio.ensure_future(drive.position())
        await asyncio.sleep(0)
        move.cancel()
        keep.append((drive, reading, drive_named("x")))
        await asyncio.sleep(0)
        assert "STOP" not in lines(drive_named("x"))

    with asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
        runner.run(main())
    far = keep[0][2]
    assert "STOP" in lines(far)
    assert far.log.texts(LogKind.MOTION_STOPPED)
