"""A quantity over the last minute: kept within bounds, and drawn as a line of blocks."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

__all__ = ["SPAN_S", "Trend", "sparkline"]

SPAN_S: Final = 60.0
"""What is drawn."""

_MAX_SAMPLES: Final = 6000
"""A hundred a second; no line at hand is that quick."""
_BLOCKS: Final = "▁▂▃▄▅▆▇█"
_GAP: Final = " "


@dataclass(frozen=True, slots=True)
class _Sample:
    at: float
    value: float


class Trend:
    """The samples of the last minute."""

    def __init__(self) -> None:
        self._samples: deque[_Sample] = deque(maxlen=_MAX_SAMPLES)

    def add(self, at: float, value: float) -> None:
        """Take a value that was read at loop time *at*."""
        self._samples.append(_Sample(at, value))
        self._forget(at)

    def _forget(self, now: float) -> None:
        while self._samples and self._samples[0].at < now - SPAN_S:
            self._samples.popleft()

    def columns(self, now: float, count: int) -> list[float | None]:
        """
        Return what is drawn in each of *count* columns, oldest first: the value furthest from zero of its time.

        None where nothing was read: a gap stays a gap, but for columns that are narrower than readings are far apart.
        """
        self._forget(now)
        columns: list[float | None] = [None] * count
        width_s = SPAN_S / count
        for sample in self._samples:
            # By whole columns since the clock began, so that a column that is over does not change any more.
            column = count - 1 - (int(now / width_s) - int(sample.at / width_s))
            if 0 <= column < count:
                before = columns[column]
                columns[column] = sample.value if before is None or abs(sample.value) > abs(before) else before
        return columns

    def extent(self, now: float) -> tuple[float, float] | None:
        """Return the lowest and highest value of the last minute; None if there was none."""
        self._forget(now)
        values = [sample.value for sample in self._samples]
        return (min(values), max(values)) if values else None


def sparkline(columns: Sequence[float | None]) -> str:
    """Draw *columns* from the lowest of them to the highest; one that is None is left blank."""
    values = [value for value in columns if value is not None]
    if not values:
        return _GAP * len(columns)
    low, span = min(values), max(values) - min(values)
    return "".join(
        _GAP if value is None else _BLOCKS[round((value - low) / span * (len(_BLOCKS) - 1)) if span > 0 else 0]
        for value in columns
    )
