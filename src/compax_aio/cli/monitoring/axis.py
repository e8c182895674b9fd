"""One axis of the monitor: its line opened again and again, what it says taken down, and what is asked of it done."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from contextlib import suppress
from dataclasses import replace
from typing import Any, Final

import compax_aio
from compax_aio import Drive, DriveSettings
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
from compax_aio.errors import CompaxError, ConnectionLostError, MoveInDoubtError

from ..unasked import UnaskedText
from .diary import Diary
from .levels import Level
from .orders import Farewell, Orders
from .state import DETAILS, ESSENTIALS, AxisState, Phase
from .words import by_keys

__all__ = ["MonitoredAxis"]

_FIRST_PAUSE_S: Final = 1.0
_LONGEST_PAUSE_S: Final = 10.0
_LEAST_DETAILS_S: Final = 0.4

_ANY_MOTION: Final = "a motion"


class MonitoredAxis:
    """
    One axis, on a line of its own; nothing that happens on it reaches another one.

    Attributes:
        state: What is known of it.
        orders: What may be asked of it.

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
        self.orders = Orders(self.state, diary, jog_percent)
        self._settings = settings
        self._diary = diary
        self._run: asyncio.Task[None] | None = None
        self._tasks: set[asyncio.Task[Any]] = set()
        self._again = asyncio.Event()
        self._openings = 0
        self._error_was_asked = False
        self._unasked = UnaskedText()

    @property
    def name(self) -> str:
        """What the axis is called."""
        return self.state.name

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
                self.orders.drive = await self._connected()
                await self._follow(self.orders.drive)
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
        assert self.orders.drive is not None
        self.state.enter(Phase.ENDED, self._now(), self.state.trouble)
        self._again.clear()
        await self._again.wait()
        drive, self.orders.drive = self.orders.drive, None
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
        state.doubt = _doubt_of(drive) or self.orders.doubt
        state.unit, state.decimals = drive.settings.unit, drive.settings.decimals
        state.answer_time_s = drive.stats.answer_time_s(50)

    def look(self) -> None:
        """Take down what can be known without a word from the drive; to be called before it is shown."""
        if self.orders.drive is None:
            return
        self.state.doubt = _doubt_of(self.orders.drive) or self.orders.doubt
        if self.state.phase is Phase.LOST:
            self.state.attempts = self.orders.drive.stats.openings - self._openings

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
            if state.phase is Phase.OPEN and self.orders.drive is not None:
                self._openings = self.orders.drive.stats.openings
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
        if (told := self._unasked.take(repr(event.text[:60]))) is not None:
            self._tell(f"unexpected text {told}", Level.ATTENTION)

    # The end --------------------------------------------------------------------------------------------------------

    async def close(self) -> Farewell:
        """Stop what was started here, close the line, and say what became of the axis."""
        if self._run is not None:
            self._run.cancel()
            await asyncio.wait([self._run])
        farewell = await self.orders.close()
        if self._tasks:
            await asyncio.wait(self._tasks)
        self.state.enter(Phase.ENDED, self._now(), "the monitor was left")
        return farewell


def _doubt_of(drive: Drive) -> str | None:
    """Return why a drive takes no motion from here; a motion is planned for it, and never sent."""
    try:
        drive.check(replace(plan_home(drive.settings), description=_ANY_MOTION))
    except MoveInDoubtError as error:
        return error.what.removeprefix(f"{_ANY_MOTION} was not sent, for ")
    except CompaxError:
        return None
    return None
