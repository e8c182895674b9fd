"""What is known of one cutter's line and set by its user: times, patience, and how much may be on its way."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Final

from ..checked_numbers import check_time, check_whole
from .facts.instructions import MAX_BLOCK_SIZE, MAX_DELAY_MS

__all__ = ["CutterSettings"]

_COUNTS: Final = ("resync_attempts", "reconnect_attempts")
_MAY_BE_NONE: Final = frozenset({"reconnect_attempts", "reserve_bytes", "baud_rate"})


@dataclass(frozen=True, slots=True, kw_only=True)
class CutterSettings:
    """
    How long things may take on one line, and how much may be on its way; all times in seconds.

    Raises:
        InvalidCommandError: A value means nothing.
    """

    answer_timeout_s: float = 2.0
    """How long the reply to something may take that is answered at once, beside what the bytes before it take."""
    cutting_timeout_s: float = 60.0
    """How long the reply to ``OA;`` may take, which comes after the last instruction was cut."""
    stall_timeout_s: float = 60.0
    """For so long a cutter that is not paused may take nothing more before a job counts as stalled."""
    held_timeout_s: float = 600.0
    """The same where the cable holds the line (hardwire handshake), so that nobody can ask whether it is paused."""
    look_s: float = 1.0
    """For so long Xon is awaited before free space is asked for: it may be lost."""
    enquiry_timeout_s: float = 0.5
    """For so long ENQ may stay unacknowledged before it is taken back, and free space asked for instead."""
    poll_first_s: float = 0.02
    """After so long a cutter without room is asked again …"""
    poll_slowest_s: float = 0.25
    """… and, while nothing changes, ever more rarely up to this."""
    watch_s: float = 5.0
    """The line's error is looked at so often while a job is sent (``ESC.E``)."""
    settle_s: float = 0.05
    """After ``.K`` nothing is sent for so long."""
    drain_s: float = 0.1
    """After ``.J`` nothing is sent for so long, and what comes is late; beside the turnaround."""
    stop_timeout_s: float = 60.0
    """How long an aborted cutter may take until it is empty: the vector under way is cut to its end."""
    turnaround_ms: int = 0
    """The cutter waits so long before it replies (``.M``, up to 32767 ms): for lines whose host is slow to listen."""
    reserve_bytes: int | None = None
    """So much of the buffer stays free; None: 128 bytes, of a buffer below 512 bytes an eighth and 16 at least."""
    window_s: float = 0.25
    """No more may be on its way than what the line sends in that time, 48 to 256 bytes: so stops are quick."""
    baud_rate: int | None = None
    """Of the line; None: what the URL says, which a terminal server's does not."""
    resync_attempts: int = 5
    """How many times the cutter is asked for a sign of life before it counts as silent."""
    in_doubt_after_s: float = 30.0
    """How long a lost line is waited for by what asks or stops."""

    reconnect: bool = True
    """Open a line that was lost, or that keeps silent, again. A job is never resumed."""
    reconnect_first_s: float = 0.5
    """When a lost line is tried first, at most; later ever more rarely."""
    reconnect_slowest_s: float = 30.0
    """Longest pause between two attempts."""
    reconnect_attempts: int | None = None
    """How often a lost line is tried; None: until it is back."""

    def __post_init__(self) -> None:
        for field in fields(self):
            name, value = field.name, getattr(self, field.name)
            if value is None and name in _MAY_BE_NONE:
                continue
            if name.endswith("_s"):
                check_time(name, value)
            elif name in _COUNTS:
                check_whole(name, value, 1, 1_000_000)
        check_whole("turnaround_ms", self.turnaround_ms, 0, MAX_DELAY_MS, source="PNC-1610 p. 28")
        if self.reserve_bytes is not None:
            check_whole("reserve_bytes", self.reserve_bytes, 0, MAX_BLOCK_SIZE)
        if self.baud_rate is not None:
            check_whole("baud_rate", self.baud_rate, 1, 12_000_000)

    @property
    def drained_after_s(self) -> float:
        """How long what the cutter was about to reply may come after ``.J``."""
        return self.drain_s + self.turnaround_ms / 1000

    @property
    def answered_after_s(self) -> float:
        """How long a reply may take, with its turnaround."""
        return self.answer_timeout_s + self.turnaround_ms / 1000
