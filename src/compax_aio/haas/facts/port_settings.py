"""Settings of a control that concern its port, and sets of them that were seen to work."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType
from typing import Final

from ...certainty import Certainty
from .eob import EobPattern
from .sources import (
    BOBCAD,
    LEARNING_FACTORY,
    MANUAL,
    MTCONNECT,
    NGC_PAGE,
    OPENDNC,
    SECOND_PORT,
    SETTINGS_TABLE,
    certainty_of,
)

__all__ = [
    "ADD_SPACES",
    "AUXILIARY_SYNCHRONIZATION",
    "BAUD_RATE",
    "BAUD_RATES",
    "DATA_BITS",
    "DATA_COLLECTION",
    "DATA_ECHO",
    "END_OF_BLOCK",
    "LEADER_TO_PUNCH",
    "PARITY",
    "PORT_SETTINGS",
    "SAVE_OFFSETS",
    "STOP_BITS",
    "SYNCHRONIZATION",
    "WORKING_SETS",
    "Parity",
    "PortSetting",
    "Synchronization",
    "WorkingSet",
]

BAUD_RATE: Final = 11
PARITY: Final = 12
STOP_BITS: Final = 13
SYNCHRONIZATION: Final = 14
LEADER_TO_PUNCH: Final = 24
END_OF_BLOCK: Final = 25
DATA_BITS: Final = 37
ADD_SPACES: Final = 41
AUXILIARY_SYNCHRONIZATION: Final = 50
DATA_COLLECTION: Final = 143
SAVE_OFFSETS: Final = 156
DATA_ECHO: Final = 187

BAUD_RATES: Final = (50, 110, 200, 300, 600, 1200, 2400, 4800, 7200, 9600, 19_200, 38_400, 115_200)
"""Of Setting 11 (CNC-lathe/learning-factory-server)."""


class Synchronization(StrEnum):
    """Setting 14: what keeps both ends in step; Setting 50 has the same choices for the second port."""

    RTS_CTS = "rts/cts"
    """Wires tell the sender to pause."""
    XON_XOFF = "xon/xoff"
    """DC1 and DC3 from the receiver tell the sender to go on and to pause."""
    DC_CODES = "dc codes"
    """As Xon/Xoff, with codes that start and stop reader and punch (Haas 11596-8000)."""
    XMODEM = "xmodem"
    """Blocks of 128 bytes, each checked and acknowledged."""


class Parity(StrEnum):
    """Setting 12."""

    NONE = "none"
    ZERO = "zero"
    """A bit that is always 0: eight data bits without parity, the highest of them 0 (inferred)."""
    EVEN = "even"
    ODD = "odd"


@dataclass(frozen=True, slots=True, kw_only=True)
class PortSetting:
    """One setting."""

    number: int
    name: str
    """As the page of settings shows it."""
    values: tuple[str, ...]
    """As shown there; empty if they are not known."""
    meaning: str
    source: str

    @property
    def certainty(self) -> Certainty:
        """How well the row is founded."""
        return certainty_of(self.source)


_ON_OFF: Final = ("ON", "OFF")
_CHOICES: Final = ("RTS/CTS", "XON/XOFF", "DC CODES", "XMODEM")

PORT_SETTINGS: Final[Mapping[int, PortSetting]] = MappingProxyType(
    {
        row.number: row
        for row in (
            PortSetting(
                number=BAUD_RATE, name="BAUD RATE SELECT", values=tuple(map(str, BAUD_RATES)),
                meaning="bits per second", source=LEARNING_FACTORY,
            ),
            PortSetting(
                number=PARITY, name="PARITY SELECT", values=("NONE", "ZERO", "EVEN", "ODD"), meaning="the parity bit",
                source=LEARNING_FACTORY,
            ),
            PortSetting(
                number=STOP_BITS, name="STOP BIT", values=("1", "2"), meaning="stop bits", source=LEARNING_FACTORY,
            ),
            PortSetting(
                number=SYNCHRONIZATION, name="SYNCHRONIZATION", values=_CHOICES,
                meaning="what keeps both ends in step", source=f"{MANUAL}; {OPENDNC}; {SECOND_PORT}",
            ),
            PortSetting(
                number=LEADER_TO_PUNCH, name="LEADER TO PUNCH", values=("NONE", "BLANK"),
                meaning="what is sent in front of the data; other values were not found",
                source=f"{OPENDNC}; {SETTINGS_TABLE}",
            ),
            PortSetting(
                number=END_OF_BLOCK, name="EOB PATTERN", values=tuple(each.on_screen for each in EobPattern),
                meaning="what is sent for each end of block", source=OPENDNC,
            ),
            PortSetting(
                number=DATA_BITS, name="RS-232 DATA BITS", values=("7", "8"), meaning="data bits",
                source=f"{OPENDNC}; {LEARNING_FACTORY}",
            ),
            PortSetting(
                number=ADD_SPACES, name="ADD SPACES RS232 OUT", values=_ON_OFF, meaning="spaces between words sent",
                source=f"{BOBCAD}; {SETTINGS_TABLE}",
            ),
            PortSetting(
                number=AUXILIARY_SYNCHRONIZATION, name="AUX AXIS SYNC", values=_CHOICES,
                meaning="as 14, of the second port", source=SECOND_PORT,
            ),
            PortSetting(
                number=DATA_COLLECTION, name="MACHINE DATA COLLECT", values=_ON_OFF,
                meaning="whether requests are answered; over Ethernet the number of a TCP port, 0 is off",
                source=f"{SETTINGS_TABLE}; {NGC_PAGE}",
            ),
            PortSetting(
                number=SAVE_OFFSETS, name="SAVE OFFSET WITH PROGRAM", values=_ON_OFF,
                meaning="offsets go out with a program", source=BOBCAD,
            ),
            PortSetting(
                number=DATA_ECHO, name="MACHINE DATA ECHO", values=_ON_OFF, meaning="requests are echoed",
                source=SETTINGS_TABLE,
            ),
        )
    }
)  # fmt: skip
"""By number."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkingSet:
    """Settings that somebody worked with; None where that is not told."""

    purpose: str
    baudrate: int
    parity: Parity
    stop_bits: int
    data_bits: int
    synchronization: Synchronization | None = None
    eob: EobPattern | None = None
    add_spaces: bool | None = None
    data_collection: bool | None = None
    data_echo: bool | None = None
    source: str


