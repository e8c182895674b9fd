"""Files of numbered data: parameters, settings, offsets, macro variables, and what N0 and N9999 are in each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, StrEnum
from types import MappingProxyType
from typing import Final

from .sources import MANUAL

__all__ = ["CHECKSUM_NUMBER", "DATA_FILES", "LAST_NUMBER", "DataFileRules", "DataKind", "Presence"]

CHECKSUM_NUMBER: Final = 0
"""``N0``: a CRC that the control computes before it sends. How is not known: it is kept, or left out, never made."""
LAST_NUMBER: Final = 9999
"""``N9999`` of macro variables; what its V means and where it stands is not known: both are kept."""


class DataKind(StrEnum):
    """What the numbers are."""

    PARAMETERS = "parameters"
    SETTINGS = "settings"
    OFFSETS = "offsets"
    MACROS = "macros"


class Presence(Enum):
    """Whether a line is there."""

    MANDATORY = "mandatory"
    OPTIONAL = "optional"
    ABSENT = "absent"


@dataclass(frozen=True, slots=True, kw_only=True)
class DataFileRules:
    """What holds for one kind."""

    kind: DataKind
    singular: str
    checksum: Presence
    """Of the N0 line."""
    last_line: Presence
    """Of the N9999 line."""
    may_be_edited: bool
    """Whether anything but the bytes of the control may be sent back: without its N0 no parameter file is whole."""
    source: str


DATA_FILES: Final[Mapping[DataKind, DataFileRules]] = MappingProxyType(
    {
        row.kind: row
        for row in (
            DataFileRules(
                kind=DataKind.PARAMETERS, singular="parameter", checksum=Presence.MANDATORY, last_line=Presence.ABSENT,
                may_be_edited=False, source=MANUAL,
            ),
            DataFileRules(
                kind=DataKind.SETTINGS, singular="setting", checksum=Presence.OPTIONAL, last_line=Presence.ABSENT,
                may_be_edited=True, source=MANUAL,
            ),
            DataFileRules(
                kind=DataKind.OFFSETS, singular="offset", checksum=Presence.OPTIONAL, last_line=Presence.ABSENT,
                may_be_edited=True, source=MANUAL,
            ),
            DataFileRules(
                kind=DataKind.MACROS, singular="macro variable", checksum=Presence.ABSENT,
                last_line=Presence.MANDATORY, may_be_edited=True, source=MANUAL,
            ),
        )
    }
)  # fmt: skip
"""By kind. Whatever is wrong with N0, the data are loaded all the same, with an alarm (Haas 11596-8000)."""
