"""What is known of the line that bytes go out on: how fast it is, and how many bytes have not left yet."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

__all__ = ["LineLevel"]


@dataclass(slots=True)
class LineLevel:
    """
    What is known of the line that bytes go out on.

    Attributes:
        bytes_per_s: How fast it sends; None: nobody knows.
        unsent: Says how many bytes that were written have not left yet.
    """

    bytes_per_s: float | None = None
    unsent: Callable[[], int] = lambda: 0

    def waiting(self, more_bytes: int = 0) -> int | None:
        """Return how many bytes wait to leave, with *more_bytes* that are about to be written; None: nobody knows."""
        return None if self.bytes_per_s is None else self.unsent() + more_bytes

    def leaves_s(self, more_bytes: int = 0) -> float:
        """Return how long it takes until all has left that was written."""
        return (self.waiting(more_bytes) or 0) / self.bytes_per_s if self.bytes_per_s else 0.0
