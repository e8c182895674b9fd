"""What happens on a line, as facts, and who is told of them: taps that are there when the line is made."""

from __future__ import annotations

from asyncio import Future
from collections.abc import Callable, Mapping
from contextvars import ContextVar
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum, StrEnum
from typing import Any

from .contract import Event, HoldOver, InStep, Lane, MarkerSpent, TurnOver

__all__ = [
    "TAPS",
    "Asked",
    "Closed",
    "Ended",
    "Fact",
    "LetGo",
    "LineTap",
    "Lost",
    "Noticed",
    "Opened",
    "Opening",
    "Ready",
    "Received",
    "Refused",
    "Resumed",
    "Sent",
    "Tap",
    "Way",
    "plain",
]


class Way(StrEnum):
    """Why something was written."""

    TURN = "turn"
    """It was its turn."""
    MARKER = "marker"
    """To get in step."""
    AHEAD = "ahead"
    """A stop, although in doubt."""
    PREEMPT = "preempt"
    """The device heeds it at any time."""
    GOES_ON = "goes on"
    """It goes on with what was written before."""


@dataclass(frozen=True, slots=True)
class Fact:
    """Something that happened on a line."""


@dataclass(frozen=True, slots=True)
class Opening(Fact):
    """It is tried to open the line."""

    url: str
    """Without secrets."""


@dataclass(frozen=True, slots=True)
class Refused(Fact):
    """It could not be opened, or who is there is not who should be."""

    why: str


@dataclass(frozen=True, slots=True)
class Opened(Fact):
    """There is a transport."""


@dataclass(frozen=True, slots=True)
class Ready(Fact):
    """The line is in step, who is there was looked at, and all that waits may go."""

    times_opened: int
    """Or tried to: more than 1 on a line that was lost and is back."""


@dataclass(frozen=True, slots=True)
class Sent(Fact):
    """Bytes were handed to the transport."""

    data: bytes
    number: int | None = None
    """Of the :class:`Asked` that it begins."""
    way: Way = Way.TURN


@dataclass(frozen=True, slots=True)
class Received(Fact):
    """Bytes were read."""

    data: bytes


@dataclass(frozen=True, slots=True)
class LetGo(Fact):
    """The transport was closed from here."""


@dataclass(frozen=True, slots=True)
class Lost(Fact):
    """The transport has reported its end."""

    why: str | None = None


@dataclass(frozen=True, slots=True)
class Resumed(Fact):
    """A person says that what the line was held for can do no harm."""


@dataclass(frozen=True, slots=True)
class Closed(Fact):
    """The line is closed for good, or given up."""


@dataclass(frozen=True, slots=True)
class Asked(Fact):
    """Somebody has asked for an exchange; it is written when it is its turn."""

    number: int
    """Of that line, from 1 on."""
    text: str
    lane: Lane
    party: str = ""
    """Whose it is, of those who share the line."""


@dataclass(frozen=True, slots=True)
class Ended(Fact):
    """Who had asked was told."""

    number: int
    how: str
    """Name of the outcome, or of the error; ``cancelled`` if nobody waits any more."""
    text: str | None = None
    """What came, or what the error says."""

    @classmethod
    def of(cls, number: int, told: Future[TurnOver]) -> Ended:
        """Note how the exchange of that *number* ended."""
        if told.cancelled():
            return cls(number, "cancelled")
        if (error := told.exception()) is not None:
            return cls(number, type(error).__name__, getattr(error, "what", str(error)))
        outcome = told.result()
        return cls(number, type(outcome).__name__, getattr(outcome, "text", None))


@dataclass(frozen=True, slots=True)
class Noticed(Fact):
    """The protocol has read something."""

    event: str
    """Name of its kind."""
    ends_turn: bool = False
    """Nothing is outstanding any more."""
    details: Mapping[str, Any] | None = None

    @classmethod
    def of(cls, event: Event) -> Noticed:
        """Note *event* by its name and fields."""
        ends_turn = isinstance(event, TurnOver | InStep | MarkerSpent | HoldOver)
        details: dict[str, Any] = plain(event)
        details.pop("event", None)
        return cls(type(event).__name__, ends_turn, details or None)


LineTap = Callable[[Fact], bool | None]
"""
Is told what happens on one line, in order, until it says False: it has heard enough. It stands in the way of the line,
and must not raise, wait or dawdle.
"""

Tap = Callable[[str, Mapping[str, object]], LineTap]
"""Is told the name of a line that is made, and what is known about its device."""

TAPS: ContextVar[tuple[Tap, ...]] = ContextVar("taps", default=())
"""Those that hear of lines which are made in this context, so by this task and by those that it starts."""


def plain(value: Any) -> Any:
    """Return *value* made of what files know: objects by their fields, members by their names; no fields of None."""
    if isinstance(value, Enum):
        return value.name
    if is_dataclass(value) and not isinstance(value, type):
        each = {field.name: plain(getattr(value, field.name)) for field in fields(value)}
        named = {"event": type(value).__name__} if isinstance(value, TurnOver) else {}
        return named | {name: content for name, content in each.items() if content is not None}
    if isinstance(value, Mapping):
        return {str(key): plain(each) for key, each in value.items()}
    if isinstance(value, tuple | list):
        return [plain(each) for each in value]
    if isinstance(value, frozenset | set):
        return sorted(plain(each) for each in value)
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)
