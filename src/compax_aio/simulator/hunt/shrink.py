"""Leaves out of a scenario whatever it does not take to break the same promise (ddmin)."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Any, TypeVar

from .quarry import COMPAX, Quarry
from .scenario import Scenery

__all__ = ["breaks", "ddmin", "shrink"]

_Scenery = TypeVar("_Scenery", bound=Scenery[Any])


def shrink(scenario: _Scenery, promise: str, quarry: Quarry = COMPAX) -> _Scenery:
    """Return the smallest part of *scenario* that was found to break *promise*."""
    kept = ddmin(scenario.numbers, lambda numbers: breaks(scenario.keep(numbers), promise, quarry))
    return scenario.keep(kept)


def breaks(scenario: Scenery[Any], promise: str, quarry: Quarry = COMPAX) -> bool:
    """Whether *scenario* breaks *promise*."""
    if not scenario.drives:
        return False
    return any(found.promise == promise for found in quarry.broken(quarry.simulate(scenario)))


def ddmin(parts: Sequence[int], still_fails: Callable[[Collection[int]], bool]) -> tuple[int, ...]:
    """
    Return a part of *parts* that still fails, and of which no single one can be left out.

    Args:
        parts: What fails as a whole.
        still_fails: Whether some of them fail.
    """
    kept = tuple(parts)
    chunk = max(1, len(kept) // 2)
    while True:
        at, has_shrunk = 0, False
        while at < len(kept):
            rest = kept[:at] + kept[at + chunk :]
            if rest and still_fails(rest):
                kept, has_shrunk = rest, True
            else:
                at += chunk
        if chunk == 1 and not has_shrunk:
            return kept
        chunk = max(1, chunk // 2) if not has_shrunk or chunk > len(kept) // 2 else chunk
