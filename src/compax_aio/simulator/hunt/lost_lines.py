"""Promises about lines that are lost and opened again: P3, P5 and P10 once more, for what only they can break."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import pairwise
from math import inf
from typing import Final

from compax_aio.compax.events import ConnectionLost, ConnectionRestored
from compax_aio.compax.moves import MoveResult
from compax_aio.errors import ConnectionLostError, DriveFaultError, MoveError, MoveInDoubtError, MoveTimeoutError
from compax_aio.simulator.compax.log import LogKind

from .evidence import FORGES_TO_DRIVE, FORGES_TO_HOST, Case, Evidence, Outage
from .testimony import Call, WireKind, longest_opening_s
from .turns import Written

__all__ = ["bounded", "checked_before_motion", "works_again"]

_EPSILON_S: Final = 1e-6
_SETTING: Final = re.compile(r"(SD|AL-?)\d")
_STARTS: Final = re.compile(r"P[AR]-?\d[\d.]*\$?,?\Z|PH,?\Z")
_ASKS: Final = re.compile(r"[SPVN]\d{1,3}")
_IDENTITY: Final = {"S31", "S35", "S39"}
_SINGLE: Final = ("position", "target", "speed", "query", "parameter", "read_status", "record", "command S1")


# P3: bounded ------------------------------------------------------------------------------------------------------


def bounded(case: Case) -> Iterator[str]:
    """P3: what asks waits for a lost line as long as it was told, no longer; attempts are as many, and as rare."""
    for name, evidence in case.axes.items():
        yield from (f"{name}: {wrong}" for wrong in _events_in_order(evidence))
        if not evidence.settings.reconnect:
            continue
        for outage in evidence.outages:
            yield from (f"{name}: {wrong}" for wrong in _attempts(evidence, outage))
            for call in evidence.axis.calls:
                if call.what.startswith(_SINGLE) and (wrong := _patience(case, evidence, outage, call)):
                    yield f"{name}: {wrong}: {call}"


def _events_in_order(evidence: Evidence) -> Iterator[str]:
    events = [event for event in evidence.axis.events if isinstance(event, ConnectionLost | ConnectionRestored)]
    for count, (before, event) in enumerate(zip([None, *events], events, strict=False)):
        is_last = count == len(events) - 1
        if isinstance(event, ConnectionRestored):
            if not isinstance(before, ConnectionLost):
                yield f"the line was restored at {event.at:.4f}, and had not been lost"
            elif abs(event.at - before.at - event.lost_for_s) > _EPSILON_S or not event.attempts:
                yield f"lost at {before.at:.4f}, and told as restored: {event}"
        elif isinstance(before, ConnectionLost) and not (is_last and evidence.settings.reconnect_attempts is not None):
            yield f"the line was lost at {event.at:.4f}, and had not been restored"


def _attempts(evidence: Evidence, outage: Outage) -> Iterator[str]:
    settings = evidence.settings
    tried_at = [at for at, _ in evidence.attempts if outage.since < at <= outage.until]
    most = settings.reconnect_attempts
    if most is not None and len(tried_at) > most:
        yield f"it was lost at {outage.since:.4f}, and tried {len(tried_at)} times"
    shortest_s = min(settings.reconnect_first_s, settings.reconnect_slowest_s) / 2
    for before, after in pairwise(tried_at):
        if after - before < shortest_s - _EPSILON_S:
            yield f"it was tried at {before:.4f}, and {after - before:.4f} s later again"


def _patience(case: Case, evidence: Evidence, outage: Outage, call: Call) -> str | None:
    """Find who waited too long for a lost line, or was told too early that there is none."""
    assert call.ended_at is not None
    settings = evidence.settings
    until = outage.since + settings.in_doubt_after_s
    if call.asked_at < outage.until:
        # What is asked last before, or later, waits for the attempt that comes next.
        last = (end for at, end in evidence.attempts if max(until, call.asked_at) < at < outage.until)
        if call.ended_at > next(last, inf) + case.stalled_s + _EPSILON_S:
            return f"the line was lost at {outage.since:.4f}, and it waited for longer than was told"
    until = min(until, call.asked_at + settings.in_doubt_after_s)
    if not isinstance(call.outcome, ConnectionLostError) or evidence.was_closed(call.ended_at):
        return None
    is_early = outage.since - _EPSILON_S <= call.ended_at < min(until, outage.until) - _EPSILON_S
    if is_early and evidence.comes_back:
        return f"the line was lost at {outage.since:.4f}, and it was given up before {settings.in_doubt_after_s:g} s"
    return None


# P5: works again --------------------------------------------------------------------------------------------------


def works_again(case: Case) -> Iterator[str]:
    """P5: when no trouble is left, a line that is tried as long as it takes is there."""
    for name, evidence in case.axes.items():
        if not evidence.comes_back or evidence.was_closed(float("inf"), by_user=True):
            continue
        longest_s = longest_opening_s(evidence.settings)
        lost_at = evidence.outages[-1].since if evidence.outages and evidence.outages[-1].until == inf else inf
        for call in evidence.axis.calls:
            if call.what == "close" and call.item < 0 and call.asked_at >= lost_at + longest_s:
                yield f"{name}: it was lost at {lost_at:.4f}, and not opened again within {longest_s:.1f} s"


# P10: checked before motion ---------------------------------------------------------------------------------------


def checked_before_motion(case: Case) -> Iterator[str]:
    """P10: it is checked who is on the line before anything that can move is sent; settings are said again."""
    for name, evidence in case.axes.items():
        yield from (f"{name}: {wrong}" for wrong in _told_to_strangers(evidence))
        known: set[str] = set()
        for connection in _connections(evidence):
            yield from (f"{name}: {wrong}" for wrong in _not_greeted(evidence, connection, known))
        yield from (f"{name}: {wrong}" for wrong in _not_said_again(evidence))
        for outage in evidence.outages:
            if outage.signs:
                for call in evidence.axis.calls:
                    if wrong := _restart_ignored(evidence, outage, call):
                        yield f"{name}: {wrong}: {call}"


def _told_to_strangers(evidence: Evidence) -> Iterator[str]:
    stop = evidence.settings.dialect.stop
    is_forged = evidence.befell(*FORGES_TO_DRIVE)
    for stranger in evidence.axis.strangers:
        for entry in stranger.log:
            if entry.kind in {LogKind.MOTION_STARTED, LogKind.MOTION_CONTINUED}:
                yield f"another drive began {entry.text} at {entry.at:.4f}"
            elif entry.kind is LogKind.LINE and not (_ASKS.fullmatch(entry.text) or entry.text == stop or is_forged):
                yield f"another drive was told {entry.text!r} at {entry.at:.4f}"


def _connections(evidence: Evidence) -> Iterator[list[Written]]:
    """Part the lines by the connection that they were written on."""
    opened = [at for at, entry in enumerate(evidence.axis.wire) if entry.kind is WireKind.OPENED]
    lines = evidence.turns.lines
    at = 0
    for end in (*opened[1:], len(evidence.axis.wire) + 1):
        begin = at
        while at < len(lines) and lines[at].index < end:
            at += 1
        yield lines[begin:at]


def _not_greeted(evidence: Evidence, connection: list[Written], known: set[str]) -> Iterator[str]:
    """Find what was told on a new line before it was looked how the drive stands, and who it is, if that is known."""
    stop = evidence.settings.dialect.stop
    opened_at = connection[0].at if connection else 0.0
    wanted = {"S16", "S17"} | (known & _IDENTITY)
    for line in connection:
        if not (line.key or line.text == stop):
            is_forged = evidence.befell(*FORGES_TO_DRIVE, *FORGES_TO_HOST, since=opened_at, until=line.at)
            if wanted and not is_forged and not evidence.axis.plan.left_over:  # else what was asked was not understood
                yield f"{line.text!r} was written at {line.at:.4f} on a new line, and {sorted(wanted)} not asked before"
            return
        if line.over_at is not None:
            wanted.discard(line.text)
        if line.is_answered:
            known.add(line.text)


def _not_said_again(evidence: Evidence) -> Iterator[str]:
    """Find motions that went on a new line before the settings that are in force were said again."""
    if evidence.settings.binary_settings:
        return
    taken: set[str] = set()
    before: set[str] = set()
    for connection in _connections(evidence):
        missing = set(before)
        for line in connection:
            if found := _SETTING.match(line.text.replace(" ", "")):
                missing.discard(found[1])
                if line.is_acknowledged and _is_awaited(evidence, line):
                    taken.add(found[1])
            elif _STARTS.match(line.text):
                if missing:
                    yield f"{line.text!r} was written at {line.at:.4f} on a new line, {sorted(missing)} not said again"
                missing.clear()
        before = set(taken)


def _is_awaited(evidence: Evidence, line: Written) -> bool:
    """Whether the answer to a setting came while its caller waited for it: else nobody knows that it was taken."""
    for call in evidence.axis.calls:
        is_waiting = call.asked_at <= line.at and (call.ended_at is None or call.ended_at > (line.over_at or line.at))
        says = call.move.plan.settings_lines if call.move is not None else (call.detail,)
        if is_waiting and line.text in says:
            return True
    return False


def _restart_ignored(evidence: Evidence, outage: Outage, call: Call) -> str | None:
    """Find moves that were told as if the drive had not been switched off and on meanwhile, although it shows that."""
    move = call.move
    if move is None or move.sent is None or call.ended_at is None or move.started_at is None:
        return None
    if move.started_at < outage.since and outage.until < call.ended_at:
        is_taken_back = "was not taken" in str(getattr(call.outcome, "hint", ""))
        is_certain = isinstance(call.outcome, MoveError) and not isinstance(
            call.outcome, MoveInDoubtError | MoveTimeoutError | DriveFaultError
        )
        is_ours = any(
            other.what.startswith(("stop", "close")) and call.asked_at <= other.asked_at <= call.ended_at
            for other in evidence.axis.calls
        )
        if isinstance(call.outcome, MoveResult) or is_taken_back or (is_certain and not is_ours):
            return f"the drive was switched off and on while the line was lost ({outage.signs}), and nobody minded"
    return None
