"""The promises, and what breaks them: functions from what was seen to what is wrong with it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from . import in_callers_ears, lost_lines, on_the_wire
from .evidence import Case
from .testimony import Seen

__all__ = ["PROMISES", "Broken", "broken"]

Check = Callable[[Case], Iterator[str]]

PROMISES: Final[Mapping[str, tuple[Check, ...]]] = {
    "P1": (on_the_wire.turns,),
    "P2": (on_the_wire.at_most_once,),
    "P3": (in_callers_ears.settled, lost_lines.bounded),
    "P4": (in_callers_ears.own_answers,),
    "P5": (in_callers_ears.safe_to_cancel, lost_lines.works_again),
    "P6": (on_the_wire.stop_is_next,),
    "P7": (on_the_wire.own_lines, on_the_wire.own_lines_exactly),
    "P8": (in_callers_ears.bounded_memory,),
    "P9": (on_the_wire.possible_lines,),
    "P10": (in_callers_ears.nothing_invented, lost_lines.checked_before_motion),
}
"""By number."""


@dataclass(frozen=True, slots=True)
class Broken:
    """A promise that was broken, and by what."""

    promise: str
    how: str

    def __str__(self) -> str:
        return f"{self.promise}: {self.how}"


def broken(testimony: Seen) -> list[Broken]:
    """List what is wrong with what was seen."""
    case = Case(testimony)
    return [Broken(promise, how) for promise, checks in PROMISES.items() for check in checks for how in check(case)]
