"""The quantities that P233, P234 and P182 choose for S13, S14 and S15 (UG p. 211)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from .certainty import Certainty

__all__ = ["QUANTITIES", "SELECTORS", "QuantityFact", "quantity"]


@dataclass(frozen=True, slots=True, kw_only=True)
class QuantityFact:
    """One quantity, by the number that chooses it."""

    number: int
    meaning: str
    unit: str | None
    """``axis`` is the unit chosen with P90; None where there is none or nobody knows."""
    source: str = "UG p. 211"
    certainty: Certainty = Certainty.DOCUMENTED


SELECTORS: Final = {13: 233, 14: 234, 15: 182}
"""By status value: the parameter whose value is the number of the quantity shown (UG p. 211)."""


def _unknown(number: int) -> QuantityFact:
    return QuantityFact(
        number=number, meaning="not on a page at hand", unit=None, source="", certainty=Certainty.UNKNOWN
    )


def _row(number: int, meaning: str, unit: str | None = None) -> QuantityFact:
    return QuantityFact(number=number, meaning=meaning, unit=unit)


QUANTITIES: Final = (
    *(_unknown(number) for number in range(1, 17)),
    _row(17, "HEDA transmission errors since synchronisation began"),
    _row(18, "HEDA process nominal value"),
    _row(19, "HEDA control word"),
    _row(20, "HEDA status word"),
    _row(21, "largest positive synchronous following error (XX50)"),
    _row(22, "largest negative synchronous following error (XX50)"),
    *(_row(22 + channel, f"output of D/A monitor channel {channel}", "x 10 V") for channel in range(1, 5)),
    _row(27, "position of the external encoder", "axis"),
    _row(28, "measuring error: resolver minus external encoder", "axis"),
    _row(29, "effective load of the motor, of its permitted continuous load; E53 from 100 %", "%"),
    _row(30, "effective load of the unit; E53 from 100 %", "%"),
    _row(31, "mark synchronisation pointer (XX70)"),
    _row(32, "mark synchronisation correction factor (XX70)"),
)
"""Numbers 1-16 are on a page that was not available. The D/A monitor itself counts 17-26 otherwise."""

_BY_NUMBER: Final = {row.number: row for row in QUANTITIES}


def quantity(number: int) -> QuantityFact:
    """Find the row of *number*; for a number that no page at hand explains, a row that says so."""
    return _BY_NUMBER.get(number) or _unknown(number)
