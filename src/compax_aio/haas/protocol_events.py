"""What a control's line tells: how an exchange ended, and what came without being asked for."""

from __future__ import annotations

from dataclasses import dataclass

from ..link.contract import Event, TurnLost, TurnOver
from .transfers.account import LineAccount

__all__ = [
    "Answered",
    "CutShort",
    "HeldBack",
    "LeftOver",
    "NobodyAnswers",
    "Overheard",
    "Printed",
    "ReaderOff",
    "ReaderOn",
    "TransferOver",
    "Unreadable",
]


@dataclass(frozen=True, slots=True)
class Answered(TurnOver):
    """The answer to what was asked."""

    text: str
    """What stood in the frame: ``S/N, 1234567``, ``STATUS, BUSY``, ``UNKNOWN``."""


@dataclass(frozen=True, slots=True)
class TransferOver(TurnOver):
    """A transfer is over, well or not: ``account.ending`` says how."""

    account: LineAccount


@dataclass(frozen=True, slots=True)
class CutShort(TurnLost):
    """The turn of *sent* is over because something else was given up in the middle of it; its answer may still come."""

    sent: str


@dataclass(frozen=True, slots=True)
class Unreadable(TurnLost):
    """What came is no answer to what was asked, or it was damaged."""

    sent: str
    text: str
    """The beginning of what came."""


@dataclass(frozen=True, slots=True)
class HeldBack(TurnLost):
    """*sent* was not sent: the control holds the line (Xoff), or never stops sending something else."""

    sent: str
    by_xoff: bool


@dataclass(frozen=True, slots=True)
class NobodyAnswers(TurnLost):
    """*sent* was not sent: an earlier question is unanswered, and so is *asked*, which was to show that it is lost."""

    sent: str
    asked: str


@dataclass(frozen=True, slots=True)
class Printed(Event):
    """A line of text that a running program prints (DPRNT)."""

    text: str
    is_damaged: bool = False
    """Whether a byte of it came damaged."""


@dataclass(frozen=True, slots=True)
class Overheard(Event):
    """A frame that answers nothing that was asked: somebody else asks on this line, or it came very late."""

    text: str


@dataclass(frozen=True, slots=True)
class LeftOver(Event):
    """More of a file has come that was given up; it is dropped."""

    bytes: int


@dataclass(frozen=True, slots=True)
class ReaderOn(Event):
    """The control said that its reader is on (DC1, with DC codes), with no file to send: somebody has pressed RECV."""


@dataclass(frozen=True, slots=True)
class ReaderOff(Event):
    """The control said that its reader is off (DC3, with DC codes), with no file being sent."""
