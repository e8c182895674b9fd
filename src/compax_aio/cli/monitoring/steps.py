"""The step of a jog: one, two, five and their tens."""

from __future__ import annotations

from typing import Final

__all__ = ["LARGE", "next_step"]

LARGE: Final = 10
"""So many steps at once, with shift."""

_STEPS: Final = tuple(digit * 10.0**power for power in range(-3, 3) for digit in (1, 2, 5))


def next_step(step: float, direction: int, *, decimals: int) -> float:
    """Return the step above *step*, or below it, of those that a drive with *decimals* can be told; else *step*."""
    possible = [each for each in _STEPS if each >= 10.0**-decimals * 0.999]
    if direction > 0:
        return next((each for each in possible if each > step * 1.001), step)
    return next((each for each in reversed(possible) if each < step * 0.999), step)
