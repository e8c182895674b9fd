"""The line of a cutter: its signs, its units, and how long things take."""

from __future__ import annotations

from typing import Final

__all__ = [
    "ACK",
    "BITS_PER_CHARACTER_7E1",
    "BITS_PER_CHARACTER_8E1",
    "BITS_PER_CHARACTER_8N1",
    "CARRIAGE_RETURN",
    "COLON",
    "DC1",
    "DC3",
    "DEFAULT_BAUD_RATE",
    "DOT",
    "ENQ",
    "ESCAPE",
    "ETX",
    "LINE_FEED",
    "MAX_COORDINATE",
    "MAX_INSTRUCTION_LENGTH",
    "POWER_OFF_TIME_S",
    "SEMICOLON",
    "STEPS_PER_MM",
    "STEPS_PER_S_AT_1_CM_S",
    "bits_per_character",
    "character_time_s",
]

ESCAPE: Final = 0x1B
DOT: Final = 0x2E
COLON: Final = 0x3A
"""Closes a device control instruction that can have parameters (PNC-1610 p. 28)."""
SEMICOLON: Final = 0x3B
"""Separates parameters of device control instructions (PNC-1610 p. 28); ends instructions of mode 2."""
CARRIAGE_RETURN: Final = 0x0D
"""Ends a reply, unless changed with ``.M`` (PNC-1610 p. 28)."""
LINE_FEED: Final = 0x0A
ETX: Final = 0x03
"""Ends the text of a label, unless changed with ``DT`` (CAMM-GL III mode 2)."""
ENQ: Final = 0x05
ACK: Final = 0x06
"""Of the dummy handshake (HP7470 p. 10-30); the Roland pages print no codes, so assumed there."""
DC1: Final = 0x11
"""Xon, by custom; also the trigger of preset 2 (DXY-1150A p. 36)."""
DC3: Final = 0x13
"""Xoff, by custom."""

STEPS_PER_MM: Final = 40
"""One step of coordinates is 0.025 mm; ``OF`` answers ``40,40`` (PNC-900 p. 19, 23)."""
MAX_COORDINATE: Final = 2**26 - 1
"""Largest size of a coordinate, in steps (PNC-900 p. 18)."""
STEPS_PER_S_AT_1_CM_S: Final = 10 * STEPS_PER_MM
"""400 steps/s; arithmetic."""
MAX_INSTRUCTION_LENGTH: Final = 240
"""Characters of a list of coordinates that every known machine takes; the rule of thumb of peers, no manual's."""

DEFAULT_BAUD_RATE: Final = 9600
"""Of a PNC-900 as it leaves the factory, 8N1 (PNC-900 p. 5, 24)."""
POWER_OFF_TIME_S: Final = 10.0
"""Power stays off at least so long before it is put on again (PNC-900 p. 2)."""
BITS_PER_CHARACTER_8N1: Final = 10
BITS_PER_CHARACTER_8E1: Final = 11
BITS_PER_CHARACTER_7E1: Final = 10


def bits_per_character(data_bits: int = 8, parity: bool = False, stop_bits: float = 1) -> float:
    """Return the bits a character takes on the wire: a start bit, data, parity, stop bits."""
    return 1 + data_bits + parity + stop_bits


def character_time_s(baud_rate: float, bits: float = BITS_PER_CHARACTER_8N1) -> float:
    """Return how long a character takes: 1.04 ms at 9600 baud 8N1."""
    return bits / baud_rate
