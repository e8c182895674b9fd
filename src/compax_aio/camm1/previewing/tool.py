"""The tool as it draws: where it stands, whether it is down, and the ways that it has gone."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import ceil, cos, radians, sin
from typing import Final, Literal

from ..facts.line import MAX_COORDINATE
from .drawing import Box, Drawing, Place, Point, Remark, Stroke, Waymarks

__all__ = ["Tool", "arc"]

_USUAL_CHORD_DEG: Final = 5.0
"""Of arcs that say none (PNC-900 p. 18)."""
_LEAST_CHORD_DEG: Final = 0.5
_FULL_TURN_DEG: Final = 360.0


def arc(centre: Point, start: Point, sweep_deg: float, chord_deg: float | None = None) -> list[Point]:
    """
    Return the chords of an arc, *start* not among them.

    Args:
        centre: Of the circle.
        start: Where it begins.
        sweep_deg: Counter-clockwise if it is positive; more than a full turn goes over the same way again.
        chord_deg: The angle of a chord; None: the machine's own.
    """
    sweep_deg = max(min(sweep_deg, _FULL_TURN_DEG), -_FULL_TURN_DEG)
    chord = max(abs(chord_deg or _USUAL_CHORD_DEG), _LEAST_CHORD_DEG)
    pieces = max(ceil(abs(sweep_deg) / chord - 1e-9), 1)
    x, y = start[0] - centre[0], start[1] - centre[1]
    points = []
    for number in range(1, pieces + 1):
        angle = radians(sweep_deg * number / pieces)
        points.append((centre[0] + x * cos(angle) - y * sin(angle), centre[1] + x * sin(angle) + y * cos(angle)))
    return points


_BEGIN: Final = Place(0, 1, 1)


@dataclass(slots=True)
class Tool:
    """
    Keeps what it has drawn.

    Attributes:
        at: Where it stands.
        is_down: Whether it cuts when it goes.
        speed_cm_s: With which strokes are noted.
        number: Of the tool that was chosen.
        place: Of the instruction that is being drawn.
    """

    at: Point = (0.0, 0.0)
    is_down: bool = False
    speed_cm_s: float | None = None
    number: int | None = None
    place: Place = _BEGIN
    feed_mm: float = 0.0
    vectors: int = 0
    _strokes: list[Stroke] = field(default_factory=list)
    _boxes: list[Box] = field(default_factory=list)
    _remarks: dict[str, Remark] = field(default_factory=dict)
    _waymarks: Waymarks = field(default_factory=Waymarks)
    _has_gone: bool = True
    """Since it went down."""

    def begin(self, place: Place) -> None:
        """Take note that what follows belongs to the instruction at *place*."""
        self.place = place

    def end_of_instruction(self) -> None:
        """Take note of where it stands after an instruction."""
        self._waymarks.offsets.append(self.place.offset)
        self._waymarks.points.append(self.at)

    def lower(self) -> None:
        """Go down; where it goes up again without a way, it has pierced the sheet."""
        if not self.is_down:
            self.is_down, self._has_gone = True, False

    def lift(self) -> None:
        """Go up."""
        if self.is_down and not self._has_gone:
            self._begin_stroke(is_cut=True).points.append(self.at)
        self.is_down = False

    def go(self, point: Point) -> None:
        """Go straight to *point*, as it is: up or down."""
        x, y = point
        if not (-MAX_COORDINATE <= x <= MAX_COORDINATE and -MAX_COORDINATE <= y <= MAX_COORDINATE):  # nor if it is none
            self.remark("a way that leads farther than coordinates reach is not drawn")
            return
        self._has_gone = True
        if point == self.at and not self.is_down:
            return
        strokes = self._strokes
        last = strokes[-1] if strokes else None
        if (
            last is None
            or last.is_cut != self.is_down
            or last.speed_cm_s != self.speed_cm_s
            or last.tool != self.number
        ):
            last = self._begin_stroke(is_cut=self.is_down)
        last.points.append(point)
        self.vectors += 1
        self.at = point

    def go_all(self, points: list[Point]) -> None:
        """Go straight from each of *points* to the next."""
        for each in points:
            self.go(each)

    def travel(self, point: Point) -> None:
        """Go to *point* up, and be up or down there as before."""
        was_down, self.is_down = self.is_down, False
        self.go(point)
        self.is_down = was_down

    def cut(self, points: list[Point]) -> None:
        """Go to *points* down, and be up or down there as before."""
        was_down, self.is_down = self.is_down, True
        self.go_all(points)
        self.is_down = was_down

    def _begin_stroke(self, *, is_cut: bool) -> Stroke:
        stroke = Stroke(is_cut, [self.at], self.place, self.speed_cm_s, self.number)
        self._strokes.append(stroke)
        return stroke

    def take(self, kind: Literal["label", "fill", "window"], corners: list[Point], text: str = "") -> None:
        """Note an area that is taken by something."""
        if all(-MAX_COORDINATE <= each <= MAX_COORDINATE for corner in corners for each in corner):
            self._boxes.append(Box(kind, tuple(corners), self.place, text, self.number))
        else:
            self.remark("an area that is farther away than coordinates reach is not drawn")

    def remark(self, what: str) -> None:
        """Note what is not drawn as it will be cut; once for each kind."""
        self._remarks.setdefault(what, Remark(what, self.place))

    def drawing(self) -> Drawing:
        """Return all that was drawn, now that it is at its end."""
        ends_down = self.is_down
        self.lift()
        return Drawing(
            strokes=tuple(self._strokes),
            boxes=tuple(self._boxes),
            remarks=tuple(self._remarks.values()),
            end=self.at,
            ends_down=ends_down,
            vectors=self.vectors,
            feed_mm=self.feed_mm,
            waymarks=self._waymarks,
        )
