"""The states of a control's line, and the one table of what leads from each to which."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from types import MappingProxyType
from typing import Final

__all__ = ["BUSY", "DOUBTFUL", "TRANSITIONS", "State", "Step"]


class State(Enum):
    """Where one line is."""

    IN_DOUBT = "in doubt"
    """Nothing is outstanding; something may still come that belongs to what was before."""
    QUIETING = "quieting"
    """Nothing is sent; when nothing has come for a while, the line is in step."""
    READY = "ready"
    """In step: nothing is outstanding."""
    CALMING = "calming"
    """Something is to be sent, as soon as the line has been silent for a moment, and the control does not hold it."""
    CATCHING_UP = "catching up"
    """An earlier question is unanswered; another one is, whose answer shows that no answer to that one will come."""
    ASKING = "asking"
    """An answer is awaited."""
    TRANSFERRING = "transferring"
    """A file is on its way, or its beginning is awaited."""


class Step(Enum):
    """What leads from one state to another."""

    LINE_OPENED = "line opened"
    LINE_LOST = "line lost"
    PREEMPTED = "pre-empted"
    """What was outstanding was given up."""
    PAUSE_BEGUN = "pause begun"
    BABBLED = "babbled"
    """So much came in the pause that it shall not go on for ever."""
    QUIET = "quiet"
    SEND_BEGUN = "send begun"
    """Something is to be sent."""
    HELD_BACK = "held back"
    """It was not, for the control holds the line, or never stops sending."""
    PROBE_SENT = "probe sent"
    CAUGHT_UP = "caught up"
    """The probe was answered: nothing is owed any more."""
    QUERY_SENT = "query sent"
    ANSWERED = "answered"
    UNREADABLE = "unreadable"
    """What came is no answer."""
    TIME_RAN_OUT = "time ran out"
    TRANSFER_BEGUN = "transfer begun"
    TRANSFER_OVER = "transfer over"
    """It came to its end."""
    TRANSFER_BROKEN = "transfer broken"
    """It did not; something of it may still come."""


TRANSITIONS: Final[Mapping[tuple[State, Step], State]] = MappingProxyType(
    {
        **{(state, Step.LINE_OPENED): State.IN_DOUBT for state in State},
        **{(state, Step.LINE_LOST): State.IN_DOUBT for state in State},
        **{(state, Step.PREEMPTED): State.QUIETING for state in State},
        (State.IN_DOUBT, Step.PAUSE_BEGUN): State.QUIETING,
        (State.QUIETING, Step.BABBLED): State.IN_DOUBT,
        (State.QUIETING, Step.QUIET): State.READY,
        (State.READY, Step.SEND_BEGUN): State.CALMING,
        (State.CALMING, Step.HELD_BACK): State.IN_DOUBT,
        (State.CALMING, Step.PROBE_SENT): State.CATCHING_UP,
        (State.CALMING, Step.QUERY_SENT): State.ASKING,
        (State.CALMING, Step.TRANSFER_BEGUN): State.TRANSFERRING,
        (State.CATCHING_UP, Step.CAUGHT_UP): State.CALMING,
        (State.CATCHING_UP, Step.TIME_RAN_OUT): State.IN_DOUBT,
        (State.ASKING, Step.ANSWERED): State.READY,
        (State.ASKING, Step.UNREADABLE): State.IN_DOUBT,
        (State.ASKING, Step.TIME_RAN_OUT): State.IN_DOUBT,
        # What a control sends by itself is waited for at once: nothing of it may be missed.
        (State.READY, Step.TRANSFER_BEGUN): State.TRANSFERRING,
        (State.TRANSFERRING, Step.TRANSFER_OVER): State.READY,
        (State.TRANSFERRING, Step.TRANSFER_BROKEN): State.IN_DOUBT,
    }
)

DOUBTFUL: Final = frozenset({State.IN_DOUBT, State.QUIETING})
BUSY: Final = frozenset(State) - {State.IN_DOUBT, State.READY}
