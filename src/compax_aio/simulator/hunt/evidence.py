"""What the far end of an axis has really said and done, and which troubles may have forged what came of it."""

from __future__ import annotations

import re
from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

from compax_aio.compax.events import ConnectionLost, ConnectionRestored
from compax_aio.compax.facts.line import XOFF, XON
from compax_aio.simulator.compax.log import LogEntry, LogKind

from .testimony import Call, Seen, SeenAxis, WireEntry, WireKind
from .turns import Turns, Ways

__all__ = ["FORGES_TO_DRIVE", "FORGES_TO_HOST", "Case", "Evidence", "Outage", "Said", "normal"]

_NUMBER: Final = re.compile(r"[:=]\s*([-+]?)\s*(\d+(?:\.\d*)?|\.\d+)")

FORGES_TO_HOST: Final = (
    "flip to_host",
    "lose to_host",
    "garble to_host",
    "double to_host",
    "insert to_host",
    "repeated to_host",
    "noise begins",
    "flood begins",
)
FORGES_TO_DRIVE: Final = (
    "flip to_drive",
    "lose to_drive",
    "garble to_drive",
    "double to_drive",
    "insert to_drive",
    "another host to_drive",
)


_NOT_TEXT: Final = bytes({0, XON, XOFF})


@dataclass(frozen=True, slots=True)
class Said:
    """One answer of the drive."""

    asked_at: float
    """When the line that it answers had arrived."""
    said_at: float
    text: str
    """Without blanks that mean nothing."""

    @property
    def number(self) -> float | None:
        """The number behind the colon."""
        found = _NUMBER.search(self.text)
        return float(f"{found[1]}{found[2]}") if found else None


class Outage(NamedTuple):
    """A time in which a line was lost, as the client has told it."""

    since: float
    until: float
    """Infinity: it was not restored."""
    signs: tuple[str, ...] = ()
    """That the drive was switched off and on, as the client has told it."""


