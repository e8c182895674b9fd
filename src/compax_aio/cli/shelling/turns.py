"""The lines typed, carried out one after the other; a stop waits for none of them."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable

from ...errors import CompaxError
from .language import Order
from .replies import Reply

__all__ = ["Turns"]


class Turns:
    """
    Carries out lines in the order in which they were typed, while others can be typed.

    What waits behind a line that fails is dropped: whoever typed it could not know. So is what can move the axis, if
    the line to the drive was lost after it was typed: a person who plugs in a cable expects no motion.

    Args:
        on_reply: Called with what a line was answered.
        on_error: Called with why one was not.
        on_dropped: Called with a line that is not sent any more, and why.
    """

    def __init__(
        self,
        on_reply: Callable[[Order, Reply], None],
        on_error: Callable[[Order, CompaxError], None],
        on_dropped: Callable[[Order, str], None],
    ) -> None:
        self._on_reply = on_reply
        self._on_error = on_error
        self._on_dropped = on_dropped
        self._waiting: deque[Order] = deque()
        self._news = asyncio.Event()
        self._current: tuple[Order, asyncio.Task[Reply]] | None = None

    @property
    def current(self) -> Order | None:
        """The line whose answer has not come."""
        return None if self._current is None else self._current[0]

    @property
    def behind(self) -> int:
        """How many lines wait for their turn."""
        return len(self._waiting)

    def add(self, order: Order) -> None:
        """Let *order* be carried out in its turn."""
        self._waiting.append(order)
        self._news.set()

    def drop(self, why: str, fits: Callable[[Order], bool] = lambda _: True) -> None:
        """Never carry out what waits and *fits*."""
        dropped = [order for order in self._waiting if fits(order)]
        self._waiting = deque(order for order in self._waiting if not fits(order))
        for order in dropped:
            self._on_dropped(order, why)

    def give_up(self) -> Order | None:
        """Wait no longer for the answer of the current line; returns that line."""
        if self._current is None:
            return None
        order, task = self._current
        task.cancel()
        return order

    async def run(self) -> None:
        """Carry out what comes; until cancelled."""
        while True:
            while not self._waiting:
                self._news.clear()
                await self._news.wait()
            await self._carry_out(self._waiting.popleft())

    async def _carry_out(self, order: Order) -> None:
        task = asyncio.ensure_future(_awaited(order.carry_out()))
        self._current = order, task
        try:
            await asyncio.wait([task])
        except asyncio.CancelledError:
            task.cancel()
            await asyncio.wait([task])
            raise
        finally:
            self._current = None
        if task.cancelled():
            self.drop("the line before it was given up")
            return
        error = task.exception()
        if error is None:
            self._on_reply(order, task.result())
        elif isinstance(error, CompaxError):
            self._on_error(order, error)
            self.drop("the line before it has failed")
        else:
            raise error


async def _awaited(reply: Awaitable[Reply]) -> Reply:
    return await reply
