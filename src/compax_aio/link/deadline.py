"""One deadline that is put off with every line; its timer is not: it wakes early at worst, and sets itself anew."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

__all__ = ["Deadline"]


class Deadline:
    """
    Calls somebody when nothing has put it off for so long.

    Args:
        after_s: From :meth:`put_off` to the call.
        when_over: What is called.
    """

    def __init__(self, after_s: float, when_over: Callable[[], None]) -> None:
        self._after_s = after_s
        self._when_over = when_over
        self._loop = asyncio.get_running_loop()
        self.counted_from = 0.0
        """Loop time at which it was put off last."""
        self._at = 0.0
        self._timer: asyncio.TimerHandle | None = None

    def put_off(self) -> None:
        """Count from now."""
        self.counted_from = self._loop.time()
        self._at = self.counted_from + self._after_s
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
