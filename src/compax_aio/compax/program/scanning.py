"""One record's text into its record: every form is tried, and the one that gets furthest says what is missing."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from functools import partial
from typing import Any, Final, TypeAlias

from ..facts.limits import OUTPUT_NUMBERS
from ..facts.program_commands import (
    ARITHMETIC_SIGNS,
    COMPARISON_SIGNS,
    CONTROL_PARAMETERS,
    GERMAN_LETTERS,
    INPUT_NUMBERS,
    MAX_LEVELS,
    NUMBERS,
    PARAMETERS,
    PASSWORDS,
    POWER_MODES,
    RECORD_NUMBERS,
    STATUS_NUMBERS,
    SYSTEM_VARIABLES,
    VARIABLES,
    NumberFact,
)
from .forms import FORMS, Piece
from .problems import Severity
from .records import Gosub, Goto, Jump, Operand, Parameter, Record, Status, Value, Variable

__all__ = ["Finding", "Furthest", "Scan", "scan", "whole_number"]

_NUMBER: Final = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)")
_DIGITS: Final = re.compile(r"[0-9]+")
_LEVELS: Final = re.compile(r"[01]+")
_OPERAND: Final = re.compile(r"\.([PV])([0-9]+)")
_VALUE: Final = re.compile(r"\.?([PVS])([0-9]+)")
_TARGET: Final = re.compile(r"([PV])([0-9]+)")

_Known: TypeAlias = Mapping[str, tuple[Collection[int], str]]
"""Letters, with the numbers that exist and how to say them."""

_KNOWN_VARIABLES: Final = frozenset({*VARIABLES, *SYSTEM_VARIABLES})
_IN_PLACE_OF_A_NUMBER: Final[_Known] = {"P": (CONTROL_PARAMETERS, "P40-P49"), "V": (VARIABLES, "V1-V39")}
_BY_THEMSELVES: Final[_Known] = {
    "P": (PARAMETERS, "P1-P250"),
    "V": (_KNOWN_VARIABLES, "V1-V39 and V50-V70"),
    "S": (STATUS_NUMBERS, "S1-S39"),
}
_KINDS: Final[Mapping[str, Callable[[int], Parameter | Variable | Status]]] = {
    "P": Parameter,
    "V": Variable,
    "S": Status,
}


@dataclass(frozen=True, slots=True)
class Finding:
    """A problem at a place of a record's text."""

    at: int
    severity: Severity
    message: str
    hint: str


@dataclass(slots=True)
class Furthest:
    """How far any form got, and what could have come there."""

    at: int = -1
    expected: dict[str, None] = field(default_factory=dict)

    def missed(self, at: int, *expected: str) -> None:
        """Note that one of *expected* was looked for at *at*."""
        if at > self.at:
            self.at, self.expected = at, {}
        if at == self.at:
            self.expected.update(dict.fromkeys(expected))


@dataclass(slots=True)
class Scan:
    """One form, tried on one text without blanks; and what was found on the way."""

    text: str
    decimals: int
    furthest: Furthest
    at: int = 0
    record: Record | None = None
    findings: list[Finding] = field(default_factory=list)
    numbers: list[tuple[int, int]] = field(default_factory=list)
    """From where to where digits stand that belong together."""
    reads: list[tuple[Variable, int]] = field(default_factory=list)
    jump_at: int = 0
    first: int = 0
    """The number of the input or output last read: levels begin there."""

    def match(self, pattern: tuple[Piece, ...]) -> list[Any] | None:
        """Return what stands in the places of *pattern*, or None if the text does not fit to its end."""
        values = []
        for piece in pattern:
            if piece.place is None:
                if not self._word(piece.spellings):
                    return None
            elif (value := _PLACES[piece.place](self)) is None:
                return None
            else:
                values.append(value)
        if self.at < len(self.text):
            self.furthest.missed(self.at, "the end of the record")
            return None
        return values

    def problem(self, at: int, message: str, hint: str, severity: Severity = Severity.ERROR) -> None:
        """Note a problem that does not keep the text from being read."""
        self.findings.append(Finding(at, severity, message, hint))

    def found(self, pattern: re.Pattern[str], expected: str) -> re.Match[str] | None:
        """Match *pattern* here and go on behind it, or note that it was *expected*."""
        found = pattern.match(self.text, self.at)
        if found is None:
            self.furthest.missed(self.at, expected)
            return None
        self.numbers.append(found.span())
        self.at = found.end()
        return found

    def sign(self, signs: tuple[str, ...]) -> str | None:
        """Read one of *signs*."""
        for each in signs:
            if self.text.startswith(each, self.at):
                self.at += len(each)
                return each
        self.furthest.missed(self.at, *signs)
        return None

    def _word(self, spellings: tuple[str, ...]) -> bool:
        start, found = self.at, self.sign(spellings)
        if found is not None and found == GERMAN_LETTERS.get(spellings[0]):
            self.problem(
                start,
                f"{found} is the German letter; read as {spellings[0]}",
                "write I for inputs and O for outputs",
                Severity.NOTE,
            )
        return found is not None


