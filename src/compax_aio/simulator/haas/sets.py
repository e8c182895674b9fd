"""Sets of settings that a simulated control can have, by short names; made from those that were seen at work."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final

from compax_aio.haas.facts.eob import EobPattern
from compax_aio.haas.facts.port_settings import WORKING_SETS, Parity, Synchronization, WorkingSet

__all__ = ["SETS", "SettingSet"]


@dataclass(frozen=True, slots=True, kw_only=True)
class SettingSet:
    """Settings of the port; what nobody told of a set is as on most controls."""

    baudrate: int
    parity: Parity
    stop_bits: int
    data_bits: int
    synchronization: Synchronization
    eob: EobPattern
    add_spaces: bool
    data_collection: str
    echo: bool = False


def _set(known: WorkingSet) -> SettingSet:
    return SettingSet(
        baudrate=known.baudrate,
        parity=known.parity,
        stop_bits=known.stop_bits,
        data_bits=known.data_bits,
        synchronization=known.synchronization or Synchronization.XON_XOFF,
        eob=known.eob or EobPattern.CR_LF,
        add_spaces=bool(known.add_spaces),
        data_collection="off" if known.data_collection is False else "rs-232",
    )


_CLASSIC, _XMODEM, _COLLECTION, _COLLECTION_7E1, _COLLECTION_7N1 = map(_set, WORKING_SETS)

SETS: Final[Mapping[str, SettingSet]] = MappingProxyType(
    {
        "classic": _CLASSIC,
        "dc codes": replace(_CLASSIC, synchronization=Synchronization.DC_CODES),
        "rts/cts": replace(_CLASSIC, synchronization=Synchronization.RTS_CTS),
        "xmodem": _XMODEM,
        "collection": _COLLECTION,
        "collection 7e1": _COLLECTION_7E1,
        "collection 7n1": _COLLECTION_7N1,
        "ethernet": replace(_COLLECTION, data_collection="ethernet"),
    }
)
"""By name. ``collection`` is what its users set for it; over Ethernet there is no port to set."""
