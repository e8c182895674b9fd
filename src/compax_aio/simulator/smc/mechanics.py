"""The axis of a controller: its position, its motion, its switches, and when an action is over."""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import Enum
from typing import Final

from compax_aio.smc.facts import MAX_POSITION, MotionFlags

from .log import Ending, LogKind
from .memory import Parameters
from .motion import Course, Ramps, constant, index, standing
from .surroundings import Surroundings

__all__ = ["Mechanics"]


_NOTHING: Final = 1e-6
"""Steps; less is an error of calculation."""


class _Kind(Enum):
    INDEX = MotionFlags.MOVING
    CONSTANT = MotionFlags.MOVING | MotionFlags.CONSTANT_SPEED
    HOMING = MotionFlags.MOVING | MotionFlags.CONSTANT_SPEED | MotionFlags.HOMING
    """A user of a 789A-4 saw 43: with a ramp."""


class Mechanics:
    """
    One axis.

    Places are where it stands, which nothing but motion changes; positions are what it reads, and depend on the origin.

    Args:
        around: Time, switches, and the log, which is told when a motion begins and ends.
        parameters: Are those that are valid now.
        changed: Is called when an action is over, or the axis stands.
    """

    def __init__(self, around: Surroundings, parameters: Callable[[], Parameters], changed: Callable[[], None]) -> None:
        self._around = around
        self._agenda = around.agenda
        self._knobs = around.knobs
        self._parameters = parameters
        self._changed = changed
        self._origin = 0.0
        self._kind = _Kind.INDEX
        self._course = standing(0.0, around.knobs.position)
        self._ending = Ending.TARGET
        self._moving = False
        self._busy_until = self._hunts_until = -math.inf

    # What can be read

    @property
    def place(self) -> float:
        """Where the axis stands or passes by."""
        return self._course.position_at(self._agenda.now)

    @property
    def position(self) -> float:
        """What Z reads: steps from the origin, finer than Z tells."""
        return self.place - self._origin

    @property
    def speed(self) -> float:
        """Steps per second."""
        return self._course.speed_at(self._agenda.now)

    @property
    def moving(self) -> bool:
        """Whether the axis steps."""
        return self._moving

    @property
    def busy(self) -> bool:
        """Whether an action is not complete, so that the next one waits (DCB p. 27)."""
        return self._agenda.now < self._busy_until

    @property
    def flags(self) -> MotionFlags:
        """The answer to ``^``."""
        if not self._moving:
            return MotionFlags.HUNTING if self._agenda.now < self._hunts_until else MotionFlags(0)
        leg = self._course.leg_at(self._agenda.now)
        ramping = MotionFlags.RAMPING if leg is not None and leg.ramping else MotionFlags(0)
        return MotionFlags(self._kind.value) | ramping

    @property
    def at_home(self) -> bool:
        """Whether the home switch is on."""
        return abs(self.place - self._knobs.home) <= self._knobs.home_width / 2 + _NOTHING

    @property
    def limits(self) -> tuple[bool, bool]:
        """Whether the minus and the plus limit switch seem to be on."""
        low, high = self.place <= self._knobs.limit_min, self.place >= self._knobs.limit_max
        return (low, high) if self._limits_are_right else (not low, not high)

    # What can be done

    def index(self, target: float, text: str) -> None:
        """Go to a position."""
        most = MAX_POSITION if self._knobs.decimals else math.floor(MAX_POSITION)
        target = min(max(target, -most), most) + self._origin
        parameters, now = self._parameters(), self._agenda.now
        course = index(now, self.place, self.speed, target=target, speed=parameters.slew_speed, ramps=self._ramps())
        self._begin(_Kind.INDEX, course, text)

    def run_at(self, speed: float, text: str) -> None:
        """Go at a speed until something else is said; the action is over when the speed is reached."""
        if self._moving or speed:
            self._begin(_Kind.CONSTANT, constant(self._agenda.now, self.place, self.speed, speed, self._ramps()), text)

    def find_home(self, speed: float, text: str) -> None:
        """Go until the home switch is on; a negative speed leads to minus."""
        stopping = constant(self._agenda.now, self.place, self.speed, 0.0, self._ramps())
        search = constant(stopping.end, stopping.end_position, 0.0, speed, self._ramps())
        half = self._knobs.home_width / 2
        near = self._knobs.home - math.copysign(half, speed)
        if abs(search.position - self._knobs.home) <= half:
            search = standing(search.start, search.position)
        elif (near - search.position) * speed > 0:
            search = search.within(near, math.inf) if speed < 0 else search.within(-math.inf, near)
        self._begin(_Kind.HOMING, stopping.followed_by(search), text)

    def stop(self) -> None:
        """Stop with a ramp; an action under way is over when the axis stands."""
        if self._moving:
            self._plan(constant(self._agenda.now, self.place, self.speed, 0.0, self._ramps()), Ending.STOP)

    def halt(self, why: Ending) -> None:
        """Stand at once."""
        self._hunts_until = -math.inf
        if self._moving:
            self._course = standing(self._agenda.now, self.place)
            self._ended(why)

    def set_origin(self, position: float) -> None:
        """Let the position here and now be that."""
        self._origin = self._on_a_step(self.place) - position

    def put_at(self, place: float) -> None:
        """Stand somewhere else, as after somebody turned the motor without power; the position counts on from there."""
        self.halt(Ending.RESET)
        self._course = standing(self._agenda.now, place)

    # How it goes

    @property
    def _limits_are_right(self) -> bool:
        return self._parameters().limit_polarity == self._knobs.limit_level

    def _ramps(self) -> Ramps:
        parameters, unit = self._parameters(), self._knobs.slope_unit
        return Ramps(
            base=parameters.initial_speed,
            up=unit / parameters.slope_up if parameters.slope_up else math.inf,
            down=unit / parameters.slope_down if parameters.slope_down else math.inf,
        )

    def _begin(self, kind: _Kind, course: Course, text: str) -> None:
        self._kind = kind
        self._hunts_until = -math.inf
        self._around.note(LogKind.MOTION_STARTED, text, self.position)
        self._plan(course, Ending.TARGET)

    def _plan(self, course: Course, ending: Ending) -> None:
        """Let the axis go that way, as far as the limit switches allow."""
        low, high = self._knobs.limit_min, self._knobs.limit_max
        if not self._limits_are_right:
            low = high = self.place
        self._course = course.within(low, high)
        self._ending = ending if self._course is course else Ending.LIMIT
        self._moving = True
        self._busy_until = min(course.steady_at, self._course.end)
        self._agenda.put((self, "end"), self._course.end, lambda: self._ended(self._ending))
        self._agenda.put((self, "steady"), self._busy_until, self._changed)

    def _ended(self, why: Ending) -> None:
        now = self._agenda.now
        self._agenda.drop((self, "end"))
        self._agenda.drop((self, "steady"))
        self._moving = False
        self._busy_until = -math.inf
        place = self._course.end_position
        self._course = standing(now, place if why is Ending.LIMIT or self.at_home else self._on_a_step(place))
        if why is Ending.TARGET and self._kind is _Kind.INDEX:
            self._hunts_until = now + self._knobs.hunt_time_s
        self._around.note(LogKind.MOTION_ENDED, why, self.position)
        self._changed()

    def _on_a_step(self, place: float) -> float:
        """Return the next place at which a stepper stands."""
        return self._origin + round(place - self._origin, self._knobs.decimals)
