"""The outer shell of a simulated device: a time that only goes forward, who gives it, and hands that reach in."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

from .line import Host

__all__ = ["ServedDevice"]


class ServedDevice(ABC):
    """
    A device that is given the time by whoever serves it, or by a test; does no I/O.

    Times are seconds on any one clock. Time goes forward in steps of any size with the same result; a time that lies
    behind the last one counts as that. Where *now* may be left out, it is the time of whoever serves the device, or
    the last time it was told.

    Args:
        name: For messages and tests.

    Attributes:
        served_by: Who gives the device the time and carries its bytes; None where a test does that itself.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.served_by: Host | None = None

    def advance(self, now: float | None = None) -> None:
        """Let everything happen that is due until *now*."""
        self._run(self._time(now))

    def act(self, now: float | None, action: Callable[[], None]) -> None:
        """Do something at time *now*, let what is due by that happen, and tell who serves the device."""
        self.advance(now)
        try:
            action()
            self._run(self._last_told())
        finally:
            self._changed()

    @abstractmethod
    def power_off(self, now: float | None = None) -> None:
        """Take the power away."""

    @abstractmethod
    def power_on(self, now: float | None = None) -> None:
        """Give the power back."""

    def power_cycle(self, now: float | None = None) -> None:
        """Take the power away and give it back at once."""
        self.power_off(now)
        self.power_on(now)

    @abstractmethod
    def _run(self, until: float) -> None:
        """Let everything happen that is due until then; a time that lies behind the last one counts as that."""

    @abstractmethod
    def _last_told(self) -> float:
        """Return the last time it was told."""

    def _time(self, now: float | None) -> float:
        if now is not None:
            return now
        return self._last_told() if self.served_by is None else self.served_by.time()

    def _changed(self) -> None:
        if self.served_by is not None:
            self.served_by.changed()
