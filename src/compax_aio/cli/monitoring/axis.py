"""One axis of the monitor: its line opened again and again, what it says taken down, and what is asked of it done."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, Final

import compax_aio
from compax_aio import Drive, DriveSettings, Move
from compax_aio.compax.events import (
    ComparatorPassed,
    ConnectionLost,
    ConnectionRestored,
    DriveEvent,
    EventStream,
    Fault,
    PositionMessage,
    UnexpectedText,
)
from compax_aio.compax.facts.limits import MAX_POSITION
from compax_aio.compax.vocabulary import plan_home
from compax_aio.errors import CompaxError, ConnectionLostError, MoveInDoubtError, MoveTimeoutError

from .diary import Diary
from .levels import Level
from .state import DETAILS, ESSENTIALS, AxisState, Phase, StopReport
from .words import by_keys

__all__ = ["Farewell", "MonitoredAxis"]

_FIRST_PAUSE_S: Final = 1.0
_LONGEST_PAUSE_S: Final = 10.0
_LEAST_DETAILS_S: Final = 0.4
_SAME_TEXT_S: Final = 5.0
"""Unexpected texts are told so rarely: a line that floods must not push all else out of the diary."""

_ANY_MOTION: Final = "a motion"


@dataclass(frozen=True, slots=True)
class Farewell:
    """What became of one axis when the monitor was left."""

    axis: str
    text: str
    """Empty where nothing of it was started here, and it stands as far as is known."""
    error: BaseException | None = None
    """Why nobody can say that it stands, although it was started here."""


class MonitoredAxis:
    """
    One axis, on a line of its own; nothing that happens on it reaches another one.

    Args:
        name: Of the axis.
        url: Of its line.
        settings: Of its drive.
        interval_s: Seconds from one reading to the next.
        jog_percent: Speed of a jog, in % of nominal speed.
        diary: Where everything is written down.
    """

    def __init__(
        self, name: str, url: str, settings: DriveSettings, *, interval_s: float, jog_percent: float, diary: Diary
    ) -> None:
        self.state = AxisState(name, url, interval_s, unit=settings.unit, decimals=settings.decimals)
        self._settings = settings
        self._jog_percent = jog_percent
        self._diary = diary
        self._drive: Drive | None = None
        self._move: Move | None = None
        self._run: asyncio.Task[None] | None = None
        self._stopping: asyncio.Task[None] | None = None
        self._tasks: set[asyncio.Task[Any]] = set()
        self._again = asyncio.Event()
        self._openings = 0
        self._error_was_asked = False
        self._strays_untold = 0
        self._stray_told_at = float("-inf")
        self._may_have_left_moving = False

    @property
    def name(self) -> str:
        """What the axis is called."""
        return self.state.name

    @property
    def is_moved_from_here(self) -> bool:
        """Whether a motion was started here that is not known to be over."""
        return self._move is not None or self._may_have_left_moving

    def _now(self) -> float:
        return asyncio.get_running_loop().time()

    def _tell(self, text: str, level: Level = Level.QUIET) -> None:
        self._diary.add(self.name, by_keys(text), level)

    def _spawn(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    # Its line -------------------------------------------------------------------------------------------------------

    def start(self) -> None:
        """Open the line, and follow the drive from then on, until :meth:`close`."""
        self._run = asyncio.create_task(self._follow_for_ever(), name=f"{self.name}: monitor")

    def try_again(self) -> None:
        """Try a line that could not be opened, or is not tried any more, at once."""
        if self.state.phase in {Phase.UNREACHABLE, Phase.ENDED}:
            self._again.set()
        elif self.state.phase is Phase.LOST:
            self._tell("the line is lost and is tried again by itself")
        else:
            self._tell("the line is there" if self.state.phase is Phase.OPEN else "the line is being opened")

    async def _follow_for_ever(self) -> None:
        try:
            while True:
                self._drive = await self._connected()
                await self._follow(self._drive)
                await self._await_word()
        except Exception as defect:
            self.state.enter(Phase.ENDED, self._now(), f"{type(defect).__name__}: {defect}")
            self._tell(f"not watched any more, by a defect of compax: {type(defect).__name__}: {defect}", Level.ALARM)

    async def _connected(self) -> Drive:
        """Open the line, however often it takes."""
        state, pause_s = self.state, _FIRST_PAUSE_S
        state.attempts = 0
        while True:
            state.enter(Phase.OPENING, self._now(), state.trouble)
            try:
                drive = await compax_aio.connect(state.url, name=state.name, settings=self._settings)
            except CompaxError as error:
                why = str(error).removeprefix(f"{self.name}: ")
                if why != state.trouble:
                    self._tell(f"not reachable: {why}", Level.ALARM)
                state.attempts += 1
                state.enter(Phase.UNREACHABLE, self._now(), why)
                state.next_attempt_at = self._now() + pause_s
                self._again.clear()
                with suppress(TimeoutError):
                    async with asyncio.timeout(pause_s):
                        await self._again.wait()
                pause_s = min(2 * pause_s, _LONGEST_PAUSE_S)
            else:
                self._tell(f"connected: {state.url}", Level.ACTIVE)
                return drive

    async def _follow(self, drive: Drive) -> None:
        """Take down what the drive says until its line is lost for good."""
        events = drive.events()
        self.state.attempts = 0
        self.state.enter(Phase.OPEN, self._now())
        self._openings = drive.stats.openings
        self._error_was_asked = False
        others = [self._spawn(self._take_events(events)), self._spawn(self._read_axis(drive))]
        details_s = max(2 * self.state.interval_s, _LEAST_DETAILS_S)
        try:
            await asyncio.gather(
                self._watch(drive, ESSENTIALS, self.state.interval_s), self._watch(drive, DETAILS, details_s)
            )
        finally:
            for task in others:
                task.cancel()

    async def _await_word(self) -> None:
        """Wait until somebody wants a line that was lost for good to be opened anew."""
        assert self._drive is not None
        self.state.enter(Phase.ENDED, self._now(), self.state.trouble)
        self._again.clear()
        await self._again.wait()
        drive, self._drive = self._drive, None
        await drive.close()

    # What it says ---------------------------------------------------------------------------------------------------

    async def _watch(self, drive: Drive, quantities: tuple[str, ...], interval_s: float) -> None:
        with suppress(ConnectionLostError):  # events tell it
            async for reading in drive.watch(*quantities, interval_s=interval_s):
                self.state.take(reading)
                self._take_drive(drive)
                if (status := reading.values.get("status")) is not None:
                    self._ask_for_error(drive, nothing_to_ask=status.no_fault and status.no_warning)

    def _take_drive(self, drive: Drive) -> None:
        """Take down what is known of the drive without asking it."""
        state = self.state
        state.doubt = _doubt_of(drive)
        state.unit, state.decimals = drive.settings.unit, drive.settings.decimals
        state.answer_time_s = drive.stats.answer_time_s(50)

    def look(self) -> None:
        """Take down what can be known without a word from the drive; to be called before it is shown."""
        if self._drive is None:
            return
        self.state.doubt = _doubt_of(self._drive)
        if self.state.phase is Phase.LOST:
            self.state.attempts = self._drive.stats.openings - self._openings

    def _ask_for_error(self, drive: Drive, *, nothing_to_ask: bool) -> None:
        """Ask a drive once which fault or warning it has; a fault that was there before us is no event."""
        if nothing_to_ask:
            self._error_was_asked = False
        elif not self._error_was_asked and self.state.error is None:
            self._error_was_asked = True
            self._spawn(self._read_error(drive))

    async def _read_error(self, drive: Drive) -> None:
        with suppress(CompaxError):
            self.state.error = await drive.error()

    async def _read_axis(self, drive: Drive) -> None:
        try:
            axis = await drive.read_axis()
        except CompaxError as error:
            self._tell(f"its unit and travel (P90, P11, P12) cannot be read: {error.what}", Level.ATTENTION)
        else:
            whole = (-MAX_POSITION, MAX_POSITION)
            self.state.travel = axis.travel if axis.travel != whole else None

    async def _take_events(self, events: EventStream) -> None:
        async for event in events:
            self._take_event(event)

    def _take_event(self, event: DriveEvent) -> None:
        state = self.state
        if isinstance(event, PositionMessage):
            self._tell("position reached ($)")
        elif isinstance(event, ComparatorPassed):
            self._tell(f"comparator {event.number} passed")
        elif isinstance(event, Fault):
            state.error, self._error_was_asked = event.error, True
            self._tell(f"fault {event.error}" if event.error else "a fault; it does not say which", Level.ALARM)
        elif isinstance(event, ConnectionLost):
            if state.phase is Phase.OPEN and self._drive is not None:
                self._openings = self._drive.stats.openings
                state.attempts = 0
            reason = event.reason.removeprefix(f"{self.name}: ")
            state.enter(Phase.LOST, self._now(), reason.partition(";")[0])
            self._tell(reason, Level.ALARM)
        elif isinstance(event, ConnectionRestored):
            self._take_restored(event)
        elif isinstance(event, UnexpectedText):
            self._take_stray(event)

    def _take_restored(self, event: ConnectionRestored) -> None:
        self.state.enter(Phase.OPEN, self._now())
        self.state.error, self._error_was_asked = None, False
        tries = f"{event.attempts} attempt{'s' * (event.attempts != 1)}"
        self._tell(f"the line is back after {event.lost_for_s:.1f} s and {tries}", Level.ACTIVE)
        if event.signs_of_restart:
            self._tell(
                f"it seems to have been switched off and on: {' and '.join(event.signs_of_restart)}", Level.ATTENTION
            )

    def _take_stray(self, event: UnexpectedText) -> None:
        self._strays_untold += 1
        if self._now() - self._stray_told_at >= _SAME_TEXT_S:
            before = f" ({self._strays_untold - 1} more before it)" if self._strays_untold > 1 else ""
            self._tell(f"unexpected text {event.text[:60]!r}{before}", Level.ATTENTION)
            self._strays_untold, self._stray_told_at = 0, self._now()

    # What is asked of it: moving ------------------------------------------------------------------------------------

    def jog(self, distance: float) -> None:
        """Move by *distance*, if nothing moves that was started here."""
        what = f"jog {distance:+g} {self.state.unit}"
        self._begin(what, lambda drive: drive.move_by(distance, speed_percent=self._jog_percent))

    def home(self) -> None:
        """Find machine zero, if nothing moves that was started here."""
        self._begin("search for machine zero", lambda drive: drive.home())

    def _begin(self, what: str, start: Callable[[Drive], Move]) -> None:
        drive = self._drive
        if drive is None or not drive.is_open:
            self._tell(f"{what}: nothing was sent, there is no line", Level.ATTENTION)
        elif self._stopping is not None:
            self._tell(f"{what}: nothing was sent, a stop is under way", Level.ATTENTION)
        elif self._move is not None:
            self._tell(f"{what}: nothing was sent, {self.state.own_motion} is not over", Level.ATTENTION)
        else:
            try:
                move = start(drive)
            except CompaxError as error:
                self._tell(f"{what}: {error}", Level.ATTENTION)
                return
            self._move, self.state.own_motion = move, what
            self._tell(f"{what}: begun here", Level.ACTIVE)
            self._spawn(self._see_to_its_end(move, what))

    async def _see_to_its_end(self, move: Move, what: str) -> None:
        try:
            await asyncio.wait([move])
        finally:
            self._move = self.state.own_motion = None
            self.state.own_ended_at = self._now()
        error = None if move.cancelled() else move.exception()
        if error is not None:
            self._may_have_left_moving |= isinstance(error, MoveInDoubtError)
            why = str(error).removeprefix(f"{self.name}: ")
            self._tell(f"{what}: {why}", Level.ALARM if isinstance(error, MoveInDoubtError) else Level.ATTENTION)
        elif not move.cancelled():
            result = move.result()
            where = "" if result.target is None else f" {result.target:.{self.state.decimals}f} {self.state.unit}"
            self._tell(f"{what}: reached{where}, confirmed by {result.confirmed_by}", Level.ACTIVE)

    # What is asked of it: stopping ----------------------------------------------------------------------------------

    def stop(self) -> None:
        """Stop the drive ahead of everything else; what comes of it stands in the state and the diary."""
        if self._stopping is not None:
            return  # it is repeated until it is acknowledged
        if self._drive is None:
            text = "STOP was not sent, there is no line: use the emergency stop if it moves"
            self._report_stop(Level.ALARM, text)
            return
        self.state.stop = StopReport(self._now(), Level.WAITING, "STOP sent, waiting for the drive")
        self._stopping = self._spawn(self._carry_stop_through(self._drive))

    async def _carry_stop_through(self, drive: Drive) -> None:
        try:
            await drive.stop()
        except MoveTimeoutError as error:
            self._may_have_left_moving = True
            self._report_stop(Level.ALARM, f"ACKNOWLEDGED, BUT STILL ACTIVE: use the emergency stop ({error.what})")
        except CompaxError as error:
            self._may_have_left_moving = True
            self._report_stop(Level.ALARM, f"NOT ACKNOWLEDGED: use the emergency stop ({_why(error)})")
        else:
            self._may_have_left_moving = False
            self._report_stop(Level.QUIET, "acknowledged, and the axis stands")
        finally:
            self._stopping = None
            if self.state.stop is not None and self.state.stop.level is Level.WAITING:  # a defect, or the end
                self.state.stop = replace(self.state.stop, level=Level.ALARM, text="not known: look at the machine")

    def _report_stop(self, level: Level, text: str) -> None:
        self.state.stop = StopReport(self._now(), level, text)
        self._tell(f"stop: {text}", level)

    # What is asked of it: the rest ----------------------------------------------------------------------------------

    def acknowledge(self) -> None:
        """Acknowledge the error (QUIT), unless the drive says that there is none."""
        status = self.state.status(self._now())
        if status is not None and status.no_fault and status.no_warning:
            self._tell("there is no error to acknowledge; nothing was sent")
        else:
            self._ask("acknowledging the error", self._acknowledge)

    async def _acknowledge(self, drive: Drive) -> None:
        await drive.quit()
        self._error_was_asked, self.state.error = False, None
        self._tell("QUIT was taken; whether the error is gone, its status says", Level.ACTIVE)

    def reconcile(self) -> None:
        """Read how a drive stands of which something was in doubt, and let it take motion again."""
        self._ask("reconciling", self._reconcile)

    async def _reconcile(self, drive: Drive) -> None:
        status = await drive.reconcile()
        self._may_have_left_moving &= status.command_active or status.program_running
        moves = "its command is active" if status.command_active else "no command is active"
        self._tell(f"reconciled: {moves} ({status.as_sent}); it takes motion again", Level.ACTIVE)

    def _ask(self, what: str, ask: Callable[[Drive], Coroutine[Any, Any, None]]) -> None:
        if self._drive is None:
            self._tell(f"{what}: nothing was sent, there is no line", Level.ATTENTION)
        else:
            self._spawn(self._asked(what, ask(self._drive)))

    async def _asked(self, what: str, asking: Coroutine[Any, Any, None]) -> None:
        try:
            await asking
        except CompaxError as error:
            self._tell(f"{what} failed: {error}", Level.ATTENTION)

    # The end --------------------------------------------------------------------------------------------------------

    async def close(self) -> Farewell:
        """Stop what was started here, close the line, and say what became of the axis."""
        move, what, moves_otherwise = self._move, self.state.own_motion, self.state.is_seen_moving(self._now())
        was_in_doubt = self._may_have_left_moving
        if self._run is not None:
            self._run.cancel()
            await asyncio.wait([self._run])
        error: BaseException | None = None
        if self._drive is not None:
            try:
                await self._drive.close()
            except CompaxError as failure:
                error = failure
        if self._tasks:
            await asyncio.wait(self._tasks)
        self.state.enter(Phase.ENDED, self._now(), "the monitor was left")
        if move is not None and not move.cancelled():
            ended = move.exception()
            error = error or (ended if isinstance(ended, MoveInDoubtError) else None)
        if error is not None:
            return Farewell(self.name, f"NOT KNOWN TO STAND, use the emergency stop if it moves: {error}", error)
        if move is not None:
            return Farewell(self.name, _how_it_ended(move, what or ""))
        if was_in_doubt:
            return Farewell(self.name, "something started here was in doubt: stopped, and it stands")
        return Farewell(self.name, "moves, but was not started here: left alone" if moves_otherwise else "")


def _how_it_ended(move: Move, what: str) -> str:
    error = None if move.cancelled() else move.exception()
    if error is None:
        return f"{what} was under way: it has reached its target" if not move.cancelled() else f"{what}: given up"
    return f"{what} was under way: {getattr(error, 'what', error)}"


def _why(error: CompaxError) -> str:
    return error.what.removeprefix("STOP was not acknowledged: ")


def _doubt_of(drive: Drive) -> str | None:
    """Return why a drive takes no motion from here; a motion is planned for it, and never sent."""
    try:
        drive.check(replace(plan_home(drive.settings), description=_ANY_MOTION))
    except MoveInDoubtError as error:
        return error.what.removeprefix(f"{_ANY_MOTION} was not sent, for ")
    except CompaxError:
        return None
    return None
