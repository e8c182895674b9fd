"""What is known of one party line and set by its user: times, patience, and the member of the family."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Literal

from ..checked_numbers import check_time
from ..errors import InvalidCommandError
from .profile import DCB_274, Profile

__all__ = ["CancelWith", "SmcSettings"]

CancelWith = Literal["line feed", "escape"]


@dataclass(frozen=True, slots=True, kw_only=True)
class SmcSettings:
    """
    How long things may take on one line, and what is on it; all times in seconds.

    Raises:
        InvalidCommandError: A value means nothing.
    """

    profile: Profile = DCB_274
    """The member of the family; all axes of one line are alike."""

    echo_timeout_s: float = 0.25
    """How long a character's echo may take; at least ten times what it takes on the line at hand."""
    answer_timeout_s: float = 2.0
    """How long a result may take, from the terminator on (motorIms waits as long)."""
    quiet_s: float = 0.05
    """After a line feed that clears the axes' buffers nothing is sent for so long, and what comes is dropped."""
    escape_quiet_s: float = 0.1
    """The same after ESC: all axes may answer at once."""
    sign_on_s: float = 0.3
    """What the sign-on of a single axis may take."""
    listing_quiet_s: float = 0.2
    """After so long a silence a listing of several lines is over."""
    resync_attempts: int = 6
    """How many times a line is cleared and an axis asked before it counts as silent."""
    cancel_with: CancelWith = "line feed"
    """
    What clears the axes' buffers after an echo that was missing or wrong.

    A line feed leaves every other axis alone, but the axis may execute what it holds of the damaged command (DCB
    p. 27); if that was a motion it is stopped at once. ESC lets nothing be executed, and aborts the motion of all axes.
    """

    poll_first_s: float = 0.05
    """When a motion is looked at first: no sooner, else a motion that begins late counts as ended (789A-4)."""
    poll_slowest_s: float = 0.25
    """The longest pause between two looks at a motion (gem-controld and 789A-4 take 0.25 to 0.3)."""
    stop_timeout_s: float = 5.0
    """For so long a stop is repeated until it is acknowledged."""
    standstill_timeout_s: float = 30.0
    """How long an axis may take to come to a standstill after that."""
    stall_timeout_s: float = 10.0
    """For so long an axis may say that it moves and be always at the same position."""
    in_doubt_after_s: float = 30.0
    """How long a lost or silent line is waited for before a move is in doubt."""

    reconnect: bool = True
    """Open a line that was lost, or that keeps silent, again."""
    reconnect_first_s: float = 0.5
    """When a lost line is tried first, at most; later ever more rarely."""
    reconnect_slowest_s: float = 30.0
    """Longest pause between two attempts."""
    reconnect_attempts: int | None = None
    """How often a lost line is tried; None: until it is back."""

    def __post_init__(self) -> None:
        for field in fields(self):
            if field.name.endswith("_s"):
                check_time(field.name, getattr(self, field.name))
        if self.cancel_with not in {"line feed", "escape"}:
            raise InvalidCommandError(f"cancel_with is 'line feed' or 'escape', not {self.cancel_with!r}")
        for name in ("resync_attempts", "reconnect_attempts"):
            value = getattr(self, name)
            may_be_none = name == "reconnect_attempts"
            is_count = isinstance(value, int) and not isinstance(value, bool) and value >= 1
            if not is_count and not (may_be_none and value is None):
                raise InvalidCommandError(f"{name} is a whole number above 0, not {value!r}")
