"""Motion records read back: what each axis said and when, what happened, and what is not there."""

from __future__ import annotations

import csv
from array import array
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from math import isnan, nan
from pathlib import Path
from types import MappingProxyType
from typing import BinaryIO, Final

from ..errors import InvalidCommandError
from ..escaping import shown
from ..text_file import name_of
from .motion_file import COLUMNS, FORMAT, Kind, Row, is_parquet

__all__ = ["AxisRecord", "MotionRecord", "RecordMark", "Trace", "read_record"]

_MAX_LINE: Final = 16 * 1024
_HEAD: Final = ",".join(COLUMNS)


@dataclass(frozen=True, slots=True)
class Trace:
    """One quantity of one axis: when its answers arrived, and what they said."""

    quantity: str
    unit: str
    """Empty where nobody has said it."""
    times_s: array[float]
    """When each answer arrived, or was known not to come, in seconds since the record was started."""
    values: array[float]
    """What it said; not a number (``nan``) where it did not come, or was none."""
    missing: Mapping[float, str]
    """By time: why a value is not there."""

    def __len__(self) -> int:
        """Count the values that were read."""
        return sum(not isnan(value) for value in self.values)

    def samples(self) -> Iterator[tuple[float, float]]:
        """Give time and value of all that was read."""
        return ((at, value) for at, value in zip(self.times_s, self.values, strict=True) if not isnan(value))


@dataclass(frozen=True, slots=True)
class AxisRecord:
    """What was recorded of one axis."""

    name: str
    unit: str
    traces: Mapping[str, Trace]
    """By quantity."""


@dataclass(frozen=True, slots=True)
class RecordMark:
    """Something that happened."""

    time_s: float
    axis: str
    """Empty where it is of no axis."""
    word: str
    value: float | None
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionRecord:
    """A motion record as read by :func:`read_record`."""

    path: Path
    started: datetime | None
    """The wall clock at time 0, with its zone; None where the record was cut before it."""
    axes: Mapping[str, AxisRecord]
    marks: tuple[RecordMark, ...]
    """In the order of time."""
    duration_s: float
    """The time of the last row."""
    ended: str | None
    """How it ended, as it says itself; None if it does not say so, as when the process died."""
    rows_lost: int
    """Rows that were not written, for the disk was too slow."""
    cut: str | None
    """What is not there although it may have been recorded, in words; None if the record is whole."""

    @property
    def samples(self) -> int:
        """How many values were read, of all axes."""
        return sum(len(trace) for axis in self.axes.values() for trace in axis.traces.values())


def read_record(path: str | Path) -> MotionRecord:
    """
    Read a motion record, CSV or Parquet by its name.

    A record that was cut, as by the end of the process or of power, gives what is whole; ``cut`` says what is not.
    Everything else must be as it was written.

    Raises:
        InvalidCommandError: It is no motion record, or was changed; it says in which line and column.
        OSError: It cannot be read.
    """
    path = Path(path)
    if not is_parquet(path):
        return _read_csv(path)
    from .motion_parquet import rows_of  # noqa: PLC0415 - the library is an extra

    gathering = _Gathering(name_of(path))
    for number, row in enumerate(rows_of(path), 1):
        gathering.take(row, f"{name_of(path)}, row {number}")
    return gathering.record(path, "")


def _read_csv(path: Path) -> MotionRecord:
    if path.exists() and not path.is_file():
        raise InvalidCommandError(f"{name_of(path)} is no plain file, and so no record")
    gathering = _Gathering(name_of(path))
    dropped = 0
    with path.open("rb") as file:
        number = 0
        while line := file.readline(_MAX_LINE):
            number += 1
            where = f"{name_of(path)}, line {number}"
            if not line.endswith(b"\n"):
                zeros = _zeros_to_the_end(file)
                if zeros is None or not _may_be_a_beginning(line, is_first=number == 1):
                    raise InvalidCommandError(f"{where}: it is no line of a motion record: {shown(line[:40])}")
                dropped = len(line) + zeros
                break
            _take_line(gathering, line, number, where)
    return gathering.record(path, _told_dropped(dropped))


def _zeros_to_the_end(file: BinaryIO) -> int | None:
    """Count the zeros that a dying disk has left behind; None if there is something else."""
    count = 0
    while piece := file.read(_MAX_LINE):
        if piece.strip(b"\0"):
            return None
        count += len(piece)
    return count


def _may_be_a_beginning(line: bytes, *, is_first: bool) -> bool:
    """Whether *line*, which has no end, may be all that was written of one."""
    return not is_first or _HEAD.encode().startswith(line.rstrip(b"\0").rstrip(b"\r"))


def _take_line(gathering: _Gathering, line: bytes, number: int, where: str) -> None:
    try:
        text = line.decode("utf-8-sig" if number == 1 else "utf-8").rstrip("\r\n")
    except UnicodeDecodeError as error:
        raise InvalidCommandError(f"{where}, column {error.start + 1}: it is no text: {error.reason}") from error
    if number == 1:
        if text != _HEAD:
            raise InvalidCommandError(
                f"{where}: a motion record begins with {_HEAD!r}, not with {shown(text)}",
                hint="records are made by record() and `compax record`",
            )
        return
    try:
        fields = next(csv.reader([text], strict=True), [])
    except csv.Error as error:
        raise InvalidCommandError(f"{where}: it is no line of a table: {error}") from error
    gathering.take(Row.of_fields(fields, where), where)


