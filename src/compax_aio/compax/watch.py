"""What watchers hold: the newest readings of one drive or of several, for consumers of any speed."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from dataclasses import dataclass
from math import inf
from types import MappingProxyType, TracebackType
from typing import Any, Self

from ..errors import CompaxError, InvalidCommandError
from ..motion.watching import NewestReadings

__all__ = ["GroupReading", "GroupWatch", "Reading", "Watch"]


@dataclass(frozen=True, slots=True)
class Reading:
    """
    What a drive has said of all that is watched; ``reading["position"]`` is the value of one quantity.

    No value is older than *at*, and none is carried over from the reading before: what the drive did not say this
    time is not in *values*, and *errors* says why.
    """

    drive: str
    """The drive's name."""
    at: float
    """The event loop's time, in seconds, when the first of its answers was read, or had not come in time."""
    values: Mapping[str, Any]
    """By quantity: what the method of the same name returns; a ``StatusValue`` for S1-S250, a number for P and V."""
    errors: Mapping[str, CompaxError]
    """By quantity: AnswerTimeoutError, CommandRejectedError or UnexpectedAnswerError. What the drive has refused is
    asked again every few seconds; until then its error stays."""

    def __getitem__(self, quantity: str) -> Any:
        """
        Return the value of *quantity*.

        Raises:
            AnswerTimeoutError, CommandRejectedError, UnexpectedAnswerError: It was asked, and not said.
            InvalidCommandError: It is not watched here.
        """
        if quantity in self.values:
            return self.values[quantity]
        if quantity in self.errors:
            raise self.errors[quantity].with_traceback(None)
        watched = ", ".join([*self.values, *self.errors])
        raise InvalidCommandError(f"{quantity!r} is not watched here; watched: {watched}", device=self.drive)

    def __contains__(self, quantity: object) -> bool:
        """Whether *quantity* has a value."""
        return quantity in self.values


GroupReading = Mapping[str, Reading]
"""By axis: its newest reading. An axis that has said nothing yet is not there."""


class Watch(NewestReadings[Reading]):
    """
    The readings of one drive from now on, the newest only; made by :meth:`Drive.watch`.

    Iterating ends when the drive is closed, and raises ConnectionLostError when its line is lost. The drive is asked
    for as long as somebody holds this object: ``async for reading in drive.watch(...)`` lets go of it with the loop.
    If you keep it, :meth:`close` it, or use it in a ``with`` block.

    Attributes:
        quantities: What is watched.
        interval_s: Seconds from one reading to the next, if the line can do it.
        skipped: Readings that this consumer was too slow to see.
    """

    def __init__(
        self, quantities: tuple[str, ...], interval_s: float, leave: Callable[[], None], dropped: Callable[[], None]
    ) -> None:
        super().__init__(interval_s, leave, dropped)
        self.quantities = quantities
        self.unseen_since = inf
        """When the first reading came that was not taken."""

    def put(self, reading: Reading) -> None:
        """Let *reading* be the newest."""
        super().put(reading)
        self.unseen_since = min(self.unseen_since, reading.at)

    def take(self) -> Reading | None:
        """Return the newest reading, unless it was taken before."""
        self.unseen_since = inf
        return super().take()


class GroupWatch(AsyncIterator[GroupReading]):
    """
    The newest readings of several drives; made by :meth:`DriveGroup.watch`.

    It yields when every axis has something new, and otherwise an interval after the first that had: a drive that does
    not answer delays no other for longer, and its reading is the old one, or missing if there was none. Iterating
    ends when one of the drives is closed. When one's line is lost, it raises ConnectionLostError with the axis named.
    """

    def __init__(self, watches: Mapping[str, Watch]) -> None:
        self._watches = dict(watches)
        self._newest: dict[str, Reading] = {}
        self._error: BaseException | None = None
        self._news = asyncio.Event()
        for watch in self._watches.values():
            watch.news = self._news

    @property
    def skipped(self) -> int:
        """Readings of single axes that were replaced by newer ones before they were seen."""
        return sum(watch.skipped for watch in self._watches.values())

    def close(self) -> None:
        """Watch no longer; see :meth:`Watch.close`."""
        for watch in self._watches.values():
            watch.close()

    def __aiter__(self) -> GroupWatch:
        return self

    async def __anext__(self) -> GroupReading:
        loop = asyncio.get_running_loop()
        while True:
            self._end_if_one_has_ended()
            waiting_since = [watch.unseen_since for watch in self._watches.values()]
            give_at = min(watch.unseen_since + watch.interval_s for watch in self._watches.values())
            if max(waiting_since) < inf or give_at <= loop.time():
                return self._take()
            self._news.clear()
            try:
                async with asyncio.timeout_at(give_at if give_at < inf else None):
                    await self._news.wait()
            except TimeoutError:
                pass
            except asyncio.CancelledError:
                del self  # as in NewestReadings
                raise

    def _take(self) -> GroupReading:
        for axis, watch in self._watches.items():
            if (reading := watch.take()) is not None:
                self._newest[axis] = reading
        return MappingProxyType({axis: self._newest[axis] for axis in self._watches if axis in self._newest})

    def _end_if_one_has_ended(self) -> None:
        ended = next((axis for axis, watch in self._watches.items() if watch.has_ended), None)
        if ended is None:
            return
        if (error := self._watches[ended].error) is not None:
            if getattr(error, "device", None) != ended:
                error.add_note(f"it happened to the axis {ended} of the group")
            self._error = error
        self.close()
        if self._error is not None:
            raise self._error
        raise StopAsyncIteration

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()
