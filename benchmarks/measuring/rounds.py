"""Rounds: every candidate in turn, again and again, so that what the machine does meanwhile strikes all alike."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterator, Mapping
from dataclasses import dataclass, field
from statistics import median

from .effort import Effort
from .spread import spread_of

__all__ = ["Measured", "Results", "interleaved", "interleaved_async"]

Measured = Mapping[str, float]
"""What one round gave, by quantity: ``{"cpu_s": 0.00002, "wall_s": 0.00007}``."""


@dataclass(slots=True)
class Results:
    """What all rounds gave, by candidate and quantity; the first value of each belongs to the same round, and so on."""

    values: dict[str, dict[str, list[float]]] = field(default_factory=dict)

    def add(self, candidate: str, measured: Measured) -> None:
        """Take note of one round of one candidate."""
        of_candidate = self.values.setdefault(candidate, {})
        for quantity, value in measured.items():
            of_candidate.setdefault(quantity, []).append(value)

    def median(self, candidate: str, quantity: str) -> float:
        """Return the median of all rounds."""
        return median(self.values[candidate][quantity])

    def spread(self, candidate: str, quantity: str) -> float:
        """Half of what lies between the quartiles, as a share of the median."""
        return spread_of(self.values[candidate][quantity])

    def ratios(self, candidate: str, other: str, quantity: str) -> list[float]:
        """Divide what the two did in the same round, round by round."""
        mine, theirs = self.values[candidate][quantity], self.values[other][quantity]
        return [one / another for one, another in zip(mine, theirs, strict=True)]

    def ratio(self, candidate: str, other: str, quantity: str) -> float:
        """Return the median of those ratios: what changes from round to round counts in neither."""
        return median(self.ratios(candidate, other, quantity))

    def ratio_spread(self, candidate: str, other: str, quantity: str) -> float:
        """Return how much those ratios differ from round to round."""
        return spread_of(self.ratios(candidate, other, quantity))


def _plan(effort: Effort, names: list[str]) -> Iterator[tuple[str, bool]]:
    """Name each candidate of each round in its order, and say whether it counts; every other round goes backwards."""
    for number in range(effort.rounds + 1):
        effort.noise.sample()
        for name in names if number % 2 else reversed(names):
            yield name, number > 0


def interleaved(effort: Effort, candidates: Mapping[str, Callable[[], Measured]]) -> Results:
    """Measure each candidate once a round; a first round is thrown away."""
    results = Results()
    for name, counts in _plan(effort, list(candidates)):
        measured = candidates[name]()
        if counts:
            results.add(name, measured)
    return results


async def interleaved_async(effort: Effort, candidates: Mapping[str, Callable[[], Awaitable[Measured]]]) -> Results:
    """Measure each candidate once a round, on this event loop; a first round is thrown away."""
    results = Results()
    for name, counts in _plan(effort, list(candidates)):
        measured = await candidates[name]()
        if counts:
            results.add(name, measured)
    return results
