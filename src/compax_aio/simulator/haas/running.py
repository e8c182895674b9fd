"""What a simulated control counts and times while it machines: cycles, parts, tools, modes, positions."""

from __future__ import annotations

from math import inf
from typing import Final

from .log import LogKind
from .surroundings import Surroundings

__all__ = ["Running"]

_SPINDLE_RPM: Final = 3000.0
_POSITIONS: Final = {5021: 1.5, 5022: -2.25, 5023: -0.125, 5041: 0.5, 5042: -0.25, 5043: 0.875}


class Running:
    """
    Cycles, and what is told of them.

    Args:
        around: Of the control.

    Attributes:
        mode: ``MDI``, ``MEM``, ``JOG``, ``ZERO RET`` ...
        program: Name of the one that is chosen.
        is_cycling: A cycle runs.
        is_held: A cycle is held by FEED HOLD.
        parts: How many were made.
        m30_counts: Both counters.
        tool: In the spindle.
        tool_changes: Since power-on.
        last_cycle_s: How long the last cycle lasted.
        previous_cycle_s: How long the one before did.
        variables: System variables that were set, by number; they go ahead of what is counted here.
    """

    def __init__(self, around: Surroundings) -> None:
        self._around = around
        self.mode = "MEM"
        self.program = "O00010"
        self.is_cycling = self.is_held = False
        self.parts = 42
        self.m30_counts = [380, 380]
        self.tool = 4
        self.last_cycle_s = self.previous_cycle_s = 0.0
        self.variables: dict[int, float] = {}
        self._began_at = 0.0
        self._ends_at = inf
        self._cut_s = 0.0
        self.switch_on(0.0)

    def switch_on(self, now: float) -> None:
        """Begin anew."""
        self._on_since = now
        self.tool_changes = 35
        self._motion_s = 0.0
        self.is_cycling = self.is_held = False
        self._ends_at = inf
        self._next_begin_at = now + self._around.knobs.cycle_s if self._around.knobs.cycle_s else inf

    # Cycles

    def start(self, now: float, lasts_s: float | None = None) -> None:
        """Begin a cycle, or go on with one that is held."""
        if self.is_cycling:
            return
        if not self.is_held:
            self._cut_s = 0.0
            self.tool_changes += 1
        self._ends_at = inf if lasts_s is None else now + lasts_s
        self.is_cycling, self.is_held = True, False
        self._began_at = now
        self._around.note(LogKind.KEY, "cycle start", now)

    def stop(self, now: float) -> None:
        """End a cycle: a part is made."""
        if not (self.is_cycling or self.is_held):
            return
        self._pause(now)
        self.is_held = False
        self.parts += 1
        self.m30_counts = [count + 1 for count in self.m30_counts]
        self.previous_cycle_s, self.last_cycle_s = self.last_cycle_s, self._cut_s
        self._around.note(LogKind.KEY, "cycle stop", now)
        if self._around.knobs.cycle_s:
            self._next_begin_at = now + self._around.knobs.cycle_s

    def hold(self, now: float) -> None:
        """Hold a cycle in the middle."""
        if self.is_cycling:
            self._pause(now)
            self.is_held = True
            self._around.note(LogKind.KEY, "feed hold", now)

    def reset(self, now: float) -> None:
        """End a cycle without a part."""
        self._pause(now)
        self.is_held = False

    def _pause(self, now: float) -> None:
        if self.is_cycling:
            self._cut_s += now - self._began_at
            self._motion_s += now - self._began_at
        self.is_cycling = False
        self._ends_at = inf

    def next_at(self) -> float:
        """When a cycle begins or ends by itself."""
        if self.is_cycling:
            return self._ends_at
        return inf if self.is_held else self._next_begin_at

    def run(self, now: float) -> None:
        """Begin or end a cycle that is due."""
        if self.is_cycling and self._ends_at <= now:
            self.stop(self._ends_at)
        elif not self.is_cycling and not self.is_held and self._next_begin_at <= now:
            at, self._next_begin_at = self._next_begin_at, inf
            self.start(at, self._around.knobs.cycle_s)

    # What is told

    def power_on_s(self, now: float) -> float:
        """Return for how long it has been on."""
        return now - self._on_since

    def motion_s(self, now: float) -> float:
        """Return for how long cycles have run."""
        return self._motion_s + (now - self._began_at if self.is_cycling else 0.0)

    def variable(self, number: int, now: float) -> float | None:
        """Return a system variable that is counted here; None: it is not."""
        if number in self.variables:
            return self.variables[number]
        counted = {
            3020: self.power_on_s(now),
            3026: float(self.tool),
            3027: _SPINDLE_RPM if self.is_cycling else 0.0,
            3901: float(self.m30_counts[0]),
            3902: float(self.m30_counts[1]),
        }
        return counted.get(number, _POSITIONS.get(number))
