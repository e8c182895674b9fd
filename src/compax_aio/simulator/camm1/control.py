"""Device control instructions, character by character: ``ESC .``, a letter, parameters (errors 10 to 14)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from enum import Enum, auto
from typing import Final, Protocol

from compax_aio.camm1.facts.handshakes import PRESETS, RESET_EXPANSION
from compax_aio.camm1.facts.instructions import CONTROL_INSTRUCTIONS, ControlInstruction, Kind
from compax_aio.camm1.facts.line import COLON, DOT, ESCAPE, SEMICOLON

from .handshakes import Handshakes, string_of
from .knobs import Knobs
from .transmitter import Format, Transmitter

__all__ = ["Control", "Obeyed"]

_MOST_DIGITS: Final = 9
_BLANK: Final = 0x20


class Obeyed(Protocol):
    """Who carries out what has no parameters."""

    def answer(self, letter: str, now: float) -> None:
        """Answer ``.A .B .E .L .O``."""

    def abort_output(self, now: float) -> None:
        """Carry out ``.J``."""

    def clear(self, now: float) -> None:
        """Carry out ``.K``."""

    def reset(self, now: float) -> None:
        """Carry out what ``.R`` does besides what is set."""

    def obey(self, text: str, now: float) -> None:
        """Take note of an instruction that is obeyed."""

    def put(self, data: bytes, now: float) -> None:
        """Store what was no device control instruction after all."""

    def note_io_error(self, code: int, now: float) -> None:
        """Keep an error for ``.E``."""


class _State(Enum):
    IDLE = auto()
    GOT_ESC = auto()
    GOT_DOT = auto()
    PARAMETERS = auto()
    IGNORED = auto()
    """Up to the colon."""
    BARE = auto()
    """A colon may follow."""


class Control:
    """
    The parser of device control instructions, and what they set.

    Args:
        knobs: Of the cutter.
        handshakes: What is set there.
        transmitter: Whose format is set.
        machine: Who carries out the rest.
    """

    def __init__(self, knobs: Knobs, handshakes: Handshakes, transmitter: Transmitter, machine: Obeyed) -> None:
        self._knobs = knobs
        self._handshakes = handshakes
        self._transmitter = transmitter
        self._machine = machine
        self._letters = knobs.letters
        self.power_on()

    def power_on(self) -> None:
        """Begin anew."""
        self._state = _State.IDLE
        self._letter = ""
        self._values: list[int | None] = []
        self._digits = ""
        self._transmitter.format = Format()

    @property
    def is_idle(self) -> bool:
        """Whether the next byte is data, unless it is ESC."""
        return self._state is _State.IDLE

    @property
    def awaits_letter(self) -> bool:
        """Whether the next byte may ask something."""
        return self._state in {_State.GOT_ESC, _State.GOT_DOT, _State.PARAMETERS, _State.IGNORED}

    def byte(self, byte: int, now: float) -> bool:
        """Take a byte; whether it was one of a device control instruction."""
        match self._state:
            case _State.BARE:
                self._state = _State.IDLE
                return byte == COLON or self.byte(byte, now)
            case _State.IDLE:
                if byte != ESCAPE:
                    return False
                self._state = _State.GOT_ESC
            case _State.GOT_ESC:
                self._after_escape(byte, now)
            case _State.GOT_DOT:
                self._after_dot(byte, now)
            case _State.PARAMETERS | _State.IGNORED:
                self._parameter(byte, now)
        return True

    def _after_escape(self, byte: int, now: float) -> None:
        if byte == DOT:
            self._state = _State.GOT_DOT
        elif byte != ESCAPE:
            self._state = _State.IDLE
            if self._knobs.stray_esc == "data":
                self._machine.put(bytes([ESCAPE, byte]), now)

    def _after_dot(self, byte: int, now: float) -> None:
        if byte == ESCAPE:
            self._state = _State.GOT_ESC
            return
        letter = chr(byte)
        self._state = _State.IDLE
        if letter not in self._letters:
            self._machine.note_io_error(11, now)
            return
        self._letter, self._values, self._digits = letter, [], ""
        row = CONTROL_INSTRUCTIONS[letter]
        if row.takes_parameters or self._knobs.bare_colon == "required":
            self._state = _State.PARAMETERS
            return
        self._state = _State.BARE if self._knobs.bare_colon == "swallow" else _State.IDLE
        self._obey(row, now)

    # Parameters

    def _parameter(self, byte: int, now: float) -> None:
        row = CONTROL_INSTRUCTIONS[self._letter]
        if byte == ESCAPE:
            if self._knobs.unfinished == "apply":
                self._close(row, now)
            self._state = _State.GOT_ESC
        elif byte == COLON:
            self._state = _State.IDLE
            self._close(row, now)
        elif self._state is _State.IGNORED or (byte == _BLANK and self._knobs.allow_spaces):
            pass
        elif byte == SEMICOLON:
            self._end_value(row, now)
            if len(self._values) >= len(row.parameters):
                self._refuse(14, now)
        elif 0x30 <= byte <= 0x39:
            if not row.takes_parameters:
                self._refuse(14, now)
            elif len(self._digits) < _MOST_DIGITS:
                self._digits += chr(byte)
        else:
            self._digits = ""
            # Where a colon must be, whatever else comes says that it is missing.
            self._refuse(12 if row.takes_parameters else 14, now)

    def _refuse(self, code: int, now: float) -> None:
        self._state = _State.IGNORED
        self._machine.note_io_error(code, now)

    def _end_value(self, row: ControlInstruction, now: float) -> None:
        """Take the number that stands in front of a separator; one out of range has its default, and all behind it."""
        digits, self._digits = self._digits, ""
        value = int(digits) if digits else None
        place = len(self._values)
        if value is not None and place < len(row.parameters):
            shape = row.parameters[place]
            if not shape.lowest <= value <= self._highest(row, place):
                self._refuse(13, now)
                return
        self._values.append(value)

    def _highest(self, row: ControlInstruction, place: int) -> int:
        shape = row.parameters[place]
        if shape.kind is Kind.CHARACTER and self._knobs.model.startswith("HP"):
            return 127  # HP7470 p. 10-30, 10-33
        return shape.highest

    def _close(self, row: ControlInstruction, now: float) -> None:
        if self._digits and len(self._values) < len(row.parameters):
            was = self._state
            self._end_value(row, now)
            self._state = was
        self._digits = ""
        self._obey(row, now)

    # What they do

    def _obey(self, row: ControlInstruction, now: float) -> None:
        given = self._values[: len(row.parameters)]
        text = ";".join("" if each is None else str(each) for each in given)
        self._machine.obey(f"{row.letter}{text}{':' if row.takes_parameters else ''}", now)
        self._carry_out(row.letter, _with_defaults(row, given), given, now)

    def _carry_out(self, letter: str, values: Sequence[int], given: Sequence[int | None], now: float) -> None:
        setting = _SETTINGS.get(letter)
        if setting is not None:
            setting(self, values, given, now)
        elif letter in {"H", "I"}:
            block, enquiry = values[:2]
            if self._knobs.model == "HP 7470A":
                block %= 256  # HP7470 p. 10-30
            is_bare = not any(given)
            self._handshakes.set_rule(letter, block, enquiry, string_of(values[2:]), now, is_bare=is_bare)
        elif letter == "J":
            self._machine.abort_output(now)
        elif letter == "K":
            self._machine.clear(now)
        elif letter == "R":
            for each in RESET_EXPANSION:
                self._expand(each, now)
            self._machine.reset(now)
        elif CONTROL_INSTRUCTIONS[letter].answers:
            self._machine.answer(letter, now)

    def _expand(self, instruction: str, now: float) -> None:
        """Carry out one of those that another stands for."""
        letter, text = instruction[0], instruction[1:].removesuffix(":")
        row = CONTROL_INSTRUCTIONS[letter]
        given = [int(each) if each else None for each in text.split(";")] if text else []
        self._carry_out(letter, _with_defaults(row, given), given, now)

    def _set_format(self, values: Sequence[int], _: Sequence[int | None], __: float) -> None:
        turnaround_ms, trigger, echo, first, second, initiator = values
        # Both cannot be had at once (PNC-1610 p. 28); which one gives way is inferred.
        ends = [first] if initiator else [first, second]
        self._transmitter.format = replace(
            self._transmitter.format,
            turnaround_s=turnaround_ms / 1000,
            trigger=trigger,
            echo_terminator=echo,
            terminator=bytes(each for each in ends if each),
            initiator=bytes([initiator]) if initiator else b"",
        )

    def _set_strings(self, values: Sequence[int], _: Sequence[int | None], now: float) -> None:
        self._transmitter.format = replace(self._transmitter.format, intercharacter_s=values[0] / 1000)
        self._handshakes.set_string(string_of(values[1:]), now)

    def _set_dtr(self, values: Sequence[int], given: Sequence[int | None], now: float) -> None:
        size = values[0] if given and given[0] is not None else None
        self._handshakes.set_dtr(values[1] % 2 == 1, size, now)

    def _preset(self, values: Sequence[int], _: Sequence[int | None], now: float) -> None:
        for each in PRESETS[values[0]].stands_for:
            self._expand(each, now)


def _with_defaults(row: ControlInstruction, given: Sequence[int | None]) -> list[int]:
    """Return the value of each parameter."""
    known = dict(enumerate(given))
    return [
        parameter.default if (value := known.get(place)) is None else value
        for place, parameter in enumerate(row.parameters)
    ]


_Setting = Callable[[Control, Sequence[int], Sequence[int | None], float], None]

# ruff: noqa: SLF001  (its own methods, by letter)
_SETTINGS: Final[Mapping[str, _Setting]] = {
    "M": Control._set_format,
    "N": Control._set_strings,
    "@": Control._set_dtr,
    "P": Control._preset,
}
