"""
What is known of the AMS SMC family's serial interface, as frozen tables with their sources.

Sources, as they are cited here and elsewhere: *AMS* is the page "Serial Interface" of an AMS manual (printed page 25);
*DCB* the DCB-274 Users Guide of 07/05/06; *motorIms* (EPICS), *panther* (mx-trunk), *gem-controld*, *IM483I.h* and
*789A-4* are drivers that work with relatives of these controllers, and prove no more than those relatives. The pages
of the manual that hold the command reference were not at hand.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, IntFlag
from types import MappingProxyType
from typing import Final

__all__ = [
    "BACKSPACE",
    "CARRIAGE_RETURN",
    "COMMANDS",
    "ESCAPE",
    "INSTRUCTION_BYTES",
    "LINE_FEED",
    "MAX_AXES",
    "MAX_COMMAND_LENGTH",
    "MAX_POSITION",
    "NOT_A_NAME",
    "NO_NAME",
    "ORIGIN",
    "POSSIBLE_NAMES",
    "PROGRAM_ENTRY",
    "PROMPT",
    "RESET",
    "SPACE",
    "STOPPED_MASK",
    "UNSETTLED_MASK",
    "Command",
    "Mode",
    "MotionFlags",
    "Reply",
    "command_of",
]

# The line ------------------------------------------------------------------------------------------------------------

LINE_FEED: Final = 0x0A
"""Ends a command in party line and daisy chain, and lets every axis look at the next character (AMS p. 25, rule 3)."""
CARRIAGE_RETURN: Final = 0x0D
"""Ends a command in single mode (AMS p. 25)."""
ESCAPE: Final = 0x1B
"""Aborts motion without a ramp, ends program entry, clears what was typed: on every axis (AMS p. 25; DCB p. 26-27)."""
RESET: Final = 0x03
"""^C: the same as power-up, on every axis (AMS p. 25; DCB p. 20)."""
SPACE: Final = 0x20
"""In single mode the first one after a reset brings the sign-on (DCB p. 20)."""
BACKSPACE: Final = 0x08
"""Takes a character back, in single mode alone (DCB p. 27)."""
PROMPT: Final = "#"
"""What a lone CR is answered with in single mode (panther, gem-controld)."""

MAX_COMMAND_LENGTH: Final = 12
"""Characters between the name and the terminator (AMS p. 25)."""
MAX_AXES: Final = 32
"""On one party line (DCB p. 17)."""


class Mode(Enum):
    """How an axis takes its commands: chosen at every reset by an input of the controller (DCB p. 20)."""

    SINGLE = "single"
    """One controller, no name, CR; "dumb terminal", made for typing (DCB p. 20, 23)."""
    PARTY = "party"
    """1 to 32 controllers on one bus, each with a name (DCB p. 17, 20)."""
    DAISY = "daisy"
    """Controllers in a ring, whose names are dealt out after every reset (DCB p. 20, 24)."""

    @property
    def terminator(self) -> int:
        """What ends a command (AMS p. 25; DCB p. 27)."""
        return CARRIAGE_RETURN if self is Mode.SINGLE else LINE_FEED

    @property
    def has_names(self) -> bool:
        """Whether a command begins with the name of its axis (AMS p. 25, rule 1)."""
        return self is not Mode.SINGLE


# Names ---------------------------------------------------------------------------------------------------------------

NO_NAME: Final = ""
"""The name of the only axis in single mode."""
POSSIBLE_NAMES: Final = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz"
"""Recommended, in the order in which AMS's own software looks for them (DCB p. 23); case matters."""
NOT_A_NAME: Final = frozenset("@[\\]^_`\x03\n\r")
"""Not valid (DCB p. 23; it prints ``-`` for 5F, which is the underscore)."""


# Commands ------------------------------------------------------------------------------------------------------------


