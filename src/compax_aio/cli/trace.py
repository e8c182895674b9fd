"""``compax trace``: what is in a recorded conversation, and whether the promises were kept in it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

from cyclopts import App, Parameter, validators
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from compax_aio import InvalidCommandError

from ..escaping import escaped
from ..link.taps import Asked, Ended, Lost, Opened, Ready, Received, Sent
from ..recording.trace_entries import Cut, Missing, SessionBegun, SessionEnded, TraceEntry
from ..recording.trace_reading import Conversation, conversations, read_trace
from ..simulator.hunt.recorded import Outcome, Verdict
from ..simulator.hunt.traces import check_drive
from ..simulator.smc_hunt.traces import check_party_line
from .conversing import begun_at
from .files import reading
from .interruption import moves_nothing
from .number_words import WHOLE
from .printing import Printing
from .replay import Trace

__all__ = ["LineInTrace", "SessionInTrace", "TraceInfo", "app"]

_BROKEN: Final = 1
_FINDINGS_SHOWN: Final = 10
_FAILURES: Final = frozenset({"AnswerTimeoutError", "ConnectionLostError", "UnexpectedAnswerError", "Rejected"})

_PROMISES: Final = {
    "P1": "one outstanding exchange a line",
    "P2": "a motion is written at most once",
    "P3": "everything asked ends in bounded time",
    "P4": "no answer goes to another question",
    "P5": "cancelling is safe, and stops the axis",
    "P6": "a stop is next",
    "P7": "trouble stays on its line",
    "P8": "memory is bounded",
    "P9": "only what the device can be told is written",
    "P10": "nothing is invented; who is there is looked at first",
}

app = App(name="trace", help="Check a recorded conversation against the promises, or say what is in it.")


# Info ---------------------------------------------------------------------------------------------------------------


@dataclass(kw_only=True)
class LineInTrace:
    """What a session has of one line."""

    line: str
    device: str
    """Empty: nobody said it."""
    asked: int = 0
    failed: int = 0
    """Of them: not answered, refused, lost."""
    sent_bytes: int = 0
    received_bytes: int = 0
    times_opened: int = 0
    times_lost: int = 0
    times_back: int = 0


@dataclass(kw_only=True)
class SessionInTrace:
    """What a trace has of one session."""

    session: int
    begun: str
    by: str
    lasted_s: float
    ending: str
    """``ended``, ``cut`` in the middle of a line, ``broken off`` between two, or ``goes on`` in a later part."""
    missing: int
    """Entries that were not written."""
    has_beginning: bool
    """It begins with the beginning of the session, and not with what was left of it when the trace was full."""
    lines: list[LineInTrace]


@dataclass(frozen=True, kw_only=True)
class TraceInfo:
    """What is in a trace."""

    trace: str
    entries: int
    sessions: list[SessionInTrace]


@app.command
@moves_nothing
def info(trace: Trace, *, printing: Printing = Printing()) -> None:  # noqa: B008 - it is frozen
    """
    Say what is in a trace: sessions, lines, devices, how long, how much, and where it was cut.

    ```sh
    compax trace info run.jsonl
    compax trace info run.jsonl --json
    ```
    """
    with reading(trace):
        told = _info(trace)
    printing.show(told, _info_for_people(told))


def _info(trace: Path) -> TraceInfo:
    sessions: list[SessionInTrace] = []
    lines: dict[str, LineInTrace] = {}
    entries = 0
    for entry in read_trace(trace):
        entries += 1
        if isinstance(entry.fact, SessionBegun) and (not sessions or entry.session != sessions[-1].session):
            lines = {}
            sessions.append(_session(entry, entry.fact))
            continue
        if not sessions:  # the file was cut within its first line
            continue
        current = sessions[-1]
        current.lasted_s = max(current.lasted_s, entry.at)
        match entry.fact:
            case Missing(entries=missing):
                current.missing += missing
            case Cut():
                current.ending = "cut"
            case SessionEnded():
                current.ending = "ended"
        if entry.line:
            if entry.line not in lines:
                lines[entry.line] = LineInTrace(line=entry.line, device=getattr(entry.fact, "device", ""))
                current.lines.append(lines[entry.line])
            _count(lines[entry.line], entry)
    return TraceInfo(trace=str(trace), entries=entries, sessions=sessions)


def _session(entry: TraceEntry, begun: SessionBegun) -> SessionInTrace:
    return SessionInTrace(
        session=entry.session,
        begun=begun.begun,
        by=begun.by,
        lasted_s=0.0,
        ending="broken off",
        missing=0,
        has_beginning=begun.part == 1,
        lines=[],
    )


def _count(line: LineInTrace, entry: TraceEntry) -> None:
    match entry.fact:
        case Asked():
            line.asked += 1
        case Ended(how=how) if how in _FAILURES:
            line.failed += 1
        case Sent(data=data):
            line.sent_bytes += len(data)
        case Received(data=data):
            line.received_bytes += len(data)
        case Opened():
            line.times_opened += 1
        case Lost(why=str()):
            line.times_lost += 1
        case Ready(times_opened=times) if times > 1:
            line.times_back += 1


def _info_for_people(told: TraceInfo) -> RenderableType:
    if not told.sessions:
        return Text(f"{escaped(told.trace)}: nothing is recorded there")
    return Group(*(part for session in told.sessions for part in _session_for_people(session)))


def _session_for_people(session: SessionInTrace) -> Iterator[RenderableType]:
    ending = {
        "ended": "",
        "cut": "; cut in the middle of a line, as by a crash: the rest is lost",
        "broken off": "; not ended: the program was killed, or still records",
    }[session.ending]
    yield Text(
        f"session {session.session}, begun {begun_at(session.begun)} by {escaped(session.by)}, "
        f"{session.lasted_s:.3f} s{ending}"
    )
    if not session.has_beginning:
        yield Text("  its beginning is not there: the trace was full", style="yellow")
    if session.missing:
        yield Text(f"  {session.missing} entries are missing: the disk was too slow, or full", style="bold red")
    table = Table(box=None, padding=(0, 2, 0, 0))
    for heading in ("  line", "device", "asked", "failed", "sent", "received", "opened", "lost", "back"):
        table.add_column(heading, justify="left" if heading in {"  line", "device"} else "right")
    for line in session.lines:
        counts = (line.asked, line.failed, line.sent_bytes, line.received_bytes)
        times = (line.times_opened, line.times_lost, line.times_back)
        table.add_row(f"  {escaped(line.line)}", escaped(line.device) or "unknown", *map(str, (*counts, *times)))
    yield table


# Check --------------------------------------------------------------------------------------------------------------


@app.command
@moves_nothing
def check(
    trace: Trace,
    *,
    line: Annotated[
        tuple[str, ...], Parameter(negative=(), help="Check only the line of this name; may be given several times.")
    ] = (),
    session: Annotated[
        int | None,
        WHOLE,
        Parameter(help="Check only this session, counted from 1.", validator=validators.Number(gte=1)),
    ] = None,
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> int:
    """
    Hold the promises against a recorded conversation.

    Says of each promise whether it held, was broken (where, and how), or cannot be told from a trace. The bytes are
    read by rules of their own, not by those of the client. The exit code is 1 if one was broken, else 0. Times are of
    the event loop: a program that stood still itself shows as a line that was idle.

    ```sh
    compax trace check run.jsonl
    compax trace check run.jsonl --line x --json
    ```
    """
    verdicts: list[Verdict] = []
    with reading(trace):
        for each in conversations(trace):  # one after the other: a trace may be larger than what fits in memory
            if _is_wanted(each, line, session):
                verdicts += _verdicts(each)
    if not verdicts:
        raise InvalidCommandError(
            "there is no such line in the trace" if line or session else "there is no line in the trace",
            hint="`compax trace info` says what is in it",
        )
    printing.show(verdicts, Group(*_for_people(verdicts)))
    return _BROKEN if any(each.findings for each in verdicts) else 0


def _is_wanted(conversation: Conversation, lines: tuple[str, ...], session: int | None) -> bool:
    return (not lines or conversation.line in lines) and session in {None, conversation.session}


def _verdicts(conversation: Conversation) -> Iterable[Verdict]:
    """Hold the promises against one conversation, by what the device's hunt knows."""
    checks = {"compax": check_drive, "smc": check_party_line}
    try:
        checked = checks.get(conversation.made.device, _unknown_device)(conversation)
    except InvalidCommandError as error:
        raise InvalidCommandError(
            f"line {conversation.line!r} of session {conversation.session} cannot be checked: {error.what}"
        ) from error
    return checked


