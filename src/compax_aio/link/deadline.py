"""One deadline that is put off with every line; its timer is not: it wakes early at worst, and sets itself anew."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

__all__ = ["Deadline"]


class Deadline:
    """
    Calls somebody when nothing has put it off for so long.

    Args:
        when_over: What is called.
    """

    __slots__ = ("_at", "_loop", "_timer", "_when_over")

    def __init__(self, when_over: Callable[[], None]) -> None:
        self._when_over = when_over
        self._loop = asyncio.get_running_loop()
        self._at = 0.0
        self._timer: asyncio.TimerHandle | None = None

    @property
    def is_running(self) -> bool:
        """Whether somebody will be called."""
        return self._timer is not None

    def put_off(self, by_s: float) -> None:
        """Count *by_s* from now."""
        self.put_off_to(self._loop.time() + by_s)

    def put_off_to(self, at: float) -> None:
        """Call nobody before *at*, a time of the loop."""
        self._at = at
        if self._timer is not None and self._timer.when() > self._at:
            self.cancel()
        if self._timer is None:
            self._timer = self._loop.call_at(self._at, self._wake)

    def cancel(self) -> None:
        """Call nobody."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _wake(self) -> None:
        self._timer = None
        if self._loop.time() < self._at:
            self._timer = self._loop.call_at(self._at, self._wake)
        else:
            self._when_over()