def _told_dropped(dropped: int) -> str:
    return f"its last {dropped} bytes make no whole line" if dropped else ""


@dataclass(slots=True)
class _Gathered:
    """What is gathered of one axis."""

    unit: str = ""
    units: dict[str, str] = field(default_factory=dict)
    times_s: dict[str, array[float]] = field(default_factory=dict)
    values: dict[str, array[float]] = field(default_factory=dict)
    missing: dict[str, dict[float, str]] = field(default_factory=dict)

    def interrupt(self, time_s: float, why: str) -> None:
        """Let nothing that was read before be joined to what comes."""
        for name in self.units:
            self.missing[name][time_s] = why
            self.times_s[name].append(time_s)
            self.values[name].append(nan)

    def traces(self) -> Mapping[str, Trace]:
        return MappingProxyType(
            {
                name: Trace(name, unit, self.times_s[name], self.values[name], MappingProxyType(self.missing[name]))
                for name, unit in self.units.items()
            }
        )


class _Gathering:
    """Makes a record of its rows, one after the other."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._axes: dict[str, _Gathered] = {}
        self._marks: list[RecordMark] = []
        self._facts: dict[str, Row] = {}
        self._duration_s = 0.0

    def take(self, row: Row, where: str) -> None:
        """Take *row*; raises InvalidCommandError if it does not fit to those before."""
        if "ended" in self._facts:
            raise InvalidCommandError(f"{where}: the record had ended before")
        self._duration_s = max(self._duration_s, row.time_s)
        if row.kind is Kind.RECORD:
            self._take_fact(row, where)
        elif row.kind is Kind.AXIS:
            self._axes.setdefault(row.axis, _Gathered()).unit = row.text
        elif row.kind is Kind.MARK:
            self._marks.append(RecordMark(row.time_s, row.axis, row.name, row.value, row.text))
        else:
            self._take_quantity(row, where)

    def _take_fact(self, row: Row, where: str) -> None:
        if row.name == "format" and row.value != FORMAT:
            raise InvalidCommandError(
                f"{where}: it is of format {row.value}, and this version reads format {FORMAT}",
                hint="read it with a newer version",
            )
        if row.name == "started":
            _wall_clock(row, where)
        if row.name == "lost":
            for axis in self._axes.values():
                axis.interrupt(row.time_s, "rows were lost, for the disk was too slow")
        self._facts[row.name] = row

    def _take_quantity(self, row: Row, where: str) -> None:
        axis = self._axes.get(row.axis)
        if axis is None:
            raise InvalidCommandError(f"{where}, column 2 (axis): {shown(row.axis)} is no axis of this record")
        if row.kind is Kind.QUANTITY:
            axis.units[row.name] = row.text
            axis.times_s.setdefault(row.name, array("d"))
            axis.values.setdefault(row.name, array("d"))
            axis.missing.setdefault(row.name, {})
            return
        if row.name not in axis.units:
            raise InvalidCommandError(
                f"{where}, column 4 (name): {shown(row.name)} is no quantity of the axis {row.axis}"
            )
        if (row.value is None) is (row.kind is Kind.SAMPLE):
            needs = "has a value" if row.kind is Kind.SAMPLE else "has no value"
            raise InvalidCommandError(f"{where}, column 5 (value): a {row.kind.value} {needs}")
        times_s = axis.times_s[row.name]
        if times_s and row.time_s < times_s[-1]:
            raise InvalidCommandError(
                f"{where}, column 1 (time_s): {row.time_s:g} s is before {times_s[-1]:g} s, which stands before it"
            )
        if row.value is None:
            axis.missing[row.name][row.time_s] = row.text
        times_s.append(row.time_s)
        axis.values[row.name].append(nan if row.value is None else row.value)

    def record(self, path: Path, dropped: str) -> MotionRecord:
        """Return all that was taken."""
        started, ended = self._facts.get("started"), self._facts.get("ended")
        lost = self._facts.get("lost")
        cut = None
        if ended is None:
            cut = f"it ends at {self._duration_s:.3f} s without saying so: what came later is not there"
        if dropped:
            cut = f"{cut or 'something stands behind its end'}; {dropped}"
        return MotionRecord(
            path=path,
            started=None if started is None else _wall_clock(started, self._name),
            axes=MappingProxyType(
                {name: AxisRecord(name, axis.unit, axis.traces()) for name, axis in self._axes.items()}
            ),
            marks=tuple(sorted(self._marks, key=lambda mark: mark.time_s)),
            duration_s=self._duration_s,
            ended=None if ended is None else ended.text,
            rows_lost=0 if lost is None or lost.value is None else int(lost.value),
            cut=cut,
        )


def _wall_clock(row: Row, where: str) -> datetime:
    try:
        at = datetime.fromisoformat(row.text)
    except ValueError:
        at = None
    if at is None or at.tzinfo is None:
        raise InvalidCommandError(f"{where}, column 6 (text): {shown(row.text)} is no date and time with a zone")
    return at
