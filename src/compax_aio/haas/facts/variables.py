"""Variables of a control: those worth reading, with units where they are known, and those never to be written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from .sources import INFERRED, VARIABLE_TABLE

__all__ = ["EXAMPLE_WRITABLE", "PROTECTED", "VARIABLES", "ProtectedRange", "Variable", "name_of", "protection_of"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Variable:
    """One variable; they vary by control and year, so that nothing of it is sure of a given machine."""

    number: int
    name: str
    unit: str = ""
    """Empty where there is none, or it is not known."""
    read_only: bool = False
    source: str = VARIABLE_TABLE


@dataclass(frozen=True, slots=True, kw_only=True)
class ProtectedRange:
    """Variables that are refused to be written, whatever an allow-list says."""

    numbers: range
    what: str
    source: str

    def __contains__(self, number: object) -> bool:
        """Whether *number* is one of them."""
        return number in self.numbers


_AXES: Final = "XYZAB"


def _axes(first: int, what: str) -> tuple[Variable, ...]:
    return tuple(Variable(number=first + at, name=f"{axis} {what}", read_only=True) for at, axis in enumerate(_AXES))


VARIABLES: Final[Mapping[int, Variable]] = MappingProxyType(
    {
        row.number: row
        for row in (
            *_axes(1064, "axis load, highest"),
            Variable(number=1094, name="coolant level", read_only=True, source="named so by users of adapters"),
            Variable(number=1098, name="spindle load", read_only=True),
            Variable(number=3001, name="timer", unit="ms"),
            Variable(number=3002, name="timer", unit="h"),
            Variable(number=3011, name="date, YYMMDD", read_only=True),
            Variable(number=3012, name="time of day, HHMMSS", read_only=True),
            Variable(number=3020, name="power-on timer", read_only=True),
            Variable(number=3021, name="cycle start timer"),
            Variable(number=3022, name="feed timer"),
            Variable(number=3023, name="present part timer"),
            Variable(number=3024, name="last complete part timer"),
            Variable(number=3025, name="previous part timer"),
            Variable(number=3026, name="tool in spindle", read_only=True),
            Variable(number=3027, name="spindle speed", unit="rpm", read_only=True),
            *_axes(5021, "machine position"),
            *_axes(5041, "work position"),
        )
    }
)
"""By number. Units of positions are those that the control is set to, inch or mm; those of its timers are not told."""

PROTECTED: Final = (
    ProtectedRange(numbers=range(150, 200), what="values of the probe", source=VARIABLE_TABLE),
    ProtectedRange(numbers=range(550, 600), what="calibration of the probe", source=VARIABLE_TABLE),
    ProtectedRange(
        numbers=range(700, 750), what="for internal use only, 709 of the fixture clamp", source=VARIABLE_TABLE
    ),
    ProtectedRange(numbers=range(10_150, 10_200), what="values of the probe, newer controls", source=VARIABLE_TABLE),
    ProtectedRange(
        numbers=range(10_550, 10_600), what="calibration of the probe, newer controls", source=VARIABLE_TABLE
    ),
    ProtectedRange(numbers=range(3000, 3007), what="raises alarms, stops, changes how programs run", source=INFERRED),
)
"""Overwritten, they make the machine measure or move wrongly."""

EXAMPLE_WRITABLE: Final = (range(1, 34), range(10_200, 10_300), range(10_800, 11_000))
"""An allow-list as a peer has it (bobvawter/mdcmux); ours is empty until a user writes one."""


def name_of(number: int) -> str:
    """Return the name of a variable, or ``""``."""
    row = VARIABLES.get(number)
    return row.name if row else ""


def protection_of(number: int) -> ProtectedRange | None:
    """Return why a variable is never written, or None."""
    return next((each for each in PROTECTED if number in each.numbers), None)
