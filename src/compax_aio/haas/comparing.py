"""In what two files differ: data by their numbers, programs by their blocks; what does not matter is left out."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from itertools import zip_longest
from typing import Final

from ..errors import InvalidCommandError
from ..escaping import shown
from .facts import port_settings, variables
from .facts.data_files import CHECKSUM_NUMBER, LAST_NUMBER, DataKind
from .language.data_file import DataFile, DataLine
from .language.lines import IGNORED, LINE_ENDS, SKIPPED
from .language.program_file import Block, Program, ProgramFile, parse_program_file

__all__ = [
    "Comparison",
    "Difference",
    "How",
    "ProgramDifference",
    "compare_data",
    "diff",
    "first_difference",
    "same_program",
]

# Numbered data -------------------------------------------------------------------------------------------------------


class How(Enum):
    """How a number differs."""

    CHANGED = "changed"
    MISSING = "missing"
    """It is in the first file alone."""
    ADDED = "added"
    """It is in the second file alone."""
    MOVED = "moved"
    """The same numbers come in another order, from here on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """One number whose value differs."""

    number: int
    """Of the datum; of the program, 0 if it has none."""
    name: str
    """As far as the tables know it; else empty. Of a program its ``O`` and digits."""
    how: How
    before: str | None
    """The value as text, without blanks; of a program, the block. None if it is not there."""
    after: str | None
    before_line: int | None
    """In the file, from 1; None if it is not there."""
    after_line: int | None

    def __str__(self) -> str:
        """Write ``N11 (BAUD RATE SELECT): 9600 became 19200``."""
        which = f"N{self.number} ({self.name})" if self.name else f"N{self.number}"
        match self.how:
            case How.CHANGED:
                return f"{which}: {self.before} became {self.after}"
            case How.MISSING:
                return f"{which}: is missing, was {self.before}"
            case How.ADDED:
                return f"{which}: is new, {self.after}"
            case How.MOVED:
                return f"{which}: stood in line {self.before_line}, stands in line {self.after_line}"


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramDifference(Difference):
    """The first block in which a program differs, or where one of the two ends."""

    def __str__(self) -> str:
        """Write ``O01234, line 7: 'G0X1' became 'G0X2' (line 8)``."""
        which = self.name or "a program without a name"
        match self.how:
            case How.MISSING:
                return f"{which}, line {self.before_line}: {shown(self.before)} is missing"
            case How.ADDED:
                return f"{which}: {shown(self.after)} is new (line {self.after_line})"
            case _:
                became = f"{shown(self.before)} became {shown(self.after)} (line {self.after_line})"
                return f"{which}, line {self.before_line}: {became}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Two files of numbered data beside each other."""

    differences: tuple[Difference, ...]
    """In the order of the first file, what the second one alone has at the end; N0 is not among them."""
    checksums: tuple[str | None, str | None]
    """The values of N0; they say nothing of the data, for how they are computed is not known."""

    @property
    def is_equal(self) -> bool:
        """Whether all data are the same, in the same order."""
        return not self.differences

    @property
    def checksum_differs(self) -> bool:
        """Whether N0 differs, or one of them has none."""
        return self.checksums[0] != self.checksums[1]


def compare_data(before: DataFile, after: DataFile) -> Comparison:
    """
    Compare two files of the same kind (sheet, sections 5 and 11).

    Numbers and values are compared as text, in order; blanks, ends of lines, lead-in and N0 do not count, N9999 does.

    Raises:
        InvalidCommandError: One has parameters, the other settings: numbers that mean something else.
    """
    if before.kind is not after.kind:
        raise InvalidCommandError(
            f"{before.kind} and {after.kind} cannot be compared", hint="their numbers mean different things"
        )
    left, right = _by_occurrence(before), _by_occurrence(after)
    differences = [_difference(before.kind, key, left.get(key), right.get(key)) for key in {**left, **right}]
    found = [each for each in differences if each is not None]
    moved = _moved(before.kind, left, right)
    return Comparison(differences=(*found, *moved), checksums=(before.checksum, after.checksum))


def diff(before: DataFile | ProgramFile, after: DataFile | ProgramFile) -> tuple[Difference, ...]:
    """
    Return in what two files differ; ``()`` if in nothing that matters.

    Of numbered data each number that differs is told, see ``compare_data()``; of programs, by their numbers, the first
    block in which each differs, see ``first_difference()``.

    Raises:
        InvalidCommandError: They are of different kinds.
    """
    if isinstance(before, ProgramFile) and isinstance(after, ProgramFile):
        return tuple(_between_programs(before, after))
    if isinstance(before, DataFile) and isinstance(after, DataFile):
        return compare_data(before, after).differences
    raise InvalidCommandError("programs and numbered data cannot be compared", hint="give two files of the same kind")


_Key = tuple[int, int]
"""A number, and how often it has come before."""


def _by_occurrence(file: DataFile) -> dict[_Key, DataLine]:
    counts: Counter[int] = Counter()
    found: dict[_Key, DataLine] = {}
    for each in file.lines:
        if each.number != CHECKSUM_NUMBER:
            found[each.number, counts[each.number]] = each
            counts[each.number] += 1
    return found


