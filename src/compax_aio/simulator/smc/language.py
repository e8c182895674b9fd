"""What an axis understands: a letter and its numbers, and between which values they lie."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from compax_aio.smc.facts import COMMANDS, MAX_POSITION

from .knobs import Knobs

__all__ = ["HUNDREDTHS", "PROGRAMMABLE", "Argument", "Instruction", "arguments", "parsed"]

HUNDREDTHS: Final = frozenset("R+-M")
"""Commands whose number may have a fraction."""
PROGRAMMABLE: Final = frozenset(COMMANDS) - frozenset("PQXS^Z]")
"""Commands that can stand in a program."""
_SEPARATORS: Final = re.compile("[ ,]+")
_NUMBER: Final = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)")
_WORD: Final = 65_535


@dataclass(frozen=True, slots=True)
class Instruction:
    """A command and its numbers."""

    letter: str
    numbers: tuple[float, ...] = ()

    def __str__(self) -> str:
        """As a program is listed: ``R 10000.00``, ``J 1 3`` (DCB p. 24)."""
        form = "{:.2f}" if self.letter in HUNDREDTHS else "{:.0f}"
        return " ".join((self.letter, *(form.format(each) for each in self.numbers)))


@dataclass(frozen=True, slots=True)
class Argument:
    """A number of a command."""

    low: float
    high: float
    default: float | None = None
    """If it is left out; None: it must be there, or count as 0."""
    gap: float = 0.0
    """Sizes between 0 and this are not possible either."""

    def nearest(self, value: float) -> float:
        """Return the nearest value that is possible."""
        value = min(max(value, self.low), self.high)
        if 0 < abs(value) < self.gap:
            return math.copysign(self.gap, value)
        return value


def parsed(text: str) -> Instruction | None:
    """Read a command; None: it is none. There may be blanks or commas between letter and numbers."""
    text = text.strip(" ")
    if not text or text[0] not in COMMANDS:
        return None
    numbers = [each for each in _SEPARATORS.split(text[1:]) if each]
    if not all(_NUMBER.fullmatch(each) for each in numbers):
        return None
    return Instruction(text[0], tuple(float(each) for each in numbers))


def arguments(letter: str, knobs: Knobs) -> tuple[Argument, ...]:
    """List the numbers that a command takes; more are not looked at (``@ 0``, motorIms)."""
    if letter in {"I", "V"}:
        return (Argument(knobs.min_speed, knobs.max_speed),)
    if letter == "M":
        return (Argument(-knobs.max_speed, knobs.max_speed, gap=knobs.min_speed),)
    if letter == "F":
        return (Argument(knobs.min_speed, knobs.max_speed), Argument(0, 1, 0.0))
    return _FIXED.get(letter, ())


_FIXED: Final[Mapping[str, tuple[Argument, ...]]] = {
    "+": (Argument(0, MAX_POSITION),),
    "-": (Argument(0, MAX_POSITION),),
    "R": (Argument(-MAX_POSITION, MAX_POSITION),),
    "G": (Argument(0, _WORD, 0.0), Argument(0, 255, 0.0)),
    "Z": (Argument(0, 1, 0.0),),
    "]": (Argument(0, 1, 0.0),),
    "O": (Argument(-MAX_POSITION, MAX_POSITION, 0.0),),
    "K": (Argument(0, 255), Argument(0, 255, -1.0)),
    "D": (Argument(0, 8),),
    "H": (Argument(0, 1),),
    "Y": (Argument(0, 100), Argument(0, 100, -1.0)),
    "E": (Argument(0, _WORD),),
    "l": (Argument(0, 1),),
    "A": (Argument(0, 129),),
    "P": (Argument(0, _WORD),),
    "J": (Argument(0, _WORD), Argument(0, 255)),
    "W": (Argument(0, _WORD),),
    "Q": (Argument(0, _WORD, 0.0),),
    "C": (Argument(0, 1, 0.0),),
}
"""Those that no knob changes; where no source has a range, what fits the bytes. A default of -1: as the first one."""
