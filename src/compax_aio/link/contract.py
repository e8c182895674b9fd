"""What a device's line protocol is to the link: four doors, no clock, and events that say whose turn it is."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

__all__ = ["DeviceProtocol", "Event", "InStep", "Lane", "LateEnding", "MarkerSpent", "TurnOver"]


class Lane(IntEnum):
    """What goes first when the line is free; inside a lane, first come first served."""

    STOP = 0
    CONTROL = 1
    MOTION = 2
    READ = 3


@dataclass(frozen=True, slots=True)
class Event:
    """Something that a protocol has read from the line."""


@dataclass(frozen=True, slots=True)
class TurnOver(Event):
    """The outstanding exchange is over; how, says the subclass. The device takes the next line."""


@dataclass(frozen=True, slots=True)
class LateEnding(Event):
    """The outcome of an exchange whose time had run out: late, and told apart from everything sent since."""

    sent: str
    outcome: TurnOver


@dataclass(frozen=True, slots=True)
class MarkerSpent(Event):
    """What was sent to get in step has been answered without settling the doubt; send another marker."""


@dataclass(frozen=True, slots=True)
class InStep(Event):
    """The doubt is over: every earlier line has been answered, refused or lost."""


class DeviceProtocol(Protocol):
    """
    One device's line, sans-IO: commands in, bytes out, bytes in, events out.

    The link calls the methods in turns: :meth:`send` when the line is in step and free; after :meth:`time_ran_out`
    or :meth:`line_opened` the line is in doubt, and only :meth:`send_marker` and :meth:`send_ahead` are allowed
    until an :class:`InStep` event.
    """

    @property
    def in_doubt(self) -> bool:
        """Whether it is unknown what the device will answer next."""

    @property
    def is_busy(self) -> bool:
        """Whether something is outstanding that must be answered, or given up, before more is sent."""

    def line_opened(self) -> None:
        """Take note that the line is new: what stands in the device's buffer is unknown."""

    def send(self, text: str) -> None:
        """Begin the exchange of *text*; allowed when in step and not busy."""

    def send_marker(self) -> None:
        """Begin the next attempt to get in step; allowed when in doubt and not busy."""

    def send_ahead(self, text: str) -> None:
        """Send *text*, which does no harm when it comes twice, although in doubt; allowed when not busy."""

    def time_ran_out(self) -> None:
        """Give the outstanding exchange up: the line is in doubt, and its answer, if it comes, is late."""

    def bytes_to_send(self) -> bytes:
        """Take what is to be written now."""

    def receive(self, data: bytes) -> None:
        """Read *data*, a piece of any size."""

    def events(self) -> list[Event]:
        """Take what has been noticed since the last call, in order."""
