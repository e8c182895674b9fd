"""A page with a drawing on it, in plain shapes: what a picture is made of, whatever writes it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

from .drawing import Point

__all__ = ["Area", "Mark", "Rule", "Scene", "Shape", "Ways", "Words"]


@dataclass(frozen=True, slots=True)
class Ways:
    """
    Many lines that look alike.

    Attributes:
        paths: Each of two points at least, in steps.
        colour: As ``#rrggbb``.
        width_mm: Of the line.
        dashes_mm: Lengths of dash and gap; none: solid.
        about: What they are.
    """

    paths: Sequence[Sequence[Point]]
    colour: str
    width_mm: float
    dashes_mm: tuple[float, ...] = ()
    about: str = ""


@dataclass(frozen=True, slots=True)
class Area:
    """One closed outline, in steps, filled with *fill* unless that is empty."""

    corners: Sequence[Point]
    colour: str
    width_mm: float
    fill: str = ""
    dashes_mm: tuple[float, ...] = ()
    about: str = ""


@dataclass(frozen=True, slots=True)
class Mark:
    """A sign at a point of the page, in mm."""

    kind: Literal["dot", "square", "cross"]
    at_mm: Point
    size_mm: float
    colour: str
    about: str = ""


@dataclass(frozen=True, slots=True)
class Rule:
    """One line on the page, in mm, from left and top."""

    points_mm: Sequence[Point]
    colour: str
    width_mm: float
    dashes_mm: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Words:
    """One line of text; *at_mm* is where its base line begins, or its middle, or its end."""

    at_mm: Point
    text: str
    size_mm: float
    colour: str
    anchor: Literal["start", "middle", "end"] = "start"
    is_bold: bool = False
    is_upright: bool = False
    """Written from bottom to top."""
    halo: bool = False
    """With a white rim, so that it can be read on lines."""


Shape = Ways | Area | Mark | Rule | Words


@dataclass(slots=True)
class Scene:
    """
    One page.

    Attributes:
        width_mm: Of the page.
        height_mm: Of the page.
        origin_mm: Where the point with the steps 0, 0 is on it, from left and top.
        mm_per_step: Of the machine.
        title: What it is called.
        shapes: From back to front.
    """

    width_mm: float
    height_mm: float
    origin_mm: Point
    mm_per_step: float
    title: str
    shapes: list[Shape] = field(default_factory=list)

    def on_page(self, point: Point) -> Point:
        """Return where *point*, in steps, is on the page, in mm."""
        return self.origin_mm[0] + point[0] * self.mm_per_step, self.origin_mm[1] - point[1] * self.mm_per_step
