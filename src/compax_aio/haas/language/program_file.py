"""Program files: what a control sends and takes, with its programs and blocks, and every byte of it."""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, NamedTuple, overload

from ...errors import InvalidCommandError
from ..facts.eob import EobPattern
from ..facts.programs import MAX_NAME_DIGITS
from .lines import IGNORED, LINE_ENDS, SKIPPED, Lines, as_bytes, matches

__all__ = ["Block", "Blocks", "Name", "Program", "ProgramFile", "name_of_line", "parse_program_file"]

_NAME: Final = re.compile(rb"[Oo][ \t]*([0-9]*)[ \t]*(\([^)]*\)?)?")


_FIRST_SIGN: Final = re.compile(rb"(?<![^\r\n])[" + re.escape(SKIPPED) + rb"]*[Oo]")
"""At the beginning of a line."""
_MOST_PROGRAMS: Final = 10**MAX_NAME_DIGITS


class Block(NamedTuple):
    """One line of a program."""

    line: int
    """In the file, from 1."""
    offset: int
    """Of its first byte in the file, from 0."""
    raw: bytes
    """With its end of block."""

    @property
    def text(self) -> str:
        """Without its end, and without what is no text: leader, reader and punch codes."""
        return self.raw.rstrip(LINE_ENDS).translate(None, IGNORED).decode("latin-1")

    @property
    def is_blank(self) -> bool:
        """Whether it holds nothing."""
        return not self.raw.rstrip(LINE_ENDS).strip(SKIPPED)


class Blocks(Sequence[Block]):
    """
    Blocks of a program, made when they are looked at: kept, they would take ten times the room of the file.

    Args:
        lines: Of the file.
        begin: Index of the first one.
        behind: Index behind the last one.
    """

    __slots__ = ("_begin", "_behind", "_lines")

    def __init__(self, lines: Lines, begin: int, behind: int) -> None:
        self._lines = lines
        self._begin = begin
        self._behind = behind

    def __len__(self) -> int:
        return self._behind - self._begin

    def __iter__(self) -> Iterator[Block]:
        return map(self._block, range(self._begin, self._behind))

    @overload
    def __getitem__(self, at: int) -> Block: ...

    @overload
    def __getitem__(self, at: slice) -> tuple[Block, ...]: ...

    def __getitem__(self, at: int | slice) -> Block | tuple[Block, ...]:
        places = range(self._begin, self._behind)[at]
        return self._block(places) if isinstance(places, int) else tuple(map(self._block, places))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Blocks):
            return NotImplemented
        return len(self) == len(other) and all(one == another for one, another in zip(self, other, strict=True))

    def __hash__(self) -> int:
        return hash((self._begin, bytes(self)))

    def __bytes__(self) -> bytes:
        """Give all of them, one behind the other."""
        offsets = self._lines.offsets
        return self._lines.data[offsets[self._begin] : offsets[self._behind]]

    def __repr__(self) -> str:
        return f"<Blocks of lines {self._begin + 1} to {self._behind}>"

    def without_blank_end(self) -> Blocks:
        """Leave out the blank ones at the end."""
        lines = self._lines
        end = lines.offsets[self._begin] + len(bytes(self).rstrip(SKIPPED + LINE_ENDS))
        return Blocks(lines, self._begin, bisect_left(lines.offsets, end))

    def _block(self, at: int) -> Block:
        return Block(at + 1, self._lines.offsets[at], self._lines.raw[at])


@dataclass(frozen=True, slots=True)
class Name:
    """The ``O`` line that begins a program."""

    text: str
    """As it is written: ``O05555``."""
    number: int | None
    """None if it is no name: no digits, or more than five."""
    comment: str | None
    """What stands in parentheses right behind it."""


