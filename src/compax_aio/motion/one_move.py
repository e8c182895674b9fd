"""What moves one drive or axis: at most one move at a time, and a stop that goes before everything."""

from __future__ import annotations

import asyncio
import logging
from abc import ABC, abstractmethod
from collections.abc import Awaitable, Callable
from typing import Generic, Protocol, TypeVar

from ..errors import (
    AnswerTimeoutError,
    CompaxError,
    ConnectionLostError,
    MoveError,
    MoveInDoubtError,
    UnexpectedAnswerError,
)
from ..link.link import Link
from .announcing import announce
from .events import DriveEvent, Stopped
from .moves import MoveFuture, fetch_error
from .reports import MoveReports
from .untracked import Untracked

__all__ = ["Doubtful", "MustStop", "OneMove", "Pursued"]


class MustStop(Exception):  # noqa: N818 - it is no error of its own, and never leaves OneMove
    """
    The device must be stopped, for it may be moving or begin to.

    Args:
        reason: What the move then raises.
    """

    def __init__(self, reason: MoveError) -> None:
        super().__init__(reason.what)
        self.reason = reason


class Pursued(Protocol):
    """One move carried out, in the way of its device."""

    @property
    def move(self) -> MoveFuture:
        """What its holder awaits."""

    @property
    def times_opened(self) -> int:
        """How often the line had been opened when the move was commanded."""

    async def carry_out(self) -> None:
        """
        Say it, watch it; returns when the move has reached its target.

        Raises:
            MustStop: The device must be stopped, and then has not reached its target, unless the standstill shows it.
            CompaxError: It has not reached its target; the error says why.
        """

    def look_now(self) -> None:
        """Look at once: something has happened to the line."""

    def line_restored(self, signs_of_restart: tuple[str, ...]) -> None:
        """Look at once, now that the line is back."""


class Doubtful(Protocol):
    """What is remembered from one move to the next."""

    doubt: str | None
    """Why no motion is taken until somebody has looked."""


_Pursuit = TypeVar("_Pursuit", bound=Pursued)
_Standstill = TypeVar("_Standstill")
_Answer = TypeVar("_Answer")


