"""What a plot shows of motion records: curves by panel and marks, on one time base, thinned to what can be seen."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import inf, isnan, nan
from typing import Final

from ..errors import InvalidCommandError
from .motion_reading import AxisRecord, MotionRecord, RecordMark, Trace

__all__ = ["Curve", "Panel", "ShownAxis", "Span", "panels_of", "shown_axes", "shown_marks", "thinned"]

_ORDER: Final = ("position", "following_error", "speed", "torque")
_BESIDE: Final = {"target": "position"}
"""Quantities that are drawn in the panel of another one."""
_TITLES: Final = {"following_error": "following error"}

_LARGEST: Final = 1e100
"""No scale can be made of larger numbers, and no machine has them."""

_ENVELOPE: Final = 4
"""Points that are kept of each slice of time: the first, the lowest, the highest, the last."""


@dataclass(frozen=True, slots=True)
class Span:
    """The time that is shown, in seconds."""

    from_s: float = -inf
    until_s: float = inf

    def __contains__(self, time_s: float) -> bool:
        return self.from_s <= time_s <= self.until_s


@dataclass(frozen=True, slots=True)
class ShownAxis:
    """An axis that is drawn: its name in the plot, and where its time begins on that of the plot."""

    label: str
    record: MotionRecord
    axis: AxisRecord
    offset_s: float


@dataclass(frozen=True, slots=True)
class Curve:
    """One quantity of one axis, as it is drawn."""

    axis: str
    quantity: str
    times_s: tuple[float, ...]
    values: tuple[float, ...]
    """Not a number where nothing was read: there the line is broken."""

    @property
    def is_target(self) -> bool:
        """Whether it is drawn as steps: it holds from one reading to the next."""
        return self.quantity in _BESIDE


@dataclass(frozen=True, slots=True)
class Panel:
    """Curves that share one scale: one quantity, in one unit."""

    quantity: str
    unit: str
    curves: tuple[Curve, ...]
    missing: str
    """Why there is nothing to draw; empty if there is."""

    @property
    def title(self) -> str:
        """What stands at the scale: ``following error [mm]``."""
        name = _TITLES.get(self.quantity, self.quantity)
        return f"{name} [{self.unit}]" if self.unit else name


def shown_axes(records: Sequence[MotionRecord], names: Sequence[str], *, overlay: bool) -> list[ShownAxis]:
    """
    Choose the axes to be drawn, on one time base: the wall clock's, from the first start; or each record's own.

    Args:
        records: At least one.
        names: Of the axes, as in the records; empty: all.
        overlay: Let each record begin at 0.

    Raises:
        InvalidCommandError: There is no axis of such a name, or none at all.
    """
    starts = [record.started for record in records if record.started is not None]
    first = min(starts, default=None)
    shown = []
    for record in records:
        offset_s = 0.0
        if not overlay and first is not None and record.started is not None:
            offset_s = (record.started - first).total_seconds()
        for axis in record.axes.values():
            if not names or axis.name in names:
                is_unique = sum(axis.name in other.axes for other in records) == 1
                label = axis.name if is_unique else f"{axis.name} ({_distinct_name(record, records)})"
                shown.append(ShownAxis(label, record, axis, offset_s))
    known = sorted({name for record in records for name in record.axes})
    unknown = [name for name in names if name not in known]
    if unknown or not shown:
        wanted = f"the axis {', '.join(unknown)}" if unknown else "an axis"
        there = f"there are {', '.join(known)}" if known else "the record was cut before its first line"
        raise InvalidCommandError(f"{wanted} is not in what was recorded", hint=there)
    return shown


def _distinct_name(record: MotionRecord, records: Sequence[MotionRecord]) -> str:
    same = [other for other in records if other.path.stem == record.path.stem]
    if len(same) == 1:
        return record.path.stem
    return str(next(number for number, other in enumerate(records, 1) if other is record))


def panels_of(axes: Sequence[ShownAxis], span: Span) -> list[Panel]:
    """Sort what was recorded of *axes* into panels; axes of different units have panels of their own."""
    keys: dict[tuple[str, str], list[tuple[ShownAxis, Trace]]] = {}
    for shown in axes:
        for trace in shown.axis.traces.values():
            keys.setdefault((_BESIDE.get(trace.quantity, trace.quantity), trace.unit), []).append((shown, trace))
    panels = []
    for quantity, unit in sorted(keys, key=_place):
        traces = keys[quantity, unit]
        curves = [_curve(shown, trace, span) for shown, trace in traces]
        drawn = tuple(curve for curve in curves if any(not isnan(value) for value in curve.values))
        panels.append(Panel(quantity, unit, drawn, "" if drawn else _why_nothing(trace for _, trace in traces)))
    return panels


def _place(key: tuple[str, str]) -> tuple[int, str, str]:
    quantity, unit = key
    return (_ORDER.index(quantity) if quantity in _ORDER else len(_ORDER), quantity, unit)


def _curve(shown: ShownAxis, trace: Trace, span: Span) -> Curve:
    """Cut *trace* to *span*, with one point more at each side, so that lines go on to the edge."""
    points = [(at + shown.offset_s, value) for at, value in zip(trace.times_s, trace.values, strict=True)]
    inside = [number for number, (at, _) in enumerate(points) if at in span]
    if inside:
        points = points[max(inside[0] - 1, 0) : inside[-1] + 2]
    else:
        points = [point for point in points if point[0] < span.from_s][-1:]
        points = points if trace.quantity in _BESIDE else []
    largest = max((abs(value) for _, value in points if not isnan(value)), default=0.0)
    if largest > _LARGEST:
        raise InvalidCommandError(
            f"{shown.label}: its {trace.quantity} of {largest:g} {trace.unit} is more than can be drawn"
        )
    return Curve(shown.label, trace.quantity, tuple(at for at, _ in points), tuple(value for _, value in points))


def _why_nothing(traces: Iterable[Trace]) -> str:
    reasons = [why for trace in traces for why in trace.missing.values()]
    return f"nothing was read: {reasons[-1]}" if reasons else "nothing was read in this time"


def shown_marks(records: Sequence[MotionRecord], axes: Sequence[ShownAxis], span: Span) -> list[tuple[str, RecordMark]]:
    """Give the marks of *axes*, and those of no axis, in the order of time on that of the plot, each with its label."""
    labels = {(id(shown.record), shown.axis.name): shown for shown in axes}
    offsets = {id(shown.record): shown.offset_s for shown in axes}
    found = []
    for record in records:
        offset_s = offsets.get(id(record))
        for mark in record.marks if offset_s is not None else ():
            shown = labels.get((id(record), mark.axis))
            at = mark.time_s + (offset_s or 0.0)
            if (shown is not None or not mark.axis) and at in span:
                found.append((shown.label if shown is not None else "", replace(mark, time_s=at)))
    return sorted(found, key=lambda each: each[1].time_s)


def thinned(curve: Curve, slices: int) -> Curve:
    """
    Leave out points that nobody could tell apart: of each of so many slices of time four stay.

    These are the first, the lowest, the highest and the last, so that no peak is lost; gaps stay gaps.
    """
    if len(curve.times_s) <= _ENVELOPE * slices:
        return curve
    begin, end = curve.times_s[0], curve.times_s[-1]
    width = (end - begin) / slices or 1.0
    kept: list[int] = []
    for numbers in _sliced(curve, begin, width):
        there = [number for number in numbers if not isnan(curve.values[number])]
        if there:
            lowest = min(there, key=curve.values.__getitem__)
            highest = max(there, key=curve.values.__getitem__)
            kept += sorted({there[0], lowest, highest, there[-1]})
        if len(there) < len(numbers):
            kept.append(numbers[-1] if not there else next(n for n in numbers if isnan(curve.values[n])))
    kept = sorted(set(kept))
    return replace(
        curve,
        times_s=tuple(curve.times_s[number] for number in kept),
        values=tuple(curve.values[number] if not isnan(curve.values[number]) else nan for number in kept),
    )


def _sliced(curve: Curve, begin: float, width: float) -> Iterator[list[int]]:
    """Give the numbers of the points of each slice that has any."""
    numbers: list[int] = []
    current = 0
    for number, at in enumerate(curve.times_s):
        slice_ = int((at - begin) / width)
        if numbers and slice_ != current:
            yield numbers
            numbers = []
        current = slice_
        numbers.append(number)
    yield numbers
