"""The axis: where it is, the positioning under way, and what happens at which time of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

from .motion import Profile, SpeedStep, plan

__all__ = ["Axis", "Comparator", "ComparatorPassed", "Move", "MoveEnded", "Outcome"]


@dataclass(frozen=True, slots=True)
class Comparator:
    """Sets an output at a distance from the start of the positioning."""

    number: int
    """Sent when it is passed."""
    distance: float
    output: int
    value: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Move:
    """A positioning with all that was in force when its command came."""

    word: str
    origin: float
    target: float
    speed: float
    acceleration: float
    deceleration: float
    steps: tuple[SpeedStep, ...] = ()
    comparators: tuple[Comparator, ...] = ()
    """Those not passed yet."""
    signed: bool = False
    """The command carried ``$``."""
    reports: bool = False
    """``$`` is still to be sent."""
    homing: bool = False
    travelled: float = 0.0
    """Distance that lies behind when it continues after STOP."""

    @property
    def length(self) -> float:
        """The whole distance."""
        return abs(self.target - self.origin)

    def position(self, distance: float) -> float:
        """Return where the axis is after *distance*, exactly the target at the end."""
        if distance >= self.length:
            return self.target
        return self.origin + (distance if self.target > self.origin else -distance)


class Outcome(Enum):
    """How a positioning ends."""

    REACHED = "at its target"
    STOPPED = "by STOP; START continues it"
    BROKEN = "by BREAK"
    FAULT = "by a fault, or without power"


@dataclass(frozen=True, slots=True)
class ComparatorPassed:
    """The axis has come to a comparator."""

    comparator: Comparator


@dataclass(frozen=True, slots=True)
class MoveEnded:
    """The axis stands."""

    move: Move
    outcome: Outcome


class Axis:
    """One axis; time only goes forward, in steps of any size."""

    def __init__(self, position: float, time_lag_s: float) -> None:
        self._rest = position
        self._time_lag_s = time_lag_s
        self._move: Move | None = None
        self._profile: Profile | None = None
        self._outcome = Outcome.REACHED
        self._catches_up = 1.0
        self._due: list[tuple[float, Comparator]] = []

    @property
    def move(self) -> Move | None:
        """The positioning under way; None when the axis stands."""
        return self._move

    @property
    def outcome(self) -> Outcome:
        """How the positioning under way is going to end."""
        return self._outcome

    def setpoint(self, now: float) -> float:
        """Return where the axis is told to be."""
        if self._move is None or self._profile is None:
            return self._rest
        return self._move.position(self._profile.distance(now))

    def position(self, now: float) -> float:
        """Return where the axis is: it lags behind while it moves, and has caught up when it stands."""
        if self._move is None or self._profile is None:
            return self._rest
        return self._move.position(self._profile.distance(now - self._lag_s(now)))

    def speed(self, now: float) -> float:
        """Return the speed in units per second, negative towards smaller positions."""
        return self._direction * self._profile.speed(now) if self._profile else 0.0

    def acceleration(self, now: float) -> float:
        """Return the acceleration in units per second squared, with the sign of its direction."""
        return self._direction * self._profile.acceleration(now) if self._profile else 0.0

    def start(self, move: Move, now: float) -> None:
        """Begin a positioning, or what is left of it, from standstill."""
        self._move = move
        self._outcome = Outcome.REACHED
        self._catches_up = 1.0
        self._follow(_planned(move, now, move.travelled, 0.0))

    def change_speed(self, speed: float, now: float) -> None:
        """Go on at *speed* in units per second until the next step ahead; after STOP that is for what START does."""
        assert self._move is not None
        assert self._profile is not None
        travelled = self._profile.distance(now)
        ahead = (step for step in self._move.steps if step.distance > travelled)
        self._move = replace(self._move, steps=(SpeedStep(travelled, speed), *ahead))
        if self._outcome is Outcome.REACHED:
            later = _planned(self._move, now, travelled, self._profile.speed(now))
            self._go_over_to(self._profile.followed_by(later, since=now - self._time_lag_s), now)

    def stop(self, now: float, deceleration: float, outcome: Outcome) -> None:
        """End the positioning under way before its target; a second stop only changes what comes after it."""
        if self._profile is None:
            return
        if self._outcome is Outcome.REACHED:
            self._go_over_to(self._profile.stopped(now, deceleration), now)
        self._outcome = outcome

    def freeze(self, now: float) -> MoveEnded | None:
        """Stand still at once, as without power."""
        if self._profile is None:
            return None
        self._outcome = Outcome.FAULT
        self._profile = self._profile.stopped(now, float("inf"))
        return self._end()

    def put(self, position: float) -> None:
        """Call the place where the axis stands *position* from now on."""
        self._rest = position

    def next_event_at(self) -> float | None:
        """Return the time of the next comparator or of the end."""
        if self._profile is None:
            return None
        return min(self._due[0][0], self._profile.end) if self._due else self._profile.end

    def step(self) -> ComparatorPassed | MoveEnded:
        """Let the next event, which must be due, happen."""
        assert self._move is not None
        if not self._due:
            return self._end()
        _, passed = self._due.pop(0)
        ahead = tuple(each for each in self._move.comparators if each is not passed)
        self._move = replace(self._move, comparators=ahead)
        return ComparatorPassed(passed)

    def _lag_s(self, now: float) -> float:
        """Return the time by which the axis lags behind; it has caught up at the end."""
        assert self._profile is not None
        return min(self._time_lag_s, self._catches_up * max(0.0, self._profile.end - now))

    def _go_over_to(self, profile: Profile, now: float) -> None:
        """Follow another profile on the way; the axis goes on lagging as it did, so that its position never jumps."""
        lag_s, left_s = self._lag_s(now), profile.end - now
        self._catches_up = lag_s / left_s if left_s > 0 and min(lag_s, left_s) < self._time_lag_s else 1.0
        self._follow(profile)

    def _follow(self, profile: Profile) -> None:
        """Go on with *profile*, and look when it passes the comparators ahead."""
        assert self._move is not None
        self._profile = profile
        self._due = sorted(
            (
                (profile.time_at(comparator.distance), comparator)
                for comparator in self._move.comparators
                if comparator.distance <= profile.end_distance
            ),
            key=lambda due: (due[0], due[1].number),
        )

    def _end(self) -> MoveEnded:
        assert self._move is not None
        assert self._profile is not None
        move = replace(self._move, travelled=self._profile.end_distance)
        self._rest = move.position(move.travelled)
        self._move = self._profile = None
        self._due = []
        return MoveEnded(move, self._outcome)

    @property
    def _direction(self) -> int:
        return -1 if self._move is not None and self._move.target < self._move.origin else 1


def _planned(move: Move, start: float, travelled: float, speed: float) -> Profile:
    """Plan what is left of *move*."""
    return plan(
        start=start,
        length=move.length,
        speed=move.speed,
        acceleration=move.acceleration,
        deceleration=move.deceleration,
        steps=move.steps,
        travelled=travelled,
        speed_now=speed,
    )
