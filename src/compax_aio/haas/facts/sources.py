"""Where the facts are from, and how well each source founds what it says."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from ...certainty import Certainty

__all__ = [
    "ALARM_TABLE",
    "BOBCAD",
    "COLLECTION_TESTS",
    "DNC_FORUM",
    "DPRNT_THREAD",
    "INFERRED",
    "ISOLATORS",
    "KNOWLEDGE_BASE",
    "LEARNING_FACTORY",
    "MANUAL",
    "MDCMUX",
    "MTCONNECT",
    "NGC_PAGE",
    "OPENDNC",
    "SECOND_PORT",
    "SETTINGS_TABLE",
    "SOURCES",
    "VARIABLE_TABLE",
    "certainty_of",
]

MANUAL: Final = "Haas 11596-8000 (June 1999), page of the RS-232 data"
OPENDNC: Final = "OpenDNC, traces of a VF4 and a DT1"
MTCONNECT: Final = "mtconnect/adapter, folder haas"
LEARNING_FACTORY: Final = "CNC-lathe/learning-factory-server"
MDCMUX: Final = "bobvawter/mdcmux"
COLLECTION_TESTS: Final = "tests of an embedded codec that quote Haas's page of Setting 143"
SETTINGS_TABLE: Final = "documentation of a shop-monitoring gateway"
ALARM_TABLE: Final = "an alarm list that names Haas 96-0284 as its source"
ISOLATORS: Final = "a maker of RS-232 isolators, tests on a VF-2 of 1993"
DPRNT_THREAD: Final = "a machinists' forum on DPRNT, 2006"
DNC_FORUM: Final = "machinists' forums on DNC"
KNOWLEDGE_BASE: Final = "an unsigned knowledge-base article"
NGC_PAGE: Final = "Haas's how-to page of data collection, Next Generation Control"
BOBCAD: Final = "a CAM vendor's article on settings, 2019"
SECOND_PORT: Final = "a parts vendor's text of Setting 50, the second port"
VARIABLE_TABLE: Final = "a consultant's table of system variables, column of the older controls"
INFERRED: Final = "inferred"

SOURCES: Final[Mapping[str, Certainty]] = MappingProxyType(
    {
        MANUAL: Certainty.DOCUMENTED,
        OPENDNC: Certainty.REPORTED,
        MTCONNECT: Certainty.REPORTED,
        LEARNING_FACTORY: Certainty.REPORTED,
        MDCMUX: Certainty.REPORTED,
        COLLECTION_TESTS: Certainty.REPORTED,
        SETTINGS_TABLE: Certainty.REPORTED,
        ALARM_TABLE: Certainty.REPORTED,
        ISOLATORS: Certainty.REPORTED,
        DPRNT_THREAD: Certainty.REPORTED,
        DNC_FORUM: Certainty.REPORTED,
        KNOWLEDGE_BASE: Certainty.REPORTED,
        NGC_PAGE: Certainty.DOCUMENTED,
        BOBCAD: Certainty.REPORTED,
        SECOND_PORT: Certainty.REPORTED,
        VARIABLE_TABLE: Certainty.REPORTED,
        INFERRED: Certainty.INFERRED,
    }
)
"""By source, how well founded what it says is. Only two of them are the maker's own."""


def certainty_of(source: str) -> Certainty:
    """Return how well a fact with this source is founded: the best of those that are named, parted by ``;``."""
    best = list(Certainty)
    named = [SOURCES[part.strip()] for part in source.split(";") if part.strip() in SOURCES]
    return min(named, key=best.index, default=Certainty.UNKNOWN)
