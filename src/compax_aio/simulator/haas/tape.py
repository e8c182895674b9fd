"""How a simulated control finds blocks in bytes: between two ``%``, with any end of block."""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from compax_aio.haas.facts.characters import PERCENT
from compax_aio.haas.facts.eob import EobPattern

__all__ = ["Tape"]

_LONGEST_BLOCK: Final = 4096
"""What is longer than any block is cut, so that no end of block never fills the memory."""
_LEADER: Final = b"\x00\x7f"
_PERCENT: Final = bytes([PERCENT])
_LAST_PERCENT: Final = re.compile(rb"(?:\A|[\r\n;])[\x00\x7f ]*%")
_PERCENT_BEHIND_EOB: Final = re.compile(rb"[\r\n;][\x00\x7f ]*%")
_BLANK: Final = re.compile(rb"[\x00\x7f ]*\Z")

_ENDS: Final[Mapping[EobPattern, tuple[re.Pattern[bytes], Mapping[int, bytes]]]] = MappingProxyType(
    {
        EobPattern.CR_CR: (re.compile(rb"\r[\r\n]|\r|\n"), {0x0D: b"\r\n"}),
        EobPattern.LF_LF: (re.compile(rb"\r\n|\n\n|\r|\n"), {0x0D: b"\n", 0x0A: b"\n"}),
    }
)
"""What ends a block, and what still belongs to an end of block that ends a piece, by its last byte."""
_USUAL_ENDS: Final = (re.compile(rb"\r\n|\r|\n"), {0x0D: b"\n"})


class Tape:
    """
    Reads the blocks of one file, in pieces of any size.

    Args:
        eob: Setting 25: CR CR, or LF LF, end one block where it says so.

    Attributes:
        is_begun: The first ``%`` has come.
        is_ended: The last ``%`` has come; what follows is not of this file.
        bytes: How many have come since it began.
    """

    def __init__(self, eob: EobPattern) -> None:
        self._end, self._second_half = _ENDS.get(eob, _USUAL_ENDS)
        self.is_begun = self.is_ended = False
        self.bytes = 0
        self._rest = b""
        self._skips = b""
        self._is_first_line = True

    def feed(self, data: bytes) -> tuple[int, list[bytes]]:
        """Take bytes; returns how many of them belong to this file, and the blocks that are whole."""
        begin = 0
        if not self.is_begun:
            begin = data.find(_PERCENT) + 1
            if not begin:
                return len(data), []
            self.is_begun = True
        starts_blank = _BLANK.match(self._rest) is not None and not self._is_first_line
        last = (_LAST_PERCENT if starts_blank else _PERCENT_BEHIND_EOB).search(data, begin)
        end = len(data) if last is None else last.end()
        text = data[begin : end if last is None else end - 1]
        self.bytes += end
        lines = self._lines(text)
        if last is not None:
            self.is_ended = True
            self._rest = b""
        return end, lines

    def reopen(self) -> None:
        """Expect another pair of ``%``."""
        self.is_begun = self.is_ended = False
        self._rest = self._skips = b""
        self._is_first_line = True

    def _lines(self, text: bytes) -> list[bytes]:
        if self._skips and text:
            if text[0] in self._skips:
                text = text[1:]
            self._skips = b""
        if not text:
            return []
        if text[-1] in self._second_half and not self._is_whole_end(text):
            self._skips = self._second_half[text[-1]]
        *lines, self._rest = self._end.sub(b"\n", self._rest + text).translate(None, _LEADER).split(b"\n")
        if len(self._rest) > _LONGEST_BLOCK:
            lines.append(self._rest)
            self._rest = b""
        if lines and self._is_first_line:
            self._is_first_line = False
            if not lines[0].strip():  # the end of the block with the first % alone
                del lines[0]
        return _with_blank_lines(lines)

    def _is_whole_end(self, text: bytes) -> bool:
        """Whether the last two bytes are one end of block already."""
        found = [each.end() - each.start() for each in self._end.finditer(text[-8:]) if each.end() == len(text[-8:])]
        return bool(found) and found[-1] == 2


def _with_blank_lines(lines: list[bytes]) -> list[bytes]:
    """Make a blank line of each ``;``: that is what becomes of an EOB that is received (Haas 11596-8000)."""
    if not any(b";" in line for line in lines):
        return lines
    made: list[bytes] = []
    for line in lines:
        first, *others = line.split(b";")
        if first.strip() or not others:
            made.append(first)
        for each in others:
            made.append(b"")
            if each.strip():
                made.append(each)
    return made
