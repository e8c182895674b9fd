"""The text of every status value and parameter that the simulated drive tells."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from compax_aio.compax.facts.status import S16_BITS, S17_BITS, STATUS_VALUES, StatusBit

from .knobs import Knobs
from .machine import Machine
from .motion import ramp
from .refusals import SYNTAX, RefusedError

__all__ = ["reading"]

_Reader = Callable[[Machine, float], str]


def reading(machine: Machine, kind: str, number: int, now: float) -> str:
    """
    Write the answer to ``S1`` or ``P2``: ``S001: 123.45``.

    Raises:
        RefusedError: The simulated drive has no such value.
    """
    readers = _STATUS if kind == "S" else _PARAMETERS
    if number not in readers:
        raise RefusedError(SYNTAX)
    return f"{kind}{number:03d}: {readers[number](machine, now)}"


def _number(value: Callable[[Machine, float], float], unit: str | None, decimals: int | None = None) -> _Reader:
    """Write a number with so many decimals (None: those of positions), padded or with its unit."""

    def read(machine: Machine, now: float) -> str:
        knobs = machine.knobs
        places = knobs.decimals if decimals is None else decimals
        # Adding zero turns "-0.00" into "0.00".
        text = f"{round(value(machine, now), places) + 0.0:.{places}f}"
        if knobs.reply_padding == "blanks":
            return f"{text:>12} "
        if knobs.reply_padding == "unit" and unit is not None:
            return f"{text} {_spelt(unit, knobs)}"
        return text

    return read


def _fixed(value: float) -> Callable[[Machine, float], float]:
    """Return something plausible that never changes."""
    return lambda *_: value


def _spelt(unit: str, knobs: Knobs) -> str:
    """Write a unit with the characters of the line, which are ASCII."""
    return knobs.unit if unit == "axis" else unit.replace("°", "")


def _bits(rows: tuple[StatusBit, ...], states: Callable[[Machine, float], Mapping[str, bool]]) -> _Reader:
    """Write eight bits, bit 1 on the left (UG p. 209); those without a state are 0."""

    def read(machine: Machine, now: float) -> str:
        is_set = states(machine, now)
        text = "".join("1" if is_set.get(row.name, False) else "0" for row in rows)
        return f"{text[:4]} {text[4:]}" if machine.knobs.status_bits_blank else text

    return read


def _s16(machine: Machine, now: float) -> Mapping[str, bool]:
    return {
        "no_fault": machine.is_ready(now),
        "no_warning": machine.faults.warning is None,
        "machine_zero_approached": machine.homed,
        "ready_for_start": machine.is_ready(now) and not machine.moving,
        "position_reached": machine.position_reached,
        "idle_after_stop": machine.idle_after_stop,
        "output_0_is_1": machine.power_mode == 1,
        "output_0_is_2": machine.power_mode == 2,
    }


def _s17(machine: Machine, _: float) -> Mapping[str, bool]:
    return {
        "password_active": machine.password,
        "service_password_active": machine.service_password,
        "command_active": machine.moving,
        "running": machine.energised,
    }


def _s18(machine: Machine, _: float) -> str:
    return " ".join(f"{code:02d}" for code in machine.faults.history)


def _s30(machine: Machine, _: float) -> str:
    code = machine.faults.present or 0
    return f"{code} 0" if machine.knobs.fault_numbers == "two" else f"{code}"


def _speed_percent(machine: Machine, now: float) -> float:
    return 100 * machine.axis.speed(now) / machine.knobs.nominal_speed


def _torque_percent(machine: Machine, now: float) -> float:
    """5 % of friction, and 20 % to reach nominal speed in 250 ms: plausible, no more."""
    speed, acceleration = machine.axis.speed(now), machine.axis.acceleration(now)
    friction = 5.0 if speed > 0 else -5.0 if speed < 0 else 0.0
    return max(-300.0, min(300.0, friction + 20 * acceleration / ramp(machine.knobs.nominal_speed, 250)))


_VALUES: Final[Mapping[int, tuple[Callable[[Machine, float], float], int | None]]] = {
    1: (lambda machine, now: machine.axis.position(now), None),
    2: (lambda machine, _: machine.target, None),
    3: (lambda machine, now: machine.axis.setpoint(now) - machine.axis.position(now), None),
    4: (_speed_percent, 2),
    5: (_torque_percent, 2),
    6: (_fixed(35.0), 2),
    7: (_fixed(24.0), 2),
    8: (_fixed(320.0), 2),
    9: (lambda machine, _: machine.cycles, 0),
    10: (lambda _, now: now // 3600, 0),
    11: (_fixed(0), 0),
    12: (lambda machine, now: machine.axis.position(now), None),
    13: (_fixed(0), 2),
    14: (_fixed(0), 2),
    15: (_fixed(0), 2),
}
"""S1-S15: the value and its decimals."""

_UNITS: Final = {row.number: row.unit for row in STATUS_VALUES}

_STATUS: Final[Mapping[int, _Reader]] = {
    **{number: _number(value, _UNITS[number], decimals) for number, (value, decimals) in _VALUES.items()},
    16: _bits(S16_BITS, _s16),
    17: _bits(S17_BITS, _s17),
    18: _s18,
    30: _s30,
}

_UNIT_CODES: Final = {"increments": 0, "mm": 1, "inch": 2, "degree": 3}
"""P90; the coding stands on a page that was not available, so these are placeholders."""


def _p20(machine: Machine, _: float) -> float:
    """Weights as far as known (UG p. 166): 1 Xon/Xoff, 2 no error in the answer."""
    knobs = machine.knobs
    return knobs.xonxoff + 2 * (knobs.error_style in {"prompt_only", "silent"})


_PARAMETERS: Final[Mapping[int, _Reader]] = {
    1: _number(_fixed(0), "axis"),
    2: _number(lambda machine, _: machine.knobs.speed_percent, "%", 3),
    6: _number(lambda machine, _: machine.knobs.acceleration_ms, "ms", 0),
    10: _number(lambda machine, _: machine.knobs.stop_ramp_ms, "ms", 0),
    11: _number(lambda machine, _: machine.knobs.travel_max, "axis"),
    12: _number(lambda machine, _: machine.knobs.travel_min, "axis"),
    14: _number(_fixed(1), "axis"),
    20: _number(_p20, None, 0),
    90: _number(lambda machine, _: _UNIT_CODES[machine.knobs.unit], None, 0),
}
"""Resolutions as stored in the drive (IBS p. 24), positions as they are written."""
