"""What is recorded, and how it is asked: drives by the names of their axes, quantities by the names of methods."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Awaitable, Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from math import floor, isfinite
from pathlib import Path
from typing import Any, Final, Protocol, TypeGuard

from ..checked_numbers import check_number
from ..errors import InvalidCommandError
from ..escaping import shown
from ..motion.events import EventStream
from .motion_file import MAX_NAME, is_parquet

__all__ = [
    "QUANTITIES",
    "GroupOfRecordables",
    "Recordable",
    "Recordables",
    "RecordedAxis",
    "RecordedQuantity",
    "axis_of",
    "check_record",
    "drives_by_axis",
    "is_number",
    "next_beat",
]

QUANTITIES: Final = ("position", "target", "following_error", "speed", "torque")
"""What is recorded if nothing else is said."""

_UNITS: Final = {"speed": "%", "torque": "%"}
"""All others are in the axis's own unit."""
_STATUS_VALUE: Final = re.compile(r"S([1-9][0-9]{0,2})")
_HIGHEST_STATUS: Final = 250

_SAME_TIME_S: Final = 1e-6
_TIMES_KEPT: Final = 1000
"""Of answers, to know their rate."""


class Recordable(Protocol):
    """What is needed of a drive: it is asked by methods with the names of the quantities, and tells its events."""

    @property
    def name(self) -> str:
        """What it is called in the record."""

    @property
    def unit(self) -> str:
        """Of its positions."""

    def events(self) -> EventStream:
        """Follow what happens, until it is closed."""


class GroupOfRecordables(Protocol):
    """Several drives by the names of their axes."""

    @property
    def drives(self) -> Mapping[str, Recordable]:
        """The drives by axis."""


Recordables = Recordable | GroupOfRecordables | Mapping[str, Recordable] | Iterable[Recordable]


@dataclass(slots=True, eq=False)
class RecordedQuantity:
    """One thing that is asked, and when next."""

    name: str
    read: Callable[[], Awaitable[Any]]
    unit: str
    due_at: float
    interval_s: float
    is_refused: bool = False


@dataclass(slots=True, eq=False)
class RecordedAxis:
    """One axis that is recorded."""

    name: str
    drive: Recordable
    quantities: list[RecordedQuantity]
    status: RecordedQuantity | None
    """Read so that faults are noticed; it is not recorded."""
    events: EventStream
    is_over: bool = False
    answered_at: deque[float] = field(default_factory=lambda: deque(maxlen=_TIMES_KEPT))
    samples: int = 0
    newest: dict[str, float] = field(default_factory=dict)


def check_record(
    path: Path,
    *,
    quantities: Sequence[str] = QUANTITIES,
    interval_s: float | None = None,
    status_interval_s: float | None = None,
    line_share: float = 1.0,
) -> None:
    """
    Raise what :func:`record` would raise before it looks at its drives.

    Raises:
        InvalidCommandError: Something of that means nothing, or Parquet is not installed.
    """
    _check_quantities(quantities)
    for what, seconds in (("interval_s", interval_s), ("status_interval_s", status_interval_s)):
        if seconds is not None and not check_number(what, seconds) > 0:
            raise InvalidCommandError(f"{what} must be above 0, not {seconds!r}")
    if not 0 < check_number("line_share", line_share) <= 1:
        raise InvalidCommandError(f"line_share is above 0 and at most 1, not {line_share!r}")
    if is_parquet(path):
        from .motion_parquet import convert  # noqa: F401, PLC0415 - the library is an extra


def _check_quantities(quantities: Sequence[str]) -> None:
    """Check names of quantities, as far as no drive is needed for that."""
    possible = f"possible are {', '.join(QUANTITIES)}, S1-S{_HIGHEST_STATUS}"
    if not quantities:
        raise InvalidCommandError("no quantity was named, so nothing is recorded", hint=possible)
    for quantity in quantities:
        if quantity not in QUANTITIES and _status_number(quantity) is None:
            raise InvalidCommandError(f"{shown(quantity)} cannot be recorded", hint=possible)


def _status_number(quantity: object) -> int | None:
    found = _STATUS_VALUE.fullmatch(quantity) if isinstance(quantity, str) else None
    return int(found[1]) if found and int(found[1]) <= _HIGHEST_STATUS else None


def axis_of(
    name: str,
    drive: Recordable,
    quantities: Sequence[str],
    *,
    interval_s: float,
    status_interval_s: float | None,
    now: float,
) -> RecordedAxis:
    """
    Make ready to ask *drive*, from *now* on.

    Raises:
        InvalidCommandError: It cannot be asked for one of *quantities*.
    """
    asked = []
    for quantity in dict.fromkeys(quantities):
        read, unit = _reader(drive, quantity)
        asked.append(RecordedQuantity(quantity, read, unit, now, interval_s))
    read_status = getattr(drive, "status", None)
    status = None
    if status_interval_s is not None and read_status is not None:
        status = RecordedQuantity("status", read_status, "", now, status_interval_s)
    return RecordedAxis(name, drive, asked, status, drive.events())


def _reader(drive: Recordable, quantity: str) -> tuple[Callable[[], Awaitable[Any]], str]:
    """Find what asks *drive* for *quantity*, and its unit, as far as it is known before it is asked."""
    number = _status_number(quantity)
    read = getattr(drive, quantity if number is None else "read_status", None)
    if read is None:
        possible = ", ".join(name for name in QUANTITIES if hasattr(drive, name))
        raise InvalidCommandError(
            f"{quantity!r} cannot be recorded of it", device=drive.name, hint=f"possible are {possible}"
        )
    if number is None:
        return read, _UNITS.get(quantity, drive.unit)
    return partial(read, number), ""


def drives_by_axis(devices: Recordables) -> dict[str, Recordable]:
    """
    Find the drives and the names under which they are recorded.

    Raises:
        InvalidCommandError: There are none, or two of one name, or something is no drive.
    """
    by_axis = getattr(devices, "drives", devices)
    if isinstance(by_axis, Mapping):
        found = dict(by_axis)
    else:
        each = list(by_axis) if isinstance(by_axis, Iterable) else [by_axis]
        names = [str(getattr(drive, "name", drive)) for drive in each]
        found = dict(zip(names, each, strict=True))
        if len(found) < len(each):
            raise InvalidCommandError(f"each axis of a record has a name of its own, not {', '.join(names)}")
    if not found:
        raise InvalidCommandError("no drive was named, so nothing is recorded")
    for name, drive in found.items():
        if len(name) > MAX_NAME:
            raise InvalidCommandError(f"the name of an axis has at most {MAX_NAME} letters, not as {shown(name)}")
        if not hasattr(drive, "events"):
            raise InvalidCommandError(f"{name} is {shown(drive)}, and no drive whose motion can be recorded")
    return found


def is_number(value: object) -> TypeGuard[float]:
    """Whether *value* is a finite number that a file can hold."""
    try:
        return isinstance(value, int | float) and isfinite(value)
    except OverflowError:  # of an int that no float can hold
        return False


def next_beat(at: float, interval_s: float) -> float:
    """Return the next whole multiple of *interval_s*, so that all axes are read together; without one, *at*."""
    return at if interval_s <= 0 else (floor((at + _SAME_TIME_S) / interval_s) + 1) * interval_s
