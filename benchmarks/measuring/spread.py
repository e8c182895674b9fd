"""How much values differ from each other, in one number that a few wild ones do not change."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median

__all__ = ["spread_of"]


def spread_of(values: Sequence[float]) -> float:
    """Half of what lies between the quartiles, as a share of the median; 0 of fewer than two values."""
    ordered = sorted(values)
    if len(ordered) < 2 or not (middle := median(ordered)):
        return 0.0
    low, high = ordered[len(ordered) // 4], ordered[(3 * len(ordered)) // 4]
    return (high - low) / 2 / abs(middle)
