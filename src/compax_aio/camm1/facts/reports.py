"""What a cutter reports of itself: errors of the line, its status in three encodings, errors and status of HP-GL."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, IntFlag
from types import MappingProxyType
from typing import Final

__all__ = [
    "BUFFER_EMPTY",
    "HP_GL_ERRORS",
    "HP_GL_POWER_ON_STATUS",
    "IO_ERRORS",
    "NO_ERROR",
    "OUTPUT_INSTRUCTIONS",
    "PAUSED",
    "STATUS_CODES",
    "STATUS_WORD_BITS",
    "DeviceError",
    "HpGlStatus",
    "HpStatus",
    "StatusStyle",
    "StatusWord",
]

NO_ERROR: Final = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceError:
    """One error number."""

    code: int
    meaning: str
    remedy: str
    ruins_job: bool = False
    """Bytes of the job are lost, or it cannot be told that none is."""
    refuses_control: bool = False
    """A device control instruction was not, or not wholly, obeyed."""
    source: str


_BAD_LINE = "check baud rate, parity and stop bits on both sides, and the cable"
_CONTROL = "nothing of the job is lost; a defect of the sender, or of another profile than this machine's"

IO_ERRORS: Final[Mapping[int, DeviceError]] = MappingProxyType(
    {
        row.code: row
        for row in (
            DeviceError(code=0, meaning="no error", remedy="", source="PNC-900 p. 21"),
            DeviceError(
                code=10, meaning="output was requested while another output was unfinished", refuses_control=True,
                remedy="ask one thing at a time", source="PNC-900 p. 21; DPX p. 45",
            ),
            DeviceError(
                code=11, meaning="bad byte behind ESC ., or unknown device control instruction", refuses_control=True,
                remedy=_CONTROL, source="PNC-900 p. 21; DPX p. 45",
            ),
            DeviceError(
                code=12, meaning="bad parameter of a device control instruction", refuses_control=True,
                remedy=_CONTROL, source="PNC-900 p. 21; Automove p. 6-6",
            ),
            DeviceError(
                code=13, meaning="parameter of a device control instruction out of range", refuses_control=True,
                remedy=_CONTROL, source="PNC-900 p. 21; Automove p. 6-6",
            ),
            DeviceError(
                code=14, meaning="too many parameters of a device control instruction, or its colon is missing",
                refuses_control=True, remedy=_CONTROL, source="PNC-900 p. 21; Automove p. 6-6",
            ),
            DeviceError(
                code=15, meaning="framing, parity or overrun error on reception", ruins_job=True, remedy=_BAD_LINE,
                source="PNC-900 p. 21; DPX p. 45",
            ),
            DeviceError(
                code=16, meaning="the data buffer overflowed, bytes are lost", ruins_job=True,
                remedy="use another handshake, or a larger reserve", source="PNC-900 p. 21; DPX p. 45",
            ),
            DeviceError(
                code=17, meaning="the baud rate is set wrongly", ruins_job=True, remedy=_BAD_LINE, source="DPX p. 45",
            ),
            DeviceError(
                code=18, meaning="other error of input or output", ruins_job=True, remedy=_BAD_LINE, source="DPX p. 45",
            ),
        )
    }
)  # fmt: skip
"""Answers to ``.E``; reading clears. Which of several errors is kept, the first or the last, is not known."""


# Status: .O ----------------------------------------------------------------------------------------------------------

BUFFER_EMPTY: Final = 8
"""In all three encodings; no encoding says that motion is finished."""
PAUSED: Final = 16
"""In the plain codes and the word; bit 4 of the HP code is VIEW, which holds the plot as well."""


class StatusStyle(Enum):
    """How a machine words the answer to ``.O``."""

    CODES = "codes"
    """0, 8, 16, 24 (PNC-900 p. 20; DXY p. 5-21)."""
    WORD = "word"
    """A sum of bits (PNC-1610 p. 29; DPX p. 45)."""
    HP = "hp"
    """0, 8, 16, 24, 32, 40 (hpgl-buddy citing HP p. 181)."""


STATUS_CODES: Final[Mapping[StatusStyle, frozenset[int]]] = MappingProxyType(
    {StatusStyle.CODES: frozenset({0, 8, 16, 24}), StatusStyle.HP: frozenset({0, 8, 16, 24, 32, 40})}
)
"""What these two can answer."""


class StatusWord(IntFlag):
    """Bits of the word (PNC-1610 p. 29; DPX p. 45); all others are unused and 0."""

    DRAWN = 2
    """Something has been drawn."""
    BUFFER_EMPTY = 8
    PAUSED = 16
    BIT_5 = 32
    """Contradictory: its column shows 32, its text says unused."""
    ALWAYS = 256
    """Always on (DXY-1150A: off in expand mode)."""
    FUNCTION_KEY = 512
    """A function key was pressed in keyboard mode; cleared by ``.O``."""


STATUS_WORD_BITS: Final = sum(StatusWord)


class HpStatus(IntFlag):
    """Bits of the HP code (hpgl-buddy citing HP p. 181)."""

    BUFFER_EMPTY = 8
    VIEW = 16
    """VIEW was pressed, the plot is held."""
    SUSPENDED = 32
    """Paper lever or pinch wheels are up."""


# The cutting language's own ------------------------------------------------------------------------------------------

HP_GL_ERRORS: Final[Mapping[int, DeviceError]] = MappingProxyType(
    {
        row.code: row
        for row in (
            DeviceError(code=0, meaning="no error", remedy="", source="HP family"),
            DeviceError(
                code=1, meaning="unknown instruction", ruins_job=True, source="HP family",
                remedy="check the job against this machine's profile",
            ),
            DeviceError(
                code=2, meaning="wrong number of parameters", ruins_job=True, source="HP family",
                remedy="check the job; an instruction that was split shows so as well",
            ),
            DeviceError(
                code=3, meaning="parameter out of range", ruins_job=True, source="HP family", remedy="check the job",
            ),
            DeviceError(
                code=5, meaning="unknown character set", source="HP family", remedy="choose another with CS or CA",
            ),
            DeviceError(
                code=6, meaning="position overflow", ruins_job=True, source="HP family",
                remedy="keep the coordinates within the machine's range",
            ),
            DeviceError(
                code=8, meaning="pinch wheels are raised", ruins_job=True, source="HP family",
                remedy="lower them and load the sheet",
            ),
        )
    }
)  # fmt: skip
"""Answers to ``OE;``; those of a CAMM-1 may differ. 4 and 7 are unused."""


class HpGlStatus(IntFlag):
    """Bits of the answer to ``OS;`` (DXY p. 3-45); bit 4 is unreliable there."""

    TOOL_DOWN = 1
    SCALING_POINTS_CHANGED = 2
    """Cleared by ``OP``."""
    DIGITISED = 4
    INITIALISED = 8
    """Cleared by ``OS``."""
    READY = 16
    ERROR = 32
    """Read it with ``OE``."""


HP_GL_POWER_ON_STATUS: Final = HpGlStatus.INITIALISED | HpGlStatus.READY


OUTPUT_INSTRUCTIONS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "OA": "actual position: X,Y,P; P is 1 with the tool down",
        "OC": "commanded position: X,Y,P",
        "OD": "digitised point: X,Y,P",
        "OE": "error of the cutting language",
        "OF": "steps per mm: 40,40 (PNC-900 p. 19)",
        "OH": "hard-clip limits, 4 numbers",
        "OI": "model (PNC-900 p. 19)",
        "OO": "options, 8 numbers (PNC-900 p. 19)",
        "OP": "P1 and P2, 4 numbers (DXY p. 3-44)",
        "OS": "status byte (DXY p. 3-45)",
        "OW": "window, 4 numbers",
    }
)
"""Answered when they are reached in the buffer, on a serial line alone (DXY p. 3-1)."""
