"""A day of eight drives with troubles in one long scenario, and how fast it went."""

from __future__ import annotations

import time
from collections.abc import Callable
from random import Random
from typing import Any, Final

from .actions import ACTIONS
from .drawing import AXIS_APART, draw_drive, draw_trouble
from .promises import broken
from .scenario import Action, Scenario, Trouble
from .simulation import simulate

__all__ = ["draw_day", "run_day"]

_AXES: Final = "xyzwabcd"
_BETWEEN_ACTIONS_S: Final = 180.0
_BETWEEN_TROUBLES_S: Final = 1200.0
_KINDS: Final = (
    *("move", "move", "move", "home", "prepare", "group move", "read", "command", "write", "program", "stop"),
    *("reconcile", "reconcile", "watch"),
)
_SEED: Final = 24
_PROMISES: Final = ("P1", "P2", "P3", "P6", "P9")
"""The others are held against the drives' own logs, and these do not reach back for a day."""


def draw_day(hours: float, seed: int = _SEED) -> Scenario:
    """Draw it: every drive does something every few minutes, and something befalls one of them as often."""
    random = Random(seed)
    lasts_s = hours * 3600
    drives = tuple(draw_drive(number, axis, Random(f"{seed}/{axis}"), usual=True) for number, axis in enumerate(_AXES))
    number = len(drives)
    actions: list[Action] = []
    for at_s in _times(random, lasts_s, _BETWEEN_ACTIONS_S / len(_AXES)):
        kind = random.choice(_KINDS)
        axes: Any = random.sample(_AXES, 3) if ACTIONS[kind].of_group else random.choice(_AXES)
        bases = [AXIS_APART * _AXES.index(axis) for axis in axes]
        arguments = ACTIONS[kind].draw(random, number % 100, bases)
        actions.append(Action(number=number, at_s=at_s, kind=kind, axes=tuple(axes), arguments=arguments))
        number += 1
    troubles: list[Trouble] = []
    for at_s in _times(random, lasts_s, _BETWEEN_TROUBLES_S / len(_AXES)):
        trouble = draw_trouble(random, number, at_s, _AXES)
        number += 1
        if not _ends_the_line(trouble):
            troubles.append(trouble)
    return Scenario(seed=seed, drives=drives, actions=tuple(actions), troubles=tuple(troubles))


def _ends_the_line(trouble: Trouble) -> bool:
    return trouble.kind == "cut" or trouble.arguments.get("kind") == "cut"


def _times(random: Random, lasts_s: float, apart_s: float) -> list[float]:
    times, at_s = [], 1.0
    while at_s < lasts_s:
        times.append(at_s)
        at_s += random.expovariate(1 / apart_s)
    return times


def run_day(hours: float, tell: Callable[[str], None]) -> int:
    """Run it, tell how fast it went, and what is wrong; returns the exit code."""
    began_at = time.monotonic()
    scenario = draw_day(hours)
    testimony = simulate(scenario)
    took_s = time.monotonic() - began_at
    lines = sum(len(axis.written()) for axis in testimony.axes.values())
    tell(
        f"{testimony.lasted_s / 3600:.1f} hours of {len(scenario.drives)} drives, {len(scenario.actions)} actions, "
        f"{len(scenario.troubles)} troubles, {lines} lines: {took_s:.1f} s, "
        f"{testimony.lasted_s / took_s:,.0f} simulated seconds a second"
    )
    found = [each for each in broken(testimony) if each.promise in _PROMISES]
    for each in found:
        tell(str(each))
    return 1 if found else 0
