"""What is set before a positioning and taken when it begins: speed, ramps and prepared points (UG p. 101, 162)."""

from __future__ import annotations

from compax_aio.compax.facts.limits import MAX_PREPARED_POINTS

from . import instructions as say
from .axis import Comparator, Move
from .knobs import Knobs
from .motion import SpeedStep, ramp
from .parameters import Parameters
from .refusals import POINTS_FULL, RefusedError

__all__ = ["Preparation"]


class Preparation:
    """The settings in force, and the points of the next positioning."""

    def __init__(self, knobs: Knobs, parameters: Parameters) -> None:
        self._knobs = knobs
        self._parameters = parameters
        self._points: list[say.PreparedSpeed | say.PreparedOutput] = []
        self.forget()

    def forget(self) -> None:
        """Return to P2 and P6, as at power-on (IBS p. 33)."""
        self._points.clear()
        self.speed_percent: float | None = None
        self.acceleration_ms: float | None = None
        self.deceleration_ms: float | None = None

    @property
    def points(self) -> int:
        """How many points wait for the next positioning."""
        return len(self._points)

    def prepare(self, point: say.PreparedSpeed | say.PreparedOutput) -> None:
        """
        Keep a point for the next positioning.

        Raises:
            RefusedError: There are eight already.
        """
        if len(self._points) >= MAX_PREPARED_POINTS:
            raise RefusedError(POINTS_FULL)
        self._points.append(point)

    def cancel_points(self) -> None:
        """Forget what was prepared for the next positioning."""
        self._points.clear()

    def move(self, word: str, origin: float, target: float, reports: bool) -> Move:
        """Make a positioning of all that is in force, and use up the points."""
        homing = word == "POSA HOME"
        # Preparatory commands are cancelled by finding machine zero (UG p. 101).
        steps, comparators = ((), ()) if homing else self._taken_points()
        self._points.clear()
        nominal = self._knobs.nominal_speed
        percent = self._parameters[2] if self.speed_percent is None else self.speed_percent
        acceleration_ms = self._parameters[6] if self.acceleration_ms is None else self.acceleration_ms
        braking_ms = acceleration_ms if self.deceleration_ms is None else self.deceleration_ms
        return Move(
            word=word,
            origin=origin,
            target=target,
            speed=nominal * percent / 100,
            acceleration=ramp(nominal, acceleration_ms),
            deceleration=ramp(nominal, braking_ms),
            steps=steps,
            comparators=comparators,
            signed=reports,
            reports=reports and (self._knobs.position_reached_on_home or not homing),
            homing=homing,
        )

    def _taken_points(self) -> tuple[tuple[SpeedStep, ...], tuple[Comparator, ...]]:
        """Turn the points into steps and comparators, the latter numbered in programming order."""
        steps: list[SpeedStep] = []
        comparators: list[Comparator] = []
        for place, point in enumerate(self._points, 1):
            if isinstance(point, say.PreparedSpeed):
                nominal = self._knobs.nominal_speed
                own_ramp = None if point.time_ms is None else ramp(nominal, point.time_ms)
                steps.append(SpeedStep(point.distance, nominal * point.percent / 100, own_ramp))
            else:
                number = place if self._knobs.comparator_numbering == "points" else len(comparators) + 1
                comparators.append(Comparator(number, point.distance, point.output, point.value))
        return tuple(steps), tuple(comparators)
