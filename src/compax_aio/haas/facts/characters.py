"""Characters that mean something on the line of a control."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from .sources import COLLECTION_TESTS, INFERRED, MANUAL, OPENDNC

__all__ = [
    "ACK",
    "CAN",
    "CARRIAGE_RETURN",
    "CHARACTERS",
    "DC1",
    "DC2",
    "DC3",
    "DC4",
    "DELETE",
    "EOT",
    "ETB",
    "LEADER",
    "LINE_FEED",
    "NAK",
    "NEVER_IN_A_FILE",
    "NUL",
    "PERCENT",
    "PROMPT",
    "SEMICOLON",
    "SOH",
    "SPACE",
    "STX",
    "SUB",
    "TEXT",
    "Character",
    "name_of",
]

NUL: Final = 0x00
SOH: Final = 0x01
STX: Final = 0x02
EOT: Final = 0x04
ACK: Final = 0x06
LINE_FEED: Final = 0x0A
CARRIAGE_RETURN: Final = 0x0D
DC1: Final = 0x11
DC2: Final = 0x12
DC3: Final = 0x13
DC4: Final = 0x14
NAK: Final = 0x15
ETB: Final = 0x17
CAN: Final = 0x18
SUB: Final = 0x1A
SPACE: Final = 0x20
PERCENT: Final = 0x25
SEMICOLON: Final = 0x3B
PROMPT: Final = 0x3E
DELETE: Final = 0x7F


@dataclass(frozen=True, slots=True, kw_only=True)
class Character:
    """One of them."""

    code: int
    name: str
    """As the trade calls it: ``DC1``."""
    meaning: str
    source: str


CHARACTERS: Final[Mapping[int, Character]] = MappingProxyType(
    {
        row.code: row
        for row in (
            Character(code=NUL, name="NUL", meaning="blank tape: leader", source=INFERRED),
            Character(code=SOH, name="SOH", meaning="XMODEM: a block begins", source=OPENDNC),
            Character(code=STX, name="STX", meaning="an answer of data collection begins", source=COLLECTION_TESTS),
            Character(code=EOT, name="EOT", meaning="XMODEM: no more blocks", source=OPENDNC),
            Character(code=ACK, name="ACK", meaning="XMODEM: the block is taken", source=OPENDNC),
            Character(code=LINE_FEED, name="LF", meaning="end of block, as Setting 25 has it", source=OPENDNC),
            Character(code=CARRIAGE_RETURN, name="CR", meaning="end of block, as Setting 25 has it", source=OPENDNC),
            Character(code=DC1, name="DC1", meaning="reader on; go on (Xon)", source=MANUAL),
            Character(code=DC2, name="DC2", meaning="punch on: data follow", source=MANUAL),
            Character(code=DC3, name="DC3", meaning="reader off: the last % is received; pause (Xoff)", source=MANUAL),
            Character(code=DC4, name="DC4", meaning="punch off: no more data", source=MANUAL),
            Character(code=NAK, name="NAK", meaning="XMODEM: begin, or repeat the block", source=OPENDNC),
            Character(code=ETB, name="ETB", meaning="an answer of data collection ends", source=COLLECTION_TESTS),
            Character(code=CAN, name="CAN", meaning="XMODEM: stop; three of them behind EOT end it", source=OPENDNC),
            Character(code=SUB, name="SUB", meaning="XMODEM: fills the last block", source=OPENDNC),
            Character(code=SPACE, name="space", meaning="between words if Setting 41 is ON; leader", source=INFERRED),
            Character(code=PERCENT, name="%", meaning="alone in a line, the data begin or end", source=MANUAL),
            Character(code=SEMICOLON, name=";", meaning="EOB: not sent; received, a blank line", source=MANUAL),
            Character(
                code=PROMPT, name=">", meaning="the answer of data collection is over (in front of it, over Ethernet)",
                source=COLLECTION_TESTS,
            ),
            Character(code=DELETE, name="DEL", meaning="leader, or a hole punched over", source=INFERRED),
        )
    }
)  # fmt: skip
"""By code."""

LEADER: Final = frozenset({NUL, SPACE, DELETE})
"""What Setting 24 may have sent around the data: nothing of it is data (inferred)."""
NEVER_IN_A_FILE: Final = frozenset({DC1, DC2, DC3, DC4, SUB})
"""The line takes them for signs of its own (inferred)."""
TEXT: Final = bytes((CARRIAGE_RETURN, LINE_FEED, ord("\t"), *range(SPACE, DELETE)))
"""What a block, or a line that a program prints, can have, with its end."""

_LAST_CONTROL: Final = 0x1F


def name_of(code: int) -> str:
    """Write a character so that it can be found: ``'A'``, ``DC1 (11 hex)``, ``07 hex``."""
    if code in CHARACTERS and (code <= _LAST_CONTROL or code == DELETE):
        return f"{CHARACTERS[code].name} ({code:02X} hex)"
    if _LAST_CONTROL < code < DELETE:
        return repr(chr(code))
    return f"{code:02X} hex"
