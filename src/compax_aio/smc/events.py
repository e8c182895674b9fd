"""What happens on a line with axes, beside what happens on any line."""

from __future__ import annotations

from dataclasses import dataclass

from ..motion.events import (
    ConnectionLost,
    ConnectionRestored,
    DriveEvent,
    EventStream,
    Mark,
    MoveAccepted,
    MoveEnded,
    Stopped,
    UnexpectedText,
)

__all__ = [
    "AxesReset",
    "CommandDamaged",
    "ConnectionLost",
    "ConnectionRestored",
    "DriveEvent",
    "EventStream",
    "Mark",
    "MoveAccepted",
    "MoveEnded",
    "Stopped",
    "UnexpectedText",
]


@dataclass(frozen=True, slots=True)
class AxesReset(DriveEvent):
    """Axes were reset, or seem to have been: they count their positions from elsewhere, and have stored settings."""

    axes: str
    """Their names; in single mode none."""
    reason: str

    def as_mark(self) -> Mark:
        """Say it in a few words."""
        return Mark("reset", None, f"{self.axes}: {self.reason}" if self.axes else self.reason)


@dataclass(frozen=True, slots=True)
class CommandDamaged(DriveEvent):
    """
    A character of a command did not come back, or another one did; clearing the line may have executed what was left.

    Where that may move the axis, it was stopped.
    """

    axis: str
    holds: tuple[str, ...]
    """What the axis may have executed, without its name."""

    def as_mark(self) -> Mark:
        """Say it in a few words."""
        return Mark(
            "command damaged", None, f"{self.axis}: {', '.join(self.holds)}" if self.axis else ", ".join(self.holds)
        )
