"""Motions that nobody watches, such as raw commands and programs: told at most once, taken back by a stop."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from functools import partial
from typing import Any, Generic, TypeVar

from ..link.contract import Lane
from .reports import MoveReports

__all__ = ["Untracked"]

_Answer = TypeVar("_Answer")


class Untracked(Generic[_Answer]):
    """
    Knows whether a motion that nobody watches may be under way, and holds those that wait for their turn on the line.

    Args:
        command: Sends a line, calls the function given when it is written, and raises unless the device takes it.
        reports: Of the same drive or axis.
    """

    def __init__(
        self, command: Callable[[str, Lane, Callable[[], None]], Coroutine[Any, Any, _Answer]], reports: MoveReports
    ) -> None:
        self._command = command
        self._reports = reports
        self._waiting: set[asyncio.Task[_Answer]] = set()
        self._count = 0
        self._under_way: dict[int, bool] = {}
        """By number, in the order of writing: whether it is a motion that ends before another can begin."""

    @property
    def may_move(self) -> bool:
        """Whether one was written that is not known to be over."""
        return bool(self._under_way)

    def mark(self) -> int:
        """Return what :meth:`note_over` wants to be told later of all that was written until now."""
        return self._count

    def note(self, *, is_move: bool = False) -> None:
        """Take note of one that was written, or of anything else that may be moving."""
        self._count += 1
        self._under_way[self._count] = is_move

    def note_over(self, mark: int) -> None:
        """Take note that all that was written up to *mark* is over."""
        self._under_way = {number: is_move for number, is_move in self._under_way.items() if number > mark}

    def note_moves_over(self, mark: int) -> None:
        """Take note that the device has taken a motion: those before *mark* have ended, programs may go on."""
        self._under_way = {
            number: is_move for number, is_move in self._under_way.items() if number > mark or not is_move
        }

    async def tell(self, text: str, *, is_move: bool) -> _Answer:
        """Send a motion that ends before another can begin (*is_move*), or what may go on; see :meth:`say`."""
        mark = self.mark()
        answer = await self.say(text, Lane.MOTION, partial(self.note, is_move=is_move))
        if is_move:
            self.note_moves_over(mark)
        return answer

    async def say(self, text: str, lane: Lane, on_sent: Callable[[], None]) -> _Answer:
        """
        Send one line, unless a stop comes before its turn on the line.

        Raises:
            MoveStoppedError: It came; nothing was sent.
            CommandRejectedError, UnexpectedAnswerError, AnswerTimeoutError, ConnectionLostError: As for any line.
        """

        def written() -> None:
            self._waiting.discard(saying)
            on_sent()

        saying = asyncio.ensure_future(self._command(text, lane, written))
        self._waiting.add(saying)
        try:
            return await saying
        except asyncio.CancelledError:
            task = asyncio.current_task()
            was_taken_back = saying in self._waiting and not (task is not None and task.cancelling())
            if not was_taken_back:
                raise
            raise self._reports.taken_back(text) from None
        finally:
            self._waiting.discard(saying)

    def take_back(self) -> None:
        """Let what waits for its turn never be sent."""
        for saying in self._waiting:
            saying.cancel()
