"""Promises about what callers are told: P3 settled, P4 answers, P5 cancelling, P8 memory, P10 nothing invented."""

from __future__ import annotations

import re
from asyncio import CancelledError
from collections.abc import Iterator
from itertools import pairwise
from typing import Any, Final

from compax_aio.compax.codecs import DriveStatus
from compax_aio.compax.events import ComparatorPassed, Fault, PositionMessage
from compax_aio.compax.moves import MoveResult
from compax_aio.errors import (
    CommandRejectedError,
    CompaxError,
    ConnectionLostError,
    DriveFaultError,
)
from compax_aio.simulator.compax.log import LogKind

from .evidence import Case, Evidence, normal
from .on_the_wire import stops_already
from .testimony import Call
from .troubles import TROUBLES

__all__ = ["bounded_memory", "nothing_invented", "own_answers", "safe_to_cancel", "settled"]

_EPSILON_S: Final = 1e-6
_TOLERANCE: Final = 0.0511
"""By so much may the axis stand beside its target: five of the last of two decimals."""
_LONGEST_TRAVEL_S: Final = 400.0
_HEAVIEST_DRIVE: Final = 64_000
"""Bytes; one that nothing befell keeps two thirds of that, one whose line was lost its last error as well."""

_LONGEST_TOLD: Final = 400

_NUMBERS: Final = re.compile(r"([-+]?)\s*(\d+(?:\.\d*)?|\.\d+)")
_LONGEST_READING_S: Final = 600.0
"""From the first value of a reading to the last, at most: half of a line in trouble."""
_MARKERS_AGAIN: Final = 2
"""While answers come, late, there may be as many markers again."""

_SINGLE: Final = ("position", "target", "speed", "error", "query", "parameter", "read_status", "record", "command S1")
"""Calls that ask one line."""


# P3 ---------------------------------------------------------------------------------------------------------------


def settled(case: Case) -> Iterator[str]:
    """P3: everything awaited settles in bounded time, with a result or one of our errors; nothing is left behind."""
    yield from case.testimony.complaints
    yield from (f"left behind: {task}" for task in case.testimony.left)
    for name, evidence in case.axes.items():
        for call in evidence.axis.calls:
            if call.ended_at is None:
                yield f"{name}: never told: {call}"
            elif isinstance(call.outcome, BaseException) and not isinstance(call.outcome, CompaxError | CancelledError):
                yield f"{name}: no error of ours: {call}"
            elif (wrong := _too_long(case, evidence, call)) is not None:
                yield f"{name}: {wrong}: {call}"


def _too_long(case: Case, evidence: Evidence, call: Call) -> str | None:
    assert call.ended_at is not None
    if call.what.startswith(_SINGLE):
        # While somebody waits the line is never idle, but where reads are held back for a trigger.
        bound_s = 2 * evidence.settings.answer_timeout_s + case.stalled_s + _EPSILON_S
        if _longest_pause_s(evidence, call.asked_at, call.ended_at) > bound_s:
            return f"the line was idle for more than {bound_s:.1f} s"
        if (markers := _markers_in_vain(evidence, call)) > _MARKERS_AGAIN * evidence.settings.resync_attempts:
            return f"it waited for {markers} markers in vain"
    if call.ended_at - call.asked_at <= _LONGEST_TRAVEL_S or call.what == "watch":
        return None
    bound_s = _bound_s(case, evidence, call)
    return f"it took longer than {bound_s:.1f} s" if call.ended_at - call.asked_at > bound_s else None


def _longest_pause_s(evidence: Evidence, since: float, until: float) -> float:
    times = [since, *(line.at for line in evidence.turns.between(since, until)), until]
    pauses_s = [after - before for before, after in pairwise(times) if not evidence.is_out(before, after)]
    return max(pauses_s, default=0.0)


