"""Which parameters and variables a COMPAX has, how exact each is, and which are in force without VP."""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import dataclass
from typing import Final

from .facts.parameters import (
    CONTROL_PARAMETERS,
    MAX_PARAMETER,
    PARAMETERS,
    VARIABLE_DECIMALS,
    VARIABLES,
    ParameterFact,
    parameter_decimals,
)

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
