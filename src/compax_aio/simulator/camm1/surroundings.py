"""What all parts of a simulated cutter share: its knobs, its time, its log, and the error that it keeps."""

from __future__ import annotations

from ..surroundings import DeviceSurroundings
from .knobs import Knobs
from .log import Log, LogKind

__all__ = ["Surroundings"]


class Surroundings(DeviceSurroundings[Knobs, LogKind]):
    """
    The inside of one cutter, as each part of it sees it.

    Args:
        knobs: Of the cutter.
        log: Where it notes what it does.

    Attributes:
        io_error: What ``.E`` answers.
    """

    def __init__(self, knobs: Knobs, log: Log) -> None:
        super().__init__(knobs, log)
        self.io_error = 0

    def fail(self, code: int) -> None:
        """Keep an error for ``.E``."""
        if not self.io_error or self.knobs.error_latch == "last":
            self.io_error = code
        self.note(LogKind.IO_ERROR, str(code))
