"""What a simulated cutter has done, for tests to read: the far end's own testimony."""

from __future__ import annotations

from enum import StrEnum
from typing import Final

from ..log import DeviceLog, DeviceLogEntry

__all__ = ["MAX_ENTRIES", "Log", "LogEntry", "LogKind"]

MAX_ENTRIES: Final = 50_000


class LogKind(StrEnum):
    """What a log entry tells of, and how its text is formed."""

    CONTROL = "control"
    """A device control instruction is obeyed, without ``ESC .``: ``B``, ``I80;5;6:``."""
    ENQUIRY = "enquiry"
    """ENQ has come; ``pending`` or ``answered``."""
    ANSWER = "answer"
    """A reply begins; what was asked, and the reply without terminator: ``B 1024``, ``OA 0,0,0``."""
    HANDSHAKE = "handshake"
    """A handshake string begins: ``Xoff``, ``Xon``, ``ACK``, ``immediate``; or ``DTR low``, ``DTR high``."""
    INSTRUCTION = "instruction"
    """An instruction of the cutting language is carried out; its text, at most 80 characters."""
    CLEARED = "cleared"
    """Data was thrown away, by ``K``, ``panel`` or ``power``, and how many bytes: ``K 500``."""
    OVERFLOW = "overflow"
    """Bytes were lost because the buffer was full; how many so far."""
    REFUSED = "refused"
    """Bytes were lost because the machine is not ready; how many so far."""
    IO_ERROR = "io_error"
    """An error for ``.E``: ``11``."""
    DATA_ERROR = "data_error"
    """An error for ``OE``, and where: ``2 PD1``."""
    PANEL = "panel"
    """Somebody is at the machine: ``pause``, ``resume``, ``setup off``, ``cancel``, ``view``, ``lever up`` ..."""
    POWER = "power"
    """``off`` or ``on``."""
    TROUBLE = "trouble"
    """Trouble was made: ``reply 1024 lost``, ``Xon lost``, ``31 spoilt`` ..."""
    CONNECTED = "connected"
    """Somebody is on the line."""
    DISCONNECTED = "disconnected"
    """Nobody is on the line any more."""


class LogEntry(DeviceLogEntry[LogKind]):
    """One thing that a cutter did."""

    __slots__ = ()


class Log(DeviceLog[LogEntry, LogKind]):
    """
    The last things that happened, in the order in which they were noted; old ones fall off at the end.

    A cutter that nobody looks at notes what its motor did when it is asked the next time, with the time at which it
    was done.
    """

    def __init__(self, entries: int = MAX_ENTRIES) -> None:
        super().__init__(LogEntry, entries)
