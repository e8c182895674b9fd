"""A virtual clock: an asyncio event loop whose time jumps to the next timer as soon as nothing else can happen."""

from __future__ import annotations

import asyncio
import os
import selectors
from collections.abc import Callable, Mapping
from contextlib import suppress
from contextvars import Context
from dataclasses import dataclass
from heapq import heappush
from math import inf
from typing import TYPE_CHECKING, Any, TypeVarTuple, Unpack

if TYPE_CHECKING:
    from _typeshed import FileDescriptorLike

__all__ = ["VirtualClockLoop"]

_Ts = TypeVarTuple("_Ts")

# Bytes that this process has written to its own sockets and ptys need a moment to come out at their other end. While
# such lines are open, time jumps only after that long a real silence; with in-memory lines alone it jumps at once.
_REAL_SILENCE_S = 0.002
# What is written to a terminal is handed on by another task of the kernel, which has to get its turn.
_REAL_SILENCE_OF_TERMINALS_S = 0.01
# Asking the operating system costs more than most callbacks; where there is nothing to be seen, it is asked so rarely.
_LOOKS_LEFT_OUT = 50


class VirtualClockLoop(asyncio.SelectorEventLoop):
    """
    An event loop on which an hour of timers takes no longer than the work they cause.

    Its clock starts at 0 and stands still while callbacks run, sockets have data or a thread of
    :meth:`run_in_executor` is at work; when only timers are left, it jumps to the first of them.
    """

    def __init__(self) -> None:
        self._now = 0.0
        self._jobs: set[_Job] = set()
        self._timers = 0
        self._scheduled: list[asyncio.TimerHandle]
        super().__init__(_JumpingSelector(self))

    def time(self) -> float:
        """Return the virtual time in seconds."""
        return self._now

    def call_at(
        self,
        when: float,
        callback: Callable[[Unpack[_Ts]], object],
        *args: *_Ts,
        context: Context | None = None,
    ) -> asyncio.TimerHandle:
        """Call *callback* at time *when*; of timers for one time the oldest goes first, whatever others there are."""
        if self.is_closed():
            raise RuntimeError("Event loop is closed")
        self._timers += 1
        timer: Any = _Timer(when, callback, args, self, context)
        timer.number = self._timers
        heappush(self._scheduled, timer)
        timer._scheduled = True  # noqa: SLF001  # so asyncio counts those that are cancelled
        return timer  # type: ignore[no-any-return]

    def jump_to_next_timer(self, at_most_s: float) -> None:
        """Move the clock on to the very time of the next timer: sums of pauses are not exact."""
        next_at = self._scheduled[0].when() if self._scheduled else inf
        is_within = next_at - self._now <= at_most_s
        self._now = max(self._now, next_at) if is_within else self._now + at_most_s

    def jump(self, seconds: float) -> None:
        """Move the clock on by *seconds*, as a loop that was blocked for so long would."""
        self._now += seconds

    @property
    def waits_for_threads(self) -> bool:
        """Whether a thread is at work, so that time must stand still."""
        return bool(self._jobs)

    def run_in_executor(self, executor: Any, func: Callable[[Unpack[_Ts]], Any], *args: *_Ts) -> asyncio.Future[Any]:
        """Run *func* in a thread; the clock stands still until it has returned."""
        job = _Job()

        def work() -> Any:
            job.has_begun = True
            try:
                return func(*args)
            finally:
                with suppress(RuntimeError):  # the loop is closed
                    self.call_soon_threadsafe(self._thread_ended, job)

        def result_taken(future: asyncio.Future[Any]) -> None:
            job.result_is_awaited = False
            if not job.is_at_work or (future.cancelled() and not job.has_begun):
                self._jobs.discard(job)

        self._jobs.add(job)
        future = super().run_in_executor(executor, work)
        future.add_done_callback(result_taken)
        return future

    async def shutdown_default_executor(self, timeout: float | None = None) -> None:  # noqa: ARG002, ASYNC109
        """Wait until all threads have ended; the clock stands still meanwhile, so no *timeout* can come first."""
        job = _Job()
        self._jobs.add(job)
        try:
            await super().shutdown_default_executor()
        finally:
            self._jobs.discard(job)

    def _thread_ended(self, job: _Job) -> None:
        job.is_at_work = False
        if not job.result_is_awaited:
            self._jobs.discard(job)


class _Timer(asyncio.TimerHandle):
    """A timer that knows which of two for the same time is the older one; a heap alone does not."""

    __slots__ = ("number",)

    def __lt__(self: Any, other: Any) -> bool:
        mine, theirs = self._when, other._when  # asked so often that a method call counts
        return bool(mine < theirs or (mine == theirs and self.number < other.number))

    number: int


@dataclass(slots=True, eq=False)
class _Job:
    """A call in a thread: the clock stands still until it has ended, cancelled or not, and its result has arrived."""

    has_begun: bool = False
    is_at_work: bool = True
    result_is_awaited: bool = True


class _JumpingSelector(selectors.BaseSelector):
    """The selector of a VirtualClockLoop: instead of waiting for a timer, it moves the clock."""

    def __init__(self, loop: VirtualClockLoop) -> None:
        self._loop = loop
        self._selector = selectors.DefaultSelector()
        self._terminals: set[int] = set()
        self._looks_left = 0
        self._descriptors = 0

    def register(self, fileobj: FileDescriptorLike, events: int, data: Any = None) -> selectors.SelectorKey:
        key = self._selector.register(fileobj, events, data)
        self._descriptors += 1
        if os.isatty(key.fd):
            self._terminals.add(key.fd)
        return key

    def unregister(self, fileobj: FileDescriptorLike) -> selectors.SelectorKey:
        key = self._selector.unregister(fileobj)
        self._descriptors -= 1
        self._terminals.discard(key.fd)
        return key

    def modify(self, fileobj: FileDescriptorLike, events: int, data: Any = None) -> selectors.SelectorKey:
        return self._selector.modify(fileobj, events, data)

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        ready = [] if self._has_nothing_to_see() else self._selector.select(0)
        if ready or timeout == 0:
            return ready
        if timeout is None or self._loop.waits_for_threads:
            return self._selector.select(None)
        # One descriptor is the loop's own, by which other threads wake it.
        if self._descriptors > 1:
            ready = self._selector.select(_REAL_SILENCE_OF_TERMINALS_S if self._terminals else _REAL_SILENCE_S)
            if ready:
                return ready
        self._loop.jump_to_next_timer(max(timeout, 0.0))
        return []

    def _has_nothing_to_see(self) -> bool:
        """Whether only the loop's own descriptor is there, and no thread that would write to it; now and then not."""
        self._looks_left -= 1
        if self._descriptors > 1 or self._looks_left <= 0 or self._loop.waits_for_threads:
            self._looks_left = _LOOKS_LEFT_OUT
            return False
        return True

    def close(self) -> None:
        self._selector.close()

    def get_map(self) -> Mapping[FileDescriptorLike, selectors.SelectorKey]:
        return self._selector.get_map()
