"""A listing as text into its records, each with its place; what cannot be read becomes a problem."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from typing import Final

from ..facts.limits import POSITION_DECIMALS
from ..facts.program_commands import RECORD_NUMBERS, RECORD_TEMPLATE
from .printing import record_text
from .problems import Problem, Severity, raise_for_errors
from .records import Program, Record, Variable
from .scanning import Furthest, Scan, scan, whole_number

__all__ = ["COMMENT", "Reading", "SourceRecord", "normalise", "parse", "parse_record", "read"]

_LINE_END: Final = re.compile(r"\r\n|\r|\n")
_NUMBERED: Final = re.compile(r"N([0-9]+):?")
_NEXT_RECORD: Final = re.compile(r"N[0-9]+:")
COMMENT: Final = ";"
_LONGEST: Final = 100
"""Characters without blanks: no record has a third of it, and reading the numbers in longer ones takes time."""

_MOST_ERRORS: Final = 250
"""There are no more records than that; reading on would take time, and tell nobody anything."""

_SHOWN: Final = 5
"""Of what could have stood there, so many are named."""

_HINTS: Final = {
    ",": "the decimal sign is a point (IBS p. 23)",
    **{sign: f"{sign} is a sign of the line and not part of a record (UG p. 160)" for sign in "$?!"},
}


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceRecord:
    """One record and where it stands."""

    number: int
    record: Record
    line: int
    column: int
    """Of the record's text, behind its number."""
    jump_column: int
    """Of the record number that it jumps to or calls."""
    reads: tuple[tuple[Variable, int], ...]
    """The variables V1-V39 that it reads, each with its column."""


@dataclass(frozen=True, slots=True)
class Reading:
    """What a listing says, as far as it can be read, and what is wrong with it."""

    sources: dict[int, SourceRecord] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)
    unread: dict[int, int] = field(default_factory=dict)
    """Numbers of records that stand in the listing but could not be read, each with its line."""
    is_whole: bool = True
    """False: it has so many errors that the rest was not read."""

    @property
    def program(self) -> Program:
        """The records that could be read."""
        return Program({number: source.record for number, source in self.sources.items()})


def parse(text: str, *, decimals: int = POSITION_DECIMALS) -> Program:
    """
    Read a listing: a record a line, such as ``N001: ACCEL 250``; what follows ``;`` is a comment.

    Taken as well: no colon, numbers without leading zeros, blanks anywhere but in a number, small letters, the
    abbreviations of direct mode. Whether the program makes sense is not looked at: that is ``check()``.

    Args:
        text: The listing.
        decimals: Of positions and distances: 2, or 3 where the unit is inches (UG p. 100).

    Raises:
        InvalidCommandError: It cannot be read, or has numbers that the drive does not take; all errors in its text.
    """
    reading = read(text, decimals=decimals)
    raise_for_errors(reading.problems)
    return reading.program


def parse_record(text: str, *, decimals: int = POSITION_DECIMALS) -> Record:
    """
    Read one record without its number: ``POSR 10 SPEED 50``.

    Raises:
        InvalidCommandError: It is not one record, or has numbers that the drive does not take.
    """
    reading = Reading()
    text, source = text.rstrip("\r\n"), None
    if not _LINE_END.search(text):
        source = _read_record(reading, 1, 1, _Line(text), decimals)
    else:
        reading.problems.append(_error(1, 1, "more than one line is more than one record", "give one record"))
    raise_for_errors(reading.problems)
    assert source is not None, "what cannot be read has an error"
    return source.record


def read(text: str, *, decimals: int = POSITION_DECIMALS) -> Reading:
    """
    Read a listing as ``parse()`` does; never raises, but tells what is wrong, and keeps the rest.

    After 250 errors it reads no further, and says so.
    """
    reading = Reading()
    for line_number, line in enumerate(_LINE_END.split(text), start=1):
        if sum(problem.severity is Severity.ERROR for problem in reading.problems) >= _MOST_ERRORS:
            reading.problems.append(_error(line_number, 1, "so many errors that the rest was not read", "mend these"))
            return replace(reading, is_whole=False)
        _read_line(reading, line_number, _Line(line.partition(COMMENT)[0]), decimals)
    return reading


def normalise(text: str) -> str:
    """
    Write *text* so that two texts of the same records are equal, however blanks, words and numbers are written.

    For comparing what the drive reads back with what was written, with or without record numbers. Never raises: what
    is no record stays as it is, in capitals and without blanks.
    """
    lines = (_normal_line(_Line(line.partition(COMMENT)[0])) for line in _LINE_END.split(text))
    return "\n".join(line for line in lines if line)


