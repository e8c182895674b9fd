"""Work that takes long, as the caller holds it: a future of its result, that can be watched and cancelled."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import suppress
from typing import Any, ClassVar, Generic, Protocol, TypeVar

from ..checked_numbers import check_number
from ..errors import CompaxError, InvalidCommandError

__all__ = ["UnderWay", "WorkOwner"]

_ResultT = TypeVar("_ResultT")
_ProgressT = TypeVar("_ProgressT")
_AccountT = TypeVar("_AccountT")
_ProgressT_co = TypeVar("_ProgressT_co", covariant=True)
_AccountT_co = TypeVar("_AccountT_co", covariant=True)


class WorkOwner(Protocol[_ProgressT_co, _AccountT_co]):
    """Who carries the work out."""

    def snapshot(self) -> _ProgressT_co:
        """Say how far it is."""

    def account(self) -> _AccountT_co:
        """Say what is known of it."""

    def abandon(self) -> None:
        """Deal with its having been cancelled."""


class UnderWay(asyncio.Future[_ResultT], Generic[_ResultT, _ProgressT, _AccountT]):
    """
    Work under way; awaiting it gives its result, or raises why there is none. Cancelling it gives it up.

    Attributes:
        description: What is done, in a few words.
        failure: The error that it has ended with; None if it has not.
    """

    _look_s: ClassVar[float | None] = None
    """So often it is looked how far it is; None: whenever that is noted, for then it always is."""

    def __init__(self, owner: WorkOwner[_ProgressT, _AccountT], description: str) -> None:
        super().__init__()
        self.description = description
        self.failure: CompaxError | None = None
        self._owner = owner
        self._changed = asyncio.Event()
        self.add_done_callback(lambda _: self._changed.set())

    @property
    def account(self) -> _AccountT:
        """What is known of it now."""
        return self._owner.account()

    def cancel(self, msg: Any = None) -> bool:
        """Give it up; whoever carries it out deals with that before this returns."""
        if not super().cancel(msg):
            return False
        self._owner.abandon()
        return True

    async def progress(self, *, interval_s: float = 0.1) -> AsyncIterator[_ProgressT]:
        """
        Yield how far it is, whenever that changes, and once at its end.

        Args:
            interval_s: Shortest time between two of them.

        Yields:
            The newest state. Errors end the iteration: awaiting it raises them.

        Raises:
            InvalidCommandError: The interval is none.
        """
        if not check_number("interval_s", interval_s) >= 0:
            raise InvalidCommandError(f"interval_s is 0 or more, not {interval_s!r}")
        told: _ProgressT | None = None
        is_last = False
        while not is_last:
            is_last = self.done()
            self._changed.clear()
            now = self._owner.snapshot()
            if is_last or told is None or self._is_news(now, told):
                told = now
                yield now
            if not is_last and not self.done():
                await asyncio.sleep(interval_s)
                with suppress(TimeoutError):
                    async with asyncio.timeout(self._look_s):
                        await self._changed.wait()

    def _is_news(self, now: _ProgressT, told: _ProgressT) -> bool:
        """Whether *now* is worth telling after *told*: here each snapshot is."""
        return now is not told

    # What the one who carries it out tells it -----------------------------------------------------------------------

    def note_change(self) -> None:
        """Note that it is further, or in another state."""
        self._changed.set()

    def finish(self, result: _ResultT) -> None:
        """Note that it has ended well."""
        if not self.done():
            self.set_result(result)

    def fail(self, error: BaseException) -> None:
        """Raise *error* in whoever awaits it."""
        if isinstance(error, CompaxError):
            self.failure = error
        if not self.done():
            self.set_exception(error)
