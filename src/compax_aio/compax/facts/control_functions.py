"""The 19 functions that a COMPAX has beside its commands with values (CAN p. 32), and how each is reached here."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from .certainty import Certainty

__all__ = ["CONTROL_FUNCTIONS", "ControlFunction"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlFunction:
    """One function; *number* is that of the CANopen object of control commands, the function is the drive's."""

    number: int
    meaning: str
    word: str | None
    """Its text on RS-232; None where no page at hand gives one."""
    source: str
    certainty: Certainty = Certainty.DOCUMENTED
    """Of the word; the function itself is documented (CAN p. 32)."""
    setting: str | None = None
    """The word of the dialect that holds it, which a user can change."""
    member: str | None = None
    """What sends it, as ``Drive.home``; None: nothing does."""


CONTROL_FUNCTIONS: Final = (
    ControlFunction(
        number=1,
        meaning="go to machine home",
        word="POSA HOME",
        source="UG p. 162",
        setting="home",
        member="Drive.home",
    ),
    ControlFunction(
        number=2,
        meaning="start the program",
        word="START",
        source="UG p. 101",
        certainty=Certainty.PLACEHOLDER,
        setting="start",
        member="ProgramMemory.start",
    ),
    ControlFunction(
        number=3,
        meaning="stop program and positioning, which can be continued",
        word="STOP",
        source="UG p. 101",
        certainty=Certainty.PLACEHOLDER,
        setting="stop",
        member="Drive.stop",
    ),
    ControlFunction(
        number=4,
        meaning="break off program and positioning",
        word="BREAK",
        source="CAN-S p. 28",
        certainty=Certainty.PLACEHOLDER,
        setting="break_off",
        member="ProgramMemory.break_off",
    ),
    ControlFunction(
        number=5,
        meaning="acknowledge an error",
        word="QUIT",
        source="CAN-S p. 28",
        certainty=Certainty.PLACEHOLDER,
        setting="quit",
        member="Drive.quit",
    ),
    ControlFunction(
        number=6,
        meaning="take the actual position as real zero",
        word=None,
        source="",
        certainty=Certainty.UNKNOWN,
        setting="real_zero",
        member="Drive.set_real_zero",
    ),
    ControlFunction(
        number=7,
        meaning="declare the parameters valid",
        word="VP",
        source="UG p. 158",
        certainty=Certainty.INFERRED,
        setting="make_valid",
        member="Parameters.make_valid",
    ),
    ControlFunction(
        number=8,
        meaning="declare the configuration valid",
        word="VC",
        source="",
        certainty=Certainty.PLACEHOLDER,
    ),
    ControlFunction(
        number=9,
        meaning="take the speed from an external encoder",
        word="SPEED SYNC",
        source="UG p. 124",
        certainty=Certainty.INFERRED,
    ),
    ControlFunction(
        number=10,
        meaning="drive energised, brake open",
        word="OUTPUT O0=0",
        source="UG p. 162, 209",
        certainty=Certainty.INFERRED,
        setting="power_on",
        member="Drive.power",
    ),
    ControlFunction(
        number=11,
        meaning="drive dead, brake closed",
        word="OUTPUT O0=1",
        source="UG p. 162, 209",
        certainty=Certainty.INFERRED,
        setting="power_off",
        member="Drive.power",
    ),
    ControlFunction(
        number=12,
        meaning="drive dead, brake open",
        word="OUTPUT O0=2",
        source="UG p. 162, 209",
        certainty=Certainty.INFERRED,
        setting="power_off_brake_open",
        member="Drive.power",
    ),
    ControlFunction(number=13, meaning="program jump chosen by inputs", word="GOTO EXT", source="CAN p. 59"),
    ControlFunction(
        number=14,
        meaning="remove the password protection",
        word="GOTO 302",
        source="CAN p. 32",
        member="Parameters.unlock",
    ),
    ControlFunction(
        number=15,
        meaning="restore the password protection",
        word="GOTO 270",
        source="CAN p. 32",
        member="Parameters.lock",
    ),
    ControlFunction(
        number=16, meaning="remove the password protection, second level", word="GOTO 620", source="CAN p. 32"
    ),
    ControlFunction(
        number=17,
        meaning="declare the curve valid",
        word="VF",
        source="",
        certainty=Certainty.PLACEHOLDER,
    ),
    ControlFunction(
        number=18, meaning="emergency stop with clearing", word=None, source="", certainty=Certainty.UNKNOWN
    ),
    ControlFunction(
        number=19, meaning="emergency stop without clearing", word=None, source="", certainty=Certainty.UNKNOWN
    ),
)
"""
START, STOP, BREAK and QUIT are the words that manuals use for the functions, VC and VF not even that: the pages with
the text of the control functions on RS-232 were not available. Which of O0=0, 1 and 2 does what is inferred from the
order of functions 10 to 12 and from S16 bits 7 and 8. What no member sends, ``Drive.command`` can.
"""
