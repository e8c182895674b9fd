"""What a simulation does, drawn up beforehand: drives, actions of users, troubles; any part of it can be left out."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from random import Random
from typing import Any, Generic, Self, TypeVar

from compax_aio.compax.settings import DriveSettings
from compax_aio.simulator.compax.knobs import Knobs

__all__ = ["Action", "DrivePlan", "Item", "Plan", "Scenario", "Scenery", "Trouble", "difference"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Item:
    """One part of a scenario, known by its number; nothing of it depends on any other part."""

    number: int

    def random(self, seed: int) -> Random:
        """Return this item's own chance, for what cannot be drawn beforehand."""
        return Random(f"{seed}/{self.number}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan(Item):
    """What moves one axis."""

    axis: str


@dataclass(frozen=True, slots=True, kw_only=True)
class DrivePlan(Plan):
    """One drive, and how the client is set up for it."""

    knobs: Knobs
    settings: DriveSettings
    left_over: bytes = b""
    """Half a line that another host has left in the drive's entry buffer."""

    def __str__(self) -> str:
        told = [difference("knobs", self.knobs, Knobs()), difference("settings", self.settings, DriveSettings())]
        if self.left_over:
            told.append(f"half a line before: {self.left_over!r}")
        return f"drive {self.axis} ({'; '.join(part for part in told if part) or 'as usual'})"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Timed(Item):
    at_s: float
    """From the beginning, when the lines are opened."""
    kind: str
    axes: tuple[str, ...]
    """Whom it concerns; of a group, all its axes."""
    arguments: Mapping[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        given = ", ".join(f"{name}={value!r}" for name, value in self.arguments.items() if value is not None)
        return f"at {self.at_s:.4f} s {self.kind} {'+'.join(self.axes)}({given})"


@dataclass(frozen=True, slots=True, kw_only=True)
class Action(_Timed):
    """Something that a user does."""

    gives_up: tuple[float, int] | None = None
    """When the task that does it is cancelled: seconds after it began, and steps of the event loop after that."""

    def __str__(self) -> str:
        if self.gives_up is None:
            return super(Action, self).__str__()
        after_s, steps = self.gives_up
        return f"{super(Action, self).__str__()}, cancelled after {after_s:g} s and {steps} steps"


@dataclass(frozen=True, slots=True, kw_only=True)
class Trouble(_Timed):
    """Something that befalls a drive or its line."""

    lasts_s: float = 0.0


_Plan = TypeVar("_Plan", bound=Plan)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenery(Generic[_Plan]):
    """A whole simulation, of whatever devices."""

    seed: int
    drives: tuple[_Plan, ...]
    actions: tuple[Action, ...]
    troubles: tuple[Trouble, ...]

    @property
    def items(self) -> tuple[Item, ...]:
        """Every part, in the order of the numbers."""
        return (*self.drives, *self.actions, *self.troubles)

    @property
    def numbers(self) -> tuple[int, ...]:
        """The numbers of all parts."""
        return tuple(item.number for item in self.items)

    def keep(self, numbers: Collection[int]) -> Self:
        """Leave out everything else; with a drive goes what is done to it alone."""
        drives = tuple(drive for drive in self.drives if drive.number in numbers)
        axes = {drive.axis for drive in drives}
        return replace(
            self,
            drives=drives,
            actions=tuple(kept for each in self.actions if each.number in numbers and (kept := _on(each, axes))),
            troubles=tuple(kept for each in self.troubles if each.number in numbers and (kept := _on(each, axes))),
        )

    def __str__(self) -> str:
        return "\n".join(f"{item.number:4d}  {item}" for item in self.items)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario(Scenery[DrivePlan]):
    """A whole simulation of drives, each with a line of its own."""

    drives: tuple[DrivePlan, ...]


def _on(item: Any, axes: Collection[str]) -> Any:
    """Return *item* as far as it concerns *axes*; None if nothing is left. What concerns none concerns all."""
    left = tuple(axis for axis in item.axes if axis in axes)
    return replace(item, axes=left) if left or not item.axes else None


def difference(what: str, value: Any, usual: Any) -> str:
    """Say in what *value* differs from *usual*; nothing if it does not."""
    names = [name for name in type(value).__slots__ if getattr(value, name) != getattr(usual, name)]
    return f"{what}: {', '.join(f'{name}={getattr(value, name)!r}' for name in names)}" if names else ""
