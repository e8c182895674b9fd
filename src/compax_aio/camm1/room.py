"""How much room a job has to get through: the cutter's buffer, what of it stays free, and what may be on its way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from ..errors import InvalidCommandError

__all__ = ["Room", "reserve_of"]

_LARGE_BYTES: Final = 512
_LARGE_RESERVE_BYTES: Final = 128
"""Filled to the brim, a 7475A has lost bytes; kept back so much, it has not (hpgl-buddy)."""
_SMALLEST_BUFFER_BYTES: Final = 32
_MOST_THRESHOLD_BYTES: Final = 384


def reserve_of(capacity_bytes: int) -> int:
    """Return how much of a buffer stays free."""
    return _LARGE_RESERVE_BYTES if capacity_bytes >= _LARGE_BYTES else max(16, capacity_bytes // 8)


@dataclass(frozen=True, slots=True)
class Room:
    """
    What a job has to get through.

    Attributes:
        capacity_bytes: Of the cutter's buffer: the most that it has ever said to be free.
        reserve_bytes: So much of it stays free.
        window_bytes: No more than that may be on its way, written and not known to have arrived.

    Raises:
        InvalidCommandError: Nothing can be sent through that.
    """

    capacity_bytes: int
    reserve_bytes: int
    window_bytes: int = 240

    def __post_init__(self) -> None:
        if self.capacity_bytes < _SMALLEST_BUFFER_BYTES or self.usable_bytes < _SMALLEST_BUFFER_BYTES // 2:
            raise InvalidCommandError(
                f"a buffer of {self.capacity_bytes} bytes with {self.reserve_bytes} kept free is too small for a job",
                hint="a cutter that is idle says its buffer's size; is it, and has nobody set another with .@?",
            )

    @classmethod
    def of(cls, capacity_bytes: int, reserve_bytes: int | None = None, window_bytes: int = 240) -> Room:
        """Make one, with the reserve that is due to a buffer of that size unless it is given."""
        reserve = reserve_of(capacity_bytes) if reserve_bytes is None else reserve_bytes
        return cls(capacity_bytes, reserve, window_bytes)

    @property
    def usable_bytes(self) -> int:
        """What of the buffer may be filled."""
        return self.capacity_bytes - self.reserve_bytes

    @property
    def threshold_bytes(self) -> int:
        """When less is free the cutter shall say stop: early, for what is on its way still comes."""
        return min(self.capacity_bytes // 2, _MOST_THRESHOLD_BYTES)
