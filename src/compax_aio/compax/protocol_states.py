"""The states of a COMPAX line, and the table of what leads from one to the next."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Final

from ..link.contract import Event, HoldOver, InStep, LateEnding, MarkerSpent
from .protocol_events import (
    Acknowledged,
    Answered,
    ComparatorReached,
    PositionReached,
    Rejected,
    Stray,
    UnexpectedAnswer,
)

__all__ = [
    "AHEAD",
    "AWAITING",
    "BUSY",
    "DOUBTFUL",
    "HELD",
    "MEANINGS",
    "TRANSITIONS",
    "CommandSent",
    "LineOpened",
    "MarkerSent",
    "MotionFrameSent",
    "Resumed",
    "SentAhead",
    "State",
    "TimeRanOut",
]


class State(Enum):
    """Whose turn it is, and whether that is certain."""

    READY = "in step, nothing outstanding"
    AWAITING_ANSWER = "in step, one line outstanding"
    AWAITING_FRAME = "in step, a binary motion outstanding"
    IN_DOUBT = "it is unknown what the drive will answer next"
    AWAITING_MARKER = "in doubt, a marker is outstanding"
    AWAITING_AHEAD = "in doubt, a line sent ahead is outstanding"
    FRAME_IN_DOUBT = "a binary motion may have arrived cut: nothing but a stop is sent, for it could complete it"
    AWAITING_STOP = "a binary motion may have arrived cut, a stop is outstanding"

    __hash__ = object.__hash__  # each line that is sent looks a few of them up; enum's own hashes the name in Python


@dataclass(frozen=True, slots=True)
class CommandSent(Event):
    """A line that a caller has asked for was sent."""


@dataclass(frozen=True, slots=True)
class MotionFrameSent(Event):
    """A motion was sent as a binary frame: it has no end sign, so half of it would wait for more."""


@dataclass(frozen=True, slots=True)
class MarkerSent(Event):
    """A query was sent whose answer tells it from all others."""


@dataclass(frozen=True, slots=True)
class SentAhead(Event):
    """A stop was sent although in doubt."""


@dataclass(frozen=True, slots=True)
class TimeRanOut(Event):
    """What is outstanding was not answered in time."""


@dataclass(frozen=True, slots=True)
class Resumed(Event):
    """A person says that half a frame can do no harm any more."""


@dataclass(frozen=True, slots=True)
class LineOpened(Event):
    """The line is new."""


HELD: Final = frozenset({State.FRAME_IN_DOUBT, State.AWAITING_STOP})
"""Nothing but a stop is sent, until :class:`~compax_aio.link.contract.HoldOver` or :class:`Resumed`."""
AWAITING: Final = frozenset({State.AWAITING_ANSWER, State.AWAITING_FRAME})
AHEAD: Final = frozenset({State.AWAITING_AHEAD, State.AWAITING_STOP})
BUSY: Final = AWAITING | AHEAD | {State.AWAITING_MARKER}
DOUBTFUL: Final = HELD | AHEAD | {State.IN_DOUBT, State.AWAITING_MARKER}

MEANINGS: Final[Mapping[State, tuple[bool, bool]]] = {state: (state in BUSY, state in DOUBTFUL) for state in State}
"""What each state means to the link: whether a line is outstanding, and whether the line is in doubt."""

TRANSITIONS: Final[Mapping[tuple[State, type[Event]], State]] = {
    (State.READY, CommandSent): State.AWAITING_ANSWER,
    (State.AWAITING_ANSWER, Acknowledged): State.READY,
    (State.AWAITING_ANSWER, Answered): State.READY,
    (State.AWAITING_ANSWER, Rejected): State.READY,
    (State.AWAITING_ANSWER, UnexpectedAnswer): State.IN_DOUBT,
    (State.AWAITING_ANSWER, TimeRanOut): State.IN_DOUBT,
    # Something unasked for in a quiet moment means that turns were miscounted, here or there: find out.
    (State.READY, Stray): State.IN_DOUBT,
    **{(state, Stray): state for state in State if state is not State.READY},
    # In doubt: markers, and what may go ahead of them.
    (State.IN_DOUBT, MarkerSent): State.AWAITING_MARKER,
    (State.IN_DOUBT, SentAhead): State.AWAITING_AHEAD,
    (State.AWAITING_MARKER, TimeRanOut): State.IN_DOUBT,
    (State.AWAITING_AHEAD, TimeRanOut): State.IN_DOUBT,
    (State.AWAITING_MARKER, MarkerSpent): State.IN_DOUBT,
    (State.AWAITING_AHEAD, MarkerSpent): State.IN_DOUBT,
    (State.IN_DOUBT, LateEnding): State.IN_DOUBT,
    (State.AWAITING_MARKER, LateEnding): State.AWAITING_MARKER,
    (State.AWAITING_AHEAD, LateEnding): State.AWAITING_AHEAD,
    (State.IN_DOUBT, InStep): State.READY,
    (State.AWAITING_MARKER, InStep): State.READY,
    (State.AWAITING_AHEAD, InStep): State.READY,
    # A binary motion that was not answered: a marker could be the end it waits for (UG p. 166).
    (State.READY, MotionFrameSent): State.AWAITING_FRAME,
    (State.AWAITING_FRAME, Acknowledged): State.READY,
    (State.AWAITING_FRAME, Rejected): State.READY,
    (State.AWAITING_FRAME, UnexpectedAnswer): State.FRAME_IN_DOUBT,
    (State.AWAITING_FRAME, TimeRanOut): State.FRAME_IN_DOUBT,
    (State.FRAME_IN_DOUBT, SentAhead): State.AWAITING_STOP,
    (State.AWAITING_STOP, TimeRanOut): State.FRAME_IN_DOUBT,
    (State.AWAITING_STOP, MarkerSpent): State.FRAME_IN_DOUBT,
    (State.FRAME_IN_DOUBT, MarkerSpent): State.FRAME_IN_DOUBT,
    (State.FRAME_IN_DOUBT, LateEnding): State.IN_DOUBT,
    (State.FRAME_IN_DOUBT, Resumed): State.IN_DOUBT,
    (State.FRAME_IN_DOUBT, HoldOver): State.IN_DOUBT,
    (State.AWAITING_STOP, Resumed): State.AWAITING_AHEAD,
    # Messages come unasked (UG p. 160, 162); the prompt that ends one frees no command.
    **{(state, message): state for state in State for message in (PositionReached, ComparatorReached)},
    # A drive keeps what stands in its buffer while its line is gone.
    **{(state, LineOpened): State.IN_DOUBT for state in State},
    **{(state, LineOpened): State.FRAME_IN_DOUBT for state in HELD | {State.AWAITING_FRAME}},
}
