"""What a binary frame means: read from the fact tables, and said as the line that means the same (UG p. 166-167)."""

from __future__ import annotations

from typing import Final

from compax_aio.compax.facts.binary import (
    BINARY_FRAMES,
    FIXED_POINT_BITS,
    FIXED_POINT_BYTES,
    FRAME_BASE,
    LEVEL_BYTES,
    LONGEST_FRAME,
    WORD_BYTES,
    BinaryFrameFact,
    BinaryOperand,
)
from compax_aio.compax.facts.limits import SPEED_DECIMALS

__all__ = ["frame_length", "line_of", "shown"]

_SHORTEST_FRAME: Final = min(row.length for row in BINARY_FRAMES)

_OPERAND_BYTES: Final = {
    BinaryOperand.NUMBER: FIXED_POINT_BYTES,
    BinaryOperand.WORD: WORD_BYTES,
    BinaryOperand.OUTPUT: WORD_BYTES + 1,
}


def frame_length(first: int) -> int:
    """Return how many bytes the frame has that begins with the byte *first*; 0 if none does."""
    length = first - FRAME_BASE
    return length if _SHORTEST_FRAME <= length <= LONGEST_FRAME else 0


def line_of(frame: bytes, decimals: int) -> str | None:
    """
    Return the line that says the same as a whole *frame* to a drive with *decimals*; None if it means nothing.

    A frame's number is more exact than a drive counts, and is rounded to the decimals that the line may have. That is
    a choice: the manual does not say what becomes of the rest.
    """
    for row in BINARY_FRAMES:
        if row.length == len(frame) and (operands := _operands(row, frame)) is not None:
            return _line(row, operands, decimals)
    return None


def shown(frame: bytes, decimals: int) -> str:
    """Return a whole *frame* for the log, with what it means if anything: ``84 4C 00 FA (ACCEL 250)``."""
    line = line_of(frame, decimals)
    written = frame.hex(" ").upper()
    return written if line is None else f"{written} ({line})"


def _operands(row: BinaryFrameFact, frame: bytes) -> list[bytes] | None:
    """Return what follows each letter of *row*; None if *frame* has other letters."""
    operands = []
    at = 1
    for letter, kind in row.parts:
        if frame[at] != letter:
            return None
        end = at + 1 + _OPERAND_BYTES[kind]
        operands.append(frame[at + 1 : end])
        at = end
    return operands


def _line(row: BinaryFrameFact, operands: list[bytes], decimals: int) -> str | None:
    """Return the words of *row* and its operands as text; None if one of them is none."""
    words = row.long.split()
    said: list[str] = []
    for word, (_, kind), operand in zip(words, row.parts, operands, strict=True):
        text = _text(kind, operand, _decimals(words, word, decimals))
        if text is None:
            return None
        if len(words) > 1 and kind is BinaryOperand.NUMBER and any(operand) and not float(text):
            # A point that is nothing once rounded must not become the "POSR 0" of another command: more exact, it is
            # refused.
            text = f"{_number(operand):.{FIXED_POINT_BITS}f}"
        said += [word, text]
    return " ".join(said)


def _text(kind: BinaryOperand, operand: bytes, decimals: int) -> str | None:
    """Return an operand as a line has it; None if it is none."""
    if kind is BinaryOperand.NUMBER:
        return f"{round(_number(operand), decimals) + 0.0:.{decimals}f}"
    word = int.from_bytes(operand[:WORD_BYTES], "big")
    if kind is BinaryOperand.WORD:
        return str(word)
    level = LEVEL_BYTES.get(operand[-1])
    return None if level is None else f"O{word}={level:d}"


def _number(operand: bytes) -> float:
    return int.from_bytes(operand, "little", signed=True) / 2**FIXED_POINT_BITS


def _decimals(words: list[str], word: str, of_position: int) -> int:
    """Return how many decimals the number after *word* has; the speed of a speed step has none (UG p. 101)."""
    if word != "SPEED":
        return of_position
    return SPEED_DECIMALS if word is words[0] else 0
