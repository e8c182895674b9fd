"""How controllers and host are wired: on one bus, where bytes can collide, or in a ring."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from random import Random

from .uart import Transmitter

__all__ = ["Bus", "Stretch"]


class Bus:
    """
    The wire from all controllers to the host, or from one of them.

    Bytes that overlap come out as one, which began first.

    Args:
        out: Is given each byte as it ends.
        collision: What becomes of bytes that overlap, as the knob says.
        chance: For those that become any byte.
    """

    def __init__(self, out: Callable[[int], None], collision: str, chance: Random) -> None:
        self._out = out
        self._collision = collision
        self._chance = chance
        self._under_way: dict[Transmitter, _Byte] = {}

    def begins(self, sender: Transmitter, byte: int) -> None:
        """Put a byte on the wire; if there is one, they collide."""
        mine = _Byte(byte)
        others = list(self._under_way.values())
        self._under_way[sender] = mine
        carrier = next((each for each in others if each.comes_out), None)
        if carrier is not None:
            mine.comes_out = False
            self._mix(carrier, byte)
            return
        for each in others:
            self._mix(mine, each.value)

    def ended(self, sender: Transmitter) -> None:
        """Take a byte from the wire."""
        byte = self._under_way.pop(sender)
        if byte.comes_out:
            self._out(byte.value)

    def _mix(self, byte: _Byte, other: int) -> None:
        if self._collision == "merge":
            byte.value &= other
        elif self._collision == "garble":
            byte.value = self._chance.randrange(256)


@dataclass(slots=True)
class _Byte:
    value: int
    comes_out: bool = True


class Stretch:
    """
    The wire from one controller of a ring to the next, or from the last one to the host.

    Args:
        out: Is given each byte as it ends.
    """

    def __init__(self, out: Callable[[int], None]) -> None:
        self._out = out
        self._byte = 0

    def begins(self, _: Transmitter, byte: int) -> None:
        """Put a byte on the wire."""
        self._byte = byte

    def ended(self, _: Transmitter) -> None:
        """Take it from the wire."""
        self._out(self._byte)
