"""A move as the caller holds it: a future of its result, that can be watched, stopped and cancelled."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Generator, Iterable
from contextvars import Context
from dataclasses import dataclass
from typing import Any, Literal, Protocol, Self, get_args

from ..errors import CompaxError, InvalidCommandError
from .vocabulary import MovePlan, check_number

__all__ = ["Move", "MoveOwner", "MoveResult", "OnCancel", "PreparedMove", "check_manner", "fetch_error"]

OnCancel = Literal["stop", "detach"]


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveResult:
    """How a move ended that reached its target."""

    drive: str
    target: float | None
    """As rounded to the drive's decimals, in its unit. For a relative move: the target position read before, plus
    the distance. None for the search for machine zero."""
    confirmed_by: Literal["message", "status"]
    """``message``: the drive sent ``$``. ``status``: S16 and S17 were asked."""
    started_at: float
    """Loop time when the line that starts the motion was written."""
    finished_at: float
    """Loop time when the confirmation was read."""
    last_position: float | None
    """What the drive last sent as its position, usually on the way; None if it was never asked."""

    @property
    def duration_s(self) -> float:
        """Seconds from the start being written to the confirmation being read."""
        return self.finished_at - self.started_at


class MoveOwner(Protocol):
    """What a move needs of the drive it runs on."""

    name: str

    def abandon(self, move: Move) -> None:
        """Deal with a move that was cancelled."""

    async def stop_move(self, move: Move) -> None:
        """Stop the drive, if *move* still runs."""

    async def read_position(self) -> float:
        """Ask the drive where it is."""

    async def change_speed(self, move: Move, speed_percent: int) -> None:
        """Let *move*, which must run, go on at another speed."""

    def trigger(self, move: PreparedMove) -> None:
        """Start *move*, which the drive must hold ready."""


class _Part(asyncio.Future[None]):
    """A part of a move that can be awaited by itself: who does has learnt the error that the move ends with."""

    def __init__(self, move: Move) -> None:
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


class Move(asyncio.Future[MoveResult]):
    """
    A motion under way; awaiting it gives a :class:`MoveResult`, or raises why the target was not reached.

    Cancelling it (also by a time-out around it, a failing task group, Ctrl-C) stops the drive, unless it was made
    with ``on_cancel="detach"``; then the drive goes on, unwatched. Cancelling somebody who awaits :attr:`accepted`, or
    iterates over :meth:`positions`, cancels only that; leaving the drive's block stops the move all the same.

    Attributes:
        accepted: A future that is done when the drive's prompt came back, or raises why it did not.
        target: The absolute target, rounded to the drive's decimals; None as long as only the drive knows it.
        plan: What is said to the drive.
        sent: The line that started the motion, as it was written; None until then.
    """

    def __init__(self, owner: MoveOwner, plan: MovePlan, on_cancel: OnCancel) -> None:
        super().__init__()
        # Whoever awaits only the move learns the same error there, and the other way round.
        self.accepted: asyncio.Future[None] = _Part(self)
        self.acceptance: asyncio.Future[None] = self.get_loop().create_future()
        """The same for the library itself: who gives up waiting for the other does not end this one."""
        self.acceptance.add_done_callback(fetch_error)
        self.plan = plan
        self.target = plan.target
        self.on_cancel = on_cancel
        self.sent: str | None = None
        self.started_at: float | None = None
        self.is_told_by_part = False
        self._passed: list[int] = []
        self._owner = owner
        self._changed = asyncio.Event()
        self.add_done_callback(lambda _: self._changed.set())

    @property
    def is_on_wire(self) -> bool:
        """Whether the line that starts the motion was written."""
        return self.started_at is not None

    def cancel(self, msg: Any = None) -> bool:
        """Give the move up; STOP is written before this returns, if the line is free and the drive may be moving."""
        if not super().cancel(msg):
            return False
        _end((self.accepted, self.acceptance))
        self._owner.abandon(self)
        return True

    async def stop(self) -> None:
        """
        Stop the drive, and return at its standstill; the move then raises MoveStoppedError.

        A move that has ended already is left as it is.

        Raises:
            AnswerTimeoutError, CommandRejectedError, MoveTimeoutError, ConnectionLostError: It may not have stopped.
        """
        await self._owner.stop_move(self)

    async def change_speed(self, speed_percent: int) -> None:
        """
        Go on at another speed from now on, while the move runs (by inference from IBS p. 42; a word of the dialect).

        Args:
            speed_percent: Of nominal speed, a whole number above 0, at most the settings' ``speed_limit_percent``.

        Raises:
            InvalidCommandError: The drive cannot be told this; nothing was sent.
            MoveError: The move does not run, or ended before the new speed was sent.
            CommandRejectedError: The drive refused it; the move goes on as it was.
        """
        await self._owner.change_speed(self, speed_percent)

    async def positions(self, *, interval_s: float = 0.05) -> AsyncIterator[float]:
        """
        Yield the actual position (S1, UG p. 104) while the move runs, and once at its end.

        Args:
            interval_s: Shortest time between two readings; the line sets a limit of its own (9600 baud: about 24 ms).

        Yields:
            Positions in the drive's unit. Errors end the iteration: awaiting the move raises them.
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

    async def comparators(self) -> AsyncIterator[int]:
        """
        Yield the number of each comparator as the drive passes it (UG p. 162), until all are passed or the move ends.

        Numbers count in the order in which the comparators were given, from 1, whatever their distance.
        """
        seen = 0
        while True:
            while seen < len(self._passed):
                seen += 1
                yield self._passed[seen - 1]
            if self.done() or seen >= self.plan.comparators:
                return
            await self._wait_for_change(None)

    async def _wait_for_change(self, at_most_s: float | None) -> None:
        """Wait until a comparator is passed, the move ends, or *at_most_s* has gone by."""
        self._changed.clear()
        if self.done():
            return
        try:
            async with asyncio.timeout(at_most_s):
                await self._changed.wait()
        except TimeoutError:
            pass

    # What the drive tells it ----------------------------------------------------------------------------------------

    def note_sent(self, text: str) -> None:
        """Note that the line which starts the motion was written."""
        self.sent, self.started_at = text, self.get_loop().time()

    def note_accepted(self) -> None:
        """Note that the prompt came back."""
        _succeed((self.accepted, self.acceptance))

    def note_comparator(self, number: int) -> None:
        """Note that comparator *number* was passed."""
        if len(self._passed) < self.plan.comparators:
            self._passed.append(number)
            self._changed.set()

    def finish(self, confirmed_by: Literal["message", "status"], last_position: float | None) -> None:
        """Note that the drive confirmed the target."""
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
        _fail((self.accepted, self.acceptance), error)
        if not self.done():
            self.set_exception(error)


