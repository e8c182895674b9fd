"""A figure: what was measured, what it should be, and what stands beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Literal

__all__ = ["Figure", "Row", "Target", "above", "at_least", "at_most"]


@dataclass(frozen=True, slots=True)
class Target:
    """What a value should be, in the figure's own unit."""

    limit: float
    kind: Literal["at most", "at least", "above"]
    says: str = ""
    """Other words for it."""

    def is_reached(self, value: float) -> bool:
        """Whether *value* is as it should be."""
        if self.kind == "at least":
            return value >= self.limit
        return value > self.limit if self.kind == "above" else value <= self.limit

    def told(self, unit: str) -> str:
        """Say it: ``≤ 1.5 times the floor``."""
        sign = {"at most": "≤", "at least": "≥", "above": ">"}[self.kind]
        return self.says or f"{sign} {self.limit:,g} {unit}".strip()


def at_most(limit: float, says: str = "") -> Target:
    """Make a target that larger values miss."""
    return Target(limit, "at most", says)


def at_least(limit: float, says: str = "") -> Target:
    """Make a target that smaller values miss."""
    return Target(limit, "at least", says)


def above(limit: float, says: str = "") -> Target:
    """Make a target that values must be larger than."""
    return Target(limit, "above", says)


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """
    What stands beside a figure: the floor, a peer, a step on the way, a percentile.

    Attributes:
        value: In *unit*; None if it could not be measured: *note* says why.
        ratio: How it compares with what the figure's ``ratio_of`` names; None if it does not.
        spread: Half of what lies between the quartiles of its rounds, as a share of the median; None for one value.
    """

    name: str
    value: float | None
    unit: str
    ratio: float | None = None
    spread: float | None = None
    note: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """
    One line of the table, and the lines that are told under it.

    Attributes:
        name: What was measured: ``position() on TCP, asyncio``.
        value: In *unit*; None if it could not be measured: a note says why.
        unit: ``times the floor``, ``ms``, ``KiB``; may be empty.
        target: What it should be; None for a figure that is only told.
        spread: Half of what lies between the quartiles of its rounds, as a share of the median; None for one value.
        ratio_of: What the ratios of the rows are to: ``the floor``.
        rows: What stands beside it.
        notes: What must be said: what limits it, that the far end does not, what is not installed.
    """

    name: str
    value: float | None
    unit: str = ""
    target: Target | None = None
    spread: float | None = None
    ratio_of: str = ""
    rows: Sequence[Row] = ()
    notes: Sequence[str] = ()

    @property
    def is_reached(self) -> bool | None:
        """Whether it is as it should be; None if there is no target, or it was not measured."""
        if self.target is None or self.value is None:
            return None
        return self.target.is_reached(self.value)

    def as_dict(self) -> Mapping[str, object]:
        """Say it in JSON."""
        return {
            **asdict(self),
            "is_reached": self.is_reached,
            "target_told": self.target.told(self.unit) if self.target else None,
        }