def _markers_in_vain(evidence: Evidence, call: Call) -> int:
    """Count how many markers in a row were not answered while *call* waited."""
    most = row = 0
    before_at = call.asked_at
    for line in evidence.turns.between(call.asked_at, call.ended_at or 0.0):
        if evidence.was_lost(before_at, line.at):
            row = 0  # each line that is opened is tried anew
        before_at = line.at
        if call.asked_at < line.at < (call.ended_at or 0.0):
            is_vain = line.is_marker and line.in_doubt and line.over_at is None
            row = row + 1 if is_vain else row if line.text == evidence.settings.dialect.stop else 0
            most = max(most, row)
    return most


def _bound_s(case: Case, evidence: Evidence, call: Call) -> float:
    settings = evidence.settings
    assert call.ended_at is not None
    exchange_s = settings.answer_timeout_s * (2 + 2 * settings.resync_attempts)
    patience_s = 3 * settings.in_doubt_after_s + 2 * (settings.stop_timeout_s + settings.standstill_timeout_s)
    troubles_s = sum(trouble.lasts_s for trouble in case.scenario.troubles) + case.stalled_s
    at_once = sum(
        other.asked_at <= call.ended_at and (other.ended_at or call.ended_at) >= call.asked_at
        for other in evidence.axis.calls
    )
    return _LONGEST_TRAVEL_S + settings.stall_timeout_s + patience_s + troubles_s + exchange_s * (30 + 5 * at_once)


# P4 ---------------------------------------------------------------------------------------------------------------

_QUERIES: Final = {
    "position": "S1",
    "probe": "S1",
    "settle": "S1",
    "target": "S2",
    "speed": "S4",
    "query S1": "S1",
    "query S4": "S4",
    "query P40": "P40",
    "query V7": "V7",
    "parameter 41": "P41",
    "read_status 9": "S9",
    "record 2": "N2",
}
_NAMED: Final = {"position": "S1", "speed": "S4"}


def own_answers(case: Case) -> Iterator[str]:
    """P4: an answer is what the drive said to a line that it was sent after the call; never to an earlier one."""
    for name, evidence in case.axes.items():
        for call in evidence.axis.calls:
            if isinstance(call.outcome, BaseException) or call.ended_at is None:
                continue
            for query, value, since, until in _values(call, evidence.settings.answer_timeout_s + case.stalled_s):
                if _was_said(evidence, query, value, since, until):
                    continue
                if not evidence.is_forged(since, until):
                    yield f"{name}: {value!r} is not what it said to {query} since {since:.4f}: {_short(call)}"
                elif not _was_heard(evidence, value, since, until):
                    yield f"{name}: {value!r} is not what came since {since:.4f}, from whomever: {_short(call)}"


def _short(call: Call) -> str:
    return str(call)[:_LONGEST_TOLD]


def _values(call: Call, answer_takes_s: float) -> Iterator[tuple[str, Any, float, float]]:
    """List what was told to a caller, by the query that it is the answer to, and when that was asked and answered."""
    since, until = call.asked_at, call.ended_at or 0.0
    if call.what in _QUERIES:
        value = getattr(call.outcome, "value", call.outcome)
        yield _QUERIES[call.what], value, since, until
    elif call.what == "status" and isinstance(call.outcome, DriveStatus):
        yield "S16", call.outcome.s16, since, until
        yield "S17", call.outcome.s17, since, until
    elif call.what == "write":
        yield call.detail[0], call.outcome, since, until
    elif call.what == "watch":
        for reading in call.outcome:
            # A watch is served by a question that was on its way when it began.
            since, latest = reading.at - answer_takes_s, reading.at + _LONGEST_READING_S
            for quantity, value in reading.values.items():
                if quantity != "status":
                    yield _NAMED.get(quantity, quantity), getattr(value, "value", value), since, min(until, latest)


def _was_heard(evidence: Evidence, value: Any, since: float, until: float) -> bool:
    heard = evidence.heard(since - _EPSILON_S, until + _EPSILON_S)
    if isinstance(value, float | int):
        return any(float(f"{sign}{digits}") == value for sign, digits in _NUMBERS.findall(heard))
    return "".join(str(value).split()) in "".join(heard.split())