class PreparedMove(Move):
    """
    A move that the drive holds ready in its intermediate memory (``,``, UG p. 160) until :meth:`trigger` (``!``).

    So several drives begin at the same time: prepare all of them, and then send no more than the triggers. Until it is
    triggered nothing moves, and cancelling or stopping it only forgets it.

    Attributes:
        ready: A future that is done when the drive holds the move, or raises why it does not.
    """

    def __init__(self, owner: MoveOwner, plan: MovePlan, on_cancel: OnCancel) -> None:
        super().__init__(owner, plan, on_cancel)
        self.ready: asyncio.Future[None] = _Part(self)
        self.readiness: asyncio.Future[None] = self.get_loop().create_future()
        """The same for the library itself."""
        self.readiness.add_done_callback(fetch_error)
        self.triggered = asyncio.Event()

    def trigger(self) -> None:
        """
        Start the move; it is sent in the next turn of the event loop.

        Where something else went over the line since the drive took the move, the motion itself is sent in place of
        ``!``: no page says what the intermediate memory holds then.

        Raises:
            MoveError: It is not ready, was triggered before, or has ended.
        """
        self._owner.trigger(self)

    def cancel(self, msg: Any = None) -> bool:
        """Give the move up; see :meth:`Move.cancel`."""
        _end((self.ready, self.readiness))
        return super().cancel(msg)

    def note_ready(self) -> None:
        """Note that the drive holds the move."""
        _succeed((self.ready, self.readiness))

    def fail(self, error: CompaxError) -> None:
        """Raise *error* in whoever awaits the move, its readiness, or its acceptance."""
        _fail((self.ready, self.readiness), error)
        super().fail(error)


def _succeed(futures: Iterable[asyncio.Future[None]]) -> None:
    for future in futures:
        if not future.done():
            future.set_result(None)


def _fail(futures: Iterable[asyncio.Future[None]], error: CompaxError) -> None:
    for future in futures:
        if not future.done():
            future.set_exception(error)


def _end(futures: Iterable[asyncio.Future[None]]) -> None:
    for future in futures:
        future.cancel()


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
