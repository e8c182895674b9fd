"""The drive as callers hold it: connect, read, move, stop, close."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable
from types import TracebackType
from typing import Self

from ..errors import ConnectionLostError, InvalidCommandError
from ..link.cancellation import despite_cancellation
from ..link.contract import Event, Lane
from ..link.link import LinkStats
from .codecs import DriveStatus
from .events import (
    ComparatorPassed,
    ConnectionLost,
    EventHub,
    EventStream,
    Fault,
    PositionMessage,
    UnexpectedText,
)
from .facts.device_errors import DeviceError
from .line import DriveLine
from .motion import Motion
from .moves import Move, OnCancel
from .observer import Observer
from .parameters import VARIABLE_TABLE, NumberedValues, Parameters
from .plain_line import check_line, is_query, starts_motion
from .protocol import ComparatorReached, PositionReached, Stray
from .readings import Readings
from .settings import DriveSettings
from .vocabulary import (
    Comparator,
    MovePlan,
    SpeedStep,
    plan_home,
    plan_move_by,
    plan_move_to,
)

__all__ = ["Drive"]


class Drive(Readings):
    """
    One COMPAX drive on an open line; made by :func:`compax_aio.connect`.

    Positions are in :attr:`unit`, counted from machine zero (P1 shifts them, UG p. 104). Every method that asks the
    drive raises AnswerTimeoutError or ConnectionLostError when no answer comes, CommandRejectedError when the answer
    is an error, UnexpectedAnswerError when it is something else.

    Attributes:
        parameters: P1-P250, read, written, saved and restored.
        variables: V1-V39 and V50-V70, likewise.
    """

    def __init__(self, name: str, settings: DriveSettings) -> None:
        self.name = name
        self._events = EventHub()
        self._loop = asyncio.get_running_loop()
        line = DriveLine(name, settings, self._on_event, self._on_lost)
        super().__init__(line, Observer(line, self._on_fault))
        self._motion = Motion(self._observer)
        self.parameters = Parameters(line)
        self.variables = NumberedValues(line, VARIABLE_TABLE)

    async def _open(self, url: str) -> None:
        await self._line.link.open(url)
        try:
            await self._motion.look_around()
        except BaseException:
            await self._line.link.close()
            raise

    def __repr__(self) -> str:
        return f"<Drive {self.name} {'open' if self.is_open else 'closed'}>"

    # Motion ---------------------------------------------------------------------------------------------------------

    def move_to(
        self,
        position: float,
        *,
        speed_percent: float | None = None,
        acceleration_ms: int | None = None,
        deceleration_ms: int | None = None,
        steps: Iterable[SpeedStep | tuple[float, int]] = (),
        comparators: Iterable[Comparator | tuple[float, int] | tuple[float, int, int]] = (),
        timeout_s: float | None = None,
        on_cancel: OnCancel = "stop",
    ) -> Move:
        """
        Start an absolute move (``POSA``, UG p. 162) as soon as the line is free.

        Args:
            position: Target in :attr:`unit`, within ±4,000,000; rounded to the drive's decimals.
            speed_percent: Of nominal speed, above 0; None keeps the last one.
            acceleration_ms: 0 to 65,000, the time from standstill to nominal speed; None keeps the last one.
            deceleration_ms: The same for braking.
            steps: Speed steps ``(distance, speed_percent)``; with the comparators at most 8.
            comparators: Outputs to set on the way, ``(distance, output)`` or ``(distance, output, value)``.
            timeout_s: A fixed budget for the whole move; None: it may take as long as the axis moves.
            on_cancel: ``"stop"`` stops the drive when the move is cancelled, ``"detach"`` lets it go on.

        Returns:
            A :class:`Move`; awaiting it returns at position reached (``$``, UG p. 160, or S16 and S17).

        Raises:
            InvalidCommandError: The drive cannot be told this; nothing was sent.
            MoveActiveError: Another move is running; nothing was sent.
            MoveInDoubtError: What became of the last move is unknown; see :meth:`reconcile`.
            MoveError: Points prepared for a move that was not started would act on this one.

        Awaiting the move raises MoveStoppedError, DriveFaultError, MoveTimeoutError or MoveInDoubtError for the
        motion, CommandRejectedError, AnswerTimeoutError or ConnectionLostError for the line.
        """
        plan = plan_move_to(
            position,
            self.settings,
            speed_percent=speed_percent,
            acceleration_ms=acceleration_ms,
            deceleration_ms=deceleration_ms,
            steps=steps,
            comparators=comparators,
        )
        return self.start(plan, timeout_s=timeout_s, on_cancel=on_cancel)

    def move_by(
        self,
        distance: float,
        *,
        speed_percent: float | None = None,
        acceleration_ms: int | None = None,
        deceleration_ms: int | None = None,
        steps: Iterable[SpeedStep | tuple[float, int]] = (),
        comparators: Iterable[Comparator | tuple[float, int] | tuple[float, int, int]] = (),
        timeout_s: float | None = None,
        on_cancel: OnCancel = "stop",
    ) -> Move:
        """
        Start a relative move (``POSR``, UG p. 162) as soon as the line is free; see :meth:`move_to`.

        The target position (S2) is read first, so that the end can be told from the beginning.
        """
        plan = plan_move_by(
            distance,
            self.settings,
            speed_percent=speed_percent,
            acceleration_ms=acceleration_ms,
            deceleration_ms=deceleration_ms,
            steps=steps,
            comparators=comparators,
        )
        return self.start(plan, timeout_s=timeout_s, on_cancel=on_cancel)

    def home(self, *, timeout_s: float | None = None, on_cancel: OnCancel = "stop") -> Move:
        """Find machine zero (``POSA HOME``, UG p. 162), confirmed by S16 bit 3; see :meth:`move_to`."""
        return self.start(plan_home(self.settings), timeout_s=timeout_s, on_cancel=on_cancel)

    def check(self, plan: MovePlan) -> None:
        """Raise what :meth:`start` would raise, and do nothing."""
        self._motion.check(plan)

    def start(self, plan: MovePlan, *, timeout_s: float | None = None, on_cancel: OnCancel = "stop") -> Move:
        """Start a motion that was planned for this drive before; see :meth:`move_to`."""
        return self._motion.start(plan, timeout_s, on_cancel)

    async def stop(self) -> None:
        """
        Stop the drive ahead of everything that is queued, and return at its standstill.

        STOP is written before this first waits, if no exchange is in flight, and repeated until acknowledged. A move
        that was running raises MoveStoppedError. Cancelling the caller does not take the stop back.

        Raises:
            AnswerTimeoutError, CommandRejectedError, ConnectionLostError: STOP was not acknowledged; the axis may move.
            MoveTimeoutError: It was acknowledged, but the drive's command is still active.
        """
        await self._motion.stop()

    async def quit(self) -> None:
        """Acknowledge an error (QUIT, CAN-S p. 28); its text is part of the dialect."""
        await self._line.command(self.settings.dialect.quit)

    async def reconcile(self) -> DriveStatus:
        """Read the status after a move was in doubt; from then on the drive takes motion again."""
        return await self._motion.reconcile()

    # Raw ------------------------------------------------------------------------------------------------------------

    async def command(self, text: str) -> str:
        """
        Send one line, in capitals (IBS p. 23), and return what came before the prompt: nothing, for a command.

        A motion that is started so is not watched; leaving the block stops the drive all the same.

        Raises:
            InvalidCommandError: *text* is not one plain line of at most 30 characters; nothing was sent.
            MoveActiveError, MoveInDoubtError: It starts a motion, and a move is running or in doubt; nothing was sent.
        """
        line = check_line(text.upper())
        if is_query(line):
            return await self._line.query(line)
        if starts_motion(line):
            self._motion.note_untracked(line)
            await self._line.command(line, Lane.MOTION)
        else:
            await self._line.command(line)
        return ""

    async def query(self, text: str) -> str:
        """
        Ask one line, in capitals, and return the whole answer: ``query("S1")`` gives ``"S001: 120.50"``.

        Raises:
            InvalidCommandError: *text* is not one plain line of at most 30 characters, or starts a motion; nothing
                was sent.
        """
        line = check_line(text.upper())
        if is_query(line):
            return await self._line.query(line)
        if starts_motion(line):
            raise InvalidCommandError(f"{text!r} starts a motion, it asks nothing", hint="use move_to() or command()")
        return await self._line.ask_freely(line)

    # Events and life ------------------------------------------------------------------------------------------------

    def events(self) -> EventStream:
        """Follow what happens from now on: messages, faults, the line; an asynchronous iterator."""
        return self._events.stream()

    @property
    def settings(self) -> DriveSettings:
        """What is known of this drive."""
        return self._line.settings

    @property
    def stats(self) -> LinkStats:
        """Counters of the line."""
        return self._line.link.stats

    @property
    def is_open(self) -> bool:
        """Whether the line is there."""
        return self._line.link.is_open

    async def close(self) -> None:
        """
        Stop what was started here, and close the line; harmless when repeated.

        It is carried through even if the caller is cancelled meanwhile.

        Raises:
            AnswerTimeoutError, CommandRejectedError, MoveTimeoutError: The axis may not have stopped.
        """
        await despite_cancellation(self._close())

    async def _close(self) -> None:
        try:
            if self.is_open:
                await self._motion.end()
        except ConnectionLostError:
            pass  # whoever awaited the move has been told
        finally:
            await self._line.link.close()
            self._events.end()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        await self.close()

    # What the line tells --------------------------------------------------------------------------------------------

    def _on_event(self, event: Event) -> None:
        at = self._loop.time()
        if isinstance(event, PositionReached):
            self._events.publish(PositionMessage(self.name, at))
            self._motion.position_reached()
        elif isinstance(event, ComparatorReached):
            self._events.publish(ComparatorPassed(self.name, at, event.number))
            self._motion.comparator_reached(event.number)
        elif isinstance(event, Stray):
            self.stats.strays += 1
            self._events.publish(UnexpectedText(self.name, at, event.text))

    def _on_fault(self, error: DeviceError | None) -> None:
        self._events.publish(Fault(self.name, self._loop.time(), error))

    def _on_lost(self, error: ConnectionLostError) -> None:
        self._events.publish(ConnectionLost(self.name, self._loop.time(), str(error)))
        self._motion.line_lost()
