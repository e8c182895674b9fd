"""A scene drawn as PNG, which takes matplotlib."""

from __future__ import annotations

import io
import warnings
from typing import Any, Final

from ...errors import InvalidCommandError
from .scene import Area, Mark, Rule, Scene, Shape, Ways, Words

try:
    from matplotlib import rc_context
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure
    from matplotlib.patches import Polygon
    from matplotlib.patheffects import withStroke
except ModuleNotFoundError as missing:
    raise InvalidCommandError(
        f"a PNG needs {missing.name}, which is not installed",
        hint="pip install 'compax-aio[plot]', or take .svg, which needs nothing",
    ) from missing

__all__ = ["png_of"]

_MOST_DOTS: Final = 2400
"""Along the longer side."""
_LEAST_DOTS: Final = 1000
_DOTS_A_MM: Final = 12
_DPI: Final = 100
_POINTS_AN_INCH: Final = 72
_CHUNK: Final = 5000
_MARKERS: Final = {"dot": "o", "square": "s", "cross": "x"}


def png_of(scene: Scene) -> bytes:
    """Draw *scene*; what is longer than wide gets as many dots along that side as fit a screen twice."""
    longer = max(scene.width_mm, scene.height_mm)
    dots = min(max(longer * _DOTS_A_MM, _LEAST_DOTS), _MOST_DOTS)
    inches_a_mm = dots / _DPI / longer
    with rc_context({"text.parse_math": False, "agg.path.chunksize": _CHUNK}), warnings.catch_warnings():
        # A label in letters that the font does not have is drawn with boxes.
        warnings.filterwarnings("ignore", message="Glyph .* missing from font", category=UserWarning)
        figure = Figure(
            figsize=(max(scene.width_mm * inches_a_mm, 0.1), max(scene.height_mm * inches_a_mm, 0.1)), dpi=_DPI
        )
        FigureCanvasAgg(figure)
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set_xlim(0, scene.width_mm)
        axes.set_ylim(scene.height_mm, 0)
        axes.axis("off")
        canvas = _Canvas(scene, axes, inches_a_mm * _POINTS_AN_INCH)
        for order, shape in enumerate(scene.shapes):
            canvas.draw(shape, order)
        picture = io.BytesIO()
        figure.savefig(picture, format="png", facecolor="#ffffff")
    return picture.getvalue()


class _Canvas:
    """Draws shapes."""

    def __init__(self, scene: Scene, axes: Axes, points_a_mm: float) -> None:
        self._scene = scene
        self._axes = axes
        self._points_a_mm = points_a_mm

    def draw(self, shape: Shape, order: int) -> None:
        match shape:
            case Ways():
                self._draw_ways(shape, order)
            case Area():
                self._draw_area(shape, order)
            case Rule():
                xs, ys = zip(*shape.points_mm, strict=True)
                self._axes.plot(xs, ys, color=shape.colour, zorder=order, **self._line(shape.width_mm, shape.dashes_mm))
            case Mark():
                size = shape.size_mm * self._points_a_mm
                self._axes.plot(
                    *shape.at_mm, _MARKERS[shape.kind], color=shape.colour, markersize=size, zorder=order,
                    markeredgewidth=size / 5 if shape.kind == "cross" else 0,
                )  # fmt: skip
            case Words():
                self._write(shape, order)

    def _line(self, width_mm: float, dashes_mm: tuple[float, ...]) -> dict[str, Any]:
        # Dashes are counted in widths of the line, and a line that is thinner than a dot fades away.
        width = max(width_mm * self._points_a_mm, 0.3)
        style: Any = (0, tuple(each * self._points_a_mm / width for each in dashes_mm)) if dashes_mm else "-"
        return {"linewidth": width, "linestyle": style}

    def _draw_ways(self, ways: Ways, order: int) -> None:
        (x, y), scale = self._scene.origin_mm, self._scene.mm_per_step
        paths = [[(x + a * scale, y - b * scale) for a, b in path] for path in ways.paths]
        lines = LineCollection(
            paths, colors=ways.colour, capstyle="round", zorder=order, **self._line(ways.width_mm, ways.dashes_mm)
        )
        self._axes.add_collection(lines, autolim=False)

    def _draw_area(self, area: Area, order: int) -> None:
        corners = [self._scene.on_page(each) for each in area.corners]
        look = self._line(area.width_mm, area.dashes_mm)
        self._axes.add_patch(Polygon(corners, closed=True, fill=False, edgecolor=area.colour, zorder=order, **look))
        if area.fill:
            self._axes.add_patch(Polygon(corners, closed=True, facecolor=area.fill, alpha=0.25, zorder=order))

    def _write(self, words: Words, order: int) -> None:
        text = self._axes.text(
            *words.at_mm, words.text, fontsize=max(words.size_mm * self._points_a_mm, 0.1), color=words.colour,
            ha={"start": "left", "middle": "center", "end": "right"}[words.anchor], va="baseline", zorder=order,
            fontweight="bold" if words.is_bold else "normal", rotation=90 if words.is_upright else 0,
            rotation_mode="anchor",
        )  # fmt: skip
        if words.halo:
            text.set_path_effects([withStroke(linewidth=words.size_mm * self._points_a_mm / 4, foreground="#ffffff")])
