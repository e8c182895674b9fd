"""Instructions that draw more than lines: arcs, circles, wedges, rectangles, axes, of both modes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import atan2, cos, degrees, hypot, radians, sin
from types import MappingProxyType
from typing import Final

from .shapes import CHORD_DEG, Point, arc
from .tool import Step, Tool

__all__ = ["OUTLINES", "Action", "mark"]

Action = Callable[[Tool, Step, Sequence[float]], None]


def mark(_: Tool, step: Step, numbers: Sequence[float]) -> None:
    """Keep that it was done."""
    step.mark = (step.name, ",".join(f"{each:g}" for each in numbers))


def _on_circle(centre: Point, radius: float, angle_deg: float) -> Point:
    return centre[0] + radius * cos(radians(angle_deg)), centre[1] + radius * sin(radians(angle_deg))


def _chord(numbers: Sequence[float], place: int) -> float:
    return numbers[place] if len(numbers) > place else CHORD_DEG


def _circle(tool: Tool, step: Step, numbers: Sequence[float]) -> None:
    centre, radius = (tool.x, tool.y), abs(tool.length(numbers[0]))
    tool.draw(step, _on_circle(centre, radius, 0), arc(centre, radius, 0, 360, _chord(numbers, 1)))


def _arc_around(tool: Tool, step: Step, numbers: Sequence[float]) -> None:
    """``AA``, ``AR``: around a centre, from where the tool is, up or down as it is."""
    x, y, sweep = numbers[:3]
    centre = tool.point(x, y) if step.name == "AA" else tool.beside(x, y)
    radius = hypot(tool.x - centre[0], tool.y - centre[1])
    begin = degrees(atan2(tool.y - centre[1], tool.x - centre[0]))
    tool.go(step, arc(centre, radius, begin, sweep, _chord(numbers, 3)), is_down=tool.is_down)


def _wedge(tool: Tool, step: Step, numbers: Sequence[float]) -> None:
    centre, radius = (tool.x, tool.y), tool.length(numbers[0])
    begin, sweep = numbers[1:3]
    outline = [_on_circle(centre, radius, begin), *arc(centre, radius, begin, sweep, _chord(numbers, 3)), centre]
    tool.draw(step, centre, outline)


def _draw_rectangle(tool: Tool, step: Step, corner: Point) -> None:
    begin = (tool.x, tool.y)
    tool.draw(step, begin, [(corner[0], begin[1]), corner, (begin[0], corner[1]), begin])


def _rectangle(tool: Tool, step: Step, numbers: Sequence[float]) -> None:
    x, y = numbers
    _draw_rectangle(tool, step, tool.point(x, y) if step.name == "EA" else tool.beside(x, y))


def _arc_of_mode_1(tool: Tool, step: Step, numbers: Sequence[float]) -> None:
    """``C`` around a point, ``G`` around that of ``A``, ``E`` from where the tool is."""
    centre = tool.centre
    if step.name == "C":
        centre, numbers = tool.point(numbers[0], numbers[1]), numbers[2:]
    radius, (begin, end) = tool.length(numbers[0]), numbers[1:3]
    if step.name == "E":
        centre = _on_circle((tool.x, tool.y), -radius, begin)
    tool.lead_to(step, _on_circle(centre, radius, begin))
    tool.go(step, arc(centre, radius, begin, end - begin, _chord(numbers, 3)), is_down=True)
    tool.is_down = True


def _set_centre(tool: Tool, _: Step, numbers: Sequence[float]) -> None:
    tool.centre = tool.point(numbers[0], numbers[1])


def _division(tool: Tool, step: Step, numbers: Sequence[float]) -> None:
    """``K``: as we read it, a line between two distances from the centre of ``A``, at an angle."""
    angle, near, far = numbers
    tool.lead_to(step, _on_circle(tool.centre, tool.length(near), angle))
    tool.go(step, [_on_circle(tool.centre, tool.length(far), angle)], is_down=True)
    tool.is_down = True


def _box(tool: Tool, step: Step, numbers: Sequence[float]) -> None:
    """``T``: as we read it, a rectangle of that width and height; hatching is told as a mark."""
    if numbers[0]:
        mark(tool, step, numbers)
    _draw_rectangle(tool, step, tool.beside(numbers[1], numbers[2]))


def _axis(tool: Tool, step: Step, numbers: Sequence[float]) -> None:
    """``X``: along y or x, so long as its ticks need; they are told as a mark."""
    kind, length = numbers[0], numbers[1] * numbers[2]
    mark(tool, step, numbers)
    tool.go(step, [tool.beside(length, 0) if kind else tool.beside(0, length)], is_down=True)
    tool.is_down = True


def _lines_of_mode_1(tool: Tool, step: Step, numbers: Sequence[float]) -> None:
    is_relative = step.name in {"I", "R"}
    tool.is_down = step.name in {"D", "I"}
    for x, y in zip(numbers[::2], numbers[1::2], strict=True):
        tool.go(step, [tool.beside(x, y) if is_relative else tool.point(x, y)], is_down=tool.is_down)


def _home(tool: Tool, step: Step, _: Sequence[float]) -> None:
    tool.is_down = False
    tool.go(step, [(0.0, 0.0)], is_down=False)


OUTLINES: Final[Mapping[str, Action]] = MappingProxyType({
    **dict.fromkeys(["D", "I", "M", "R"], _lines_of_mode_1),
    "H": _home,
    "CI": _circle,
    **dict.fromkeys(["AA", "AR"], _arc_around),
    "EW": _wedge,
    **dict.fromkeys(["EA", "ER"], _rectangle),
    # How the lines of a filling lie, FT says, and no page.
    **dict.fromkeys(["RA", "RR", "WG"], mark),
    **dict.fromkeys(["C", "E", "G"], _arc_of_mode_1),
    "A": _set_centre,
    "K": _division,
    "T": _box,
    "X": _axis,
    "N": mark,
    "UC": mark,
    "XT": mark,
    "YT": mark,
})  # fmt: skip
"""By name; fillings, symbols and ticks are kept as marks."""
