"""How long to wait before the next look at a move: ever longer, but not past the time at which it should arrive."""

from __future__ import annotations

from typing import Final

__all__ = ["Pace"]

_GROWTH: Final = 1.5


class Pace:
    """
    The pace at which one move is looked at; plain numbers in and out, no clock.

    Args:
        first_s: The first pause, and the shortest.
        slowest_s: The longest one.
        now: Loop time at which the move began.
    """

    def __init__(self, first_s: float, slowest_s: float, now: float) -> None:
        self._first_s = first_s
        self._slowest_s = slowest_s
        self._pause_s = first_s
        self._moved_at = now
        self._position: float | None = None
        self._seen_at = now
        self._speed = 0.0

    @property
    def pause_s(self) -> float:
        """Seconds until the next look."""
        return self._pause_s

    def note(self, position: float | None, now: float) -> None:
        """Take a position that was just read; None where it cannot be."""
        if position is not None and self._position is not None and now > self._seen_at:
            self._speed = (position - self._position) / (now - self._seen_at)
        if position is None or position != self._position:  # where it cannot be read, no stall can be seen
            self._moved_at = now
        self._position, self._seen_at = position, now
        self._pause_s = min(self._pause_s * _GROWTH, self._slowest_s)

    def stood_still_s(self, now: float) -> float:
        """Return for how long no other position was seen."""
        return now - self._moved_at

    def pause_before_arrival_s(self, target: float | None) -> float:
        """Return the next pause, cut to when the axis would arrive at *target* at the speed last seen."""
        if target is None or self._position is None or (target - self._position) * self._speed <= 0:
            return self._pause_s
        arrives_in_s = (target - self._position) / self._speed
        return min(self._pause_s, max(self._first_s, arrives_in_s))
