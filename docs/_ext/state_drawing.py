"""Draws the states of a line as SVG, from its table of transitions and the places where its states are put."""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from html import escape
from math import hypot
from typing import Any, Final

__all__ = ["Arrow", "Box", "Diagram", "Route", "drawing", "svg"]

Point = tuple[float, float]

_FONT_PX: Final = 12
_LINE_PX: Final = 14
_CHARACTER_PX: Final = 0.605 * _FONT_PX
"""Of the fonts with letters of one width; none of the usual ones is wider."""
_BASELINE_PX: Final = 0.34 * _FONT_PX
"""From the middle of a line of text down to what its letters stand on."""
_STATE: Final = (130.0, 34.0)
_PAIR_PX: Final = 8
"""How far the arrows there and back lie from the straight line between two states."""
_GAP_PX: Final = 5
_LOOP_PX: Final = 26
_WIDE: Final = 0.75
"""Of the states: from more than that an event is drawn once, not from each of them."""


# What the table says --------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Arrow:
    """All events that lead from the same states to the same one; *sources* is one state, or nearly all of them."""

    sources: frozenset[Enum]
    target: Enum | None
    """None: where they are; nothing changes."""
    events: tuple[Hashable, ...]

    def pairs(self) -> Iterator[tuple[tuple[Enum, Hashable], Enum]]:
        """Give the rows of the table that this stands for."""
        for source in self.sources:
            for event in self.events:
                yield (source, event), source if self.target is None else self.target


@dataclass(frozen=True, slots=True, kw_only=True)
class Route:
    """Where one arrow runs, if not straight."""

    via: tuple[Point, ...]
    label_at: int = 0
    """By which of its parts the events stand, from 0."""


@dataclass(frozen=True, kw_only=True)
class Diagram:
    """
    One table, and where its states are put; what leads where is in the table alone.

    Attributes:
        places: Of the states, their middle.
        loops: At which side of a state that which leaves it as it is is drawn; below if it is not here.
        routes: By source and target, of what does not run straight.
        anywhere: By target, where "any state" stands.
    """

    title: str
    table: Mapping[tuple[Any, Any], Any]
    doubtful: Collection[Enum]
    word: Callable[[Any], str]
    """How an event is called."""
    size: Point
    places: Mapping[Enum, Point]
    loops: Mapping[Enum, Point] = field(default_factory=dict)
    routes: Mapping[tuple[Enum, Enum], Route] = field(default_factory=dict)
    anywhere: Mapping[Enum, Point] = field(default_factory=dict)

    @property
    def states(self) -> tuple[Enum, ...]:
        """All states, in their order."""
        return tuple(type(next(iter(self.places))))

    def arrows(self) -> list[Arrow]:
        """Group the table: what leads from nearly everywhere to one state, or nowhere, once; the rest by two states."""
        wide: dict[tuple[frozenset[Enum], Enum | None], list[Hashable]] = {}
        drawn: set[tuple[Any, Any]] = set()
        for event in dict.fromkeys(event for _, event in self.table):
            for sources, target in self._ways(event):
                if len(sources) > _WIDE * len(self.states):
                    wide.setdefault((sources, target), []).append(event)
                    drawn |= {(source, event) for source in sources}
        narrow: dict[tuple[Enum, Enum], list[Hashable]] = {}
        for (source, event), target in self.table.items():
            if (source, event) not in drawn:
                narrow.setdefault((source, target), []).append(event)
        return [
            *(Arrow(sources, target, tuple(events)) for (sources, target), events in wide.items()),
            *(Arrow(frozenset({source}), target, tuple(events)) for (source, target), events in narrow.items()),
        ]

    def _ways(self, event: Hashable) -> Iterator[tuple[frozenset[Enum], Enum | None]]:
        """Give where *event* leads, and from which states; None: it leaves them as they are."""
        follows = {source: target for (source, each), target in self.table.items() if each == event}
        yield frozenset(source for source, target in follows.items() if source is target), None
        for target in dict.fromkeys(follows.values()):
            yield frozenset(source for source, then in follows.items() if then is target), target


# Where it is drawn ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangle with text."""

    middle: Point
    size: Point
    lines: tuple[str, ...]

    @classmethod
    def of(cls, middle: Point, lines: Sequence[str], margin: float = 0.0) -> Box:
        """Return the box that *lines* need."""
        width = max(map(len, lines)) * _CHARACTER_PX + 2 * margin
        return cls(middle, (width, len(lines) * _LINE_PX + 2 * margin), tuple(lines))

    def border_towards(self, point: Point) -> Point:
        """Return where the way from the middle to *point* leaves the box."""
        dx, dy = point[0] - self.middle[0], point[1] - self.middle[1]
        scale = min(self.size[0] / 2 / abs(dx) if dx else 1e9, self.size[1] / 2 / abs(dy) if dy else 1e9)
        return self.middle[0] + dx * scale, self.middle[1] + dy * scale

    def side_facing(self, point: Point) -> Point:
        """Return where an upright or level line from *point* meets the box, which is beside, above or below it."""
        (x, y), (width, height) = self.middle, self.size
        if abs(point[1] - y) <= height / 2:
            return x + (width / 2 if point[0] > x else -width / 2), point[1]
        return point[0], y + (height / 2 if point[1] > y else -height / 2)


