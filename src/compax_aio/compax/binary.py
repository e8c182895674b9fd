"""Binary transfer, sans-IO: which lines have a frame that says the same, and which go out as one (UG p. 166-167)."""

from __future__ import annotations

import re
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from typing import Final

from ..errors import InvalidCommandError
from .facts.binary import (
    BINARY_FRAMES,
    FIXED_POINT_BITS,
    FIXED_POINT_BYTES,
    FRAME_BASE,
    LEVEL_BYTES,
    WORD_BYTES,
    BinaryFrameFact,
    BinaryOperand,
)
from .facts.commands import COMMANDS
from .facts.limits import OUTPUT_NUMBERS
from .facts.line import COMMAND_END, XOFF, XON

__all__ = [
    "BinaryTransfer",
    "decode_frame",
    "decode_number",
    "decode_word",
    "encode_ascii",
    "encode_frame",
    "encode_number",
    "encode_word",
    "is_frame",
    "is_motion_frame",
]

_SCALE: Final = 1 << FIXED_POINT_BITS
_DECIMALS: Final = 8
"""So many always suffice to write a number so that the same bytes come of it again."""

_MAX_WORD: Final = (1 << 8 * WORD_BYTES) - 1
_LEVELS: Final = {level: bytes([code]) for code, level in LEVEL_BYTES.items()}
_SHORT: Final = {row.long: row.short for row in COMMANDS}

_OPERAND_TEXTS: Final = {
    BinaryOperand.NUMBER: r"([+-]?[0-9]+(?:\.[0-9]*)?)",
    BinaryOperand.WORD: r"([0-9]+)",
    BinaryOperand.OUTPUT: r"(O[0-9]+=[01])",
}
_OPERAND_BYTES: Final = {
    BinaryOperand.NUMBER: FIXED_POINT_BYTES,
    BinaryOperand.WORD: WORD_BYTES,
    BinaryOperand.OUTPUT: WORD_BYTES + 1,
}


def _words(row: BinaryFrameFact) -> list[str]:
    """List the command words of *row*, one for each of its parts."""
    return row.long.split(" ")


def _line_of(row: BinaryFrameFact) -> re.Pattern[str]:
    """Make the pattern of the lines that say what a frame of *row* says, blanks left out."""
    parts = zip(_words(row), row.parts, strict=True)
    return re.compile("".join(rf"(?:{word}|{_SHORT[word]}){_OPERAND_TEXTS[kind]}" for word, (_, kind) in parts))


_LINES: Final = tuple((row, _line_of(row)) for row in BINARY_FRAMES)

_SETTINGS: Final = frozenset({"SPEED", "ACCEL", "ACCEL-"})
_MOTIONS: Final = frozenset({"POSA", "POSR"})
_MOTION_HEADS: Final = frozenset(
    bytes([FRAME_BASE + row.length, row.parts[0][0]]) for row in BINARY_FRAMES if row.long in _MOTIONS
)


# Operands -------------------------------------------------------------------------------------------------------------


def encode_number(value: float | Decimal | Fraction) -> bytes:
    """
    Write a number as fixed point, exact to half of 2^-24: six bytes, least significant first (UG p. 167).

    Raises:
        InvalidCommandError: It is not finite, or not from -8,388,608 up to, not including, 8,388,608.
    """
    try:
        scaled = round(Fraction(value) * _SCALE)
        return scaled.to_bytes(FIXED_POINT_BYTES, "little", signed=True)
    except (OverflowError, TypeError, ValueError):
        raise InvalidCommandError(
            f"{value!r:.60} has no form in binary transfer: a number must be finite and within ±8,388,608 (UG p. 167)"
        ) from None


def decode_number(data: bytes) -> float:
    """
    Read six bytes of fixed point; every value fits a float exactly.

    Raises:
        InvalidCommandError: They are not six.
    """
    _check_length(data, FIXED_POINT_BYTES)
    return int.from_bytes(data, "little", signed=True) / _SCALE


def encode_word(value: int) -> bytes:
    """
    Write a time or an output's number: two bytes, most significant first (UG p. 167).

    Raises:
        InvalidCommandError: It is no whole number from 0 to 65,535.
    """
    if type(value) is not int or not 0 <= value <= _MAX_WORD:
        raise InvalidCommandError(f"{value!r:.60} is no whole number from 0 to {_MAX_WORD} (UG p. 167)")
    return value.to_bytes(WORD_BYTES, "big")


def decode_word(data: bytes) -> int:
    """
    Read two bytes, most significant first.

    Raises:
        InvalidCommandError: They are not two.
    """
    _check_length(data, WORD_BYTES)
    return int.from_bytes(data, "big")


def _check_length(data: bytes, length: int) -> None:
    if len(data) != length:
        raise InvalidCommandError(f"an operand of {length} bytes does not have {len(data)} (UG p. 167)")


