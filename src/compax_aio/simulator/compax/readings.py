"""The text of every status value, parameter and variable that the simulated drive tells."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final
from zlib import crc32

from compax_aio.compax.facts.status import S16_BITS, S17_BITS, STATUS_VALUES, StatusBit

from .machine import Machine
from .parameters import CONTROL_PARAMETERS, stored_decimals
from .quantities import QUANTITIES
from .refusals import SYNTAX, RefusedError

__all__ = ["reading"]

_Reader = Callable[[Machine, float], str]


def reading(machine: Machine, kind: str, number: int, now: float) -> str:
    """
    Write the answer to ``S1`` or ``P2``: ``S001: 123.45``.

    Raises:
        RefusedError: The simulated drive has no such value.
    """
    if kind == "N":
        return machine.memory.shown(number)
    return f"{kind}{number:03d}: {_value(machine, kind, number, now)}"


def _value(machine: Machine, kind: str, number: int, now: float) -> str:
    if kind in {"P", "V"}:
        return _setting(machine, kind, number)
    if number not in _STATUS:
        raise RefusedError(SYNTAX)
    return _STATUS[number](machine, now)


def _setting(machine: Machine, kind: str, number: int) -> str:
    value = machine.parameters.shown(kind, number)
    text = f"{value:.{stored_decimals(kind, number)}f}"
    zeros = machine.knobs.trailing_zeros
    control = kind == "V" or number in CONTROL_PARAMETERS
    if "." in text and (zeros == "none" or (zeros == "not_control" and control)):
        text = text.rstrip("0").rstrip(".")
    return _padded(machine, text, _PARAMETER_UNITS.get(number) if kind == "P" else None)


def _padded(machine: Machine, text: str, unit: str | None) -> str:
    """Write a number as it is, padded, or with its unit."""
    padding = machine.knobs.reply_padding
    if padding == "blanks":
        return f"{text:>12} "
    if padding == "unit" and unit is not None:
        return f"{text} {_spelt(unit, machine)}"
    return text


def _number(value: Callable[[Machine, float], float], unit: str | None, decimals: int | None = None) -> _Reader:
    """Write a number with so many decimals (None: those of positions), padded or with its unit."""

    def read(machine: Machine, now: float) -> str:
        places = machine.decimals if decimals is None else decimals
        # Adding zero turns "-0.00" into "0.00".
        return _padded(machine, f"{round(value(machine, now), places) + 0.0:.{places}f}", unit)

    return read


def _spelt(unit: str, machine: Machine) -> str:
    """Write a unit with the characters of the line, which are ASCII."""
    return machine.unit if unit == "axis" else unit.replace("°", "")


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
        "ready_for_start": machine.is_ready_for_start(now),
        "position_reached": machine.positioning.reached,
        "idle_after_stop": machine.idle_after_stop,
        "output_0_is_1": machine.power_mode == 1,
        "output_0_is_2": machine.power_mode == 2,
    }


def _s17(machine: Machine, _: float) -> Mapping[str, bool]:
    return {
        "password_active": machine.password,
        "service_password_active": machine.service_password,
        "command_active": machine.moving,
        "program_running": machine.program.running,
        "running": machine.energised,
    }


def _s18(machine: Machine, _: float) -> str:
    return " ".join(f"{code:02d}" for code in machine.faults.history)


def _s30(machine: Machine, _: float) -> str:
    code = machine.faults.present or 0
    return f"{code} 0" if machine.knobs.fault_numbers == "two" else f"{code}"


def _placeholder(text: str) -> _Reader:
    """Write something that only has its place: that there is such a value is known, its form is not."""
    return lambda *_: text


_UNITS: Final = {row.number: row.unit for row in STATUS_VALUES}

_STATUS: Final[Mapping[int, _Reader]] = {
    **{number: _number(value, _UNITS[number], decimals) for number, (value, decimals) in QUANTITIES.items()},
    16: _bits(S16_BITS, _s16),
    17: _bits(S17_BITS, _s17),
    18: _s18,
    **dict.fromkeys(range(23, 27), _placeholder("0")),
    30: _s30,
    **{number: _placeholder(f"SIMULATOR {number - 30}") for number in range(31, 39)},
    39: lambda machine, _: f"SIMULATOR {crc32(machine.name.encode()) % 1_000_000}",
}
"""
S23-S26, diagnosis, and S31-S39, identification, are four and nine values (IBS p. 12): placeholders, of which the last
tells two drives from each other.
"""

_PARAMETER_UNITS: Final = {1: "axis", 2: "%", 6: "ms", 10: "ms", 11: "axis", 12: "axis", 14: "axis"}
