r"""A file as lines: ends of blocks in any mix, and the ``%`` lines between which the data stand."""

from __future__ import annotations

import re
from array import array
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from itertools import islice
from typing import Final, overload

from ...errors import InvalidCommandError
from ..facts.characters import DC1, DC2, DC3, DC4, DELETE, NUL, SPACE, SUB
from ..facts.eob import EobPattern

__all__ = ["IGNORED", "LINE_ENDS", "SKIPPED", "LineView", "Lines", "as_bytes", "eob_of", "matches"]

IGNORED: Final = bytes((NUL, DC1, DC2, DC3, DC4, SUB, DELETE))
"""Leader, reader, punch, fill: around the data they mean nothing, and within a block they are no text of it."""
SKIPPED: Final = IGNORED + bytes((SPACE,)) + b"\t"
"""May stand beside the ``%`` of a line, and in front of a name."""
LINE_ENDS: Final = b"\r\n"
_SKIPPED_AND_ENDS: Final = SKIPPED + LINE_ENDS

_END: Final = re.compile(rb"\r\n?|\n")
_DOUBLED: Final = {
    EobPattern.CR_CR: re.compile(rb"\r\r|\r\n|\r|\n"),
    EobPattern.LF_LF: re.compile(rb"\n\n|\r\n|\r|\n"),
}
_SINGLE_CR: Final = re.compile(rb"(?<!\r)\r(?:\r\r)*(?!\r)")
_SINGLE_LF: Final = re.compile(rb"(?<!\n)\n(?:\n\n)*(?!\n)")
_RUN_OF_ENDS: Final = re.compile(rb"[\r\n]+")
_PIECE_BYTES: Final = 1 << 16
_SMALL: Final = 1 << 32
_MOST_PERCENTS: Final = 100_000
"""A pair for each program that there can be is fewer by far."""


def as_bytes(text: str | bytes | bytearray | memoryview) -> bytes:
    """
    Return *text* as bytes, one for each character.

    Raises:
        InvalidCommandError: A character has no code of 8 bits; its line and column are told.
    """
    if not isinstance(text, str):
        return bytes(memoryview(text))
    try:
        return text.encode("latin-1")
    except UnicodeEncodeError as error:
        line, column = Lines(text[: error.start].encode("latin-1") + b"?").place(error.start)
        raise InvalidCommandError(
            f"line {line}, column {column}: {text[error.start]!r} has no code of 8 bits",
            hint="a control knows 7-bit ASCII alone; write it with other characters",
        ) from None


def matches(
    pattern: re.Pattern[bytes], data: bytes | bytearray, begin: int = 0, end: int | None = None
) -> Iterator[re.Match[bytes]]:
    """
    Find a pattern that reaches beyond no line, as ``pattern.finditer()`` does, but in pieces of whole lines.

    While a pattern is looked for, Python lets no other thread have its turn, so a file of megabytes that does not have
    it would hold up the event loop. A line of more than 64 KiB, which no control has, may be cut.
    """
    end = len(data) if end is None else end
    while begin < end:
        behind = min(begin + _PIECE_BYTES, end)
        if behind < end and (run := _RUN_OF_ENDS.search(data, behind, min(behind + _PIECE_BYTES, end))) is not None:
            behind = run.end()
            while behind < end and data[behind] in LINE_ENDS:
                behind += 1
        yield from pattern.finditer(data, begin, behind)
        begin = behind


def eob_of(data: bytes) -> EobPattern | None:
    """
    Return the pattern that all lines of *data* end with; None if they are mixed, or there is none.

    CR CR or LF LF is taken for one end if no end of the whole file is single: such a file could as well have a blank
    block behind each other one, which no control sends.
    """
    pairs = data.count(b"\r\n")
    returns, feeds = data.count(b"\r") - pairs, data.count(b"\n") - pairs
    if (pairs > 0) + (returns > 0) + (feeds > 0) != 1:
        return None
    if pairs:
        return EobPattern.CR_LF
    single, one, two = (
        (_SINGLE_CR, EobPattern.CR, EobPattern.CR_CR) if returns else (_SINGLE_LF, EobPattern.LF, EobPattern.LF_LF)
    )
    has_several = len(list(islice(_RUN_OF_ENDS.finditer(data), 2))) > 1
    return two if has_several and single.search(data) is None else one


class LineView(Sequence[bytes]):
    """Lines of a file, cut out of it when they are looked at: each of its own would take more room than it has."""

    __slots__ = ("_data", "_offsets")

    def __init__(self, data: bytes, offsets: Sequence[int]) -> None:
        self._data = data
        self._offsets = offsets

    def __len__(self) -> int:
        return len(self._offsets) - 1

    @overload
    def __getitem__(self, at: int) -> bytes: ...

    @overload
    def __getitem__(self, at: slice) -> list[bytes]: ...

    def __getitem__(self, at: int | slice) -> bytes | list[bytes]:
        if isinstance(at, slice):
            return [self[each] for each in range(*at.indices(len(self)))]
        index = range(len(self))[at]
        return self._data[self._offsets[index] : self._offsets[index + 1]]


