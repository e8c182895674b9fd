"""A move as the caller holds it: a future of its result, that can be watched, stopped and cancelled."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Generator
from contextvars import Context
from dataclasses import dataclass
from typing import Any, Literal, Protocol, Self, get_args

from ..checked_numbers import check_number
from ..errors import CompaxError, InvalidCommandError

__all__ = ["Milestone", "MoveFuture", "MoveOwner", "MoveResult", "OnCancel", "check_manner", "fetch_error"]

OnCancel = Literal["stop", "detach"]


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveResult:
    """How a move ended that reached its target."""

    drive: str
    """The name of the drive, or of the axis, that moved."""
    target: float | None
    """As rounded to the decimals of the device, in its unit. For a relative move: the target position read before, plus
    the distance. None for a search whose end only the device knows."""
    confirmed_by: Literal["message", "status"]
    """``message``: the device said so unasked. ``status``: it was asked."""
    started_at: float
    """Loop time when the line that starts the motion was written."""
    finished_at: float
    """Loop time when the confirmation was read."""
    last_position: float | None
    """What the device last sent as its position, usually on the way; None if it was never asked."""

    @property
    def duration_s(self) -> float:
        """Seconds from the start being written to the confirmation being read."""
        return self.finished_at - self.started_at


class MoveOwner(Protocol):
    """What a move needs of what it moves."""

    name: str

    def abandon(self, move: MoveFuture) -> None:
        """Deal with a move that was cancelled."""

    async def stop_move(self, move: MoveFuture) -> None:
        """Stop the device, if *move* still runs."""

    async def read_position(self) -> float:
        """Ask the device where it is."""


class _Part(asyncio.Future[None]):
    """A part of a move that can be awaited by itself: who does has learnt the error that the move ends with."""

    def __init__(self, move: MoveFuture) -> None:
        super().__init__(loop=move.get_loop())
        self._move = move
        super().add_done_callback(fetch_error)

    def add_done_callback(self, callback: Callable[[Self], object], /, *, context: Context | None = None) -> None:
        """Take note that somebody waits."""
        self._move.is_told_by_part = True
        super().add_done_callback(callback, context=context)

    def __await__(self) -> Generator[Any, None, None]:
        if self.done() and not self.cancelled() and self.exception() is not None:
            fetch_error(self._move)
        return super().__await__()


class Milestone:
    """
    What a move gets to before its end, as two futures.

    Attributes:
        told: For callers.
        known: The same for the library itself: who gives up waiting for the other does not end this one.
    """

    def __init__(self, move: MoveFuture) -> None:
        # Whoever awaits only the move learns the same error there, and the other way round.
        self.told: asyncio.Future[None] = _Part(move)
        self.known: asyncio.Future[None] = move.get_loop().create_future()
        self.known.add_done_callback(fetch_error)

    def reach(self) -> None:
        """Let who waits go on."""
        for future in (self.told, self.known):
            if not future.done():
                future.set_result(None)

    def fail(self, error: CompaxError) -> None:
        """Raise *error* in who waits."""
        for future in (self.told, self.known):
            if not future.done():
                future.set_exception(error)

    def cancel(self) -> None:
        """Let nobody wait any more."""
        self.told.cancel()
        self.known.cancel()


class MoveFuture(asyncio.Future[MoveResult]):
    """
    A motion under way; awaiting it gives a :class:`MoveResult`, or raises why the target was not reached.

    Cancelling it (also by a time-out around it, a failing task group, Ctrl-C) stops the device, unless it was made
    with ``on_cancel="detach"``; then the device goes on, unwatched. Cancelling somebody who awaits :attr:`accepted`, or
    iterates over :meth:`positions`, cancels only that; leaving the device's block stops the move all the same.

    Attributes:
        accepted: A future that is done when the device has taken the motion, or raises why it has not.
        acceptance: The same for the library itself: who gives up waiting for the other does not end this one.
        description: What was asked for, in a few words, for errors.
        target: The absolute target, rounded to the device's decimals; None as long as only the device knows it.
        on_cancel: What cancelling it does.
        sent: The line that started the motion, as it was written; None until then.
        started_at: Loop time when that was; None until then.
        failure: The error that it has ended with; None if it has not. Looking at it is not having learnt of it.
        is_told_by_part: Whether somebody awaits a part of it, and so learns its error.
    """

    def __init__(self, owner: MoveOwner, description: str, target: float | None, on_cancel: OnCancel) -> None:
        super().__init__()
        self._acceptance = Milestone(self)
        self.accepted = self._acceptance.told
        self.acceptance = self._acceptance.known
        self.description = description
        self.target = target
        self.on_cancel = on_cancel
        self.sent: str | None = None
        self.started_at: float | None = None
        self.failure: CompaxError | None = None
        self.is_told_by_part = False
        self._owner = owner
        self._changed = asyncio.Event()
        self.add_done_callback(lambda _: self._changed.set())

    @property
    def is_on_wire(self) -> bool:
        """Whether the line that starts the motion was written."""
        return self.started_at is not None

    def cancel(self, msg: Any = None) -> bool:
        """Give the move up; a stop is written before this returns, if the line is free and the device may be moving."""
        if not super().cancel(msg):
            return False
        self._acceptance.cancel()
        self._owner.abandon(self)
        return True

    async def stop(self) -> None:
        """
        Stop the device, and return at its standstill; the move then raises MoveStoppedError.

        A move that has ended already is left as it is.

        Raises:
            AnswerTimeoutError, CommandRejectedError, MoveTimeoutError, ConnectionLostError: It may not have stopped.
        """
        await self._owner.stop_move(self)

    async def positions(self, *, interval_s: float = 0.05) -> AsyncIterator[float]:
        """
        Yield the actual position while the move runs, and once at its end.

        Args:
            interval_s: Shortest time between two readings; the line sets a limit of its own.

        Yields:
            Positions in the device's unit. Errors end the iteration: awaiting the move raises them.
        """
        last_reading = False
        while not last_reading:
            last_reading = self.done()
            try:
                yield await self._owner.read_position()
            except CompaxError:
                return
            if not last_reading:
                await self._wait_for_change(interval_s)

    async def _wait_for_change(self, at_most_s: float | None) -> None:
        """Wait until something is noted on the way, the move ends, or *at_most_s* has gone by."""
        self._changed.clear()
        if self.done():
            return
        try:
            async with asyncio.timeout(at_most_s):
                await self._changed.wait()
        except TimeoutError:
            pass

    # What the device tells it ---------------------------------------------------------------------------------------

    def note_sent(self, text: str) -> None:
        """Note that the line which starts the motion was written."""
        self.sent, self.started_at = text, self.get_loop().time()

    def note_accepted(self) -> None:
        """Note that the device has taken the motion."""
        self._acceptance.reach()

    def finish(self, confirmed_by: Literal["message", "status"], last_position: float | None) -> None:
        """Note that the device confirmed the target."""
        self.note_accepted()
        if not self.done():
            assert self.started_at is not None
            self.set_result(
                MoveResult(
                    drive=self._owner.name,
                    target=self.target,
                    confirmed_by=confirmed_by,
                    started_at=self.started_at,
                    finished_at=self.get_loop().time(),
                    last_position=last_position,
                )
            )

    def fail(self, error: CompaxError) -> None:
        """Raise *error* in whoever awaits the move, or its acceptance."""
        if self.is_told_by_part and not self.accepted.done():
            self.add_done_callback(fetch_error)
        self._acceptance.fail(error)
        if not self.done():
            self.failure = error
            self.set_exception(error)


def check_manner(timeout_s: float | None, on_cancel: OnCancel) -> None:
    """
    Check what a move is told about itself.

    Raises:
        InvalidCommandError: It means nothing.
    """
    if timeout_s is not None and not check_number("timeout_s", timeout_s) > 0:
        raise InvalidCommandError(f"timeout_s must be above 0, not {timeout_s!r}")
    if on_cancel not in get_args(OnCancel):
        raise InvalidCommandError(f"on_cancel is 'stop' or 'detach', not {on_cancel!r}")


def fetch_error(future: asyncio.Future[Any]) -> None:
    """Take note of how *future* ended, so that asyncio does not complain that nobody did."""
    if not future.cancelled():
        future.exception()
