"""What is wrong with a program or a file of data, said before a byte of it is sent: where, what, and what to do."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Final, TypeVar

from ..errors import InvalidCommandError
from ..escaping import shown
from ..severity import Severity
from .facts.alarms import ALARMS
from .facts.characters import NEVER_IN_A_FILE, PERCENT, name_of
from .facts.data_files import CHECKSUM_NUMBER, DATA_FILES, LAST_NUMBER, DataKind, Presence
from .facts.programs import DNC_MAX_LINE_NUMBER, LONG_BLOCK_BYTES
from .language.data_file import DataFile, DataLine, fault_of, kind_of_data, lines_of_data
from .language.lines import LINE_ENDS, SKIPPED, Lines, as_bytes, matches
from .language.program_file import Program, ProgramFile, parse_program_file
from .problems import Finding, Kind, Problem, raise_for_errors, some, told
from .profiles import CLASSIC, Profile

__all__ = ["Problem", "check_bare_program", "check_data_file", "check_program", "has_text_behind", "raise_for_errors"]

_T = TypeVar("_T")

# Programs ------------------------------------------------------------------------------------------------------------


def check_program(
    file: ProgramFile | str | bytes,
    profile: Profile = CLASSIC,
    *,
    for_dnc: bool = False,
    protected: bool = False,
    semicolons: bool = False,
) -> tuple[Problem, ...]:
    r"""
    Say what is wrong with a program file, in its order, and at last what was only counted; nothing found: ``()``.

    What is looked at: characters that are no 7-bit ASCII, control characters, semicolons and small letters outside of
    comments; the ``%`` lines, exactly one in front and one behind; names, missing, not possible, protected or twice;
    line numbers that are too high for DNC; long blocks, comments without end, an empty file. Whether the codes mean
    anything to the machine is not asked. Of each kind 20 are told one by one, the others are counted.

    Args:
        file: A file, text, or bytes.
        profile: The control.
        for_dnc: It is to be fed by DNC: nothing is stored, so that names do not matter, but line numbers do.
        protected: Programs that the profile protects, 8000 to 9999, are meant to be overwritten: told as notes.
        semicolons: They are meant: each makes a blank line (Haas 11596-8000); told as notes.

    Raises:
        InvalidCommandError: A character of the text has no code of 8 bits.

    >>> for problem in check_program(b"%\nO01234\nG0 X1;\nM30\n%\n"):
    ...     print(problem.line, problem.column, problem.what)
    3 6 a semicolon
    """
    if not isinstance(file, ProgramFile):
        file = parse_program_file(file, eob=profile.eob)
    lines = Lines(file.data, file.eob)
    findings = [
        *_about_frame(lines),
        *_about_programs(file, lines, profile, for_dnc=for_dnc, protected=protected, semicolons=semicolons),
    ]
    return told(findings, lines)


def check_bare_program(
    source: ProgramFile | Program, profile: Profile, *, for_dnc: bool, protected: bool, semicolons: bool
) -> tuple[Problem, ...]:
    """
    Say what is wrong with programs that the ``%`` lines are still to be put around.

    Args:
        source: Without ``%`` lines; or a program of a file: places are those in that file.
        profile: The control.
        for_dnc: See :func:`check_program`.
        protected: The same.
        semicolons: The same.
    """
    file = source if isinstance(source, ProgramFile) else parse_program_file(bytes(source), eob=profile.eob)
    lines = Lines(file.data, file.eob)
    findings = _about_programs(file, lines, profile, for_dnc=for_dnc, protected=protected, semicolons=semicolons)
    problems = told(list(findings), lines)
    if isinstance(source, ProgramFile):
        return problems
    return tuple(
        replace(each, line=each.line + source.line - 1, offset=each.offset + source.offset) for each in problems
    )


def _about_programs(
    file: ProgramFile, lines: Lines, profile: Profile, *, for_dnc: bool, protected: bool, semicolons: bool
) -> Iterator[Finding]:
    """Look at all that stands between the ``%`` lines."""
    begin, end = lines.offsets[lines.first], lines.offsets[lines.behind]
    body = file.data[begin:end]
    masked = _without_comments(body)
    yield from _about_signs(body, begin)
    yield from _about_semicolons(body, begin, Severity.NOTE if semicolons else Severity.ERROR)
    yield from _about_percents(body, masked, begin)
    yield from _about_words(masked, body, begin)
    yield from _about_bad_names(file.programs, profile)
    if for_dnc:
        yield from _about_line_numbers(masked, begin)
    else:  # what is fed is not stored, whatever its name
        yield from _about_names(file.programs, profile, protected=protected)
    if not file.programs:
        what, hint = "there is no program", "put one between the % lines"
        yield Finding(Kind.PARTS, begin, Severity.ERROR, what, hint, ALARMS["empty-program"])


_COMMENT: Final = re.compile(rb"\([^)\r\n]*\)?")
_EIGHT_BITS: Final = re.compile(rb"[\x80-\xff]+")
_CONTROL: Final = re.compile(rb"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]")
_LOWER_CASE: Final = re.compile(rb"[a-z]+")
_LONG: Final = re.compile(rb"[^\r\n]{%d,}" % (LONG_BLOCK_BYTES + 1))
_WITH_PERCENT: Final = re.compile(rb"(?<![^\r\n])[^\r\n%]*%[^\r\n]*")
_LINE_NUMBER: Final = re.compile(rb"(?<![A-Z0-9#.\[])N[ \t]*0*([1-9][0-9]{5,})")


def _without_comments(body: bytes) -> bytes:
    """Put blanks in their place; here and not by sub(), which keeps each piece for itself until the end."""
    masked = bytearray(body)
    for match in matches(_COMMENT, body):
        masked[match.start() : match.end()] = b" " * len(match[0])
    return bytes(masked)


def _about_frame(lines: Lines) -> Iterator[Finding]:
    """Look at the ``%`` lines, and at what stands outside of them."""
    size = len(lines.data)
    if lines.start is None:
        hint = "put % alone in a line in front of all else"
        yield Finding(Kind.PARTS, 0, Severity.ERROR, "it does not begin with %", hint)
    if lines.end is None:
        hint = "put % alone in the last line; if it was there once, the file has been cut short"
        yield Finding(Kind.PARTS, size, Severity.ERROR, "it does not end with %", hint, ALARMS["unexpected-end"])
    yield from some((at for at in lines.percents if at not in (lines.start, lines.end)), _percent_line_of(lines))
    if lines.lead_in.strip(SKIPPED + LINE_ENDS):
        what = f"{len(lines.lead_in)} bytes in front of the first %"
        hint = "they are not sent: a control takes what stands between the % lines alone"
        yield Finding(Kind.OUTSIDE, 0, Severity.WARNING, what, hint)
    if has_text_behind(lines.tail):
        what = f"{len(lines.tail)} bytes behind the last %"
        hint = "they would not be sent: put them in front of it, or take them out"
        yield Finding(Kind.OUTSIDE, size - len(lines.tail), Severity.ERROR, what, hint)


def has_text_behind(tail: bytes) -> bool:
    """Whether there is more behind the last ``%`` than ends of blocks, fill, leader and punch codes."""
    return bool(tail.strip(SKIPPED + LINE_ENDS))


def _percent_line_of(lines: Lines) -> Callable[[int], Finding]:
    what = "a % line between the first and the last one"
    hint = "one pair of % stands around all programs: the control may take each for the last one"
    return lambda at: Finding(Kind.PERCENT_LINE, lines.offsets[at], Severity.ERROR, what, hint)


def _at(kind: Kind, severity: Severity, what: str, hint: str, begin: int) -> Callable[[int], Finding]:
    """Return how a finding is made of an offset within the body."""
    return lambda at: Finding(kind, begin + at, severity, what, hint)


def _about_signs(body: bytes, begin: int) -> Iterator[Finding]:
    yield from some(() if body.isascii() else matches(_EIGHT_BITS, body), lambda match: _eight_bits(match, begin))
    yield from some(matches(_CONTROL, body), lambda match: _control(match, begin))
    yield from some(_places_of(b"\t", body), _at(Kind.TAB, Severity.WARNING, "a tab", "write blanks", begin))


def _eight_bits(match: re.Match[bytes], begin: int) -> Finding:
    what = f"{shown(match[0][:20].decode('latin-1'))} is no 7-bit ASCII"
    hint = "write it with other characters: on a line of 7 bits another one arrives"
    return Finding(Kind.EIGHT_BITS, begin + match.start(), Severity.ERROR, what, hint)


def _control(match: re.Match[bytes], begin: int) -> Finding:
    code = match[0][0]
    is_sign = code in NEVER_IN_A_FILE
    hint = "the line takes it for a sign of its own; take it out" if is_sign else "it is no text; take it out"
    return Finding(Kind.CONTROL, begin + match.start(), Severity.ERROR, f"{name_of(code)} in a program", hint)


def _about_semicolons(body: bytes, begin: int, severity: Severity) -> Iterator[Finding]:
    hint = "it is how screens show the end of a block; received, it makes a blank line (Haas 11596-8000)"
    yield from some(_places_of(b";", body), _at(Kind.SEMICOLON, severity, "a semicolon", hint, begin))


def _about_percents(body: bytes, masked: bytes, begin: int) -> Iterator[Finding]:
    """Look for ``%`` that is not alone in its line: what a control makes of it is not known."""
    hint = "the control may take it for the end of the data; take it out, or put it alone in the last line"
    yield from some(
        (at for at in _percents_within(body) if masked[at] == PERCENT),
        _at(Kind.PERCENT, Severity.ERROR, "a % within a block", hint, begin),
    )
    yield from some(
        (at for at in _percents_within(body) if masked[at] != PERCENT),
        _at(Kind.PERCENT_IN_COMMENT, Severity.WARNING, "a % within a comment", hint, begin),
    )


def _places_of(what: bytes, body: bytes) -> Iterator[int]:
    at = body.find(what)
    while at >= 0:
        yield at
        at = body.find(what, at + 1)


def _percents_within(body: bytes) -> Iterator[int]:
    for line in matches(_WITH_PERCENT, body):
        if line[0].strip(SKIPPED) != b"%":
            yield from (line.start() + at for at in _places_of(b"%", line[0]))


def _about_words(masked: bytes, body: bytes, begin: int) -> Iterator[Finding]:
    yield from some(matches(_LOWER_CASE, masked), lambda match: _lower_case(match, begin))
    yield from some(
        (match.start() for match in matches(_COMMENT, body) if not match[0].endswith(b")")),
        _at(Kind.COMMENT, Severity.WARNING, "a comment that does not end in its line", "close it with )", begin),
    )
    yield from some(matches(_LONG, body), lambda match: _long(match, begin))


def _lower_case(match: re.Match[bytes], begin: int) -> Finding:
    found = shown(match[0][:20].decode("ascii"))
    what = f"{found} is {'a small letter' if len(match[0]) == 1 else 'in small letters'} outside of a comment"
    where = begin + match.start()
    return Finding(Kind.LOWER_CASE, where, Severity.ERROR, what, "write capital letters", ALARMS["invalid-code"])


def _long(match: re.Match[bytes], begin: int) -> Finding:
    what = f"a block of {len(match[0])} bytes"
    hint = f"write it in several; what a control takes is not known, {LONG_BLOCK_BYTES} bytes are likely"
    return Finding(Kind.LONG, begin + match.start(), Severity.WARNING, what, hint)


def _about_line_numbers(masked: bytes, begin: int) -> Iterator[Finding]:
    high = (match for match in matches(_LINE_NUMBER, masked) if int(match[1][:9]) > DNC_MAX_LINE_NUMBER)
    yield from some(high, lambda match: _line_number(match, begin))


def _line_number(match: re.Match[bytes], begin: int) -> Finding:
    what = f"{match[0][:20].decode('ascii')} is above {DNC_MAX_LINE_NUMBER}"
    hint = "take the N words out: line numbers above about 100 000 have crashed a control in DNC"
    return Finding(Kind.LINE_NUMBER, begin + match.start(), Severity.ERROR, what, hint)


def _about_names(programs: tuple[Program, ...], profile: Profile, *, protected: bool) -> Iterator[Finding]:
    """Look at names of programs that are to be stored."""
    yield from some((each for each in programs if each.name is None), _no_name)
    named = [each for each in programs if each.number is not None]
    yield from some(_doubles((each.number, each) for each in named), _double_name)
    yield from some(
        (each for each in named if profile.protects(each.number or 0)),
        lambda program: _protected(program, Severity.NOTE if protected else Severity.ERROR),
    )


def _about_bad_names(programs: tuple[Program, ...], profile: Profile) -> Iterator[Finding]:
    digits = profile.o_digits
    bad = (each for each in programs if each.name is not None and (each.number is None or each.number >= 10**digits))
    yield from some(bad, lambda program: _bad_name(program, digits))


def _no_name(program: Program) -> Finding:
    what = "blocks without the name of a program in front"
    hint = "begin each program with O and its number, alone or with its comment in a line"
    return Finding(Kind.NAME, program.offset, Severity.ERROR, what, hint, ALARMS["no-program-name"])


def _bad_name(program: Program, digits: int) -> Finding:
    what = f"{shown(program.blocks[0].text[:20])} is no name of a program"
    hint = f"it is O and a number of at most {digits} digits"
    return Finding(Kind.BAD_NAME, program.offset, Severity.ERROR, what, hint, ALARMS["illegal-program-name"])


def _double_name(found: tuple[Program, Program]) -> Finding:
    first, again = found
    what = f"{_name_of(again)} is there already, in line {first.line}"
    return Finding(Kind.DOUBLE, again.offset, Severity.ERROR, what, "give each program a number of its own")


def _protected(program: Program, severity: Severity) -> Finding:
    what = f"{_name_of(program)} is protected: probing and the vendor's macros have such numbers"
    is_meant = severity is Severity.NOTE
    hint = "it overwrites what is there" if is_meant else "choose another number, or say that it is meant"
    return Finding(Kind.PROTECTED, program.offset, severity, what, hint)


def _name_of(program: Program) -> str:
    return "" if program.name is None else program.name.text


def _doubles(numbered: Iterable[tuple[int | None, _T]]) -> Iterator[tuple[_T, _T]]:
    """Give each that has the number of an earlier one, behind that."""
    first: dict[int | None, _T] = {}
    for number, each in numbered:
        if number in first:
            yield first[number], each
        else:
            first[number] = each


# Numbered data -------------------------------------------------------------------------------------------------------


def check_data_file(
    file: DataFile | str | bytes, kind: DataKind | str | None = None, *, force: bool = False
) -> tuple[Problem, ...]:
    r"""
    Say what is wrong with a file of parameters, settings, offsets or macro variables; nothing found: ``()``.

    What is looked at: the ``%`` lines; lines that are no ``N… V…``; numbers that come twice; N0, which parameters must
    have and macro variables must not; N9999, which macro variables must have (Haas 11596-8000).

    Args:
        file: A file, text, or bytes.
        kind: Of text or bytes: ``"parameters"``, ``"settings"``, ``"offsets"`` or ``"macros"``.
        force: Macro variables may lack N9999: told as a warning.

    Raises:
        InvalidCommandError: There is no such kind, or none is given.

    >>> for problem in check_data_file(b"%\nN1 V100\n%\n", "parameters"):
    ...     print(problem.line, problem.what, "-", problem.alarm)
    2 there is no N0 - alarm CRC ERROR (number not known)
    """
    if isinstance(file, DataFile):
        kind, lines = file.kind, Lines(file.data, file.eob)
    elif kind is None:
        raise InvalidCommandError("of what the data are must be said", hint=f"kind is one of {', '.join(DataKind)}")
    else:
        kind, lines = kind_of_data(kind), Lines(as_bytes(file))
    read: list[DataLine] = []
    wrong: list[int] = []
    for each in lines_of_data(lines):
        if isinstance(each, DataLine):
            read.append(each)
        elif lines.raw[each].strip(SKIPPED + LINE_ENDS) != b"%":
            wrong.append(each)
    findings = [
        *_about_frame(lines),
        *some(wrong, lambda at: _no_line(lines, at)),
        *_about_presence(kind, read, lines.offsets[lines.first], force=force),
        *some(_doubles((each.number, each) for each in read), _double_number),
    ]
    return told(findings, lines)


def _no_line(lines: Lines, at: int) -> Finding:
    fault = fault_of(lines.raw[at])
    offset = lines.offsets[at] + fault.column - 1
    hint = "take the line as the control has sent it"
    return Finding(Kind.LINE, offset, Severity.ERROR, fault.what, hint, fault.alarm)


def _double_number(found: tuple[DataLine, DataLine]) -> Finding:
    first, again = found
    what = f"N{again.number} is there already, in line {first.line}"
    return Finding(Kind.NUMBER, again.offset, Severity.ERROR, what, "keep one of them")


def _about_presence(kind: DataKind, read: list[DataLine], begin: int, *, force: bool) -> Iterator[Finding]:
    rules = DATA_FILES[kind]
    checksum = next((each for each in read if each.number == CHECKSUM_NUMBER), None)
    if not any(each.is_data for each in read):
        what, hint = f"there is no {rules.singular}", "receive the file from the control again"
        yield Finding(Kind.PARTS, begin, Severity.ERROR, what, hint)
    if rules.checksum is Presence.MANDATORY and checksum is None:
        hint = f"send the file as the control has sent it: N0 is mandatory with {kind}"
        yield Finding(Kind.PARTS, begin, Severity.ERROR, "there is no N0", hint, ALARMS["wrong-checksum"])
    if rules.checksum is Presence.ABSENT and checksum is not None:
        hint = f"take the line out: a file of {rules.singular}s has none"
        yield Finding(Kind.PARTS, checksum.offset, Severity.ERROR, "there is an N0", hint)
    if rules.last_line is Presence.MANDATORY and all(each.number != LAST_NUMBER for each in read):
        severity = Severity.WARNING if force else Severity.ERROR
        hint = "keep that line where the control has it: something is missing without it"
        yield Finding(Kind.PARTS, begin, severity, "there is no N9999", hint)
