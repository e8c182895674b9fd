"""How well a fact about a device is founded."""

from __future__ import annotations

from enum import Enum

__all__ = ["Certainty"]


class Certainty(Enum):
    """How well a row of a table is founded."""

    DOCUMENTED = "a manual says so"
    REPORTED = "public software or a user says so, no manual"
    INFERRED = "deduced from what manuals say"
    PLACEHOLDER = "no source; a value so that something can be sent or simulated"
    UNKNOWN = "it exists; no page that was available says what it is"