def scan(text: str, *, decimals: int) -> Scan | Furthest:
    """Read *text*, upper case and without blanks; if it is no record, say how far it got."""
    furthest = Furthest()
    for form in FORMS:
        for pattern in form.patterns:
            attempt = Scan(text, decimals, furthest)
            values = attempt.match(pattern)
            if values is not None:
                attempt.record = form.kind(*values)
                return attempt
    return furthest


def whole_number(digits: str) -> int:
    """Read *digits*; of a number that is too large for anything, nine digits are enough to tell."""
    return int(digits.lstrip("0")[:9] or "0")


# Places ---------------------------------------------------------------------------------------------------------------


def _operand(scan: Scan, name: str) -> Operand | None:
    fact, start = NUMBERS[name], scan.at
    if named := _OPERAND.match(scan.text, start):
        scan.at = named.end()
        operand = _named(scan, named, _IN_PLACE_OF_A_NUMBER)
        return None if isinstance(operand, Status) else operand
    if scan.found(_NUMBER, f"{fact.meaning} (a number, .P40-.P49 or .V1-.V39)") is None:
        return None
    return _in_range(scan, start, fact)


def _value(scan: Scan) -> Value | None:
    start = scan.at
    if named := _VALUE.match(scan.text, start):
        scan.at = named.end()
        return _named(scan, named, _BY_THEMSELVES)
    if scan.found(_NUMBER, "Pn, Vn, Sn or a constant") is None:
        return None
    return _in_range(scan, start, NUMBERS["constant"])


def _named(scan: Scan, found: re.Match[str], known: _Known) -> Parameter | Variable | Status:
    start, letter, number = found.start(), found[1], whole_number(found[2])
    scan.numbers.append((found.start(2), found.end(2)))
    numbers, names = known[letter]
    if number not in numbers:
        scan.problem(start, f"{found[0]:.20} does not exist here", f"use one of {names} (UG p. 100, IBS p. 12, 24)")
    operand = _KINDS[letter](number)
    if isinstance(operand, Variable) and number in VARIABLES:
        scan.reads.append((operand, start))
    return operand


def _in_range(scan: Scan, start: int, fact: NumberFact) -> Decimal:
    text = scan.text[start : scan.at]
    number, what = Decimal(text), f"{fact.meaning} of {text:.20} {fact.unit}".rstrip()
    if not fact.low <= number <= fact.high or (fact.above_low and number == fact.low):
        low = "above 0" if fact.above_low else f"from {fact.low}"
        scan.problem(start, f"{what} is out of range", f"{low} to {fact.high} is possible ({fact.source})")
    decimals = scan.decimals if fact.decimals is None else fact.decimals
    if len(text.partition(".")[2].rstrip("0")) > decimals:
        held = f"at most {decimals} decimals" if decimals else "a whole number"
        scan.problem(start, f"{what} cannot be held by the drive", f"write {held} ({fact.source})")
    return number


