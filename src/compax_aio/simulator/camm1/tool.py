"""The tool of a simulated cutter: where it is, how it was told to go, and how the job counts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import cos, inf, sin
from typing import Final

from compax_aio.camm1.facts.line import MAX_COORDINATE, STEPS_PER_MM, STEPS_PER_S_AT_1_CM_S
from compax_aio.camm1.facts.reports import OUTPUT_INSTRUCTIONS

from .knobs import Knobs
from .shapes import Point

__all__ = ["CHARACTER_CM", "Step", "Stop", "Tool"]

CHARACTER_CM: Final = (0.285, 0.375)
"""Width and height of a character, as an HP 7475A has them; those of a cutter are not known."""
_ADVANCE: Final = 1.5
_LINE: Final = 2.0
_STEPS_PER_CM: Final = 10 * STEPS_PER_MM
_USUAL_POINTS: Final = ((0.0, 0.0), (10_000.0, 10_000.0))

Stop = tuple[float, float, bool]
"""Where a vector ends, and whether it was cut."""


@dataclass(slots=True)
class Step:
    """One instruction, as it was carried out."""

    name: str
    text: str
    begins: Stop
    state: int
    """Of the tool, for :meth:`.Vectors.move`, but for up and down."""
    speeds: tuple[float, float] = (inf, inf)
    """Steps per second, of tool up and down."""
    stops: list[Stop] = field(default_factory=list)
    counted: int = 0
    """Bytes of the buffer that it holds until its end."""
    mark: tuple[str, str] | None = None

    @property
    def asks(self) -> bool:
        """Whether it is answered."""
        return self.name in OUTPUT_INSTRUCTIONS


class Tool:
    """
    The state that instructions change.

    Args:
        knobs: Of the cutter.
        on_error: Called with a number for ``OE``.

    Attributes:
        x: Where the last instruction leads to, in steps.
        y: The same.
        is_down: Whether the tool is.
        number: Of ``!ST`` or ``SP``.
        p1: The first scaling point.
        p2: The second.
        p_changed: Whether they were since they were asked.
        initialised: Whether it was since ``OS``.
        is_relative: After ``PR``.
        scale: Of ``SC``: low and high of x, then of y; None: steps.
        window: Of ``IW``, in steps; None: all.
        centre: Of ``A``.
        character: Width and height in cm.
        direction: Of text, in radians.
        speed_cm_s: With the tool down.
        force: As it was given; None: none was.
    """

    def __init__(self, knobs: Knobs, on_error: Callable[[int], None]) -> None:
        self._usual_speed_cm_s = knobs.speed_cm_s
        self._travel = knobs.travel_cm_s * STEPS_PER_S_AT_1_CM_S
        self.range_cm_s = knobs.speeds_cm_s
        self.fail = on_error
        self.x, self.y = 0.0, 0.0
        self.is_down = False
        self.number = 0
        self.initialise()

    def initialise(self) -> None:
        """Lift it, and set all as after power-on, but where it is (``IN``)."""
        self.is_down = False
        self.set_points(*_USUAL_POINTS)
        self.p_changed, self.initialised = False, True
        self.set_defaults()

    def set_defaults(self) -> None:
        """Set what ``DF`` sets."""
        self.is_relative = False
        self.scale: tuple[float, ...] | None = None
        self.window: tuple[float, ...] | None = None
        self.centre: Point = (0.0, 0.0)
        self.character = CHARACTER_CM
        self.direction = 0.0
        self.force: float | None = None
        self.set_speed(None)

    def set_speed(self, speed_cm_s: float | None) -> None:
        """Cut at that speed; None: the usual one."""
        self.speed_cm_s = self._usual_speed_cm_s if speed_cm_s is None else speed_cm_s
        self.speeds = (self._travel, self.speed_cm_s * STEPS_PER_S_AT_1_CM_S)

    def set_points(self, p1: Point | None, p2: Point | None) -> None:
        """Set the scaling points (``IP``); None: the usual one."""
        self.p1, self.p2 = p1 or _USUAL_POINTS[0], p2 or _USUAL_POINTS[1]
        self.p_changed = True

    def step(self, name: str, text: str) -> Step:
        """Begin an instruction."""
        return Step(name, text, (self.x, self.y, self.is_down), self.number << 2, self.speeds)

    def take_back(self, step: Step) -> None:
        """Be where it was before *step*, which was not begun."""
        self.x, self.y, self.is_down = step.begins

    # As the job counts

    @property
    def user_position(self) -> Point:
        """Where the last instruction leads to, as the job counts."""
        if self.scale is None:
            return self.x, self.y
        x, y = (
            self.scale[2 * axis] + (place - self.p1[axis]) / self._factor(axis)
            for axis, place in enumerate((self.x, self.y))
        )
        return x, y

    def _factor(self, axis: int) -> float:
        assert self.scale is not None
        low, high = self.scale[2 * axis : 2 * axis + 2]
        return (self.p2[axis] - self.p1[axis]) / (high - low)

    def length(self, value: float, axis: int = 0) -> float:
        """Return a distance of the job in steps."""
        return value if self.scale is None else value * self._factor(axis)

    def point(self, x: float, y: float) -> Point:
        """Return a place of the job in steps."""
        if self.scale is None:
            return x, y
        return (
            self.p1[0] + (x - self.scale[0]) * self._factor(0),
            self.p1[1] + (y - self.scale[2]) * self._factor(1),
        )

    def beside(self, dx: float, dy: float) -> Point:
        """Return the place that is so far away, as the job counts."""
        return self.x + self.length(dx, 0), self.y + self.length(dy, 1)

    # Going

    def go(self, step: Step, points: Sequence[Point], *, is_down: bool) -> None:
        """Lead through *points*, rounded to steps."""
        for x, y in points:
            if max(abs(x), abs(y)) > MAX_COORDINATE:
                self.fail(6)
                return
            self.x, self.y = round(x), round(y)
            step.stops.append((self.x, self.y, is_down))

    def lead_to(self, step: Step, begin: Point) -> None:
        """Go there with the tool up, unless it is there."""
        if (round(begin[0]), round(begin[1])) != (self.x, self.y):
            self.go(step, [begin], is_down=False)

    def draw(self, step: Step, begin: Point, points: Sequence[Point]) -> None:
        """Go to *begin*, cut through *points*, and be where the tool was, as it was."""
        x, y = self.x, self.y
        self.lead_to(step, begin)
        self.go(step, points, is_down=True)
        self.lead_to(step, (x, y))

    def advance(self, step: Step, characters: float, lines: float) -> None:
        """Go on by characters and lines of text, with the tool up."""
        along = characters * self.character[0] * _ADVANCE * _STEPS_PER_CM
        across = lines * self.character[1] * _LINE * _STEPS_PER_CM
        turn_x, turn_y = cos(self.direction), sin(self.direction)
        self.lead_to(step, (self.x + along * turn_x - across * turn_y, self.y + along * turn_y + across * turn_x))