def name_of_line(raw: bytes) -> Name | None:
    """Return the name that a line begins with, or None if it does not begin with ``O``."""
    line = raw.rstrip(LINE_ENDS).translate(None, IGNORED).strip(SKIPPED)
    match = _NAME.match(line)
    if match is None:
        return None
    digits, comment = match[1].decode("ascii"), match[2]
    is_name = 1 <= len(digits) <= MAX_NAME_DIGITS
    return Name(
        text=f"{chr(line[0])}{digits}",
        number=int(digits) if is_name else None,
        comment=None if comment is None else comment[1:].rstrip(b")").decode("latin-1"),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Program:
    """One program of a file."""

    name: Name | None
    """None if no ``O`` line stands in front of it: a control cannot store it."""
    blocks: Blocks
    """All of its lines, that of the name and blank ones too; one behind the other they are its bytes."""

    @property
    def number(self) -> int | None:
        """1234 of ``O01234``; None if there is none, or none that is one."""
        return None if self.name is None else self.name.number

    @property
    def comment(self) -> str | None:
        """What stands in parentheses right behind the name."""
        return None if self.name is None else self.name.comment

    @property
    def line(self) -> int:
        """Of its first block in the file, from 1."""
        return self.blocks[0].line

    @property
    def offset(self) -> int:
        """Of its first byte in the file, from 0."""
        return self.blocks[0].offset

    @property
    def text(self) -> str:
        r"""All of it, with ``\n`` behind each block."""
        return "".join(f"{block.text}\n" for block in self.blocks)

    def __bytes__(self) -> bytes:
        """Give the bytes it was made of."""
        return bytes(self.blocks)

    def __str__(self) -> str:
        """Write ``O05555 (CS390_TEST)``."""
        name = "a program without a name" if self.name is None else self.name.text
        return name if self.comment is None else f"{name} ({self.comment})"


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramFile:
    """
    A file of one program or several; ``bytes(file)`` are those it was made of.

    Attributes:
        data: All of its bytes.
        programs: In their order; empty if there is nothing between the ``%`` lines.
        lead_in: What stands in front of the first ``%``: an end of block, leader, a punch code. No data.
        tail: What stands behind the line of the last ``%``: fill, a punch code. No data.
        payload: From the first ``%`` to the end of the line of the last one.
        percent_lines: Of each ``%`` alone in its line, from 1.
        has_start: Whether the data begin with ``%``.
        has_end: Whether they end with ``%``: else something may be missing.
        eob: The pattern all lines end with; None if they are mixed, or there is none.
    """

    data: bytes
    programs: tuple[Program, ...]
    lead_in: bytes
    tail: bytes
    payload: bytes
    percent_lines: tuple[int, ...]
    has_start: bool
    has_end: bool
    eob: EobPattern | None

    def __bytes__(self) -> bytes:
        """Give the bytes it was made of."""
        return self.data

    def __len__(self) -> int:
        """How many bytes it has."""
        return len(self.data)

    def __iter__(self) -> Iterator[Program]:
        """Give its programs."""
        return iter(self.programs)

    @property
    def numbers(self) -> tuple[int, ...]:
        """Of its programs, as far as they have one."""
        return tuple(each.number for each in self.programs if each.number is not None)

    def program(self, number: int) -> Program | None:
        """Return the first program of that number, or None."""
        return next((each for each in self.programs if each.number == number), None)


def parse_program_file(text: str | bytes, *, eob: EobPattern | str | None = None) -> ProgramFile:
    r"""
    Take a file apart as it comes from a control, or from a disk; nothing is checked, nothing is changed.

    The data stand between the first line that is ``%`` alone and the last one (sheet, section 4; OpenDNC). Where one
    is missing, they reach to that end of the file. A program begins with each line that begins with ``O``.

    Args:
        text: Bytes, or text; of a file, read it as bytes.
        eob: How its lines end, if that is known (Setting 25); it matters for CR CR and LF LF alone: without it, they
            are one end of block if no end of the whole file is single.

    Raises:
        InvalidCommandError: A character of the text has no code of 8 bits; or there are more programs in it, or ``%``
            lines, than there are numbers for programs.

    >>> file = parse_program_file(b"%\nO01234(FIRST)\nG0X0\nM30\n%\n")
    >>> file.programs[0].number, file.programs[0].comment, len(file.programs[0].blocks)
    (1234, 'FIRST', 3)
    """
    lines = Lines(as_bytes(text), eob)
    return ProgramFile(
        data=lines.data,
        programs=tuple(_limited(_programs(lines))),
        lead_in=lines.lead_in,
        tail=lines.tail,
        payload=lines.payload,
        percent_lines=tuple(at + 1 for at in lines.percents),
        has_start=lines.start is not None,
        has_end=lines.end is not None,
        eob=lines.eob,
    )


def _programs(lines: Lines) -> Iterator[Program]:
    """Each ``%`` between the first and the last one parts as well: programs that were wrapped one by one."""
    walls = [at for at in lines.percents if lines.first <= at < lines.behind]
    begins = [lines.first, *(at + 1 for at in walls)]
    for begin, end in zip(begins, [*walls, lines.behind], strict=True):
        yield from _programs_between(lines, begin, end)


def _limited(programs: Iterator[Program]) -> Iterator[Program]:
    for count, each in enumerate(programs):
        if count >= _MOST_PROGRAMS:
            raise InvalidCommandError(
                f"there are more than {_MOST_PROGRAMS} programs in it",
                hint="a control has no numbers for so many: it is no file of one, or it is damaged",
            )
        yield each


def _programs_between(lines: Lines, begin: int, end: int) -> Iterator[Program]:
    for at, behind in pairwise(_borders(lines, begin, end)):
        yield Program(name=name_of_line(lines.raw[at]), blocks=Blocks(lines, at, behind))


def _borders(lines: Lines, begin: int, end: int) -> Iterator[int]:
    """Give the index of the first line of each program, and that behind the last one."""
    is_first = True
    for match in matches(_FIRST_SIGN, lines.data, lines.offsets[begin], lines.offsets[end]):
        at = bisect_left(lines.offsets, match.start())
        if is_first and not lines.are_blank(begin, at):
            yield begin
        is_first = False
        yield at
    if is_first and not lines.are_blank(begin, end):
        yield begin
    yield end
