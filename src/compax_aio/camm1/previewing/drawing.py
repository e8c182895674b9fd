"""What a job will draw: strokes in their order, areas and labels as boxes, bounds, lengths; in steps of the machine."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import pairwise
from math import hypot
from typing import Literal, NamedTuple

__all__ = ["Bounds", "Box", "Drawing", "Place", "Point", "Remark", "Stroke", "Waymarks"]

Point = tuple[float, float]
"""In steps, from the origin."""


class Place(NamedTuple):
    """Where in a job something stands; lines and columns count from 1, the offset is that of a byte, from 0."""

    offset: int
    line: int
    column: int


@dataclass(frozen=True, slots=True)
class Bounds:
    """The least rectangle with its sides along the axes, in steps."""

    left: float
    bottom: float
    right: float
    top: float

    @property
    def width_steps(self) -> float:
        """From left to right."""
        return self.right - self.left

    @property
    def height_steps(self) -> float:
        """From bottom to top."""
        return self.top - self.bottom

    def __or__(self, other: Bounds | None) -> Bounds:
        """Return the bounds of both."""
        if other is None:
            return self
        return Bounds(
            min(self.left, other.left),
            min(self.bottom, other.bottom),
            max(self.right, other.right),
            max(self.top, other.top),
        )

    @staticmethod
    def of(points: Iterable[Point]) -> Bounds | None:
        """Return those of *points*; None of none."""
        each = list(points)
        if not each:
            return None
        xs, ys = zip(*each, strict=True)
        return Bounds(min(xs), min(ys), max(xs), max(ys))


@dataclass(slots=True)
class Stroke:
    """
    One way of the tool without lifting or lowering it.

    Attributes:
        is_cut: Whether the tool is down.
        points: Two at least; two that are equal: the tool goes down there, and up again.
        place: Of the instruction that begins it.
        speed_cm_s: That the job asked for; None: the machine's own.
        tool: Of ``SP`` or ``!ST``; None: none was chosen.
    """

    is_cut: bool
    points: list[Point]
    place: Place
    speed_cm_s: float | None = None
    tool: int | None = None

    @property
    def length_steps(self) -> float:
        """How long the way is."""
        return sum(hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(self.points))


@dataclass(frozen=True, slots=True)
class Box:
    """
    Something that is drawn as the area that it takes, because how it looks is the machine's own matter.

    Attributes:
        kind: A text, a filled area, or the window outside of which nothing is cut.
        corners: Four or more, in order.
        place: Of its instruction.
        text: Of a label.
        tool: As of a stroke.
    """

    kind: Literal["label", "fill", "window"]
    corners: tuple[Point, ...]
    place: Place
    text: str = ""
    tool: int | None = None


@dataclass(frozen=True, slots=True)
class Remark:
    """Something that is not drawn as it will be cut, and where that is so for the first time."""

    what: str
    place: Place


@dataclass(slots=True)
class Waymarks:
    """Where the tool stands at the beginning of each instruction."""

    offsets: list[int] = field(default_factory=list)
    points: list[Point] = field(default_factory=list)

    def at(self, offset: int) -> Point | None:
        """Return where the tool stands after the instruction that byte *offset* belongs to; None before the first."""
        index = bisect_right(self.offsets, offset)
        return self.points[index - 1] if index else None


@dataclass(frozen=True, slots=True)
class Drawing:
    """
    All of a job as it will be cut, as far as that can be told without the machine.

    Attributes:
        strokes: In their order; each begins where the one before it ends.
        boxes: Labels, fills, windows.
        remarks: What is not drawn as it will be.
        end: Where the tool stands at the end.
        ends_down: Whether it is down there.
        vectors: How many straight pieces there are, chords of arcs included, travel too.
        feed_mm: By how much the sheet is fed in all (``!PG``).
        waymarks: Where the tool stands at each instruction.
    """

    strokes: tuple[Stroke, ...]
    boxes: tuple[Box, ...]
    remarks: tuple[Remark, ...]
    end: Point
    ends_down: bool
    vectors: int
    feed_mm: float
    waymarks: Waymarks

    @property
    def cut_bounds(self) -> Bounds | None:
        """Of all that is cut, labels and fills included; None where nothing is."""
        bounds: Bounds | None = None
        for stroke in self.strokes:
            if stroke.is_cut and (each := Bounds.of(stroke.points)) is not None:
                bounds = each | bounds
        for box in self.boxes:
            if box.kind != "window" and (each := Bounds.of(box.corners)) is not None:
                bounds = each | bounds
        return bounds

    @property
    def bounds(self) -> Bounds | None:
        """Of all ways, travel included; None where there is nothing."""
        bounds = self.cut_bounds
        for stroke in self.strokes:
            if not stroke.is_cut and (each := Bounds.of(stroke.points)) is not None:
                bounds = each | bounds
        return bounds

    @property
    def cuts(self) -> int:
        """How often the tool goes down."""
        return sum(stroke.is_cut for stroke in self.strokes)

    @property
    def travel_steps(self) -> float:
        """How long the way is with the tool up."""
        return sum(stroke.length_steps for stroke in self.strokes if not stroke.is_cut)

    @property
    def cut_steps(self) -> float:
        """How long the way is with the tool down, labels and fills not included."""
        return sum(self.cut_steps_by_speed().values())

    def cut_steps_by_speed(self) -> dict[float | None, float]:
        """Return how much is cut at each speed in cm/s that the job asks for; None: at the machine's own."""
        lengths: dict[float | None, float] = {}
        for stroke in self.strokes:
            if stroke.is_cut:
                lengths[stroke.speed_cm_s] = lengths.get(stroke.speed_cm_s, 0.0) + stroke.length_steps
        return lengths
