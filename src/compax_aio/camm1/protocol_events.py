"""What a cutter's line tells: how an exchange ended, and what came without being asked for."""

from __future__ import annotations

from dataclasses import dataclass

from ..link.contract import Event, TurnLost, TurnOver

__all__ = ["Answered", "BurstOver", "CutShort", "SettingsLost", "StatusSeen", "Stray", "Unreadable"]


@dataclass(frozen=True, slots=True)
class Answered(TurnOver):
    """The reply to what was asked."""

    text: str
    """Without its sign and its terminator."""


@dataclass(frozen=True, slots=True)
class BurstOver(TurnOver):
    """A burst of a job is written, or as much of it as there was room for; how much, the burst says."""

    is_full: bool
    """Whether the cutter has no room for the next instruction now."""


@dataclass(frozen=True, slots=True)
class CutShort(TurnLost):
    """Something that the cutter heeds at any time was sent in the middle of it."""

    sent: str
    by: str


@dataclass(frozen=True, slots=True)
class Unreadable(TurnLost):
    """What came is no reply to what was asked; the line is in doubt."""

    sent: str
    text: str
    """The beginning of what came."""


@dataclass(frozen=True, slots=True)
class SettingsLost(Event):
    """
    The cutter has forgotten how its replies shall look: it was switched off and on, or somebody has reset it.

    What stood in its buffer is lost with a power cycle.
    """

    text: str
    """The reply that has shown it."""


@dataclass(frozen=True, slots=True)
class StatusSeen(Event):
    """The status, as it was told when the line got in step."""

    text: str


@dataclass(frozen=True, slots=True)
class Stray(Event):
    """Something came that nothing was asked for: noise, or a reply to somebody else."""

    text: str
