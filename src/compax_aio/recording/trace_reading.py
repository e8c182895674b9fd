"""Reading traces: entry by entry, strictly, but for lines that were cut when a program or a disk stopped."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from ..errors import InvalidCommandError
from ..text_file import name_of, open_file
from .trace_entries import (
    LONGEST_LINE,
    Cut,
    LineMade,
    Missing,
    SessionBegun,
    SessionEnded,
    TraceEntry,
    decoded,
    may_be_cut,
)
from .trace_file import older_file

__all__ = ["Conversation", "conversations", "read_trace"]

_LONGEST_CUT: Final = 200


@dataclass(slots=True, eq=False)
class Conversation:
    """All that a trace has of one line in one session."""

    session: int
    """Counted from 1."""
    begun: SessionBegun
    line: str
    made: LineMade
    entries: list[TraceEntry] = field(default_factory=list)
    """In order; with :class:`Missing` and :class:`Cut`, which are of all lines."""
    is_ended: bool = False
    """The recording was ended, and neither cut nor broken off."""

    @property
    def about(self) -> Mapping[str, Any]:
        """What is known of the line besides its device."""
        return self.made.about or {}


def read_trace(path: str | Path) -> Iterator[TraceEntry]:
    """
    Read the trace at *path*, and before it what became of the beginning of its first session, ``<path>.1``.

    A line that was cut is given as :class:`Cut`, and what follows it is a new session, or nothing.

    Raises:
        InvalidCommandError: It is no trace, is damaged, or of another version; says in which line.
        OSError: It cannot be read.
    """
    path = Path(path)
    older = older_file(path)
    if path.exists() or not older.exists():
        first = next(_entries(path), None)
        # Or the program stopped in the moment in which the new file was begun.
        is_continued = first is None or isinstance(first.fact, Cut) or getattr(first.fact, "part", 1) > 1
        files = [older, path] if is_continued and older.exists() else [path]
    else:
        files = [older]
    session, begun = 0, ""
    for file in files:
        for entry in _entries(file):
            if isinstance(entry.fact, SessionBegun):
                session += not (entry.fact.part > 1 and entry.fact.begun == begun)
                begun = entry.fact.begun
            yield replace(entry, session=session, is_older=file is not path)


def _entries(path: Path) -> Iterator[TraceEntry]:
    cut: tuple[TraceEntry, InvalidCommandError] | None = None
    is_first = True
    with open_file(path) as file:
        for place, text in _lines(file, path):
            try:
                entry = replace(decoded(text), place=place)
            except InvalidCommandError as error:
                if cut is not None:
                    raise _damaged(path, *cut) from None
                if not may_be_cut(text):
                    raise _damaged(path, TraceEntry(0.0, "", Cut(""), place=place), error) from None
                cut = TraceEntry(0.0, "", Cut(text[:_LONGEST_CUT]), place=place), error
                continue
            if cut is not None:
                if not isinstance(entry.fact, SessionBegun):
                    raise _damaged(path, *cut)
                yield cut[0]
                cut = None
            elif is_first and not isinstance(entry.fact, SessionBegun):
                raise InvalidCommandError(f"{name_of(path)} is no trace: it does not begin with a session")
            is_first = False
            yield entry
        if cut is not None:
            if is_first and not _may_begin(cut[0]):
                raise _damaged(path, *cut)
            yield cut[0]


def _lines(file: Any, path: Path) -> Iterator[tuple[int, str]]:
    place = 0
    while line := file.readline(LONGEST_LINE + 1):
        place += 1
        if len(line) > LONGEST_LINE:
            raise InvalidCommandError(
                f"{name_of(path)} is no trace: its line {place} is longer than {LONGEST_LINE} characters"
            )
        yield place, line.removesuffix(b"\n").decode("latin-1")


def _may_begin(entry: TraceEntry) -> bool:
    return isinstance(entry.fact, Cut) and '{"at":0.0,"what":"session"'.startswith(entry.fact.text[:26])


def _damaged(path: Path, entry: TraceEntry, error: InvalidCommandError) -> InvalidCommandError:
    what = f"{name_of(path)} is no trace, or is damaged, in line {entry.place}: {error.what}"
    return InvalidCommandError(what, hint=error.hint)


def conversations(path: str | Path) -> Iterator[Conversation]:
    """
    Read the trace at *path*, session by session and line by line; of each session at its end.

    See :func:`read_trace` for errors. In memory is one session at a time.
    """
    session: dict[str, Conversation] = {}
    begun = SessionBegun("", "")
    number = 0
    for entry in read_trace(path):
        if entry.session != number:
            yield from session.values()
            session, number = {}, entry.session
        fact = entry.fact
        if isinstance(fact, SessionBegun):
            begun = fact
        elif isinstance(fact, LineMade) and entry.line not in session:
            session[entry.line] = Conversation(number, begun, entry.line, fact)
        if isinstance(fact, Missing | Cut):
            for each in session.values():
                each.entries.append(entry)
        elif isinstance(fact, SessionEnded):
            for each in session.values():
                each.is_ended = True
        elif entry.line in session:
            session[entry.line].entries.append(entry)
    yield from session.values()
