"""What is recorded, and how it is asked: drives by the names of their axes, quantities by the names of methods."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Awaitable, Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Final, Protocol

from ..errors import InvalidCommandError
from ..escaping import shown
from ..motion.events import EventStream

__all__ = [
    "QUANTITIES",
    "GroupOfRecordables",
    "Recordable",
    "Recordables",
    "RecordedAxis",
    "RecordedQuantity",
    "axis_of",
    "drives_by_axis",
]

QUANTITIES: Final = ("position", "target", "following_error", "speed", "torque")
"""What is recorded if nothing else is said."""

_UNITS: Final = {"speed": "%", "torque": "%"}
"""All others are in the axis's own unit."""
_STATUS_VALUE: Final = re.compile(r"S([1-9][0-9]{0,2})")
_HIGHEST_STATUS: Final = 250

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
    newest: dict[str, float] = field(default_factory=dict)


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


def _reader(drive: Recordable, quantity: object) -> tuple[Callable[[], Awaitable[Any]], str]:
    """Find what asks *drive* for *quantity*, and its unit, as far as it is known before it is asked."""
    if isinstance(quantity, str):
        if quantity in QUANTITIES and (read := getattr(drive, quantity, None)) is not None:
            return read, _UNITS.get(quantity, drive.unit)
        found = _STATUS_VALUE.fullmatch(quantity)
        read_status = getattr(drive, "read_status", None)
        if found and int(found[1]) <= _HIGHEST_STATUS and read_status is not None:
            return partial(read_status, int(found[1])), ""
    possible = [name for name in QUANTITIES if hasattr(drive, name)]
    if hasattr(drive, "read_status"):
        possible.append(f"S1-S{_HIGHEST_STATUS}")
    raise InvalidCommandError(
        f"{quantity!r} cannot be recorded", device=drive.name, hint=f"possible are {', '.join(possible)}"
    )


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
        if not hasattr(drive, "events"):
            raise InvalidCommandError(f"{name} is {shown(drive)}, and no drive whose motion can be recorded")
    return found
