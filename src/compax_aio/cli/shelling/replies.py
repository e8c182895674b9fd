"""What is said about one typed line, or about what a drive did unasked: data for programs, and a text for people."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from rich.text import Text

from ...compax.events import (
    ComparatorPassed,
    ConnectionLost,
    ConnectionRestored,
    DriveEvent,
    Fault,
    PositionMessage,
    UnexpectedText,
)
from ...compax.moves import Move, MoveResult
from ...compax.settings import DriveSettings
from ...errors import AnswerTimeoutError, CompaxError, MoveStoppedError, UnexpectedAnswerError
from ...escaping import escaped
from ..unasked import UnaskedText

__all__ = ["Reply", "told_error", "told_event", "told_move"]

_EXCHANGES: Final = 6
_AFTER_RESTART: Final = "Machine zero, SPEED, ramps and prepared points may be gone"


@dataclass(frozen=True, slots=True, kw_only=True)
class Reply:
    """How one line was answered."""

    data: Mapping[str, Any] = field(default_factory=dict)
    """For programs."""
    people: Text | None = None
    """For people; None: there is nothing to say."""
    move: Move | None = None
    """A move that was accepted, and whose end is to be awaited."""


def told_event(event: DriveEvent, unasked: UnaskedText) -> Text | None:
    """Say what a drive, or its line, did unasked; None for what is not told, or not now."""
    match event:
        case PositionMessage():
            sign, style, rest = "$", "bold green", "position reached"
        case ComparatorPassed(number=number):
            sign, style, rest = str(number), "bold cyan", f"comparator {number} was passed"
        case Fault(error=error):
            sign, style, rest = "FAULT", "bold red", str(error or "the drive does not say which; S30 and S18 may")
        case ConnectionLost(reason=reason):
            sign, style, rest = "LINE LOST", "bold red", reason
        case ConnectionRestored(lost_for_s=lost_for_s, signs_of_restart=signs):
            sign, style, rest = "LINE BACK", "bold green", f"after {lost_for_s:.1f} s"
            if signs:
                rest += f"; the drive seems to have been switched off and on: {' and '.join(signs)}. {_AFTER_RESTART}"
        case UnexpectedText(text=came) if (told := unasked.take(came)) is not None:
            sign, style, rest = "unasked", "yellow", told
        case _:
            return None
    return Text.assemble((sign, style), "  ", escaped(rest))


def told_move(result: MoveResult, settings: DriveSettings) -> Reply:
    """Say how a move ended that reached its target."""
    where = "machine zero" if result.target is None else f"{result.target:.{settings.decimals}f} {settings.unit}"
    how = "the message $" if result.confirmed_by == "message" else "the status"
    return Reply(
        data={
            "reached": result.target,
            "unit": settings.unit,
            "confirmed_by": result.confirmed_by,
            "duration_s": round(result.duration_s, 3),
        },
        people=Text.assemble(("reached  ", "bold green"), f"{where}, by {how}, after {result.duration_s:.2f} s"),
    )


def told_error(error: CompaxError) -> Text:
    """Say what went wrong; where the line itself may be at fault, with the last that went over it."""
    if isinstance(error, MoveStoppedError):
        return Text.assemble(("stopped  ", "bold yellow"), str(error))
    text = Text.assemble((f"{type(error).__name__}: ", "bold red"), str(error))
    if isinstance(error, AnswerTimeoutError | UnexpectedAnswerError) and error.exchanges:
        text.append("\nthe last that went over the line:", "dim")
        for line in error.exchanges[-_EXCHANGES:]:
            text.append(f"\n  {line}", "dim")
    return text
