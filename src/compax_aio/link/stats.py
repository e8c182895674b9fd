"""What is counted of one line."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["LinkStats"]


@dataclass(slots=True)
class LinkStats:
    """Counters of one line since it was made."""

    exchanges: int = 0
    """Lines answered in their turn."""
    timeouts: int = 0
    """Lines whose answer did not come in time."""
    resynchronisations: int = 0
    """Times the line was brought back in step, the first after opening included."""
    late_answers: int = 0
    """Answers that came after their time had run out, and were recognised."""
    strays: int = 0
    """Unsolicited texts, messages of the device not counted."""
    bytes_sent: int = 0
    bytes_received: int = 0
