"""What a simulated cutter has done, for tests to read: the far end's own testimony."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

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


@dataclass(frozen=True, slots=True)
class LogEntry:
    """One thing that a cutter did."""

    at: float
    """Time in seconds, on the clock that the cutter is given."""
    kind: LogKind
    text: str


class Log(deque[LogEntry]):
    """
    The last things that happened, in the order in which they were noted; old ones fall off at the end.

    A cutter that nobody looks at notes what its motor did when it is asked the next time, with the time at which it
    was done.

    Args:
        entries: How many are kept.

    Attributes:
        on_entry: Called with each that is added; None: nobody wants to know.
    """

    def __init__(self, entries: int = MAX_ENTRIES) -> None:
        super().__init__(maxlen=entries)
        self.on_entry: Callable[[LogEntry], None] | None = None

    def add(self, at: float, kind: LogKind, text: str = "") -> None:
        """Append an entry."""
        entry = LogEntry(at, kind, text)
        self.append(entry)
        if self.on_entry is not None:
            self.on_entry(entry)

    def texts(self, *kinds: LogKind) -> list[str]:
        """List the texts of all entries of *kinds*, oldest first."""
        return [entry.text for entry in self if entry.kind in kinds]
