"""What happened on the axes and what the user did, newest last, bounded."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from .levels import Level

__all__ = ["Diary", "Entry"]

_KEPT: Final = 1000


@dataclass(frozen=True, slots=True)
class Entry:
    """One line of the diary."""

    when: datetime
    """Local time of day."""
    axis: str
    """Empty where it concerns all."""
    level: Level
    text: str


class Diary:
    """The last 1000 entries; *written* counts all that there ever were."""

    def __init__(self) -> None:
        self.written = 0
        self._entries: deque[Entry] = deque(maxlen=_KEPT)

    def add(self, axis: str, text: str, level: Level = Level.QUIET) -> None:
        """Write *text* down, on one line."""
        self._entries.append(Entry(datetime.now().astimezone(), axis, level, " ".join(text.split())))
        self.written += 1

    def since(self, written: int) -> list[Entry]:
        """Return the entries that came after the first *written*, as far as they are still kept."""
        news = min(self.written - written, len(self._entries))
        return list(self._entries)[len(self._entries) - news :]
