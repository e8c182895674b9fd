"""What may be moving because of this shell, as far as it is known."""

from __future__ import annotations

from math import inf

from ...compax.codecs import DriveStatus
from ...compax.moves import Move

__all__ = ["Underway"]


class Underway:
    """
    The move that runs, and a motion by a raw line of which nobody has seen the end.

    Attributes:
        move: A move from here that has not ended.
        raw: The raw line that may have set the axis, or a program, in motion.
    """

    def __init__(self) -> None:
        self.move: Move | None = None
        self.raw: str | None = None
        self._raw_since = -inf

    def __str__(self) -> str:
        """Say what it is, in a few words; nothing, if nothing moves because of this shell."""
        if self.move is not None and not self.move.done():
            return self.move.description
        return "" if self.raw is None else f"{self.raw!r} may still be moving it"

    def __bool__(self) -> bool:
        """Whether the axis may be moving because of this shell."""
        return bool(str(self))

    def note_raw(self, line: str, now: float) -> None:
        """Take note of a raw line that was given to be sent, or that was taken, at loop time *now*."""
        self.raw, self._raw_since = line, now

    def note_status(self, status: DriveStatus, at: float) -> None:
        """Take note of a status that was read from loop time *at* on: it may show that a raw motion is over."""
        if at > self._raw_since and not status.command_active and not status.program_running:
            self.raw = None

    def note_standstill(self) -> None:
        """Take note that a stop has brought the axis to a standstill."""
        self.raw = None
