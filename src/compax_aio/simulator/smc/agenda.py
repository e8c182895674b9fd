"""What happens next on a simulated line: at most one thing for each key, in the order of time."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from heapq import heapify, heappop, heappush
from typing import Final

__all__ = ["Agenda"]

_SPARE: Final = 64


class Agenda:
    """
    The only clock of a simulated line.

    Attributes:
        now: The time, in seconds on any clock; it goes forward in :meth:`run` alone.
    """

    def __init__(self) -> None:
        self.now = 0.0
        self._due: dict[Hashable, tuple[int, Callable[[], None]]] = {}
        self._heap: list[tuple[float, int, Hashable]] = []
        self._count = 0

    def put(self, key: Hashable, at: float, action: Callable[[], None]) -> None:
        """Have *action* called at time *at*, instead of what was planned under *key* before."""
        self._count += 1
        self._due[key] = (self._count, action)
        heappush(self._heap, (max(at, self.now), self._count, key))
        if len(self._heap) > 2 * len(self._due) + _SPARE:
            self._heap = [each for each in self._heap if self._is_valid(each)]
            heapify(self._heap)

    def drop(self, key: Hashable) -> None:
        """Forget what was planned under *key*, if anything was."""
        self._due.pop(key, None)

    def next_at(self) -> float | None:
        """Return when something happens next; None: never."""
        while self._heap and not self._is_valid(self._heap[0]):
            heappop(self._heap)
        return self._heap[0][0] if self._heap else None

    def run(self, until: float) -> None:
        """Let everything happen that is due until then; of things at one time what was planned first."""
        while (at := self.next_at()) is not None and at <= until:
            _, _, key = heappop(self._heap)
            self.now = at
            self._due.pop(key)[1]()
        self.now = max(self.now, until)

    def _is_valid(self, entry: tuple[float, int, Hashable]) -> bool:
        due = self._due.get(entry[2])
        return due is not None and due[0] == entry[1]
