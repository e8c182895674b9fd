"""The value of N0. How a control computes it is not known: this is a stand-in, of which only its sameness is true."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final
from zlib import crc32

from compax_aio.haas.facts.data_files import DataKind

__all__ = ["stand_in"]

_BELOW: Final = 1_000_000


def stand_in(kind: DataKind, values: Mapping[int, str]) -> int:
    """
    Return a number that is the same for the same data, and most often another one for other data.

    No control computes it like that. What was made here is accepted here; a real control refuses it with an alarm.
    """
    return crc32(f"{kind} {sorted(values.items())}".encode()) % _BELOW
