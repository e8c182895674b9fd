"""What a simulated device has done, for tests to read: entries with their times, of which the last ones are kept."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Generic, TypeVar

__all__ = ["DeviceLog", "DeviceLogEntry", "KeptEntries"]

_Kind = TypeVar("_Kind", bound=StrEnum)
_Entry = TypeVar("_Entry")
_DeviceEntry = TypeVar("_DeviceEntry", bound="DeviceLogEntry[Any]")


@dataclass(frozen=True, slots=True)
class DeviceLogEntry(Generic[_Kind]):
    """One thing that a device did."""

    at: float
    """Time in seconds, on the clock that the device is given."""
    kind: _Kind
    text: str


class KeptEntries(deque[_Entry]):
    """
    The last things that happened, oldest first; old ones fall off at the end.

    Args:
        entries: How many are kept.

    Attributes:
        on_entry: Called with each that is added; None: nobody wants to know.
    """

    def __init__(self, entries: int) -> None:
        super().__init__(maxlen=entries)
        self.on_entry: Callable[[_Entry], None] | None = None

    def keep(self, entry: _Entry) -> None:
        """Append an entry, and tell who wants to know."""
        self.append(entry)
        if self.on_entry is not None:
            self.on_entry(entry)


class DeviceLog(KeptEntries[_DeviceEntry], Generic[_DeviceEntry, _Kind]):
    """
    The last things that one device did, in the order in which they were noted.

    Args:
        entry: Makes an entry of a time, a kind and a text.
        entries: How many are kept.
    """

    def __init__(self, entry: Callable[[float, _Kind, str], _DeviceEntry], entries: int) -> None:
        super().__init__(entries)
        self._entry = entry

    def add(self, at: float, kind: _Kind, text: str = "") -> None:
        """Append an entry."""
        self.keep(self._entry(at, kind, text))

    def add_count(self, at: float, kind: _Kind, count: int) -> None:
        """Append a count that grows: in place of the last entry, if that is of the same kind."""
        if self and self[-1].kind is kind:
            self.pop()
        self.add(at, kind, str(count))

    def texts(self, *kinds: _Kind) -> list[str]:
        """List the texts of all entries of *kinds*, oldest first."""
        return [entry.text for entry in self if entry.kind in kinds]