def _encode_operand(kind: BinaryOperand, text: str) -> bytes:
    if kind is BinaryOperand.NUMBER:
        return encode_number(Decimal(text))
    if kind is BinaryOperand.WORD:
        return encode_word(int(text))
    number, _, level = text.removeprefix("O").partition("=")
    if int(number) not in OUTPUT_NUMBERS:
        raise InvalidCommandError(f"O{number} is none of the outputs 1 to {OUTPUT_NUMBERS[-1]}")
    return encode_word(int(number)) + _LEVELS[level == "1"]


def _decode_operand(kind: BinaryOperand, data: bytes) -> str:
    if kind is BinaryOperand.NUMBER:
        return _shortest(decode_number(data))
    if kind is BinaryOperand.WORD:
        return str(decode_word(data))
    if data[-1] not in LEVEL_BYTES:
        raise InvalidCommandError(f"0x{data[-1]:02X} is no level of an output (UG p. 167)")
    return f"O{decode_word(data[:-1])}={LEVEL_BYTES[data[-1]]:d}"


def _shortest(value: float) -> str:
    """Write *value* with as few decimals as make the same bytes again."""
    wanted = encode_number(value)
    texts = (f"{value:.{decimals}f}" for decimals in range(_DECIMALS + 1))
    text = next(text for text in texts if _makes(text, wanted))
    return "0" if text == "-0" else text


def _makes(text: str, wanted: bytes) -> bool:
    try:
        return encode_number(Decimal(text)) == wanted
    except InvalidCommandError:  # rounded up, out of range
        return False


# Frames ---------------------------------------------------------------------------------------------------------------


def encode_ascii(line: str) -> bytes:
    """Write *line* as text, with its end sign (UG p. 160)."""
    return line.encode("ascii") + COMMAND_END


def encode_frame(line: str) -> bytes | None:
    """Write a checked *line*, long or short form, as the frame that says the same; None if there is none."""
    found = _find_frame(line)
    return found[1] if found else None


def _find_frame(line: str) -> tuple[BinaryFrameFact, bytes] | None:
    compact = line.replace(" ", "")
    for row, pattern in _LINES:
        if match := pattern.fullmatch(compact):
            try:
                parts = [
                    bytes([letter]) + _encode_operand(kind, text)
                    for (letter, kind), text in zip(row.parts, match.groups(), strict=True)
                ]
            except InvalidCommandError:  # a number that no frame can hold; the drive shall judge the line
                return None
            return row, bytes([FRAME_BASE + row.length]) + b"".join(parts)
    return None


def decode_frame(data: bytes) -> str:
    """
    Say what one whole frame says, as a line in its short form, for logs and people.

    Raises:
        InvalidCommandError: It is no frame, or not one alone.
    """
    for row in BINARY_FRAMES:
        if (operands := _split(row, data)) is not None:
            words = zip(_words(row), row.parts, operands, strict=True)
            return " ".join(
                _SHORT[word] + (" " if kind is BinaryOperand.OUTPUT else "") + _decode_operand(kind, operand)
                for word, (_, kind), operand in words
            )
    raise InvalidCommandError(f"{data.hex(' ')!r:.60} is no frame of binary transfer (UG p. 166-167)")


def _split(row: BinaryFrameFact, data: bytes) -> list[bytes] | None:
    """Cut *data* into the operands of a frame of *row*; None if it is no such frame."""
    if len(data) != row.length or data[0] != FRAME_BASE + row.length:
        return None
    operands, at = [], 1
    for letter, kind in row.parts:
        end = at + 1 + _OPERAND_BYTES[kind]
        if data[at] != letter:
            return None
        operands.append(data[at + 1 : end])
        at = end
    return operands


def is_frame(data: bytes) -> bool:
    """Whether *data*, as it goes out, is a frame and not text: text has 7 bits."""
    return data[:1] >= bytes([FRAME_BASE])


def is_motion_frame(data: bytes) -> bool:
    """Whether *data*, as it goes out, is a frame that sets the axis in motion."""
    return data[:2] in _MOTION_HEADS


# What goes out --------------------------------------------------------------------------------------------------------

_FLOW_CONTROL: Final = frozenset({XON, XOFF})


@dataclass(frozen=True, slots=True, kw_only=True)
class BinaryTransfer:
    """
    Which lines go out as frames; all others, and all that carry a sign, stay text (mixed mode, UG p. 166).

    A frame that would hold the byte of XON or XOFF goes out as text: something on the way might keep it.

    Attributes:
        settings: SPEED, ACCEL and ACCEL-. A frame that is cut makes at worst a wrong speed or ramp.
        motion: POSA and POSR without ``$``. A frame that is cut takes what comes next for its own end, and moves the
            axis to where nobody said: only for lines that cannot lose a byte.
    """

    settings: bool = True
    motion: bool = False

    def encode(self, line: str) -> bytes:
        """Write *line* as it goes out."""
        found = _find_frame(line)
        if found is None or not self._allows(found[0]) or not _FLOW_CONTROL.isdisjoint(found[1]):
            return encode_ascii(line)
        return found[1]

    def _allows(self, row: BinaryFrameFact) -> bool:
        return (self.settings and row.long in _SETTINGS) or (self.motion and row.long in _MOTIONS)
