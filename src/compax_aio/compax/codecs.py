"""Status answers into values: numbers, named bits, error history (UG p. 209)."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

from ..errors import UnexpectedAnswerError
from .facts.device_errors import (
    HISTORY_ACKNOWLEDGED,
    HISTORY_POWERED_ON,
    DeviceError,
    device_error,
)
from .facts.status import S16_BITS, S17_BITS, STATUS_VALUES, Form, StatusFact

__all__ = [
    "DriveStatus",
    "HistoryEntry",
    "StatusValue",
    "decode_error",
    "decode_history",
    "decode_number",
    "decode_status_value",
    "value_text",
]

# Blanks may stand anywhere (UG p. 160), between a sign and its number too; digits behind a letter are a name: "E92".
_NUMBER: Final = re.compile(r"(?<![A-Za-z\d.])([-+]?)\s*(\d+(?:\.\d*)?|\.\d+)")
_HEAD: Final = re.compile(r"[SPVN]\d+\s*[:=]?|[:=]")
_BITS: Final = re.compile(r"[01]{8}")
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
    """A number; binary digits without the blank; codes; or the text, where the form is not documented."""
    meaning: str
    unit: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class HistoryEntry:
    """One error of the history, and how it ended."""

    error: DeviceError
    ended_by: str | None
    """``"acknowledged"``, ``"power-on"``, or None: it was not acknowledged before the next one came."""


def value_text(answer: str) -> str:
    """Return what stands behind the colon of an answer, or behind its number where there is no colon."""
    answer = answer.strip()
    head = _HEAD.match(answer)
    return answer[head.end() :].strip() if head else answer


def decode_number(answer: str) -> float:
    """
    Return the first signed decimal number behind the colon; padding, a plus sign and a unit are allowed.

    Raises:
        UnexpectedAnswerError: There is none.
    """
    found = _NUMBER.search(value_text(answer))
    if found is None:
        raise UnexpectedAnswerError("the answer holds no number", received=answer)
    return float(found[1] + found[2])


def decode_status_value(number: int, answer: str, axis_unit: str) -> StatusValue:
    """
    Decode the answer to ``S<number>`` by its row in the table.

    Raises:
        UnexpectedAnswerError: The answer has not the form that the table gives.
    """
    fact = _FACTS.get(number) or StatusFact(number=number, meaning="unknown", unit=None, form=Form.TEXT, source="")
    raw = value_text(answer)
    value: float | str | tuple[int, ...] = raw
    if fact.form is Form.NUMBER:
        value = decode_number(answer)
    elif fact.form is Form.BITS:
        value = _bits(answer)
    elif fact.form in (Form.HISTORY, Form.PAIR):
        value = tuple(_codes(answer))
    unit = axis_unit if fact.unit == "axis" else fact.unit
    return StatusValue(number=number, raw=raw, value=value, meaning=fact.meaning, unit=unit)


def decode_history(answer: str) -> tuple[HistoryEntry, ...]:
    """Decode S18, newest first; a mark (98, 99) stands before the error that it ended (UG p. 209)."""
    entries = []
    ended_by: str | None = None
    for code in _codes(answer):
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
    return next((device_error(code) for code in _codes(answer) if code), None)


def _bits(answer: str) -> str:
    text = value_text(answer).replace(" ", "")
    if not _BITS.fullmatch(text):
        raise UnexpectedAnswerError("a status has eight binary digits (UG p. 209)", received=answer)
    return text


def _codes(answer: str) -> list[int]:
    codes = re.findall(r"\d+", value_text(answer))
    if not codes:
        raise UnexpectedAnswerError("the answer holds no error code (UG p. 209)", received=answer)
    return [int(code) for code in codes]
