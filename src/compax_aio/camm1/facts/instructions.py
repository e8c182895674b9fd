"""
Device control instructions, ``ESC .`` and a letter: their parameters, ranges and defaults, and whether they answer.

Sources, as they are cited here and in the other tables: *PNC-1610*, *PNC-900*, *PNC-1050* and so on are the user's
manuals of Roland CAMM-1 cutters; *DXY* is the command reference of the DXY-1300/1200/1100, *DXY-1150A* and *DPX* those
plotters' user's manuals; *PNC-300*, *PNC-3100* are CAMM-3 engravers, *EGX-600* an engraver; *HP7470* is the interfacing
and programming manual of the HP 7470A; *Automove* is the manual of a controller with the same instructions; *Kyocera*
that of a printer that emulates an HP 7550A. Whatever else is named is public software.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType
from typing import Final

__all__ = [
    "CONTROL_INSTRUCTIONS",
    "DEFAULT_BLOCK_SIZE",
    "HIGHEST_CODE",
    "MAX_BLOCK_SIZE",
    "MAX_DELAY_MS",
    "MAX_SIGNS",
    "SAFE_CODE",
    "ControlInstruction",
    "Group",
    "Kind",
    "Parameter",
]

MAX_BLOCK_SIZE: Final = 15_358
"""Bytes (PNC-1610 p. 28-29)."""
DEFAULT_BLOCK_SIZE: Final = 80
"""Bytes (PNC-1610 p. 28-29)."""
MAX_DELAY_MS: Final = 32_767
"""Of ``.M`` and ``.N`` (PNC-1610 p. 28)."""
MAX_SIGNS: Final = 10
"""Characters of an ACK, Xon, Xoff or immediate string (HP7470 p. 10-30; PNC-1610 p. 28)."""
SAFE_CODE: Final = 127
"""Highest code of a character that every relative takes (HP7470 p. 10-30, 10-33)."""
HIGHEST_CODE: Final = 255
"""Highest code that one of them takes (Automove p. 6-6)."""


class Kind(Enum):
    """What the decimal number of a parameter stands for (HP7470 p. 10-23)."""

    NUMBER = "number"
    CHARACTER = "character"
    """The code of a character; 0 is none (PNC-1610 p. 28)."""


class Group(Enum):
    """What an instruction is about."""

    HANDSHAKE = "handshake"
    STATUS = "status"
    ABORT = "abort"
    WIRING = "wiring"
    """Between a computer and a terminal, or of memory: HP alone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """One parameter of a device control instruction; omitted, it has its default (PNC-1610 p. 28)."""

    name: str
    meaning: str
    kind: Kind = Kind.NUMBER
    lowest: int = 0
    highest: int
    default: int
    source: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlInstruction:
    """One device control instruction."""

    letter: str
    meaning: str
    group: Group
    parameters: tuple[Parameter, ...] = ()
    answers: bool = False
    """Whether a reply comes, at once and out of turn of the data."""
    source: str

    @property
    def takes_parameters(self) -> bool:
        """Then ``:`` closes it, even if none is given (PNC-1610 p. 28)."""
        return bool(self.parameters)


def _sign(name: str, meaning: str, default: int, source: str) -> Parameter:
    return Parameter(
        name=name, meaning=meaning, kind=Kind.CHARACTER, highest=HIGHEST_CODE, default=default, source=source
    )


def _signs(name: str, meaning: str, source: str) -> tuple[Parameter, ...]:
    return tuple(_sign(f"{name}_{n}", meaning, 0, source) for n in range(1, MAX_SIGNS + 1))


def _block(name: str, meaning: str, source: str) -> Parameter:
    return Parameter(name=name, meaning=meaning, highest=MAX_BLOCK_SIZE, default=DEFAULT_BLOCK_SIZE, source=source)


def _delay(name: str, meaning: str) -> Parameter:
    return Parameter(name=name, meaning=meaning, highest=MAX_DELAY_MS, default=0, source="PNC-1610 p. 28")


_OUTPUT_FORMAT = (
    _delay("turnaround_ms", "delay before a reply"),
    _sign("trigger", "a reply waits for this character", 0, "PNC-1610 p. 28"),
    _sign("echo_terminator", "after a reply, what comes is dropped until this character", 0, "PNC-1610 p. 28"),
    _sign("terminator", "ends a reply", 13, "PNC-1610 p. 28"),
    _sign("second_terminator", "comes behind the terminator", 0, "PNC-1610 p. 28"),
    _sign("initiator", "stands in front of a reply", 0, "PNC-1610 p. 28"),
)
_MEMORY_AREAS = ("io", "polygon", "character", "replot", "vector")
_LARGEST_AREA = 12_752

