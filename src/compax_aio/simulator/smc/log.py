"""What a simulated line and its axes have done, for tests to read: the far end's own testimony."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from ..log import KeptEntries

__all__ = ["MAX_ENTRIES", "Ending", "Log", "LogEntry", "LogKind"]

MAX_ENTRIES: Final = 50_000


class LogKind(StrEnum):
    """What a log entry tells of, and how its text is formed."""

    RECEIVED = "received"
    """A character has arrived over the line, as it came: ``0A``."""
    OVERRUN = "overrun"
    """A character was lost because the one before it had not been read: ``35``."""
    COMMAND = "command"
    """An axis executes a command, the text as it was entered, without name and terminator."""
    ANSWER = "answer"
    """An axis begins to answer the command it executed last; the data, without padding and terminator."""
    QUEUED = "queued"
    """A command waits for the end of another one; the text."""
    REFUSED = "refused"
    """A command had no effect; the text."""
    MOTION_STARTED = "motion_started"
    """The axis is stepping from now on, or otherwise than before; the command, or ``jog``."""
    MOTION_ENDED = "motion_ended"
    """The axis stands; an :class:`Ending`."""
    RESET = "reset"
    """An axis begins anew: ``^C``, ``power`` or ``itself``."""
    ABORT = "abort"
    """An axis has read ESC."""
    NAMED = "named"
    """An axis takes a name; in Python's form."""
    PROGRAM = "program"
    """The program: ``started 0``, ``ended 26``, ``aborted 9``."""
    WRITTEN = "written"
    """Non-volatile memory was written: ``9: R-10000``, ``S``."""
    TROUBLE = "trouble"
    """Trouble was made: ``echo 41 lost``, ``stuck 1 s``, ..."""
    POWER = "power"
    """``off`` or ``on``."""
    CONNECTED = "connected"
    """Somebody is on the line."""
    DISCONNECTED = "disconnected"
    """Nobody is on the line any more."""


class Ending(StrEnum):
    """Why a motion has ended."""

    TARGET = "target"
    """It stands where it should; also a constant speed that has become 0, and home that was found."""
    STOP = "stop"
    """Soft stop, ``@``."""
    ABORT = "abort"
    """ESC."""
    LIMIT = "limit"
    """A limit switch."""
    RESET = "reset"
    """A reset of the controller, or no power."""


@dataclass(frozen=True, slots=True)
class LogEntry:
    """One thing that a line or an axis did."""

    at: float
    """Time in seconds, on the clock that the line is given."""
    kind: LogKind
    axis: str
    """Letter of the axis in ``line.axes``; empty: the line."""
    text: str
    position: float | None = None
    """Where the axis stood when a motion began or ended, as it reads."""


class Log(KeptEntries[LogEntry]):
    """The last things that happened, oldest first; old ones fall off at the end."""

    def __init__(self, entries: int = MAX_ENTRIES) -> None:
        super().__init__(entries)

    def add(self, at: float, kind: LogKind, axis: str = "", text: str = "", position: float | None = None) -> None:
        """Append an entry."""
        self.keep(LogEntry(at, kind, axis, text, position))

    def texts(self, *kinds: LogKind, axis: str | None = None) -> list[str]:
        """List the texts of all entries of *kinds*, oldest first, of one axis or of all."""
        return [entry.text for entry in self if entry.kind in kinds and axis in {None, entry.axis}]
