"""Motion records drawn for a report: panels on one time base, marks with labels that do not overlap."""

from __future__ import annotations

import io
import secrets
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from math import inf, isfinite
from pathlib import Path
from textwrap import fill, wrap
from typing import Any, Final

from ..errors import InvalidCommandError
from ..text_file import name_of
from .motion_reading import MotionRecord, RecordMark
from .plot_curves import Curve, Panel, ShownAxis, Span, panels_of, shown_axes, shown_marks, thinned
from .plot_marks import Label, labels_of, place, shortened

try:
    from matplotlib import rc_context
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.text import Text
except ModuleNotFoundError as missing:
    raise InvalidCommandError(
        f"plots need {missing.name}, which is not installed", hint="pip install 'compax-aio[plot]'"
    ) from missing

__all__ = ["FORMS", "draw", "save_plot"]

FORMS: Final = (".png", ".svg", ".pdf")

_COLOURS: Final = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Those of Okabe and Ito, which people with any kind of colour vision can tell apart."""
_DASHES: Final = ("-", (0, (6, 1.5)), (0, (3, 1, 1, 1)))
"""Of further axes, when all colours are used."""
_NEUTRAL: Final = "#555555"
_BAD: Final = {"fault", "in doubt", "connection lost", "out of time", "failed", "refused"}

_WIDTH_IN: Final = 7.1
"""180 mm: as wide as the text of an A4 page."""
_PANEL_IN: Final = 1.5
_FIRST_PANEL_IN: Final = 2.2
_LANE_IN: Final = 0.155
_HEAD_IN: Final = 0.95
"""Of title, time scale and legend."""
_TITLE_LETTERS: Final = 56
_SUBTITLE_LETTERS: Final = 105
_REASON_LETTERS: Final = 44
_LEGEND_LETTERS: Final = 70
_SCALE_LETTERS: Final = 32
_MAX_LINES: Final = 4
"""Of each text that may be long; the rest is left out."""
_LONGEST_S: Final = 1e12
"""Time that is shown, and how far it may be from 0: what is longer no clock has measured."""
_LETTER_IN: Final = 0.075
"""Of the legend; few are wider."""
_DPI: Final = 200
_SLICES: Final = 1500
"""More than there are dots from left to right."""
_MARKERS_UP_TO: Final = 120
"""Readings of a curve, to show each as a dot."""
_SAME_MOMENT: Final = 1 / 400
"""Of the time that is shown."""
_LABEL_GAP_PT: Final = 3.0
_LINE_ALPHA: Final = 0.6
_FAINTEST: Final = 0.15
_MANY: Final = 40
"""Lines of marks; more of them are drawn fainter, so that the curves are seen."""

_STYLE: Final[Any] = {
    "font.size": 8.0,
    "axes.titlesize": 8.0,
    "axes.labelsize": 8.0,
    "axes.linewidth": 0.6,
    "axes.grid": True,
    "axes.formatter.useoffset": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.5,
    "lines.linewidth": 1.1,
    "legend.frameon": False,
    "svg.fonttype": "none",  # text stays text
    "svg.hashsalt": "compax_aio",
    "pdf.fonttype": 42,
    "text.parse_math": False,  # "$" is a message of the drive
    "path.simplify": True,
}


@dataclass(frozen=True, slots=True)
class _Look:
    """How one axis is drawn."""

    colour: str
    dashes: Any


def draw(
    records: Sequence[MotionRecord],
    *,
    axes: Sequence[str] = (),
    from_s: float | None = None,
    until_s: float | None = None,
    title: str | None = None,
    overlay: bool = False,
) -> Figure:
    """
    Draw motion records, 180 mm wide: position with target, following error, speed, torque, and what else was recorded.

    Time is that of the wall clock, counted from the start of the first record. Where nothing was read, a line is
    broken; a target is drawn as steps, from when it was read.

    Args:
        records: One or more.
        axes: Names of those that are drawn; empty: all.
        from_s: Where the time that is shown begins, in seconds; None: with the first record.
        until_s: Where it ends; None: with the last.
        title: In place of the names of the axes.
        overlay: Let each record begin at 0, to compare moves.

    Raises:
        InvalidCommandError: There is no record, no such axis, or no time between *from_s* and *until_s*.
    """
    if not records:
        raise InvalidCommandError("no record was given, so nothing is drawn")
    span = _span(from_s, until_s)
    shown = shown_axes(records, axes, overlay=overlay)
    panels = panels_of(shown, span)
    if not panels:
        raise InvalidCommandError("no quantity was recorded of these axes, so there is nothing to draw")
    marks = shown_marks(records, shown, span)
    looks = {
        axis.label: _Look(_COLOURS[number % len(_COLOURS)], _DASHES[number // len(_COLOURS) % len(_DASHES)])
        for number, axis in enumerate(shown)
    }
    units = {axis.label: axis.axis.unit for axis in shown}
    with _style():
        plot = _Plot(panels, looks)
        plot.draw_curves(_limits(shown, span))
        plot.draw_marks(marks, units)
        plot.write_title(title or f"Motion of {', '.join(looks)}", _subtitle(records, overlay=overlay))
        plot.fit()
        return plot.figure


def save_plot(figure: Figure, path: str | Path) -> None:
    """
    Write *figure* as PNG, SVG or PDF, by the name of the file: whole, or not at all.

    Raises:
        InvalidCommandError: The name ends in something else.
        OSError: The file cannot be written.
    """
    path = Path(path)
    form = path.suffix.lower()
    if form not in FORMS:
        raise InvalidCommandError(f"the name of a plot ends in {', '.join(FORMS)}, not as {name_of(path)}")
    picture = io.BytesIO()
    metadata = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(form)
    with _style():
        figure.savefig(picture, format=form[1:], dpi=_DPI, metadata=metadata)
    new = path.with_name(f".{path.name[:32]}.{secrets.token_hex(8)}")
    try:
        new.write_bytes(picture.getvalue())
        new.replace(path)
    except BaseException:
        with suppress(OSError):
            new.unlink()
        raise


@contextmanager
def _style() -> Iterator[None]:
    with rc_context(_STYLE), warnings.catch_warnings():
        # A name in letters that the font does not have is drawn with boxes; in an SVG it is right all the same.
        warnings.filterwarnings("ignore", message="Glyph .* missing from font", category=UserWarning)
        yield


def _span(from_s: float | None, until_s: float | None) -> Span:
    span = Span(-inf if from_s is None else from_s, inf if until_s is None else until_s)
    if not span.from_s < span.until_s:
        raise InvalidCommandError(f"there is no time from {span.from_s:g} s until {span.until_s:g} s")
    return span


def _limits(axes: Sequence[ShownAxis], span: Span) -> tuple[float, float]:
    """Return from when until when is drawn: what was asked for, else all that was recorded, and a little more."""
    begin = span.from_s if isfinite(span.from_s) else min(axis.offset_s for axis in axes)
    end = span.until_s if isfinite(span.until_s) else max(axis.offset_s + axis.record.duration_s for axis in axes)
    if max(abs(begin), abs(end)) > _LONGEST_S:
        raise InvalidCommandError(f"nothing can be drawn from {begin:g} s until {end:g} s")
    if end <= begin:  # a record that ended as it began, or nothing is left of it
        return begin, begin + 1.0
    margin = 0.01 * (end - begin)
    return begin - (0 if isfinite(span.from_s) else margin), end + (0 if isfinite(span.until_s) else margin)


def _subtitle(records: Sequence[MotionRecord], *, overlay: bool) -> str:
    if overlay:
        names = (f"{record.path.name} of {_written([record])}" for record in records)
        told = ["time 0 is that of each record", *names]
    else:
        told = [f"time 0 is {_written(records)}", ", ".join(record.path.name for record in records)]
    told += [f"{record.path.name} was cut" for record in records if record.cut]
    told += [f"{record.rows_lost} rows were lost" for record in records if record.rows_lost]
    return "   ".join(told)


def _written(records: Sequence[MotionRecord]) -> str:
    """Write when the first of *records* was started."""
    starts = [record.started for record in records if record.started is not None]
    return f"{min(starts):%Y-%m-%d %H:%M:%S %z}" if starts else "date unknown"


def _columns(handles: Sequence[Line2D]) -> int:
    """Return how many columns of a legend the page has room for."""
    longest = max(len(str(handle.get_label())) for handle in handles)
    return min(len(handles), max(1, int(_WIDTH_IN / (longest * _LETTER_IN + 0.6))))


class _Plot:
    """
    One figure: a strip for the labels of marks, and a panel for each quantity below it.

    Args:
        panels: From top to bottom.
        looks: By axis.
    """

    def __init__(self, panels: Sequence[Panel], looks: dict[str, _Look]) -> None:
        self._panels = panels
        self._looks = looks
        self._heights = [_FIRST_PANEL_IN] + [_PANEL_IN] * (len(panels) - 1)
        self.figure = Figure(figsize=(_WIDTH_IN, 4.0), layout="constrained")
        FigureCanvasAgg(self.figure)
        self.figure.get_layout_engine().set(h_pad=0.05, hspace=0.0, w_pad=0.05)  # type: ignore[union-attr,call-arg]
        self._grid = self.figure.add_gridspec(len(panels) + 1, 1, height_ratios=[0.1, *self._heights])
        self._areas: list[Axes] = []
        for row in range(len(panels)):
            share = self._areas[0] if self._areas else None
            self._areas.append(self.figure.add_subplot(self._grid[row + 1], sharex=share))
        self._strip = self.figure.add_subplot(self._grid[0], sharex=self._areas[0])
        self._strip.axis("off")
        self._labels: list[Label] = []
        self._written: list[Text | Line2D] = []
        self._lanes = 0
        for area in self._areas[:-1]:
            area.tick_params(labelbottom=False)
        self._areas[-1].set_xlabel("time [s]")

    def draw_curves(self, limits: tuple[float, float]) -> None:
        """Draw all curves; *limits* are those of time."""
        self._areas[0].set_xlim(*limits)
        for panel, area in zip(self._panels, self._areas, strict=True):
            area.set_ylabel(shortened(panel.title, _SCALE_LETTERS), wrap=True)
            for curve in panel.curves:
                self._draw_curve(area, thinned(curve, _SLICES))
            if panel.missing:
                area.set_yticks([])
                area.text(
                    0.5,
                    0.5,
                    fill(panel.missing, _REASON_LETTERS, max_lines=_MAX_LINES, placeholder=" …"),
                    transform=area.transAxes,
                    ha="center",
                    va="center",
                    color=_NEUTRAL,
                )
        self._write_legend()

    def _draw_curve(self, area: Axes, curve: Curve) -> None:
        look = self._looks[curve.axis]
        if curve.is_target:
            area.step(
                curve.times_s, curve.values, where="post", color=look.colour, linestyle=(0, (2, 1.5)), linewidth=0.9,
                alpha=0.75, zorder=1.8,
            )  # fmt: skip
            if len(curve.times_s) == 1:
                area.plot(curve.times_s, curve.values, color=look.colour, marker="_", linestyle="")
            return
        marker = "." if len(curve.times_s) <= _MARKERS_UP_TO else ""
        area.plot(
            curve.times_s,
            curve.values,
            color=look.colour,
            linestyle=look.dashes,
            marker=marker,
            markersize=3.0,
            zorder=2,
        )

    def _write_legend(self) -> None:
        handles = [
            Line2D([], [], color=look.colour, linestyle=look.dashes, label=shortened(axis, _LEGEND_LETTERS))
            for axis, look in self._looks.items()
        ]
        if any(curve.is_target for panel in self._panels for curve in panel.curves):
            handles.append(Line2D([], [], color=_NEUTRAL, linestyle=(0, (2, 1.5)), linewidth=0.9, label="target"))
        self.figure.legend(handles=handles, loc="outside lower center", ncols=_columns(handles))

    def draw_marks(self, marks: Sequence[tuple[str, RecordMark]], units: dict[str, str]) -> None:
        """Draw a line through all panels for each mark; where the labels go, :meth:`fit` finds out."""
        begin, end = self._areas[0].get_xlim()
        names_axes = len(self._looks) > 1
        same_moment_s = (end - begin) * _SAME_MOMENT
        self._labels = labels_of(marks, lambda axis: units.get(axis, ""), same_moment_s, names_axes=names_axes)
        times, colours = [label.time_s for label in self._labels], [self._colour_of(label) for label in self._labels]
        alpha = max(_FAINTEST, min(_LINE_ALPHA, _LINE_ALPHA * _MANY / max(len(times), 1)))
        for area in self._areas:
            area.vlines(
                times, 0, 1, colors=colours, transform=area.get_xaxis_transform(), linewidth=0.6, alpha=alpha, zorder=1
            )

    def _colour_of(self, label: Label) -> str:
        look = self._looks.get(label.axis)
        return look.colour if look is not None and len(self._looks) > 1 else _NEUTRAL

    def write_title(self, title: str, subtitle: str) -> None:
        """Write the title of the figure, and smaller below it when and where it is from."""
        lines = wrap(subtitle, _SUBTITLE_LETTERS, max_lines=_MAX_LINES, placeholder=" …")
        heading = fill(title, _TITLE_LETTERS, max_lines=_MAX_LINES, placeholder=" …")
        self._strip.set_title(heading, fontsize=10, fontweight="bold", loc="left", pad=5 + 9 * len(lines))
        self._strip.annotate(
            "\n".join(lines), (0, 1), xycoords="axes fraction", xytext=(0, 4), textcoords="offset points", fontsize=7,
            color=_NEUTRAL,
        )  # fmt: skip

    def fit(self) -> None:
        """Lay all of it out: how much room the labels leave for the panels decides how wide these are, and back."""
        for _ in range(3):
            self._set_height()
            self.figure.draw_without_rendering()
            self._write_labels()
        self._set_height()

    def _set_height(self) -> None:
        strip_in = 0.05 + self._lanes * _LANE_IN
        self._grid.set_height_ratios([strip_in, *self._heights])
        self.figure.set_size_inches(_WIDTH_IN, strip_in + sum(self._heights) + _HEAD_IN)
        self._strip.set_ylim(0, max(self._lanes, 1))

    def _write_labels(self) -> None:
        for artist in self._written:
            artist.remove()
        renderer = self.figure.canvas.get_renderer()  # type: ignore[attr-defined]
        probe = self.figure.text(0, 0, "", fontsize=6.5)
        pixels_a_point = self.figure.dpi / 72

        def width_of(text: str) -> float:
            probe.set_text(text)
            return float(probe.get_window_extent(renderer).width) + 2 * _LABEL_GAP_PT * pixels_a_point

        def x_of(time_s: float) -> float:
            return float(self._strip.transData.transform((time_s, 0))[0])

        placed = place(self._labels, x_of, width_of)
        probe.remove()
        self._lanes = max((each.lane + 1 for each in placed if each.lane is not None), default=0)
        self._written = []
        for each in placed:
            if each.lane is not None:
                self._write_label(each.label, each.lane)
        without = sum(each.lane is None for each in placed)
        if without:
            text = f"{without} more marks without a label"
            self._written.append(
                self._areas[-1].annotate(
                    text,
                    (1, 0),
                    xycoords=("axes fraction", self._areas[-1].xaxis.label),
                    xytext=(0, 0),
                    textcoords="offset points",
                    ha="right",
                    fontsize=7,
                    fontstyle="italic",
                    color=_NEUTRAL,
                )
            )

    def _write_label(self, label: Label, lane: int) -> None:
        is_bad = any(word in label.text for word in _BAD)
        colour = self._colour_of(label)
        (line,) = self._strip.plot(
            [label.time_s] * 2, [0, lane + 0.9], color=colour, linewidth=0.6, alpha=_LINE_ALPHA, clip_on=False, zorder=1
        )
        text = self._strip.annotate(
            label.text, (label.time_s, lane + 0.5), xytext=(_LABEL_GAP_PT, 0), textcoords="offset points", va="center",
            ha="left", fontsize=6.5, color=colour, fontweight="bold" if is_bad else "normal", annotation_clip=False,
        )  # fmt: skip
        self._written += [line, text]
