"""The drive as callers hold it: connect, read, move, stop, close."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Iterable
from functools import cached_property
from typing import Unpack

from ..errors import ConnectionLostError, InvalidCommandError
from ..link.contract import Event
from ..link.reconnecting import Restored
from ..motion.open_device import OpenDevice
from .axis import AxisCommands
from .codecs import DriveStatus, SerialInterface
from .events import (
    ComparatorPassed,
    EventHub,
    EventStream,
    Fault,
    PositionMessage,
    UnexpectedText,
)
from .facts.device_errors import DeviceError
from .identity import Identity
from .line import DriveLine
from .motion import Motion
from .moves import Move, OnCancel, PreparedMove
from .observer import Observer
from .parts import Parts
from .plain_line import check_line, is_query, starts_motion
from .poller import Poller
from .protocol import ComparatorReached, PositionReached, Stray
from .readings import Readings
from .settings import DriveSettings
from .vocabulary import (
    Comparator,
    MoveOptions,
    MovePlan,
    SpeedStep,
    plan_home,
    plan_move_by,
    plan_move_to,
)
from .watch import Watch

__all__ = ["Drive"]

_log = logging.getLogger("compax_aio.compax")


class Drive(Readings, AxisCommands, Parts, OpenDevice[DriveLine]):
    """
    One COMPAX drive on an open line; made by :func:`compax_aio.connect`.

    Positions are in :attr:`unit`, counted from machine zero (P1 shifts them, UG p. 104). Every method that asks the
    drive raises AnswerTimeoutError or ConnectionLostError when no answer comes, CommandRejectedError when the answer
    is an error, UnexpectedAnswerError when it is something else.
    """

    def __init__(self, name: str, settings: DriveSettings) -> None:
        self.name = name
        self._events = EventHub()
        self._loop = asyncio.get_running_loop()
        line = DriveLine(name, settings, **self._tells)
        super().__init__(line, Observer(line, self._on_fault))
        self._motion = Motion(self._observer, self._events.publish)
        self._identity = Identity(self._observer, self._motion)

    async def _open(self, url: str) -> None:
        await self._line.link.open(url)

    async def _greet(self) -> None:
        await self._identity.greet()

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

    def prepare_move_to(
        self,
        position: float,
        *,
        timeout_s: float | None = None,
        on_cancel: OnCancel = "stop",
        **options: Unpack[MoveOptions],
    ) -> PreparedMove:
        """
        Let the drive hold an absolute move ready (``,``, UG p. 160), to be started by :meth:`PreparedMove.trigger`.

        Takes and raises what :meth:`move_to` does. It is confirmed by the drive's status, unless
        ``DriveSettings.message_when_prepared`` lets it ask for ``$`` as well.
        """
        return self.prepare(plan_move_to(position, self.settings, **options), timeout_s=timeout_s, on_cancel=on_cancel)

    def prepare_move_by(
        self,
        distance: float,
        *,
        timeout_s: float | None = None,
        on_cancel: OnCancel = "stop",
        **options: Unpack[MoveOptions],
    ) -> PreparedMove:
        """Let the drive hold a relative move ready; see :meth:`prepare_move_to` and :meth:`move_by`."""
        return self.prepare(plan_move_by(distance, self.settings, **options), timeout_s=timeout_s, on_cancel=on_cancel)

    def prepare(self, plan: MovePlan, *, timeout_s: float | None = None, on_cancel: OnCancel = "stop") -> PreparedMove:
        """Let the drive hold a motion ready that was planned for it before; see :meth:`prepare_move_to`."""
        return self._motion.prepare(plan, timeout_s, on_cancel)

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
            MoveStoppedError: It starts a motion, and a stop came before it was sent.
            AnswerTimeoutError, ConnectionLostError: No answer came. If it starts a motion and was sent, the drive takes
                no other until :meth:`reconcile`.
        """
        line = check_line(text).upper()
        if is_query(line):
            return await self._line.query(line)
        if starts_motion(line, self.settings.dialect.motions):
            await self._motion.command(line)
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
        line = check_line(text).upper()
        if is_query(line):
            return await self._line.query(line)
        if starts_motion(line, self.settings.dialect.motions):
            raise InvalidCommandError(f"{text!r} starts a motion, it asks nothing", hint="use move_to() or command()")
        return await self._line.ask_freely(line)

    # Events and life ------------------------------------------------------------------------------------------------

    def events(self) -> EventStream:
        """Follow what happens from now on: messages, faults, the line; an asynchronous iterator."""
        return self._events.stream()

    def watch(self, *quantities: str, interval_s: float = 0.2) -> Watch:
        """
        Read quantities again and again, once for all who watch; an asynchronous iterator of readings.

        It goes last on the line, and takes half of it at most: while others need it, readings come more rarely.

        Args:
            quantities: ``position``, ``target``, ``following_error``, ``speed``, ``torque``, ``status``, ``error``,
                ``error_history``, or by number ``S1`` to ``S250``, ``P1`` to ``P250``, ``V1`` to ``V70``.
            interval_s: Seconds from one reading to the next, above 0; at whole multiples of it on the loop's clock.

        Raises:
            InvalidCommandError: A quantity is not known, or *interval_s* is no time; nothing was sent.
        """
        return self._poller.watch(quantities, interval_s)

    @cached_property
    def _poller(self) -> Poller:
        return Poller(self._line, self, self.parameters, self.variables)

    @property
    def settings(self) -> DriveSettings:
        """What is known of this drive."""
        return self._line.settings

    @property
    def interface(self) -> SerialInterface | None:
        """What P20 says of errors, handshake and binary; None where it could not be read, or was written since."""
        return self._line.transfer.interface

    async def close(self) -> None:
        """
        Stop what was started here, and close the line; harmless when repeated.

        It is carried through even if the caller is cancelled meanwhile.

        Raises:
            AnswerTimeoutError, CommandRejectedError, MoveTimeoutError: The axis may not have stopped.
        """
        await super().close()

    async def _end(self) -> None:
        try:
            if not self._line.link.is_over:
                await self._motion.end()
        except ConnectionLostError:
            if not self._line.link.is_over:
                raise
            # Else whoever awaited the move has been told.
        finally:
            self._poller.end()

    # What the line tells --------------------------------------------------------------------------------------------

    def _on_event(self, event: Event) -> None:
        if not self._line.link.is_open:
            self._on_early_event(event)
            return
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

    def _on_early_event(self, event: Event) -> None:
        """Take what came before it was known who is there: nobody is told, and no move is ended by it."""
        if isinstance(event, PositionReached):
            self._motion.forget_message()
        elif isinstance(event, Stray):
            self.stats.strays += 1

    def _on_fault(self, error: DeviceError | None) -> None:
        self._events.publish(Fault(self.name, self._loop.time(), error))

    def _on_down(self, error: ConnectionLostError) -> None:
        super()._on_down(error)
        self._motion.line_lost(error)

    def _on_restored(self, restored: Restored) -> None:
        signs = self._identity.take_signs_of_restart()
        if signs:
            _log.warning(
                "%s seems to have been switched off and on: %s; prepared points, SPEED, ramps and the position "
                "reference may be gone",
                self.name,
                " and ".join(signs),
            )
        self._tell_restored(restored, signs)
        self._motion.line_restored(signs)

    def _on_lost(self, error: ConnectionLostError) -> None:
        super()._on_lost(error)
        self._poller.end(error)