def _difference(kind: DataKind, key: _Key, before: DataLine | None, after: DataLine | None) -> Difference | None:
    if before is not None and after is not None and before.value == after.value:
        return None
    how = How.ADDED if before is None else How.MISSING if after is None else How.CHANGED
    return _told(kind, key, how, before, after)


def _moved(kind: DataKind, left: Mapping[_Key, DataLine], right: Mapping[_Key, DataLine]) -> Iterable[Difference]:
    """Give the first number of both that stands elsewhere, if one does."""
    order_left = [key for key in left if key in right]
    order_right = [key for key in right if key in left]
    for key, other in zip(order_left, order_right, strict=True):
        if key != other:
            return (_told(kind, key, How.MOVED, left[key], right[key]),)
    return ()


def _told(kind: DataKind, key: _Key, how: How, before: DataLine | None, after: DataLine | None) -> Difference:
    return Difference(
        number=key[0],
        name=_name_of(kind, key[0]),
        how=how,
        before=None if before is None else before.value,
        after=None if after is None else after.value,
        before_line=None if before is None else before.line,
        after_line=None if after is None else after.line,
    )


def _name_of(kind: DataKind, number: int) -> str:
    if kind is DataKind.SETTINGS and number in port_settings.PORT_SETTINGS:
        return port_settings.PORT_SETTINGS[number].name
    if kind is DataKind.MACROS and number != LAST_NUMBER:
        return variables.name_of(number)
    return ""


# Programs ------------------------------------------------------------------------------------------------------------


_COMMENT: Final = re.compile(rb"(\([^)]*\)?)")
_NAME: Final = re.compile(rb"[Oo]0*(?=[0-9])")
_BLANKS: Final = b" \t"


def first_difference(sent: ProgramFile | str | bytes, received: ProgramFile | str | bytes) -> ProgramDifference | None:
    r"""
    Return the first place at which what came back is not what was sent; None if all programs are the same.

    What a control writes in its own way does not count: ends of blocks, blanks between words (Setting 41), leading
    zeros of names, blank blocks at the ends of programs, what stands outside of the ``%`` lines. Comments count as
    they are written, and so do blank blocks within: a control makes one of a semicolon. Programs are found again by
    their numbers.

    Raises:
        InvalidCommandError: A character of a text has no code of 8 bits.

    >>> print(first_difference(b"%\nO1234\nG0 X1\n%\n", b"\r\n%\r\nO01234\r\nG0X2\r\n%\r\n"))
    O1234, line 3: 'G0 X1' became 'G0X2' (line 4)
    """
    ours = sent if isinstance(sent, ProgramFile) else parse_program_file(sent)
    theirs = received if isinstance(received, ProgramFile) else parse_program_file(received)
    return next(_between_programs(ours, theirs), None)


def same_program(sent: ProgramFile | str | bytes, received: ProgramFile | str | bytes) -> bool:
    """Return whether what came back is what was sent; ``first_difference()`` tells what counts, and where it is not."""
    return first_difference(sent, received) is None


def _between_programs(before: ProgramFile, after: ProgramFile) -> Iterator[ProgramDifference]:
    left, right = _programs_by_occurrence(before), _programs_by_occurrence(after)
    for key in {**left, **right}:
        found = _first_in(left.get(key), right.get(key))
        if found is not None:
            yield found


def _programs_by_occurrence(file: ProgramFile) -> dict[tuple[str | int, int], Program]:
    counts: Counter[str | int] = Counter()
    found = {}
    for each in file.programs:
        key = each.number if each.number is not None else "" if each.name is None else each.name.text
        found[key, counts[key]] = each
        counts[key] += 1
    return found


def _first_in(before: Program | None, after: Program | None) -> ProgramDifference | None:
    if before is not None and after is not None and bytes(before) == bytes(after):
        return None
    for one, other in zip_longest(_blocks_of(before), _blocks_of(after)):
        if one is not None and other is not None and (one.raw == other.raw or _bare(one) == _bare(other)):
            continue
        program = before or after
        return ProgramDifference(
            number=(program.number if program else None) or 0,
            name=program.name.text if program and program.name else "",
            how=How.ADDED if one is None else How.MISSING if other is None else How.CHANGED,
            before=None if one is None else one.text,
            after=None if other is None else other.text,
            before_line=None if one is None else one.line,
            after_line=None if other is None else other.line,
        )
    return None


def _blocks_of(program: Program | None) -> Iterable[Block]:
    """Leave out blank blocks at the end: a control has one in front of the last ``%``."""
    return () if program is None else program.blocks.without_blank_end()


def _bare(block: Block) -> bytes:
    """Take the end, leader and punch codes, blanks outside of comments and leading zeros of a name away."""
    line = block.raw.rstrip(LINE_ENDS).strip(SKIPPED).translate(None, IGNORED)
    if b"(" in line:
        parts = _COMMENT.split(line)
        parts[::2] = [part.translate(None, _BLANKS) for part in parts[::2]]
        line = b"".join(parts)
    else:
        line = line.translate(None, _BLANKS)
    return _NAME.sub(b"O", line, count=1) if line[:1] in (b"O", b"o") else line
