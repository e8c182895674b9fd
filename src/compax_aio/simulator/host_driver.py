"""The driver of a host: what its program writes waits there until the wire has taken it, and it holds only so much."""

from __future__ import annotations

from math import inf

from .wire import Wire

__all__ = ["HostDriver"]


class HostDriver:
    """
    The driver of the host's port, as a device at the far end of the wire sees it.

    Args:
        wire: What the host has written and has not arrived yet.
        queue_bytes: How many bytes the driver takes before it holds the program up.
        lost_on_close: What has not been sent when the program closes the port is lost.
    """

    def __init__(self, wire: Wire, queue_bytes: int, *, lost_on_close: bool) -> None:
        self._wire = wire
        self._queue_bytes = queue_bytes
        self._lost_on_close = lost_on_close
        self._holds = False

    def holds_program(self) -> bool:
        """Return whether what the program writes now stays with it: the wire is stopped, or the driver is full."""
        waiting = len(self._wire)
        if self._wire.is_stopped or waiting > self._queue_bytes:
            self._holds = True
        elif waiting <= self._goes_on_at:
            self._holds = False
        return self._holds

    def next_at(self) -> float:
        """Return when the program is let go, as far as time alone does that."""
        if not self._holds or not len(self._wire) or self._wire.is_stopped:
            return inf
        return self._wire.at(len(self._wire) - self._goes_on_at - 1)

    def close(self, now: float) -> int:
        """Let the program close the port; returns how many bytes are lost with it."""
        return self._wire.cut(now) if self._lost_on_close else 0

    @property
    def _goes_on_at(self) -> int:
        return self._queue_bytes // 2