def _was_said(evidence: Evidence, query: str, value: Any, since: float, until: float) -> bool:
    said = evidence.answers_to(query, since - _EPSILON_S, until + _EPSILON_S)
    if isinstance(value, float | int):
        return any(each.number == value for each in said)
    text = normal(str(value))
    if query in {"S16", "S17"}:
        return any(each.text.partition(":")[2].replace(" ", "") == text for each in said)
    return any(text in (each.text, each.text.partition(":")[2].strip()) for each in said)


# P5 ---------------------------------------------------------------------------------------------------------------


def safe_to_cancel(case: Case) -> Iterator[str]:
    """P5: who is given up stops its drive, and what others do on that line goes on; who leaves leaves it standing."""
    for name, evidence in case.axes.items():
        for call in evidence.axis.calls:
            if _needs_stop(call) and not _was_stopped(case, evidence, call):
                yield f"{name}: it was given up, and no STOP was written: {call}"
            if call.what == "probe" and isinstance(call.outcome, CompaxError) and not _may_fail(evidence, call):
                yield f"{name}: at the end its line does not work: {call}"
        if not _may_go_on(evidence):
            if evidence.axis.moving_at_end:
                yield f"{name}: the axis moves although its block was left"
            if len(evidence.axis.motions) > evidence.axis.motions_at_end:
                yield f"{name}: the axis began to move after its block was left"


def _needs_stop(call: Call) -> bool:
    given_up = isinstance(call.outcome, CancelledError)
    return given_up and call.move is not None and call.move.sent is not None and call.on_cancel == "stop"


def _was_stopped(case: Case, evidence: Evidence, call: Call) -> bool:
    assert call.ended_at is not None
    stop = evidence.settings.dialect.stop
    timeout_s = evidence.settings.answer_timeout_s
    latest = call.ended_at + 2 * timeout_s + case.stalled_s + _EPSILON_S
    if evidence.is_out(call.ended_at, latest):
        return True
    lines = evidence.turns.lines
    if any(line.text == stop and call.ended_at - _EPSILON_S <= line.at <= latest for line in lines):
        return True
    # Or a stop was under way already.
    return stops_already(stop, [line for line in lines if line.at < call.ended_at])


def _may_fail(evidence: Evidence, call: Call) -> bool:
    if isinstance(call.outcome, ConnectionLostError):
        return evidence.lost_at <= (call.ended_at or 0.0)
    frames = bool(evidence.axis.plan.knobs.p20 & 16)
    return frames or not evidence.axis.far._powered  # noqa: SLF001  # nobody else knows


def _may_go_on(evidence: Evidence) -> bool:
    """Whether the axis may move when its block has been left."""
    axis = evidence.axis
    detached = any(call.on_cancel == "detach" for call in axis.calls)
    told = any(call.what == "close" and isinstance(call.outcome, CompaxError) for call in axis.calls)
    lost = evidence.befell("moved at its panel", "power begins", "blackout begins", "fault begins", *_FORGING)
    is_cut = not evidence.comes_back and evidence.befell("cut")
    return detached or told or lost or is_cut or bool(axis.plan.left_over)


_FORGING: Final = tuple(f"{kind} begins" for kind, what in TROUBLES.items() if what.forges)


# P8 ---------------------------------------------------------------------------------------------------------------


def bounded_memory(case: Case) -> Iterator[str]:
    """P8: whatever arrives, a drive keeps no more than so much of it."""
    for name, evidence in case.axes.items():
        if evidence.axis.weight > _HEAVIEST_DRIVE:
            yield f"{name}: the client's drive keeps {evidence.axis.weight} bytes"


# P10 --------------------------------------------------------------------------------------------------------------


def nothing_invented(case: Case) -> Iterator[str]:
    """P10: what is told of a motion is true, and what is told as read was sent by that drive."""
    for name, evidence in case.axes.items():
        for call in evidence.axis.calls:
            if call.ended_at is not None and not evidence.may_be_forged(call):
                for wrong in _untrue(evidence, call):
                    yield f"{name}: {wrong}: {call}"
        yield from (f"{name}: {wrong}" for wrong in _invented_events(evidence))


