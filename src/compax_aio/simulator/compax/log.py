"""What a simulated drive has done, for tests to read: the far end's own testimony."""

from __future__ import annotations

from enum import StrEnum
from typing import Final

from ..log import DeviceLog, DeviceLogEntry

__all__ = ["MAX_ENTRIES", "Log", "LogEntry", "LogKind"]

MAX_ENTRIES: Final = 20_000


class LogKind(StrEnum):
    """What a log entry tells of, and how its text is formed."""

    LINE = "line"
    """A complete line is being processed, the text as received, without CR; or a frame, ``84 4C 00 FA (ACCEL 250)``."""
    ANSWER = "answer"
    """An answer begins on the wire; its text without prompt."""
    MESSAGE = "message"
    """A message begins on the wire: ``$`` or a comparator's number."""
    LOST = "lost"
    """An answer or message that a fault hook kept from the wire; its text."""
    MOTION_STARTED = "motion_started"
    """A positioning began; command word and target: ``POSA 100.00``."""
    MOTION_CONTINUED = "motion_continued"
    """START continued a stopped positioning; command word and target."""
    SPEED_CHANGED = "speed_changed"
    """A positioning goes on at another speed; in % of nominal speed: ``30``."""
    MOTION_REACHED = "motion_reached"
    """The axis stands at its target; the position."""
    MOTION_STOPPED = "motion_stopped"
    """The axis stands after STOP or BREAK; the position."""
    MOTION_FAULT = "motion_fault"
    """The axis stands after a fault or without power; the position."""
    OUTPUT = "output"
    """An output was set: ``O9=1``."""
    PROGRAM = "program"
    """The program: ``started N001``, ``stopped N009``, ``continued N009``, ``ended N013``, ``N005 refused: ...``."""
    FAULT = "fault"
    """A fault or warning came: ``E55``."""
    QUIT = "quit"
    """The fault was acknowledged."""
    POWER = "power"
    """``off`` or ``on``."""
    CONNECTED = "connected"
    """Somebody is on the line."""
    DISCONNECTED = "disconnected"
    """Nobody is on the line any more."""


class LogEntry(DeviceLogEntry[LogKind]):
    """One thing that the drive did."""

    __slots__ = ()


class Log(DeviceLog[LogEntry, LogKind]):
    """The last things that happened, oldest first; old ones fall off at the end."""

    def __init__(self, entries: int = MAX_ENTRIES) -> None:
        super().__init__(LogEntry, entries)
