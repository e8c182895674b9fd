"""What a controller keeps without power: its name, its parameters and the bytes of its program."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Final, Self

from .knobs import Knobs
from .language import HUNDREDTHS, PROGRAMMABLE, Instruction, arguments

__all__ = ["ERASED", "Memory", "Parameters"]

ERASED: Final = 0xFF
"""A byte of the program memory that holds nothing; a program ends there."""


@dataclass(frozen=True, slots=True)
class Parameters:
    """What S stores and a reset brings back, by the command that sets it."""

    initial_speed: int
    slew_speed: int
    slope_up: int
    slope_down: int
    resolution: int = 4
    variable_resolution: int = 1
    hold_current: int = 5
    run_current: int = 25
    settling: int = 200
    limit_polarity: int = 0

    @classmethod
    def of_factory(cls, knobs: Knobs) -> Self:
        """Return what a new controller has."""
        return cls(knobs.initial_speed, knobs.slew_speed, knobs.ramp_slope, knobs.ramp_slope)

    def with_values(self, instruction: Instruction) -> Parameters:
        """Return these after a command that sets some; others change nothing."""
        names = _SET_BY.get(instruction.letter, ())
        return replace(self, **{name: int(value) for name, value in zip(names, instruction.numbers, strict=False)})

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """List them."""
        return tuple(each.name for each in fields(cls))


_SET_BY: Final = {
    "I": ("initial_speed",),
    "V": ("slew_speed",),
    "K": ("slope_up", "slope_down"),
    "D": ("resolution",),
    "H": ("variable_resolution",),
    "Y": ("hold_current", "run_current"),
    "E": ("settling",),
    "l": ("limit_polarity",),
}


class Memory:
    """
    The non-volatile memory.

    A program is bytes and nothing else: a letter, and its numbers in the bytes that are left for them. What was
    written over half an instruction is read as whatever the bytes then say (AMS p. 25).

    Attributes:
        name: The name that S has stored.
        parameters: The parameters that S has stored.
        program: The bytes of the program.
        writes: How often something was written; such memory wears out.
    """

    def __init__(self, knobs: Knobs, name: str) -> None:
        self._knobs = knobs
        self.name = name
        self.parameters = Parameters.of_factory(knobs)
        self.program = bytearray([ERASED]) * knobs.program_size
        self.writes = 0

    def store(self, name: str, parameters: Parameters) -> None:
        """Keep a name and parameters (DCB p. 23)."""
        self.name = name
        self.parameters = parameters
        self.writes += 1

    def write(self, address: int, instruction: Instruction) -> int | None:
        """Write an instruction at once (DCB p. 24); return the address behind it, or None if it does not fit."""
        data = self._encoded(instruction)
        end = address + len(data)
        if end > len(self.program):
            return None
        self.program[address:end] = data
        self.writes += 1
        return end

    def read(self, address: int) -> tuple[Instruction | None, int] | None:
        """
        Read what stands at an address, as bytes say, and the address behind it.

        A byte that begins no instruction is one that does nothing. None: the program ends here.
        """
        if not 0 <= address < len(self.program) or self.program[address] == ERASED:
            return None
        letter = chr(self.program[address])
        if letter not in PROGRAMMABLE:
            return None, address + 1
        end = address + self._knobs.bytes_of(letter)
        data = bytes(self.program[address + 1 : end]).ljust(end - address - 1, b"\xff")
        return Instruction(letter, self._decoded(letter, data)), end

    def listing(self, address: int) -> list[str]:
        """List the program from an address on."""
        lines = []
        while (found := self.read(address)) is not None:
            instruction, end = found
            lines.append(f"{address} {instruction or '?'}")
            address = end
        return lines

    def _encoded(self, instruction: Instruction) -> bytes:
        """Pack the numbers into the bytes there are; what does not fit is cut off."""
        letter, numbers = instruction.letter, instruction.numbers
        scale = 100 if letter in HUNDREDTHS else 1
        data = bytearray([ord(letter)])
        for size, number in zip(self._sizes(letter), numbers, strict=True):
            data += (round(number * scale) % (1 << 8 * size)).to_bytes(size, "big")
        return bytes(data).ljust(self._knobs.bytes_of(letter), b"\0")

    def _decoded(self, letter: str, data: bytes) -> tuple[float, ...]:
        scale = 100 if letter in HUNDREDTHS else 1
        numbers, start = [], 0
        for size, argument in zip(self._sizes(letter), arguments(letter, self._knobs), strict=True):
            number = int.from_bytes(data[start : start + size], "big", signed=argument.low < 0)
            numbers.append(number / scale)
            start += size
        return tuple(numbers)

    def _sizes(self, letter: str) -> tuple[int, ...]:
        """Divide the bytes behind the letter among its numbers; of two the last has the smaller half."""
        size = self._knobs.bytes_of(letter) - 1
        count = len(arguments(letter, self._knobs))
        if count == 2:
            return size - size // 2, size // 2
        return (size,) * count