def _untrue(evidence: Evidence, call: Call) -> Iterator[str]:
    if isinstance(call.outcome, MoveResult):
        yield from _untrue_result(evidence, call, call.outcome)
    elif isinstance(call.outcome, DriveFaultError):
        causes = evidence.happened(LogKind.FAULT, LogKind.POWER, until=call.ended_at or 0.0)
        if not causes and not evidence.axis.plan.knobs.self_test_s:
            yield "there was no fault"
    elif call.move is not None and _says_not_taken(call.outcome):
        if (
            _has_begun(evidence, call)
            and not evidence.befell("power", "blackout")
            and not evidence.may_be_misheard(call)
        ):
            yield "it had begun"
    elif _stands_they_say(evidence, call) and call.moving_then and not _moved_since(evidence, call):
        yield "the axis moves"


def _stands_they_say(evidence: Evidence, call: Call) -> bool:
    if call.outcome is not None:
        return False
    # A line that is lost for good cannot be used for a stop: whoever awaited the move has been told.
    is_lost = not evidence.comes_back and evidence.was_lost(0.0, call.ended_at or 0.0)
    return call.what == "stop" or (call.what == "close" and not is_lost)


def _untrue_result(evidence: Evidence, call: Call, result: MoveResult) -> Iterator[str]:
    if evidence.may_be_misheard(call):
        return
    position = result.last_position
    if position is not None and not _was_said(evidence, "S1", position, 0.0, call.ended_at or 0.0):
        yield f"it never said that it was at {position}"
    target = result.target
    if target is None:
        return
    reached = evidence.happened(LogKind.MOTION_REACHED, since=result.started_at, until=result.finished_at)
    if any(abs(float(entry.text) - target) <= _TOLERANCE for entry in reached):
        return
    if abs(call.position_then - target) > _TOLERANCE or call.moving_then:
        yield f"the axis was at {call.position_then:.2f}, not at its target {target:.2f}"


def _says_not_taken(outcome: object) -> bool:
    return isinstance(outcome, CommandRejectedError) or "was not taken" in str(getattr(outcome, "hint", ""))


def _has_begun(evidence: Evidence, call: Call) -> bool:
    assert call.move is not None
    if call.move.sent is None or call.move.started_at is None:
        return False
    since, until = call.move.started_at, call.ended_at or float("inf")
    begun = evidence.happened(LogKind.MOTION_STARTED, since=since, until=until)
    word = "POSR" if call.move.plan.distance is not None else "POSA"
    if call.move.plan.finds_machine_zero:
        return any(entry.text.startswith("POSA HOME") for entry in begun)
    target = call.move.target
    return any(
        entry.text.startswith(f"{word} ") and target is not None and abs(float(entry.text[5:]) - target) < _TOLERANCE
        for entry in begun
        if re.fullmatch(r"POS[AR] -?[\d.]+", entry.text)
    )


def _moved_since(evidence: Evidence, call: Call) -> bool:
    """Whether a motion began after the stop of *call* had come to the drive; or a fault brakes it."""
    stop = evidence.settings.dialect.stop
    stops = [entry.at for entry in evidence.happened(LogKind.LINE, until=call.ended_at or 0.0) if entry.text == stop]
    if not stops or call.fault_then is not None:
        return call.what == "close" or call.fault_then is not None
    return bool(evidence.happened(LogKind.MOTION_STARTED, LogKind.MOTION_CONTINUED, since=stops[-1]))


def _invented_events(evidence: Evidence) -> Iterator[str]:
    for call in evidence.axis.calls:
        if call.what != "events" or not isinstance(call.outcome, list) or evidence.may_be_forged(call):
            continue
        events = call.outcome
        messages = [entry.text for entry in evidence.happened(LogKind.MESSAGE)]
        if sum(isinstance(event, PositionMessage) for event in events) > messages.count("$"):
            yield f"more $ were told than came: {call}"
        for event in events:
            if isinstance(event, ComparatorPassed) and str(event.number) not in messages:
                yield f"comparator {event.number} was never passed: {call}"
            elif isinstance(event, Fault) and event.error is not None:
                codes = {entry.text for entry in evidence.happened(LogKind.FAULT)}
                if f"E{event.error.code:02d}" not in codes:
                    yield f"there was no E{event.error.code}: {call}"
