"""A plot shows what was recorded and nothing else, in a form that can be pasted into a report: nothing overlaps."""

from __future__ import annotations

import math
import re
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime, timedelta
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from compax_aio import InvalidCommandError
from compax_aio.recording import MotionRecord, read_record
from compax_aio.recording.motion_file import Kind, RecordFile, Row
from compax_aio.recording.motion_reading import RecordMark
from compax_aio.recording.plot import draw, save_plot
from compax_aio.recording.plot_curves import Curve, thinned
from compax_aio.recording.plot_marks import Label, labels_of, place

STARTED = datetime(2026, 3, 1, 12, 30, tzinfo=UTC)
UNITS = {"position": "mm", "target": "mm", "following_error": "mm", "speed": "%", "torque": "%"}


class Making:
    """Makes records, each in a file of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.rows: list[Row] = []

    def axis(self, name: str, unit: str = "mm", quantities: Iterable[str] = tuple(UNITS)) -> None:
        self.rows.append(Row(0.0, name, Kind.AXIS, "unit", None, unit))
        for quantity in quantities:
            shown = unit if UNITS.get(quantity) == "mm" else UNITS.get(quantity, "")
            self.rows.append(Row(0.0, name, Kind.QUANTITY, quantity, None, shown))

    def samples(self, name: str, quantity: str, values: Sequence[float | None], step_s: float = 0.1) -> None:
        for number, value in enumerate(values):
            kind = Kind.MISSING if value is None else Kind.SAMPLE
            self.rows.append(Row(number * step_s, name, kind, quantity, value, "E90" if value is None else ""))

    def mark(self, at: float, name: str, word: str, value: float | None = None, text: str = "") -> None:
        self.rows.append(Row(at, name, Kind.MARK, word, value, text))

    def move(self, name: str, height: float, *, length: int = 50) -> None:
        """Record a move with all its quantities."""
        self.axis(name)
        ramp = [height * min(number / (length - 10), 1.0) for number in range(length)]
        self.samples(name, "position", ramp)
        self.samples(name, "target", [0.0, *[height] * (length - 1)])
        self.samples(name, "following_error", [0.1 if value < height else 0.0 for value in ramp])
        self.samples(name, "speed", [50.0 if abs(value) < abs(height) else 0.0 for value in ramp])
        self.samples(name, "torque", [5.0] * length)
        self.mark(0.1, name, "accepted", height)
        self.mark(length * 0.1 - 0.9, name, "$")
        self.mark(length * 0.1 - 0.9, name, "reached", height)

    def record(
        self, name: str = "run", *, started: datetime = STARTED, ends: bool = True, duration_s: float | None = None
    ) -> MotionRecord:
        path = self.folder / f"{name}.csv"
        file = RecordFile(path, overwrite=True)
        file.open(started)
        for row in self.rows:
            file.put(row)
        end = max((row.time_s for row in self.rows), default=0.0) if duration_s is None else duration_s
        file.close(Row(end, "", Kind.RECORD, "ended", 0, "as asked"))
        if not ends:
            path.write_bytes(path.read_bytes()[:-5])
        self.rows.clear()
        return read_record(path)


@pytest.fixture
def making(tmp_path: Path) -> Making:
    return Making(tmp_path)


def panels(figure: Figure) -> list[Axes]:
    """Give the panels from top to bottom; the strip for labels is none of them."""
    return figure.axes[:-1]


def texts(figure: Figure) -> list[str]:
    return [text.get_text() for text in visible_texts(figure)]


def visible_texts(figure: Figure) -> list[Text]:
    """Give the texts that are drawn; those of ticks beyond the limits and of hidden scales are there, and are not."""
    figure.canvas.draw()
    hidden: set[Any] = set()
    for axes in figure.axes:
        scales: tuple[Any, ...] = (axes.xaxis, axes.yaxis)
        for scale in scales:
            ticks: list[Any] = [*scale.get_major_ticks(), *scale.get_minor_ticks()]
            drawn: list[Any] = scale._update_ticks() if axes.axison else []
            hidden |= {label for tick in ticks if tick not in drawn for label in (tick.label1, tick.label2)}
            if not axes.axison:
                hidden.add(scale.label)
    found = figure.findobj(lambda artist: isinstance(artist, Text) and artist.get_visible() and artist not in hidden)
    return [text for text in found if isinstance(text, Text) and text.get_text().strip()]


def xs_and_ys(line: Line2D) -> tuple[list[float], list[float]]:
    return [float(x) for x in np.asarray(line.get_xdata())], [float(y) for y in np.asarray(line.get_ydata())]


def expect_no_overlap(figure: Figure) -> None:
    """No text is on another one, and none is cut by the edge of the picture."""
    boxes = [(text.get_text(), text.get_window_extent()) for text in visible_texts(figure)]
    page = figure.bbox
    for text, box in boxes:
        assert box.x0 >= page.x0 - 1, f"{text!r} is cut"
        assert box.x1 <= page.x1 + 1, f"{text!r} is cut"
        assert box.y0 >= page.y0 - 1, f"{text!r} is cut"
        assert box.y1 <= page.y1 + 1, f"{text!r} is cut"
    for (one, first), (other, second) in combinations(boxes, 2):
        assert not _overlap(first, second), f"{one!r} and {other!r} overlap"


def _overlap(first: Bbox, second: Bbox) -> bool:
    width = min(first.x1, second.x1) - max(first.x0, second.x0)
    height = min(first.y1, second.y1) - max(first.y0, second.y0)
    return bool(width > 1 and height > 1)


# What is drawn --------------------------------------------------------------------------------------------------------


def test_a_move_has_a_panel_for_each_quantity_with_unit_title_and_legend(making: Making) -> None:
    making.move("x", 240)
    figure = draw([making.record()])
    assert [panel.get_ylabel() for panel in panels(figure)] == [
        "position [mm]",
        "following error [mm]",
        "speed [%]",
        "torque [%]",
    ]
    assert panels(figure)[-1].get_xlabel() == "time [s]"
    told = texts(figure)
    assert "Motion of x" in told
    assert "time 0 is 2026-03-01 12:30:00 +0000   run.csv" in told
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["x", "target"]
    assert "accepted 240 mm" in told
    assert "reached 240 mm" in told, "'$' of the same moment says no more"
    width, height = figure.get_size_inches()
    assert width == pytest.approx(7.1)
    assert height < 11
    expect_no_overlap(figure)


def test_the_curve_is_the_samples_and_the_target_is_steps(making: Making) -> None:
    making.axis("x", quantities=("position", "target"))
    making.samples("x", "position", [1, 2, 4])
    making.samples("x", "target", [0, 4, 4])
    (panel,) = panels(draw([making.record()]))
    position, target = sorted(panel.get_lines(), key=lambda line: line.get_drawstyle())
    assert position.get_drawstyle() == "default"
    xs, ys = xs_and_ys(position)
    assert ys == [1, 2, 4]
    assert xs == pytest.approx([0, 0.1, 0.2])
    assert target.get_drawstyle() == "steps-post"
    assert position.get_color() == target.get_color()


def test_where_nothing_was_read_the_line_is_broken(making: Making) -> None:
    making.axis("x", quantities=("position",))
    making.samples("x", "position", [1, 2, None, 4])
    (panel,) = panels(draw([making.record()]))
    _, values = xs_and_ys(panel.get_lines()[0])
    assert values[:2] == [1, 2]
    assert math.isnan(values[2])


def test_a_quantity_that_was_never_said_has_a_panel_that_says_why(making: Making) -> None:
    making.axis("x", quantities=("position", "torque"))
    making.samples("x", "position", [1, 2])
    making.samples("x", "torque", [None, None])
    figure = draw([making.record()])
    assert "nothing was read: E90" in texts(figure)
    assert not panels(figure)[1].get_lines()
    expect_no_overlap(figure)


def test_a_quantity_that_nobody_answered_in_time_says_so(making: Making) -> None:
    making.axis("x", quantities=("position",))
    assert "nothing was read in this time" in texts(draw([making.record(duration_s=1)]))


def test_axes_of_different_units_have_panels_of_their_own(making: Making) -> None:
    for name, unit in (("x", "mm"), ("a", "deg"), ("y", "mm")):
        making.axis(name, unit, ("position", "torque"))
        making.samples(name, "position", [1, 2])
        making.samples(name, "torque", [1, 2])
    figure = draw([making.record()])
    assert [panel.get_ylabel() for panel in panels(figure)] == ["position [deg]", "position [mm]", "torque [%]"]
    assert [len(panel.get_lines()) for panel in panels(figure)] == [1, 2, 3]
    colours = [line.get_color() for line in panels(figure)[2].get_lines()]
    assert len(set(colours)) == 3


def test_status_values_have_panels_behind_the_others(making: Making) -> None:
    making.axis("x", quantities=("S12", "position"))
    making.samples("x", "S12", [1, 2])
    making.samples("x", "position", [1, 2])
    assert [panel.get_ylabel() for panel in panels(draw([making.record()]))] == ["position [mm]", "S12"]


def test_many_axes_can_be_told_apart(making: Making) -> None:
    names = [f"axis{number}" for number in range(16)]
    for name in names:
        making.axis(name, quantities=("position",))
        making.samples(name, "position", [1, 2])
    figure = draw([making.record()])
    looks = {(line.get_color(), str(line._dash_pattern)) for line in panels(figure)[0].get_lines()}  # type: ignore[attr-defined]
    assert len(looks) == 16
    expect_no_overlap(figure)


def test_chosen_axes_and_times_are_drawn_alone(making: Making) -> None:
    making.move("x", 240)
    making.move("y", -60)
    record = making.record()
    figure = draw([record], axes=["y"], from_s=1, until_s=3)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["y", "target"]
    assert panels(figure)[0].get_xlim() == (1, 3)
    drawn = [at for line in panels(figure)[0].get_lines() for at in xs_and_ys(line)[0]]
    assert min(drawn) == pytest.approx(0.9), "one point more, so that the line goes to the edge"
    assert max(drawn) == pytest.approx(3.1)
    assert not any("reached" in text for text in texts(figure))
    nothing = draw([record], axes=["x"], from_s=100, until_s=101)
    assert "Motion of x" in texts(nothing)
    assert "nothing was read in this time" in texts(nothing)


def test_records_are_placed_by_the_clock_or_laid_over_each_other(making: Making) -> None:
    making.move("x", 100)
    first = making.record("before")
    making.move("x", 200)
    second = making.record("after", started=STARTED + timedelta(seconds=20))
    by_clock = draw([first, second])
    assert panels(by_clock)[0].get_xlim()[1] > 24
    assert [text.get_text() for text in by_clock.legends[0].get_texts()] == ["x (before)", "x (after)", "target"]
    assert panels(draw([first, second], overlay=True))[0].get_xlim()[1] < 6
    expect_no_overlap(by_clock)
    same = draw([first, read_record(first.path)])
    assert [text.get_text() for text in same.legends[0].get_texts()][:2] == ["x (1)", "x (2)"]


def test_a_record_that_was_cut_says_so(making: Making) -> None:
    making.move("x", 100)
    assert any("run.csv was cut" in text for text in texts(draw([making.record(ends=False)])))


def test_rows_that_were_lost_are_told(making: Making) -> None:
    making.move("x", 100)
    making.rows.append(Row(1.0, "", Kind.RECORD, "lost", 17, "rows"))
    assert any("17 rows were lost" in text for text in texts(draw([making.record()])))


# Nothing overlaps -----------------------------------------------------------------------------------------------------


def test_one_sample_alone_is_seen(making: Making) -> None:
    making.axis("x", quantities=("position", "target"))
    making.samples("x", "position", [-5.0])
    making.samples("x", "target", [-6.0])
    figure = draw([making.record()])
    assert any(line.get_marker() == "." for line in panels(figure)[0].get_lines())
    expect_no_overlap(figure)


@pytest.mark.parametrize("heights", [(240.0,), (-300.0,), (240.0, 155.5, -60.0), (1e6, -0.001)])
def test_moves_of_several_axes_do_not_overlap(making: Making, heights: tuple[float, ...]) -> None:
    for name, height in zip("xyz", heights, strict=False):
        making.move(name, height)
    making.mark(2.0, "x", "stopped", heights[0])
    making.mark(2.0, "x", "standstill")
    making.mark(2.01, "x", "fault", 55, "E55: emergency stop")
    making.mark(2.02, "", "clamp closed $ and $ open")
    figure = draw([making.record()])
    expect_no_overlap(figure)
    prefix = "x: " if len(heights) > 1 else ""
    assert f"{prefix}stopped · fault E55" in texts(figure)
    assert "clamp closed $ and $ open" in texts(figure)


def test_a_long_record_with_many_marks_keeps_what_matters(making: Making) -> None:
    making.axis("x", quantities=("position",))
    making.samples("x", "position", [math.sin(number / 50) for number in range(20_000)], step_s=0.05)
    for number in range(300):
        making.mark(number * 3.0, "x", "accepted", number)
        making.mark(number * 3.0 + 2, "x", "reached", number)
    making.mark(450.0, "x", "fault", 20)
    figure = draw([making.record()])
    told = texts(figure)
    assert any("fault E20" in text for text in told)
    assert any(text.endswith("more marks without a label") for text in told)
    assert figure.get_size_inches()[1] < 6
    line = panels(figure)[0].get_lines()[0]
    _, ys = xs_and_ys(line)
    assert len(ys) < 7000
    assert (max(ys), min(ys)) == pytest.approx((1, -1), abs=1e-3)
    expect_no_overlap(figure)


@pytest.mark.parametrize("axes", [1, 3])
def test_long_names_do_not_leave_the_page(making: Making, axes: int) -> None:
    for number in range(axes):
        making.move(f"tcp://very-long-name-of-a-serial-server.example:400{number}", 240)
    record = making.record("-".join(["a-rather-long-name-of-a-file"] * 5))
    expect_no_overlap(draw([record], title="A rather long title of a test of acceptance " * 3))
    expect_no_overlap(draw([record]))


@pytest.mark.parametrize("letters", [100, 200, 500])
def test_words_of_any_length_leave_room_for_the_curves(making: Making, letters: int) -> None:
    long = ("word " * letters)[:letters]
    making.axis(f"first {long}"[:200], unit=f"unit {long}", quantities=("position", "torque"))
    making.axis(f"second {long}"[:200], quantities=("position",))
    for axis in (f"first {long}"[:200], f"second {long}"[:200]):
        making.samples(axis, "position", [0.0, 1.0, 2.0, 3.0])
        making.mark(0.2, axis, long)
        making.mark(0.3, axis, f"{long} once more"[-200:])
        making.mark(0.3, axis, "fault", 55)
    making.rows.append(Row(0.1, f"first {long}"[:200], Kind.MISSING, "torque", None, f"AnswerTimeoutError: {long}"))
    figure = draw([making.record()])
    expect_no_overlap(figure)
    assert any("fault E55" in text for text in texts(figure)), "what is important is not cut off"
    assert panels(figure)[0].get_position().width > 0.35


def test_very_many_marks_of_one_moment_leave_room_for_the_curves(making: Making) -> None:
    making.axis("x", quantities=("position",))
    making.samples("x", "position", [float(number) for number in range(2000)])
    for number in range(4000):
        making.mark(number * 0.05, "x", f"word {number}")
    figure = draw([making.record()])
    expect_no_overlap(figure)
    assert panels(figure)[0].get_position().width > 0.5
    assert any(re.search(r"· \d+ more$", text) for text in texts(figure))


# Labels in lanes ------------------------------------------------------------------------------------------------------


def as_label(time_s: float, text: str = "label", rank: int = 5) -> Label:
    return Label(time_s, "x", text, rank)


@given(st.lists(st.tuples(st.floats(0, 100), st.integers(1, 40)), max_size=30))
def test_no_label_is_on_another_and_no_line_crosses_one(places: list[tuple[float, int]]) -> None:
    labels = [as_label(at, "m" * length) for at, length in sorted(places)]
    placed = place(labels, lambda at: at, len, max_lanes=100)
    assert all(each.lane is not None for each in placed)
    for one, other in combinations(placed, 2):
        assert one.lane is not None
        assert other.lane is not None
        if other.label.time_s <= one.label.time_s + len(one.label.text):
            assert one.lane > other.lane, "its line ends below the label that it stands under"


def test_labels_that_have_room_share_the_lowest_lane() -> None:
    placed = place([as_label(0), as_label(10), as_label(20)], lambda at: at, len)
    assert [each.lane for each in placed] == [0, 0, 0]


def test_the_least_important_labels_are_left_out_first() -> None:
    labels = [as_label(float(number), "x" * 50, rank=number % 2) for number in range(10)]
    placed = place(labels, lambda at: at, len, max_lanes=5)
    kept = [each.label.rank for each in placed if each.lane is not None]
    assert kept == [0] * 5


def test_marks_of_one_moment_have_one_label() -> None:
    marks = [
        ("x", RecordMark(1.0, "x", "accepted", 5.0, "")),
        ("y", RecordMark(1.0, "y", "accepted", 6.0, "")),
        ("x", RecordMark(1.005, "x", "comparator", 2.0, "")),
        ("x", RecordMark(2.0, "x", "connection restored", 2.25, "")),
        ("", RecordMark(3.0, "", "lunch", None, "")),
        ("x", RecordMark(4.0, "x", "out of time", 5.0, "")),
    ]
    labels = labels_of(marks, {"x": "mm", "y": "", "": ""}.__getitem__, 0.01, names_axes=True)
    assert [label.text for label in labels] == [
        "x: accepted 5 mm · comparator 2",
        "y: accepted 6",
        "x: connection restored after 2.2 s",
        "lunch",
        "x: out of time",
    ]


# Curves ---------------------------------------------------------------------------------------------------------------


@given(st.lists(st.floats(-1e6, 1e6) | st.just(math.nan), min_size=1, max_size=400), st.integers(1, 20))
def test_thinning_keeps_ends_peaks_and_gaps(values: list[float], slices: int) -> None:
    curve = Curve("x", "position", tuple(float(number) for number in range(len(values))), tuple(values))
    thin = thinned(curve, slices)
    assert set(thin.times_s) <= set(curve.times_s)
    assert list(thin.times_s) == sorted(thin.times_s)
    assert len(thin.times_s) <= 5 * (slices + 1)
    said = [value for value in values if not math.isnan(value)]
    kept = [value for value in thin.values if not math.isnan(value)]
    if said:
        assert (min(kept), max(kept)) == (min(said), max(said))
        assert (kept[0], kept[-1]) == (said[0], said[-1])
    assert any(map(math.isnan, thin.values)) == any(map(math.isnan, values))


# Files ----------------------------------------------------------------------------------------------------------------


def test_text_of_an_svg_stays_text(making: Making, tmp_path: Path) -> None:
    making.move("x", 240)
    save_plot(draw([making.record()]), tmp_path / "one.svg")
    root = ET.parse(tmp_path / "one.svg")
    told = [element.text for element in root.iter("{http://www.w3.org/2000/svg}text")]
    assert {"Motion of x", "position [mm]", "accepted 240 mm", "time [s]"} <= set(told)


@pytest.mark.parametrize(("name", "begins"), [("a.png", b"\x89PNG"), ("a.PDF", b"%PDF"), ("a.svg", b"<?xml")])
def test_the_form_is_that_of_the_name(making: Making, tmp_path: Path, name: str, begins: bytes) -> None:
    making.move("x", 240)
    figure = draw([making.record()])
    save_plot(figure, tmp_path / name)
    assert (tmp_path / name).read_bytes().startswith(begins)
    with pytest.raises(InvalidCommandError, match=r"ends in \.png, \.svg, \.pdf, not as"):
        save_plot(figure, tmp_path / "a.bmp")


def test_a_picture_that_cannot_be_written_leaves_nothing(making: Making, tmp_path: Path) -> None:
    making.move("x", 240)
    figure = draw([making.record()])
    (tmp_path / "folder.png").mkdir()
    with pytest.raises(OSError, match="folder"):
        save_plot(figure, tmp_path / "folder.png")
    assert sorted(each.name for each in tmp_path.iterdir()) == ["folder.png", "run.csv"]


def test_letters_that_the_font_lacks_are_no_reason_to_fail(making: Making, tmp_path: Path) -> None:
    making.axis("旋转轴", quantities=("position",))
    making.samples("旋转轴", "position", [1, 2])
    save_plot(draw([making.record()]), tmp_path / "a.png")


def test_what_cannot_be_drawn_is_refused(making: Making) -> None:
    with pytest.raises(InvalidCommandError, match="no record was given"):
        draw([])
    making.axis("x")
    record = making.record()
    with pytest.raises(InvalidCommandError, match="the axis q is not in what was recorded; there are x"):
        draw([record], axes=["q"])
    with pytest.raises(InvalidCommandError, match="no time from 5 s until 5 s"):
        draw([record], from_s=5, until_s=5)
    with pytest.raises(InvalidCommandError, match=r"nothing can be drawn from -1e\+308 s until 1e\+308 s"):
        draw([record], from_s=-1e308, until_s=1e308)
    with pytest.raises(InvalidCommandError, match="an axis is not in what was recorded; the record was cut"):
        draw([making.record("empty")])
    making.axis("x", quantities=())
    with pytest.raises(InvalidCommandError, match="nothing to draw"):
        draw([making.record("nothing")])


@pytest.mark.parametrize(
    ("time_s", "value", "says"), [(1, 1e308, "x: its position of 1e.308 mm"), (1e300, 1, "until 1e")]
)
def test_numbers_of_no_machine_are_refused(making: Making, time_s: float, value: float, says: str) -> None:
    making.axis("x", quantities=("position",))
    making.samples("x", "position", [-value])
    making.rows.append(Row(time_s, "x", Kind.SAMPLE, "position", value))
    with pytest.raises(InvalidCommandError, match=says):
        draw([making.record()])


def test_records_laid_over_each_other_claim_no_common_time(making: Making) -> None:
    making.move("x", 100)
    first = making.record("monday")
    making.move("x", 100)
    second = making.record("tuesday", started=STARTED + timedelta(days=1))
    told = " ".join(text.replace("\n", " ") for text in texts(draw([first, second], overlay=True)))
    assert "time 0 is that of each record" in told
    assert f"monday.csv of {STARTED:%Y-%m-%d}" in told
    assert f"tuesday.csv of {STARTED + timedelta(days=1):%Y-%m-%d}" in told
    assert f"time 0 is {STARTED:%Y}" not in told


def test_without_its_library_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "compax_aio.recording.plot", raising=False)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(InvalidCommandError, match=r"plots need matplotlib.*pip install 'compax-aio\[plot\]'"):
        __import__("compax_aio.recording.plot")
