"""One axis as lines of text: title, numbers, trends, its place within the travel, lamps; old values told from new."""

from __future__ import annotations

from typing import Final

from rich.cells import cell_len
from rich.text import Text

from .levels import Level
from .state import AxisState, Phase
from .trend import Trend, sparkline
from .words import Lamp, LampLight, duration, lamps, say

__all__ = [
    "COLOURS",
    "between",
    "draw_bar",
    "draw_compact",
    "draw_facts",
    "draw_lamps",
    "draw_place",
    "draw_title",
    "draw_trends",
    "position_text",
]

# By Okabe and Ito, made lighter for a dark ground: told from each other with any colour vision. Each comes with a sign.
COLOURS: Final = {
    Level.QUIET: "#9fb1c1",
    Level.ACTIVE: "#56b4e9",
    Level.WAITING: "#cc9bd3",
    Level.ATTENTION: "#e8b130",
    Level.ALARM: "#ff7a45",
}
_DARK: Final = "#0d1117"
_PLAIN: Final = "#dbe4ee"
_OLD: Final = "#66727f"
"""Of what is not current, and of labels."""
_LABEL: Final = "#8a97a5"
_TREND: Final = "#56b4e9"
_ERROR_TREND: Final = "#e8b130"
_LAMPS: Final = {
    LampLight.DARK: _OLD,
    LampLight.LIT: "#3ddbb0",
    LampLight.WARNING: COLOURS[Level.ALARM],
    LampLight.UNKNOWN: _OLD,
}
_NOTHING: Final = "--"
_FACTS: Final = (("target", None), ("following_error", None), ("speed", "%"), ("torque", "%"))
_LABELS: Final = {
    "target": "target",
    "following_error": "following error",
    "speed": "speed",
    "torque": "torque",
}


def between(left: Text, right: Text, width: int) -> Text:
    """Put *left* and *right* at the two ends of a line; what does not fit is cut from the left one."""
    room = width - cell_len(right.plain)
    if room < 8:
        right, room = Text(), width
    if cell_len(left.plain) > room:
        left = left.copy()
        left.truncate(room - 1, overflow="ellipsis")
    return Text.assemble(left, " " * (room - cell_len(left.plain)), right)


def draw_title(axis: AxisState, now: float, width: int, *, is_selected: bool) -> Text:
    """Draw who it is, and how it stands."""
    said = say(axis, now)
    left = Text.assemble(
        ("▌ " if is_selected else "  ", f"bold {_PLAIN}"),
        (f"{axis.name} ", f"bold {_PLAIN}"),
        (f" {said.level.sign} {said.state} ", f"bold {_DARK} on {COLOURS[said.level]}"),
        (f" {said.detail}" if said.detail else "", COLOURS[said.level] if said.level is Level.ALARM else _PLAIN),
    )
    # Why something wants to be looked at is worth more than the name of the line.
    right = axis.url if axis.url != axis.name and said.level in {Level.QUIET, Level.ACTIVE} else ""
    return between(left, Text(f" {right} ", _LABEL), width) if right else between(left, Text(" "), width)


def position_text(axis: AxisState) -> str:
    """Write the position that the drive said last, however old; to be shown with its age."""
    dated = axis.values.get("position")
    return "--.--" if dated is None else f"{dated.value:.{axis.decimals}f}"


def _style(axis: AxisState, quantity: str, now: float) -> str:
    return _PLAIN if axis.is_current(quantity, now) else _OLD


def _age(axis: AxisState, quantity: str, now: float) -> str:
    """Say how old a value is that is not current."""
    age = axis.age_s(quantity, now)
    return "" if age is None or axis.is_current(quantity, now) else f"{duration(age)} old"


def _written(axis: AxisState, quantity: str, unit: str | None) -> str:
    dated = axis.values.get(quantity)
    if quantity in axis.refused:
        return "refused" if axis.refused[quantity].code is None else f"refused (E{axis.refused[quantity].code})"
    if dated is None:
        return _NOTHING
    if unit is None:
        return f"{dated.value:.{axis.decimals}f} {axis.unit}"
    return f"{dated.value:.1f} %" if unit else f"{dated.value:.{axis.decimals}f}"


def draw_place(axis: AxisState, now: float) -> Text:
    """Draw what stands under the large digits."""
    old = _age(axis, "position", now)
    return Text.assemble((f"{axis.unit}  position", _LABEL), (f"  {old}" if old else "", "bold " + _OLD))


def draw_facts(axis: AxisState, now: float) -> Text:
    """Draw target, following error, speed and torque, a line each."""
    lines = []
    for quantity, unit in _FACTS:
        old = _age(axis, quantity, now)
        line = Text.assemble(
            (f"{_LABELS[quantity]:<16}", _LABEL),
            (_written(axis, quantity, unit), _style(axis, quantity, now)),
            (f"  {old}" if old else "", _OLD),
        )
        lines.append(line)
    return Text("\n").join(lines)


