"""The numbers behind the status values S1-S15, and those that S13, S14 and S15 can be told to show."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Final

from .motion import ramp
from .refusals import SYNTAX, RefusedError

if TYPE_CHECKING:
    from .machine import Machine

__all__ = ["QUANTITIES", "SELECTABLE", "status_number"]


def status_number(machine: Machine, number: int, now: float) -> float:
    """
    Return S1-S15 as a number.

    Raises:
        RefusedError: There is no such number.
    """
    if number not in QUANTITIES:
        raise RefusedError(SYNTAX)
    return QUANTITIES[number][0](machine, now)


def _fixed(value: float) -> Callable[[Machine, float], float]:
    """Return something plausible that never changes."""
    return lambda *_: value


def _speed_percent(machine: Machine, now: float) -> float:
    return 100 * machine.axis.speed(now) / machine.knobs.nominal_speed


def _torque_percent(machine: Machine, now: float) -> float:
    """5 % of friction, and 20 % to reach nominal speed in 250 ms: plausible, no more."""
    speed, acceleration = machine.axis.speed(now), machine.axis.acceleration(now)
    friction = 5.0 if speed > 0 else -5.0 if speed < 0 else 0.0
    return max(-300.0, min(300.0, friction + 20 * acceleration / ramp(machine.knobs.nominal_speed, 250)))


def _chosen(parameter: int) -> Callable[[Machine, float], float]:
    """Return the quantity that a parameter chooses by its number."""

    def value(machine: Machine, now: float) -> float:
        quantity = SELECTABLE.get(int(machine.parameters[parameter]))
        return 0.0 if quantity is None else quantity(machine, now)

    return value


SELECTABLE: Final[Mapping[int, Callable[[Machine, float], float]]] = {
    27: lambda machine, now: machine.axis.position(now),  # the external encoder: it measures the axis itself
    28: _fixed(0),  # so nothing is between it and the resolver
    29: _fixed(30),  # load of the motor in %; E53 comes from 100 on
    30: _fixed(25),  # load of the unit in %; likewise
}
"""
What S13, S14 and S15 show by the numbers in P233, P234 and P182 (UG p. 211).

Of all other numbers this is 0: 1-16 stand on a page that was not available, and the rest is HEDA, variants XX50 and
XX70 and the monitor outputs, which are not simulated.
"""

QUANTITIES: Final[Mapping[int, tuple[Callable[[Machine, float], float], int | None]]] = {
    1: (lambda machine, now: machine.axis.position(now), None),
    2: (lambda machine, _: machine.positioning.target, None),
    3: (lambda machine, now: machine.axis.setpoint(now) - machine.axis.position(now), None),
    4: (_speed_percent, 2),
    5: (_torque_percent, 2),
    6: (_fixed(35.0), 2),
    7: (_fixed(24.0), 2),
    8: (_fixed(320.0), 2),
    9: (lambda machine, _: machine.positioning.cycles, 0),
    10: (lambda machine, now: machine.operating_time_s(now) // 3600, 0),
    11: (lambda machine, _: machine.program.loop_counter, 0),
    12: (lambda machine, now: machine.axis.position(now), None),
    13: (_chosen(233), 2),
    14: (_chosen(234), 2),
    15: (_chosen(182), 2),
}
"""S1-S15: the value and its decimals."""
