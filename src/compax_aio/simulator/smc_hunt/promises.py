"""The promises that a party line must keep, and what breaks them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Final

from ..hunt.promises import Broken
from . import in_callers_ears, on_the_wire
from .evidence import Case
from .testimony import SeenLine

__all__ = ["PROMISES", "broken_on_line"]

Check = Callable[[Case], Iterator[str]]

PROMISES: Final[Mapping[str, tuple[Check, ...]]] = {
    "P1": (on_the_wire.turns,),
    "P2": (on_the_wire.at_most_once, on_the_wire.doubt_is_followed),
    "P3": (in_callers_ears.settled,),
    "P4": (in_callers_ears.own_answers,),
    "P5": (in_callers_ears.safe_to_cancel,),
    "P6": (on_the_wire.stop_is_next,),
    "P8": (in_callers_ears.bounded_memory,),
    "P9": (on_the_wire.possible_lines, on_the_wire.refused_at_once),
    "P10": (in_callers_ears.nothing_invented,),
}
"""By number; P7 is about several lines."""


def broken_on_line(testimony: SeenLine) -> list[Broken]:
    """List what is wrong with what was seen."""
    case = Case(testimony)
    return [Broken(promise, how) for promise, checks in PROMISES.items() for check in checks for how in check(case)]
