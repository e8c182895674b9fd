"""The states of a cutter's line, and the one table of what leads from each to which."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from types import MappingProxyType
from typing import Final

__all__ = ["BUSY", "DOUBTFUL", "TRANSITIONS", "State", "Step"]


class State(Enum):
    """Where one line is."""

    IN_DOUBT = "in doubt"
    """Nothing is outstanding; what comes next may belong to anything sent before."""
    SETTLING = "settling"
    """``.K`` was sent; for a moment nothing may follow it."""
    DRAINING = "draining"
    """``.J`` was sent, which aborts output; what comes in the pause after it is late."""
    PROBING = "probing"
    """The status is asked for in the form that was agreed on, to see whether the cutter still knows it."""
    SIGNING = "signing"
    """A new sign for replies was agreed on; one that bears it is awaited."""
    READY = "ready"
    """In step: nothing is outstanding."""
    ASKING = "asking"
    """A reply is awaited."""
    BURSTING = "bursting"
    """A burst of a job is being written."""
    QUESTIONING = "questioning"
    """The same, and the handshake's question is not answered yet."""
    WITHDRAWING = "withdrawing"
    """ENQ was not acknowledged for long: it was taken back, and free space asked for instead."""
    ENDING = "ending"
    """All of a burst was written at once."""


class Step(Enum):
    """What leads from one state to another."""

    LINE_OPENED = "line opened"
    LINE_LOST = "line lost"
    PREEMPTED = "pre-empted"
    """``.K`` was sent."""
    SETTLED = "settled"
    CLEARED = "cleared"
    """``.J`` was sent."""
    DRAINED = "drained"
    """The pause is over; the status was asked for."""
    SIGN_SENT = "sign sent"
    SIGNED = "signed"
    """A reply with the new sign came."""
    TIME_RAN_OUT = "time ran out"
    UNREADABLE = "unreadable"
    """What came is no reply."""
    QUERY_SENT = "query sent"
    ANSWERED = "answered"
    BURST_BEGUN = "burst begun"
    QUESTION_SENT = "question sent"
    QUESTION_ANSWERED = "question answered"
    WITHDRAWN = "withdrawn"
    WRITTEN = "written"
    """Nothing more of the burst can be written, before anything was awaited."""
    BURST_OVER = "burst over"


TRANSITIONS: Final[Mapping[tuple[State, Step], State]] = MappingProxyType(
    {
        **{(state, Step.LINE_OPENED): State.IN_DOUBT for state in State},
        **{(state, Step.LINE_LOST): State.IN_DOUBT for state in State},
        # .K is obeyed the moment it arrives (PNC-900 p. 21).
        **{(state, Step.PREEMPTED): State.SETTLING for state in State},
        (State.SETTLING, Step.SETTLED): State.IN_DOUBT,
        (State.IN_DOUBT, Step.CLEARED): State.DRAINING,
        (State.DRAINING, Step.DRAINED): State.PROBING,
        (State.DRAINING, Step.SIGN_SENT): State.SIGNING,  # where replies have no sign
        (State.IN_DOUBT, Step.SIGN_SENT): State.SIGNING,  # where no form was agreed on
        (State.PROBING, Step.SIGN_SENT): State.SIGNING,
        (State.PROBING, Step.TIME_RAN_OUT): State.IN_DOUBT,
        (State.SIGNING, Step.SIGNED): State.READY,
        (State.SIGNING, Step.TIME_RAN_OUT): State.IN_DOUBT,
        (State.READY, Step.QUERY_SENT): State.ASKING,
        (State.ASKING, Step.ANSWERED): State.READY,
        (State.ASKING, Step.TIME_RAN_OUT): State.IN_DOUBT,
        (State.ASKING, Step.UNREADABLE): State.IN_DOUBT,
        (State.READY, Step.BURST_BEGUN): State.BURSTING,
        (State.BURSTING, Step.QUESTION_SENT): State.QUESTIONING,
        (State.BURSTING, Step.WRITTEN): State.ENDING,
        (State.BURSTING, Step.BURST_OVER): State.READY,
        (State.ENDING, Step.BURST_OVER): State.READY,
        (State.QUESTIONING, Step.QUESTION_ANSWERED): State.BURSTING,
        (State.QUESTIONING, Step.WITHDRAWN): State.WITHDRAWING,
        (State.QUESTIONING, Step.TIME_RAN_OUT): State.IN_DOUBT,
        (State.QUESTIONING, Step.UNREADABLE): State.IN_DOUBT,
        (State.WITHDRAWING, Step.BURST_OVER): State.READY,
        (State.WITHDRAWING, Step.TIME_RAN_OUT): State.IN_DOUBT,
        (State.WITHDRAWING, Step.UNREADABLE): State.IN_DOUBT,
    }
)

DOUBTFUL: Final = frozenset({State.IN_DOUBT, State.SETTLING, State.DRAINING, State.PROBING, State.SIGNING})
BUSY: Final = frozenset(State) - {State.IN_DOUBT, State.READY}
