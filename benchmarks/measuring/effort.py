"""How much time a measurement may take: the least for a smoke test, seconds for a look, minutes for good figures."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final, Literal, TypeVar

from .machine import Noise

__all__ = ["FULL", "LEAST", "SHORT", "Effort"]

T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """
    What a figure may cost.

    Attributes:
        rounds: How often each candidate is measured, in turn with the others; one more is thrown away first.
        round_s: How long each round is, in seconds.
        noise: What the machine did meanwhile is noted there.
    """

    name: Literal["least", "short", "full"]
    rounds: int
    round_s: float
    noise: Noise = field(default_factory=Noise, compare=False)

    def pick(self, least: T, short: T, full: T) -> T:
        """Choose a size: how many lines, exchanges, seeds."""
        return {"least": least, "short": short, "full": full}[self.name]


LEAST: Final = Effort(name="least", rounds=1, round_s=0.02)
"""Shows that a figure can be measured; its values mean nothing."""
SHORT: Final = Effort(name="short", rounds=7, round_s=0.15)
FULL: Final = Effort(name="full", rounds=25, round_s=0.6)
