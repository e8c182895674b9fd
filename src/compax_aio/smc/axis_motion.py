"""What moves one axis: at most one motion, the soft stop before everything, and the abort of all axes."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Protocol

from ..errors import CompaxError, MoveActiveError, MoveError, MoveStoppedError
from ..link.contract import Lane
from ..motion.events import DriveEvent
from ..motion.moves import OnCancel, check_manner
from ..motion.one_move import OneMove
from ..motion.untracked import Untracked
from .codecs import AxisStatus
from .facts import COMMANDS, PROGRAM_ENTRY, command_of
from .moves import AxisMove
from .observer import Look, Observer
from .protocol_events import Answered, EntryFailed
from .pursuit import Pursuit
from .reports import AxisReports
from .stopping import Stop
from .vocabulary import MotionKind, MotionPlan, plan_run

__all__ = ["AxisMotion", "Programming"]

_log = logging.getLogger("compax_aio.smc")


@dataclass(slots=True)
class _Memory:
    """What is remembered of an axis from one motion to the next."""

    doubt: str | None = None


class Programming(Protocol):
    """Who has the axis in program entry, where it stores what it is told."""

    @property
    def is_inside(self) -> bool:
        """Whether what the axis is told now is stored, for certain."""

    def interrupt(self) -> None:
        """End the entry as soon as possible: a stop waits for that."""

    def note_left(self, *, certainly: bool) -> None:
        """Take note that the axis has left program entry, or may have."""


class AxisMotion(OneMove[Pursuit, Look, str]):
    """
    Moves one axis; :class:`~compax_aio.smc.axis.SmcAxis` is the face it has for callers.

    Args:
        observer: Of the axis.
        publish: Called with what happens to motions, and with standstills after stops.
    """

    def __init__(self, observer: Observer, publish: Callable[[DriveEvent], None]) -> None:
        self._observer = observer
        self._axis_reports = AxisReports(observer)
        super().__init__(
            observer.name,
            observer.line.link,
            reports=self._axis_reports,
            untracked=Untracked(self._command, self._axis_reports),
            memory=_Memory(),
            log=_log,
            publish=publish,
        )
        self.may_be_in_entry = False
        """Whether the axis may be in program entry, where it stores what it is told, a look or a stop as well."""
        self._programming: Programming | None = None

    # Starting -------------------------------------------------------------------------------------------------------

    def check(self, plan: MotionPlan) -> None:
        """Raise what :meth:`start` would raise."""
        self.check_free(plan.description)
        if plan.kind is MotionKind.MOVE_TO and (why := self._observer.lost_reference) is not None:
            raise self._axis_reports.no_reference(plan.description, why)

    def start(
        self, plan: MotionPlan, timeout_s: float | None, on_cancel: OnCancel, *, sets_origin: bool = False
    ) -> AxisMove:
        """
        Send *plan* as soon as the line is free, after a stop that is under way.

        Raises:
            MoveActiveError: Another motion runs.
            MoveInDoubtError: What became of the last one is unknown.
            MoveError: It leads to a position, and nobody knows what positions are counted from.
            InvalidCommandError: *timeout_s* or *on_cancel* means nothing.
        """
        check_manner(timeout_s, on_cancel)
        self.check(plan)
        move = AxisMove(self, plan, on_cancel)
        patience_s = self._observer.line.settings.in_doubt_after_s
        if plan.kind is MotionKind.PROGRAM and timeout_s is not None:
            patience_s = max(patience_s, timeout_s)  # an axis that runs a program may say nothing meanwhile (DCB p. 27)
        pursuit = Pursuit(
            move, self._observer, self._axis_reports, self._memory, sets_origin=sets_origin, patience_s=patience_s
        )
        self._begin(pursuit)
        self._limit(move, timeout_s)
        return move

    async def change_speed(self, move: AxisMove, speed_steps_s: int) -> None:
        """Let *move*, a run, go on at another speed, when its ramp is over: an action waits for that (DCB p. 27)."""
        text = plan_run(speed_steps_s, self._observer.line.settings.profile).text
        while True:
            if move.plan.kind is not MotionKind.RUN or not self._is_active(move) or not move.accepted.done():
                raise MoveError(
                    f"{move.description} is no run that is under way, so its speed cannot be changed",
                    device=self.name,
                    hint="await accepted first; a move travels at the slew speed of the settings",
                )
            status = await self._observer.status()
            if not status.ramping:
                break
            await asyncio.sleep(self._observer.line.settings.poll_first_s)
        try:
            await self.untracked.say(text, Lane.MOTION, self._observer.note_moving)
        except CompaxError as error:
            if self._is_active(move) and not isinstance(error, MoveStoppedError):
                self.begin_stop(self._axis_reports.speed_in_doubt(move, error))
            raise

    async def _make_ready(self, text: str) -> None:
        await self.refuse_if_moving(repr(text))

    async def refuse_if_moving(self, what: str) -> None:
        """Raise MoveActiveError, or MoveInDoubtError, if the axis moves or may: *what* was not sent."""
        self.check_free(what)
        look = await self._observer.look(Lane.MOTION)
        if not look.status.is_settled:
            raise MoveActiveError(
                f"the axis moves, so {what} was not sent",
                device=self.name,
                received=look.as_sent,
                hint="the axis would hold it back, and the whole line with it (DCB p. 27): wait, or stop() first",
            )

    async def _command(self, text: str, lane: Lane, on_sent: Callable[[], None]) -> str:
        """Send what may start a motion, once, and return its answer, which only an unknown command may have."""

        def written() -> None:
            self._observer.note_moving()
            on_sent()

        line, axis = self._observer.line, self._observer.axis
        before, times_lost = self._observer.standing_at, self._observer.times_lost
        outcome = await line.start(axis, text, lane, written)
        if isinstance(outcome, EntryFailed) and not outcome.was_begun:
            # It may have kept silent because it was reset, and count from elsewhere now.
            if before is not None:
                self._observer.note_standing(before)
            await self.refuse_if_moving(repr(text))
            if (why := self._observer.lost_reference) is not None and self._observer.times_lost != times_lost:
                raise self._axis_reports.no_reference(repr(text), why)
            outcome = await line.start(axis, text, lane, written)
        is_known = text[0] in COMMANDS
        if isinstance(outcome, Answered) and not is_known and outcome.text not in line.settings.profile.refusals:
            return outcome.text
        if (error := line.refusal(axis, text, outcome)) is not None:
            raise error
        return ""

    # Program entry --------------------------------------------------------------------------------------------------

    def check_free(self, what: str) -> None:
        """Raise MoveActiveError or MoveInDoubtError if no motion can begin: *what* was not sent."""
        if self._programming is not None:
            raise MoveActiveError(
                f"the axis's program is being written, so {what} was not sent",
                device=self.name,
                hint="the axis would store it instead of obeying (DCB p. 24): await the writing, or cancel it",
            )
        super().check_free(what)

    async def begin_programming(self, what: str, programming: Programming) -> None:
        """Take no motion until :meth:`end_programming`, and tell *programming* of stops; raises as :meth:`tell`."""
        stops = self.stops
        await self._until_free(what)
        await self.refuse_if_moving(what)
        if self.stops != stops:
            raise self._reports.taken_back(what)
        self.check_free(what)  # a move may have begun meanwhile
        self._programming = programming

    def end_programming(self, doubt: str | None) -> None:
        """Take motions again; not if the axis may still be in program entry, by *doubt*."""
        self._programming = None
        if doubt is not None:
            self.note_doubt(doubt)
            self.may_be_in_entry = True

    @property
    def is_storing(self) -> bool:
        """Whether the axis stores what it is told, for certain: what is left of a damaged instruction as well."""
        return self._programming is not None and self._programming.is_inside

    def note_aborted(self) -> None:
        """Take note that ESC or ^C was sent, which ends program entry (DCB p. 26-27)."""
        if self._programming is not None:
            self._programming.note_left(certainly=True)
        if self.may_be_in_entry:
            self._memory.doubt, self.may_be_in_entry = None, False

    # Looking --------------------------------------------------------------------------------------------------------

    async def read_position(self) -> float:
        """Read the position in steps."""
        return await self._observer.position(Lane.READ)

    async def reconcile(self) -> AxisStatus:
        """Read status and position, and end the doubt: the caller has looked, and takes the position as it is."""
        mark = self.untracked.mark()
        look = await self._observer.look()
        self._memory.doubt, self.may_be_in_entry = None, False
        self._observer.lost_reference = None
        if look.status.is_settled:
            self.untracked.note_over(mark)
            self._observer.note_standing(look.position)
        return look.status

    # Stopping -------------------------------------------------------------------------------------------------------

    def begin_stop(self, reason: MoveError | None = None) -> asyncio.Task[None]:
        """Send the stop, at once or as soon as program entry has ended; see :class:`OneMove`."""
        if self._programming is not None:
            self._programming.interrupt()
        return super().begin_stop(reason)

    async def end(self) -> None:
        """Stop what was started here, unless it was to go on, or the axis may store the stop; raises what that does."""
        doubt = self._memory.doubt
        if doubt is not None and self.may_be_in_entry and not self.is_watched:
            raise self._reports.left_without_stop(doubt, "look at the machine before you connect again")
        await super().end()

    def _send_stop(self) -> Callable[[], Awaitable[Look]]:
        return Stop(self._observer).carry_through

    def _conclude_stopped(self, pursuit: Pursuit, standstill: Look, reason: MoveError | None) -> None:
        pursuit.conclude_stopped(standstill, reason)

    def withdraw(self, why: str) -> None:
        """Let no motion that waits for its turn be sent."""
        self.untracked.take_back()
        if self._active is not None and not self._active.move.is_on_wire:
            self._withdraw(self._active.move, self._axis_reports.no_reference(self._active.move.description, why))

    @property
    def is_watched(self) -> bool:
        """Whether a motion of this end runs, or a stop is under way."""
        return self._active is not None or self._stopping is not None

    def cut_off(self, why: str) -> MoveStoppedError:
        """Make the error of a motion that was ended without a ramp."""
        return self._axis_reports.cut_off(why)

    def note_doubt(self, why: str) -> None:
        """Take no motion until somebody has looked; that the axis may be in program entry goes before all else."""
        before = self._memory.doubt
        super().note_doubt(before if self.may_be_in_entry and before is not None else why)

    def note_damage(self, holds: tuple[str, ...]) -> None:
        """Take note that the axis may execute one of *holds*; if that may move it, it is stopped at once."""
        if self._programming is None and any(text.startswith(PROGRAM_ENTRY) for text in holds):
            self.note_doubt(
                "a command was damaged on the line and may have begun program entry, where the axis stores what it is "
                "told instead of obeying, stops as well; abort_all() ends it"
            )
            self.may_be_in_entry = True
        if any(command_of(text).moves for text in holds):
            reason = self._axis_reports.damaged(holds)
            _log.warning("%s", reason)
            self.begin_stop(reason)

    def note_reset(self) -> None:
        """Take note that the axis was reset: whatever was in doubt is over, and it moves nowhere."""
        self._memory.doubt, self.may_be_in_entry = None, False
        if self._programming is not None:
            self._programming.note_left(certainly=False)
