"""
The file of a motion record: one row for each answer, mark and fact, appended as it happens.

Every row has the same six columns, so that any reader of tables takes the file as it is. A row is whole when its line
feed is there: a file that was cut at any byte has lost what came after its last line feed, and nothing else.
"""

from __future__ import annotations

import csv
import errno
import io
import os
from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from enum import Enum
from math import isfinite
from pathlib import Path
from typing import Final, TextIO

from ..errors import InvalidCommandError
from ..escaping import escaped, shown
from ..text_file import name_of

__all__ = ["COLUMNS", "FORMAT", "MAX_NAME", "Kind", "RecordFile", "Row", "csv_path_of", "expect_free", "is_parquet"]

COLUMNS: Final = ("time_s", "axis", "kind", "name", "value", "text")
FORMAT: Final = 1

_MAX_WAITING: Final = 50_000
"""Rows that a disk which does not take them may leave waiting; what comes then is lost, and counted."""
_MAX_TEXT: Final = 500
MAX_NAME: Final = 200
"""Letters of the name of an axis; of a longer word of a mark the rest is left out."""
_PARQUET: Final = ".parquet"


class Kind(Enum):
    """What a row tells."""

    RECORD = "record"
    """Of the record itself: ``format``, ``started`` (wall clock), ``lost``, ``ended``."""
    AXIS = "axis"
    """An axis that is recorded: its ``unit``."""
    QUANTITY = "quantity"
    """A quantity of an axis that is recorded, and its unit."""
    SAMPLE = "sample"
    """A value that was read, and when its answer arrived."""
    MISSING = "missing"
    """A value that was asked for and not said, when that was known, and why."""
    MARK = "mark"
    """Something that happened."""


@dataclass(frozen=True, slots=True)
class Row:
    """One row of a record."""

    time_s: float
    """Seconds since the record was started, on a clock that is never set."""
    axis: str
    """Empty where it is of no axis."""
    kind: Kind
    name: str
    value: float | None = None
    text: str = ""

    def as_fields(self) -> tuple[str, ...]:
        """Write it as the fields of a line."""
        value = "" if self.value is None else repr(float(self.value))
        name, text = escaped(_cut(self.name, MAX_NAME)), escaped(_cut(self.text, _MAX_TEXT))
        return (f"{self.time_s:.6f}", escaped(self.axis), self.kind.value, name, value, text)

    @staticmethod
    def of_fields(fields: list[str], where: str) -> Row:
        """
        Read the fields of a line; *where* says which it is.

        Raises:
            InvalidCommandError: They are no row; it says which column is wrong.
        """
        if len(fields) != len(COLUMNS):
            raise InvalidCommandError(f"{where}: it has {len(fields)} columns, a row of a record has {len(COLUMNS)}")
        time, axis, kind, name, value, text = fields
        if kind not in _KINDS:
            raise _wrong(where, "kind", kind, f"one of {', '.join(_KINDS)}")
        time_s = _number(where, "time_s", time)
        if time_s < 0:
            raise _wrong(where, "time_s", time, "a number of seconds, not below 0")
        return Row(time_s, axis, _KINDS[kind], name, _number(where, "value", value) if value else None, text)


_KINDS: Final = {kind.value: kind for kind in Kind}


def _cut(text: str, letters: int) -> str:
    return text if len(text) <= letters else f"{text[: letters - 1]}…"


def _number(where: str, column: str, text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = float("nan")
    if not isfinite(number):
        raise _wrong(where, column, text, "a number")
    return number


def _wrong(where: str, column: str, text: str, expected: str) -> InvalidCommandError:
    place = COLUMNS.index(column) + 1
    return InvalidCommandError(f"{where}, column {place} ({column}): {shown(text)} is not {expected}")


def is_parquet(path: Path) -> bool:
    """
    Tell the form of the file from its name.

    Raises:
        InvalidCommandError: It ends neither in ``.csv`` nor in ``.parquet``.
    """
    if path.suffix.lower() not in {".csv", _PARQUET}:
        raise InvalidCommandError(f"the name of a record ends in .csv or .parquet, not as {name_of(path)}")
    return path.suffix.lower() == _PARQUET


def csv_path_of(path: Path) -> Path:
    """Return where a record is written while it goes on: a Parquet file cannot be read until its very end is there."""
    return path.with_name(f"{path.name}.csv") if is_parquet(path) else path


def expect_free(path: Path) -> None:
    """
    Do nothing if there is no *path* yet.

    Raises:
        FileExistsError: There is.
    """
    if path.exists() or path.is_symlink():
        raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(path))


class RecordFile:
    """
    Takes rows at any time, and writes them in a thread, which is always the same one.

    Args:
        path: Of the CSV file.
        overwrite: Replace a file that is there.
    """

    def __init__(self, path: Path, *, overwrite: bool) -> None:
        self.lost = 0
        """Rows that could not wait any longer."""
        self.rows = 0
        """Rows that were written, or are to be."""
        self._path = path
        self._overwrite = overwrite
        self._waiting: deque[Row] = deque()
        self._file: TextIO | None = None
        self._lost_told = 0

    def put(self, row: Row) -> None:
        """Let *row* be written; takes no time."""
        if len(self._waiting) >= _MAX_WAITING:
            self.lost += 1
            return
        if self.lost > self._lost_told:  # here they are missing, and nowhere else
            self._waiting.append(self._told_lost(row.time_s))
        self._waiting.append(row)
        self.rows += 1

    def _told_lost(self, time_s: float) -> Row:
        self._lost_told = self.lost
        return Row(time_s, "", Kind.RECORD, "lost", self.lost, "rows until here, for the disk was too slow")

    def open(self, started: datetime) -> None:
        """
        Create the file, and write what a record begins with.

        Raises:
            OSError: It cannot be created, or is there already.
        """
        if self._overwrite and self._path.exists() and not self._path.is_file():
            raise OSError(errno.EINVAL, "It is no plain file", str(self._path))
        self._file = self._path.open("w" if self._overwrite else "x", encoding="utf-8", newline="")
        csv.writer(self._file, lineterminator="\n").writerow(COLUMNS)
        self._waiting.appendleft(Row(0.0, "", Kind.RECORD, "started", None, started.isoformat()))
        self._waiting.appendleft(Row(0.0, "", Kind.RECORD, "format", FORMAT, "motion record of compax_aio"))
        self.write_waiting()

    def write_waiting(self) -> None:
        """
        Hand all that waits to the operating system: from then on it survives the end of this process.

        Raises:
            OSError: The disk is full, or gone; nothing more can be written.
        """
        if self._file is None or self._file.closed:
            return
        lines = io.StringIO()
        writer = csv.writer(lines, lineterminator="\n")
        last_s = 0.0
        while self._waiting:
            row = self._waiting.popleft()
            last_s = max(last_s, row.time_s)
            writer.writerow(row.as_fields())
        if self.lost > self._lost_told:
            writer.writerow(self._told_lost(last_s).as_fields())
        try:
            self._file.write(lines.getvalue())
            self._file.flush()
        except OSError:
            # Whatever came behind a line that was cut would be read as a part of it.
            with suppress(OSError):
                self._file.close()
            raise

    def close(self, ended: Row) -> bool:
        """
        Write what waits, and *ended* at its end, to the disk itself; returns whether the file is whole.

        Raises:
            OSError: As for :meth:`write_waiting`.
        """
        if self._file is None or self._file.closed:
            return False
        self.write_waiting()
        self._waiting.append(ended)
        self.write_waiting()
        try:
            os.fsync(self._file.fileno())
        finally:
            self._file.close()
        return True
