"""A day of eight drives with troubles in one long scenario, and how fast it went."""

from __future__ import annotations

import time
from collections.abc import Callable
from random import Random
from typing import Any, Final

from compax_aio.compax.settings import DriveSettings
from compax_aio.simulator.compax.knobs import Knobs

from .actions import ACTIONS
from .drawing import AXIS_APART, draw_trouble
from .promises import broken
from .scenario import Action, DrivePlan, Scenario, Trouble
from .simulation import simulate

__all__ = ["draw_day", "run_day"]

_AXES: Final = "xyzwabcd"
_SPARED: Final = "d"
"""Nothing befalls its line, and no group moves it: it shall be what it is without the others."""
_BETWEEN_ACTIONS_S: Final = 100.0
"""Of one drive."""
_BETWEEN_TROUBLES_S: Final = 180.0
"""Of all."""
_WATCHED_EVERY_S: Final = 10.0
_KINDS: Final = (
    *("move",) * 8,
    *("home", "prepare", "prepare", "group move", "read", "command", "write", "program", "stop", "events"),
    *("reconcile", "reconcile"),
)
_SEED: Final = 24
_LOG_ENTRIES: Final = 2_000_000
_LONGEST_TOLD: Final = 600


def draw_day(hours: float, seed: int = _SEED) -> Scenario:
    """Draw it: every drive is watched, does something every minute or two, and troubles come."""
    random = Random(seed)
    lasts_s = hours * 3600
    drives = tuple(_drive(number, axis) for number, axis in enumerate(_AXES))
    actions = [_watch(number, axis, lasts_s) for number, axis in enumerate(_AXES, len(drives))]
    for at_s in _times(random, lasts_s, _BETWEEN_ACTIONS_S / len(_AXES)):
        kind = random.choice(_KINDS)
        axes: Any = random.sample(_AXES.replace(_SPARED, ""), 3) if ACTIONS[kind].of_group else random.choice(_AXES)
        bases = [AXIS_APART * _AXES.index(axis) for axis in axes]
        number = len(drives) + len(actions)
        arguments = ACTIONS[kind].draw(random, number % 100, bases)
        actions.append(Action(number=number, at_s=at_s, kind=kind, axes=tuple(axes), arguments=arguments))
    troubles: list[Trouble] = []
    for at_s in _times(random, lasts_s, _BETWEEN_TROUBLES_S):
        number = len(drives) + len(actions) + len(troubles)
        trouble = draw_trouble(random, number, at_s, _AXES.replace(_SPARED, ""), reconnecting=True)
        if trouble.axes:  # what stalls the event loop befalls all of them
            troubles.append(trouble)
    return Scenario(seed=seed, drives=drives, actions=tuple(actions), troubles=tuple(troubles))


def _drive(number: int, axis: str) -> DrivePlan:
    settings = DriveSettings(answer_timeout_s=0.5, poll_first_s=1.0, poll_slowest_s=5.0)
    return DrivePlan(number=number, axis=axis, knobs=Knobs(position=AXIS_APART * number), settings=settings)


def _watch(number: int, axis: str, lasts_s: float) -> Action:
    readings = max(1, int(lasts_s / _WATCHED_EVERY_S) - 1)
    arguments = {"quantities": ("position",), "interval_s": _WATCHED_EVERY_S, "readings": readings}
    return Action(number=number, at_s=0.5, kind="watch", axes=(axis,), arguments=arguments)


def _times(random: Random, lasts_s: float, apart_s: float) -> list[float]:
    times, at_s = [], 1.0
    while at_s < lasts_s:
        times.append(at_s)
        at_s += random.expovariate(1 / apart_s)
    return times


def run_day(hours: float, tell: Callable[[str], None]) -> int:
    """Run it, hold it against every promise, and tell how fast that went; returns the exit code."""
    began_at = time.monotonic()
    scenario = draw_day(hours)
    testimony = simulate(scenario, log_entries=_LOG_ENTRIES)
    ran_s = time.monotonic() - began_at
    found = broken(testimony)
    took_s = time.monotonic() - began_at
    lines = sum(len(axis.written()) for axis in testimony.axes.values())
    tell(
        f"{testimony.lasted_s / 3600:.1f} hours of {len(scenario.drives)} drives, {len(scenario.actions)} actions, "
        f"{len(scenario.troubles)} troubles, {lines} lines: {took_s:.1f} s, {took_s - ran_s:.1f} s of them to hold it "
        f"against the promises; {testimony.lasted_s / took_s:,.0f} simulated seconds a second"
    )
    for each in found:
        tell(str(each)[:_LONGEST_TOLD])
    return 1 if found else 0
