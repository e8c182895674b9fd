"""Parameters P1-P250 and variables: numbers, resolution, and the meanings that pages at hand give (IBS p. 24)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from .certainty import Certainty

__all__ = [
    "CONTROL_PARAMETERS",
    "MAX_DIGITS",
    "MAX_PARAMETER",
    "PARAMETERS",
    "PASSWORD_OFF",
    "PASSWORD_ON",
    "VARIABLES",
    "VARIABLE_DECIMALS",
    "ParameterFact",
    "parameter_decimals",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterFact:
    """One parameter whose meaning is known."""

    number: int
    meaning: str
    unit: str | None
    """``axis`` is the unit chosen with P90; None where there is none or nobody knows."""
    source: str
    certainty: Certainty = Certainty.DOCUMENTED


MAX_PARAMETER: Final = 250
"""P1-P250 (IBS p. 24)."""

MAX_DIGITS: Final = 7
"""Before the point of a value, at the PLC interface (UG p. 158); that RS-232 has no more is inferred."""

CONTROL_PARAMETERS: Final = range(40, 50)
"""P40-P49: live values for programs, in force without VP (UG p. 100-101)."""

VARIABLES: Final = (*range(1, 40), *range(50, 71))
"""V1-V39 are free (UG p. 100), V50-V70 belong to the cam controller (UG p. 104)."""

VARIABLE_DECIMALS: Final = 3
"""By analogy with the control parameters; no page at hand gives the resolution of variables."""

PASSWORD_OFF: Final = "GOTO 302"
"""Removes the write protection; S17 bit 1 shows it (CAN p. 32, UG p. 209)."""

PASSWORD_ON: Final = "GOTO 270"
"""Restores the write protection (CAN p. 32)."""

_DECIMALS: Final = (
    (range(1, 6), 3),
    (range(6, 11), 0),
    (range(11, 17), 3),
    (range(17, 21), 0),
    (range(21, 23), 6),
    (range(23, 30), 0),
    (range(30, 35), 3),
    (range(35, 37), 6),
    (range(37, 50), 3),
    (range(50, 73), 0),
    (range(73, 100), 3),
    (range(100, 187), 0),
    (range(187, 197), 3),
    (range(197, MAX_PARAMETER + 1), 0),
)
"""Stored resolution by range (IBS p. 24, CAN p. 33)."""

PARAMETERS: Final = (
    ParameterFact(number=1, meaning="real zero; shifts the actual position", unit="axis", source="UG p. 104"),
    ParameterFact(number=2, meaning="speed used when no SPEED was given", unit="%", source="IBS p. 33"),
    ParameterFact(number=6, meaning="acceleration time used when no ACCEL was given", unit="ms", source="IBS p. 33"),
    ParameterFact(
        number=10, meaning="ramp time of STOP", unit="ms", source="CAN-S p. 28", certainty=Certainty.INFERRED
    ),
    ParameterFact(number=11, meaning="limit of the travel range", unit="axis", source="UG p. 100"),
    ParameterFact(number=12, meaning="limit of the travel range", unit="axis", source="UG p. 100"),
    ParameterFact(number=14, meaning="positioning window", unit="axis", source="UG p. 117"),
    ParameterFact(number=19, meaning="baud rate; its coding is unknown", unit=None, source="UG p. 160"),
    ParameterFact(
        number=20, meaning="serial interface: handshake, errors, binary transfer", unit=None, source="UG p. 166"
    ),
    ParameterFact(number=35, meaning="mark reference: 1 on, 0 off", unit=None, source="UG p. 100"),
    ParameterFact(number=37, meaning="least travel to the mark", unit="axis", source="UG p. 100"),
    ParameterFact(number=38, meaning="greatest travel to the mark", unit="axis", source="UG p. 100"),
    ParameterFact(number=39, meaning="greatest feed without a mark", unit="axis", source="UG p. 100"),
    *(
        ParameterFact(number=number, meaning="control parameter for programs", unit=None, source="UG p. 100-101")
        for number in CONTROL_PARAMETERS
    ),
    *(
        ParameterFact(number=number, meaning=meaning, unit=None, source="UG p. 124, 211", certainty=Certainty.INFERRED)
        for number, meaning in (
            (71, "D/A monitor channel 0: gain or value"),
            (72, "D/A monitor channel 1: gain or value"),
            (73, "D/A monitor channel 0: source; 39 is the voltage output"),
            (74, "D/A monitor channel 1: source; 39 is the voltage output"),
        )
    ),
    ParameterFact(
        number=76,
        meaning="D/A monitor channel 2: source before the point, gain behind it",
        unit=None,
        source="UG p. 124, 211",
    ),
    ParameterFact(
        number=77,
        meaning="D/A monitor channel 3: source before the point, gain behind it",
        unit=None,
        source="UG p. 124, 211",
    ),
    ParameterFact(number=90, meaning="unit of travel; its coding is unknown", unit=None, source="UG p. 100-101"),
    ParameterFact(
        number=93, meaning="operating mode: 1 to 3 position; one controls speed", unit=None, source="UG p. 117, 209"
    ),
    *(
        ParameterFact(number=number, meaning="process data assignment (Interbus)", unit=None, source="IBS p. 70")
        for number in range(135, 139)
    ),
    ParameterFact(number=156, meaning="1000SL: source of inputs 1-6", unit=None, source="UG p. 140"),
    ParameterFact(number=157, meaning="1000SL: source of inputs 7-12", unit=None, source="UG p. 140"),
    ParameterFact(number=158, meaning="1000SL: source of inputs 13-16", unit=None, source="UG p. 140"),
    ParameterFact(number=182, meaning="quantity shown in S15", unit=None, source="UG p. 211"),
    ParameterFact(number=190, meaning="CAN profile: 22 is DSP402", unit=None, source="CAN-S p. 28"),
    ParameterFact(
        number=193,
        meaning="unasked messages on the bus: 1 error, 2 position reached, 4 comparator",
        unit=None,
        source="CAN p. 31",
    ),
    ParameterFact(number=194, meaning="bus address", unit=None, source="485 p. 6"),
    ParameterFact(number=195, meaning="baud rate of the bus", unit=None, source="485 p. 6"),
    ParameterFact(number=196, meaning="mode of the bus", unit=None, source="485 p. 6"),
    ParameterFact(
        number=215,
        meaning="unknown; left out, as P1, by modes 1 and 2 of the cam controller",
        unit=None,
        source="UG p. 104",
        certainty=Certainty.UNKNOWN,
    ),
    ParameterFact(number=221, meaning="enables bits of the bus control word", unit=None, source="IBS p. 20"),
    ParameterFact(number=227, meaning="bit 4: how output O5 shows position reached", unit=None, source="UG p. 117"),
    ParameterFact(number=233, meaning="quantity shown in S13", unit=None, source="UG p. 211"),
    ParameterFact(number=234, meaning="quantity shown in S14", unit=None, source="UG p. 211"),
)
"""All that pages at hand explain; the manual's own list was not available."""


def parameter_decimals(number: int) -> int:
    """Return how many decimals P<number> is stored with."""
    return next(decimals for numbers, decimals in _DECIMALS if number in numbers)