def _target(scan: Scan) -> Parameter | Variable | None:
    found = scan.found(_TARGET, "a program command")
    if found is None:
        return None
    target = _named(scan, found, _BY_THEMSELVES)
    scan.reads.clear()  # written, not read
    if isinstance(target, Parameter) and target.number in PARAMETERS and target.number not in CONTROL_PARAMETERS:
        scan.problem(
            found.start(),
            f"P{target.number} is none of the control parameters P40-P49",
            "whether a program may write it, and from when on it counts, stands on no page at hand; use P40-P49",
            Severity.WARNING,
        )
    return None if isinstance(target, Status) else target


def _plain(scan: Scan, meaning: str, known: range | Mapping[int, str], hint: str) -> int | None:
    found = scan.found(_DIGITS, meaning)
    if found is None:
        return None
    number = whole_number(found[0])
    if number not in known:
        scan.problem(found.start(), f"{found[0]:.20} is not {meaning}", hint)
    return number


def _record(scan: Scan) -> int | None:
    scan.jump_at = scan.at
    return _plain(scan, "a record number", RECORD_NUMBERS, "records are 1 to 250 (UG p. 95)")


def _password(scan: Scan) -> int | None:
    found = _DIGITS.match(scan.text, scan.at)
    number = whole_number(found[0]) if found else 0
    if found is None or number not in PASSWORDS:
        return None  # the next form, a jump, says what was expected
    scan.numbers.append(found.span())
    scan.at = found.end()
    return number


def _level(scan: Scan) -> bool | None:
    found = scan.found(_LEVELS, "0 or 1")
    if found is None:
        return None
    if len(found[0]) > 1:
        scan.problem(found.start(), f"{found[0]:.20} is not one digit", "a comparator sets one output to 0 or 1")
    return found[0][0] == "1"


def _levels(scan: Scan) -> tuple[bool, ...] | None:
    start, found = scan.at, scan.found(_LEVELS, "1 to 8 digits, each 0 or 1")
    if found is None:
        return None
    scan.numbers.pop()  # a blank between the levels of two groups is all right
    levels = tuple(digit == "1" for digit in found[0])
    first, last = scan.first, scan.first + len(levels) - 1
    if len(levels) > MAX_LEVELS:
        scan.problem(
            start, f"{len(levels)} digits are too many", f"at most {MAX_LEVELS} follow one another (CAN p. 59)"
        )
    elif first in OUTPUT_NUMBERS and last not in OUTPUT_NUMBERS:
        scan.problem(
            start, f"{len(levels)} digits from {first} on reach up to {last}", "16 is the last (CAN p. 59, 61)"
        )
    return levels


def _output(scan: Scan) -> int | None:
    number = _plain(scan, "the number of an output", OUTPUT_NUMBERS, "outputs are 1 to 16, as far as is known")
    scan.first = number or 0
    return number


def _input(scan: Scan) -> int | None:
    number = _plain(scan, "the number of an input", INPUT_NUMBERS, "inputs are 1 to 16 (UG p. 100)")
    scan.first = number or 0
    return number


def _mode(scan: Scan) -> int | None:
    hint = "OUTPUT O0 switches the drive and takes 0, 1 or 2 (UG p. 209); outputs begin with O1"
    return _plain(scan, "0, 1 or 2", POWER_MODES, hint)


def _jump(scan: Scan) -> Jump | None:
    word = scan.sign(("GOTO", "GOSUB"))
    record = _record(scan) if word else None
    if record is None:
        return None
    return Goto(record) if word == "GOTO" else Gosub(record)


_PLACES: Final[Mapping[str, Callable[[Scan], object | None]]] = {
    **{name: partial(_operand, name=name) for name in NUMBERS},
    "value": _value,
    "target": _target,
    "comparison": lambda scan: scan.sign(COMPARISON_SIGNS),
    "arithmetic": lambda scan: scan.sign(ARITHMETIC_SIGNS),
    "jump": _jump,
    "record": _record,
    "password": _password,
    "output": _output,
    "input": _input,
    "mode": _mode,
    "level": _level,
    "levels": _levels,
}
