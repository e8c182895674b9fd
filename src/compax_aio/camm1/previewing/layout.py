"""A drawing laid out on a page: cuts by order, travel, sheet, dimensions in mm, problems at their place, a legend."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import hypot
from textwrap import wrap
from typing import Final, Literal

from .drawing import Bounds, Drawing, Point, Stroke
from .scene import Area, Mark, Rule, Scene, Shape, Ways, Words

__all__ = ["Flaw", "scene_of"]

_ORDER_COLOURS: Final = (
    "#1b0c8a",
    "#41049d",
    "#6300a7",
    "#8305a7",
    "#a01a9c",
    "#b93289",
    "#cc4977",
    "#dd5e66",
    "#ea7456",
    "#f48849",
)
"""From the first cut to the last: dark to light, so that they differ to people with any kind of colour vision."""
_TRAVEL: Final = "#9a9a9a"
_MUCH_TRAVEL: Final = "#d2d2d2"
_SHEET: Final = "#5b7fa6"
_LABEL: Final = "#2e7d32"
_BAD: Final = "#d00000"
_INK: Final = "#222222"
_FAINT: Final = "#666666"

_LEAST_LETTER_MM: Final = 2.2
_LETTERS_ALONG: Final = 80
"""How many letters high the page is along its diagonal, where that makes them larger than the least."""
_LETTER_WIDTH: Final = 0.52
"""Of its size, on the average."""
_LEAST_WIDTH_LETTERS: Final = 62
_MOST_NUMBERS: Final = 30
"""Cuts that are numbered: more of them are shown by their colour alone."""
_MOST_DASHED: Final = 400
"""Ways with the tool up that are dashed; more of them are solid, thinner and fainter, so that cuts are seen."""
_MOST_LISTED: Final = 12
"""Problems and remarks that are told in words."""


@dataclass(frozen=True, slots=True)
class Flaw:
    """Something that is wrong with the job: what, which byte of it, and whether it must not be cut so."""

    what: str
    offset: int
    where: str
    is_error: bool = True


def scene_of(
    drawing: Drawing,
    *,
    mm_per_step: float,
    title: str,
    subtitles: Sequence[str] = (),
    sheet: Bounds | None = None,
    flaws: Sequence[Flaw] = (),
) -> Scene:
    """
    Lay *drawing* out.

    Args:
        drawing: Of a job.
        mm_per_step: Of the machine.
        title: In the first line.
        subtitles: In smaller lines below it.
        sheet: That is outlined; None: none.
        flaws: Marked where they are, and told below.
    """
    bounds = drawing.bounds or Bounds(0, 0, 0, 0)
    page = _Page(title, bounds | sheet, mm_per_step)
    page.write_head(title, subtitles)
    page.draw_sheet(sheet)
    page.draw_boxes(drawing)
    page.draw_dimensions(drawing.cut_bounds)
    page.draw_travel(drawing)
    page.draw_cuts(drawing)
    page.draw_ends(drawing)
    page.draw_flaws(drawing, flaws)
    page.write_legend(drawing, sheet=sheet, flaws=flaws)
    page.write_notes(_remarks(drawing))
    return page.finished()


def _remarks(drawing: Drawing) -> list[str]:
    told = [f"line {each.place.line}: {each.what}" for each in drawing.remarks[:_MOST_LISTED]]
    more = len(drawing.remarks) - _MOST_LISTED
    return [*told, f"and {more} more of this kind"] if more > 0 else told


class _Page:
    """
    A page that grows downward: a head, the drawing, what is told below it.

    Args:
        title: Of the document.
        area: That is drawn, in steps.
        mm_per_step: Of the machine.
    """

    def __init__(self, title: str, area: Bounds, mm_per_step: float) -> None:
        self._mm = mm_per_step
        width_mm, height_mm = area.width_steps * mm_per_step, area.height_steps * mm_per_step
        self._area = area
        self._letter = max(_LEAST_LETTER_MM, hypot(width_mm, height_mm) / _LETTERS_ALONG)
        self._line_mm = self._letter / 13
        self._margin = 5.5 * self._letter
        self._width_mm = max(width_mm + 2 * self._margin, _LEAST_WIDTH_LETTERS * self._letter)
        self._left = (self._width_mm - width_mm) / 2
        self._inner_height_mm = height_mm
        self._y = 0.0
        self._scene = Scene(self._width_mm, 0.0, (0.0, 0.0), mm_per_step, title)

    def _add(self, *shapes: Shape) -> None:
        self._scene.shapes += shapes

    def finished(self) -> Scene:
        self._scene.height_mm = self._y + self._letter
        return self._scene

    def write_head(self, title: str, subtitles: Sequence[str]) -> None:
        """Write the first lines, and thereby fix where the drawing is."""
        letter = self._letter
        self._y = 0.6 * letter
        for line in self._wrapped(title, 1.5 * letter) or [""]:
            self._y += 1.8 * letter
            self._add(Words((letter, self._y), line, 1.5 * letter, _INK, is_bold=True))
        for subtitle in subtitles:
            self._write(subtitle, _FAINT)
        self._y += 2.0 * letter
        left, top = self._area.left * self._mm, self._area.top * self._mm
        self._scene.origin_mm = (self._left - left, self._y + top)
        self._y += self._inner_height_mm + 1.5 * letter

    def _write(self, text: str, colour: str, indent: float = 1.0) -> None:
        for line in self._wrapped(text, self._letter, indent):
            self._y += 1.35 * self._letter
            self._add(Words((indent * self._letter, self._y), line, self._letter, colour))

    def _wrapped(self, text: str, size_mm: float, indent: float = 1.0) -> list[str]:
        room = self._width_mm - (indent + 1.0) * self._letter
        return wrap(" ".join(text.split()), max(int(room / (_LETTER_WIDTH * size_mm)), 20))

    # The drawing ------------------------------------------------------------------------------------------------------

    def draw_sheet(self, sheet: Bounds | None) -> None:
        """Outline the sheet."""
        if sheet is not None:
            self._add(Area(_corners(sheet), _SHEET, 1.5 * self._line_mm, about="the sheet"))

    def draw_boxes(self, drawing: Drawing) -> None:
        """Draw labels, fills and windows."""
        for box in drawing.boxes:
            about = f"line {box.place.line}: {box.kind}{f' {box.text!r}' if box.text else ''}"
            if box.kind == "window":
                self._add(Area(box.corners, _SHEET, self._line_mm, dashes_mm=self._dashes(3), about=about))
                continue
            self._add(Area(box.corners, _LABEL, self._line_mm, fill=_LABEL, about=about))
            if box.text:
                self._write_label(box.corners, box.text)

    def _write_label(self, corners: Sequence[Point], text: str) -> None:
        """Write a label into its box, where it runs to the right and there is room to read it."""
        (left, bottom), (right, at_right), (_, top) = corners[:3]
        if at_right != bottom or right < left or "\n" in text:
            return
        width, height = (right - left) * self._mm, (top - bottom) * self._mm
        size = min(height, width / (_LETTER_WIDTH * len(text)))
        x, y = self._scene.on_page(((left + right) / 2, bottom))
        self._add(Words((x, y - (height - 0.7 * size) / 2), text, size, _LABEL, anchor="middle"))

    def draw_travel(self, drawing: Drawing) -> None:
        """Draw the ways with the tool up."""
        paths = [stroke.points for stroke in drawing.strokes if not stroke.is_cut]
        if paths:
            colour, lines, dashes = self._look_of_travel(len(paths))
            self._add(Ways(paths, colour, lines * self._line_mm, dashes, about="travel, tool up"))

    def _look_of_travel(self, count: int) -> tuple[str, float, tuple[float, ...]]:
        return (_TRAVEL, 0.5, self._dashes(6)) if count <= _MOST_DASHED else (_MUCH_TRAVEL, 0.25, ())

    def _dashes(self, lines: float) -> tuple[float, float]:
        return lines * self._line_mm, lines * self._line_mm

    def draw_cuts(self, drawing: Drawing) -> None:
        """Draw the cuts, each tenth of their length in a colour of its own."""
        for number, (colour, paths) in enumerate(zip(_ORDER_COLOURS, _tenths(drawing), strict=True)):
            if paths:
                about = f"cuts, {number * 10} % to {number * 10 + 10} % of their length"
                self._add(Ways(paths, colour, self._line_mm, about=about))

    def draw_ends(self, drawing: Drawing) -> None:
        """Mark where it begins and ends, and number the cuts where they are few."""
        cuts = [stroke for stroke in drawing.strokes if stroke.is_cut]
        if 1 < len(cuts) <= _MOST_NUMBERS:
            self._number(cuts)
        if not drawing.strokes:
            return
        size = 0.8 * self._letter
        start, end = drawing.strokes[0].points[0], drawing.end
        self._add(
            Mark("dot", self._scene.on_page(start), 1.2 * size, "#007a33", about="here it begins"),
            Mark("square", self._scene.on_page(end), 0.6 * size, _INK, about="here it ends"),
        )

    def _number(self, cuts: Sequence[Stroke]) -> None:
        taken: list[Point] = []
        for number, stroke in enumerate(cuts, 1):
            x, y = self._scene.on_page(stroke.points[0])
            at = (x + 0.3 * self._letter, y - 0.3 * self._letter)
            if all(hypot(at[0] - other[0], at[1] - other[1]) > 1.5 * self._letter for other in taken):
                taken.append(at)
                self._add(Words(at, str(number), 0.8 * self._letter, _INK, halo=True))

    # Beside it --------------------------------------------------------------------------------------------------------

    def draw_dimensions(self, bounds: Bounds | None) -> None:
        """Write how wide and high all cuts are together, and where they begin."""
        if bounds is None:
            return
        letter, (left, bottom) = self._letter, self._scene.on_page((bounds.left, bounds.bottom))
        right, top = self._scene.on_page((bounds.right, bounds.top))
        below = self._y
        beside = self._left - 1.5 * letter
        self._measure((left, below), (right, below), (left, bottom), (right, bottom))
        self._measure((beside, bottom), (beside, top), (left, bottom), (left, top))
        width, height = bounds.width_steps * self._mm, bounds.height_steps * self._mm
        self._add(
            Words(((left + right) / 2, below + 1.3 * letter), f"{width:.2f} mm", letter, _INK, anchor="middle"),
            Words(
                (beside - 0.5 * letter, (top + bottom) / 2),
                f"{height:.2f} mm",
                letter,
                _INK,
                anchor="middle",
                is_upright=True,
            ),
        )
        self._y += 2.2 * letter

    def _measure(self, begin: Point, end: Point, from_begin: Point, from_end: Point) -> None:
        """Draw a line with a stroke across each end, and thin ones to what it measures."""
        thin, tick = 0.5 * self._line_mm, 0.4 * self._letter
        self._add(
            Rule((from_begin, begin), "#cccccc", thin),
            Rule((from_end, end), "#cccccc", thin),
            Rule((begin, end), _INK, thin),
        )
        for x, y in (begin, end):
            across = ((x, y - tick), (x, y + tick)) if begin[1] == end[1] else ((x - tick, y), (x + tick, y))
            self._add(Rule(across, _INK, thin))

    def draw_flaws(self, drawing: Drawing, flaws: Sequence[Flaw]) -> None:
        """Mark where problems are."""
        for flaw in flaws:
            point = drawing.waymarks.at(flaw.offset)
            if point is not None:
                about = f"{flaw.where}: {flaw.what}"
                colour = _BAD if flaw.is_error else "#b36b00"
                self._add(Mark("cross", self._scene.on_page(point), 1.6 * self._letter, colour, about))

    def write_legend(self, drawing: Drawing, *, sheet: Bounds | None, flaws: Sequence[Flaw]) -> None:
        """Say what the looks of lines mean, as far as they are there; then what is wrong."""
        has_cuts = any(stroke.is_cut for stroke in drawing.strokes)
        travels = sum(not stroke.is_cut for stroke in drawing.strokes)
        kinds = {box.kind for box in drawing.boxes}
        samples: list[tuple[bool, Callable[[float, float], float], str]] = [
            (has_cuts, self._sample_of_order, "cut, from first to last"),
            (travels > 0, self._sample_of(*self._look_of_travel(travels)), "travel, tool up"),
            (bool(drawing.strokes), self._sample_of_mark("dot", "#007a33"), "begin"),
            (bool(drawing.strokes), self._sample_of_mark("square", _INK), "end"),
            (sheet is not None, self._sample_of(_SHEET, 1.5), "sheet"),
            (bool(kinds & {"label", "fill"}), self._sample_of(_LABEL, 4.0), "label or filled area"),
            ("window" in kinds, self._sample_of(_SHEET, 1.0, self._dashes(3)), "window"),
            (bool(flaws), self._sample_of_mark("cross", _BAD), "problem"),
        ]
        self._write_samples((draw, text) for is_there, draw, text in samples if is_there)
        for flaw in flaws[:_MOST_LISTED]:
            self._write(f"{flaw.where}: {flaw.what}", _BAD if flaw.is_error else "#b36b00")
        if len(flaws) > _MOST_LISTED:
            self._write(f"and {len(flaws) - _MOST_LISTED} more", _BAD)

    def write_notes(self, notes: Iterable[str]) -> None:
        """Write small print."""
        for note in notes:
            self._write(note, _FAINT)

    def _write_samples(self, samples: Iterable[tuple[Callable[[float, float], float], str]]) -> None:
        x, letter = self._letter, self._letter
        self._y += 1.6 * letter
        for draw, text in samples:
            width = 5.0 * letter + _LETTER_WIDTH * letter * len(text)
            if x > letter and x + width > self._width_mm:
                x = letter
                self._y += 1.5 * letter
            after = draw(x, self._y - 0.35 * letter)
            self._add(Words((after + 0.5 * letter, self._y), text, letter, _INK))
            x += width
        self._y += 0.4 * letter

    def _sample_of(self, colour: str, lines: float, dashes: tuple[float, ...] = ()) -> Callable[[float, float], float]:
        def draw(x: float, y: float) -> float:
            end = x + 2.5 * self._letter
            self._add(Rule(((x, y), (end, y)), colour, lines * self._line_mm, dashes))
            return end

        return draw

    def _sample_of_mark(self, kind: Literal["dot", "square", "cross"], colour: str) -> Callable[[float, float], float]:
        def draw(x: float, y: float) -> float:
            self._add(Mark(kind, (x + 0.4 * self._letter, y), 0.7 * self._letter, colour))
            return x + 0.8 * self._letter

        return draw

    def _sample_of_order(self, x: float, y: float) -> float:
        step = 2.5 * self._letter / len(_ORDER_COLOURS)
        for number, colour in enumerate(_ORDER_COLOURS):
            begin = x + number * step
            self._add(Rule(((begin, y), (begin + step, y)), colour, 2 * self._line_mm))
        return x + 2.5 * self._letter


def _corners(bounds: Bounds) -> tuple[Point, ...]:
    return (
        (bounds.left, bounds.bottom),
        (bounds.right, bounds.bottom),
        (bounds.right, bounds.top),
        (bounds.left, bounds.top),
    )


def _tenths(drawing: Drawing) -> list[list[list[Point]]]:
    """Part all cuts into as many groups as there are colours, by the length that is cut before each point."""
    groups: list[list[list[Point]]] = [[] for _ in _ORDER_COLOURS]
    share = drawing.cut_steps / len(groups) or 1.0
    gone, limit, number = 0.0, share, 0
    for stroke in drawing.strokes:
        if not stroke.is_cut:
            continue
        path = [stroke.points[0]]
        for begin, end in pairwise(stroke.points):
            if gone >= limit and number + 1 < len(groups):
                if len(path) > 1:
                    groups[number].append(path)
                    path = [begin]
                while gone >= limit and number + 1 < len(groups):
                    number, limit = number + 1, limit + share
            path.append(end)
            gone += hypot(end[0] - begin[0], end[1] - begin[1])
        groups[number].append(path)
    return groups
