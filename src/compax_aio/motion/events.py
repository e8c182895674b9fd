"""What happens on a device, as events that any number of consumers can follow without holding anybody up."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import Final, Literal
from weakref import WeakSet

from ..errors import CompaxError

__all__ = [
    "ConnectionLost",
    "ConnectionRestored",
    "DriveEvent",
    "EventHub",
    "EventStream",
    "Mark",
    "MoveAccepted",
    "MoveEnded",
    "MoveOutcome",
    "Stopped",
    "UnexpectedText",
]

MoveOutcome = Literal["reached", "stopped", "fault", "out of time", "in doubt", "refused", "cancelled", "failed"]

_MAX_WAITING: Final = 1000


@dataclass(frozen=True, slots=True)
class Mark:
    """An event in a few words, for records, plots and displays."""

    word: str
    """What happened: ``accepted``, ``fault``."""
    value: float | None = None
    """Its number, if it has one: a target, the number of a comparator, the code of an error."""
    text: str = ""
    """What a person wants to know beside that."""


@dataclass(frozen=True, slots=True)
class DriveEvent:
    """Something that a drive or an axis, or its line, did."""

    drive: str
    """The name of the drive or axis."""
    at: float
    """The event loop's time, in seconds, when it was read."""

    def as_mark(self) -> Mark:
        """Say it in a few words."""
        return Mark(type(self).__name__)


@dataclass(frozen=True, slots=True)
class MoveAccepted(DriveEvent):
    """
    A move of this end was taken by the device: *at* is when that was known.

    It was acknowledged; or its acknowledgement was lost, and the device's status shows that it was taken.
    """

    move: str
    """What was asked for, in a few words."""
    target: float | None
    """In the device's unit; None as long as only the device knows it."""

    def as_mark(self) -> Mark:
        """Say it in a few words."""
        return Mark("accepted", self.target, self.move)


@dataclass(frozen=True, slots=True)
class MoveEnded(DriveEvent):
    """
    A move of this end is over for whoever awaits it; *outcome* says how.

    Only ``reached`` says where the device is. After ``in doubt`` and ``failed`` it may be moving. After ``cancelled``
    it is being stopped, if it had been told to move at all, and :class:`Stopped` follows; or it goes on
    (``on_cancel="detach"``).
    """

    move: str
    """What was asked for, in a few words."""
    target: float | None
    outcome: MoveOutcome
    was_sent: bool
    """Whether the line that starts the motion was written; if not, it never will be."""
    confirmed_by: Literal["message", "status"] | None
    """What has shown that the target was reached; None if it was not."""
    error: CompaxError | None
    """What awaiting the move raises; None if it was reached or cancelled."""

    def as_mark(self) -> Mark:
        """Say it in a few words."""
        if self.outcome == "reached":
            return Mark("reached", self.target, f"{self.move}, by {self.confirmed_by}")
        why = self.move if self.error is None else self.error.what
        word = "ended by fault" if self.outcome == "fault" else self.outcome  # the fault has a mark of its own
        return Mark(word, self.target, why if self.was_sent else f"{why} (what starts the motion had not been sent)")


@dataclass(frozen=True, slots=True)
class Stopped(DriveEvent):
    """A stop from this end was acknowledged, and the device stands still; told also where no move was under way."""

    def as_mark(self) -> Mark:
        """Say it in a few words."""
        return Mark("standstill", None, "stopped from here")


@dataclass(frozen=True, slots=True)
class ConnectionLost(DriveEvent):
    """The line went away; it is tried again, unless the settings say otherwise (``reconnect``)."""

    reason: str

    def as_mark(self) -> Mark:
        """Say it in a few words."""
        return Mark("connection lost", None, self.reason)


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

    def as_mark(self) -> Mark:
        """Say it in a few words."""
        return Mark("connection restored", self.lost_for_s, " and ".join(self.signs_of_restart))


@dataclass(frozen=True, slots=True)
class UnexpectedText(DriveEvent):
    """Something came that answers nothing: noise, a doubled answer, a text of another device."""

    text: str

    def as_mark(self) -> Mark:
        """Say it in a few words."""
        return Mark("unexpected text", None, self.text)


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

    def take_waiting(self) -> list[DriveEvent]:
        """Take what has been told and not yet been read, without waiting for more."""
        events = list(self._waiting)
        self._waiting.clear()
        return events

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
        self._streams: WeakSet[EventStream] | None = None
        """None as long as nobody has followed."""
        self._ended = False

    def stream(self) -> EventStream:
        """Make a stream of the events from now on."""
        stream = EventStream()
        if self._ended:
            stream.end()
        if self._streams is None:
            self._streams = WeakSet()
        self._streams.add(stream)
        return stream

    def publish(self, event: DriveEvent) -> None:
        """Give *event* to all streams."""
        for stream in self._streams or ():
            stream.put(event)

    def end(self) -> None:
        """End all streams, and those to come."""
        self._ended = True
        for stream in self._streams or ():
            stream.end()