@dataclass(frozen=True, slots=True)
class Line:
    """One arrow as it is drawn: its points, and its events beside it."""

    points: tuple[Point, ...]
    label: Box


@dataclass(frozen=True, slots=True)
class Drawing:
    """All that is drawn, so that it can be checked that nothing lies on anything else."""

    states: Mapping[Enum, Box]
    anywhere: tuple[Box, ...]
    lines: tuple[tuple[Arrow, Line], ...]
    notes: tuple[str, ...]


def drawing(diagram: Diagram) -> Drawing:
    """Put the arrows of *diagram* between its states."""
    states = {state: Box(place, _STATE, (state.name,)) for state, place in diagram.places.items()}
    arrows = diagram.arrows()
    narrow = {(next(iter(arrow.sources)), arrow.target) for arrow in arrows if len(arrow.sources) == 1}
    anywhere: list[Box] = []
    lines: list[tuple[Arrow, Line]] = []
    notes = ["Dashed: in doubt."]
    for arrow in arrows:
        words = [diagram.word(event) for event in arrow.events]
        if arrow.target is None:
            notes.append(f"{' and '.join(words)} {'change' if len(words) > 1 else 'changes'} nothing, "
                         f"in {_all_but(arrow.sources, diagram.states)}.")  # fmt: skip
        elif len(arrow.sources) > 1:
            box = Box.of(diagram.anywhere[arrow.target], [_all_but(arrow.sources, diagram.states)], margin=5)
            anywhere.append(box)
            lines.append((arrow, _straight(box, states[arrow.target], words, apart=False)))
        else:
            way = next(iter(arrow.sources)), arrow.target
            lines.append((arrow, _line(diagram, states, way, words, apart=way[::-1] in narrow)))
    return Drawing(states, tuple(anywhere), tuple(lines), tuple(notes))


def _line(
    diagram: Diagram, states: Mapping[Enum, Box], way: tuple[Enum, Enum], words: Sequence[str], *, apart: bool
) -> Line:
    source, target = way
    if source is target:
        return _loop(states[source], diagram.loops.get(source, (0, 1)), words)
    route = diagram.routes.get(way)
    if route is None:
        return _straight(states[source], states[target], words, apart=apart)
    points = (states[source].side_facing(route.via[0]), *route.via, states[target].side_facing(route.via[-1]))
    return Line(points, _beside(points[route.label_at], points[route.label_at + 1], words))


def _straight(source: Box, target: Box, words: Sequence[str], *, apart: bool) -> Line:
    """Draw from box to box, a little to the right if something leads back."""
    nx, ny = _right_of(source.middle, target.middle)
    shift = _PAIR_PX if apart else 0
    moved = [Box((box.middle[0] + nx * shift, box.middle[1] + ny * shift), box.size, ()) for box in (source, target)]
    begin, end = moved[0].border_towards(moved[1].middle), moved[1].border_towards(moved[0].middle)
    # A box that was moved aside has its border elsewhere.
    begin, end = _onto(source, begin, end), _onto(target, end, begin)
    return Line((begin, end), _beside(begin, end, words))


def _onto(box: Box, point: Point, other: Point) -> Point:
    """Move *point* along the line to *other* until it lies on the border of *box*."""
    dx, dy = other[0] - point[0], other[1] - point[1]
    best = point
    for axis, delta in ((0, dx), (1, dy)):
        for side in (-1, 1):
            if delta:
                t = (box.middle[axis] + side * box.size[axis] / 2 - point[axis]) / delta
                crossing = (point[0] + t * dx, point[1] + t * dy)
                inside = all(abs(crossing[i] - box.middle[i]) <= box.size[i] / 2 + 1e-6 for i in (0, 1))
                if inside and (best is point or _distance(crossing, other) < _distance(best, other)):
                    best = crossing
    return best


def _loop(state: Box, side: Point, words: Sequence[str]) -> Line:
    """Draw a way out of a state at one side and back in."""
    (x, y), (dx, dy) = state.middle, side
    half = _STATE[0] / 2 if dx else _STATE[1] / 2
    begin, out = 9.0, half + _LOOP_PX
    points = tuple(
        (x + dx * away + dy * across, y + dy * away + dx * across)
        for away, across in ((half, -begin), (out, -begin), (out, begin), (half, begin))
    )
    size = Box.of((0, 0), words).size
    away = out + _GAP_PX + (size[0] / 2 if dx else size[1] / 2)
    return Line(points, Box.of((x + dx * away, y + dy * away), words))


