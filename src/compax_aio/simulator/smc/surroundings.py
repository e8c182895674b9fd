"""What every part of one simulated axis is given: the time, its knobs, and where to write down what it did."""

from __future__ import annotations

from dataclasses import dataclass

from .agenda import Agenda
from .knobs import Knobs
from .log import Log, LogKind

__all__ = ["Surroundings"]


@dataclass(frozen=True, slots=True)
class Surroundings:
    """Of one axis."""

    letter: str
    """Of the axis in the log; also the name it has stored in the factory."""
    agenda: Agenda
    knobs: Knobs
    log: Log

    def note(self, kind: LogKind, text: str = "", position: float | None = None) -> None:
        """Write down what the axis did."""
        self.log.add(self.agenda.now, kind, self.letter, text, position)