class _Line:
    """A line in capitals without its blanks, and where each of its characters stands."""

    def __init__(self, text: str) -> None:
        # Capitals of ASCII only: others may be longer than their small letters.
        kept = [(each.upper() if each.isascii() else each, at) for at, each in enumerate(text, 1) if each not in " \t"]
        self.text = "".join(each for each, _ in kept)
        self._columns = [*(at for _, at in kept), len(text.rstrip(" \t")) + 1]

    def from_(self, at: int) -> _Line:
        rest = _Line("")
        rest.text, rest._columns = self.text[at:], self._columns[at:]
        return rest

    def column(self, at: int) -> int:
        return self._columns[at]

    def is_torn(self, start: int, end: int) -> bool:
        """Whether blanks were taken out between the digits from *start* to *end*."""
        if self.text[start] in "+-":
            start += 1
        return self.column(end - 1) - self.column(start) != end - 1 - start


def _normal_line(line: _Line) -> str:
    numbered = _NUMBERED.match(line.text)
    text, prefix = line.text, None
    if numbered:
        text, prefix = line.text[numbered.end() :], numbered[1]
    found = scan(text, decimals=POSITION_DECIMALS) if len(text) <= _LONGEST else None
    written = record_text(found.record) if isinstance(found, Scan) and found.record else text
    return written if prefix is None else RECORD_TEMPLATE.format(n=whole_number(prefix), text=written).rstrip()


def _read_line(reading: Reading, line_number: int, line: _Line, decimals: int) -> None:
    if not line.text:
        return
    numbered = _NUMBERED.match(line.text)
    if numbered is None:
        message = f"{line.text[:20]!r} has no record number"
        reading.problems.append(_error(line_number, line.column(0), message, "begin the line like N001:"))
        return
    number, column = whole_number(numbered[1]), line.column(0)
    if line.is_torn(*numbered.span(1)):
        message = "a blank stands within the record number"
        reading.problems.append(_error(line_number, line.column(1), message, "write it in one: N001"))
    if number not in RECORD_NUMBERS:
        message = f"N{numbered[1]:.20} is no record"
        reading.problems.append(_error(line_number, column, message, "records are N001 to N250 (UG p. 95)"))
    source = _read_record(reading, number, line_number, line.from_(numbered.end()), decimals)
    first = reading.sources[number].line if number in reading.sources else reading.unread.get(number)
    if first is not None:
        message = f"N{number:03d} is there twice, first in line {first}"
        reading.problems.append(_error(line_number, column, message, "give it another number, or take one out"))
    elif source is None:
        reading.unread[number] = line_number
    elif number in RECORD_NUMBERS:
        reading.sources[number] = source


def _read_record(reading: Reading, number: int, line_number: int, line: _Line, decimals: int) -> SourceRecord | None:
    for at, character in enumerate(line.text):
        if not "!" <= character <= "~":
            message = f"{character!r} cannot be sent: a line is printable ASCII (UG p. 160)"
            reading.problems.append(_error(line_number, line.column(at), message, "take it out"))
            return None
    if len(line.text) > _LONGEST:
        message = f"{line.text[:20]!r}… has {len(line.text)} characters and is no record"
        reading.problems.append(_error(line_number, line.column(0), message, "write one record a line"))
        return None
    found = scan(line.text, decimals=decimals)
    if isinstance(found, Furthest):
        message, hint = _what_is_missing(line.text, found)
        reading.problems.append(_error(line_number, line.column(found.at), message, hint))
        return None
    for finding in found.findings:
        reading.problems.append(
            Problem(
                line=line_number,
                column=line.column(finding.at),
                severity=finding.severity,
                message=finding.message,
                hint=finding.hint,
            )
        )
    for start, end in found.numbers:
        if line.is_torn(start, end):
            message = f"a blank stands within the number {line.text[start:end]:.20}"
            reading.problems.append(_error(line_number, line.column(start), message, "write the number in one"))
    assert found.record is not None, "a scan that matched has its record"
    return SourceRecord(
        number=number,
        record=found.record,
        line=line_number,
        column=line.column(0),
        jump_column=line.column(found.jump_at),
        reads=tuple((variable, line.column(at)) for variable, at in found.reads),
    )


def _what_is_missing(text: str, furthest: Furthest) -> tuple[str, str]:
    rest = text[furthest.at :]
    shown = [*furthest.expected][:_SHOWN]
    more = ", …" if len(furthest.expected) > _SHOWN else ""
    expected = "here may stand: " + ", ".join(shown) + more
    if not text:
        return "the record is empty", "write a command behind its number, such as END"
    if not rest:
        return f"{text[:20]!r} breaks off", expected
    if furthest.at == 0:
        return f"no program command begins like {rest[:20]!r}", "commands are listed in the manual (UG p. 95)"
    message = f"{rest[:20]!r} cannot be read here"
    if _NEXT_RECORD.search(rest):
        return message, "write one record a line"
    return message, _HINTS.get(rest[0], expected)


def _error(line: int, column: int, message: str, hint: str) -> Problem:
    return Problem(line=line, column=column, severity=Severity.ERROR, message=message, hint=hint)
