"""Answers into values: numbers, named bits, error history, chosen quantities, P20 (UG p. 166, 209, 211)."""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import isfinite
from typing import Final

from ..errors import UnexpectedAnswerError
from .facts.certainty import Certainty
from .facts.device_errors import (
    HISTORY_ACKNOWLEDGED,
    HISTORY_POWERED_ON,
    DeviceError,
    device_error,
)
from .facts.quantities import SELECTORS, quantity
from .facts.serial_interface import BINARY_BIT, ERRORS_SUPPRESSED_BIT, XONXOFF_BIT
from .facts.status import S16_BITS, S17_BITS, STATUS_VALUES, Form, StatusFact

__all__ = [
    "DriveStatus",
    "HistoryEntry",
    "MonitorValue",
    "SerialInterface",
    "StatusValue",
    "decode_codes",
    "decode_error",
    "decode_history",
    "decode_interface",
    "decode_monitor_value",
    "decode_number",
    "decode_status_value",
    "shows_active",
    "value_text",
]

_HEAD: Final = re.compile(r"[SPVN][0-9]++[ \t]*+[:=]?+|[:=]")
# Blanks may stand anywhere (UG p. 160), between a sign and its number too. Nothing else stands before it: what has lost
# a digit on the line is another number. Behind it a unit, or nothing: "1,5", "1 234.56", "1.5E3" and "1x2.50" are
# numbers that would be misread. There is only one way to take a text apart so (nothing that is taken is given back): it
# comes from a line, and to try many could take for ever.
_NUMBER_ANSWER: Final = re.compile(
    rf"[ \t]*+(?:{_HEAD.pattern})?+[ \t:=]*+([-+]?+)[ \t]*+([0-9]++(?:\.[0-9]*+)?+|\.[0-9]++)"
    r"(?![eE][-+]?\d)(?:[^\d\s.,'+-][^\d\s.,'+/]*(?:/[^\d\s.,'+]*\d?)?)?(?:\s+[^\d\s.,'+-]\S*)*\s*"
)
_PLAIN_NUMBER: Final = re.compile(r"[SPVN][0-9]++:[ \t]*+([-+]?+[0-9]++\.?+[0-9]*+)")
"""What nearly all answers are, and :data:`_NUMBER_ANSWER` reads in more steps."""
_BLANKS: Final = " \t"
_ACTIVE_BIT: Final = next(bit.bit for bit in S17_BITS if bit.name == "command_active")
_BITS: Final = re.compile(r"[01]{8}")
_WHOLE: Final = re.compile(r"[-+]?[0-9]{1,15}")
_BROKEN: Final = re.compile(r"[-+]?(?:[0-9]{1,15}\.[0-9]*|\.[0-9]+)")
_FACTS: Final = {fact.number: fact for fact in STATUS_VALUES}


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveStatus:
    """
    S16 and S17, every bit by its name (UG p. 209); *s16* and *s17* are the digits as the drive sent them.

    The two are read one after the other, S17 first: a move that ends in between shows as not active and reached.
    """

    s16: str
    s17: str
    no_fault: bool
    """False with a fault, when no positioning command is accepted; and after power-on until the self-test is over."""
    no_warning: bool
    machine_zero_approached: bool
    ready_for_start: bool
    """Of programs; it has no meaning in direct command mode (CAN-S p. 28)."""
    position_reached: bool
    idle_after_stop: bool
    output_0_is_1: bool
    output_0_is_2: bool
    password_active: bool
    service_password_active: bool
    command_active: bool
    """A positioning is running; POSA and POSR are refused with E92."""
    program_running: bool
    stopped_by_input: bool
    reserved: bool
    running: bool
    """RUN; False when off, or switched off by an error."""
    unused: bool

    @property
    def as_sent(self) -> str:
        """Both as the drive sent them, for errors."""
        return f"S16 {self.s16}, S17 {self.s17}"

    @property
    def shows_stop(self) -> bool:
        """Whether the drive says that it was stopped, over the line or by input I6."""
        return self.idle_after_stop or self.stopped_by_input

    @classmethod
    def decode(cls, s16: str, s17: str) -> DriveStatus:
        """
        Decode the answers to S16 and S17; bit 1 is the leftmost digit, and a blank in the middle means nothing.

        Raises:
            UnexpectedAnswerError: An answer has not eight binary digits.
        """
        digits = [_bits(s16), _bits(s17)]
        return cls(
            s16=digits[0],
            s17=digits[1],
            **{bit.name: digits[0][bit.bit - 1] == "1" for bit in S16_BITS},
            **{bit.name: digits[1][bit.bit - 1] == "1" for bit in S17_BITS},
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class StatusValue:
    """One status value as read: *raw* is what stood behind the colon."""

    number: int
    raw: str
    value: float | str | tuple[int, ...]
    """
    A number; binary digits without the blank; codes. Where the form is not documented (S19-S29, S31 and up): a number
    if the answer is nothing else, whole if it has no point; else the text.
    """
    meaning: str
    unit: str | None
    certainty: Certainty = Certainty.DOCUMENTED
    """Of meaning and unit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MonitorValue:
    """S13, S14 or S15, and what it shows: a quantity that a parameter chooses (UG p. 211)."""

    number: int
    chosen: int
    """The number of the quantity: the value of P233, P234 or P182."""
    raw: str
    value: float
    meaning: str
    unit: str | None
    """None where the quantity has none, or is not known."""
    certainty: Certainty
    """Of meaning and unit; UNKNOWN for quantities 1 to 16, whose page was not available."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SerialInterface:
    """
    P20, how the serial interface behaves (UG p. 166).

    Which weights stand for Xon/Xoff and for suppressed errors is inferred from the documented values 3 and 19;
    ``DriveSettings`` can say it otherwise.
    """

    xonxoff: bool
    errors_suppressed: bool
    """A refused command is answered as an accepted one is, or not at all."""
    binary: bool
    """Binary transfer beside ASCII; documented."""
    raw: int
    unknown: int
    """The weights of *raw* that no page at hand explains, added up; 0 if there are none."""

    @classmethod
    def decode(
        cls,
        p20: float,
        *,
        xonxoff_weight: int = XONXOFF_BIT.weight,
        errors_suppressed_weight: int = ERRORS_SUPPRESSED_BIT.weight,
    ) -> SerialInterface:
        """
        Decode the value of P20.

        Raises:
            UnexpectedAnswerError: It is not a whole number from 0 on.
        """
        if not isfinite(p20) or p20 != int(p20) or p20 < 0:
            raise UnexpectedAnswerError(f"P20 is a whole number of bits (UG p. 166), not {p20!r}")
        raw = int(p20)
        known = xonxoff_weight | errors_suppressed_weight | BINARY_BIT.weight
        return cls(
            xonxoff=bool(raw & xonxoff_weight),
            errors_suppressed=bool(raw & errors_suppressed_weight),
            binary=bool(raw & BINARY_BIT.weight),
            raw=raw,
            unknown=raw & ~known,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class HistoryEntry:
    """One error of the history, and how it ended."""

    error: DeviceError
    ended_by: str | None
    """``"acknowledged"``, ``"power-on"``, or None: it was not acknowledged before the next one came."""


def value_text(answer: str) -> str:
    """Return what stands behind the colon of an answer, or behind its number where there is no colon."""
    answer = answer.strip(_BLANKS)
    head = _HEAD.match(answer)
    return answer[head.end() :].strip(_BLANKS) if head else answer


def decode_number(answer: str) -> float:
    """
    Return the signed decimal number behind the colon; padding, a plus sign and a unit are allowed.

    Raises:
        UnexpectedAnswerError: There is none.
    """
    if plain := _PLAIN_NUMBER.fullmatch(answer):
        return float(plain[1])
    found = _NUMBER_ANSWER.fullmatch(answer)
    if found is None:
        raise UnexpectedAnswerError("the answer holds no number that is understood", received=answer)
    return float(found[1] + found[2])


def decode_status_value(number: int, answer: str, axis_unit: str) -> StatusValue:
    """
    Decode the answer to ``S<number>`` by its row in the table.

    Raises:
        UnexpectedAnswerError: The answer has not the form that the table gives.
    """
    fact = _FACTS.get(number) or StatusFact(
        number=number, meaning="unknown", unit=None, form=Form.UNKNOWN, source="", certainty=Certainty.UNKNOWN
    )
    raw = value_text(answer)
    value: float | str | tuple[int, ...]
    if fact.form is Form.NUMBER:
        value = decode_number(answer)
    elif fact.form is Form.BITS:
        value = _bits(answer)
    elif fact.form in (Form.HISTORY, Form.PAIR):
        value = decode_codes(answer)
    else:
        value = _number_or_text(raw)
    return StatusValue(
        number=number,
        raw=raw,
        value=value,
        meaning=fact.meaning,
        unit=_spelt(fact.unit, axis_unit),
        certainty=fact.certainty,
    )


def decode_monitor_value(number: int, chosen: str, answer: str, axis_unit: str) -> MonitorValue:
    """
    Decode the answer to S13, S14 or S15 by the quantity that its parameter chooses (UG p. 211).

    Args:
        number: 13, 14 or 15.
        chosen: The answer to P233, P234 or P182.
        answer: The answer to ``S<number>``.
        axis_unit: Of positions.

    Raises:
        UnexpectedAnswerError: An answer is no number, or *chosen* no whole one.
    """
    selector = decode_number(chosen)
    if not isfinite(selector) or selector != int(selector):
        raise UnexpectedAnswerError(
            f"P{SELECTORS[number]} chooses a quantity by a whole number (UG p. 211)", received=chosen
        )
    fact = quantity(int(selector))
    return MonitorValue(
        number=number,
        chosen=fact.number,
        raw=value_text(answer),
        value=decode_number(answer),
        meaning=fact.meaning,
        unit=_spelt(fact.unit, axis_unit),
        certainty=fact.certainty,
    )


def decode_interface(
    answer: str,
    *,
    xonxoff_weight: int = XONXOFF_BIT.weight,
    errors_suppressed_weight: int = ERRORS_SUPPRESSED_BIT.weight,
) -> SerialInterface:
    """
    Decode the answer to P20 (UG p. 166).

    Raises:
        UnexpectedAnswerError: It is not a whole number from 0 on.
    """
    try:
        return SerialInterface.decode(
            decode_number(answer),
            xonxoff_weight=xonxoff_weight,
            errors_suppressed_weight=errors_suppressed_weight,
        )
    except UnexpectedAnswerError as error:
        error.received = answer
        raise


def shows_active(s17: str) -> bool:
    """Whether an answer to S17 says that a positioning runs (bit 3, UG p. 209); what is no such answer does not."""
    digits = value_text(s17).replace(" ", "")
    return _BITS.fullmatch(digits) is not None and digits[_ACTIVE_BIT - 1] == "1"


def decode_history(answer: str) -> tuple[HistoryEntry, ...]:
    """Decode S18, newest first; a mark (98, 99) stands before the error that it ended (UG p. 209)."""
    entries = []
    ended_by: str | None = None
    for code in decode_codes(answer):
        if code == HISTORY_ACKNOWLEDGED:
            ended_by = "acknowledged"
        elif code == HISTORY_POWERED_ON:
            ended_by = "power-on"
        else:
            if code:
                entries.append(HistoryEntry(error=device_error(code), ended_by=ended_by))
            ended_by = None
    return tuple(entries)


def decode_error(answer: str) -> DeviceError | None:
    """Decode S30, one number or two in an order that is not documented: the first that is not zero (IBS p. 12)."""
    return next((device_error(code) for code in decode_codes(answer) if code), None)


def _spelt(unit: str | None, axis_unit: str) -> str | None:
    return axis_unit if unit == "axis" else unit


def _number_or_text(raw: str) -> float | str:
    if _WHOLE.fullmatch(raw):
        return int(raw)
    return float(raw) if _BROKEN.fullmatch(raw) else raw


def _bits(answer: str) -> str:
    text = value_text(answer).replace(" ", "")
    if not _BITS.fullmatch(text):
        raise UnexpectedAnswerError("a status has eight binary digits (UG p. 209)", received=answer)
    return text


def decode_codes(answer: str) -> tuple[int, ...]:
    """Return the codes and marks of S18, newest first, or of S30, as they are (UG p. 209)."""
    codes = re.findall("[0-9]+", value_text(answer))
    if not codes:
        raise UnexpectedAnswerError("the answer holds no error code (UG p. 209)", received=answer)
    return tuple(map(int, codes))
