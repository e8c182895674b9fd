"""
When a control may be asked: one question at a time, ever more rarely while it is silent, and not while it is at work.

A control that was polled without pause has frozen (HaasMTConnect, issue 1), so nothing that callers do together, wait
for or cancel brings questions closer to each other than the line's own gap.
"""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import Any, Final

from ..errors import AnswerTimeoutError, CompaxError
from .settings import ControlSettings

__all__ = ["Pacing"]

_PRINT_PAUSE_S: Final = 1.0
"""A program that has printed may print on: so long nothing is asked behind a line."""
_MOST_DOUBLINGS: Final = 32


@dataclass(frozen=True, slots=True)
class _Block:
    """Why nothing is asked now."""

    why: str
    hint: str
    since: float
    patience_s: float
    """So long a question waits for it to be over."""
    until: float = inf
    transfer: asyncio.Future[Any] | None = None


class Pacing:
    """
    Lets one question through after the other, first come, first served.

    Args:
        name: Of the control.
        settings: How long things take.
        transfer: Says which transfer there is, under way or over.
        may_wait_for_rest: Says whether the control may take what comes next for the rest of a file.
    """

    def __init__(
        self,
        name: str,
        settings: ControlSettings,
        transfer: Callable[[], asyncio.Future[Any] | None],
        may_wait_for_rest: Callable[[], bool],
    ) -> None:
        self._name = name
        self._settings = settings
        self._transfer = transfer
        self._may_wait_for_rest = may_wait_for_rest
        self._loop = asyncio.get_running_loop()
        self._waiting: OrderedDict[asyncio.Future[None], None] = OrderedDict()
        """First come, first served; each is done when it is the first one."""
        self._is_taken = False
        self._wakers: set[asyncio.Future[None]] = set()
        self._in_vain = 0
        """Questions in a row that had no answer."""
        self._silent_since = self._silent_until = -inf
        self._printing_since = self._printed_at = -inf
        self._seen_transfer: asyncio.Future[Any] | None = None
        self._transfer_since = 0.0

    # Passing --------------------------------------------------------------------------------------------------------

    async def enter(self, question: str) -> None:
        """
        Wait for one's turn; :meth:`leave` must follow.

        Raises:
            AnswerTimeoutError: *question* cannot be sent for longer than it may wait; it was not.
        """
        is_first: asyncio.Future[None] = self._loop.create_future()
        arrived_at = self._loop.time()
        self._waiting[is_first] = None
        self._call_first()
        try:
            # Whoever came later gives up later: it is enough that the first one looks whether it may go, for waking
            # all who wait each time that one of them goes takes a time of its own when there are thousands.
            await is_first
            while (block := self._block()) is not None or self._is_taken:
                until = inf
                if block is not None:
                    give_up_at = max(arrived_at, block.since) + block.patience_s
                    if self._loop.time() >= give_up_at:
                        raise self._refused(question, block)
                    until = min(give_up_at, block.until)
                await self._change(until, block)
            self._is_taken = True
        finally:
            del self._waiting[is_first]
            self._call_first()

    def leave(self) -> None:
        """Let the next question through."""
        self._is_taken = False
        self._wake()

    async def until_free(self) -> None:
        """Wait until something may be asked, however long that takes; what only somebody can end is not waited for."""
        while (block := self._pause()) is not None:
            await self._change(block.until, block)

    @property
    def is_silent(self) -> bool:
        """Whether so many questions had no answer that nothing is asked for a while."""
        return self._loop.time() < self._silent_until

    # What happens ---------------------------------------------------------------------------------------------------

    def note_answered(self) -> None:
        """Take note that the control answers."""
        self._in_vain = 0
        self._silent_until = -inf

    def note_silence(self) -> None:
        """Take note that it did not."""
        self._in_vain += 1
        more = self._in_vain - self._settings.back_off_after
        if more >= 0:
            longer = self._settings.back_off_first_s * 2.0 ** min(more, _MOST_DOUBLINGS)
            self._silent_since = self._loop.time()
            self._silent_until = self._silent_since + min(longer, self._settings.back_off_slowest_s)

    def note_printed(self) -> None:
        """Take note that a program prints."""
        now = self._loop.time()
        if now >= self._printed_at + _PRINT_PAUSE_S:
            self._printing_since = now
        self._printed_at = now

    # Waiting --------------------------------------------------------------------------------------------------------

    def _block(self) -> _Block | None:
        return self._pause() or self._rest()

    def _rest(self) -> _Block | None:
        """Return what keeps questions out of a program that the control may still read."""
        if not self._may_wait_for_rest():
            return None
        why = "the file before was not sent to its end, and the control may take a question for the rest of it"
        hint = "press RESET at the control, then say so: reset_was_pressed()"
        return _Block(why, hint, self._loop.time(), 0.0)

    def _pause(self) -> _Block | None:
        now, settings = self._loop.time(), self._settings
        transfer = self._transfer()
        if transfer is not None and not transfer.done():
            if transfer is not self._seen_transfer:
                self._seen_transfer, self._transfer_since = transfer, now
            hint = "ask when it is over, or cancel it"
            since = self._transfer_since
            return _Block("a transfer is under way", hint, since, settings.in_doubt_after_s, transfer=transfer)
        if now < self._printed_at + _PRINT_PAUSE_S:
            hint = "ask when the program is through with it"
            until = self._printed_at + _PRINT_PAUSE_S
            return _Block("a program prints", hint, self._printing_since, settings.in_doubt_after_s, until)
        if now < self._silent_until:
            why = f"the last {self._in_vain} questions had no answer, and it is left alone for a while"
            hint = "is Setting 143 (machine data collection) ON? If the control has frozen, RESET brings it back"
            return _Block(why, hint, self._silent_since, settings.answer_timeout_s, self._silent_until)
        return None

    async def _change(self, until: float, block: _Block | None) -> None:
        """Wait until something may have changed, or *until*."""
        waker: asyncio.Future[None] = self._loop.create_future()
        self._wakers.add(waker)
        awaited: set[asyncio.Future[Any]] = {waker}
        if block is not None and block.transfer is not None:
            awaited.add(block.transfer)
        try:
            timeout = None if until == inf else max(until - self._loop.time(), 0.0)
            await asyncio.wait(awaited, timeout=timeout, return_when=asyncio.FIRST_COMPLETED)
        finally:
            self._wakers.discard(waker)
            waker.cancel()

    def _call_first(self) -> None:
        first = next(iter(self._waiting), None)
        if first is not None and not first.done():
            first.set_result(None)

    def _wake(self) -> None:
        for waker in self._wakers:
            if not waker.done():
                waker.set_result(None)

    def _refused(self, question: str, block: _Block) -> CompaxError:
        return AnswerTimeoutError(f"{question!r} was not sent: {block.why}", device=self._name, hint=block.hint)
