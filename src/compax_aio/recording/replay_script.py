"""The drive's side of a recorded conversation as something that can be played: attempts, and steps of each."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Final

from ..errors import InvalidCommandError, TransportError
from ..escaping import shown
from ..link.taps import LetGo, Lost, Noticed, Opened, Opening, Received, Refused, Sent
from ..text_file import name_of
from .trace_entries import Cut, Missing, TraceEntry
from .trace_reading import Conversation, conversations

__all__ = ["Attempt", "Script", "read_script"]

_MOST_STEPS: Final = 300_000
"""Of a conversation that is played; in memory they take some hundred megabytes."""
_PLAYED: Final = (Opening, Opened, Refused, Sent, Received, Lost)


@dataclass(slots=True, eq=False)
class Attempt:
    """The line as it was opened once, until it was lost or let go of."""

    begun: TraceEntry
    opened_at: float | None = None
    refused: TraceEntry | None = None
    """Why there was no transport at all."""
    steps: list[TraceEntry] = field(default_factory=list)
    """What was sent, received and noticed, and that it was lost, if not from here."""


@dataclass(slots=True, eq=False)
class Script:
    """All attempts at one line in one session."""

    path: Path
    conversation: Conversation
    attempts: list[Attempt]

    def place(self, entry: TraceEntry) -> str:
        """Say where *entry* stands."""
        return f"{name_of(self.path)}, {entry.where}"


def read_script(path: Path, line: str | None, session: int | None) -> Script:
    """
    Read the conversation to be played.

    Args:
        path: Of the trace.
        line: Its name; None if the session has one line only.
        session: Counted from 1; None: the last one that has the line.

    Raises:
        TransportError: The trace has no such conversation, or only the end of it.
        InvalidCommandError, OSError: See :func:`~compax_aio.recording.read_trace`.
    """
    found: dict[str, Conversation] = {}
    number, names = 0, set()
    for each in conversations(path):
        names.add(each.line)
        if (session is not None and each.session != session) or (line is not None and each.line != line):
            continue
        if each.session != number:
            number, found = each.session, {}
        found[each.line] = each
    if not found:
        wanted = f"line {shown(line)}" if line is not None else "line"
        where = f"session {session} of {name_of(path)}" if session is not None else name_of(path)
        lines = ", ".join(sorted(map(shown, islice(names, 20)))) or "none"
        raise TransportError(f"there is no {wanted} in {where}", hint=f"lines in the trace: {lines}")
    if len(found) > 1:
        lines = ", ".join(sorted(map(shown, islice(found, 20))))
        raise TransportError(
            f"session {number} of {name_of(path)} has {len(found)} lines", hint=f"say line=…, which is one of {lines}"
        )
    (conversation,) = found.values()
    return _script(path, conversation)


def _script(path: Path, conversation: Conversation) -> Script:
    attempts: list[Attempt] = []
    was_let_go = True
    if len(conversation.entries) > _MOST_STEPS:
        raise TransportError(
            f"line {shown(conversation.line)} of {name_of(path)} is too long to be played: "
            f"{len(conversation.entries)} entries, of {_MOST_STEPS} that may be",
            hint="cut the file behind what matters; a trace may be cut at any byte",
        )
    gap: TraceEntry | None = None
    for entry in conversation.entries:
        if gap is not None and isinstance(entry.fact, _PLAYED):
            raise InvalidCommandError(
                f"{name_of(path)} has a gap in {gap.where}: what is behind it cannot be played",
                hint="cut the file there",
            )
        if isinstance(entry.fact, Opening):
            attempts.append(Attempt(entry))
            was_let_go = False
        elif attempts and isinstance(entry.fact, Missing | Cut):
            gap = gap or entry
        elif attempts and not was_let_go:
            was_let_go = _took_end(attempts[-1], entry)
    if not attempts:
        raise TransportError(
            f"{name_of(path)} has no beginning of line {shown(conversation.line)}",
            hint="it was opened before the trace begins; the older half of a trace that was full is at <path>.1",
        )
    return Script(path, conversation, attempts)


def _took_end(attempt: Attempt, entry: TraceEntry) -> bool:
    """Take what happened in *attempt*; return whether it is over."""
    match entry.fact:
        case Opened():
            attempt.opened_at = entry.at
        case Refused() if attempt.opened_at is None:
            attempt.refused = entry
        case Sent() | Received() | Noticed() | Lost():
            attempt.steps.append(entry)
    return isinstance(entry.fact, LetGo | Lost)
