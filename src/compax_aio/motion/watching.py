"""Watching a device: one task asks for all who do, and each sees the newest reading, at a speed of its own."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator
from contextlib import suppress
from copy import copy
from functools import partial
from itertools import count
from types import TracebackType
from typing import Any, Generic, Self, TypeVar
from weakref import WeakValueDictionary

from ..errors import CompaxError, ConnectionLostError
from ..link.link import Link

__all__ = ["NewestReadings", "Watchers"]

_ReadingT = TypeVar("_ReadingT")


class NewestReadings(AsyncIterator[_ReadingT]):
    """
    What one who watches holds: the newest reading, until it is seen.

    Args:
        interval_s: Seconds from one reading to the next, if the line can do it.
        leave: Called when it is closed.
        dropped: Called when nobody holds it any more; from any thread.

    Attributes:
        skipped: Readings that this consumer was too slow to see.
        due_at: Loop time from which on it wants its next reading; what was read before does not count for that.
        news: Set when there is a reading to take, or no more to come.
        has_ended: Whether no more is to come.
        error: What it has ended with; None if it has not, or ended well.
    """

    has_ended = True  # until it is made

    def __init__(self, interval_s: float, leave: Callable[[], None], dropped: Callable[[], None]) -> None:
        self.interval_s = interval_s
        self.skipped = 0
        self.due_at = asyncio.get_running_loop().time()
        self.news = asyncio.Event()
        self.error: BaseException | None = None
        self.has_ended = False
        self._newest: _ReadingT | None = None
        self._leave = leave
        self._dropped = dropped

    def put(self, reading: _ReadingT) -> None:
        """Let *reading* be the newest."""
        self.skipped += self._newest is not None
        self._newest = reading
        self.news.set()

    def take(self) -> _ReadingT | None:
        """Return the newest reading, unless it was taken before."""
        reading, self._newest = self._newest, None
        return reading

    def end(self, error: BaseException | None = None) -> None:
        """Let the consumer finish, or raise *error*, when it has seen the newest reading."""
        if not self.has_ended:
            self.has_ended = True
            self.error = error
            self.news.set()

    def close(self) -> None:
        """Watch no longer: iterating ends, and nothing is asked on this one's behalf. Harmless when repeated."""
        self.end()
        self.take()
        self.error = None
        self._leave()

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> _ReadingT:
        while (reading := self.take()) is None:
            if self.error is not None:
                raise self.error
            if self.has_ended:
                raise StopAsyncIteration
            self.news.clear()
            try:
                await self.news.wait()
            except asyncio.CancelledError:
                del self  # whoever keeps the cancelled task, and its traceback, does not go on watching
                raise
        return reading

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def __del__(self) -> None:
        if not self.has_ended:
            self._dropped()


_WatchT = TypeVar("_WatchT", bound=NewestReadings[Any])


class Watchers(Generic[_WatchT]):
    """
    All who watch one device, in the order in which they came, and the task that asks for them: from first to last.

    Those whom nobody holds any more are not held here.

    Args:
        name: Of the device.
        link: Of its line.
        ask: Asks, and gives out readings, until nobody watches any more; may raise CompaxError when the line is over.
    """

    def __init__(self, name: str, link: Link, ask: Callable[[], Coroutine[Any, Any, None]]) -> None:
        self.is_asking = False
        """Whether a question is under way: it is carried through, although nobody may want its answer any more."""
        self._name = name
        self._link = link
        self._ask = ask
        self._loop = asyncio.get_running_loop()
        self._watches: WeakValueDictionary[int, _WatchT] = WeakValueDictionary()
        self._numbers = count()
        self._task: asyncio.Task[None] | None = None
        self._joined: asyncio.Future[None] | None = None
        self._is_over = False
        self._lost: ConnectionLostError | None = None

    def __iter__(self) -> Iterator[_WatchT]:
        return (watch for watch in list(self._watches.values()) if not watch.has_ended)

    def __len__(self) -> int:
        return len(self._watches)

    # Joining and leaving --------------------------------------------------------------------------------------------

    def join(self, make: Callable[[Callable[[], None], Callable[[], None]], _WatchT]) -> _WatchT:
        """Let somebody watch from now on with what *make* makes, of what it calls to leave, and when it is dropped."""
        number = next(self._numbers)
        watch = make(partial(self._leave, number), self._dropped)
        if self._is_over:
            watch.end(self._loss())
            return watch
        self._watches[number] = watch
        if self._joined is not None and not self._joined.done():
            self._joined.set_result(None)
        if self._task is None:
            self._task = self._loop.create_task(self._run(), name=f"{self._name}: watch")
        return watch

    def end(self, error: ConnectionLostError | None = None) -> None:
        """Let all who watch finish, and those to come; or raise *error* in them."""
        self._lost = error
        self._is_over = True
        for watch in self:
            watch.end(self._loss())
        self._look_after()

    def _loss(self) -> ConnectionLostError | None:
        """Make an error of its own for each consumer: they are raised at different places."""
        if self._lost is None:
            return None
        error = copy(self._lost)
        error.__cause__ = self._lost.__cause__
        return error

    def _leave(self, number: int) -> None:
        # Kept, those who have left would be looked through each time that one more leaves.
        self._watches.pop(number, None)
        self._look_after()

    def _dropped(self) -> None:
        # Whichever thread collects garbage; and the event loop may have ended long ago.
        with suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self._look_after)

    def _look_after(self) -> None:
        """End the task if nobody watches any more; a question that is under way is carried through first."""
        if self._task is not None and not self.is_asking and not self.is_anybody_there:
            task, self._task = self._task, None
            task.cancel()

    # Asking ---------------------------------------------------------------------------------------------------------

    @property
    def is_anybody_there(self) -> bool:
        """Whether anybody watches."""
        return any(True for _ in self)

    async def wait_until(self, due_at: float) -> None:
        """Wait until *due_at*, or until somebody joins."""
        self._joined = self._loop.create_future()
        with suppress(TimeoutError):
            async with asyncio.timeout_at(due_at):
                await self._joined

    async def _run(self) -> None:
        try:
            await self._ask()
        except BaseException as error:
            if isinstance(error, CompaxError) and self._link.is_over:
                return  # the device tells all who watch, or has done so
            # A defect, or somebody who cancels every task there is: nobody shall wait for ever.
            if self._task is asyncio.current_task():
                for watch in self:
                    watch.end(error if isinstance(error, Exception) else None)
            raise
        finally:
            if self._task is asyncio.current_task():
                self._task = None
