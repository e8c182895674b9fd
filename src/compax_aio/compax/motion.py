"""One drive's motion: moves in one step or two, its messages, its stop, and what is remembered in between."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial

from ..errors import CommandRejectedError, ConnectionLostError, MoveError, UnexpectedAnswerError
from ..link.contract import Lane
from ..motion.events import DriveEvent
from ..motion.moves import check_manner
from ..motion.one_move import OneMove
from ..motion.untracked import Untracked
from .codecs import DriveStatus
from .facts.device_errors import DeviceError
from .memory import Memory
from .moves import Move, OnCancel, PreparedMove
from .observer import Look, Observer
from .plain_line import is_positioning
from .pursuit import Pursuit
from .reports import Reports
from .stopping import Stop
from .vocabulary import MovePlan, change_of_speed

__all__ = ["Motion"]

_log = logging.getLogger("compax_aio.compax")


@dataclass(frozen=True, slots=True)
class _Standstill:
    """How a drive stands after a stop."""

    look: Look
    fault: DeviceError | None
    """None also where the drive does not say which it has."""


class Motion(OneMove[Pursuit, _Standstill, None]):
    """
    What moves one drive; :class:`~compax_aio.compax.drive.Drive` is the face it has for callers.

    Args:
        observer: Of the drive.
        publish: Called with what happens to moves, and with standstills after stops.
    """

    _reports: Reports
    _memory: Memory

    def __init__(self, observer: Observer, publish: Callable[[DriveEvent], None]) -> None:
        self._observer = observer
        line = observer.line
        reports = Reports(line.name, observer)
        super().__init__(
            line.name,
            line.link,
            reports=reports,
            untracked=Untracked(line.command, reports),
            memory=Memory(),
            log=_log,
            publish=publish,
        )
        self.restarts = 0
        """How many times the drive seemed to have been switched off and on while its line was lost."""
        self._timeout_s: float | None = None

    # Starting -------------------------------------------------------------------------------------------------------

    def check(self, plan: MovePlan) -> None:
        """Raise what :meth:`start` would raise."""
        self.check_free(plan.description)
        if self._observer.line.transfer.speed_is_unknown and not plan.sets_speed and not plan.finds_machine_zero:
            raise self._reports.speed_unknown(plan)
        if self._memory.points_prepared and not plan.finds_machine_zero:
            raise self._reports.points_left(plan, self._memory.points_prepared)

    def start(self, plan: MovePlan, timeout_s: float | None, on_cancel: OnCancel) -> Move:
        """
        Send *plan* as soon as the line is free, after a stop that is under way.

        Raises:
            MoveActiveError: Another move runs.
            MoveInDoubtError: What became of the last one is unknown.
            MoveError: Points prepared for a move that never started would act on this one.
            InvalidCommandError: *timeout_s* or *on_cancel* means nothing.
        """
        check_manner(timeout_s, on_cancel)
        self.check(plan)
        move = Move(self, plan, on_cancel)
        self._carry_out(move)
        self._limit(move, timeout_s)
        return move

    def prepare(self, plan: MovePlan, timeout_s: float | None, on_cancel: OnCancel) -> PreparedMove:
        """Let the drive hold *plan* ready, and start it when triggered; *timeout_s* counts from then."""
        check_manner(timeout_s, on_cancel)
        self.check(plan)
        move = PreparedMove(self, plan, on_cancel)
        self._timeout_s = timeout_s
        self._carry_out(move)
        return move

    def trigger(self, move: PreparedMove) -> None:
        """Start *move*, which the drive must hold ready."""
        if not self._is_active(move) or not move.readiness.done() or move.triggered.is_set():
            raise self._reports.not_ready(move)
        move.triggered.set()
        self._limit(move, self._timeout_s)

    def _carry_out(self, move: Move) -> None:
        self._begin(Pursuit(move, self._observer, self._memory))
        move.acceptance.add_done_callback(self._move_accepted)

    def _move_accepted(self, acceptance: asyncio.Future[None]) -> None:
        if not acceptance.cancelled() and acceptance.exception() is None:
            self.untracked.note_moves_over(self.untracked.mark())

    async def change_speed(self, move: Move, speed_percent: int) -> None:
        """Let *move*, which must run, go on at another speed."""
        text = change_of_speed(speed_percent, self._observer.line.settings)
        if not self._is_active(move) or not move.is_on_wire:
            raise MoveError(
                f"{move.plan.description} does not run, so its speed cannot be changed",
                device=self.name,
                hint="give a move its speed with speed_percent=",
            )
        came_late = False

        def on_sent() -> None:
            nonlocal came_late
            came_late = move.done()

        await self.untracked.say(text, Lane.CONTROL, on_sent)
        if came_late:
            # Taken by a drive that stood, it may be a speed step at the beginning of the next move.
            self._memory.points_prepared += 1
            raise MoveError(
                f"{move.plan.description} ended before its new speed was sent, which may act on the next move",
                device=self.name,
                sent=text,
                hint="home() cancels it (UG p. 101)",
            )

    async def _make_ready(self, text: str) -> None:  # noqa: ARG002
        await self._observer.line.transfer.say_settings(())

    async def _tell(self, text: str) -> None:
        self._observer.is_homed = False  # what nobody watches may be a search for machine zero
        await self.untracked.tell(text, is_move=is_positioning(text))

    # Hearing --------------------------------------------------------------------------------------------------------

    def position_reached(self) -> None:
        """Take a ``$`` that was just read."""
        if self._active is not None:
            self._active.position_reached()
        else:
            self._memory.messages_owed = max(0, self._memory.messages_owed - 1)

    def forget_message(self) -> None:
        """Take a ``$`` that came before it was known from whom: it ends nothing, and is not owed any more."""
        self._memory.messages_owed = max(0, self._memory.messages_owed - 1)

    def comparator_reached(self, number: int) -> None:
        """Take a comparator's number that was just read."""
        # One that is passed on the ramp of a stop is not of the move that waits for it.
        if self._active is not None and self._active.move.is_on_wire:
            self._active.move.note_comparator(number)

    def line_lost(self, error: ConnectionLostError) -> None:
        """Let whoever watches a move find out at once; one that waits for its trigger will never be sent."""
        move = self._active.move if self._active is not None else None
        if isinstance(move, PreparedMove) and not move.is_on_wire:
            self._withdraw(move, error)
        else:
            self.look_now()

    def line_restored(self, signs_of_restart: tuple[str, ...]) -> None:
        """Let a move that is under way find its fate; before the next, settings are said again."""
        self._observer.line.transfer.forget_taken()
        self.restarts += bool(signs_of_restart)
        super().line_restored(signs_of_restart)

    @property
    def is_homing(self) -> bool:
        """Whether a search for machine zero may be under way from here."""
        return self._active is not None and self._active.move.is_on_wire and self._active.move.plan.finds_machine_zero

    async def read_position(self) -> float:
        """Read S1."""
        return await self._observer.line.position()

    async def look_around(self) -> DriveStatus | None:
        """
        Find out whether a motion runs: the ``$`` that ends somebody else's is not one of ours.

        On a line that came back: one that was sent before the answer to this came before it, or is lost.
        """
        try:
            status = await self._observer.read_status(Lane.GREETING)
        except (CommandRejectedError, UnexpectedAnswerError) as error:
            _log.warning("%s does not say how it stands: %s", self.name, error)
            return None
        self._memory.messages_owed = int(status.command_active)
        return status

    async def reconcile(self) -> DriveStatus:
        """Read status and position, and end the doubt; a line that is held goes on by the caller's word."""
        self._observer.line.link.resume()
        mark = self.untracked.mark()
        look = await self._observer.look()
        self._memory.doubt = None
        if not look.status.command_active and not look.status.program_running:
            self.untracked.note_over(mark)
        return look.status

    # Stopping -------------------------------------------------------------------------------------------------------

    def _send_stop(self) -> Callable[[], Awaitable[_Standstill]]:
        return partial(self._carry_through, Stop(self._observer))

    async def _carry_through(self, stop: Stop) -> _Standstill:
        look = await stop.carry_through()
        return _Standstill(look, None if look.status.no_fault else await self._read_fault())

    async def _read_fault(self) -> DeviceError | None:
        """Read S30 of a drive that stands; which fault it is does not hold up who waits for the stop."""
        with suppress(TimeoutError, ConnectionLostError):
            async with asyncio.timeout(self._observer.line.settings.answer_timeout_s):
                return await self._observer.read_error()
        return None

    def _conclude_stopped(self, pursuit: Pursuit, standstill: _Standstill, reason: MoveError | None) -> None:
        look, fault = standstill.look, standstill.fault
        pursuit.conclude_stopped(
            look, None if look.status.no_fault else self._reports.fault(pursuit.move, look, fault), reason
        )