def draw_trends(axis: AxisState, now: float, width: int) -> Text:
    """Draw position and size of the following error over the last minute, with the range of the one and the other."""
    decimals = axis.decimals
    where, error = axis.position_trend.extent(now), axis.error_trend.extent(now)
    extent = "" if where is None else f"{where[0]:.{decimals}f} … {where[1]:.{decimals}f}"
    largest = "" if error is None else f"up to {max(map(abs, error)):.{decimals}f}"
    return Text("\n").join(
        [
            between(Text("position, 60 s", _LABEL), Text(extent, _LABEL), width),
            Text(sparkline(axis.position_trend.columns(now, width)), _TREND),
            between(Text("following error, 60 s", _LABEL), Text(largest, _LABEL), width),
            Text(_sizes(axis.error_trend, now, width), _ERROR_TREND),
        ]
    )


def _sizes(trend: Trend, now: float, width: int) -> str:
    """Draw how large a quantity was, whatever its sign."""
    return sparkline([None if value is None else abs(value) for value in trend.columns(now, width)])


def draw_bar(axis: AxisState, now: float, width: int) -> Text:
    """Draw the place of the axis within its travel, and its target; nothing where the travel is not known."""
    if axis.travel is None:
        return Text("travel not known" if axis.phase is Phase.OPEN else "", _OLD)
    low, high = axis.travel
    ends = (f"{low:g} ", f" {high:g}")
    room = width - len(ends[0]) - len(ends[1])
    if room < 6:
        return Text()
    cells = ["─"] * room

    def put(quantity: str, sign: str) -> None:
        if (dated := axis.values.get(quantity)) is not None:
            place = round((dated.value - low) / (high - low) * (room - 1))
            cells[min(max(place, 0), room - 1)] = sign

    put("target", "┼")
    put("position", "◆")
    line = Text.assemble((ends[0], _LABEL), ("".join(cells), _OLD), (ends[1], _LABEL))
    for sign, style in (("◆", _TREND if axis.is_current("position", now) else _OLD), ("┼", _PLAIN)):
        line.highlight_regex(sign, style)
    return line


def draw_lamps(axis: AxisState, now: float, width: int, *, with_pace: bool) -> Text:
    """Draw the status flags as lamps, and how quickly the line answers where there is room."""
    dated = axis.values.get("status")
    is_current = axis.is_current("status", now)
    line = Text("  ")
    for lamp in lamps(None if dated is None else dated.value):
        line.append_text(_lamp(lamp, is_current=is_current)).append(" ")
    return between(line, Text(f"{_pace(axis, now)} " if with_pace else "", _LABEL), width)


def _lamp(lamp: Lamp, *, is_current: bool) -> Text:
    style = _LAMPS[lamp.light] if is_current else _OLD
    label = _PLAIN if is_current and lamp.light in {LampLight.LIT, LampLight.WARNING} else _OLD
    return Text.assemble((lamp.light.value, style), (lamp.label, label))


def _pace(axis: AxisState, now: float) -> str:
    if axis.phase is not Phase.OPEN or axis.answer_time_s is None:
        return ""
    return f"{axis.readings_per_s(now):.1f}/s {1000 * axis.answer_time_s:.0f} ms"


def draw_compact(axis: AxisState, now: float, width: int) -> Text:
    """Draw all numbers and trends in two lines, for small terminals."""
    old = _age(axis, "position", now)
    numbers = Text.assemble(
        (f"{position_text(axis):>12} {axis.unit}", f"bold {_style(axis, 'position', now)}"),
        (f" {old} " if old else "  ", _OLD),
        ("→ ", _LABEL),
        (_written(axis, "target", ""), _style(axis, "target", now)),
        ("  err ", _LABEL),
        (_written(axis, "following_error", ""), _style(axis, "following_error", now)),
        ("  v ", _LABEL),
        (_written(axis, "speed", "%"), _style(axis, "speed", now)),
        ("  M ", _LABEL),
        (_written(axis, "torque", "%"), _style(axis, "torque", now)),
    )
    half = (width - 14) // 2
    bar = draw_bar(axis, now, half) if axis.travel is not None else Text()
    trends = Text.assemble(
        ("  pos ", _LABEL),
        (sparkline(axis.position_trend.columns(now, half if not bar.plain else half // 2)), _TREND),
        ("  err ", _LABEL),
        (_sizes(axis.error_trend, now, half if not bar.plain else half // 2), _ERROR_TREND),
        "  ",
        bar,
    )
    trends.truncate(width)
    return Text("\n").join([between(numbers, Text(f" {_pace(axis, now)} ", _LABEL), width), trends])
