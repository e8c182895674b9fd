"""Labels of marks above a plot: in lanes, so that no two overlap and no line of a mark crosses the label of another."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile
from typing import Final

from .motion_reading import RecordMark

__all__ = ["Label", "PlacedLabel", "labels_of", "place", "shortened"]

_MAX_LANES: Final = 9
_SEPARATOR: Final = " · "
_LONGEST_TEXT: Final = 48
_LONGEST_WORD: Final = 36
_LONGEST_AXIS: Final = 24
"""Letters of a label, of each of its words, of the name of its axis: panels become narrower for what is longer."""
_IMPORTANT: Final = (
    "fault",
    "ended by fault",
    "in doubt",
    "connection lost",
    "stopped",
    "out of time",
    "failed",
    "refused",
    "cancelled",
    "connection restored",
    "closed",
)
"""What keeps its label where there is no room for all, the first first; then what people have marked themselves."""
_USUAL: Final = ("unexpected text", "standstill", "reached", "accepted", "comparator", "$")
"""What loses its label first, from the last on."""


@dataclass(frozen=True, slots=True)
class Label:
    """What is written of one or several marks of one moment."""

    time_s: float
    axis: str
    """Empty where it is of no axis."""
    text: str
    rank: int
    """The lower, the more important."""


@dataclass(frozen=True, slots=True)
class PlacedLabel:
    """A label, and the lane that it is written in, from 0 at the bottom; None where there is no room."""

    label: Label
    lane: int | None


def _rank(word: str) -> int:
    if word in _IMPORTANT:
        return _IMPORTANT.index(word)
    return len(_IMPORTANT) + (1 + _USUAL.index(word) if word in _USUAL else 0)


def _words(mark: RecordMark, unit: str) -> str:
    if mark.value is None:
        return mark.word
    number = f"{mark.value:.10g}"
    if mark.word in {"accepted", "reached"}:
        return f"{mark.word} {number} {unit}".rstrip()
    if mark.word == "fault":
        return f"fault E{mark.value:02.0f}"
    if mark.word == "comparator":
        return f"comparator {number}"
    if mark.word == "connection restored":
        return f"{mark.word} after {mark.value:.1f} s"
    # A move that did not reach its target was to go there; where it is, the curve shows.
    return mark.word


def labels_of(
    marks: Sequence[tuple[str, RecordMark]], unit_of: Callable[[str], str], same_moment_s: float, *, names_axes: bool
) -> list[Label]:
    """
    Write labels for *marks*, which are in the order of time; those of one axis and one moment have one in common.

    Args:
        marks: Each with its axis.
        unit_of: Gives the unit of an axis.
        same_moment_s: So close to each other marks cannot be told apart.
        names_axes: Whether the axis is written as well.
    """
    groups: list[tuple[str, list[RecordMark]]] = []
    newest: dict[str, list[RecordMark]] = {}
    for axis, mark in marks:
        group = newest.get(axis)
        if group is not None and mark.time_s - group[0].time_s <= same_moment_s:
            group.append(mark)
        else:
            newest[axis] = [mark]
            groups.append((axis, newest[axis]))
    labels = []
    for axis, group in groups:
        ranks: dict[str, int] = {}
        for mark in group:
            ranks.setdefault(shortened(_words(mark, unit_of(axis)), _LONGEST_WORD), _rank(mark.word))
        if any(word.startswith("reached") for word in ranks):
            ranks.pop("$", None)
        if any(word.startswith("stopped") for word in ranks):
            ranks.pop("standstill", None)
        prefix = f"{shortened(axis, _LONGEST_AXIS)}: " if names_axes and axis else ""
        labels.append(Label(group[0].time_s, axis, prefix + _joined(ranks), min(_rank(mark.word) for mark in group)))
    return labels


def _joined(ranks: Mapping[str, int]) -> str:
    """Join words; where there is no room for all, the most important ones, and how many more there are."""
    text = _SEPARATOR.join(ranks)
    if len(text) <= _LONGEST_TEXT:
        return text
    kept: set[str] = set()
    for word in sorted(ranks, key=ranks.__getitem__):
        if kept and sum(map(len, kept)) + len(word) > _LONGEST_TEXT - len(" · 99 more"):
            break
        kept.add(word)
    more = [f"{len(ranks) - len(kept)} more"] if len(kept) < len(ranks) else []
    return _SEPARATOR.join([word for word in ranks if word in kept] + more)


def shortened(text: str, letters: int) -> str:
    """Leave out the middle of what is longer: names often differ at their ends alone."""
    if len(text) <= letters:
        return text
    end = letters // 2
    return f"{text[: letters - end - 1].rstrip()}…{text[-end:].lstrip()}"


def place(
    labels: Sequence[Label],
    x_of: Callable[[float], float],
    width_of: Callable[[str], float],
    max_lanes: int = _MAX_LANES,
) -> list[PlacedLabel]:
    """
    Place *labels*, which are in the order of time, each to the right of the line of its mark.

    A line goes up to its own label. So from right to left each label goes above all labels that begin under it.
    Where that takes too many lanes, the least important labels are left out until it does not.

    Args:
        labels: In the order of time.
        x_of: Gives the place of a time.
        width_of: Gives the width of a text, in the same unit.
        max_lanes: So many there may be.
    """
    left_out: set[int] = set()
    order = sorted(range(len(labels)), key=lambda number: (-labels[number].rank, number))
    while True:
        lanes = _lanes(labels, left_out, x_of, width_of)
        too_high = [number for number, lane in lanes.items() if lane >= max_lanes]
        if not too_high:
            break
        rank = max(labels[number].rank for number in lanes)
        worst = [number for number in order if number not in left_out and labels[number].rank == rank]
        # Every other one of those that say the least: what stays is spread over the time.
        left_out |= set(worst[::2] if len(worst) > 1 else worst)
    return [PlacedLabel(label, lanes.get(number)) for number, label in enumerate(labels)]


def _lanes(
    labels: Sequence[Label], left_out: set[int], x_of: Callable[[float], float], width_of: Callable[[str], float]
) -> dict[int, int]:
    lanes: dict[int, int] = {}
    begins: list[tuple[float, int]] = []  # of what is placed already, from right to left
    for number in range(len(labels) - 1, -1, -1):
        if number in left_out:
            continue
        x = x_of(labels[number].time_s)
        end = x + width_of(labels[number].text)
        under = takewhile(lambda each: each[0] <= end, reversed(begins))  # noqa: B023 - it is used up here
        lanes[number] = max((lane for _, lane in under), default=-1) + 1
        begins.append((x, lanes[number]))
    return lanes
