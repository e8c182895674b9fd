"""What a simulation of a party line does, drawn up beforehand: the line, its axes, actions of users, troubles."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Self

from compax_aio.simulator.smc.knobs import Knobs
from compax_aio.smc.settings import SmcSettings

from ..hunt.scenario import Item, Plan, Scenery, difference

__all__ = ["AxisPlan", "LinePlan", "PartyScenario"]


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisPlan(Plan):
    """One axis, and what is its own of the knobs."""

    knobs: Knobs

    def __str__(self) -> str:
        return f"axis {self.axis} ({difference('knobs', self.knobs, Knobs())})"


@dataclass(frozen=True, slots=True, kw_only=True)
class LinePlan(Item):
    """The line, and how the client is set up for it."""

    knobs: Knobs
    settings: SmcSettings
    is_told_axes: bool = True
    """Whether the client is told which axes there are, or finds them."""

    def __str__(self) -> str:
        told = [difference("knobs", self.knobs, Knobs()), difference("settings", self.settings, SmcSettings())]
        if not self.is_told_axes:
            told.append("axes not told")
        return f"line ({'; '.join(part for part in told if part) or 'as usual'})"


@dataclass(frozen=True, slots=True, kw_only=True)
class PartyScenario(Scenery[AxisPlan]):
    """A whole simulation of one line."""

    line: LinePlan

    @property
    def items(self) -> tuple[Item, ...]:
        """Every part, in the order of the numbers."""
        return (self.line, *self.drives, *self.actions, *self.troubles)

    def keep(self, numbers: Collection[int]) -> Self:
        """Leave out everything else; a ring keeps all its axes, and a line its ways."""
        if self.line.knobs.mode == "daisy":
            numbers = {*numbers, *(plan.number for plan in self.drives)}
        kept = super(PartyScenario, self).keep({*numbers, self.line.number})
        axes = "".join(plan.axis for plan in kept.drives)
        if not axes:
            return kept
        return replace(kept, line=replace(kept.line, knobs=replace(kept.line.knobs, axes=axes)))
