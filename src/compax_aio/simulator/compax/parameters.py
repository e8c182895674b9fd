"""Parameters P1-P250 and variables: how finely each is stored, what has been written, and what is valid."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from compax_aio.compax.facts.limits import (
    MAX_ACCELERATION_TIME_MS,
    MAX_POSITION,
    MAX_SPEED_PERCENT,
    POSITION_DECIMALS,
    POSITION_DECIMALS_INCH,
)

from .knobs import Knobs
from .refusals import NUMBER, SYNTAX, RefusedError

__all__ = [
    "CONTROL_PARAMETERS",
    "FREE_VARIABLES",
    "UNITS",
    "VARIABLE_DECIMALS",
    "Parameters",
    "stored",
    "stored_decimals",
]

_NUMBERS: Final = range(1, 251)
"""P1-P250 (IBS p. 24)."""

CONTROL_PARAMETERS: Final = range(40, 50)
"""P40-P49, free for programs (UG p. 100); here they need neither password nor VP."""

FREE_VARIABLES: Final = range(1, 40)
"""V1-V39 (UG p. 100)."""

_VARIABLES: Final = (*FREE_VARIABLES, *range(50, 71))
"""V50-V70 belong to the cam controller (UG p. 104) and are only kept here."""

VARIABLE_DECIMALS: Final = 3
"""Unknown; as P40-P49, a placeholder."""

_STORED_DECIMALS: Final = (
    (5, 3), (10, 0), (16, 3), (20, 0), (22, 6), (29, 0), (34, 3), (36, 6), (49, 3), (72, 0), (99, 3), (186, 0),
    (196, 3), (250, 0),
)  # fmt: skip
"""Last parameter of each range, and the decimals of its stored resolution (IBS p. 24, CAN p. 33)."""

UNITS: Final = ("increments", "mm", "inch", "degree")
"""P90 is the place in this list; the real coding stands on a page that was not available: a placeholder."""

_LARGEST: Final = 8_388_607
"""Of a parameter without known limits, and of a variable; 24 bits and sign, as P156-P158 have (UG p. 140)."""

_LIMITS: Final[Mapping[int, tuple[float, float]]] = {
    2: (0.001, MAX_SPEED_PERCENT),
    6: (0, MAX_ACCELERATION_TIME_MS),
    10: (0, MAX_ACCELERATION_TIME_MS),
    11: (-MAX_POSITION, MAX_POSITION),
    12: (-MAX_POSITION, MAX_POSITION),
    14: (0, MAX_POSITION),
    20: (0, 255),
    90: (0, len(UNITS) - 1),
}
"""Those of the commands that set the same thing; the manual's own parameter list was not available."""


class Parameters:
    """
    What stands in the parameters and variables.

    A written parameter other than P40-P49 waits for VP, unless the knob ``vp`` says that it is not needed. Numbers
    are rounded to what can be stored. A parameter of which nothing is known begins at 0, a placeholder.
    """

    def __init__(self, knobs: Knobs) -> None:
        self._knobs = knobs
        self._at_once = knobs.vp == "at_once"
        self._shows_valid = knobs.parameter_reading == "valid"
        self._first = {**dict.fromkeys(_NUMBERS, 0.0), **_first_values(knobs)}
        self._valid = dict(self._first)
        self._written: dict[int, float] = {}
        self._variables = dict.fromkeys(_VARIABLES, 0.0)

    def __getitem__(self, number: int) -> float:
        """Return the valid value of a parameter."""
        return self._valid[number]

    @property
    def unit(self) -> str:
        """What positions are counted in, by P90."""
        return UNITS[int(self[90])]

    @property
    def decimals(self) -> int:
        """Of positions and distances: those of the knob, until P90 chooses another unit (UG p. 100)."""
        if self.unit == self._knobs.unit:
            return self._knobs.decimals
        return POSITION_DECIMALS_INCH if self.unit == "inch" else POSITION_DECIMALS

    def value(self, kind: str, number: int) -> float:
        """
        Return what ``P40`` or ``V5`` stands for in a command.

        Raises:
            RefusedError: There is none.
        """
        values = self._valid if kind == "P" else self._variables
        if number not in values:
            raise RefusedError(SYNTAX)
        return values[number]

    def shown(self, kind: str, number: int) -> float:
        """
        Return what reading gives: the value written last, or the valid one, as the knob ``parameter_reading`` says.

        Raises:
            RefusedError: There is none.
        """
        value = self.value(kind, number)
        return value if kind == "V" or self._shows_valid else self._written.get(number, value)

    def write(self, kind: str, number: int, value: float) -> None:
        """
        Write a parameter or variable.

        Raises:
            RefusedError: There is none, or it does not take that value.
        """
        rounded = stored(kind, number, value)
        if kind == "V":
            self._variables[number] = rounded
        elif self._at_once or number in CONTROL_PARAMETERS:
            self._valid[number] = rounded
        else:
            self._written[number] = rounded

    def put(self, number: int, value: float) -> None:
        """
        Let the drive itself set a parameter: it is valid at once, and what waited for VP is gone.

        Raises:
            RefusedError: It does not take that value.
        """
        self._valid[number] = stored("P", number, value)
        self._written.pop(number, None)

    def make_valid(self) -> None:
        """Let everything written take effect, as VP does."""
        self._valid |= self._written
        self._written.clear()

    def forget_written(self) -> None:
        """Lose what VP has not made valid, as without power."""
        self._written.clear()

    # What is kept without power

    @property
    def changed(self) -> Mapping[int, float]:
        """The valid parameters that are not as they were at the beginning."""
        return {number: value for number, value in self._valid.items() if value != self._first[number]}

    @property
    def changed_variables(self) -> Mapping[int, float]:
        """The variables that are not 0."""
        return {number: value for number, value in self._variables.items() if value}

    def replace(self, parameters: Mapping[int, float], variables: Mapping[int, float]) -> None:
        """Hold what :func:`stored` has found good, and all else as at the beginning."""
        self._valid = {**self._first, **parameters}
        self._written.clear()
        self._variables = {**dict.fromkeys(_VARIABLES, 0.0), **variables}


def stored(kind: str, number: int, value: float) -> float:
    """
    Return *value* as parameter or variable *number* would hold it.

    Raises:
        RefusedError: There is none, or it does not take that value.
    """
    if number not in (_NUMBERS if kind == "P" else _VARIABLES):
        raise RefusedError(SYNTAX)
    low, high = _LIMITS.get(number, (-_LARGEST, _LARGEST)) if kind == "P" else (-_LARGEST, _LARGEST)
    rounded = round(value, stored_decimals(kind, number)) + 0.0
    if not low <= rounded <= high:
        raise RefusedError(NUMBER)
    return rounded


def stored_decimals(kind: str, number: int) -> int:
    """Return the decimals of the stored resolution."""
    if kind == "V":
        return VARIABLE_DECIMALS
    return next(decimals for last, decimals in _STORED_DECIMALS if number <= last)


def _first_values(knobs: Knobs) -> dict[int, float]:
    """Return what the knobs say of parameters; P20 is made of weights as far as known (UG p. 166)."""
    p20 = knobs.p20 | int(knobs.xonxoff) | 2 * (knobs.error_style in {"prompt_only", "silent"})
    return {
        2: knobs.speed_percent,
        6: knobs.acceleration_ms,
        10: knobs.stop_ramp_ms,
        11: knobs.travel_max,
        12: knobs.travel_min,
        14: 1.0,
        20: p20,
        90: UNITS.index(knobs.unit),
    }
