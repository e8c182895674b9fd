"""What all parts of a simulated cutter share: its knobs, its time, its log, and the error that it keeps."""

from __future__ import annotations

from .knobs import Knobs
from .log import Log, LogKind

__all__ = ["Surroundings"]


class Surroundings:
    """
    The inside of one cutter, as each part of it sees it.

    Args:
        knobs: Of the cutter.
        log: Where it notes what it does.

    Attributes:
        now: The time of what happens.
        is_on: Whether there is power.
        io_error: What ``.E`` answers.
    """

    def __init__(self, knobs: Knobs, log: Log) -> None:
        self.knobs = knobs
        self.log = log
        self.now = 0.0
        self.is_on = True
        self.io_error = 0

    def reach(self, now: float) -> None:
        """Let it be *now*, unless it is later."""
        self.now = max(self.now, now)

    def note(self, kind: LogKind, text: str = "", at: float | None = None) -> None:
        """Note something that happens, or happened at a time of its own."""
        self.log.add(self.now if at is None else at, kind, text)

    def note_count(self, kind: LogKind, count: int) -> None:
        """Note how many bytes were lost, in one entry as long as nothing else is noted."""
        if self.log and self.log[-1].kind is kind:
            self.log.pop()
        self.note(kind, str(count))

    def fail(self, code: int) -> None:
        """Keep an error for ``.E``."""
        if not self.io_error or self.knobs.error_latch == "last":
            self.io_error = code
        self.note(LogKind.IO_ERROR, str(code))
