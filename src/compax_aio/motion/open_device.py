"""A device on its line, as callers hold it: its block is left, it is closed, and its line is lost and comes back."""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from types import TracebackType
from typing import Generic, Protocol, Self, TypeVar

from ..errors import ConnectionLostError
from ..link.cancellation import despite_cancellation
from ..link.contract import Event
from ..link.device_link import LineTells
from ..link.link import Link, LinkStats
from ..link.reconnecting import Restored
from .events import ConnectionLost, ConnectionRestored, EventHub

__all__ = ["OpenDevice"]


class _Line(Protocol):
    @property
    def link(self) -> Link:
        """What runs it."""


_LineT = TypeVar("_LineT", bound=_Line)


class OpenDevice(ABC, Generic[_LineT]):
    """What every device has of its line."""

    name: str
    _line: _LineT
    _events: EventHub
    _loop: asyncio.AbstractEventLoop

    @property
    def stats(self) -> LinkStats:
        """Counters of the line."""
        return self._line.link.stats

    @property
    def is_open(self) -> bool:
        """Whether the line is there, and known to lead to this device; not while it is lost and tried again."""
        return self._line.link.is_open

    async def close(self) -> None:
        """End what was started here, and close the line; carried through even if the caller is cancelled meanwhile."""
        await despite_cancellation(self._close())

    async def _close(self) -> None:
        try:
            await self._end()
        finally:
            await self._line.link.close()
            self._events.end()

    @abstractmethod
    async def _end(self) -> None:
        """End what was started here, while there is a line."""

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        await self.close()

    # What the line tells --------------------------------------------------------------------------------------------

    @property
    def _tells(self) -> LineTells:
        return {
            "on_event": self._on_event,
            "on_lost": self._on_lost,
            "greet": self._greet,
            "on_down": self._on_down,
            "on_restored": self._on_restored,
        }

    @abstractmethod
    def _on_event(self, event: Event) -> None:
        """Take what comes unasked."""

    @abstractmethod
    async def _greet(self) -> None:
        """Look who is on a line that was opened."""

    def _on_lost(self, error: ConnectionLostError) -> None:
        self._on_down(error)

    def _on_down(self, error: ConnectionLostError) -> None:
        self._events.publish(ConnectionLost(self.name, self._loop.time(), str(error)))

    def _on_restored(self, restored: Restored) -> None:
        self._tell_restored(restored)

    def _tell_restored(self, restored: Restored, signs_of_restart: tuple[str, ...] = ()) -> None:
        now = self._loop.time()
        self._events.publish(ConnectionRestored(self.name, now, restored.after_s, restored.attempts, signs_of_restart))
