"""What a transfer tells while it is under way."""

from __future__ import annotations

from dataclasses import dataclass

from ...link.contract import Event

__all__ = ["TransferBegan", "TransferHeld", "TransferStillHeld", "TransferWentOn"]


@dataclass(frozen=True, slots=True)
class TransferBegan(Event):
    """The control has begun to send, or is ready to read."""

    label: str


@dataclass(frozen=True, slots=True)
class TransferHeld(Event):
    """The control has told to stop (Xoff)."""

    label: str
    offset: int
    """So many bytes of the file had left."""
    unsent_bytes: int
    """So many more were on their way already, and leave all the same."""


@dataclass(frozen=True, slots=True)
class TransferWentOn(Event):
    """The control has told to go on (Xon)."""

    label: str
    offset: int


@dataclass(frozen=True, slots=True)
class TransferStillHeld(Event):
    """A drip feed is held for long: the machine may be in a long move, in feed hold, or stand."""

    label: str
    offset: int
    held_s: float
