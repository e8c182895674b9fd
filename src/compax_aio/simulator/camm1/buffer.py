"""The data buffer: what has come and was not read, when each byte came, and how much counts as stored."""

from __future__ import annotations

from collections import deque

__all__ = ["Buffer"]


class Buffer:
    """
    A first-in first-out store of *size* bytes.

    Attributes:
        size: Bytes that it holds.
        data: What was not read yet.
        stored: Bytes that count: also those of instructions being carried out, where they count until their end.
    """

    def __init__(self, size: int) -> None:
        self.size = size
        self.data = bytearray()
        self.stored = 0
        self._head = 0
        self._uncounted = 0
        self._arrivals: deque[tuple[int, int, float, float]] = deque()

    @property
    def room(self) -> int:
        """Bytes for which there is room."""
        return self.size - self.stored

    def append(self, data: bytes, first_at: float, byte_time_s: float) -> None:
        """Store bytes of which the first has come then, and the others one after the other; there is room for them."""
        begin = self._head + len(self.data)
        self._arrivals.append((begin, begin + len(data), first_at, byte_time_s))
        self.data += data
        self.stored += len(data)

    def arrived_at(self, count: int) -> float:
        """Return when the first *count* bytes of :attr:`data` had come."""
        place = self._head + count - 1
        for begin, end, first_at, byte_time_s in self._arrivals:
            if place < end:
                return first_at + (place - begin) * byte_time_s
        return 0.0

    def read(self, count: int) -> int:
        """Take bytes away from the head; return how many of them still count as stored."""
        del self.data[:count]
        self._head += count
        while self._arrivals and self._arrivals[0][1] <= self._head:
            self._arrivals.popleft()
        if not self._uncounted:
            return count
        free = min(count, self._uncounted)
        self._uncounted -= free
        return count - free

    def drop_oldest(self, count: int) -> None:
        """Lose bytes at the head."""
        self.stored -= self.read(min(count, len(self.data)))

    def clear(self, *, kept: int = 0) -> int:
        """Throw all away, but for the last *kept* bytes, which take no room; return how many went."""
        dropped = len(self.data) - kept
        self.read(dropped)
        self.stored, self._uncounted = 0, kept
        return dropped
