"""Motion in closed form: where a stepping axis is and how fast, at any time, without counting a step."""

from __future__ import annotations

import bisect
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

__all__ = ["Course", "Leg", "Ramps", "constant", "index", "standing"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Ramps:
    """How an axis changes its speed: at once up to *base*, above that at these rates; times in s, ways in steps."""

    base: float
    """Steps/s from which and to which it can jump."""
    up: float
    """Steps/s²; infinite: no ramp."""
    down: float


@dataclass(frozen=True, slots=True)
class Leg:
    """A stretch of constant acceleration in one direction; speeds have the sign of the direction."""

    start: float
    position: float
    speed: float
    end: float
    end_position: float
    end_speed: float

    @property
    def ramping(self) -> bool:
        """Whether the speed changes."""
        return self.speed != self.end_speed

    def position_at(self, at: float) -> float:
        """Return where the axis is, never outside of this leg."""
        after = at - self.start
        way = after * self.speed
        if self.ramping:
            way += after * after * (self.end_speed - self.speed) / (self.end - self.start) / 2
        low, high = sorted((self.position, self.end_position))
        return min(max(self.position + way, low), high)

    def speed_at(self, at: float) -> float:
        """Return how fast it is, in steps/s."""
        if not self.ramping:
            return self.speed
        return self.speed + (self.end_speed - self.speed) * (at - self.start) / (self.end - self.start)

    def cut_at_position(self, position: float) -> Leg:
        """Return this leg as far as *position*, which lies on it."""
        way = position - self.position
        if not self.ramping:
            return replace(self, end=self.start + way / self.speed, end_position=position)
        rate = (self.end_speed - self.speed) / (self.end - self.start)
        speed = math.copysign(math.sqrt(max(0.0, self.speed**2 + 2 * rate * way)), self.speed)
        after = 2 * way / (self.speed + speed) if way else 0.0
        return replace(self, end=min(self.end, self.start + after), end_position=position, end_speed=speed)


@dataclass(frozen=True, slots=True)
class Course:
    """A motion from its beginning until the axis stands, or for ever."""

    start: float
    position: float
    legs: tuple[Leg, ...]
    _starts: list[float] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_starts", [leg.start for leg in self.legs])

    @property
    def end(self) -> float:
        """When the axis stands; infinite: never."""
        return self.legs[-1].end if self.legs else self.start

    @property
    def end_position(self) -> float:
        """Where it stands then."""
        return self.legs[-1].end_position if self.legs else self.position

    @property
    def steady_at(self) -> float:
        """When the speed has become what it stays, be it 0."""
        return self.legs[-1].start if self.legs and math.isinf(self.legs[-1].end) else self.end

    def leg_at(self, at: float) -> Leg | None:
        """Return the leg that the axis is on; None: it stands."""
        if not self.start <= at < self.end:
            return None
        return self.legs[bisect.bisect_right(self._starts, at) - 1]

    def position_at(self, at: float) -> float:
        """Return where the axis is."""
        leg = self.leg_at(at)
        if leg is not None:
            return leg.position_at(at)
        return self.end_position if at >= self.end else self.position

    def speed_at(self, at: float) -> float:
        """Return its speed, with a sign."""
        leg = self.leg_at(at)
        return leg.speed_at(at) if leg is not None else 0.0

    def within(self, low: float, high: float) -> Course:
        """Return this course as far as it leads neither below *low* nor above *high*; who is beyond can come back."""
        for place, leg in enumerate(self.legs):
            bound = high if leg.speed + leg.end_speed > 0 else low
            if (leg.end_position - bound) * (leg.speed + leg.end_speed) > 0:
                return self._cut(place, bound)
        return self

    def followed_by(self, later: Course) -> Course:
        """Return this course and, from its end on, another one."""
        return replace(self, legs=(*self.legs, *later.legs))

    def _cut(self, place: int, bound: float) -> Course:
        leg = self.legs[place]
        if (leg.position - bound) * (leg.speed + leg.end_speed) >= 0:
            return replace(self, legs=self.legs[:place])
        return replace(self, legs=(*self.legs[:place], leg.cut_at_position(bound)))


def standing(at: float, position: float) -> Course:
    """Return the course of an axis that does not move."""
    return Course(at, position, ())


def constant(at: float, position: float, speed_now: float, speed: float, ramps: Ramps) -> Course:
    """Plan a change from one speed to another, which then lasts; to 0 or into the other direction by way of a stop."""
    legs: list[Leg] = []
    where = (at, position)
    if speed_now * speed <= 0:
        for first, last in _slowing(abs(speed_now), ramps.base):
            where = _add(legs, where, math.copysign(1, speed_now), (first, last), ramps)
        speed_now = 0.0
    if speed:
        sign = math.copysign(1, speed)
        first = max(abs(speed_now), min(ramps.base, abs(speed)))
        last = max(abs(speed), min(ramps.base, first))
        where = _add(legs, where, sign, (first, last), ramps)
        legs.append(Leg(*where, speed, math.inf, sign * math.inf, speed))
    return Course(at, position, tuple(legs))


def index(at: float, position: float, speed_now: float, *, target: float, speed: float, ramps: Ramps) -> Course:
    """Plan a move to *target* at up to *speed*; an axis that moves is stopped first."""
    stopping = constant(at, position, speed_now, 0.0, ramps)
    legs = list(stopping.legs)
    where = (stopping.end, stopping.end_position)
    way = target - where[1]
    sign = math.copysign(1, way)
    base = min(ramps.base, speed)
    for first, last, length in _trapezoid(abs(way), base, speed, ramps):
        where = _append(legs, where, sign, (first, last), length)
    if legs and way:
        legs[-1] = replace(legs[-1], end_position=target)
    return Course(at, position, tuple(legs))


def _slowing(speed: float, base: float) -> Sequence[tuple[float, float]]:
    """List the ramps of a stop: one, unless the axis can stand at once."""
    return [(speed, base)] if speed > base else []


def _trapezoid(way: float, base: float, speed: float, ramps: Ramps) -> Iterator[tuple[float, float, float]]:
    """List the speeds at the ends of each leg of a move, and how long it is."""
    up, down = 1 / (2 * ramps.up), 1 / (2 * ramps.down)
    if (speed**2 - base**2) * (up + down) > way:
        speed = math.sqrt(base**2 + way / (up + down))
    rise, fall = (speed**2 - base**2) * up, (speed**2 - base**2) * down
    yield base, speed, rise
    yield speed, speed, way - rise - fall
    yield speed, base, fall


def _add(
    legs: list[Leg], where: tuple[float, float], sign: float, speeds: tuple[float, float], ramps: Ramps
) -> tuple[float, float]:
    """Append the ramp between two speeds; return when and where it ends."""
    first, last = speeds
    rate = ramps.up if last > first else ramps.down
    return _append(legs, where, sign, speeds, abs(last**2 - first**2) / (2 * rate))


def _append(
    legs: list[Leg], where: tuple[float, float], sign: float, speeds: tuple[float, float], length: float
) -> tuple[float, float]:
    """Append a leg, unless it has no length; return when and where it ends."""
    if length <= 0:
        return where
    at, position = where
    end = (at + 2 * length / sum(speeds), position + sign * length)
    legs.append(Leg(at, position, sign * speeds[0], *end, sign * speeds[1]))
    return end
