"""Why the simulated drive refuses a line; only E92 is documented, every other code here is a placeholder."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from compax_aio.compax.facts.certainty import Certainty

__all__ = [
    "FAULTED",
    "MOVE_ACTIVE",
    "NESTING",
    "NOT_MOVING",
    "NOT_SIMULATED",
    "NO_RECORD",
    "NUMBER",
    "PASSWORD",
    "POINTS_FULL",
    "POWER_OFF",
    "PROGRAM_RUNS",
    "REFUSALS",
    "STORE_EMPTY",
    "SYNTAX",
    "TRAVEL",
    "Refusal",
    "RefusedError",
]


@dataclass(frozen=True, slots=True)
class Refusal:
    """One reason, and the code that is answered."""

    code: int
    text: str
    """Follows the code where errors are answered with text; short, because the output buffer has 30 characters."""
    certainty: Certainty = Certainty.PLACEHOLDER


NOT_SIMULATED: Final = Refusal(84, "not simulated")
NOT_MOVING: Final = Refusal(85, "no move under way")
PROGRAM_RUNS: Final = Refusal(86, "program running")
NESTING: Final = Refusal(87, "wrong nesting")
NO_RECORD: Final = Refusal(88, "no such record")
PASSWORD: Final = Refusal(89, "password needed")
SYNTAX: Final = Refusal(90, "syntax error")
NUMBER: Final = Refusal(91, "number out of range")
MOVE_ACTIVE: Final = Refusal(92, "command active", Certainty.DOCUMENTED)
TRAVEL: Final = Refusal(93, "outside travel range")
FAULTED: Final = Refusal(94, "fault present")
POINTS_FULL: Final = Refusal(95, "too many points")
STORE_EMPTY: Final = Refusal(96, "nothing stored")
POWER_OFF: Final = Refusal(97, "power stage off")

REFUSALS: Final = (
    NOT_SIMULATED,
    NOT_MOVING,
    PROGRAM_RUNS,
    NESTING,
    NO_RECORD,
    PASSWORD,
    SYNTAX,
    NUMBER,
    MOVE_ACTIVE,
    TRAVEL,
    FAULTED,
    POINTS_FULL,
    STORE_EMPTY,
    POWER_OFF,
)
"""E92 is in UG p. 209; 98 and 99 are left out because they are marks of the error history."""


class RefusedError(Exception):
    """The drive refuses a line; stays inside the simulator."""

    def __init__(self, refusal: Refusal) -> None:
        super().__init__(f"E{refusal.code} {refusal.text}")
        self.refusal = refusal
