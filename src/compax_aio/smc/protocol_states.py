"""The states of the SMC line, and the one table of what leads from each to which."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from types import MappingProxyType
from typing import Final

__all__ = ["BUSY", "DOUBTFUL", "ECHOING", "TRANSITIONS", "State", "Step"]


class State(Enum):
    """Where one line is."""

    IN_DOUBT = "in doubt"
    """Nothing is outstanding; what the axes hold of an earlier command is unknown."""
    HALF_TYPED = "half typed"
    """The same, after a command whose terminator was not sent: an axis may hold part of it."""
    CLEARING = "clearing"
    """Something that empties the axes' buffers was sent; what comes in the pause after it is dropped."""
    PROBING = "probing"
    """A command that does no harm is typed, to see whether echoes come back."""
    PROBE_ENDING = "probe ending"
    """Its terminator was sent."""
    READY = "ready"
    """In step: the last character on the line was a terminator that came back."""
    TYPING = "typing"
    """A character of a command was sent; its echo is awaited before the next one."""
    ENDING = "ending"
    """The terminator was sent; the result and the terminator's echo are awaited."""
    LISTING = "listing"
    """Lines come until there is silence."""


class Step(Enum):
    """What leads from one state to another."""

    LINE_OPENED = "line opened"
    LINE_LOST = "line lost"
    PREEMPTED = "pre-empted"
    """ESC or ^C was sent."""
    MARKER_SENT = "marker sent"
    PAUSED = "paused"
    """What clears the buffers goes on after a pause."""
    CLEARED = "cleared"
    NOBODY_TO_ASK = "nobody to ask"
    """The buffers were cleared, and no name is known that could be asked."""
    COMMAND_SENT = "command sent"
    ECHOED = "echoed"
    """The echo came; the next character was sent."""
    TYPED = "typed"
    """All echoes came; the terminator was sent."""
    NAME_FAILED = "name failed"
    """The echo of the first character, a name, did not come in time, or another character did."""
    ECHO_FAILED = "echo failed"
    """The same, with a later one."""
    ENDED = "ended"
    """The terminator came back."""
    LINE_CAME = "line came"
    """One of several lines."""
    SILENCE = "silence"
    """No other line came."""
    TIME_RAN_OUT = "time ran out"
    FLOODED = "flooded"
    """More came than any answer has."""


TRANSITIONS: Final[Mapping[tuple[State, Step], State]] = MappingProxyType(
    {
        **{(state, Step.LINE_OPENED): State.IN_DOUBT for state in State},
        **{(state, Step.LINE_LOST): State.IN_DOUBT for state in State},
        # What an axis holds of a command it holds on the next line, too.
        (State.HALF_TYPED, Step.LINE_OPENED): State.HALF_TYPED,
        (State.HALF_TYPED, Step.LINE_LOST): State.HALF_TYPED,
        # ESC and ^C are obeyed at any time, by every axis (AMS p. 25).
        **{(state, Step.PREEMPTED): State.CLEARING for state in State},
        (State.IN_DOUBT, Step.MARKER_SENT): State.CLEARING,
        (State.HALF_TYPED, Step.MARKER_SENT): State.CLEARING,
        (State.CLEARING, Step.PAUSED): State.CLEARING,
        (State.CLEARING, Step.CLEARED): State.PROBING,
        (State.CLEARING, Step.TIME_RAN_OUT): State.IN_DOUBT,
        (State.CLEARING, Step.NOBODY_TO_ASK): State.READY,
        (State.PROBING, Step.ECHOED): State.PROBING,
        (State.PROBING, Step.TYPED): State.PROBE_ENDING,
        (State.PROBING, Step.NAME_FAILED): State.IN_DOUBT,
        (State.PROBING, Step.ECHO_FAILED): State.IN_DOUBT,  # of a stop: half of one does no harm
        # What came too early was no echo; the terminator is not sent then.
        (State.PROBE_ENDING, Step.NAME_FAILED): State.IN_DOUBT,
        (State.PROBE_ENDING, Step.ECHO_FAILED): State.IN_DOUBT,
        (State.PROBE_ENDING, Step.ENDED): State.READY,
        (State.PROBE_ENDING, Step.TIME_RAN_OUT): State.IN_DOUBT,
        (State.PROBE_ENDING, Step.FLOODED): State.IN_DOUBT,
        (State.READY, Step.COMMAND_SENT): State.TYPING,
        (State.TYPING, Step.ECHOED): State.TYPING,
        (State.TYPING, Step.TYPED): State.ENDING,
        (State.TYPING, Step.NAME_FAILED): State.IN_DOUBT,
        (State.TYPING, Step.ECHO_FAILED): State.HALF_TYPED,
        (State.ENDING, Step.ECHO_FAILED): State.HALF_TYPED,
        (State.ENDING, Step.ENDED): State.READY,
        (State.ENDING, Step.LINE_CAME): State.LISTING,
        (State.ENDING, Step.TIME_RAN_OUT): State.IN_DOUBT,
        (State.ENDING, Step.FLOODED): State.IN_DOUBT,
        (State.LISTING, Step.LINE_CAME): State.LISTING,
        (State.LISTING, Step.SILENCE): State.READY,
        (State.LISTING, Step.FLOODED): State.IN_DOUBT,
    }
)

DOUBTFUL: Final = frozenset({State.IN_DOUBT, State.HALF_TYPED, State.CLEARING, State.PROBING, State.PROBE_ENDING})
ECHOING: Final = frozenset({State.PROBING, State.PROBE_ENDING, State.TYPING, State.ENDING})
BUSY: Final = frozenset(State) - {State.IN_DOUBT, State.HALF_TYPED, State.READY}
