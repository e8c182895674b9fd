"""The digital inputs of a simulated drive, set by tests."""

from __future__ import annotations

from collections.abc import Callable

from .program import INPUT_NUMBERS

__all__ = ["Inputs"]


class Inputs(dict[int, bool]):
    """I1-I16; off until somebody sets them: ``drive.inputs[7] = True``."""

    def __init__(self) -> None:
        super().__init__(dict.fromkeys(INPUT_NUMBERS, False))
        self.before_change: Callable[[], None] = lambda: None
        """Called before an input changes, so that what was due earlier has happened."""

    def __setitem__(self, number: int, value: bool) -> None:
        """
        Set an input.

        Raises:
            ValueError: There is none of that number.
        """
        if number not in INPUT_NUMBERS:
            raise ValueError(f"inputs are I{INPUT_NUMBERS[0]} to I{INPUT_NUMBERS[-1]}, not I{number}")
        self.before_change()
        super().__setitem__(number, bool(value))
