"""What happens on a device, as events that any number of consumers can follow without holding anybody up."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import Final
from weakref import WeakSet

__all__ = ["ConnectionLost", "ConnectionRestored", "DriveEvent", "EventHub", "EventStream", "UnexpectedText"]

_MAX_WAITING: Final = 1000


@dataclass(frozen=True, slots=True)
class DriveEvent:
    """Something that a drive or an axis, or its line, did unasked."""

    drive: str
    """The name of the drive or axis."""
    at: float
    """The event loop's time, in seconds, when it was read."""


@dataclass(frozen=True, slots=True)
class ConnectionLost(DriveEvent):
    """The line went away; it is tried again, unless the settings say otherwise (``reconnect``)."""

    reason: str


@dataclass(frozen=True, slots=True)
class ConnectionRestored(DriveEvent):
    """A line that was lost is back, and the same device is on it, as far as it says who it is."""

    lost_for_s: float
    attempts: int
    """How often the line was tried."""
    signs_of_restart: tuple[str, ...]
    """
    What shows that the device was switched off and on meanwhile; empty proves nothing.

    What it was told before, and what it counts its position from, may be gone then.
    """


@dataclass(frozen=True, slots=True)
class UnexpectedText(DriveEvent):
    """Something came that answers nothing: noise, a doubled answer, a text of another device."""

    text: str


class EventStream(AsyncIterator[DriveEvent]):
    """
    The events of one device from now on; iterating ends when the device is closed.

    A consumer that is slow loses the oldest events, never memory; *lost* counts them.
    """

    def __init__(self) -> None:
        self.lost = 0
        self._waiting: deque[DriveEvent] = deque()
        self._wake = asyncio.Event()
        self._ended = False

    def put(self, event: DriveEvent) -> None:
        """Add *event*, in place of the oldest one if the consumer is too slow."""
        if len(self._waiting) >= _MAX_WAITING:
            self._waiting.popleft()
            self.lost += 1
        self._waiting.append(event)
        self._wake.set()

    def end(self) -> None:
        """Let the consumer finish when it has read what waits."""
        self._ended = True
        self._wake.set()

    def __aiter__(self) -> EventStream:
        return self

    async def __anext__(self) -> DriveEvent:
        while not self._waiting:
            if self._ended:
                raise StopAsyncIteration
            self._wake.clear()
            await self._wake.wait()
        return self._waiting.popleft()


class EventHub:
    """Passes every event to every stream; a stream that nobody holds any more is forgotten."""

    def __init__(self) -> None:
        self._streams: WeakSet[EventStream] = WeakSet()
        self._ended = False

    def stream(self) -> EventStream:
        """Make a stream of the events from now on."""
        stream = EventStream()
        if self._ended:
            stream.end()
        self._streams.add(stream)
        return stream

    def publish(self, event: DriveEvent) -> None:
        """Give *event* to all streams."""
        for stream in self._streams:
            stream.put(event)

    def end(self) -> None:
        """End all streams, and those to come."""
        self._ended = True
        for stream in self._streams:
            stream.end()
