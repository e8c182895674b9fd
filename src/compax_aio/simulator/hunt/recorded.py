"""A recorded conversation as the checks of promises read it: what was on the wire, who has asked, and what was told."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import pairwise
from math import inf
from typing import Final

from compax_aio.link.contract import Lane
from compax_aio.link.taps import Asked, Ended, LetGo, Lost, Noticed, Opened, Received, Resumed, Sent
from compax_aio.recording import Conversation, TraceEntry
from compax_aio.recording.trace_entries import Cut, Missing

from .testimony import WireEntry, WireKind

__all__ = [
    "NOT_IN_TRACES",
    "NO_ANSWER",
    "SLACK_S",
    "Finding",
    "Outcome",
    "RecordedLine",
    "Request",
    "Verdict",
    "settled",
]

SLACK_S: Final = 0.002
"""By so much the times of a trace may be late or early: timers of an event loop wake when they get their turn."""

NO_ANSWER: Final = frozenset({"AnswerTimeoutError", "ConnectionLostError"})

NOT_IN_TRACES: Final[Mapping[str, str]] = {
    "P5": "who was cancelled, and was to stop the axis, is not in a trace",
    "P7": "what else the program had to do is not in a trace",
    "P8": "how much memory was used is not in a trace",
}
"""By number, promises of which no trace can tell, and why."""


class Outcome(StrEnum):
    """What a trace says of a promise."""

    HELD = "held"
    BROKEN = "broken"
    UNKNOWN = "cannot be told"


@dataclass(frozen=True, slots=True)
class Finding:
    """Where a promise was broken, and how."""

    place: int
    """Line number in the file."""
    is_older: bool
    """It is in the older half of the trace."""
    at: float
    """Seconds since the session began."""
    how: str


@dataclass(frozen=True, slots=True)
class Verdict:
    """What one conversation says of one promise."""

    promise: str
    outcome: Outcome
    session: int
    line: str
    why: str = ""
    """Why it cannot be told, or what was looked at."""
    findings: tuple[Finding, ...] = ()


@dataclass(slots=True, eq=False)
class Request:
    """Something that was asked for, and what came of it."""

    number: int
    text: str
    lane: Lane
    party: str
    asked: TraceEntry
    index: int
    """How much had been on the wire when it was asked."""
    ended: TraceEntry | None = None
    how: str = ""
    answer: str | None = None
    written: list[int] = field(default_factory=list)
    """Where on the wire it was written."""

    @property
    def until(self) -> float:
        """When it ended; never, if that is not in the trace."""
        return inf if self.ended is None else self.ended.at


class RecordedLine:
    """
    What is known of a line, as far as it is known without a gap.

    Args:
        conversation: What was recorded of it.

    Attributes:
        wire: What was written and read, and when it was opened and lost.
        requests: All that was asked for, in order.
        noticed: What the client said that it has read, each with how much had been on the wire.
        resumed_at: When somebody said that half a frame does no harm.
        broken_off: Why nothing is known from some place on; empty if all is.
        until: Time of the last entry.
    """

    def __init__(self, conversation: Conversation) -> None:
        self.conversation = conversation
        self.wire: list[WireEntry] = []
        self.requests: list[Request] = []
        self.noticed: list[tuple[int, TraceEntry, Noticed]] = []
        self.resumed_at: list[float] = []
        self.broken_off = ""
        self.until = 0.0
        self._places: list[TraceEntry] = []
        self._by_number: dict[int, Request] = {}
        self._ends: list[int] = []
        self._openings: list[tuple[int, bool]] = []
        for entry in self._known():
            self._take(entry)

    def _known(self) -> Iterator[TraceEntry]:
        """Give the entries from the first opening on, until something is missing."""
        is_known = not self.conversation.made.is_open and self.conversation.begun.part == 1
        for entry in self.conversation.entries:
            is_known = is_known or isinstance(entry.fact, Opened)
            if isinstance(entry.fact, Missing | Cut):
                self.broken_off = f"entries are missing from {entry.where} on"
                return
            if is_known:
                yield entry

    def _take(self, entry: TraceEntry) -> None:
        self.until = entry.at
        match entry.fact:
            case Opened():
                self._openings.append((len(self.wire), True))
                self._note(entry, WireKind.OPENED)
            case Sent(data=data, number=number):
                if number is not None and number in self._by_number:
                    self._by_number[number].written.append(len(self.wire))
                self._note(entry, WireKind.WRITTEN, data)
            case Received(data=data):
                self._note(entry, WireKind.READ, data)
            case LetGo() | Lost():
                kind = WireKind.LOST if isinstance(entry.fact, Lost) else WireKind.CLOSED
                self._ends.append(len(self.wire))
                self._openings.append((len(self.wire), False))
                self._note(entry, kind)
            case Asked(number=number, text=text, lane=lane, party=party):
                request = Request(number, text, lane, party, entry, len(self.wire))
                self.requests.append(request)
                self._by_number[number] = request
            case Ended(number=number, how=how, text=answer) if number in self._by_number:
                request = self._by_number[number]
                request.ended, request.how, request.answer = entry, how, answer
            case Noticed():
                self.noticed.append((len(self.wire), entry, entry.fact))
            case Resumed():
                self.resumed_at.append(entry.at)

    def _note(self, entry: TraceEntry, kind: WireKind, data: bytes = b"") -> None:
        self.wire.append(WireEntry(entry.at, kind, data))
        self._places.append(entry)

    def at(self, index: int, how: str) -> Finding:
        """Make a finding of what happened on the wire at *index*."""
        return self.of(self._places[min(index, len(self._places) - 1)], how)

    @staticmethod
    def of(entry: TraceEntry, how: str) -> Finding:
        """Make a finding of an entry."""
        return Finding(entry.place, entry.is_older, entry.at, how)

    def is_open(self, index: int) -> bool:
        """Whether there was a line before what happened on the wire at *index*."""
        place = bisect_left(self._openings, (index, False)) - 1
        return place >= 0 and self._openings[place][1]

    def was_lost(self, first: int, end: int) -> bool:
        """Whether the line went away between two places on the wire."""
        place = bisect_left(self._ends, first)
        return place < len(self._ends) and self._ends[place] < end

    def outages(self) -> Iterator[tuple[float, float]]:
        """Give the times in which there was no line."""
        since = 0.0
        is_open = False
        for entry in self.wire:
            if entry.kind is WireKind.OPENED:
                yield since, entry.at
                is_open = True
            elif entry.kind in {WireKind.LOST, WireKind.CLOSED} and is_open:
                since, is_open = entry.at, False
        if not is_open:
            yield since, inf


# P3, of any device --------------------------------------------------------------------------------------------------


def settled(line: RecordedLine, idle_s: float, lost_s: float) -> Iterator[Finding]:
    """
    P3: what was asked for ends in bounded time.

    Args:
        line: What was seen.
        idle_s: While somebody waits on a line that is there, something is written or read this often.
        lost_s: So long a line that is lost is waited for at most.
    """
    times = [entry.at for entry in line.wire if entry.kind in {WireKind.WRITTEN, WireKind.READ, WireKind.OPENED}]
    outages = list(line.outages())
    for request in line.requests:
        until = min(request.until, line.until)
        since = request.asked.at
        first, end = bisect_left(times, since), bisect_left(times, until)
        moments = [since, *times[first:end], until]
        for before, after in pairwise(moments):
            out_s = sum(max(0.0, min(after, end_at) - max(before, begin_at)) for begin_at, end_at in outages)
            if out_s > lost_s + SLACK_S:
                yield line.of(request.asked, f"{request.text!r} waited {out_s:.3f} s for a line that was lost")
                break
            if not out_s and after - before > idle_s + SLACK_S:
                yield line.of(
                    request.asked,
                    f"{request.text!r} waited {after - before:.3f} s, from {before:.3f} on, while the line was idle "
                    "or the program stood still",
                )
                break