CONTROL_INSTRUCTIONS: Final[Mapping[str, ControlInstruction]] = MappingProxyType(
    {
        row.letter: row
        for row in (
            ControlInstruction(
                letter="B", meaning="free space in the data buffer, bytes", group=Group.HANDSHAKE, answers=True,
                source="PNC-1610 p. 28",
            ),
            ControlInstruction(
                letter="M", meaning="format of replies (1)", group=Group.HANDSHAKE, parameters=_OUTPUT_FORMAT,
                source="PNC-1610 p. 28",
            ),
            ControlInstruction(
                letter="N", meaning="format of replies (2)", group=Group.HANDSHAKE, source="PNC-1610 p. 28",
                parameters=(
                    _delay("intercharacter_ms", "delay before every character of a reply"),
                    *_signs("sign", "Xoff string, or immediate response", "PNC-1610 p. 28; DXY p. 5-19"),
                ),
            ),
            ControlInstruction(
                letter="H", meaning="ENQ/ACK, mode 1", group=Group.HANDSHAKE, source="PNC-1610 p. 28",
                parameters=(
                    _block("block_bytes", "acknowledged when so much is free", "PNC-1610 p. 28"),
                    _sign("enquiry", "asks whether there is room", 0, "PNC-1610 p. 28"),
                    *_signs("sign", "acknowledgement", "PNC-1610 p. 28"),
                ),
            ),
            ControlInstruction(
                letter="I", meaning="Xon/Xoff, or ENQ/ACK mode 2", group=Group.HANDSHAKE, source="PNC-1610 p. 29",
                parameters=(
                    _block("block_bytes", "block size, or free space below which Xoff is sent", "PNC-1610 p. 29"),
                    _sign("enquiry", "asks whether there is room; 0 for Xon/Xoff", 0, "PNC-1610 p. 29"),
                    *_signs("sign", "acknowledgement, or Xon string", "PNC-1610 p. 29"),
                ),
            ),
            ControlInstruction(
                letter="@", meaning="DTR control", group=Group.HANDSHAKE, source="PNC-900 p. 20; PNC-300 p. 41",
                parameters=(
                    Parameter(
                        name="buffer_bytes", meaning="logical buffer size; ignored by PNC-900 and PNC-1050",
                        highest=MAX_BLOCK_SIZE, default=1024, source="PNC-300 p. 41",
                    ),
                    Parameter(
                        name="dtr", meaning="odd: DTR follows the free space", highest=255, default=1,
                        source="PNC-900 p. 20; PNC-1050 p. 33",
                    ),
                ),
            ),
            ControlInstruction(
                letter="P", meaning="preset handshake", group=Group.HANDSHAKE, source="PNC-1610 p. 29",
                parameters=(
                    Parameter(
                        name="preset", meaning="0 dummy, 1 Xon/Xoff, 2 ENQ/ACK mode 2, 3 hardwire", highest=3,
                        default=0, source="PNC-1610 p. 29; DXY-1150A p. 36",
                    ),
                ),
            ),
            ControlInstruction(
                letter="A", meaning="model", group=Group.STATUS, answers=True, source="PNC-1610 p. 29; DPX p. 45",
            ),
            ControlInstruction(
                letter="O", meaning="status", group=Group.STATUS, answers=True, source="PNC-1610 p. 29; PNC-900 p. 20",
            ),
            ControlInstruction(
                letter="E", meaning="error of the line; reading clears it", group=Group.STATUS, answers=True,
                source="PNC-900 p. 21; EGX-600 p. 140",
            ),
            ControlInstruction(
                letter="L", meaning="buffer size, bytes; on some only once it is empty", group=Group.STATUS,
                answers=True, source="PNC-900 p. 21; DPX p. 45; PNC-300 p. 41",
            ),
            ControlInstruction(
                letter="J", meaning="abort the control instruction being executed, and output", group=Group.ABORT,
                source="PNC-900 p. 21; Automove p. 6-11",
            ),
            ControlInstruction(
                letter="K", meaning="finish the cutting instruction in progress, drop all later ones",
                group=Group.ABORT, source="PNC-900 p. 21; EGX-600 p. 140",
            ),
            ControlInstruction(
                letter="R", meaning="reset what device control instructions have set", group=Group.ABORT,
                source="PNC-900 p. 21",
            ),
            ControlInstruction(letter="(", meaning="programmed on", group=Group.WIRING, source="HP7470 p. 10-23"),
            ControlInstruction(letter="Y", meaning="programmed on", group=Group.WIRING, source="HP7470 p. 10-23"),
            ControlInstruction(letter=")", meaning="programmed off", group=Group.WIRING, source="HP7470 p. 10-23"),
            ControlInstruction(letter="Z", meaning="programmed off", group=Group.WIRING, source="HP7470 p. 10-23"),
            ControlInstruction(
                letter="T", meaning="allocate memory, HP 7550A", group=Group.WIRING, source="cursor",
                parameters=tuple(
                    Parameter(
                        name=f"{area}_bytes", meaning=f"{area} memory", highest=_LARGEST_AREA, default=0,
                        source="cursor",
                    )
                    for area in _MEMORY_AREAS
                ),
            ),
        )
    }
)  # fmt: skip
"""By letter. ``.S``, ``.U`` and ``.Q`` are named somewhere and described nowhere: nothing is known of them."""
