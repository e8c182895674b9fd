"""What the SMC line tells: how an exchange ended, and what came without being asked for."""

from __future__ import annotations

from dataclasses import dataclass

from ..link.contract import Event, TurnLost, TurnOver

__all__ = ["Answered", "CutShort", "Damaged", "EntryFailed", "NamesDealt", "Stray", "Unreadable"]


@dataclass(frozen=True, slots=True)
class Answered(TurnOver):
    """The terminator came back: the command was taken, and started if it is a motion (AMS p. 25)."""

    text: str
    """What stood between the command and its terminator; empty for most commands."""


@dataclass(frozen=True, slots=True)
class EntryFailed(TurnLost):
    """
    A character did not come back, or another one did; nothing was sent after it, so not the terminator.

    What the axis holds of the command is unknown, and what clears it may execute it (see the protocol's first lines).
    """

    sent: str
    """The whole command, with the name."""
    echoed: int
    """How many of its characters came back."""
    received: str
    """What came instead of the next one; empty: nothing."""
    was_begun: bool
    """Whether the axis may hold more of it than its name."""

    @property
    def expected(self) -> str:
        """The character that did not come back."""
        return self.sent[self.echoed]


@dataclass(frozen=True, slots=True)
class Damaged(Event):
    """
    A command was not ended, and the line feed that clears the axis's buffer may execute what stands there (DCB p. 27).

    That can be another command than the one that was typed: a question whose first character arrived as an ``R``
    leads to the origin.
    """

    axis: str
    holds: tuple[str, ...]
    """What the axis may hold, without its name: up to the last echo, with the character behind it, or with what came
    back in its place."""


@dataclass(frozen=True, slots=True)
class CutShort(TurnLost):
    """ESC or ^C was sent in the middle of it."""

    sent: str
    by: str
    was_complete: bool
    """Whether the terminator had been sent: then the command may have been executed before."""


@dataclass(frozen=True, slots=True)
class Unreadable(TurnLost):
    """More came than any answer has; the command had been sent whole, and may have been executed."""

    sent: str
    text: str
    """The beginning of what came."""


@dataclass(frozen=True, slots=True)
class NamesDealt(Event):
    """The controllers of a daisy chain have taken names, from the one *offered* up to the one before *returned*."""

    returned: str
    offered: str


@dataclass(frozen=True, slots=True)
class Stray(Event):
    """Something came that nothing was asked for: noise, or a controller that was reset."""

    text: str
