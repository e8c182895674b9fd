"""
Motion in closed form: how far and how fast an axis is at any time of a positioning.

Everything here counts the distance travelled since the positioning began, which only grows; where that lies on the
axis is not known here. A profile is a chain of segments of constant acceleration, so that position at a time, time at a
distance, and the end are found without integrating.
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

__all__ = ["Profile", "Segment", "SpeedStep", "plan", "ramp"]

_SHORTEST_RAMP_MS: Final = 0.1
"""The cycle of the control loop; ACCEL 0 is not infinitely steep (data sheet p. 6)."""


@dataclass(frozen=True, slots=True)
class SpeedStep:
    """From *distance* on, the axis goes for *speed*."""

    distance: float
    speed: float
    ramp: float | None = None
    """Of the change to that speed, up or down; None: as the positioning accelerates and brakes."""


@dataclass(frozen=True, slots=True)
class Segment:
    """A stretch of constant acceleration."""

    start: float
    distance: float
    """At the start."""
    speed: float
    """At the start, never negative."""
    acceleration: float
    duration: float

    def distance_after(self, seconds: float) -> float:
        """Return the distance *seconds* after the start."""
        return self.distance + seconds * (self.speed + self.acceleration * seconds / 2)

    def speed_after(self, seconds: float) -> float:
        """Return the speed *seconds* after the start."""
        return max(0.0, self.speed + self.acceleration * seconds)

    def seconds_to(self, distance: float) -> float:
        """Return how long after the start *distance* is reached, at most the duration."""
        way = distance - self.distance
        if way <= 0:
            return 0.0
        root = math.sqrt(max(0.0, self.speed**2 + 2 * self.acceleration * way))
        return min(self.duration, 2 * way / (self.speed + root)) if self.speed + root > 0 else self.duration


@dataclass(frozen=True, slots=True)
class Profile:
    """The whole course of a positioning, or of what is left of it."""

    start: float
    """Time at which it begins."""
    end: float
    """Time at which the axis stands."""
    start_distance: float
    end_distance: float
    segments: tuple[Segment, ...]
    _starts: list[float] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_starts", [segment.start for segment in self.segments])

    def distance(self, at: float) -> float:
        """Return the distance travelled at time *at*; it never shrinks."""
        if at >= self.end:
            return self.end_distance
        index = bisect.bisect_right(self._starts, at) - 1
        if index < 0:
            return self.start_distance
        segment = self.segments[index]
        following = self.segments[index + 1].distance if index + 1 < len(self.segments) else self.end_distance
        return min(max(segment.distance, segment.distance_after(at - segment.start)), following)

    def speed(self, at: float) -> float:
        """Return the speed at time *at*."""
        segment = self._segment(at)
        return segment.speed_after(at - segment.start) if segment else 0.0

    def acceleration(self, at: float) -> float:
        """Return the acceleration at time *at*, negative while braking."""
        segment = self._segment(at)
        return segment.acceleration if segment else 0.0

    def time_at(self, distance: float) -> float:
        """Return when *distance* is passed: the start if that was before, the end if it is never."""
        if distance >= self.end_distance:
            return self.end
        index = bisect.bisect_right(self.segments, distance, key=lambda segment: segment.distance) - 1
        if index < 0:
            return self.start
        segment = self.segments[index]
        return segment.start + segment.seconds_to(distance)

    def stopped(self, at: float, deceleration: float) -> Profile:
        """Return this profile with a stop ramp from time *at* on, steeper if it would else pass the end."""
        distance, speed = self.distance(at), self.speed(at)
        way = min(self.end_distance - distance, speed**2 / (2 * deceleration))
        return self.followed_by(
            _closed(
                segments=(),
                start=at,
                start_distance=distance,
                at=at,
                distance=distance,
                speed=speed,
                end_distance=distance + way,
            )
        )

    def followed_by(self, later: Profile, since: float = -math.inf) -> Profile:
        """Return this profile until *later* begins, and that from then on; what ended before *since* is left out."""
        passed = [each for each in self.segments if each.start < later.start and each.start + each.duration > since]
        if not passed:
            return later
        passed[-1] = replace(passed[-1], duration=min(passed[-1].duration, later.start - passed[-1].start))
        return Profile(passed[0].start, later.end, passed[0].distance, later.end_distance, (*passed, *later.segments))

    def _segment(self, at: float) -> Segment | None:
        if not self.start <= at < self.end:
            return None
        return self.segments[bisect.bisect_right(self._starts, at) - 1]


def ramp(nominal_speed: float, time_ms: float) -> float:
    """Return the acceleration that reaches *nominal_speed* in *time_ms* (IBS p. 48)."""
    return nominal_speed / (max(time_ms, _SHORTEST_RAMP_MS) / 1000)


def plan(
    *,
    start: float,
    length: float,
    speed: float,
    acceleration: float,
    deceleration: float,
    steps: Sequence[SpeedStep] = (),
    travelled: float = 0.0,
    speed_now: float = 0.0,
) -> Profile:
    """
    Plan a positioning over *length*, *travelled* of which lies behind already, from *speed_now* on.

    From that speed it must be possible to brake for *length*.

    At the distance of each step the axis begins to change to the speed of that step; it always brakes early enough
    to stand exactly at *length*.
    """
    segments: list[Segment] = []
    at, distance, now_speed = start, travelled, speed_now
    for end, end_speed, rate in _stretches(
        length=length,
        speed=speed,
        steps=steps,
        travelled=travelled,
        speed_now=speed_now,
        acceleration=acceleration,
        deceleration=deceleration,
    ):
        if end > distance:
            duration = 2 * (end - distance) / (now_speed + end_speed)
            segments.append(Segment(at, distance, now_speed, rate, duration))
            at, distance = at + duration, end
        now_speed = end_speed
    return _closed(
        segments=segments,
        start=start,
        start_distance=travelled,
        at=at,
        distance=distance,
        speed=now_speed,
        end_distance=length,
    )


def _stages(
    length: float, speed: float, steps: Sequence[SpeedStep], travelled: float
) -> Iterator[tuple[float, SpeedStep]]:
    """List the stretches between steps that still lie ahead: where each ends, and the step that rules it."""
    ruling = SpeedStep(0.0, speed)
    for step in sorted(steps, key=lambda step: step.distance):
        end = min(step.distance, length)
        if end > travelled:
            yield end, ruling
        if step.distance >= length:
            return
        ruling = step
    if length > travelled:
        yield length, ruling


def _stretches(
    *,
    length: float,
    speed: float,
    steps: Sequence[SpeedStep],
    travelled: float,
    speed_now: float,
    acceleration: float,
    deceleration: float,
) -> Iterator[tuple[float, float, float]]:
    """List what comes before the final braking: the end of each stretch, the speed there, and the acceleration."""
    distance, now_speed = travelled, speed_now
    for stage_end, stage in _stages(length, speed, steps, travelled):
        stage_speed = stage.speed
        if now_speed != stage_speed:
            rate = (stage.ramp or acceleration) if now_speed < stage_speed else -(stage.ramp or deceleration)
            changed = distance + (stage_speed**2 - now_speed**2) / (2 * rate)
            # Where this ramp meets the one that ends at the target; who brakes as hard or harder never meets it.
            meets = length
            if rate + deceleration > 0:
                meets = (2 * deceleration * length - now_speed**2 + 2 * rate * distance) / (2 * (rate + deceleration))
            end = max(distance, min(changed, meets, stage_end))
            if changed > end:
                now_speed = math.sqrt(max(0.0, now_speed**2 + 2 * rate * (end - distance)))
                distance = end
                yield end, now_speed, rate
                if meets <= stage_end:
                    return
                continue
            now_speed, distance = stage_speed, end
            yield end, stage_speed, rate
        meets = length - stage_speed**2 / (2 * deceleration)
        distance = max(distance, min(meets, stage_end))
        yield distance, stage_speed, 0.0
        if meets <= stage_end:
            return


def _closed(
    *,
    segments: Sequence[Segment],
    start: float,
    start_distance: float,
    at: float,
    distance: float,
    speed: float,
    end_distance: float,
) -> Profile:
    """Make the profile of *segments*, which lead to *at*, and of the braking from there to *end_distance*."""
    way = end_distance - distance
    if speed <= 0 or way <= 0:
        return Profile(start, at, start_distance, end_distance, tuple(segments))
    brake = Segment(at, distance, speed, -(speed**2) / (2 * way), 2 * way / speed)
    return Profile(start, at + brake.duration, start_distance, end_distance, (*segments, brake))
