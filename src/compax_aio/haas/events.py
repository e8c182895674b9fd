"""What happens at a control, beside what happens on any line."""

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
    UnexpectedText,
)
from .transfer import Kind, TransferAccount, Way

__all__ = [
    "ConnectionLost",
    "ConnectionRestored",
    "DripFeedHeld",
    "DriveEvent",
    "EventStream",
    "Overheard",
    "Printed",
    "ReaderOff",
    "ReaderOn",
    "TransferBegun",
    "TransferEnded",
    "UnexpectedText",
    "VariableWritten",
]


@dataclass(frozen=True, slots=True)
class Printed(DriveEvent):
    """A line of text that a running program prints (DPRNT)."""

    text: str
    is_damaged: bool = False
    """Whether a byte of it came damaged."""

    def as_mark(self) -> Mark:
        """Say it in a few words."""
        return Mark("printed", None, self.text)


@dataclass(frozen=True, slots=True)
class Overheard(DriveEvent):
    """An answer to nothing that was asked here: somebody else asks on this line, or it came very late."""

    text: str

    def as_mark(self) -> Mark:
        """Say it in a few words."""
        return Mark("overheard", None, self.text)


@dataclass(frozen=True, slots=True)
class ReaderOn(DriveEvent):
    """The control is ready to read a file (DC1, with DC codes), and there is none to send: RECV was pressed."""

    def as_mark(self) -> Mark:
        """Say it in a few words."""
        return Mark("reader on", None, "somebody has pressed RECV")


@dataclass(frozen=True, slots=True)
class ReaderOff(DriveEvent):
    """The control reads no more (DC3, with DC codes), with no file being sent."""

    def as_mark(self) -> Mark:
        """Say it in a few words."""
        return Mark("reader off")


@dataclass(frozen=True, slots=True)
class TransferBegun(DriveEvent):
    """The control sends, or is ready to read: the operator has pressed SEND or RECV."""

    kind: Kind
    way: Way

    def as_mark(self) -> Mark:
        """Say it in a few words."""
        return Mark("accepted", None, f"{self.way} {self.kind}")


@dataclass(frozen=True, slots=True)
class TransferEnded(DriveEvent):
    """A transfer is over; ``reached`` says that it came whole, or was sent whole: not that it is stored."""

    kind: Kind
    way: Way
    outcome: MoveOutcome
    account: TransferAccount
    error: CompaxError | None
    """What awaiting the transfer raises; None if it ended well or was cancelled."""

    def as_mark(self) -> Mark:
        """Say it in a few words."""
        return Mark(self.outcome, None, f"{self.way} {self.kind}" if self.error is None else self.error.what)


@dataclass(frozen=True, slots=True)
class DripFeedHeld(DriveEvent):
    """A drip feed is held for long: the machine may be in a long move, in feed hold, or stand."""

    offset: int
    """So many bytes of the program have left."""
    held_s: float

    def as_mark(self) -> Mark:
        """Say it in a few words."""
        return Mark("held", self.held_s, f"at byte {self.offset} of the program")


@dataclass(frozen=True, slots=True)
class VariableWritten(DriveEvent):
    """A variable of the control was written from here, and read back."""

    variable: int
    before: float | None
    value: float

    def as_mark(self) -> Mark:
        """Say it in a few words."""
        return Mark("variable written", self.value, f"#{self.variable}")
