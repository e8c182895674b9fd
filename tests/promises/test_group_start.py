"""
P2, P3, P5 and P10 for groups and prepared moves: whole applications in trouble, each from one seed, in virtual time.

Checked at the far end's own log. ``COMPAX_SEEDS=5000`` runs more, ``COMPAX_SEED=17`` one alone, with its whole story.
"""

from __future__ import annotations

import asyncio
import os
from collections.abc import Awaitable, Callable
from contextlib import AsyncExitStack, suppress
from dataclasses import dataclass, field
from random import Random
from typing import Any

import pytest
from tests.promises.bench import lines, motions, now

import compax_aio
from compax_aio import CommandRejectedError, CompaxError, Drive, DriveGroup, DriveSettings, MoveResult
from compax_aio.compax.group import GroupMove
from compax_aio.compax.moves import Move, OnCancel, fetch_error
from compax_aio.simulator.clock import VirtualClockLoop
from compax_aio.simulator.compax import Knobs, SimulatedDrive
from compax_aio.simulator.compax.instructions import MoveTo
from compax_aio.simulator.compax.refusals import RefusedError
from compax_aio.simulator.server import drive_named

AXES = "xyz"
ACTIONS = 4
"""Of each of the users."""
LONGEST_S = 300.0
"""Each action of a user ends within some 20 s: 3 s of patience in doubt, time-outs of 0.3 s, and stops of 3 s."""

SEEDS = int(os.environ.get("COMPAX_SEEDS", "200"))
PIECES = 8


@dataclass(eq=False)
class Call:
    """A motion that a user has asked for: what it may say on the line, and how it ended."""

    axis: str
    text: str
    """The line that starts it, without signs."""
    begun: str | None
    """What the far end logs when it begins; None where that cannot be told from others."""
    move: Move | None = None
    outcome: MoveResult | BaseException | None = None
    position_then: float | None = None


