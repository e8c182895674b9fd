"""What the instructions of both cutting languages do: the state of the tool, and where it goes."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import atan2, cos, degrees, hypot, inf, radians, sin
from typing import Final

from compax_aio.camm1.facts.line import ETX, MAX_COORDINATE, STEPS_PER_MM, STEPS_PER_S_AT_1_CM_S
from compax_aio.camm1.facts.mnemonics import Shape, mnemonic_of
from compax_aio.camm1.facts.reports import OUTPUT_INSTRUCTIONS

from .language import NOTHING, Reader, Stored
from .shapes import CHORD_DEG, Point, arc

__all__ = ["Interpreter", "Step", "Stop"]

_ONE_NUMBER: Final = re.compile(rb"[-+]?(?:\d+\.?\d*|\.\d+)")
_SEPARATORS: Final = b" ,\t\r\n"
_CHARACTER_CM: Final = (0.285, 0.375)
_ADVANCE: Final = 1.5
_STEPS_PER_CM: Final = 10 * STEPS_PER_MM
_LINES: Final = ("PA", "PR", "PU", "PD")
_KNOWN_SETS: Final = frozenset({*range(10), *range(30, 40)})

Stop = tuple[float, float, bool]
"""Where a vector ends, and whether it was cut."""


@dataclass(slots=True)
class Step:
    """One instruction, as it was carried out."""

    name: str
    text: str
    counted: int = 0
    """Bytes of the buffer that it holds until its end."""
    begins: Stop = (0.0, 0.0, False)
    stops: list[Stop] = field(default_factory=list)
    state: int = 0
    """Of the tool, for :meth:`.Vectors.move`, but for up and down."""
    speeds: tuple[float, float] = (inf, inf)
    """Steps per second, of tool up and down."""
    mark: tuple[str, str] | None = None

    @property
    def asks(self) -> bool:
        """Whether it is answered."""
        return self.name in OUTPUT_INSTRUCTIONS


class Interpreter:
    """
    Carries out what :class:`.Reader` has found; the machine gives it time.

    Args:
        reader: Whose label terminator is set by ``DT``.
        names: Instructions that the machine has.
        speed_cm_s: Of the tool when it is down.
        travel_cm_s: Of the tool when it is up.
        speeds_cm_s: What ``VS`` takes.
        on_error: Called with a number for ``OE``.

    Attributes:
        x: Where the last instruction leads to, in steps.
        y: The same.
        is_down: Whether the tool is.
    """

    def __init__(
        self,
        reader: Reader,
        names: frozenset[str],
        speed_cm_s: float,
        travel_cm_s: float,
        speeds_cm_s: tuple[float, float],
        on_error: Callable[[int], None],
    ) -> None:
        self._reader = reader
        self._names = names
        self._usual_speed = speed_cm_s
        self._travel = travel_cm_s * STEPS_PER_S_AT_1_CM_S
        self._speed_range = speeds_cm_s
        self._error = on_error
        self.x, self.y = 0.0, 0.0
        self.is_down = False
        self.tool = 0
        self.p1: Point = (0.0, 0.0)
        self.p2: Point = (10_000.0, 10_000.0)
        self.p_changed = False
        self.initialised = True
        self.window: tuple[float, ...] | None = None
        self._set_defaults()

    def _set_defaults(self) -> None:
        """Set what ``DF`` sets."""
        self._is_relative = False
        self._scale: tuple[float, ...] | None = None
        self._centre: Point = (0.0, 0.0)
        self._character = _CHARACTER_CM
        self._direction = 0.0
        self._turn = 0.0
        self._reader.label_end = ETX
        self.window = None
        self.force: float | None = None
        self._set_speed(self._usual_speed)

    def _set_speed(self, speed_cm_s: float) -> None:
        self.speed_cm_s = speed_cm_s
        self._speeds = (self._travel, speed_cm_s * STEPS_PER_S_AT_1_CM_S)

    @property
    def user_x(self) -> float:
        """Where the last instruction leads to, as the job counts."""
        return self._to_user(self.x, 0)

    @property
    def user_y(self) -> float:
        """The same."""
        return self._to_user(self.y, 1)

    @property
    def is_scaled(self) -> bool:
        """Whether the job counts in units of its own."""
        return self._scale is not None

    def carry_out(self, stored: Stored) -> Step:
        """Do what an instruction says; where it leads is in the step, and the state is as after it."""
        name, argument = stored.name, stored.argument
        step = Step(name, "", 0, (self.x, self.y, self.is_down), [], self.tool << 2, self._speeds)
        if name == NOTHING:
            return step
        step.text = name + argument[:78].decode("latin-1")
        if name not in self._names:
            self._error(1)
            return step
        if name in _LINES:
            self._plot(step, argument)
            return step
        row = mnemonic_of(name)
        if row is not None and row.shape is not Shape.NUMBERS:
            self._tell(step, argument)
            return step
        numbers = self._numbers(argument)
        if numbers is None:
            return step
        if row is not None and not row.takes(len(numbers)):
            self._error(2)
            return step
        action = _ACTIONS.get(name)
        if action is not None:
            action(self, step, numbers)
        return step

    def take_back(self, step: Step) -> None:
        """Be where the tool was before *step*, which was not begun."""
        self.x, self.y, self.is_down = step.begins

    # Numbers and places

    def _numbers(self, argument: bytes) -> list[float] | None:
        """Read numbers; None after telling an error."""
        if not argument:
            return []
        numbers = [float(each) for each in _ONE_NUMBER.findall(argument)]
        if _ONE_NUMBER.sub(b"", argument).strip(_SEPARATORS).translate(None, _SEPARATORS):
            self._error(1)
            return None
        if any(abs(each) > MAX_COORDINATE for each in numbers):
            self._error(3)
            return None
        return numbers

    def _factor(self, axis: int) -> float:
        assert self._scale is not None
        low, high = self._scale[2 * axis : 2 * axis + 2]
        return (self.p2[axis] - self.p1[axis]) / (high - low)

    def _place(self, value: float, axis: int) -> float:
        """Return where a coordinate of the job is."""
        if self._scale is None:
            return value
        return self.p1[axis] + (value - self._scale[2 * axis]) * self._factor(axis)

    def _distance(self, value: float, axis: int) -> float:
        return value if self._scale is None else value * self._factor(axis)

    def _to_user(self, value: float, axis: int) -> float:
        if self._scale is None:
            return value
        return self._scale[2 * axis] + (value - self.p1[axis]) / self._factor(axis)

    def _point(self, x: float, y: float) -> Point:
        return self._place(x, 0), self._place(y, 1)

    def _go(self, step: Step, points: Sequence[Point], *, is_down: bool) -> None:
        """Lead through *points*, rounded to steps."""
        for x, y in points:
            if max(abs(x), abs(y)) > MAX_COORDINATE:
                self._error(6)
                return
            self.x, self.y = round(x), round(y)
            step.stops.append((self.x, self.y, is_down))

    def _draw(self, step: Step, begin: Point, points: Sequence[Point]) -> None:
        """Go to *begin*, cut through *points*, and be where the tool was, as it was."""
        x, y = self.x, self.y
        if (round(begin[0]), round(begin[1])) != (x, y):
            self._go(step, [begin], is_down=False)
        self._go(step, points, is_down=True)
        if (self.x, self.y) != (x, y):
            self._go(step, [(x, y)], is_down=False)

    # Lines

    def _plot(self, step: Step, argument: bytes) -> None:
        if step.name == "PA":
            self._is_relative = False
        elif step.name == "PR":
            self._is_relative = True
        elif step.name == "PU":
            self.is_down = False
        else:
            self.is_down = True
        if not argument:
            return
        numbers: Sequence[float] | None
        try:
            numbers = [int(each) for each in argument.split(b",")]
        except ValueError:
            numbers = self._numbers(argument)
            if numbers is None:
                return
        if len(numbers) % 2:
            self._error(2)
        is_down, stops = self.is_down, step.stops
        if not self._is_relative and self._scale is None:
            for x, y in zip(numbers[::2], numbers[1::2], strict=False):
                if not (-MAX_COORDINATE <= x <= MAX_COORDINATE and -MAX_COORDINATE <= y <= MAX_COORDINATE):
                    self._error(3)
                    return
                self.x, self.y = round(x), round(y)
                stops.append((self.x, self.y, is_down))
            return
        for x, y in zip(numbers[::2], numbers[1::2], strict=False):
            if self._is_relative:
                point = (self.x + self._distance(x, 0), self.y + self._distance(y, 1))
            else:
                point = self._point(x, y)
            self._go(step, [point], is_down=is_down)

    def _lines_of_mode_1(self, step: Step, numbers: Sequence[float]) -> None:
        is_relative = step.name in "IR"
        self.is_down = step.name in "DI"
        for x, y in zip(numbers[::2], numbers[1::2], strict=True):
            point = (self.x + self._distance(x, 0), self.y + self._distance(y, 1)) if is_relative else self._point(x, y)
            self._go(step, [point], is_down=self.is_down)

    def _home(self, step: Step, _: Sequence[float]) -> None:
        self.is_down = False
        self._go(step, [(0.0, 0.0)], is_down=False)

    # Arcs and areas

    def _circle(self, step: Step, numbers: Sequence[float]) -> None:
        radius = abs(self._distance(numbers[0], 0))
        chord = numbers[1] if len(numbers) > 1 else CHORD_DEG
        centre = (self.x, self.y)
        self._draw(step, (self.x + radius, self.y), arc(centre, radius, 0, 360, chord))

    def _arc_around(self, step: Step, numbers: Sequence[float]) -> None:
        """``AA``, ``AR``: around a centre, from where the tool is, as it is."""
        if step.name == "AA":
            centre = self._point(numbers[0], numbers[1])
        else:
            centre = (self.x + self._distance(numbers[0], 0), self.y + self._distance(numbers[1], 1))
        radius = hypot(self.x - centre[0], self.y - centre[1])
        begin = degrees(atan2(self.y - centre[1], self.x - centre[0]))
        chord = numbers[3] if len(numbers) > 3 else CHORD_DEG
        self._go(step, arc(centre, radius, begin, numbers[2], chord), is_down=self.is_down)

    def _wedge(self, step: Step, numbers: Sequence[float]) -> None:
        radius, begin, sweep = self._distance(numbers[0], 0), numbers[1], numbers[2]
        chord = numbers[3] if len(numbers) > 3 else CHORD_DEG
        if step.name == "WG":
            step.mark = ("WG", ",".join(f"{each:g}" for each in numbers))
            return
        centre = (self.x, self.y)
        first = (centre[0] + radius * cos(radians(begin)), centre[1] + radius * sin(radians(begin)))
        self._draw(step, centre, [first, *arc(centre, radius, begin, sweep, chord), centre])

    def _rectangle(self, step: Step, numbers: Sequence[float]) -> None:
        if step.name[1] == "A":
            x, y = self._point(numbers[0], numbers[1])
        else:
            x, y = self.x + self._distance(numbers[0], 0), self.y + self._distance(numbers[1], 1)
        if step.name in {"RA", "RR"}:  # how its lines lie, FT says, and no page
            step.mark = (step.name, f"{x:g},{y:g}")
            return
        begin = (self.x, self.y)
        self._draw(step, begin, [(x, begin[1]), (x, y), (begin[0], y), begin])

    def _arc_of_mode_1(self, step: Step, numbers: Sequence[float]) -> None:
        if step.name == "C":
            centre, numbers = self._point(numbers[0], numbers[1]), numbers[2:]
        else:
            centre = self._centre
        radius, begin, end = self._distance(numbers[0], 0), numbers[1], numbers[2]
        chord = numbers[3] if len(numbers) > 3 else CHORD_DEG
        first = (centre[0] + radius * cos(radians(begin)), centre[1] + radius * sin(radians(begin)))
        if step.name == "E":
            centre = (self.x - radius * cos(radians(begin)), self.y - radius * sin(radians(begin)))
            first = (self.x, self.y)
        if (round(first[0]), round(first[1])) != (self.x, self.y):
            self._go(step, [first], is_down=False)
        self._go(step, arc(centre, radius, begin, end - begin, chord), is_down=True)
        self.is_down = True

    def _set_centre(self, _: Step, numbers: Sequence[float]) -> None:
        self._centre = self._point(numbers[0], numbers[1])

    def _division(self, step: Step, numbers: Sequence[float]) -> None:
        """``K``: a line between two distances from the centre of ``A``, at an angle."""
        angle, (x, y) = radians(numbers[0]), self._centre
        near, far = (self._distance(each, 0) for each in numbers[1:])
        ends = [(x + each * cos(angle), y + each * sin(angle)) for each in (near, far)]
        self._go(step, ends[:1], is_down=False)
        self._go(step, ends[1:], is_down=True)
        self.is_down = True

    def _box(self, step: Step, numbers: Sequence[float]) -> None:
        """``T``: a rectangle from the tool position; its hatching is told as a mark."""
        kind, width, height = numbers[0], self._distance(numbers[1], 0), self._distance(numbers[2], 1)
        begin = (self.x, self.y)
        x, y = begin[0] + width, begin[1] + height
        self._draw(step, begin, [(x, begin[1]), (x, y), (begin[0], y), begin])
        if kind:
            step.mark = ("T", ",".join(f"{each:g}" for each in numbers))

    def _axis(self, step: Step, numbers: Sequence[float]) -> None:
        """``X``: the line of an axis; its ticks are told as a mark."""
        length = self._distance(numbers[1] * numbers[2], 0)
        x, y = (self.x + length, self.y) if numbers[0] else (self.x, self.y + length)
        self._go(step, [(x, y)], is_down=True)
        self.is_down = True
        step.mark = ("X", ",".join(f"{each:g}" for each in numbers))

    # Text: told as marks, and the tool moves on

    def _tell(self, step: Step, argument: bytes) -> None:
        text = argument.decode("latin-1")
        if step.name == "DT":
            self._reader.label_end = argument[0] if argument and argument != b";" else ETX
        elif step.name in {"SM", "CO"}:
            step.mark = (step.name, text.strip(";"))
        else:
            step.mark = (step.name, text)
            if step.name in {"LB", "P"}:
                self._advance(step, sum(each.isprintable() for each in text), 0)

    def _advance(self, step: Step, characters: float, lines: float) -> None:
        along = characters * self._character[0] * _ADVANCE * _STEPS_PER_CM
        across = lines * self._character[1] * 2 * _STEPS_PER_CM
        angle = self._direction
        point = (
            self.x + along * cos(angle) - across * sin(angle),
            self.y + along * sin(angle) + across * cos(angle),
        )
        if characters or lines:
            self._go(step, [point], is_down=False)

    def _move_by_characters(self, step: Step, numbers: Sequence[float]) -> None:
        characters, lines = numbers or (0.0, -1.0)
        self._advance(step, characters, lines)

    def _set_direction(self, _: Step, numbers: Sequence[float]) -> None:
        self._direction = atan2(numbers[1], numbers[0]) if numbers else 0.0

    def _set_character(self, _: Step, numbers: Sequence[float]) -> None:
        self._character = (numbers[0], numbers[1]) if numbers else _CHARACTER_CM

    def _set_of_characters(self, _: Step, numbers: Sequence[float]) -> None:
        if numbers and numbers[0] not in _KNOWN_SETS:
            self._error(5)

    def _note(self, step: Step, numbers: Sequence[float]) -> None:
        step.mark = (step.name, ",".join(f"{each:g}" for each in numbers))

    # Settings

    def _initialise(self, step: Step, _: Sequence[float]) -> None:
        self.is_down = False
        self.p1, self.p2 = (0.0, 0.0), (10_000.0, 10_000.0)
        self.p_changed, self.initialised = False, True
        self._set_defaults()
        step.mark = ("IN", "")

    def _default(self, _: Step, __: Sequence[float]) -> None:
        self._set_defaults()

    def _set_points(self, _: Step, numbers: Sequence[float]) -> None:
        if not numbers:
            self.p1, self.p2 = (0.0, 0.0), (10_000.0, 10_000.0)
        elif len(numbers) == 2:
            dx, dy = self.p2[0] - self.p1[0], self.p2[1] - self.p1[1]
            self.p1 = (numbers[0], numbers[1])
            self.p2 = (numbers[0] + dx, numbers[1] + dy)
        else:
            self.p1, self.p2 = (numbers[0], numbers[1]), (numbers[2], numbers[3])
        self.p_changed = True

    def _set_scale(self, _: Step, numbers: Sequence[float]) -> None:
        if numbers and (numbers[0] == numbers[1] or numbers[2] == numbers[3]):
            self._error(3)
        else:
            self._scale = tuple(numbers) or None

    def _set_window(self, _: Step, numbers: Sequence[float]) -> None:
        if not numbers:
            self.window = None
            return
        (x0, y0), (x1, y1) = self._point(numbers[0], numbers[1]), self._point(numbers[2], numbers[3])
        self.window = (min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1))

    def _set_vs(self, step: Step, numbers: Sequence[float]) -> None:
        low, high = self._speed_range
        if numbers and not low <= numbers[0] <= high:
            self._error(3)
            return
        self._set_speed(numbers[0] if numbers else self._usual_speed)
        self._note(step, numbers)

    def _set_force(self, step: Step, numbers: Sequence[float]) -> None:
        self.force = numbers[0] if numbers else None
        self._note(step, numbers)

    def _set_tool(self, step: Step, numbers: Sequence[float]) -> None:
        tool = numbers[0] if numbers else 0
        if not 0 <= tool < 64 or tool != int(tool):
            self._error(3)
            return
        if step.name == "SP":  # the pen is changed
            self.is_down = False
        self.tool = int(tool)
        self._note(step, numbers)

    def _feed(self, step: Step, numbers: Sequence[float]) -> None:
        self.is_down = False
        self._note(step, numbers)


_Action = Callable[[Interpreter, Step, Sequence[float]], None]


def _each(action: _Action, *names: str) -> dict[str, _Action]:
    return dict.fromkeys(names, action)


# ruff: noqa: SLF001  (its own methods, by name)
_ACTIONS: Final[Mapping[str, _Action]] = {
    **_each(Interpreter._lines_of_mode_1, "D", "M", "I", "R"),
    **_each(Interpreter._home, "H"),
    **_each(Interpreter._circle, "CI"),
    **_each(Interpreter._arc_around, "AA", "AR"),
    **_each(Interpreter._wedge, "EW", "WG"),
    **_each(Interpreter._rectangle, "EA", "ER", "RA", "RR"),
    **_each(Interpreter._arc_of_mode_1, "C", "E", "G"),
    **_each(Interpreter._set_centre, "A"),
    **_each(Interpreter._division, "K"),
    **_each(Interpreter._box, "T"),
    **_each(Interpreter._axis, "X"),
    **_each(Interpreter._move_by_characters, "CP"),
    **_each(Interpreter._set_direction, "DI", "DR"),
    **_each(Interpreter._set_character, "SI"),
    **_each(Interpreter._set_of_characters, "CS", "CA"),
    **_each(Interpreter._initialise, "IN"),
    **_each(Interpreter._default, "DF"),
    **_each(Interpreter._set_points, "IP"),
    **_each(Interpreter._set_scale, "SC"),
    **_each(Interpreter._set_window, "IW"),
    **_each(Interpreter._set_vs, "VS"),
    **_each(Interpreter._set_force, "FS", "!FS"),
    **_each(Interpreter._set_tool, "!ST", "SP"),
    **_each(Interpreter._feed, "!PG", "PG"),
    **_each(Interpreter._note, "N", "PT", "FT", "LT", "XT", "YT", "UC", "!NR", "NR", "L", "B", "S", "Q"),
}
