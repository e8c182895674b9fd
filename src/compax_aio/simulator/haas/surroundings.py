"""What all parts of a simulated control share: knobs, time, log, memory, alarms, the screen."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Final

from compax_aio.haas.facts.alarms import ALARMS

from ..surroundings import DeviceSurroundings
from .knobs import Knobs
from .log import Log, LogKind
from .memory import Memory

__all__ = ["RaisedAlarm", "Surroundings"]

_MOST_ALARMS: Final = 1000
_LONGEST_DETAIL: Final = 80


@dataclass(frozen=True, slots=True)
class RaisedAlarm:
    """One entry of the ALARM display."""

    name: str
    """As in the table of alarms: ``parity-error``."""
    number: int | None
    """None where it is not known."""
    text: str
    detail: str
    """What it is about."""
    at: float


class Surroundings(DeviceSurroundings[Knobs, LogKind]):
    """
    The inside of one control, as each part of it sees it.

    Args:
        knobs: Of the control.
        log: Where it notes what it does.

    Attributes:
        is_frozen: Whether only RESET, or only the main switch, helps.
        memory: Programs and numbered data.
        alarms: The ALARM display, oldest first.
        screen: The bottom left corner: ``RS232 DONE``, ``RS232 ABORT``, or empty.
    """

    def __init__(self, knobs: Knobs, log: Log) -> None:
        super().__init__(knobs, log)
        self.is_frozen = False
        self.memory = Memory(knobs)
        self.alarms: deque[RaisedAlarm] = deque(maxlen=_MOST_ALARMS)
        self.screen = ""

    def alarm(self, name: str, detail: str = "", at: float | None = None) -> None:
        """Raise an alarm of the table."""
        row = ALARMS[name]
        when = self.now if at is None else at
        detail = "".join(each if each.isprintable() else "?" for each in detail[:_LONGEST_DETAIL])
        self.alarms.append(RaisedAlarm(name, row.number, row.text, detail, when))
        number = "" if row.number is None else f"{row.number} "
        self.note(LogKind.ALARM, f"{number}{row.text}{f': {detail}' if detail else ''}", when)

    def show(self, text: str, at: float | None = None) -> None:
        """Show a text in the corner."""
        self.screen = text
        if text:
            self.note(LogKind.SCREEN, text, at)
