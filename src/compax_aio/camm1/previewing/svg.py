"""A scene written as SVG: one millimetre of the sheet is one of the picture, and lines are joined to few paths."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Final
from xml.sax.saxutils import escape

from .drawing import Point
from .scene import Area, Mark, Rule, Scene, Shape, Ways, Words

__all__ = ["svg_of"]

_FONT: Final = "Helvetica, Arial, 'Liberation Sans', sans-serif"
_POINTS_A_PATH: Final = 4000
"""Viewers are slow with paths that are longer, and with many that are shorter."""

_NOT_IN_XML: Final = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that no document may have, in any form."""


def svg_of(scene: Scene) -> str:
    """Write *scene*."""
    return "\n".join(_lines(scene)) + "\n"


def _lines(scene: Scene) -> Iterator[str]:
    width, height = _number(scene.width_mm), _number(scene.height_mm)
    yield '<?xml version="1.0" encoding="UTF-8"?>'
    yield (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}mm" height="{height}mm" viewBox="0 0 {width} {height}" '
        f'font-family="{_FONT}" stroke-linecap="round" stroke-linejoin="round">'
    )
    yield f"<title>{_text(scene.title)}</title>"
    yield f'<rect width="{width}" height="{height}" fill="#ffffff"/>'
    x, y = scene.origin_mm
    scale = f"{scene.mm_per_step:.8g}"
    in_steps = f'transform="translate({_number(x)} {_number(y)}) scale({scale} -{scale})"'
    for shape in scene.shapes:
        yield from _shape(shape, in_steps, scene.mm_per_step)
    yield "</svg>"


def _shape(shape: Shape, in_steps: str, mm_per_step: float) -> Iterator[str]:
    match shape:
        case Ways():
            line = _line(shape.colour, shape.width_mm / mm_per_step, [each / mm_per_step for each in shape.dashes_mm])
            yield f'<g {in_steps} fill="none" {line}>{_about(shape.about)}'
            yield from (f'<path d="{each}"/>' for each in _joined(shape.paths))
            yield "</g>"
        case Area():
            line = _line(shape.colour, shape.width_mm / mm_per_step, [each / mm_per_step for each in shape.dashes_mm])
            fill = f'fill="{shape.fill}" fill-opacity="0.25"' if shape.fill else 'fill="none"'
            yield f'<path {in_steps} {fill} {line} d="{_path(shape.corners)}z">{_about(shape.about)}</path>'
        case Rule():
            points = " ".join(f"{_number(x)},{_number(y)}" for x, y in shape.points_mm)
            line = _line(shape.colour, shape.width_mm, shape.dashes_mm)
            yield f'<polyline fill="none" {line} points="{points}"/>'
        case Mark():
            yield _mark(shape)
        case Words():
            yield _words(shape)


def _line(colour: str, width: float, dashes: Sequence[float]) -> str:
    text = f'stroke="{colour}" stroke-width="{_number(width)}"'
    return f'{text} stroke-dasharray="{" ".join(map(_number, dashes))}"' if dashes else text


def _mark(mark: Mark) -> str:
    (x, y), half = mark.at_mm, mark.size_mm / 2
    if mark.kind == "dot":
        shape = f'circle cx="{_number(x)}" cy="{_number(y)}" r="{_number(half)}" fill="{mark.colour}"'
    elif mark.kind == "square":
        size = _number(mark.size_mm)
        shape = f'rect x="{_number(x - half)}" y="{_number(y - half)}" width="{size}" height="{size}"'
        shape += f' fill="{mark.colour}"'
    else:
        a, b, c, d = (_number(each) for each in (x - half, y - half, x + half, y + half))
        shape = f'path d="M{a} {b}L{c} {d}M{a} {d}L{c} {b}" fill="none"'
        shape += f' stroke="{mark.colour}" stroke-width="{_number(mark.size_mm / 5)}"'
    return f"<{shape}>{_about(mark.about)}</{shape.split(' ', 1)[0]}>"


def _words(words: Words) -> str:
    x, y = map(_number, words.at_mm)
    more = f' text-anchor="{words.anchor}"' if words.anchor != "start" else ""
    more += ' font-weight="bold"' if words.is_bold else ""
    more += f' transform="rotate(-90 {x} {y})"' if words.is_upright else ""
    if words.halo:
        more += f' paint-order="stroke" stroke="#ffffff" stroke-width="{_number(words.size_mm / 4)}"'
    size = _number(words.size_mm)
    return f'<text x="{x}" y="{y}" font-size="{size}" fill="{words.colour}"{more}>{_text(words.text)}</text>'


def _about(text: str) -> str:
    return f"<title>{_text(text)}</title>" if text else ""


def _text(text: str) -> str:
    return escape(_NOT_IN_XML.sub("�", text))


# Paths ----------------------------------------------------------------------------------------------------------------


def _joined(paths: Iterable[Sequence[Point]]) -> Iterator[str]:
    """Write *paths*, many in one element."""
    pieces: list[str] = []
    count = 0
    for each in paths:
        pieces.append(_path(each))
        count += len(each)
        if count >= _POINTS_A_PATH:
            yield "".join(pieces)
            pieces, count = [], 0
    if pieces:
        yield "".join(pieces)


def _path(points: Sequence[Point]) -> str:
    """Write one line by its steps from point to point, as short as can be; half a step is 0.01 mm, and lost."""
    x, y = round(points[0][0]), round(points[0][1])
    steps: list[str] = []
    for next_x, next_y in points[1:]:
        new_x, new_y = round(next_x), round(next_y)
        dx, dy = new_x - x, new_y - y
        if dx or dy:
            # A sign parts two numbers as well as a blank does.
            steps.append(f"{dx}{dy}" if dy < 0 else f"{dx} {dy}")
            x, y = new_x, new_y
    if not steps:
        steps = ["0 0"]
    text = steps[0] + "".join(each if each[0] == "-" else f" {each}" for each in steps[1:])
    return f"M{round(points[0][0])} {round(points[0][1])}l{text}"


def _number(value: float) -> str:
    """Write a number with at most three decimals, as short as can be."""
    text = f"{value:.3f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text
