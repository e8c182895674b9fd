"""What is counted of one line, and how long its answers took."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from math import ceil
from typing import Final

from ..errors import InvalidCommandError

__all__ = ["LinkStats"]

_ANSWERS_KEPT: Final = 256


@dataclass(slots=True)
class LinkStats:
    """Counters of one line since it was made; they go on when the line is lost and comes back."""

    exchanges: int = 0
    """Lines answered in their turn."""
    timeouts: int = 0
    """Lines whose answer did not come in time."""
    lost_turns: int = 0
    """Lines that were cut short, by the device or from here, and have no answer."""
    resynchronisations: int = 0
    """Times the line was brought back in step, the first after opening included."""
    openings: int = 0
    """Times the line was opened, or tried to be: while it is lost, this grows with every attempt."""
    reconnects: int = 0
    """Times the line was lost and came back."""
    late_answers: int = 0
    """Answers that came after their time had run out, and were recognised."""
    strays: int = 0
    """Unsolicited texts, messages of the device not counted."""
    bytes_sent: int = 0
    bytes_received: int = 0
    answer_times_s: deque[float] = field(default_factory=lambda: deque(maxlen=_ANSWERS_KEPT), repr=False)
    """Of the last 256 lines answered in their turn, oldest first: from being written to the answer being read."""

    def answered(self, after_s: float) -> None:
        """Count a line that was answered in its turn."""
        self.exchanges += 1
        self.answer_times_s.append(after_s)

    def answer_time_s(self, percentile: float) -> float | None:
        """
        Return the time within which that share of the last answers came; None before the first.

        Args:
            percentile: 50 for the median, 99 for all but the slowest hundredth; above 0, at most 100.

        Raises:
            InvalidCommandError: *percentile* is none.
        """
        if not 0 < percentile <= 100:
            raise InvalidCommandError(f"a percentile is above 0 and at most 100, not {percentile!r}")
        if not self.answer_times_s:
            return None
        in_order = sorted(self.answer_times_s)
        return in_order[ceil(len(in_order) * percentile / 100) - 1]
