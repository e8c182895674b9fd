"""A recorded conversation as rows for people: when, which line, what went over it, and what it meant."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Final

from rich.text import Text

from ..escaping import escaped, shown
from ..link.contract import Lane
from ..link.taps import (
    Asked,
    Closed,
    Ended,
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
from ..link.wire import readable
from ..recording.trace_entries import Cut, LineMade, Missing, SessionBegun, SessionEnded, TraceEntry

__all__ = ["HEADING", "Rows", "begun_at"]

_BYTES_SHOWN: Final = 200
_WIDEST_DATA: Final = 36
_WIDEST_NAME: Final = 12
_NOTABLE_WAIT_S: Final = 0.001
_LONG_GAP_S: Final = 1.0
_LONGEST_ROW: Final = 1000
"""Characters of what goes out piece by piece, before a new row begins."""
_MOST_REMARKS: Final = 20
_MOST_ASKED: Final = 1000
"""So many that nobody has been answered are remembered; no line has as many waiting."""

HEADING: Final = f"{'time':>12}  {'after':>9}  {'line':<{_WIDEST_NAME}}    what went over it"

_WAYS: Final = {
    Way.MARKER: "to get in step",
    Way.AHEAD: "ahead, although in doubt",
    Way.PREEMPT: "out of turn, heeded at any time",
}
_TROUBLE: Final = frozenset(
    {"Rejected", "Stray", "LateEnding", "UnexpectedAnswer", "EntryFailed", "CutShort", "Damaged"}
)


@dataclass(slots=True)
class _Row:
    at: float
    line: str
    mark: str
    text: str
    style: str
    remarks: list[tuple[str, str]] = field(default_factory=list)
    """Each with its style."""
    piece: bytes = b""
    """What was sent last."""
    echo: _Row | None = None
    """It has come back."""


class Rows:
    """
    Turns entries into rows, as they come; what an answer meant stands in its row.

    What goes out piece by piece, each when the one before it has come back, is one row.

    Args:
        shows_lines: Whether the name of the line stands in each row.
    """

    def __init__(self, *, shows_lines: bool = True) -> None:
        self._shows_lines = shows_lines
        self._row: _Row | None = None
        self._before: float | None = None
        self._asked: dict[tuple[str, int], tuple[float, str]] = {}

    def take(self, entry: TraceEntry) -> Iterator[Text]:
        """Take an entry; give the rows that are complete by it."""
        if self._joined(entry):
            return
        row = self._row_of(entry)
        if row is not None:
            yield from self.end()
            self._row = row
        else:
            yield from self._remark(entry)

    def end(self) -> Iterator[Text]:
        """Give the row that may still wait."""
        row, self._row = self._row, None
        while row is not None:
            yield self._written(row)
            self._before = row.at
            row = row.echo

    def _joined(self, entry: TraceEntry) -> bool:
        """Take what only goes on with the row that waits: an echo, or the piece behind one."""
        row, fact = self._row, entry.fact
        if row is None or row.line != entry.line or not row.piece:
            return False
        if isinstance(fact, Received) and row.echo is None and fact.data == row.piece:
            row.echo = _Row(entry.at, entry.line, "←", _shown(fact.data), "green")
            return True
        is_next = row.echo is not None and not row.echo.remarks and len(row.text) < _LONGEST_ROW
        if isinstance(fact, Sent) and fact.way is Way.GOES_ON and is_next:
            row.text, row.piece, row.echo = row.text + _shown(fact.data), fact.data, None
            return True
        return False

    # Rows -----------------------------------------------------------------------------------------------------------

    def _row_of(self, entry: TraceEntry) -> _Row | None:
        """Begin a row, if *entry* is worth one."""
        at, line, fact = entry.at, entry.line, entry.fact
        match fact:
            case Sent(data=data):
                row = _Row(at, line, "→", _shown(data), "cyan", piece=data)
                row.remarks += self._of_sending(entry, fact)
                return row
            case Received(data=data):
                return _Row(at, line, "←", _shown(data), "green")
            case Asked(lane=Lane.STOP, text=text, number=number):
                self._remember(entry, number, text)
                return _Row(at, line, "!", f"{escaped(text)} is asked for", "bold")
            case SessionBegun():
                self._before = None
                self._asked.clear()
        told = _plainly(fact)
        return None if told is None else _Row(at, line, "·", *told)

    def _of_sending(self, entry: TraceEntry, sent: Sent) -> Iterator[tuple[str, str]]:
        if sent.way in _WAYS:
            yield _WAYS[sent.way], "yellow"
        asked = self._asked.get((entry.line, sent.number)) if sent.number is not None else None
        if asked is not None and entry.at - asked[0] > _NOTABLE_WAIT_S:
            yield f"waited {_duration(entry.at - asked[0])}", "yellow"

    def _remark(self, entry: TraceEntry) -> Iterator[Text]:
        """Say what was noticed or told: in the row that waits if it is of the same moment and line, else in its own."""
        match entry.fact:
            case Asked(number=number, text=text):
                self._remember(entry, number, text)
                return
            case Noticed(event=event, details=details):
                remark = _event(event, details or {})
            case Ended(number=number, how=how, text=answer):
                _, asked = self._asked.pop((entry.line, number), (0.0, f"no. {number}"))
                if not (how.endswith("Error") or how == "cancelled"):
                    return  # it was noticed, and told by that
                remark = _ending(asked, how, answer)
            case _:
                return
        row = self._row.echo or self._row if self._row is not None else None
        is_full = row is not None and len(row.remarks) >= _MOST_REMARKS
        if row is None or row.line != entry.line or is_full or entry.at - row.at > _NOTABLE_WAIT_S:
            yield from self.end()
            row = self._row = _Row(entry.at, entry.line, " ", "", "")
        row.remarks.append(remark)

    def _remember(self, entry: TraceEntry, number: int, text: str) -> None:
        self._asked[entry.line, number] = entry.at, text
        if len(self._asked) > _MOST_ASKED:
            del self._asked[next(iter(self._asked))]

    def _written(self, row: _Row) -> Text:
        after = "" if self._before is None else f"+{_duration(row.at - self._before)}"
        is_long = self._before is not None and row.at - self._before >= _LONG_GAP_S
        told = Text(f"{row.at:12.6f}  ", style="dim")
        told.append(f"{after:>9}  ", style="bold yellow" if is_long else "dim")
        if self._shows_lines:
            told.append(f"{_short(row.line):<{_WIDEST_NAME}} ")
        told.append(f"{row.mark} ", style=row.style)
        told.append(f"{row.text:<{_WIDEST_DATA}}" if row.remarks else row.text, style=row.style)
        for number, (text, style) in enumerate(row.remarks):
            told.append("; " if number else " ")
            told.append(text, style=style)
        told.rstrip()
        return told


def _plainly(fact: Any) -> tuple[str, str] | None:  # noqa: C901, PLR0911, PLR0912 - one row each
    """Say what happened to the line, or to the recording, and in which style; None if that is no row of its own."""
    match fact:
        case SessionBegun(begun=begun, by=by, part=part):
            goes_on = " goes on here" if part > 1 else ""
            return f"session of {begun_at(begun)}, {escaped(by)}{goes_on}", "bold"
        case LineMade(device=device):
            return f"a line{f' to a device of the kind {escaped(device)}' if device else ''}", "dim"
        case Opening(url=url):
            return f"opening {escaped(url)}", "magenta"
        case Refused(why=why):
            return f"not opened: {escaped(why)}", "bold red"
        case Opened():
            return "open", "magenta"
        case Ready(times_opened=times):
            return "ready" if times == 1 else "ready again", "magenta"
        case LetGo():
            return "let go of", "magenta"
        case Lost(why=why):
            return ("ended", "magenta") if why is None else (f"lost: {escaped(why)}", "bold red")
        case Closed():
            return "closed for good", "magenta"
        case Resumed():
            return "a person says that nothing can happen", "yellow"
        case Missing(entries=entries):
            return f"{entries} entries are missing here: the disk was too slow, or full", "bold red"
        case Cut(text=text):
            return f"cut off in the middle of a line: {escaped(text[:_WIDEST_DATA])}", "bold red"
        case SessionEnded():
            return "the recording was ended", "bold"
    return None


def begun_at(begun: str) -> str:
    """Write when a session began, for people: to the second."""
    try:
        return datetime.fromisoformat(begun).isoformat(" ", "seconds")
    except ValueError:
        return escaped(begun)


def _event(event: str, details: Any) -> tuple[str, str]:
    """Say an event in words, with what is not seen from the bytes."""
    words = _words(event)
    if event == "Rejected":
        words += f", E{_told(details.get('code'))}"
    elif event == "LateEnding":
        words = f"late: answers {_told(details.get('sent'))!r}, whose time was over"
    elif event == "ComparatorReached":
        words += f" {_told(details.get('number'))}"
    style = "red" if event in _TROUBLE else "green" if event == "PositionReached" else "dim"
    return words, style


def _told(detail: Any) -> str:
    """Write what should be a number or a text, whatever it is."""
    return detail if isinstance(detail, str) and detail.isprintable() else shown(detail)


def _ending(asked: str, how: str, answer: str | None) -> tuple[str, str]:
    if how == "cancelled":
        return f"{escaped(asked)!r} was given up by who had asked", "yellow"
    return f"{escaped(asked)!r} failed: {escaped(how)}: {escaped(answer or '')}", "red"


def _words(name: str) -> str:
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", escaped(name)).lower()


def _shown(data: bytes) -> str:
    more = f" … and {len(data) - _BYTES_SHOWN} bytes" if len(data) > _BYTES_SHOWN else ""
    return readable(data[:_BYTES_SHOWN]) + more


def _short(name: str) -> str:
    name = escaped(name)
    return name if len(name) <= _WIDEST_NAME else f"{name[: _WIDEST_NAME - 1]}…"


def _duration(seconds: float) -> str:
    if seconds < 0.9995:
        return f"{seconds * 1000:.1f} ms"
    return f"{seconds:.3f} s" if seconds < 1000 else f"{seconds:.0f} s"
