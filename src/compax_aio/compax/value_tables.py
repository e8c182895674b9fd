"""Which parameters and variables a COMPAX has, how exact each is, and which are in force without VP."""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import dataclass
from typing import Final

from ..checked_numbers import check_number
from ..errors import InvalidCommandError
from ..escaping import shown
from .facts.parameters import (
    CONTROL_PARAMETERS,
    MAX_DIGITS,
    MAX_PARAMETER,
    PARAMETERS,
    VARIABLE_DECIMALS,
    VARIABLES,
    ParameterFact,
    parameter_decimals,
)
from .plain_line import as_index, check_line

__all__ = ["PARAMETER_TABLE", "VARIABLE_TABLE", "ValueTable"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ValueTable:
    """One kind of numbered values: which there are, and how exact each is."""

    kind: str
    """For people, and the name of the table in a file."""
    letter: str
    decimals: Mapping[int, int]
    """By number."""
    facts: Mapping[int, ParameterFact]
    """Those whose meaning is known."""
    live: Container[int]
    """Those that are in force as soon as they are written, without VP."""

    def index(self, number: object) -> int:
        """
        Return *number* if there is such a value.

        Raises:
            InvalidCommandError: There is none.
        """
        index = as_index(number)
        if index is None or index not in self.decimals:
            raise InvalidCommandError(
                f"there is no {self.letter}{shown(number)} among the {self.kind} of a COMPAX",
                hint="there are P1 to P250, V1 to V39 and V50 to V70 (IBS p. 12, 24, UG p. 104)",
            )
        return index

    def name(self, number: object) -> str:
        """Write the name of a value, ``P40``; raises as :meth:`index` does."""
        return f"{self.letter}{self.index(number)}"

    def rounded(self, number: int, value: object) -> float:
        """Return *value* with the decimals that this one is stored with; raises InvalidCommandError for no number."""
        return round(check_number(self.name(number), value), self.decimals[number]) + 0.0

    def written(self, number: int, value: float, template: str) -> str:
        """
        Write the line that gives a value to the drive.

        Args:
            number: Of the value.
            value: What it is to be.
            template: How a value is written, with ``{name}`` and ``{value}``: ``Dialect.write_value``.

        Raises:
            InvalidCommandError: The drive cannot be told this.
        """
        rounded, decimals = self.rounded(number, value), self.decimals[number]
        if abs(rounded - float(value)) > 1e-9 * max(1.0, abs(rounded)):
            raise InvalidCommandError(f"{self.name(number)} has {decimals} decimals (IBS p. 24), not {shown(value)}")
        if abs(rounded) >= 10**MAX_DIGITS:
            raise InvalidCommandError(
                f"{self.name(number)} cannot be {shown(value)}: a number has {MAX_DIGITS} digits before the point "
                "(UG p. 158)"
            )
        return check_line(template.format(name=self.name(number), value=f"{rounded:.{decimals}f}"))


PARAMETER_TABLE: Final = ValueTable(
    kind="parameters",
    letter="P",
    decimals={number: parameter_decimals(number) for number in range(1, MAX_PARAMETER + 1)},
    facts={fact.number: fact for fact in PARAMETERS},
    live=CONTROL_PARAMETERS,
)

VARIABLE_TABLE: Final = ValueTable(
    kind="variables", letter="V", decimals=dict.fromkeys(VARIABLES, VARIABLE_DECIMALS), facts={}, live=VARIABLES
)
"""V1-V39 and V50-V70 (UG p. 100, 104)."""