class Evidence:
    """
    The evidence of one axis; a day's worth of it is looked up by time, not gone through.

    Args:
        axis: What was seen of it.
    """

    def __init__(self, axis: SeenAxis) -> None:
        self.axis = axis
        self.name = axis.plan.axis
        self.settings = axis.plan.settings
        ends = {WireKind.LOST, WireKind.CLOSED}
        self._ends_at = [entry.at for entry in axis.wire if entry.kind in ends]
        self._openings = [
            (at, entry.kind) for at, entry in enumerate(axis.wire) if entry.kind in ends | {WireKind.OPENED}
        ]
        self._befell = [entry for entry in axis.wire if entry.kind is WireKind.BEFELL]
        self.lost_at = min(self._ends_at, default=float("inf"))
        """When its line was closed, or lost, for the first time."""

    # The line ---------------------------------------------------------------------------------------------------------

    def was_lost(self, since: float, until: float) -> bool:
        """Whether its line was closed or lost from *since* to *until*."""
        at = bisect_left(self._ends_at, since)
        return at < len(self._ends_at) and self._ends_at[at] <= until

    def is_open(self, index: int) -> bool:
        """Whether, before what happened at *index*, there was a line."""
        at = bisect_left(self._openings, index, key=lambda opening: opening[0])
        return at > 0 and self._openings[at - 1][1] is WireKind.OPENED

    @cached_property
    def comes_back(self) -> bool:
        """Whether a lost line is opened again, however long that takes, until the drive is closed."""
        settings = self.settings
        return settings.reconnect and settings.reconnect_attempts is None

    @cached_property
    def outages(self) -> list[Outage]:
        """The times in which its line was lost and tried again."""
        outages: list[Outage] = []
        for event in self.axis.events:
            if isinstance(event, ConnectionLost) and (not outages or outages[-1].until < float("inf")):
                outages.append(Outage(event.at, float("inf")))
            elif isinstance(event, ConnectionRestored) and outages:
                outages[-1] = Outage(outages[-1].since, event.at, event.signs_of_restart)
        return outages

    @cached_property
    def attempts(self) -> list[tuple[float, float]]:
        """When it was tried to open its line, and when that attempt, or the line that came of it, ended."""
        attempts = []
        for entry in self.axis.wire:
            if entry.kind is WireKind.OPENED:
                at = bisect_left(self._ends_at, entry.at)
                attempts.append((entry.at, self._ends_at[at] if at < len(self._ends_at) else float("inf")))
            elif entry.kind is WireKind.BEFELL and entry.text == "refused":
                attempts.append((entry.at, entry.at))
        return attempts

    def was_closed(self, at: float, *, by_user: bool = False) -> bool:
        """Whether its drive had been closed *at* that time; *by_user*, not because all was over."""
        return any(
            call.what == "close" and call.asked_at <= at and not (by_user and call.item < 0) for call in self.axis.calls
        )

    def is_out(self, since: float, until: float) -> bool:
        """Whether its line was lost, or closed, at any time from *since* to *until*."""
        return self.was_lost(since, until) or any(each.since <= until and each.until >= since for each in self.outages)

    def befallen(self, since: float, until: float) -> Iterator[WireEntry]:
        """List what troubles did from *since* to *until*."""
        first = bisect_left(self._befell, since, key=lambda entry: entry.at)
        for at in range(first, len(self._befell)):
            if self._befell[at].at > until:
                return
            yield self._befell[at]

    def befell(self, *words: str, since: float = 0.0, until: float = float("inf")) -> bool:
        """Whether a trouble whose text begins with one of *words* did something from *since* to *until*."""
        return any(entry.text.startswith(words) for entry in self.befallen(since, until))

    @cached_property
    def turns(self) -> Turns:
        """The turns of its line."""
        calls = self.axis.calls
        ways = Ways(
            stop=self.settings.dialect.stop,
            decimals=self.settings.decimals,
            answer_timeout_s=self.settings.answer_timeout_s,
            numbers_follow=self.axis.plan.knobs.comparator_form == "prompt_first",
            reconciled_at=[call.asked_at for call in calls if call.what == "reconcile"],
        )
        return Turns(self.axis.wire, ways)

    # The drive --------------------------------------------------------------------------------------------------------

    @cached_property
    def said(self) -> list[Said]:
        """All answers that the drive gave, also those that got lost on their way."""
        said = []
        asked_at = 0.0
        for entry in self.axis.log:
            if entry.kind is LogKind.LINE:
                asked_at = entry.at
            elif entry.kind in {LogKind.ANSWER, LogKind.LOST}:
                said.append(Said(asked_at, entry.at, normal(entry.text)))
        return said

    @cached_property
    def _by_key(self) -> dict[str, list[Said]]:
        by_key: dict[str, list[Said]] = {}
        for said in self.said:
            by_key.setdefault(said.text.partition(":")[0], []).append(said)
        return by_key

    def answers_to(self, query: str, since: float, until: float) -> Iterator[Said]:
        """List what the drive has answered to a query, ``S1``, that came after *since*, until *until*; last first."""
        said = self._by_key.get(f"{query[0]}{int(query[1:]):03d}", [])
        for at in range(bisect_right(said, until, key=lambda each: each.said_at) - 1, -1, -1):
            if said[at].asked_at < since:
                return
            yield said[at]

    @cached_property
    def _read(self) -> list[WireEntry]:
        return [entry for entry in self.axis.wire if entry.kind is WireKind.READ]

    def heard(self, since: float, until: float) -> str:
        """Return what has come to the client, whoever has said it, from *since* to *until*."""
        first = bisect_left(self._read, since, key=lambda entry: entry.at)
        last = bisect_right(self._read, until, key=lambda entry: entry.at)
        return b"".join(entry.data for entry in self._read[first:last]).translate(None, _NOT_TEXT).decode("latin-1")

    @cached_property
    def _by_kind(self) -> dict[LogKind, list[LogEntry]]:
        by_kind: dict[LogKind, list[LogEntry]] = {kind: [] for kind in LogKind}
        for entry in self.axis.log:
            by_kind[entry.kind].append(entry)
        return by_kind

    def happened(self, *kinds: LogKind, since: float = 0.0, until: float = float("inf")) -> list[LogEntry]:
        """List what the drive did from *since* to *until*, kind by kind."""
        happened: list[LogEntry] = []
        for kind in kinds:
            entries = self._by_kind[kind]
            first = bisect_left(entries, since, key=lambda entry: entry.at)
            happened += entries[first : bisect_right(entries, until, key=lambda entry: entry.at)]
        return happened

    # What excuses -----------------------------------------------------------------------------------------------------

    def may_be_forged(self, call: Call) -> bool:
        """Whether what the drive said may have been changed before the caller of *call* was told of it."""
        return self.is_forged(call.asked_at, call.ended_at or float("inf"))

    def is_forged(self, since: float, until: float) -> bool:
        """Whether what the drive said from *since* to *until* may have been changed."""
        return self.befell(*FORGES_TO_HOST, since=since - 2 * self.settings.answer_timeout_s, until=until)

    def may_be_misheard(self, call: Call) -> bool:
        """Whether what was said on behalf of *call* may have arrived as something else."""
        since = self._before(call)
        return self.befell(*FORGES_TO_DRIVE, since=since, until=call.ended_at or float("inf")) or (
            bool(self.axis.plan.left_over) and call.what == "connect"
        )

    def _before(self, call: Call) -> float:
        # A doubled answer, or half a line, may lie in wait until the line is used again.
        return call.asked_at - 2 * self.settings.answer_timeout_s


def normal(text: str) -> str:
    """Leave out blanks that mean nothing."""
    return " ".join(text.split())


class Case:
    """
    All that is held against the promises.

    Args:
        testimony: What was seen.
    """

    def __init__(self, testimony: Seen) -> None:
        self.testimony = testimony
        self.scenario = testimony.scenario
        self.axes = {name: Evidence(axis) for name, axis in testimony.axes.items()}
        self.stalled_s: float = sum(
            trouble.arguments["stall_s"] for trouble in self.scenario.troubles if trouble.kind == "stall"
        )
        """How long the event loop stood still in all."""

    def troubled(self, axis: str) -> bool:
        """Whether any trouble concerns *axis*."""
        return any(axis in trouble.axes or not trouble.axes for trouble in self.scenario.troubles)
