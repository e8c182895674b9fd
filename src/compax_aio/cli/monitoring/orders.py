"""What is asked of one axis by key: to move, to stop, to forget an error; done aside, and told when it is known."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from dataclasses import dataclass, replace
from typing import Any

from compax_aio import Drive, Move
from compax_aio.errors import CompaxError, MoveInDoubtError, MoveStoppedError, MoveTimeoutError

from ..in_doubt import may_go_on
from .diary import Diary
from .levels import Level
from .state import AxisState, StopReport
from .words import by_keys

__all__ = ["Farewell", "Orders"]


@dataclass(frozen=True, slots=True)
class Farewell:
    """What became of one axis when the monitor was left."""

    axis: str
    text: str
    """Empty where nothing of it was started here, and it stands as far as is known."""
    error: BaseException | None = None
    """Why nobody can say that it stands, although it was started here."""


class Orders:
    """
    What is asked of one axis. No method waits: keys must be heard while an axis does not answer.

    Args:
        state: Where it stands what was started and what came of it.
        diary: Where everything is written down.
        jog_percent: Speed of a jog, in % of nominal speed.

    Attributes:
        drive: The axis's drive, from when its line was opened first; None: nothing can be sent.
    """

    def __init__(self, state: AxisState, diary: Diary, jog_percent: float) -> None:
        self.drive: Drive | None = None
        self._state = state
        self._diary = diary
        self._jog_percent = jog_percent
        self._move: Move | None = None
        self._jogs: float | None = None
        """By how much a jog moves that is not over."""
        self._stopping: asyncio.Task[None] | None = None
        self._tasks: set[asyncio.Task[None]] = set()
        self._in_doubt: str | None = None
        self._is_closed = False

    @property
    def may_move_by_us(self) -> bool:
        """Whether a motion was started here that is not known to be over, or a stop from here failed."""
        return self._move is not None or self._in_doubt is not None

    @property
    def doubt(self) -> str | None:
        """What of here may still move the axis, also if its line was opened anew since; None: nothing."""
        return self._in_doubt

    def _now(self) -> float:
        return asyncio.get_running_loop().time()

    def _tell(self, text: str, level: Level = Level.QUIET) -> None:
        self._diary.add(self._state.name, by_keys(text), level)

    def _spawn(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    # Moving ---------------------------------------------------------------------------------------------------------

    def jog(self, distance: float) -> None:
        """Move by *distance*; while a jog runs, the same direction does nothing, and the other one stops the axis."""
        if self._jogs is not None:
            if self._jogs * distance < 0:
                self.stop()
            return
        what = f"jog {distance:+g} {self._state.unit}"
        if self._begin(what, lambda drive: drive.move_by(distance, speed_percent=self._jog_percent)):
            self._jogs = distance

    def home(self) -> None:
        """Find machine zero, if nothing moves that was started here."""
        self._begin("search for machine zero", lambda drive: drive.home())

    def _begin(self, what: str, start: Callable[[Drive], Move]) -> bool:
        drive = self.drive
        if drive is None or not drive.is_open:
            self._tell(f"{what}: nothing was sent, there is no line", Level.ATTENTION)
        elif self._stopping is not None:  # the drive would take it as soon as it stands
            self._tell(f"{what}: nothing was sent, a stop is under way", Level.ATTENTION)
        elif self._move is not None:
            self._tell(f"{what}: nothing was sent, {self._state.own_motion} is not over", Level.ATTENTION)
        elif self._in_doubt is not None:
            self._tell(f"{what}: nothing was sent, for {self._in_doubt}; look at it, then r", Level.ATTENTION)
        else:
            try:
                move = start(drive)
            except CompaxError as error:
                self._tell(f"{what}: {self._plain(error)}", Level.ATTENTION)
                return False
            self._move, self._state.own_motion = move, what
            self._tell(f"{what}: begun here", Level.ACTIVE)
            self._spawn(self._see_to_its_end(move, what))
            return True
        return False

    async def _see_to_its_end(self, move: Move, what: str) -> None:
        try:
            await asyncio.wait([move])
        finally:
            self._move = self._jogs = self._state.own_motion = None
            self._state.own_ended_at = self._now()
        error = None if move.cancelled() else move.exception()
        if error is not None:
            is_in_doubt = may_go_on(move, line_is_there=self.drive is not None and self.drive.is_open)
            if is_in_doubt:
                self._in_doubt = f"what became of {what} is not known"
            self._tell(f"{what}: {self._plain(error)}", Level.ALARM if is_in_doubt else Level.ATTENTION)
        elif not move.cancelled():
            result, state = move.result(), self._state
            where = "" if result.target is None else f" {result.target:.{state.decimals}f} {state.unit}"
            self._tell(f"{what}: reached{where}, confirmed by {result.confirmed_by}", Level.ACTIVE)

    def _plain(self, error: BaseException) -> str:
        """Say an error to somebody who knows of which axis it is, and who has stopped it."""
        return error.what if isinstance(error, MoveStoppedError) else str(error).removeprefix(f"{self._state.name}: ")

    # Stopping -------------------------------------------------------------------------------------------------------

    def stop(self) -> None:
        """Stop the drive ahead of everything else; what comes of it stands in the state and the diary."""
        if self._stopping is not None or self._is_closed:
            return  # it is repeated until it is acknowledged
        if self.drive is None:
            text = "STOP was not sent, there is no line: use the emergency stop if it moves"
            self._report_stop(Level.ALARM, text)
            return
        how = "waiting for the drive to acknowledge it"
        if not self.drive.is_open:
            how = "the line is lost, so it waits for it: use the emergency stop if it moves"
        self._state.stop = StopReport(self._now(), Level.WAITING, how)
        self._stopping = self._spawn(self._carry_stop_through(self.drive))

    async def _carry_stop_through(self, drive: Drive) -> None:
        try:
            await drive.stop()
        except CompaxError as error:
            self._in_doubt = "a stop was not seen to its end"
            why = error.what.removeprefix("STOP was not acknowledged: ")
            was_taken = isinstance(error, MoveTimeoutError) or why.startswith("STOP was acknowledged")
            outcome = "ACKNOWLEDGED, BUT NOT SEEN TO STAND" if was_taken else "NOT ACKNOWLEDGED"
            self._report_stop(Level.ALARM, f"{outcome}: use the emergency stop ({why})")
        else:
            self._in_doubt = None
            self._report_stop(Level.QUIET, "acknowledged, and the axis stands")
        finally:
            self._stopping = None
            if self._state.stop is not None and self._state.stop.level is Level.WAITING:  # a defect, or the end
                self._state.stop = replace(self._state.stop, level=Level.ALARM, text="not known: look at the machine")

    def _report_stop(self, level: Level, text: str) -> None:
        self._state.stop = StopReport(self._now(), level, text)
        self._tell(f"stop: {text}", level)

    # The rest -------------------------------------------------------------------------------------------------------

    def acknowledge(self) -> None:
        """Acknowledge the error (QUIT), unless the drive says that there is none."""
        status = self._state.status(self._now())
        if status is not None and status.no_fault and status.no_warning:
            self._tell("there is no error to acknowledge; nothing was sent")
        else:
            self._ask("acknowledging the error", self._acknowledge)

    async def _acknowledge(self, drive: Drive) -> None:
        await drive.quit()
        self._tell("QUIT was taken; whether the error is gone, its status says", Level.ACTIVE)

    def reconcile(self) -> None:
        """Read how a drive stands of which something was in doubt, and let it take motion again."""
        self._ask("reconciling", self._reconcile)

    async def _reconcile(self, drive: Drive) -> None:
        status = await drive.reconcile()
        is_moving = status.command_active or status.program_running
        if not is_moving:
            self._in_doubt = None
        seen = "it moves" if is_moving else "no command is active"
        self._tell(f"reconciled: {seen} ({status.as_sent}); it takes motion again", Level.ACTIVE)

    def _ask(self, what: str, ask: Callable[[Drive], Coroutine[Any, Any, None]]) -> None:
        if self.drive is None:
            self._tell(f"{what}: nothing was sent, there is no line", Level.ATTENTION)
        else:
            self._spawn(self._asked(what, ask(self.drive)))

    async def _asked(self, what: str, asking: Coroutine[Any, Any, None]) -> None:
        try:
            await asking
        except CompaxError as error:
            self._tell(f"{what} failed: {self._plain(error)}", Level.ATTENTION)

    # The end --------------------------------------------------------------------------------------------------------

    async def close(self) -> Farewell:
        """Stop what was started here, close the line, and say what became of the axis."""
        move, what, doubt = self._move, self._state.own_motion, self._in_doubt
        moves_otherwise = self._state.is_seen_moving(self._now())
        error: BaseException | None = None
        if self.drive is None:
            error = None if doubt is None else MoveInDoubtError(f"{doubt}, and there is no line to stop it")
        else:
            try:
                await self._stop_and_close(self.drive, is_in_doubt=doubt is not None)
            except CompaxError as failure:
                error = failure
        self._is_closed = True
        if self._tasks:
            await asyncio.wait(self._tasks)
        ended = None if move is None or move.cancelled() else move.exception()
        if error is None and move is not None and may_go_on(move, line_is_there=False):
            error = ended
        name = self._state.name
        if error is not None:
            why = by_keys(self._plain(error))
            return Farewell(name, f"NOT KNOWN TO STAND, use the emergency stop if it moves: {why}", error)
        if move is not None:
            told = getattr(ended, "what", None) or "it has reached its target"
            return Farewell(name, f"{what} was under way: {told}")
        if doubt is not None:
            return Farewell(name, "something was in doubt: it was stopped, and stands")
        return Farewell(name, "it moves, but was not started here: left alone" if moves_otherwise else "")

    @staticmethod
    async def _stop_and_close(drive: Drive, *, is_in_doubt: bool) -> None:
        try:
            if is_in_doubt:  # which a drive whose line was opened anew cannot know
                await drive.stop()
        finally:
            await drive.close()