def _beside(begin: Point, end: Point, words: Sequence[str]) -> Box:
    """Put *words* to the right of the middle of a line, as near as they can stand."""
    nx, ny = _right_of(begin, end)
    width, height = Box.of((0, 0), words).size
    away = _GAP_PX + abs(nx) * width / 2 + abs(ny) * height / 2
    return Box.of(((begin[0] + end[0]) / 2 + nx * away, (begin[1] + end[1]) / 2 + ny * away), words)


def _right_of(begin: Point, end: Point) -> Point:
    length = _distance(begin, end)
    return -(end[1] - begin[1]) / length, (end[0] - begin[0]) / length


def _distance(one: Point, other: Point) -> float:
    return hypot(one[0] - other[0], one[1] - other[1])


def _all_but(sources: Collection[Enum], states: Sequence[Enum]) -> str:
    others = [state.name for state in states if state not in sources]
    return f"any state but {', '.join(others)}" if others else "any state"


# SVG ------------------------------------------------------------------------------------------------------------------

_STYLE: Final = """
.state-diagram { max-width: 100%; height: auto; color: var(--color-foreground-primary, #222); }
.state-diagram text { fill: currentColor; font: 12px ui-monospace, 'DejaVu Sans Mono', Menlo, Consolas, monospace;
  text-anchor: middle; }
.state-diagram .name { font-weight: 600; }
.state-diagram .note { text-anchor: start; }
.state-diagram .state { fill: var(--color-background-secondary, #f4f5f7); stroke: currentColor; stroke-width: 1.4; }
.state-diagram .doubtful { stroke-dasharray: 6 3; }
.state-diagram .anywhere { fill: none; stroke: currentColor; stroke-width: 0.8; stroke-dasharray: 1.5 2.5; }
.state-diagram .arrow { fill: none; stroke: currentColor; stroke-width: 1.1; opacity: 0.75; }
.state-diagram .tip { fill: currentColor; }
"""


def svg(diagram: Diagram, identity: str) -> str:
    """Write *diagram*; *identity* tells what it defines from what others on the page do."""
    drawn = drawing(diagram)
    width, height = diagram.size[0], diagram.size[1] + _LINE_PX * (len(drawn.notes) + 1)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" class="state-diagram" viewBox="0 0 {width:g} {height:g}" '
        f'width="{width:g}" height="{height:g}" role="img" aria-labelledby="{identity}-title {identity}-desc">',
        f'<title id="{identity}-title">{escape(diagram.title)}</title>',
        f'<desc id="{identity}-desc">{escape(_in_words(diagram))}</desc>',
        f"<style>{_STYLE}</style>",
        f'<defs><marker id="{identity}-tip" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="8" markerHeight="8" '
        'orient="auto-start-reverse"><path class="tip" d="M 0 1 L 10 5 L 0 9 z"/></marker></defs>',
    ]
    for _, line in drawn.lines:
        parts.append(f'<path class="arrow" marker-end="url(#{identity}-tip)" d="{_path(line.points)}"/>')
        parts += _text(line.label)
    for state, box in drawn.states.items():
        kind = "state doubtful" if state in diagram.doubtful else "state"
        parts += [_rectangle(box, kind), *_text(box, "name")]
    for box in drawn.anywhere:
        parts += [_rectangle(box, "anywhere"), *_text(box)]
    for number, note in enumerate(drawn.notes, start=1):
        parts.append(f'<text class="note" x="8" y="{diagram.size[1] + number * _LINE_PX:g}">{escape(note)}</text>')
    return "\n".join([*parts, "</svg>"])


def _in_words(diagram: Diagram) -> str:
    """Say what the picture shows to those who do not see it."""
    return " ".join(
        f"From {_all_but(arrow.sources, diagram.states) if len(arrow.sources) > 1 else next(iter(arrow.sources)).name} "
        f"by {', '.join(map(diagram.word, arrow.events))} to "
        f"{arrow.target.name if arrow.target is not None else 'the same'}."
        for arrow in diagram.arrows()
    )


def _path(points: Sequence[Point]) -> str:
    return " ".join(f"{'L' if number else 'M'} {x:.1f} {y:.1f}" for number, (x, y) in enumerate(points))


def _rectangle(box: Box, kind: str) -> str:
    (x, y), (width, height) = box.middle, box.size
    return (
        f'<rect class="{kind}" x="{x - width / 2:.1f}" y="{y - height / 2:.1f}" width="{width:.1f}" '
        f'height="{height:.1f}" rx="6"/>'
    )


def _text(box: Box, kind: str = "event") -> Iterator[str]:
    top = box.middle[1] - (len(box.lines) - 1) * _LINE_PX / 2 + _BASELINE_PX
    for number, line in enumerate(box.lines):
        yield f'<text class="{kind}" x="{box.middle[0]:.1f}" y="{top + number * _LINE_PX:.1f}">{escape(line)}</text>'
