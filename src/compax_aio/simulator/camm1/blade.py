"""The blade on its way: how long a step takes, where it is within it, and what it leaves behind."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot

from compax_aio.camm1.facts.line import MAX_COORDINATE

from .cuttings import Cuttings
from .knobs import Knobs
from .shapes import Point, clipped
from .tool import Step, Stop

__all__ = ["Blade"]


class Blade:
    """
    Makes the vectors of steps.

    Args:
        knobs: Of the cutter.

    Attributes:
        cuttings: What lies on the machine.
        factor: Everything takes so many times as long.
        has_drawn: Something was cut since power-on.
    """

    def __init__(self, knobs: Knobs) -> None:
        self.cuttings = Cuttings()
        self.factor = knobs.time_factor
        self.has_drawn = False
        self._vector_time_s = knobs.vector_time_s
        self._edge = (knobs.area_x or MAX_COORDINATE, knobs.area_y or MAX_COORDINATE)
        self._made_before = 0
        self._low: Point = (0.0, 0.0)
        self._high: Point = self._edge

    # Time

    def duration_s(self, step: Step) -> float:
        """Return how long a step takes."""
        return sum(self._durations_s(step)) * self.factor

    def _durations_s(self, step: Step) -> list[float]:
        x, y, _ = step.begins
        each_s = self._vector_time_s
        travel, speed = step.speeds
        durations = []
        for to_x, to_y, is_down in step.stops:
            durations.append(hypot(to_x - x, to_y - y) / (speed if is_down else travel) + each_s)
            x, y = to_x, to_y
        return durations

    def reached(self, step: Step, elapsed_s: float) -> tuple[int, Stop]:
        """Return how many vectors of a step are whole after that time, and where the tool is."""
        x, y, was_down = step.begins
        durations = self._durations_s(step)
        for count, (to_x, to_y, is_down) in enumerate(step.stops):
            lasts_s = durations[count] * self.factor
            if elapsed_s < lasts_s:
                part = max(0.0, elapsed_s / lasts_s)
                return count, (x + part * (to_x - x), y + part * (to_y - y), is_down)
            elapsed_s -= lasts_s
            x, y, was_down = to_x, to_y, is_down
        return len(step.stops), (x, y, was_down)

    # What stays

    def leave(self, step: Step, window: Sequence[float] | None) -> None:
        """Keep what a step leaves behind, within a window."""
        if step.mark is not None:
            self.cuttings.mark(*step.mark, step.begins[0], step.begins[1])
        if not step.stops:
            return
        self._made_before = self.cuttings.vectors.total
        if window is None:
            self._low, self._high = (0.0, 0.0), self._edge
        else:
            self._low = (max(0.0, window[0]), max(0.0, window[1]))
            self._high = (min(self._edge[0], window[2]), min(self._edge[1], window[3]))
        self._make(step, step.stops)

    def cut_short(self, step: Step, elapsed_s: float) -> None:
        """Take back what is not cut yet of the step that was left last."""
        count, (x, y, is_down) = self.reached(step, elapsed_s)
        made = list(step.stops[:count])
        if count < len(step.stops):
            made.append((round(x), round(y), is_down))
        self.cuttings.vectors.take_back_to(self._made_before)
        self._make(step, made)

    def _make(self, step: Step, stops: Sequence[Stop]) -> None:
        move, state = self.cuttings.vectors.move, step.state
        low_x, low_y = self._low
        high_x, high_y = self._high
        x, y, _ = step.begins
        is_inside = low_x <= x <= high_x and low_y <= y <= high_y
        for to_x, to_y, is_down in stops:
            was_inside = is_inside
            is_inside = low_x <= to_x <= high_x and low_y <= to_y <= high_y
            if not is_down:
                move(int(to_x), int(to_y), state)
            elif was_inside and is_inside:
                move(int(to_x), int(to_y), state | 1)
                self.has_drawn = True
            else:
                self._make_partly((x, y), (to_x, to_y), state)
            x, y = to_x, to_y

    def _make_partly(self, begin: Point, end: Point, state: int) -> None:
        """Cut what lies in the window, and go over the rest with the tool up."""
        move = self.cuttings.vectors.move
        part = clipped(begin, end, self._low, self._high)
        if part is not None:
            (first_x, first_y), (last_x, last_y) = ((round(x), round(y)) for x, y in part)
            if begin[0] != first_x or begin[1] != first_y:
                move(first_x, first_y, state)
            move(last_x, last_y, state | 1)
            self.has_drawn = True
            if end[0] == last_x and end[1] == last_y:
                return
        move(int(end[0]), int(end[1]), state)
