"""What P19 and P20 say about the serial interface (UG p. 160, 166)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from .certainty import Certainty

__all__ = [
    "BAUD_RATE_PARAMETER",
    "BINARY_BIT",
    "ERRORS_SUPPRESSED_BIT",
    "INTERFACE_BITS",
    "INTERFACE_PARAMETER",
    "INTERFACE_VALUES",
    "XONXOFF_BIT",
    "InterfaceBit",
]

BAUD_RATE_PARAMETER: Final = 19
"""P19: 9600 or 4800 baud (UG p. 160); whether it holds the rate or its place in a list is not on a page at hand."""

INTERFACE_PARAMETER: Final = 20
"""P20 (UG p. 160, 166)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class InterfaceBit:
    """One bit of P20 by its weight."""

    weight: int
    name: str | None
    """As in :class:`~compax_aio.compax.codecs.SerialInterface`; None for a bit of unknown meaning."""
    meaning_when_set: str
    source: str
    certainty: Certainty = Certainty.DOCUMENTED


XONXOFF_BIT: Final = InterfaceBit(
    weight=1,
    name="xonxoff",
    meaning_when_set="Xon/Xoff is used in both directions",
    source="UG p. 166, 485 p. 6",
    certainty=Certainty.INFERRED,
)
"""P20 = 3 has Xon/Xoff on (UG p. 166), and so has weight 1 of P196, the same setting of the RS485 option."""

ERRORS_SUPPRESSED_BIT: Final = InterfaceBit(
    weight=2,
    name="errors_suppressed",
    meaning_when_set="a refused command gets no error: a bare prompt, or nothing at all",
    source="UG p. 166",
    certainty=Certainty.INFERRED,
)
"""P20 = 3 sends no error messages (UG p. 166); this is the bit of 3 that is left."""

BINARY_BIT: Final = InterfaceBit(
    weight=16,
    name="binary",
    meaning_when_set="binary transfer beside ASCII",
    source="UG p. 166",
)

INTERFACE_BITS: Final = (
    XONXOFF_BIT,
    ERRORS_SUPPRESSED_BIT,
    *(
        InterfaceBit(weight=weight, name=None, meaning_when_set="unknown", source="", certainty=Certainty.UNKNOWN)
        for weight in (4, 8)
    ),
    BINARY_BIT,
)
"""The weights that RS485 has beside 1 (block check, time-out, end sign; 485 p. 6) must not be carried over."""

INTERFACE_VALUES: Final = {
    3: "Xon/Xoff, no error messages, no binary transfer",
    19: "Xon/Xoff, no error messages, binary transfer",
}
"""The values of P20 that a page at hand spells out (UG p. 166)."""