class OneMove(ABC, Generic[_Pursuit, _Standstill, _Answer]):
    """
    Keeps at most one move of a drive or axis, and stops whatever moves it.

    How a move is carried out is told to it with each (:class:`Pursued`); how it is stopped, and what the standstill
    says of the move, by a subclass.

    Args:
        link: The line.
        reports: Of the same drive or axis.
        untracked: Of the same drive or axis.
        memory: Of the same drive or axis.
        log: Where a stop that failed is told.
        publish: Called with what happens to moves, and with standstills after stops.
    """

    def __init__(
        self,
        name: str,
        link: Link,
        *,
        reports: MoveReports,
        untracked: Untracked[_Answer],
        memory: Doubtful,
        log: logging.Logger,
        publish: Callable[[DriveEvent], None],
    ) -> None:
        self.name = name
        self.untracked = untracked
        self.stops = 0
        """How many times a stop has been asked for."""
        self._link = link
        self._reports = reports
        self._memory = memory
        self._log = log
        self._publish = publish
        self._loop = asyncio.get_running_loop()
        self._active: _Pursuit | None = None
        self._stopped: _Pursuit | None = None
        self._task: asyncio.Task[None] | None = None
        self._stopping: asyncio.Task[None] | None = None

    # What differs from device to device -----------------------------------------------------------------------------

    @abstractmethod
    def _send_stop(self) -> Callable[[], Awaitable[_Standstill]]:
        """
        Queue the stop ahead of everything else, or write it, before this returns.

        Returns:
            What is called once and awaited until the device stands still. It carries the stop through although
            it is cancelled, and raises CompaxError if nobody can say that the device stands.
        """

    @abstractmethod
    def _conclude_stopped(self, pursuit: _Pursuit, standstill: _Standstill, reason: MoveError | None) -> None:
        """End the move by what was seen after a stop: it may have been there already; else *reason* goes first."""

    @abstractmethod
    async def read_position(self) -> float:
        """Ask the device where it is."""

    async def _make_ready(self, text: str) -> None:
        """Look and say what comes before *text*, which starts a motion that nobody watches; raise to forbid it."""

    async def _tell(self, text: str) -> _Answer:
        """Send *text*, which starts a motion that nobody watches."""
        return await self.untracked.tell(text, is_move=False)

    # Starting -------------------------------------------------------------------------------------------------------

    def check_free(self, what: str) -> None:
        """Raise MoveActiveError or MoveInDoubtError if no motion can begin: *what* was not sent."""
        self.refuse_second(what)
        self._refuse_in_doubt(what)

    def refuse_second(self, what: str) -> None:
        """Raise MoveActiveError if a move runs: *what* was not sent."""
        if self._active is not None and not self._active.move.done():
            raise self._reports.running(self._active.move, what)

    def _refuse_in_doubt(self, what: str) -> None:
        if self._memory.doubt is not None:
            raise self._reports.refused_in_doubt(what, self._memory.doubt)

    def _begin(self, pursuit: _Pursuit) -> None:
        """Carry out a move, which :meth:`check_free` allows, after a stop that is under way."""
        self._release()
        self._active = pursuit
        move = pursuit.move
        self._task = self._loop.create_task(self._pursue(pursuit), name=f"{self.name}: {move.description}")
        # Whatever ends the move, by whoever's hand: the drive is free for the next.
        move.add_done_callback(self._move_done)
        announce(move, self.name, self._publish)

    def _limit(self, move: MoveFuture, timeout_s: float | None) -> None:
        """Let *move* take *timeout_s* from now on and no longer, if it is not None."""
        if timeout_s is not None:
            timer = self._loop.call_later(timeout_s, self._time_is_up, move, timeout_s)
            move.add_done_callback(lambda _: timer.cancel())

    def _time_is_up(self, move: MoveFuture, timeout_s: float) -> None:
        error = self._reports.out_of_time(move, timeout_s)
        if move.is_on_wire and self._is_active(move):
            self.begin_stop(error)
        else:
            self._withdraw(move, error)

    async def _pursue(self, pursuit: _Pursuit) -> None:
        try:
            await self._take_turn(pursuit)
        except MustStop as order:
            if self._is_active(pursuit.move):
                self.begin_stop(order.reason)
        except CompaxError as error:
            # What is in doubt may be moving: leaving the block stops it.
            if isinstance(error, MoveInDoubtError) and pursuit.move.is_on_wire:
                self.untracked.note()
            pursuit.move.fail(error)
        except Exception as defect:
            # A defect, here or in a caller's own code: the device must not go on with nobody watching it.
            if self._is_active(pursuit.move):
                self.begin_stop(self._reports.defect(pursuit.move, defect))
            raise
        except asyncio.CancelledError:
            # Either the move was taken from here, or the event loop is ending: then the drive must not go on alone.
            if self._is_active(pursuit.move):
                pursuit.move.cancel()
            # Also where somebody else was quicker to stop it: the loop must not end before that is over.
            if self._stopping is not None:
                await asyncio.wait([self._stopping])
            raise

    async def _take_turn(self, pursuit: _Pursuit) -> None:
        if self._stopping is not None:
            await self._until_stopped(pursuit.times_opened)
            self._refuse_in_doubt(pursuit.move.description)
        await pursuit.carry_out()

    async def _until_stopped(self, times_opened: int) -> None:
        """Wait for a stop that is under way; what shall follow it is not said on a line that came back meanwhile."""
        assert self._stopping is not None
        self._link.check_not_lost(times_opened)
        await asyncio.wait([self._stopping])
        self._link.check_not_lost(times_opened)

    # What nobody watches --------------------------------------------------------------------------------------------

    async def command(self, text: str) -> _Answer:
        """Send *text* as :meth:`tell` does; where nobody can say what became of it, no motion is taken any more."""
        mark = self.untracked.mark()
        try:
            return await self.tell(text)
        except (AnswerTimeoutError, ConnectionLostError, UnexpectedAnswerError) as error:
            if self.untracked.mark() != mark:
                self._memory.doubt = f"what became of {text!r} is unknown ({error.what})"
                error.hint = self._reports.hint_when_unknown
            raise

    async def tell(self, text: str, *, unless_stopped_since: int | None = None) -> _Answer:
        """
        Send *text*, which starts a motion that nobody watches, after a stop that is under way.

        Leaving the block stops it; a stop that comes before it is written takes it back.

        Args:
            text: One checked line.
            unless_stopped_since: What :attr:`stops` was when the caller began; a stop since then counts as well.

        Raises:
            MoveActiveError, MoveInDoubtError: Another move runs or is in doubt; nothing was sent.
            MoveStoppedError: A stop came before it was sent.
            CommandRejectedError, UnexpectedAnswerError, AnswerTimeoutError, ConnectionLostError: As for any line.
        """
        stops = self.stops if unless_stopped_since is None else unless_stopped_since
        await self._until_free(repr(text))
        await self._make_ready(text)
        if self.stops != stops:
            raise self._reports.taken_back(text)
        self.check_free(repr(text))  # a move may have begun meanwhile
        return await self._tell(text)

    async def _until_free(self, what: str) -> None:
        """Wait for a stop that is under way; then raise, as :meth:`check_free`, if no motion can begin."""
        if self._stopping is not None:
            await self._until_stopped(self._link.times_opened)
        self.check_free(what)

    def note_doubt(self, why: str) -> None:
        """Take no motion from here until somebody has looked; what may be moving is stopped when the block is left."""
        self._memory.doubt = why
        self.untracked.note()

    # The line -------------------------------------------------------------------------------------------------------

    def look_now(self) -> None:
        """Let whoever watches a move find out at once: something has happened to the line."""
        if self._active is not None:
            self._active.look_now()

    def line_restored(self, signs_of_restart: tuple[str, ...]) -> None:
        """Let a move that is under way find its fate."""
        for pursuit in (self._active, self._stopped):
            if pursuit is not None:
                pursuit.line_restored(signs_of_restart)

    # Stopping -------------------------------------------------------------------------------------------------------

    def begin_stop(self, reason: MoveError | None = None) -> asyncio.Task[None]:
        """
        Send the stop, now or as soon as the exchange in flight is over; the task ends at standstill.

        Args:
            reason: What the move that is stopped shall raise, if not MoveStoppedError.
        """
        self.stops += 1
        self.untracked.take_back()
        pursuit = self._release()
        if pursuit is not None and reason is None:
            # Whoever stops a move from here knows; it is no news that nobody fetched.
            pursuit.move.add_done_callback(fetch_error)
        if pursuit is not None and not pursuit.move.is_on_wire:
            self._withdraw(pursuit.move, reason or self._reports.withdrawn(pursuit.move))
            pursuit = None
        if self._stopping is None:
            self.untracked.note_over(self.untracked.mark())
            until_standstill = self._send_stop()
            self._stopped = pursuit
            self._stopping = self._loop.create_task(
                self._stop(until_standstill, pursuit, reason), name=f"{self.name}: stop"
            )
            self._stopping.add_done_callback(self._stop_done)
        return self._stopping

    async def _stop(
        self,
        until_standstill: Callable[[], Awaitable[_Standstill]],
        pursuit: _Pursuit | None,
        reason: MoveError | None,
    ) -> None:
        try:
            standstill = await until_standstill()
        except CompaxError as error:
            self.note_doubt(f"a stop failed ({error.what})")
            if pursuit is not None:
                pursuit.move.fail(self._reports.in_doubt(pursuit.move, "it may still be moving, a stop failed", error))
            raise
        self._publish(Stopped(self.name, self._loop.time()))
        if pursuit is not None:
            self._conclude_stopped(pursuit, standstill, reason)

    async def stop(self) -> None:
        """Stop the device and return at its standstill."""
        await asyncio.shield(self.begin_stop())

    async def stop_move(self, move: MoveFuture) -> None:
        """Stop the device if *move* runs, or wait for the stop that its cancelling began."""
        if self._is_active(move):
            await self.stop()
        elif self._stopping is not None:
            await asyncio.shield(self._stopping)

    def _stop_done(self, task: asyncio.Task[None]) -> None:
        self._stopping = self._stopped = None
        if not task.cancelled() and (error := task.exception()) is not None:
            self._log.error("%s", error)

    # Ending ---------------------------------------------------------------------------------------------------------

    def abandon(self, move: MoveFuture) -> None:
        """Deal with a move that its holder has cancelled."""
        if not self._is_active(move):
            return
        if move.is_on_wire and move.on_cancel == "stop":
            self.begin_stop()
        else:
            self._release()

    async def end(self) -> None:
        """Stop what was started here, unless it was to go on; raises what a stop raises."""
        move = self._active.move if self._active is not None else None
        self.untracked.take_back()
        if move is not None:
            move.add_done_callback(fetch_error)
        if move is not None and not move.is_on_wire:
            self._withdraw(move, self._reports.withdrawn(move))
            move = None
        if move is not None and move.on_cancel == "detach":
            self._withdraw(move, self._reports.unwatched(move))
        elif (hold := self._link.held) is not None:
            # Nobody has asked for a stop, and its bytes could complete a motion that never began.
            raise self._reports.left_without_stop(hold.why, hold.remedy)
        elif move is not None or self.untracked.may_move:
            self.begin_stop()
        if self._stopping is not None:
            await asyncio.shield(self._stopping)

    def _is_active(self, move: MoveFuture) -> bool:
        return self._active is not None and self._active.move is move

    def _move_done(self, move: MoveFuture) -> None:
        if self._is_active(move):
            self._release()

    def _withdraw(self, move: MoveFuture, error: CompaxError) -> None:
        """End *move* from here; if its motion is not yet on the wire, it never will be."""
        if self._is_active(move):
            self._release()
        move.fail(error)

    def _release(self) -> _Pursuit | None:
        """Let go of the active move: nobody watches it from now on."""
        pursuit, self._active = self._active, None
        task, self._task = self._task, None
        if task is not None and task is not asyncio.current_task():
            task.cancel()
        return pursuit
