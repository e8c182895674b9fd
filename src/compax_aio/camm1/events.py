"""What happens on a cutter, beside what happens on any line."""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import CompaxError
from ..motion.events import (
    ConnectionLost,
    ConnectionRestored,
    DriveEvent,
    EventStream,
    Mark,
    MoveOutcome,
    Stopped,
    UnexpectedText,
)
from .cut import CutAccount

__all__ = [
    "ConnectionLost",
    "ConnectionRestored",
    "CutBegun",
    "CutEnded",
    "CutterError",
    "CutterPaused",
    "CutterReset",
    "CutterResumed",
    "DriveEvent",
    "EventStream",
    "Stopped",
    "UnexpectedText",
]


@dataclass(frozen=True, slots=True)
class CutBegun(DriveEvent):
    """The handshake of a job is established, and its first byte goes out now."""

    job: str
    handshake: str

    def as_mark(self) -> Mark:
        """Say it in a few words."""
        return Mark("accepted", None, f"{self.job}, {self.handshake} handshake")


@dataclass(frozen=True, slots=True)
class CutEnded(DriveEvent):
    """A job of this end is over; only ``reached`` says that it was cut."""

    job: str
    outcome: MoveOutcome
    account: CutAccount
    error: CompaxError | None
    """What awaiting the job raises; None if it was cut or cancelled."""

    def as_mark(self) -> Mark:
        """Say it in a few words."""
        return Mark(self.outcome, None, self.job if self.error is None else self.error.what)


@dataclass(frozen=True, slots=True)
class CutterPaused(DriveEvent):
    """Somebody has pressed PAUSE at the machine; the job waits."""

    def as_mark(self) -> Mark:
        """Say it in a few words."""
        return Mark("paused", None, "at the machine")


@dataclass(frozen=True, slots=True)
class CutterResumed(DriveEvent):
    """The machine is not paused any more."""

    def as_mark(self) -> Mark:
        """Say it in a few words."""
        return Mark("resumed", None, "at the machine")


@dataclass(frozen=True, slots=True)
class CutterError(DriveEvent):
    """The cutter has told an error of its line, or of the cutting language; telling it has cleared it."""

    code: int
    meaning: str
    asked_with: str
    """``ESC.E`` or ``OE``."""

    def as_mark(self) -> Mark:
        """Say it in a few words."""
        return Mark("error", float(self.code), self.meaning)


@dataclass(frozen=True, slots=True)
class CutterReset(DriveEvent):
    """The cutter has forgotten its settings: it was switched off and on, or reset; its buffer is empty then."""

    reason: str

    def as_mark(self) -> Mark:
        """Say it in a few words."""
        return Mark("reset", None, self.reason)
