"""What the instructions of both cutting languages do to the tool."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

from compax_aio.camm1.facts.line import ETX, MAX_COORDINATE
from compax_aio.camm1.facts.mnemonics import Mnemonic, Shape, mnemonic_of

from .language import NOTHING, Reader, Stored
from .outlines import OUTLINES
from .tool import Step, Tool
from .tool_settings import SETTINGS

__all__ = ["Interpreter"]

_NUMBER: Final = re.compile(rb"[-+]?(?:\d+\.?\d*|\.\d+)")
_SEPARATORS: Final = b" ,\t\r\n"
_LINES: Final = frozenset({"PA", "PR", "PU", "PD"})
_ACTIONS: Final = {**OUTLINES, **SETTINGS}
_NOTED: Final = 78
"""Characters of an argument, in the log."""


class Interpreter:
    """
    Carries out what :class:`.Reader` has found; the machine gives it time.

    Args:
        tool: Whom it leads.
        reader: Whose label terminator ``DT`` sets.
        names: Instructions that the machine has.
    """

    def __init__(self, tool: Tool, reader: Reader, names: frozenset[str]) -> None:
        self._tool = tool
        self._reader = reader
        self._rows = {name: mnemonic_of(name) for name in names}

    def carry_out(self, stored: Stored) -> Step:
        """Do what an instruction says; where it leads is in the step, and the tool is as after it."""
        name, argument = stored.name, stored.argument
        step = self._tool.step(name, name + argument[:_NOTED].decode("latin-1"))
        if name in _LINES:
            self._set_motion(name)
            if argument:
                self._plot(step, argument)
        elif name in self._rows:
            self._do(step, self._rows[name], argument)
        elif name != NOTHING:
            self._tool.fail(1)
        return step

    def _do(self, step: Step, row: Mnemonic | None, argument: bytes) -> None:
        if row is not None and row.shape is not Shape.NUMBERS:
            self._tell(step, argument)
            return
        numbers = self._numbers(argument)
        if numbers is None:
            return
        if row is not None and not row.takes(len(numbers)):
            self._tool.fail(2)
            return
        if step.name in {"IN", "DF"}:
            self._reader.label_end = ETX
        action = _ACTIONS.get(step.name)
        if action is not None:
            action(self._tool, step, numbers)

    def _numbers(self, argument: bytes) -> list[float] | None:
        """Read numbers; None after telling an error."""
        numbers = [float(each) for each in _NUMBER.findall(argument)]
        if _NUMBER.sub(b"", argument).translate(None, _SEPARATORS):
            self._tool.fail(1)
            return None
        if any(abs(each) > MAX_COORDINATE for each in numbers):
            self._tool.fail(3)
            return None
        return numbers

    # Lines

    def _set_motion(self, name: str) -> None:
        tool = self._tool
        if name == "PD":
            tool.is_down = True
        elif name == "PU":
            tool.is_down = False
        else:
            tool.is_relative = name == "PR"

    def _plot(self, step: Step, argument: bytes) -> None:
        try:
            places: list[int] = [int(each) for each in argument.split(b",")]
        except ValueError:
            numbers = self._numbers(argument)
        else:
            if self._goes_straight(step, places):
                return
            numbers = self._numbers(argument)
        if numbers is None:
            return
        if len(numbers) % 2:
            self._tool.fail(2)
        self._lead(step, numbers)

    def _goes_straight(self, step: Step, places: Sequence[int]) -> bool:
        """Go where whole absolute steps lead; False if they are none, and nothing was done."""
        tool = self._tool
        if tool.is_relative or tool.scale is not None or len(places) % 2:
            return False
        if not -MAX_COORDINATE <= min(places) <= max(places) <= MAX_COORDINATE:
            return False
        is_down = tool.is_down
        step.stops = [(x, y, is_down) for x, y in zip(places[::2], places[1::2], strict=True)]
        tool.x, tool.y = places[-2:]
        return True

    def _lead(self, step: Step, numbers: Sequence[float]) -> None:
        tool = self._tool
        for x, y in zip(numbers[::2], numbers[1::2], strict=False):
            tool.go(step, [tool.beside(x, y) if tool.is_relative else tool.point(x, y)], is_down=tool.is_down)

    # What is no number

    def _tell(self, step: Step, argument: bytes) -> None:
        """Take a text: it is kept as a mark, and the tool goes on by its length."""
        text = argument.decode("latin-1")
        if step.name == "DT":
            self._reader.label_end = argument[0] if argument not in {b"", b";"} else ETX
            return
        step.mark = (step.name, text)
        if step.name in {"LB", "P"}:
            self._tool.advance(step, sum(each.isprintable() for each in text), 0)
