"""Why a conversation in XMODEM has failed."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

__all__ = ["Failure", "FailureKind"]


class FailureKind(Enum):
    """What went wrong, in one clause."""

    NEVER_BEGUN = "nobody began at the far end"
    FELL_SILENT = "the far end fell silent in the middle"
    TOO_MANY_REPEATS = "one block did not get over, however often it was sent"
    CANCELLED_THERE = "the far end has cancelled (CAN CAN)"
    CANCELLED_HERE = "it was cancelled here"
    OUT_OF_STEP = "the two ends are not at the same block"
    END_UNKNOWN = "every block was acknowledged, the end (EOT) was not"


@dataclass(frozen=True, slots=True)
class Failure:
    """
    Why a conversation is over without having reached its end.

    Attributes:
        kind: What went wrong.
        detail: What is known besides, with block numbers; a clause for a person.
    """

    kind: FailureKind
    detail: str

    def __str__(self) -> str:
        return f"{self.kind.value}: {self.detail}"
