"""What stands in a trace: one entry a line, typed as it is read, written as JSON with time, line, and what happened."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import MISSING, dataclass, fields, replace
from itertools import islice
from math import isfinite
from typing import Any, Final

from ..errors import InvalidCommandError
from ..escaping import shown
from ..link.contract import Lane
from ..link.taps import (
    Asked,
    Closed,
    Ended,
    Fact,
    LetGo,
    Lost,
    Noticed,
    Opened,
    Opening,
    Ready,
    Received,
    Refused,
    Resumed,
    Sent,
    Way,
)

__all__ = [
    "FORMAT",
    "LONGEST_LINE",
    "VERSION",
    "Cut",
    "LineMade",
    "Missing",
    "SessionBegun",
    "SessionEnded",
    "TraceEntry",
    "decoded",
    "encoded",
    "may_be_cut",
]

FORMAT: Final = "compax-aio trace"
VERSION: Final = 1

LONGEST_LINE: Final = 256 * 1024
"""Characters of a line that is read. One that is written has a tenth of it, but for long listings."""
_BYTES_AN_ENTRY: Final = 1024
_LATEST_S: Final = 1e9
_MOST: Final = 10**15
_NAMES_SHOWN: Final = 5
_LONGEST_TEXT: Final = 20_000
"""Characters of a text; an escaped one has six times as many."""


@dataclass(frozen=True, slots=True)
class SessionBegun(Fact):
    """A recording begins, or goes on in another file."""

    begun: str
    """Wall clock, ISO 8601 with its offset from UTC; it names the session, too."""
    by: str
    """Package and version."""
    part: int = 1
    """Above 1: the session goes on here; it began in the file that was full."""
    format: str = FORMAT
    version: int = VERSION


@dataclass(frozen=True, slots=True)
class LineMade(Fact):
    """There is a line; it need not be open."""

    device: str = ""
    """``compax``, ``smc`` or another; empty if nobody said it."""
    is_open: bool = False
    """It was opened before, in an earlier part of the session."""
    about: Mapping[str, Any] | None = None
    """What else is known of it: the settings by which it is talked to."""


@dataclass(frozen=True, slots=True)
class Missing(Fact):
    """Entries could not be written here: the disk did not take them fast enough, or at all."""

    entries: int


@dataclass(frozen=True, slots=True)
class SessionEnded(Fact):
    """The recording was ended; what happens on its lines after that is not in it."""


@dataclass(frozen=True, slots=True)
class Cut(Fact):
    """A line that was not written to its end: the program, or the disk, stopped in the middle of it."""

    text: str
    """What there is of it."""


@dataclass(frozen=True, slots=True)
class TraceEntry:
    """One entry of a trace."""

    at: float
    """Seconds since the session began."""
    line: str
    """Name of the line; empty where it is about none. Of two of one name the second is called ``x (2)``."""
    fact: Fact
    session: int = 0
    """Counted from 1."""
    place: int = 0
    """Line number in the file, from 1 on."""
    is_older: bool = False
    """It is in ``<path>.1``, the older half of the trace."""

    @property
    def where(self) -> str:
        """Where it stands, for people."""
        return f"line {self.place} of the older file" if self.is_older else f"line {self.place}"


_KINDS: Final[Mapping[str, type[Fact]]] = {
    "session": SessionBegun,
    "line": LineMade,
    "opening": Opening,
    "refused": Refused,
    "opened": Opened,
    "ready": Ready,
    "sent": Sent,
    "received": Received,
    "let go": LetGo,
    "lost": Lost,
    "resumed": Resumed,
    "closed": Closed,
    "asked": Asked,
    "ended": Ended,
    "noticed": Noticed,
    "missing": Missing,
    "end": SessionEnded,
}
_NAMES: Final = {kind: name for name, kind in _KINDS.items()}


# Writing ------------------------------------------------------------------------------------------------------------


def encoded(at: float, line: str, fact: Fact) -> Iterator[str]:
    """Write what happened as lines of JSON, without their ends; usually one, of many bytes more, none too long."""
    for part in _parts(fact):
        entry: dict[str, Any] = {"at": round(at, 6)}
        if line:
            entry["line"] = line
        entry["what"] = _NAMES[type(part)]
        for field in fields(part):
            value = getattr(part, field.name)
            if value != field.default:
                entry[field.name] = _written(value)
        if isinstance(part, SessionBegun):
            entry |= {"format": FORMAT, "version": VERSION}
        text = json.dumps(entry, separators=(",", ":"), allow_nan=False)
        if len(text) > LONGEST_LINE:  # nobody would read it, nor what is behind it
            text = json.dumps({"at": round(at, 6), "what": _NAMES[Missing], "entries": 1}, separators=(",", ":"))
        yield text


def _parts(fact: Fact) -> Iterator[Fact]:
    if isinstance(fact, Sent | Received) and len(fact.data) > _BYTES_AN_ENTRY:
        for begin in range(0, len(fact.data), _BYTES_AN_ENTRY):
            piece = replace(fact, data=fact.data[begin : begin + _BYTES_AN_ENTRY])
            yield replace(piece, number=None, way=Way.GOES_ON) if begin and isinstance(piece, Sent) else piece
    else:
        yield fact


def _written(value: Any) -> Any:
    if isinstance(value, bytes):
        return value.decode("latin-1")
    if isinstance(value, Lane | Way):
        return value.name.lower().replace("_", " ")
    if isinstance(value, str):
        return value if len(value) <= _LONGEST_TEXT else f"{value[:_LONGEST_TEXT]}…"
    if isinstance(value, float) and not isfinite(value):
        return str(value)
    if isinstance(value, Mapping):
        return {key: _written(each) for key, each in value.items()}
    return [_written(each) for each in value] if isinstance(value, list) else value


# Reading ------------------------------------------------------------------------------------------------------------


def may_be_cut(text: str) -> bool:
    """Whether *text*, which is no entry, can be the beginning of one: what is whole JSON was not cut."""
    try:
        json.loads(text)
    except (ValueError, RecursionError):
        return True
    return False


def decoded(text: str) -> TraceEntry:
    """
    Read one line of a trace.

    Raises:
        InvalidCommandError: It is none; says why.
    """
    if not text.isascii():
        raise InvalidCommandError("it holds a character that is not ASCII")
    try:
        entry = json.loads(text, object_pairs_hook=_each_once, parse_constant=_no_number)
    except (ValueError, RecursionError) as error:
        raise InvalidCommandError(f"it is no JSON: {error}") from None
    if not isinstance(entry, dict):
        raise InvalidCommandError(f"it is no JSON object, but {shown(entry)}")
    what, at, line = entry.pop("what", None), entry.pop("at", None), entry.pop("line", "")
    kind = _KINDS.get(what) if isinstance(what, str) else None
    if kind is None:
        raise InvalidCommandError(f"nothing is called {shown(what)} in a trace")
    if isinstance(at, bool) or not isinstance(at, int | float) or not 0 <= at < _LATEST_S:
        raise InvalidCommandError(f"its time cannot be {shown(at)}")
    if not isinstance(line, str):
        raise InvalidCommandError(f"the name of a line cannot be {shown(line)}")
    if kind is SessionBegun:
        _expect_known_form(entry)
    return TraceEntry(float(at), line, _fact(kind, entry))


def _each_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    told = dict(pairs)
    if len(told) < len(pairs):
        raise ValueError("a name stands in it twice")
    return told


def _no_number(text: str) -> None:
    raise ValueError(f"{text} is no number")


def _expect_known_form(entry: Mapping[str, Any]) -> None:
    if entry.get("format") != FORMAT:
        raise InvalidCommandError(f"it is of the format {shown(entry.get('format'))}, not {FORMAT!r}")
    if entry.get("version") != VERSION:
        raise InvalidCommandError(
            f"it is of version {shown(entry.get('version'))}, and this program knows {VERSION}",
            hint="read it with the program that wrote it, or a newer one",
        )


def _fact(kind: type[Fact], entry: dict[str, Any]) -> Fact:
    given: dict[str, Any] = {}
    for field in fields(kind):
        if field.name in entry:
            read, wanted = _READERS[str(field.type)]
            try:
                given[field.name] = read(entry.pop(field.name))
            except (ValueError, KeyError):
                raise InvalidCommandError(f"{field.name} must be {wanted}") from None
        elif field.default is MISSING:
            raise InvalidCommandError(f"it says nothing of {field.name}")
    if entry:
        raise InvalidCommandError(f"it has no place for {', '.join(sorted(map(shown, islice(entry, _NAMES_SHOWN))))}")
    return kind(**given)


def _exactly(kind: type) -> Callable[[Any], Any]:
    def read(value: Any) -> Any:
        if type(value) is not kind:
            raise ValueError
        return value

    return read


def _count(value: Any) -> int:
    if type(value) is not int or not 0 <= value <= _MOST:
        raise ValueError
    return value


_text = _exactly(str)
_READERS: Final[Mapping[str, tuple[Callable[[Any], Any], str]]] = {
    "str": (_text, "a text"),
    "str | None": (_text, "a text"),
    "int": (_count, f"a whole number up to {_MOST}"),
    "int | None": (_count, f"a whole number up to {_MOST}"),
    "bool": (_exactly(bool), "true or false"),
    "bytes": (lambda value: _text(value).encode("latin-1"), "bytes, written as the characters of the same codes"),
    "Lane": (lambda value: Lane[_text(value).upper()], f"one of {', '.join(lane.name.lower() for lane in Lane)}"),
    "Way": (lambda value: Way(_text(value)), f"one of {', '.join(Way)}"),
    "Mapping[str, Any] | None": (_exactly(dict), "an object"),
}
"""By the type of a field, how it is read, and what it must be."""