@dataclass(eq=False)
class Application:
    """Some drives, some users who do what comes to their minds, and somebody who makes trouble."""

    random: Random
    drives: dict[str, Drive] = field(default_factory=dict)
    far: dict[str, SimulatedDrive] = field(default_factory=dict)
    calls: list[Call] = field(default_factory=list)
    story: list[str] = field(default_factory=list)
    may_go_on: set[str] = field(default_factory=set)
    """Axes that may move after the block was left: detached, moved by a stranger, or in doubt."""
    power_cycled: set[str] = field(default_factory=set)
    _targets: int = 0

    # What users do

    def new_number(self) -> float:
        """Return a position that no other call has, so that the log says whose motion began."""
        self._targets += 1
        return round(self.random.uniform(5, 60), 0) * self.random.choice((-1, 1, 4)) + self._targets / 100

    def told(self, what: str) -> None:
        self.story.append(f"{now():8.4f} {what}")

    def note(self, axis: str, move: Move) -> Call:
        call = Call(axis, move.plan.motion, None, move)
        if move.plan.target is not None:
            call.begun = f"POSA {move.plan.target:.2f}"
        self.calls.append(call)
        move.add_done_callback(fetch_error)
        if move.on_cancel == "detach":
            self.may_go_on.add(axis)
        self.told(f"{axis}: {type(move).__name__} {move.plan.description} {move.on_cancel}")

        def ended(_: object) -> None:
            call.position_then = self.far[axis].position
            call.outcome = asyncio.CancelledError() if move.cancelled() else move.exception() or move.result()
            self.told(f"{axis}: {move.plan.description} at {call.position_then:.2f}: {call.outcome!r}")

        move.add_done_callback(ended)
        return call

    async def act(self) -> None:
        """Do one thing to the end, or give it up."""
        axis = self.random.choice(list(self.drives))
        actions: list[tuple[int, Callable[[str], Awaitable[None]]]] = [
            (5, self.move_a_group), (3, self.prepare), (3, self.move), (1, self.home), (2, self.stop),
            (2, self.read), (1, self.watch), (2, self.tell), (1, self.run_program), (1, self.reconcile),
        ]  # fmt: skip
        ((_, action),) = self.random.choices(actions, [weight for weight, _ in actions])
        try:
            await action(axis)
        except CompaxError as error:
            self.told(f"{axis}: {action.__name__}: {error!r}")

    async def move_a_group(self, _: str) -> None:
        group = DriveGroup(**self.drives)
        move: GroupMove
        if self.random.random() < 0.15:
            move = group.home()
        else:
            axes = self.random.sample(list(self.drives), self.random.randint(1, len(self.drives)))
            options: Any = {"speed_percent": self.random.choice((None, 50, 100)), "timeout_s": self.maybe_budget()}
            options |= {axis: self.new_number() for axis in axes}
            move = group.move_to(**options)
        move.add_done_callback(fetch_error)
        for axis, each in move.moves.items():
            self.note(axis, each)
        await self.see_it_through(move, list(move.moves.values()))

    async def prepare(self, axis: str) -> None:
        on_cancel: OnCancel = self.random.choice(("stop", "stop", "detach"))
        points: Any = {"comparators": [(2, 3)]} if self.random.random() < 0.2 else {}
        make = self.random.choice((self.drives[axis].prepare_move_to, self.drives[axis].prepare_move_by))
        move = make(self.new_number(), on_cancel=on_cancel, timeout_s=self.maybe_budget(), **points)
        self.note(axis, move)
        futures: list[asyncio.Future[Any]] = [move, move.ready]
        await asyncio.wait(futures, return_when=asyncio.FIRST_COMPLETED)
        await asyncio.sleep(self.random.choice((0, 0, 0.01, 0.5, 2)))
        if self.random.random() < 0.3:
            move.cancel()
        with suppress(compax_aio.MoveError):
            move.trigger()
        await self.see_it_through(move, [move])

    async def move(self, axis: str) -> None:
        on_cancel: OnCancel = self.random.choice(("stop", "stop", "detach"))
        make = self.random.choice((self.drives[axis].move_to, self.drives[axis].move_by))
        options: Any = {"speed_percent": self.random.choice((None, 100)), "timeout_s": self.maybe_budget()}
        move = make(self.new_number(), on_cancel=on_cancel, **options)
        self.note(axis, move)
        await self.see_it_through(move, [move])

    async def home(self, axis: str) -> None:
        move = self.drives[axis].home(timeout_s=self.maybe_budget())
        self.note(axis, move)
        await self.see_it_through(move, [move])

    async def see_it_through(self, move: asyncio.Future[Any], moves: list[Move]) -> None:
        """Await it, perhaps not for long, or stop it on the way."""
        way = self.random.choice(("await", "await", "time out", "cancel", "stop", "stop one"))
        patience_s = self.random.choice((0, 0.001, 0.005, 0.02, 0.1, 1.0))
        if way != "await":
            await asyncio.wait([move], timeout=patience_s)
            self.told(f"{way} after {patience_s} s")
        if way == "time out":
            with suppress(TimeoutError, asyncio.CancelledError):
                await asyncio.wait_for(move, self.random.choice((0.001, 0.05, 0.5)))
        elif way == "cancel":
            move.cancel()
        elif way == "stop":
            await moves[0].stop()
        elif way == "stop one":
            await self.drives[self.random.choice(list(self.drives))].stop()
        await asyncio.wait([move])
        if not move.cancelled():
            move.exception()

    async def stop(self, axis: str) -> None:
        if self.random.random() < 0.5:
            await self.drives[axis].stop()
        else:
            await DriveGroup(**self.drives).stop()

    async def read(self, axis: str) -> None:
        readings = [self.drives[axis].position() for _ in range(self.random.randint(1, 4))]
        results = await asyncio.gather(*readings, self.drives[axis].status(), return_exceptions=True)
        assert all(isinstance(result, CompaxError) or not isinstance(result, BaseException) for result in results)

    async def watch(self, axis: str) -> None:
        seen = 0
        async for _ in self.drives[axis].watch("position", "torque", interval_s=0.05):
            seen += 1
            if seen == 5:
                return

    async def tell(self, axis: str) -> None:
        number = self.new_number()
        call = Call(axis, f"PA{number:.2f}", f"POSA {number:.2f}")
        self.calls.append(call)
        self.told(f"{axis}: command({call.text!r})")
        await self.give_up_perhaps(self.drives[axis].command(call.text))

    async def run_program(self, axis: str) -> None:
        self.told(f"{axis}: program")
        program = self.drives[axis].program
        await self.give_up_perhaps(program.start(1))
        if self.random.random() < 0.7:
            await program.wait_finished(2)

    async def give_up_perhaps(self, work: Awaitable[Any]) -> None:
        with suppress(TimeoutError):
            await asyncio.wait_for(work, self.random.choice((0.001, 0.01, None, None)))

    async def reconcile(self, axis: str) -> None:
        with suppress(compax_aio.CommandRejectedError):
            await self.drives[axis].quit()
        await self.drives[axis].reconcile()

    def maybe_budget(self) -> float | None:
        return self.random.choice((None, None, None, 0.3))

    async def use(self) -> None:
        for _ in range(ACTIONS):
            await self.act()
            await asyncio.sleep(self.random.choice((0, 0, 0.003, 0.2)))

    # What befalls the drives

    async def make_trouble(self) -> None:
        for _ in range(self.random.randint(0, 6)):
            await asyncio.sleep(self.random.choice((0.001, 0.004, 0.02, 0.1, 0.7, 2.0)) * self.random.random() * 2)
            axis = self.random.choice(list(self.far))
            await self.befall(axis, self.far[axis])

    async def befall(self, axis: str, far: SimulatedDrive) -> None:
        kind = self.random.choice(
            ("lose", "deaf", "silent", "late", "lose $", "late $", "fault", "noise", "power", "stranger")
        )
        lasts_s = self.random.choice((0.003, 0.05, 0.4, 1.5))
        self.told(f"{axis}: trouble: {kind} {lasts_s} s")
        match kind:
            case "lose":
                far.lose_answers += self.random.randint(1, 3)
            case "deaf" | "silent":
                setattr(far, kind, True)
                await asyncio.sleep(lasts_s)
                setattr(far, kind, False)
            case "late":
                far.extra_answer_delay_s = lasts_s
                await asyncio.sleep(2 * lasts_s)
                far.extra_answer_delay_s = 0
            case "lose $":
                far.lose_position_reached += 1
            case "late $":
                far.delay_position_reached_s = lasts_s
            case "fault":
                far.raise_fault(self.random.choice((20, 55)))
            case "noise":
                far.inject(self.random.choice((b"\x00\xff", b"S00", b"\xa5?", b"?\r\n")))
            case "power":
                self.power_cycled.add(axis)
                far.power_cycle()
            case "stranger":
                self.may_go_on.add(axis)
                with suppress(RefusedError):  # at the drive's own panel: its answer is not on this line
                    far._machine.execute(MoveTo(777), False, now())

    # All of it

    async def run(self) -> None:
        async with AsyncExitStack() as stack:
            for axis in AXES[: self.random.randint(2, 3)]:
                self.far[axis] = drive_named(axis, self.knobs())
                self.far[axis].load_program(["WAIT 100", "POSA 333", "END"])
                url = f"sim://compax?name={axis}"
                drive = await compax_aio.connect(url, name=axis, settings=self.settings())
                self.drives[axis] = drive
                stack.push_async_callback(self.leave, axis, drive)
            users = [asyncio.ensure_future(self.use()) for _ in range(self.random.randint(1, 2))]
            trouble = asyncio.ensure_future(self.make_trouble())
            leaves_early = self.random.random() < 0.3
            _, waiting = await asyncio.wait(users, timeout=self.random.random() * 10 if leaves_early else LONGEST_S)
            self.told(f"users done: {not waiting}")
            assert leaves_early or not waiting, "it does not end"
            await trouble
            for far in self.far.values():
                far.lose_answers = 0
        _, waiting = await asyncio.wait(users, timeout=LONGEST_S)
        assert not waiting, "a user waits for ever"
        for user in users:
            user.result()
        began = {axis: len(motions(far)) for axis, far in self.far.items()}
        for axis, far in self.far.items():
            self.told(f"{axis}: moving {far.moving}")
            # A fault has a ramp of its own.
            assert axis in self.may_go_on or not far.moving or far.fault is not None, f"{axis} goes on"
        await asyncio.sleep(60)
        assert {axis: len(motions(far)) for axis, far in self.far.items() if axis not in self.may_go_on} == {
            axis: count for axis, count in began.items() if axis not in self.may_go_on
        }

    async def leave(self, axis: str, drive: Drive) -> None:
        try:
            await drive.close()
        except CompaxError as error:
            self.may_go_on.add(axis)
            self.told(f"{axis}: closed: {error!r}")

    def knobs(self) -> Knobs:
        return Knobs(
            store=self.random.choice(("until_executed", "until_next_line")),
            answer_time_s=self.random.choice((0.002, 0.01, 0.05)),
            position_reached=self.random.choice(("prompt_first", "prompt_first", "final_only")),
            error_style=self.random.choice(("code", "code", "text")),
        )

    def settings(self) -> DriveSettings:
        return DriveSettings(
            answer_timeout_s=0.3,
            in_doubt_after_s=3,
            stop_timeout_s=3,
            standstill_timeout_s=3,
            stall_timeout_s=3,
            message_when_prepared=self.random.random() < 0.5,
            verify_messages=self.random.random() < 0.2,
        )

    # What must be true

    def check(self) -> None:
        for axis, far in self.far.items():
            mine = [call for call in self.calls if call.axis == axis]
            self.check_lines(far, mine)
            self.check_motions(far, mine)
            for call in mine:
                self.check_outcome(far, call)

    def check_lines(self, far: SimulatedDrive, calls: list[Call]) -> None:
        """Each call puts what starts its motion on the wire once at most; a trigger is one, too."""
        said = lines(far)
        for call in calls:
            if call.text != "PH":
                assert sum(line in {call.text, f"{call.text}$"} for line in said) <= 1, call
                assert sum(line in {f"{call.text},", f"{call.text}$,"} for line in said) <= 1, call
            if call.move is not None and call.move.sent == "!":
                assert call.text == "PH" or not {call.text, f"{call.text}$"} & set(said), call
        assert said.count("!") <= sum(call.move is not None and call.move.sent == "!" for call in calls)
        homes = [call for call in calls if call.text == "PH"]
        assert sum(line == "PH" for line in said) <= sum(
            call.move is not None and call.move.sent == "PH" for call in homes
        )

    def check_motions(self, far: SimulatedDrive, calls: list[Call]) -> None:
        begun = motions(far)
        for call in calls:
            if call.begun is not None:
                assert begun.count(call.begun) <= 1, call
        expected = {call.begun for call in calls}
        for motion in begun:
            if motion.startswith("POSA ") and not motion.startswith("POSA HOME"):
                assert motion in expected | {"POSA 333.00", "POSA 777.00"}, motion
        assert sum(each.startswith("POSR") for each in begun) <= sum(call.text.startswith("PR") for call in calls)
        assert sum(each.startswith("POSA HOME") for each in begun) <= sum(call.text == "PH" for call in calls)
        assert begun.count("POSA 333.00") <= lines(far).count("START")

    def check_outcome(self, far: SimulatedDrive, call: Call) -> None:
        move, outcome = call.move, call.outcome
        if move is None:
            return
        assert move.done(), call
        if isinstance(outcome, MoveResult):
            assert move.accepted.done(), call
            if outcome.target is not None:
                assert call.position_then == pytest.approx(outcome.target, abs=0.051), call
        elif move.sent is None:
            assert not {call.text, f"{call.text}$"} & set(lines(far)) or call.text == "PH", call
            assert call.begun not in motions(far), call
        elif isinstance(outcome, CommandRejectedError) or "was not taken" in str(outcome):
            # A drive that was switched off on the way looks as if it had never begun.
            assert call.axis in self.power_cycled or call.begun not in motions(far), call
        assert isinstance(outcome, MoveResult | CompaxError | asyncio.CancelledError), call