class Reply(Enum):
    """What comes between the echo of a command and its terminator."""

    NOTHING = "nothing"
    NUMBER = "number"
    LINES = "lines"
    """Several lines; that they are over is known by silence alone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """One command, known by its first character: small letters are other commands (motorIms, panther)."""

    letter: str
    meaning: str
    reply: Reply = Reply.NOTHING
    is_action: bool = False
    """Waits in the controller until the action before it is over (DCB p. 27)."""
    moves: bool = False
    """The axis may move by it."""
    source: str


COMMANDS: Final[Mapping[str, Command]] = MappingProxyType(
    {
        row.letter: row
        for row in (
            Command(letter="+", meaning="index, plus direction", is_action=True, moves=True, source="DCB p. 26"),
            Command(letter="-", meaning="index, minus direction", is_action=True, moves=True, source="DCB p. 26"),
            Command(letter="R", meaning="go to a position", is_action=True, moves=True, source="AMS p. 25; DCB p. 24"),
            Command(letter="M", meaning="constant speed", is_action=True, moves=True, source="gem-controld, panther"),
            Command(letter="F", meaning="find home", is_action=True, moves=True, source="motorIms, panther, 789A-4"),
            Command(letter="G", meaning="run the program", is_action=True, moves=True, source="DCB p. 24, 27"),
            Command(letter="@", meaning="soft stop", source="panther, gem-controld, 789A-4, motorIms"),
            Command(letter="^", meaning="motion status", reply=Reply.NUMBER, source="DCB p. 26"),
            Command(letter="Z", meaning="position", reply=Reply.NUMBER, source="AMS p. 25; DCB p. 26"),
            Command(letter="]", meaning="limit inputs", reply=Reply.NUMBER, source="motorIms, panther, 789A-4"),
            Command(letter="O", meaning="set the origin here", source="DCB p. 24"),
            Command(letter="I", meaning="initial speed", source="panther, gem-controld, motorIms"),
            Command(letter="V", meaning="slew speed", source="DCB p. 27; gem-controld, panther, 789A-4"),
            Command(letter="K", meaning="ramp slopes", source="gem-controld, panther, 789A-4"),
            Command(letter="D", meaning="resolution", is_action=True, source="DCB p. 27; gem-controld, panther"),
            Command(letter="H", meaning="fixed or variable resolution", source="gem-controld, panther"),
            Command(letter="Y", meaning="hold and run current", source="gem-controld, panther"),
            Command(letter="E", meaning="settling delay", source="panther"),
            Command(letter="l", meaning="limit polarity", source="motorIms, panther"),
            Command(letter="A", meaning="outputs, or the port when it is 129", source="gem-controld, 789A-4"),
            Command(letter="P", meaning="program entry", source="AMS p. 25; DCB p. 24"),
            Command(letter="Q", meaning="list the program", reply=Reply.LINES, source="DCB p. 24"),
            Command(letter="J", meaning="jump, in a program", moves=True, source="DCB p. 24"),
            Command(letter="W", meaning="wait, in a program", source="DCB p. 24"),
            Command(letter="X", meaning="show the parameters", reply=Reply.LINES, source="DCB p. 23; panther"),
            Command(letter="S", meaning="store parameters and name", source="DCB p. 23"),
            Command(letter="C", meaning="clear", source="789A-4"),
        )
    }
)

ORIGIN: Final = "O"
PROGRAM_ENTRY: Final = "P"
_UNKNOWN: Final = "not known"
_PORT: Final = "A129"


def command_of(text: str) -> Command:
    """
    Return what is known of the command that *text*, without a name, begins with.

    One of which nothing is known counts as an action that may move the axis, and answers whatever it answers.
    """
    if text.replace(" ", "") == _PORT:
        return Command(letter="A", meaning="the port", reply=Reply.NUMBER, source="gem-controld")
    letter = text[:1]
    if (row := COMMANDS.get(letter)) is not None:
        return row
    return Command(letter=letter, meaning=_UNKNOWN, is_action=True, moves=True, source=_UNKNOWN)


# Motion --------------------------------------------------------------------------------------------------------------

MAX_POSITION: Final = 8_388_607.99
"""Largest size of a position or distance, in steps (DCB p. 26; gem-controld)."""


class MotionFlags(IntFlag):
    """The answer to ``^`` (DCB p. 26; the bits by gem-controld)."""

    MOVING = 1
    CONSTANT_SPEED = 2
    HOMING = 8
    HUNTING = 16
    """Correcting the position by the encoder."""
    RAMPING = 32


STOPPED_MASK: Final = MotionFlags.MOVING | MotionFlags.CONSTANT_SPEED
"""Standing still when none of these is set (DCB p. 26)."""
UNSETTLED_MASK: Final = MotionFlags.HOMING | MotionFlags.HUNTING | MotionFlags.RAMPING
"""Standing still for good when none of these is set either; by inference, for EPICS waits until all bits are 0."""

INSTRUCTION_BYTES: Final[Mapping[str, int]] = MappingProxyType({"O": 1, "W": 3, "J": 4, "R": 5})
"""
What an instruction takes in the program memory: the addresses of the worked program on DCB p. 24.

Those of others are on no page at hand; a listing of a program shows them.
"""
