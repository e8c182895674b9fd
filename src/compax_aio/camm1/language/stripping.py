"""What is none of a job and must not go to the cutter with it: device control, and instructions that answer."""

from __future__ import annotations

import re
from typing import Final

from ..facts.instructions import CONTROL_INSTRUCTIONS
from ..facts.reports import OUTPUT_INSTRUCTIONS
from .instruction import Instruction, Language

__all__ = ["is_output", "stripped"]

_WITH_PARAMETERS: Final = "".join(letter for letter, row in CONTROL_INSTRUCTIONS.items() if row.takes_parameters)
_CONTROL: Final = re.compile(rb"\x1b(?:\.(?:[%s][0-9; ]*:?|[^\x1b]:?)?)?" % re.escape(_WITH_PARAMETERS).encode())


def is_output(instruction: Instruction) -> bool:
    """Whether the cutter answers to it: ``OA``, ``OI`` and so on; the answer would be taken for another one's."""
    return instruction.language is Language.TWO and instruction.name in OUTPUT_INSTRUCTIONS


def stripped(instruction: Instruction) -> Instruction | None:
    """
    Return the instruction without the device control within it; None if nothing of it may go to the cutter.

    Of an instruction that is left out, the blanks that stand in front of it stay, as an instruction of blanks.
    The machine takes device control out of what it receives wherever it stands; what is left is what it would have
    cut. Offset, line and column stay.
    """
    if instruction.language is Language.CONTROL or is_output(instruction):
        return _blanks_in_front(instruction)
    if not instruction.holds_control:
        return instruction
    front, arguments, end = (
        _CONTROL.sub(b"", part)
        for part in (
            instruction.data[: instruction.first],
            instruction.data[instruction.first : instruction.last],
            instruction.data[instruction.last :],
        )
    )
    first = len(front)
    return instruction._replace(data=front + arguments + end, first=first, last=first + len(arguments))


def _blanks_in_front(instruction: Instruction) -> Instruction | None:
    size = instruction.begin
    if not size:
        return None
    blanks = instruction.data[:size]
    return instruction._replace(data=blanks, name="", language=Language.BLANK, begin=0, first=size, last=size)
