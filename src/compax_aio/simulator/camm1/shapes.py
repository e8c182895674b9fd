"""Arcs as chords, and lines cut off at the edge of a window."""

from __future__ import annotations

from math import ceil, cos, hypot, radians, sin
from typing import Final

__all__ = ["CHORD_DEG", "Point", "arc", "clipped"]

Point = tuple[float, float]

CHORD_DEG: Final = 5.0
"""Of arcs that say no other (PNC-900 p. 18)."""
_FINEST_DEG: Final = 0.36


def arc(centre: Point, radius: float, begin_deg: float, sweep_deg: float, chord_deg: float = CHORD_DEG) -> list[Point]:
    """List the points behind the first one of an arc, as chords of at most so many degrees."""
    step = max(abs(chord_deg), _FINEST_DEG)
    count = max(1, ceil(abs(sweep_deg) / step - 1e-9))
    angles = (radians(begin_deg + sweep_deg * number / count) for number in range(1, count + 1))
    return [(centre[0] + radius * cos(each), centre[1] + radius * sin(each)) for each in angles]


def clipped(begin: Point, end: Point, low: Point, high: Point) -> tuple[Point, Point] | None:
    """Return the part of a line that lies in a window (Liang and Barsky); None: no part."""
    dx, dy = end[0] - begin[0], end[1] - begin[1]
    first, last = 0.0, 1.0
    for slope, room in (
        (-dx, begin[0] - low[0]),
        (dx, high[0] - begin[0]),
        (-dy, begin[1] - low[1]),
        (dy, high[1] - begin[1]),
    ):
        if slope == 0:
            if room < 0:
                return None
            continue
        at = room / slope
        if slope < 0:
            first = max(first, at)
        else:
            last = min(last, at)
    if first > last or (hypot(dx, dy) > 0 and first == last):
        return None
    inner = (begin[0] + first * dx, begin[1] + first * dy)
    outer = end if last == 1.0 else (begin[0] + last * dx, begin[1] + last * dy)
    return inner, outer
