"""Binary transfer: commands as frames of known length, with numbers in fixed point (UG p. 166-167)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Final

from .certainty import Certainty

__all__ = [
    "BINARY_FRAMES",
    "FIXED_POINT_BITS",
    "FIXED_POINT_BYTES",
    "FRAME_BASE",
    "LEVEL_BYTES",
    "LONGEST_FRAME",
    "WORD_BYTES",
    "BinaryFrameFact",
    "BinaryOperand",
]

FRAME_BASE: Final = 0x80
"""The first byte of a frame is this plus the frame's whole length: inferred, it holds for all rows."""

FIXED_POINT_BYTES: Final = 6
"""Of a number: signed, two's complement, least significant byte first (UG p. 167)."""

FIXED_POINT_BITS: Final = 24
"""Of a number, behind the point; as many stand before it, with the sign (UG p. 167)."""

WORD_BYTES: Final = 2
"""Of a time or of an output's number: unsigned, most significant byte first (UG p. 167)."""

LEVEL_BYTES: Final = {0x30: False, 0x31: True}
"""How a frame writes an output's 0 and 1 (UG p. 167)."""


class BinaryOperand(Enum):
    """What follows a letter of a frame."""

    NUMBER = "six bytes, fixed point"
    WORD = "two bytes, unsigned"
    OUTPUT = "two bytes, an output's number, and one for its level"


@dataclass(frozen=True, slots=True, kw_only=True)
class BinaryFrameFact:
    """One command in binary: each letter is followed by its operand."""

    long: str
    """The command in ASCII, long form."""
    parts: tuple[tuple[int, BinaryOperand], ...]
    """Letter and operand, in order."""
    length: int
    """Of the whole frame, in bytes."""
    source: str = "UG p. 166-167"
    certainty: Certainty = Certainty.DOCUMENTED


BINARY_FRAMES: Final = (
    BinaryFrameFact(long="POSA", parts=((0x41, BinaryOperand.NUMBER),), length=8),
    BinaryFrameFact(long="POSR", parts=((0x52, BinaryOperand.NUMBER),), length=8),
    BinaryFrameFact(long="SPEED", parts=((0x53, BinaryOperand.NUMBER),), length=8),
    BinaryFrameFact(long="ACCEL", parts=((0x4C, BinaryOperand.WORD),), length=4),
    BinaryFrameFact(long="ACCEL-", parts=((0x44, BinaryOperand.WORD),), length=4),
    BinaryFrameFact(long="OUTPUT", parts=((0x4F, BinaryOperand.OUTPUT),), length=5),
    BinaryFrameFact(long="POSR OUTPUT", parts=((0x52, BinaryOperand.NUMBER), (0x4F, BinaryOperand.OUTPUT)), length=12),
    BinaryFrameFact(long="POSR SPEED", parts=((0x52, BinaryOperand.NUMBER), (0x53, BinaryOperand.NUMBER)), length=15),
)
"""A frame has no end sign and takes no function sign; its answer is that of the same command in ASCII (UG p. 166)."""

LONGEST_FRAME: Final = max(row.length for row in BINARY_FRAMES)
