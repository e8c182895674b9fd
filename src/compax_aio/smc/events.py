"""What happens on a line with axes, beside what happens on any line."""

from __future__ import annotations

from dataclasses import dataclass

from ..motion.events import ConnectionLost, ConnectionRestored, DriveEvent, EventStream, UnexpectedText

__all__ = [
    "AxesReset",
    "CommandDamaged",
    "ConnectionLost",
    "ConnectionRestored",
    "DriveEvent",
    "EventStream",
    "UnexpectedText",
]


@dataclass(frozen=True, slots=True)
class AxesReset(DriveEvent):
    """Axes were reset, or seem to have been: they count their positions from elsewhere, and have stored settings."""

    axes: str
    """Their names; in single mode none."""
    reason: str


@dataclass(frozen=True, slots=True)
class CommandDamaged(DriveEvent):
    """
    A character of a command did not come back, or another one did; clearing the line may have executed what was left.

    Where that may move the axis, it was stopped.
    """

    axis: str
    holds: tuple[str, ...]
    """What the axis may have executed, without its name."""
