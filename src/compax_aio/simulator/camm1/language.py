"""How a simulated cutter finds whole instructions in what is stored, in either cutting language."""

from __future__ import annotations

import re
from typing import Final, NamedTuple

from compax_aio.camm1.facts.line import ETX
from compax_aio.camm1.facts.mnemonics import CALL_OF_MODE_2, MODE_1, MODE_2, Shape, mnemonic_of

__all__ = ["NOTHING", "UNREADABLE", "Reader", "Stored"]

NOTHING: Final = ""
"""The name of what lies between instructions."""
UNREADABLE: Final = "?"
"""The name of what can be none."""

_USUAL: Final = re.compile(rb"[\x00-\x20;,]*([A-Z]{2})([-+0-9., ]*)(;|(?=[A-Z!^]))")
_BETWEEN: Final = re.compile(rb"[\x00-\x20;,]*")
_NUMBERS: Final = re.compile(rb"([^;A-Za-z!^]*)(;|(?=[A-Za-z!^]))")
_NUMBERS_OF_MODE_1: Final = re.compile(rb"([^;A-Za-z!^\r\n]*)([;\r\n]|(?=[A-Za-z!^]))")
_LINE: Final = re.compile(rb"([^\r\n]*)[\r\n]")
_PACKED: Final = re.compile(rb"([^;]*);")
_QUOTED: Final = re.compile(rb'((?:[^;"]|"[^"]*")*);')
_SIGN: Final = re.compile(rb"([\x00-\xff])")

_BY_SHAPE: Final = {
    Shape.LINE: _LINE,
    Shape.PACKED: _PACKED,
    Shape.QUOTED: _QUOTED,
    Shape.SIGN: _SIGN,
}
_USUAL_NAMES: Final = {
    name.encode(): name for name, row in MODE_2.items() if row.shape is Shape.NUMBERS and len(name) == 2
}


class Stored(NamedTuple):
    """A whole instruction that stands at the head of what is stored."""

    name: str
    argument: bytes
    size: int
    """Bytes it takes away."""
    needs: int
    """Bytes that must have come before its end is known."""


class Reader:
    """
    Reads one instruction after the other.

    Args:
        language: ``both``, or ``mode1`` or ``mode2`` alone.

    Attributes:
        label_end: What ends the text of a label; ``DT`` sets it.
    """

    def __init__(self, language: str = "both") -> None:
        self._has_mode_1 = language != "mode2"
        self._has_mode_2 = language != "mode1"
        self.label_end = ETX

    def read(self, data: bytearray) -> Stored | None:
        """Return the instruction at the head of *data*; None: it has not come whole."""
        if self._has_mode_2:
            usual = _USUAL.match(data)
            if usual is not None:
                name = _USUAL_NAMES.get(usual[1])
                if name is not None:
                    end = usual.end()
                    return Stored(name, usual[2], end, end if usual[3] else end + 1)
        return self._read(data)

    def _read(self, data: bytearray) -> Stored | None:
        found = _BETWEEN.match(data)
        begin = found.end() if found is not None else 0
        if begin == len(data):
            return Stored(NOTHING, b"", begin, begin) if begin else None
        calls_mode_2 = data[begin : begin + 1] == CALL_OF_MODE_2.encode()
        if calls_mode_2:
            begin += 1
        name = self._name(data, begin, calls_mode_2)
        if name is None:
            return None
        if not name:
            return self._unreadable(data, begin)
        return self._whole(data, name, begin + len(name))

    def _name(self, data: bytearray, begin: int, calls_mode_2: bool) -> str | None:
        """Return the name at *begin*, empty if there is none; None: it has not come whole."""
        head = data[begin : begin + 3].decode("latin-1").upper()
        if head[:1] == "!":
            return head if len(head) == 3 else None
        if head and not "A" <= head[0] <= "Z":
            return ""
        if len(head) < 2:
            return None
        two = head[:2]
        is_two = two in MODE_2 if self._has_mode_1 and head[0] in MODE_1 and not calls_mode_2 else two.isalpha()
        return two if is_two and (self._has_mode_2 or calls_mode_2) else head[0]

    def _whole(self, data: bytearray, name: str, begin: int) -> Stored | None:
        row = mnemonic_of(name)
        shape = row.shape if row is not None else Shape.NUMBERS
        if shape is Shape.LABEL:
            end = data.find(self.label_end, begin)
            return None if end < 0 else Stored(name, bytes(data[begin:end]), end + 1, end + 1)
        form = _BY_SHAPE.get(shape, _NUMBERS_OF_MODE_1 if len(name) == 1 else _NUMBERS)
        found = form.match(data, begin)
        if found is None:
            return None
        end = found.end()
        is_ended_by_next = form in {_NUMBERS, _NUMBERS_OF_MODE_1} and not found[2]
        return Stored(name, found[1], end, end + 1 if is_ended_by_next else end)

    @staticmethod
    def _unreadable(data: bytearray, begin: int) -> Stored | None:
        found = _NUMBERS.match(data, begin)
        if found is None:
            return None
        end = max(found.end(), begin + 1)
        return Stored(UNREADABLE, found[1], end, end if found[2] else end + 1)
