"""Notes of everything that users ask, and of what they are told, with how the axis stood at that moment."""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from collections.abc import Awaitable
from typing import Any, Generic, TypeVar

from compax_aio.errors import CompaxError
from compax_aio.motion.moves import MoveFuture, fetch_error

from .testimony import Call, Standing

__all__ = ["Notes"]

_Call = TypeVar("_Call", bound=Call)


class Notes(ABC, Generic[_Call]):
    """Takes notes of calls, wherever they are kept."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()

    @abstractmethod
    def far(self, axis: str) -> Standing:
        """Return the far end of an axis."""

    @abstractmethod
    def note(self, item: int, axis: str, what: str, detail: Any = None) -> _Call:
        """Note that something is asked now."""

    @abstractmethod
    def motion_text(self, move: Any) -> str:
        """Return the line that starts a move."""

    def now(self) -> float:
        """Return the time of the event loop."""
        return self._loop.time()

    def ended(self, call: _Call, outcome: Any) -> None:
        """Note what a caller was told just now."""
        call.ended(self.now(), outcome, self.far(call.axis))

    async def tell(self, call: _Call, work: Awaitable[Any]) -> Any:
        """Await *work* on behalf of *call*; returns None if it raises one of our errors."""
        try:
            result = await work
        except CompaxError as error:
            self.ended(call, error)
            return None
        except BaseException as error:
            self.ended(call, error)
            raise
        self.ended(call, result)
        return result

    def follow(self, call: _Call, move: MoveFuture) -> None:
        """Note what becomes of *move*."""
        call.move, call.text, call.on_cancel = move, self.motion_text(move), move.on_cancel

        def ended(_: object) -> None:
            self.ended(call, asyncio.CancelledError() if move.cancelled() else move.exception() or move.result())

        move.add_done_callback(fetch_error)
        move.add_done_callback(ended)
