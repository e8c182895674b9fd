"""Instructions that set something: scale, window, speed, force, tool, text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import atan2
from types import MappingProxyType
from typing import Final

from .outlines import Action, mark
from .tool import CHARACTER_CM, Step, Tool

__all__ = ["SETTINGS"]

_KNOWN_SETS: Final = frozenset({*range(10), *range(30, 40)})
_MOST_TOOLS: Final = 63


def _initialise(tool: Tool, step: Step, _: Sequence[float]) -> None:
    tool.initialise()
    mark(tool, step, ())


def _default(tool: Tool, _: Step, __: Sequence[float]) -> None:
    tool.set_defaults()


def _set_points(tool: Tool, _: Step, numbers: Sequence[float]) -> None:
    if not numbers:
        tool.set_points(None, None)
        return
    x, y = numbers[:2]
    if len(numbers) == 2:  # the second one moves with the first
        tool.set_points((x, y), (x + tool.p2[0] - tool.p1[0], y + tool.p2[1] - tool.p1[1]))
    else:
        tool.set_points((x, y), (numbers[2], numbers[3]))


def _set_scale(tool: Tool, _: Step, numbers: Sequence[float]) -> None:
    if numbers and (numbers[0] == numbers[1] or numbers[2] == numbers[3]):
        tool.fail(3)
    else:
        tool.scale = tuple(numbers) or None


def _set_window(tool: Tool, _: Step, numbers: Sequence[float]) -> None:
    if not numbers:
        tool.window = None
        return
    (x0, y0), (x1, y1) = tool.point(numbers[0], numbers[1]), tool.point(numbers[2], numbers[3])
    tool.window = (min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1))


def _set_speed(tool: Tool, step: Step, numbers: Sequence[float]) -> None:
    low, high = tool.range_cm_s
    if numbers and not low <= numbers[0] <= high:
        tool.fail(3)
        return
    tool.set_speed(numbers[0] if numbers else None)
    mark(tool, step, numbers)


def _set_force(tool: Tool, step: Step, numbers: Sequence[float]) -> None:
    tool.force = numbers[0] if numbers else None
    mark(tool, step, numbers)


def _set_tool(tool: Tool, step: Step, numbers: Sequence[float]) -> None:
    number = numbers[0] if numbers else 0
    if number != int(number) or not 0 <= number <= _MOST_TOOLS:
        tool.fail(3)
        return
    tool.is_down = tool.is_down and step.name != "SP"  # a pen is put back with the carriage up
    tool.number = int(number)
    mark(tool, step, numbers)


def _feed(tool: Tool, step: Step, numbers: Sequence[float]) -> None:
    tool.is_down = False
    mark(tool, step, numbers)


def _set_direction(tool: Tool, _: Step, numbers: Sequence[float]) -> None:
    tool.direction = atan2(numbers[1], numbers[0]) if numbers else 0.0


def _set_character(tool: Tool, _: Step, numbers: Sequence[float]) -> None:
    tool.character = (numbers[0], numbers[1]) if numbers else CHARACTER_CM


def _set_of_characters(tool: Tool, _: Step, numbers: Sequence[float]) -> None:
    if numbers and numbers[0] not in _KNOWN_SETS:
        tool.fail(5)


def _move_by_characters(tool: Tool, step: Step, numbers: Sequence[float]) -> None:
    tool.advance(step, *(numbers or (0.0, -1.0)))


SETTINGS: Final[Mapping[str, Action]] = MappingProxyType({
    "IN": _initialise,
    "DF": _default,
    "IP": _set_points,
    "SC": _set_scale,
    "IW": _set_window,
    "VS": _set_speed,
    **dict.fromkeys(["FS", "!FS"], _set_force),
    **dict.fromkeys(["SP", "!ST"], _set_tool),
    **dict.fromkeys(["PG", "!PG"], _feed),
    **dict.fromkeys(["DI", "DR"], _set_direction),
    "SI": _set_character,
    **dict.fromkeys(["CS", "CA"], _set_of_characters),
    "CP": _move_by_characters,
    # They change how something is drawn that is kept as a mark alone, or dashes that a blade does not make.
    **dict.fromkeys(["PT", "FT", "LT", "L", "B", "S", "Q", "NR", "!NR"], mark),
})  # fmt: skip
"""By name; what is not here changes nothing that is kept."""