WORKING_SETS: Final = (
    WorkingSet(
        purpose="programs", baudrate=9600, parity=Parity.EVEN, stop_bits=2, data_bits=7,
        synchronization=Synchronization.XON_XOFF, eob=EobPattern.CR_LF, add_spaces=True, source=BOBCAD,
    ),
    WorkingSet(
        purpose="programs by XMODEM", baudrate=115_200, parity=Parity.NONE, stop_bits=1, data_bits=8,
        synchronization=Synchronization.XMODEM, eob=EobPattern.LF, source=OPENDNC,
    ),
    WorkingSet(
        purpose="data collection", baudrate=9600, parity=Parity.NONE, stop_bits=1, data_bits=8,
        synchronization=Synchronization.XON_XOFF, eob=EobPattern.CR_LF, add_spaces=False, data_collection=True,
        data_echo=False, source=SETTINGS_TABLE,
    ),
    WorkingSet(
        purpose="data collection, 7E1", baudrate=19_200, parity=Parity.EVEN, stop_bits=1, data_bits=7,
        data_collection=True, source=MTCONNECT,
    ),
    WorkingSet(
        purpose="data collection, 7N1", baudrate=115_200, parity=Parity.NONE, stop_bits=1, data_bits=7,
        data_collection=True, source=LEARNING_FACTORY,
    ),
)  # fmt: skip
"""In the order in which they are told."""