def _unknown_device(conversation: Conversation) -> list[Verdict]:
    why = f"nobody knows the turns of a device of the kind {conversation.made.device!r}"
    return [Verdict(each, Outcome.UNKNOWN, conversation.session, conversation.line, why) for each in _PROMISES]


def _for_people(verdicts: list[Verdict]) -> Iterator[RenderableType]:
    heading = None
    for verdict in verdicts:
        if heading != (verdict.session, verdict.line):
            heading = verdict.session, verdict.line
            yield Text(f"session {verdict.session}, line {escaped(verdict.line)}", style="bold")
        yield _row(verdict)
        for finding in verdict.findings[:_FINDINGS_SHOWN]:
            older = " of the older file" if finding.is_older else ""
            yield Text(f"        line {finding.place}{older}, at {finding.at:.6f} s: {escaped(finding.how)}")
        if len(verdict.findings) > _FINDINGS_SHOWN:
            yield Text(f"        … and {len(verdict.findings) - _FINDINGS_SHOWN} more; --json has them all")
    counts = Counter(each.outcome for each in verdicts)
    summary = ", ".join(f"{counts[each]} {each.value}" for each in Outcome if counts[each])
    yield Text(f"{summary}.", style="bold red" if counts[Outcome.BROKEN] else "bold")


def _row(verdict: Verdict) -> Text:
    style = {Outcome.HELD: "green", Outcome.BROKEN: "bold red", Outcome.UNKNOWN: "dim"}[verdict.outcome]
    row = Text(f"  {verdict.promise:<4}")
    row.append(f"{verdict.outcome.value:<15}", style=style)
    if verdict.outcome is Outcome.UNKNOWN:
        return row.append(escaped(verdict.why), style="dim")
    row.append(_PROMISES[verdict.promise])
    if verdict.why:
        row.append(f" ({escaped(verdict.why)})", style="dim")
    return row
