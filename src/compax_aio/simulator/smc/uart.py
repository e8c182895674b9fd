"""A controller's serial port: one character that waits to be read, and characters that leave one after the other."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from random import Random
from typing import Final, Protocol

from .agenda import Agenda
from .knobs import Knobs

__all__ = ["Receiver", "Transmitter", "Wire"]

_MAX_WAITING: Final = 65_536
"""Bytes that wait to leave; more are lost, so that memory is bounded."""


class Receiver:
    """
    Where characters stand from their arrival until firmware reads them (AMS p. 25).

    Args:
        agenda: The time.
        knobs: Depth and service times.
        chance: For jitter.
        steps: Whether the axis is stepping, which leaves firmware less time.
        read: Is given each character as it is read.
        lost: Is given each character that is lost because too many wait.
    """

    def __init__(
        self,
        agenda: Agenda,
        knobs: Knobs,
        chance: Random,
        *,
        steps: Callable[[], bool],
        read: Callable[[int], None],
        lost: Callable[[int], None],
    ) -> None:
        self._agenda = agenda
        self._knobs = knobs
        self._chance = chance
        self._steps = steps
        self._read = read
        self._lost = lost
        self._waiting: deque[int] = deque()
        self._held = False

    def arrived(self, byte: int) -> None:
        """Take a character that is complete now."""
        if len(self._waiting) >= self._knobs.uart_depth:
            if self._knobs.overrun == "overwrite":
                self._lost(self._waiting.pop())
                self._waiting.append(byte)
            else:
                self._lost(byte)
            return
        self._waiting.append(byte)
        if len(self._waiting) == 1:
            self._read_soon()

    def hold(self) -> None:
        """Read nothing from now on; firmware is busy."""
        self._held = True
        self._agenda.drop(self)

    def release(self) -> None:
        """Read again."""
        self._held = False
        self._read_soon()

    def reset(self) -> None:
        """Forget what waits, and read what comes."""
        self._waiting.clear()
        self._held = False
        self._agenda.drop(self)

    def _read_soon(self) -> None:
        if self._held or not self._waiting:
            return
        service_s = self._knobs.stepping_service_s if self._steps() else self._knobs.idle_service_s
        if self._knobs.jitter:
            service_s *= 1 + self._knobs.jitter * self._chance.random()
        self._agenda.put(self, self._agenda.now + service_s, self._read_one)

    def _read_one(self) -> None:
        byte = self._waiting.popleft()
        if self._waiting:
            self._read_soon()
        self._read(byte)


class Wire(Protocol):
    """What a controller sends on."""

    def begins(self, sender: Transmitter, byte: int) -> None:
        """Take note that a byte begins to be sent."""

    def ended(self, sender: Transmitter) -> None:
        """Take note that it has been sent."""


class Transmitter:
    """
    What a controller sends, one byte after the other.

    Args:
        agenda: The time.
        wire: Where it goes.
        byte_time_s: How long a byte is on the wire.
        gap_s: How long the wire stays free between two bytes.
    """

    def __init__(self, agenda: Agenda, wire: Wire, byte_time_s: float, gap_s: float = 0.0) -> None:
        self._agenda = agenda
        self._wire = wire
        self._byte_time_s = byte_time_s
        self._gap_s = gap_s
        self._waiting: deque[int] = deque()
        self._busy = False

    def send(self, data: bytes) -> None:
        """Put bytes behind those that wait."""
        self._waiting.extend(data[: _MAX_WAITING - len(self._waiting)])
        self._begin()

    def reset(self) -> None:
        """Forget what waits; a byte on the wire is finished."""
        self._waiting.clear()

    def _begin(self) -> None:
        if self._busy or not self._waiting:
            return
        self._busy = True
        self._wire.begins(self, self._waiting.popleft())
        self._agenda.put(self, self._agenda.now + self._byte_time_s, self._ended)

    def _ended(self) -> None:
        self._wire.ended(self)
        if self._gap_s:
            self._agenda.put(self, self._agenda.now + self._gap_s, self._freed)
        else:
            self._freed()

    def _freed(self) -> None:
        self._busy = False
        self._begin()