def run_application(seed: int) -> None:
    """Run the application of *seed*, and check it; whatever is wrong is told with the seed and the whole story."""
    complaints: list[str] = []
    application = Application(Random(seed))

    async def main() -> None:
        asyncio.get_running_loop().set_exception_handler(lambda _, context: complaints.append(str(context)))
        await application.run()
        application.check()
        left = [task for task in asyncio.all_tasks() if task is not asyncio.current_task()]
        assert not left

    try:
        with asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
            runner.run(main())
        assert not complaints
    except BaseException as error:
        logs = (f"{axis}: {entry}" for axis, far in application.far.items() for entry in far.log)
        story = "\n".join([*application.story, *complaints, *(logs if "COMPAX_SEED" in os.environ else ())])
        error.add_note(f"replay: COMPAX_SEED={seed}\n{story}")
        raise


def seeds_of(piece: int) -> list[int]:
    if "COMPAX_SEED" in os.environ:
        return [int(os.environ["COMPAX_SEED"])] if piece == 0 else []
    return list(range(piece, SEEDS, PIECES))


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("piece", range(PIECES))
def test_whatever_users_and_lines_do_every_call_moves_once_at_most_and_what_is_told_is_true(piece: int) -> None:
    for seed in seeds_of(piece):
        run_application(seed)
