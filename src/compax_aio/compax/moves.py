"""A move of one drive: what any move can do, and comparators, another speed on the way, a start in two steps."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from typing import Any, Protocol

from ..errors import CompaxError
from ..motion.moves import Milestone, MoveFuture, MoveOwner, MoveResult, OnCancel, check_manner, fetch_error
from .vocabulary import MovePlan

__all__ = ["DriveOfMove", "Move", "MoveResult", "OnCancel", "PreparedMove", "check_manner", "fetch_error"]


class DriveOfMove(MoveOwner, Protocol):
    """What a move needs of the drive it runs on."""

    async def change_speed(self, move: Move, speed_percent: int) -> None:
        """Let *move*, which must run, go on at another speed."""

    def trigger(self, move: PreparedMove) -> None:
        """Start *move*, which the drive must hold ready."""


class Move(MoveFuture):
    """
    A motion under way; awaiting it gives a :class:`MoveResult`, or raises why the target was not reached.

    Cancelling it (also by a time-out around it, a failing task group, Ctrl-C) stops the drive, unless it was made
    with ``on_cancel="detach"``; then the drive goes on, unwatched. Cancelling somebody who awaits :attr:`accepted`, or
    iterates over :meth:`positions`, cancels only that; leaving the drive's block stops the move all the same.

    It is confirmed by the message ``$``, or by S16 and S17. Positions are S1 (UG p. 104), which at 9600 baud take about
    24 ms each.

    Attributes:
        accepted: A future that is done when the drive's prompt came back, or raises why it did not.
        target: The absolute target, rounded to the drive's decimals; None as long as only the drive knows it.
        plan: What is said to the drive.
        sent: The line that started the motion, as it was written; None until then.
    """

    def __init__(self, owner: DriveOfMove, plan: MovePlan, on_cancel: OnCancel) -> None:
        super().__init__(owner, plan.description, plan.target, on_cancel)
        self.plan = plan
        self._drive = owner
        self._passed: list[int] = []

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
        await self._drive.change_speed(self, speed_percent)

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

    def note_comparator(self, number: int) -> None:
        """Note that comparator *number* was passed."""
        if len(self._passed) < self.plan.comparators:
            self._passed.append(number)
            self._changed.set()


class PreparedMove(Move):
    """
    A move that the drive holds ready in its intermediate memory (``,``, UG p. 160) until :meth:`trigger` (``!``).

    So several drives begin at the same time: prepare all of them, and then send no more than the triggers. Until it is
    triggered nothing moves, and cancelling or stopping it only forgets it.

    Attributes:
        ready: A future that is done when the drive holds the move, or raises why it does not.
    """

    def __init__(self, owner: DriveOfMove, plan: MovePlan, on_cancel: OnCancel) -> None:
        super().__init__(owner, plan, on_cancel)
        self._readiness = Milestone(self)
        self.ready = self._readiness.told
        self.readiness = self._readiness.known
        """The same for the library itself."""
        self.triggered = asyncio.Event()

    def trigger(self) -> None:
        """
        Start the move; it is sent in the next turn of the event loop.

        Where something else went over the line since the drive took the move, the motion itself is sent in place of
        ``!``: no page says what the intermediate memory holds then.

        Raises:
            MoveError: It is not ready, was triggered before, or has ended.
        """
        self._drive.trigger(self)

    def cancel(self, msg: Any = None) -> bool:
        """Give the move up; see :meth:`Move.cancel`."""
        self._readiness.cancel()
        return super().cancel(msg)

    def note_ready(self) -> None:
        """Note that the drive holds the move."""
        self._readiness.reach()

    def fail(self, error: CompaxError) -> None:
        """Raise *error* in whoever awaits the move, its readiness, or its acceptance."""
        self._readiness.fail(error)
        super().fail(error)
