"""What happens on a drive: what any device's line does, and messages, comparators and faults of a COMPAX."""

from __future__ import annotations

from dataclasses import dataclass

from ..motion.events import (
    ConnectionLost,
    ConnectionRestored,
    DriveEvent,
    EventHub,
    EventStream,
    Mark,
    MoveAccepted,
    MoveEnded,
    Stopped,
    UnexpectedText,
)
from .facts.device_errors import DeviceError

__all__ = [
    "ComparatorPassed",
    "ConnectionLost",
    "ConnectionRestored",
    "DriveEvent",
    "EventHub",
    "EventStream",
    "Fault",
    "Mark",
    "MoveAccepted",
    "MoveEnded",
    "PositionMessage",
    "Stopped",
    "UnexpectedText",
]


@dataclass(frozen=True, slots=True)
class PositionMessage(DriveEvent):
    """The drive sent ``$``: position reached (UG p. 160)."""

    def as_mark(self) -> Mark:
        """Say it in a few words."""
        return Mark("$", None, "the drive says: position reached")


@dataclass(frozen=True, slots=True)
class ComparatorPassed(DriveEvent):
    """The drive passed a comparator; *number* counts in the order of programming, from 1 (UG p. 162)."""

    number: int

    def as_mark(self) -> Mark:
        """Say it in a few words."""
        return Mark("comparator", self.number)


@dataclass(frozen=True, slots=True)
class Fault(DriveEvent):
    """A status that was read shows a fault; *error* is None where the drive did not say which."""

    error: DeviceError | None

    def as_mark(self) -> Mark:
        """Say it in a few words."""
        if self.error is None:
            return Mark("fault", None, "the drive did not say which")
        return Mark("fault", self.error.code, f"E{self.error.code}: {self.error.meaning}")
