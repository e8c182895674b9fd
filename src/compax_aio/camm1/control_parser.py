"""Device control instructions found in a stream of bytes, as the machine finds them, with what it would object to."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto
from typing import Final

from ..errors import InvalidCommandError
from .facts.instructions import CONTROL_INSTRUCTIONS
from .facts.line import COLON, DOT, ESCAPE, SEMICOLON
from .instructions import Control, from_parameters

__all__ = ["ControlFound", "ControlParser", "DataFound", "FlawFound", "Found"]

_MOST_DIGITS: Final = 9
_BAD_BYTE, _BAD_PARAMETER, _OUT_OF_RANGE, _TOO_MANY = 11, 12, 13, 14


@dataclass(frozen=True, slots=True)
class ControlFound:
    """A device control instruction, which is obeyed at once."""

    control: Control
    offset: int
    """Of its ESC in the stream."""


@dataclass(frozen=True, slots=True)
class FlawFound:
    """What a machine latches as an error of the line."""

    code: int
    """11 to 14 (PNC-900 p. 21)."""
    offset: int
    """Of the byte that is wrong."""


@dataclass(frozen=True, slots=True)
class DataFound:
    """What goes into the data buffer."""

    data: bytes
    offset: int


Found = ControlFound | FlawFound | DataFound


class _State(Enum):
    IDLE = auto()
    COLON_MAY_COME = auto()
    GOT_ESCAPE = auto()
    GOT_DOT = auto()
    PARAMETERS = auto()
    IGNORING = auto()
    """Up to the colon."""


class ControlParser:
    """
    Takes a stream in pieces of any size apart into device control and data.

    A colon behind an instruction that takes no parameters is swallowed; a lone ESC is data, with what follows it; a
    new ESC among parameters drops them (14: their colon is missing). By a bad character (12) its parameter and all
    later ones get their defaults, so they do by one out of range (13); too many (14) are ignored
    (Automove p. 6-6, 13-2).
    """

    def __init__(self) -> None:
        self._state = _State.IDLE
        self._offset = 0
        self._began = 0
        self._letter = ""
        self._values: list[int | None] = []
        self._digits = ""
        self._found: list[Found] = []
        self._data = bytearray()

    @property
    def is_idle(self) -> bool:
        """Whether no device control instruction is unfinished."""
        return self._state in (_State.IDLE, _State.COLON_MAY_COME)

    def feed(self, piece: bytes) -> list[Found]:
        """Return what *piece* completes; data as it comes, so that it may come in several parts."""
        for byte in piece:
            self._take(byte)
            self._offset += 1
        self._flush()
        found, self._found = self._found, []
        return found

    def _take(self, byte: int) -> None:
        if byte == ESCAPE:
            self._take_escape()
        elif self._state is _State.GOT_ESCAPE:
            self._take_behind_escape(byte)
        elif self._state is _State.GOT_DOT:
            self._take_letter(byte)
        elif self._state is _State.PARAMETERS:
            self._take_parameter(byte)
        elif self._state is _State.IGNORING:
            if byte == COLON:
                self._apply()
        elif not (self._state is _State.COLON_MAY_COME and byte == COLON):
            self._data.append(byte)
            self._state = _State.IDLE
        else:
            self._state = _State.IDLE

    def _take_escape(self) -> None:
        if self._state is _State.PARAMETERS or self._state is _State.IGNORING:
            self._flaw(_TOO_MANY)
        elif self._state is _State.GOT_ESCAPE:
            self._data.append(ESCAPE)  # the one before it was alone
        self._flush()
        self._began = self._offset
        self._state = _State.GOT_ESCAPE

    def _take_behind_escape(self, byte: int) -> None:
        if byte == DOT:
            self._state = _State.GOT_DOT
        else:
            self._data += bytes((ESCAPE, byte))
            self._state = _State.IDLE

    def _take_letter(self, byte: int) -> None:
        row = CONTROL_INSTRUCTIONS.get(chr(byte))
        if row is None:
            self._state = _State.IDLE
            self._flaw(_BAD_BYTE)
            return
        self._letter, self._values, self._digits = row.letter, [], ""
        if row.takes_parameters:
            self._state = _State.PARAMETERS
        else:
            self._apply()
            self._state = _State.COLON_MAY_COME

    def _take_parameter(self, byte: int) -> None:
        if byte in b"0123456789":
            if len(self._digits) < _MOST_DIGITS:
                self._digits += chr(byte)
        elif byte == SEMICOLON:
            self._end_parameter()
            if len(self._values) == len(CONTROL_INSTRUCTIONS[self._letter].parameters):
                self._flaw(_TOO_MANY)
                self._state = _State.IGNORING
        elif byte == COLON:
            self._end_parameter()
            self._apply()
        else:
            self._flaw(_BAD_PARAMETER)
            self._state = _State.IGNORING

    def _end_parameter(self) -> None:
        self._values.append(int(self._digits) if self._digits else None)
        self._digits = ""

    def _apply(self) -> None:
        self._state = _State.IDLE
        values = self._values
        for count in range(len(values), -1, -1):
            try:
                control = from_parameters(self._letter, values[:count])
            except InvalidCommandError:
                continue
            if count < len(values):
                self._flaw(_OUT_OF_RANGE)
            self._flush()
            self._found.append(ControlFound(control, self._began))
            return

    def _flaw(self, code: int) -> None:
        self._flush()
        self._found.append(FlawFound(code, self._offset))

    def _flush(self) -> None:
        if self._data:
            # An ESC that turned out to be data came before this byte; all of it is contiguous.
            self._found.append(DataFound(bytes(self._data), self._data_offset()))
            self._data.clear()

    def _data_offset(self) -> int:
        return self._offset - len(self._data)