class Lines:
    r"""
    The lines of a file; of each, four bytes are kept beside the file.

    Args:
        data: The file, whole.
        eob: How its lines end, if it is known; it matters for CR CR and LF LF alone, any other mix is read all the
            same.

    Attributes:
        data: The file.
        eob: The pattern all lines end with; None if they are mixed, or there is none.
        raw: The lines with their ends; one behind the other they are the file.
        offsets: Where each begins, and at last how many bytes there are.
        percents: Indexes of the lines that are ``%`` alone.
        start: Index of the ``%`` that the data begin with, or None.
        end: Index of the ``%`` that they end with, or None.

    Raises:
        InvalidCommandError: There are more ``%`` lines than any file can have.
    """

    __slots__ = ("data", "end", "eob", "offsets", "percents", "raw", "start")

    def __init__(self, data: bytes, eob: EobPattern | str | None = None) -> None:
        self.data = data
        found = eob_of(data)
        self.eob = found if eob is None or found is None else _told_apart(found, EobPattern(eob))
        self.offsets = _offsets(data, _END if self.eob is None else _DOUBLED.get(self.eob, _END))
        self.raw = LineView(data, self.offsets)
        self.percents = list(self._percent_lines())
        self.start, self.end = self._ends_of_data()

    @property
    def first(self) -> int:
        """Index of the first line of data."""
        return 0 if self.start is None else self.start + 1

    @property
    def behind(self) -> int:
        """Index behind the last line of data."""
        return len(self.raw) if self.end is None else self.end

    @property
    def lead_in(self) -> bytes:
        """What stands in front of the first ``%``."""
        return b"" if self.start is None else self.data[: self._percent_at(self.start)]

    @property
    def payload(self) -> bytes:
        """From the first ``%`` to the end of the line of the last one: no lead-in, no punch codes, no fill."""
        begin = 0 if self.start is None else self._percent_at(self.start)
        if self.end is None:
            return self.data[begin:]
        last = self._percent_at(self.end) + 1
        return self.data[begin:last] + self._end_of(self.end)

    @property
    def tail(self) -> bytes:
        """What stands behind the line of the last ``%``."""
        return b"" if self.end is None else self.data[self.offsets[self.end + 1] :]

    def place(self, offset: int) -> tuple[int, int]:
        """Return line and column of a byte, both from 1."""
        at = max(0, min(bisect_right(self.offsets, offset), len(self.raw)) - 1)
        return at + 1, offset - self.offsets[at] + 1

    def is_blank(self, at: int) -> bool:
        """Whether the line at that index holds nothing."""
        return self.are_blank(at, at + 1)

    def are_blank(self, first: int, behind: int) -> bool:
        """Whether the lines from that index on, and in front of the other one, hold nothing."""
        return not self.data[self.offsets[first] : self.offsets[behind]].strip(_SKIPPED_AND_ENDS)

    def _percent_lines(self) -> Iterator[int]:
        count = 0
        found = self.data.find(b"%")
        while found >= 0:
            at = bisect_right(self.offsets, found) - 1
            if self.raw[at].strip(_SKIPPED_AND_ENDS) == b"%":
                yield at
                count += 1
            if count > _MOST_PERCENTS:
                raise InvalidCommandError(
                    f"it has more than {_MOST_PERCENTS} lines that are % alone",
                    hint="this is no file of a control, or it is damaged",
                )
            found = self.data.find(b"%", self.offsets[at + 1])

    def _percent_at(self, at: int) -> int:
        return self.offsets[at] + self.raw[at].index(b"%")

    def _end_of(self, at: int) -> bytes:
        line = self.raw[at]
        return line[len(line.rstrip(LINE_ENDS)) :]

    def _ends_of_data(self) -> tuple[int | None, int | None]:
        """Take the first and the last ``%``; a single one begins the data, unless they all stand in front of it."""
        if len(self.percents) > 1:
            return self.percents[0], self.percents[-1]
        if not self.percents:
            return None, None
        at = self.percents[0]
        has_before = not self.are_blank(0, at)
        has_behind = not self.are_blank(at + 1, len(self.raw))
        return (None, at) if has_before and not has_behind else (at, None)


def _told_apart(found: EobPattern, told: EobPattern) -> EobPattern:
    """Of single and doubled ends, which are one and the same where all of them are even, believe what is told."""
    alike = ({EobPattern.CR, EobPattern.CR_CR}, {EobPattern.LF, EobPattern.LF_LF})
    return told if any({found, told} <= each for each in alike) else found


def _offsets(data: bytes, end: re.Pattern[bytes]) -> Sequence[int]:
    """Return where each line begins, and how many bytes there are."""
    offsets = array("I" if len(data) < _SMALL else "Q", [0])
    offsets.extend(match.end() for match in matches(end, data))
    if offsets[-1] != len(data):
        offsets.append(len(data))
    return offsets
