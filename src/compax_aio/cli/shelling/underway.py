"""What may be moving because of this shell, as far as it is known."""

from __future__ import annotations

from math import inf

from ...compax.codecs import DriveStatus
from ...compax.moves import Move

__all__ = ["Underway"]


class Underway:
    """
    The move that runs, and a motion of which nobody has seen the end: by a raw line, in doubt, or not stopped.

    Attributes:
        move: The last move from here.
        unseen: What may have set the axis, or a program, in motion without being watched, or its end being known.
    """

    def __init__(self) -> None:
        self.move: Move | None = None
        self.unseen: str | None = None
        self._unseen_since = -inf

    def __str__(self) -> str:
        """Say what it is, in a few words; nothing, if nothing moves because of this shell."""
        if self.move is not None and not self.move.done():
            return f"{self.move.description} is running"
        return "" if self.unseen is None else f"{self.unseen} may still be moving it"

    def __bool__(self) -> bool:
        """Whether the axis may be moving because of this shell."""
        return bool(str(self))

    def note_unseen(self, what: str, now: float) -> None:
        """Take note at loop time *now* of what may be moving the axis, and is not watched."""
        self.unseen, self._unseen_since = what, now

    def note_status(self, status: DriveStatus, at: float) -> None:
        """Take note of a status that was read from loop time *at* on: it may show that what was unseen is over."""
        if at >= self._unseen_since and not status.command_active and not status.program_running:
            self.unseen = None

    def note_standstill(self) -> None:
        """Take note that a stop has brought the axis to a standstill."""
        self.unseen = None
