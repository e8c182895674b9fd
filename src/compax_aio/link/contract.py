"""What a device's line protocol is to the link: a few doors, no clock, and events that say whose turn it is."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

__all__ = [
    "DeviceProtocol",
    "Event",
    "GoesOn",
    "Hold",
    "HoldOver",
    "InStep",
    "Lane",
    "LateEnding",
    "MarkerSpent",
    "Stranger",
    "TurnLost",
    "TurnOver",
]


class Lane(IntEnum):
    """
    What goes first when the line is free, and first come, first served in each.

    Those who share a line have their turns one after the other, whatever they want; only a stop and the look at who is
    there go before the turns of others.
    """

    STOP = 0
    GREETING = 1
    """The look at who is there, on a line that was opened: all that is less urgent waits for it."""
    CONTROL = 2
    MOTION = 3
    READ = 4

    __hash__ = int.__hash__  # each line that waits is looked up by it; enum's own hashes the name in Python


@dataclass(frozen=True, slots=True)
class Event:
    """Something that a protocol has read from the line."""


@dataclass(frozen=True, slots=True)
class TurnOver(Event):
    """The outstanding exchange is over; how, says the subclass. The device takes the next line."""


@dataclass(frozen=True, slots=True)
class TurnLost(TurnOver):
    """The outstanding exchange is over without an answer, and none will come: it was cut short or never understood."""


@dataclass(frozen=True, slots=True)
class GoesOn(Event):
    """What is outstanding has come a step further: from now on the device has its time anew."""


@dataclass(frozen=True, slots=True)
class LateEnding(Event):
    """The outcome of an exchange whose time had run out: late, and told apart from everything sent since."""

    sent: str
    outcome: TurnOver


@dataclass(frozen=True, slots=True)
class MarkerSpent(Event):
    """What was sent to get in step has been answered without settling the doubt; send another marker."""


@dataclass(frozen=True, slots=True)
class HoldOver(Event):
    """What the line was held for can do no harm any more, by what was answered; it is still in doubt."""


@dataclass(frozen=True, slots=True)
class InStep(Event):
    """The doubt is over: every earlier line has been answered, refused or lost."""


@dataclass(frozen=True, slots=True)
class Hold:
    """Why nothing may be sent to get in step, not even a marker, and what a person can do about it."""

    why: str
    remedy: str


@dataclass(frozen=True, slots=True)
class Stranger:
    """Another device than the expected: what it looks like, and what a person can do about it."""

    name: str
    remedy: str


class DeviceProtocol(Protocol):
    """
    One device's line, sans-IO: commands in, bytes out, bytes in, events out.

    The link calls the methods in turns: :meth:`send` when the line is in step and free; after an exchange was given up
    or :meth:`line_opened` the line is in doubt, and only :meth:`send_marker` and :meth:`send_ahead` are allowed
    until an :class:`InStep` event. While it is :attr:`held`, not even :meth:`send_marker` is. Only :meth:`preempt` is
    allowed at any time. What an exchange is made of is the protocol's own matter: bytes may go out in reaction to
    bytes, and after a pause.
    """

    @property
    def in_doubt(self) -> bool:
        """Whether it is unknown what the device will answer next."""

    @property
    def is_busy(self) -> bool:
        """Whether something is outstanding that must be answered, or given up, before more is sent."""

    @property
    def held(self) -> Hold | None:
        """Why nothing but what goes ahead may be sent, until that is answered, or :meth:`resume`; None if it may."""

    @property
    def patience_s(self) -> float | None:
        """How long what is outstanding may take from now, answer or pause; None: as long as any answer on that line."""

    def line_opened(self) -> None:
        """Take note that the line is new: what stands in the device's buffer is unknown."""

    def line_lost(self) -> None:
        """Take note that the line is gone: nothing outstanding will be answered on it."""

    def send(self, text: str) -> None:
        """Begin the exchange of *text*; allowed when in step and not busy."""

    def send_marker(self) -> None:
        """Begin the next attempt to get in step; allowed when in doubt, not held and not busy."""

    def send_ahead(self, text: str) -> None:
        """Send *text*, which does no harm when it comes twice, although in doubt; allowed when not busy."""

    def preempt(self, text: str) -> None:
        """Send *text*, which the device heeds at any time, though something is outstanding: that turn is over by it."""

    def time_ran_out(self) -> None:
        """
        Take note that :attr:`patience_s` is over.

        The outstanding exchange is given up: the line is in doubt, and its answer, if it comes, is late. Or it was a
        pause, and now that it is over something else happens.
        """

    def resume(self) -> None:
        """Take a person's word that nothing that is sent can do harm now: the line is not held, but still in doubt."""

    def stranger(self, *, time_is_over: bool) -> Stranger | None:
        """
        Say which other device is at the far end, by what came before anything that the expected one says.

        Args:
            time_is_over: The last marker's time has run out; until then only what is certain counts.
        """

    def bytes_to_send(self) -> bytes:
        """Take what is to be written now."""

    def receive(self, data: bytes) -> None:
        """Read *data*, a piece of any size."""

    def events(self) -> list[Event]:
        """Take what has been noticed since the last call, in order."""
