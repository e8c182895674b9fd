"""The status values S1-S39 and the named bits of S16 and S17 (UG p. 104, 209-211; IBS p. 12, 38, 70)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Final

from .certainty import Certainty

__all__ = ["MARKERS", "S16_BITS", "S17_BITS", "STATUS_VALUES", "Form", "StatusBit", "StatusFact"]


class Form(Enum):
    """How the value of a status is written."""

    NUMBER = "one signed decimal number"
    BITS = "eight binary digits, bit 1 on the left"
    HISTORY = "eight two-digit codes, newest first"
    PAIR = "one or two numbers"
    UNKNOWN = "unknown: a number where it looks like one, else text"


@dataclass(frozen=True, slots=True, kw_only=True)
class StatusFact:
    """One status value."""

    number: int
    meaning: str
    unit: str | None
    """``axis`` is the unit chosen with P90; None where there is none or nobody knows."""
    form: Form
    source: str
    """Empty where there is none."""
    certainty: Certainty = Certainty.DOCUMENTED
    """Of meaning and unit together: that of the weaker."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StatusBit:
    """One bit of S16 or S17; bit 1 is the leftmost digit (UG p. 209)."""

    bit: int
    name: str
    meaning_when_set: str
    source: str = "UG p. 209"
    certainty: Certainty = Certainty.DOCUMENTED


def _number(number: int, meaning: str, unit: str | None, source: str, **more: Certainty) -> StatusFact:
    return StatusFact(number=number, meaning=meaning, unit=unit, form=Form.NUMBER, source=source, **more)


def _of_unknown_form(number: int, meaning: str, source: str, certainty: Certainty) -> StatusFact:
    return StatusFact(number=number, meaning=meaning, unit=None, form=Form.UNKNOWN, source=source, certainty=certainty)


def _unknown(number: int) -> StatusFact:
    return _of_unknown_form(number, "unknown", "", Certainty.UNKNOWN)


STATUS_VALUES: Final = (
    _number(1, "actual position", "axis", "UG p. 104"),
    _number(2, "target position", "axis", "IBS p. 12"),
    _number(3, "following error", "axis", "IBS p. 38, 70"),
    _number(4, "speed", "%", "IBS p. 70", certainty=Certainty.INFERRED),
    _number(5, "motor torque", "%", "IBS p. 70", certainty=Certainty.INFERRED),
    _number(6, "temperature of the power stage", "°C", "IBS p. 12", certainty=Certainty.INFERRED),
    _number(7, "control voltage", "V", "IBS p. 12", certainty=Certainty.INFERRED),
    _number(8, "intermediate circuit voltage", "V", "IBS p. 12", certainty=Certainty.INFERRED),
    _number(9, "axis motion cycles", None, "IBS p. 12"),
    _number(10, "operating hours", "h", "IBS p. 12", certainty=Certainty.INFERRED),
    _number(11, "loop counter of a running REPEAT", None, "IBS p. 12"),
    _number(12, "absolute value sensor position", "axis", "IBS p. 12, UG p. 104"),
    _number(13, "optimisation display, chosen by P233", None, "UG p. 211"),
    _number(14, "optimisation display, chosen by P234", None, "UG p. 211"),
    _number(15, "status monitor, chosen by P182", None, "UG p. 211"),
    StatusFact(number=16, meaning="status bits 1", unit=None, form=Form.BITS, source="UG p. 209"),
    StatusFact(number=17, meaning="status bits 2", unit=None, form=Form.BITS, source="UG p. 209"),
    StatusFact(number=18, meaning="error history", unit=None, form=Form.HISTORY, source="UG p. 209"),
    *(_unknown(number) for number in range(19, 23)),
    *(
        _of_unknown_form(number, f"diagnosis value {number - 22}", "IBS p. 12, CAN p. 69", Certainty.DOCUMENTED)
        for number in range(23, 27)
    ),
    *(_unknown(number) for number in range(27, 30)),
    StatusFact(number=30, meaning="error message", unit=None, form=Form.PAIR, source="IBS p. 12"),
    *(
        _of_unknown_form(number, f"device identification {number - 30}", "IBS p. 12", Certainty.DOCUMENTED)
        for number in range(31, 40)
    ),
)
"""All that the object of the status values has (IBS p. 12), those that no page at hand explains too."""

S16_BITS: Final = (
    StatusBit(bit=1, name="no_fault", meaning_when_set="no fault; 0 also until the self-test is done"),
    StatusBit(bit=2, name="no_warning", meaning_when_set="no warning"),
    StatusBit(bit=3, name="machine_zero_approached", meaning_when_set="machine zero has been approached"),
    StatusBit(bit=4, name="ready_for_start", meaning_when_set="ready for START", source="UG p. 209, CAN-S p. 28"),
    StatusBit(bit=5, name="position_reached", meaning_when_set="programmed nominal position reached"),
    StatusBit(bit=6, name="idle_after_stop", meaning_when_set="idle after a stop"),
    StatusBit(bit=7, name="output_0_is_1", meaning_when_set="after OUTPUT O0=1"),
    StatusBit(bit=8, name="output_0_is_2", meaning_when_set="after OUTPUT O0=2"),
)

S17_BITS: Final = (
    StatusBit(bit=1, name="password_active", meaning_when_set="password 302 is active"),
    StatusBit(bit=2, name="service_password_active", meaning_when_set="the service password is active"),
    StatusBit(
        bit=3,
        name="command_active",
        meaning_when_set="a positioning is running; POSA, POSR and, in speed control, SPEED get E92",
    ),
    StatusBit(bit=4, name="program_running", meaning_when_set="the program memory is running"),
    StatusBit(bit=5, name="stopped_by_input", meaning_when_set="stopped by input I6"),
    StatusBit(bit=6, name="reserved", meaning_when_set="reserved"),
    StatusBit(bit=7, name="running", meaning_when_set="RUN; 0 when off, or switched off by an error"),
    StatusBit(bit=8, name="unused", meaning_when_set="unused"),
)

MARKERS: Final = (17, 16, 30, *range(2, 13))
"""Status values that are asked to get a line back in step: always readable, and each answer bears its number."""
