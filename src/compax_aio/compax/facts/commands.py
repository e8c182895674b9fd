"""The commands a COMPAX takes over RS-232, long form and short (UG p. 162; sources by row)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from .certainty import Certainty

__all__ = ["COMMANDS", "CommandFact"]


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandFact:
    """One command word."""

    long: str
    """As in program listings: ``POSA``."""
    short: str
    """As sent in direct mode: ``PA``; the same as *long* where no short form is known."""
    meaning: str
    source: str
    certainty: Certainty = Certainty.DOCUMENTED


COMMANDS: Final = (
    CommandFact(long="POSA HOME", short="PH", meaning="find machine zero", source="UG p. 162"),
    CommandFact(long="POSA", short="PA", meaning="move to an absolute position", source="UG p. 162"),
    CommandFact(long="POSR", short="PR", meaning="move by a distance", source="UG p. 162"),
    CommandFact(
        long="ACCEL-",
        short="AL-",
        meaning="braking time in ms from nominal speed to standstill, from the next positioning on",
        source="UG p. 162, IBS p. 48",
    ),
    CommandFact(
        long="ACCEL",
        short="AL",
        meaning="time in ms from standstill to nominal speed, from the next positioning on",
        source="UG p. 162, IBS p. 48",
    ),
    CommandFact(
        long="SPEED",
        short="SD",
        meaning="speed in % of nominal speed, from the next positioning on",
        source="UG p. 162",
    ),
    CommandFact(long="OUTPUT", short="OT", meaning="set an output", source="UG p. 162"),
    CommandFact(
        long="STOP",
        short="STOP",
        meaning="stop positioning and program with ramp P10; START continues them",
        source="UG p. 101, CAN-S p. 28",
        certainty=Certainty.PLACEHOLDER,
    ),
    CommandFact(
        long="START",
        short="START",
        meaning="start the program, or continue what STOP has stopped",
        source="UG p. 101, CAN p. 69",
        certainty=Certainty.PLACEHOLDER,
    ),
    CommandFact(
        long="BREAK",
        short="BREAK",
        meaning="break off program and positioning; START does not continue them",
        source="CAN-S p. 28, CAN p. 32",
        certainty=Certainty.PLACEHOLDER,
    ),
    CommandFact(
        long="QUIT",
        short="QUIT",
        meaning="acknowledge an error",
        source="CAN-S p. 28, CAN p. 32",
        certainty=Certainty.PLACEHOLDER,
    ),
)
"""
Longer words first where one begins another, so that a reader can match them in this order.

The text of STOP, START, BREAK and QUIT on RS-232 stands on pages that were not available; the words are those the
manuals use for the functions.
"""
