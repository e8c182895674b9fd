"""What all parts of a simulated device share: its knobs, its time, its power, its log."""

from __future__ import annotations

from enum import StrEnum
from typing import Any, Generic, TypeVar

from .log import DeviceLog

__all__ = ["DeviceSurroundings"]

_Knobs = TypeVar("_Knobs")
_Kind = TypeVar("_Kind", bound=StrEnum)


class DeviceSurroundings(Generic[_Knobs, _Kind]):
    """
    The inside of one device, as each part of it sees it.

    Args:
        knobs: Of the device.
        log: Where it notes what it does.

    Attributes:
        now: The time of what happens.
        is_on: Whether there is power.
    """

    def __init__(self, knobs: _Knobs, log: DeviceLog[Any, _Kind]) -> None:
        self.knobs = knobs
        self.log = log
        self.now = 0.0
        self.is_on = True

    def reach(self, now: float) -> None:
        """Let it be *now*, unless it is later."""
        self.now = max(self.now, now)

    def note(self, kind: _Kind, text: str = "", at: float | None = None) -> None:
        """Note something that happens, or happened at a time of its own."""
        self.log.add(self.now if at is None else at, kind, text)

    def note_count(self, kind: _Kind, count: int, at: float | None = None) -> None:
        """Note how many there are by now, in one entry as long as nothing else is noted."""
        self.log.add_count(self.now if at is None else at, kind, count)
