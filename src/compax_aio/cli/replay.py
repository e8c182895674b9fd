"""``compax replay``: a recorded conversation as it went, at once or in its own time."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Final

from cyclopts import Parameter, validators
from rich.console import Console
from rich.text import Text

from compax_aio import InvalidCommandError

from ..escaping import shown
from ..recording.trace_entries import Cut, LineMade, Missing, SessionBegun, TraceEntry
from ..recording.trace_reading import read_trace
from .conversing import HEADING, Rows
from .files import reading
from .interruption import moves_nothing, say_at_end
from .number_words import NUMBER, WHOLE
from .printing import Printing, results_console

__all__ = ["Trace", "replay"]

_NAMES_SHOWN: Final = 20

Trace = Annotated[
    Path, Parameter(name="TRACE", help="Trace, as --trace of other commands and record_trace() write it.")
]


@moves_nothing
async def replay(
    trace: Trace,
    *,
    line: Annotated[
        tuple[str, ...], Parameter(negative=(), help="Show only the line of this name; may be given several times.")
    ] = (),
    session: Annotated[
        int | None, WHOLE, Parameter(help="Show only this session, counted from 1.", validator=validators.Number(gte=1))
    ] = None,
    from_: Annotated[
        float | None, NUMBER, Parameter(name="--from", help="Begin at so many seconds of each session.")
    ] = None,
    until: Annotated[float | None, NUMBER, Parameter(help="End at so many seconds of each session.")] = None,
    speed: Annotated[
        float | None,
        NUMBER,
        Parameter(
            help="Show it in its own time, this many times as fast: 1 as it went. Without it all is shown at once.",
            validator=validators.Number(gt=0),
        ),
    ] = None,
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    Show a recorded conversation as it went.

    Each row has the time since the session began, how long after the row before it came, the line, and what went over
    it: → what was sent, ← what came, with control characters as pictures (␍ is CR), and what the program made of it.
    What goes out character by character, each echoed, is one row; --json has every piece.

    Nothing is sent anywhere. To let a program talk to the recorded drive, connect it to replay:///path/to/TRACE.

    ```sh
    compax move sim://compax 100 --trace run.jsonl
    compax replay run.jsonl
    compax replay run.jsonl --line x --from 12.5 --until 20 --speed 1
    compax replay run.jsonl --json | jq 'select(.what == "Lost")'
    ```
    """
    if from_ is not None and until is not None and until < from_:
        raise InvalidCommandError(f"--until {until:g} is before --from {from_:g}")
    part = _Part(set(line), session, from_, until)
    entries = _wanted(trace, part)
    if printing.json:
        async for entry in _in_time(entries, speed):
            printing.show(_document(entry))
    else:
        await _show(entries, speed)
    if session is not None and session > part.sessions:
        raise InvalidCommandError(
            f"the trace has no session {session}",
            hint=f"it has {part.sessions or 'none'}; `compax trace info` says more",
        )
    if missing := part.lines - part.names:
        raise InvalidCommandError(
            f"the trace has no line {', '.join(map(repr, sorted(missing)))}",
            hint=f"it has {_some(part.names) or 'none'}; `compax trace info` says more",
        )


def _some(names: set[str]) -> str:
    return ", ".join(map(shown, sorted(names)[:_NAMES_SHOWN])) + (" …" if len(names) > _NAMES_SHOWN else "")


def _entries(trace: Path) -> Iterator[TraceEntry]:
    with reading(trace):  # and not around what is done with them, which has errors of its own
        yield from read_trace(trace)


@dataclass
class _Part:
    """What of a trace is to be shown, and what there is of that kind."""

    lines: set[str]
    session: int | None
    begin: float | None
    until: float | None
    names: set[str] = field(default_factory=set)
    sessions: int = 0

    def has(self, entry: TraceEntry) -> bool:
        if self.session not in {None, entry.session} or (self.lines and entry.line and entry.line not in self.lines):
            return False
        if isinstance(entry.fact, SessionBegun | Missing | Cut):
            return True
        return (self.begin is None or entry.at >= self.begin) and (self.until is None or entry.at <= self.until)


def _wanted(trace: Path, part: _Part) -> Iterator[TraceEntry]:
    """Give the entries that are to be shown, and note in *part* which lines and sessions there are."""
    for entry in _entries(trace):
        part.sessions = entry.session
        if isinstance(entry.fact, LineMade):
            part.names.add(entry.line)
        if part.has(entry):
            yield entry


async def _in_time(entries: Iterator[TraceEntry], speed: float | None) -> Any:
    """Give the entries, and wait between them as long as it took, if that is wanted."""
    loop = asyncio.get_running_loop()
    origin: float | None = None
    session, goes_on = 0, False
    for number, entry in enumerate(entries):
        if entry.session != session:
            session, origin = entry.session, None
        if isinstance(entry.fact, SessionBegun):
            goes_on = entry.fact.part > 1
        elif isinstance(entry.fact, Cut) or (goes_on and isinstance(entry.fact, LineMade) and not entry.at):
            pass  # where a session goes on in another file its lines are told again, without their time
        elif speed is not None:
            if origin is None:
                origin = loop.time() - entry.at / speed
            await asyncio.sleep(max(0.0, origin + entry.at / speed - loop.time()))
        elif number % 1000 == 0:
            await asyncio.sleep(0)  # so that Ctrl-C is heeded
        yield entry


async def _show(entries: Iterator[TraceEntry], speed: float | None) -> None:
    console: Console = results_console()
    rows = Rows()
    is_first = True
    say_at_end("Interrupted. This was a recording: nothing was sent to anybody.")
    async for entry in _in_time(entries, speed):
        if is_first:
            console.print(Text(HEADING, style="bold"))
            is_first = False
        for row in rows.take(entry):
            console.print(row, soft_wrap=True)
    for row in rows.end():
        console.print(row, soft_wrap=True)
    if is_first:
        console.print(Text("Nothing is recorded there."))


def _document(entry: TraceEntry) -> dict[str, Any]:
    """Write an entry for programs: bytes as the characters of the same codes, as in the trace."""
    told: dict[str, Any] = {
        "session": entry.session,
        "place": entry.place,
        "is_older": entry.is_older,
        "at": entry.at,
        "line": entry.line,
        "what": type(entry.fact).__name__,
    }
    for name in type(entry.fact).__dataclass_fields__:
        value = getattr(entry.fact, name)
        told[name] = value.decode("latin-1") if isinstance(value, bytes) else value
    return told
