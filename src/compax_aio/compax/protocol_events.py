"""What a COMPAX line tells whoever reads it: how a turn ended, what came unasked, and what is noise."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from ..link.contract import Event, TurnOver

__all__ = [
    "Acknowledged",
    "Answered",
    "ComparatorReached",
    "MessageForm",
    "PositionReached",
    "Rejected",
    "Stray",
    "UnexpectedAnswer",
]


class MessageForm(Enum):
    """What a drive answers to a command that carries ``$``."""

    UNKNOWN = "not seen yet"
    PROMPT_FIRST = "its prompt at once, and the message at position reached"
    FINAL_ONLY = "nothing but the message at position reached"


@dataclass(frozen=True, slots=True)
class Acknowledged(TurnOver):
    """The command was accepted: a bare prompt came (or, *by_message*, its ``$`` did instead)."""

    by_message: bool = False


@dataclass(frozen=True, slots=True)
class Answered(TurnOver):
    """The query was answered with *text*, prompt and echo taken off."""

    text: str


@dataclass(frozen=True, slots=True)
class Rejected(TurnOver):
    """The line was refused with an error number; *text* is all that came."""

    code: int
    text: str


@dataclass(frozen=True, slots=True)
class UnexpectedAnswer(TurnOver):
    """A command was answered with *text*, which is neither a prompt nor an error; the line is in doubt."""

    text: str


@dataclass(frozen=True, slots=True)
class PositionReached(Event):
    """The drive sent ``$`` (UG p. 160)."""


@dataclass(frozen=True, slots=True)
class ComparatorReached(Event):
    """The drive sent the number of a comparator, counted in the order of programming (UG p. 162)."""

    number: int


@dataclass(frozen=True, slots=True)
class Stray(Event):
    """Something came that answers nothing outstanding: noise, a doubled or late answer, a text nobody asked for."""

    text: str
