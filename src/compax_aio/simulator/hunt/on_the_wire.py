"""Promises that the bytes alone can break: P1 turns, P2 at most once, P6 stop is next, P7 own lines, P9 lines."""

from __future__ import annotations

import re
from asyncio import CancelledError
from bisect import bisect_left
from collections import Counter
from collections.abc import Iterator
from itertools import pairwise
from typing import Final

from compax_aio.errors import AnswerTimeoutError, ConnectionLostError, InvalidCommandError, MoveInDoubtError
from compax_aio.simulator.compax.log import LogEntry, LogKind

from .evidence import FORGES_TO_DRIVE, Case, Evidence
from .scenario import Scenario
from .simulation import PROGRAM_TARGET, simulate
from .testimony import Call, Seen, WireEntry
from .troubles import PANEL_TARGET
from .turns import Written

__all__ = [
    "at_most_once",
    "own_lines",
    "own_lines_exactly",
    "possible_lines",
    "stop_is_next",
    "stops_already",
    "turns",
]

_EPSILON_S: Final = 1e-6

_SIGNS: Final = "$,"
_NUMBER: Final = r"-?\d{1,7}(?:\.\d{1,3})?"
_LINES: Final = re.compile(
    "|".join((
        r"[SPVN]\d{1,3}",
        rf"P[AR]{_NUMBER}\$?,?",
        r"PH,?",
        r"!",
        rf"SD{_NUMBER}",
        r"AL-?\d{1,5}",
        rf"PR{_NUMBER} SD\d{{1,3}}",
        rf"PR{_NUMBER} OT O\d{{1,2}}=[01]",
        r"PR0 SD\d{1,3}",
        r"[PV]\d{1,3}=-?\d{1,7}(?:\.\d{1,6})?",
        r"OT O\d{1,2}=[012]",
        r"STOP|START|BREAK|QUIT|VP",
        r"GOTO \d{1,3}",
        r"SD 50|AL 100",
    ))
)  # fmt: skip
_FRAMES: Final = re.compile(r"(?:[0-9A-F]{2} )+\((?:POSA|POSR|SPEED|ACCEL-?|OUTPUT) .*\)")
_MOTION: Final = re.compile(r"P[AR]-?\d|PH|!|START")
_TARGETED: Final = re.compile(rf"P[AR]{_NUMBER}[$,]*\Z")
_LONGEST_LINE: Final = 30
_LOOKED_BACK: Final = 2000
"""Lines before a stop, and behind it."""


def turns(case: Case) -> Iterator[str]:
    """P1: no byte of a line leaves while an earlier one is unanswered; after doubt, markers first."""
    for name, evidence in case.axes.items():
        for violation in evidence.turns.violations:
            yield f"{name}: {violation}"


# P2 ---------------------------------------------------------------------------------------------------------------


def at_most_once(case: Case) -> Iterator[str]:
    """P2: one call puts its motion on the wire once at most; a drive in doubt takes no motion."""
    for name, evidence in case.axes.items():
        said = Counter(_plain(line) for line in evidence.turns.lines)
        asked = _asked_for(evidence)
        moves = [call for call in evidence.axis.calls if call.move is not None]
        for call in evidence.axis.calls:
            yield from (f"{name}: {wrong}: {call}" for wrong in _too_often(call, said, asked))
        yield from _told_too_often(evidence, said)
        for word, calls in (
            ("!", sum(call.move is not None and call.move.sent == "!" for call in moves)),
            ("PH", sum(call.move is not None and call.move.sent == "PH" for call in moves)),
            ("START", sum(call.what == "program.start" for call in evidence.axis.calls)),
        ):
            if said[word] > calls:
                yield f"{name}: {word} was written {said[word]} times, for {calls} calls"
        for before, line in pairwise(evidence.turns.lines):
            if line.text == "!" and not before.text.endswith(","):
                yield f"{name}: ! was written at {line.at:.4f} behind {before.text!r}, which stores nothing"
        yield from _motions_while_in_doubt(evidence)
        yield from _written_for_nobody(evidence, said, asked)
        yield from _motions_of_nobody(evidence, said, asked)


def _asked_for(evidence: Evidence) -> Counter[str]:
    """Count how often each motion was asked for."""
    return Counter(_canonical(call.text) for call in evidence.axis.calls if call.text is not None)


def _too_often(call: Call, said: Counter[str], asked: Counter[str]) -> Iterator[str]:
    if call.text is None or call.text == "PH":
        return
    motion = _canonical(call.text)
    started = said[motion] + said[f"{motion}$"]
    stored = said[f"{motion},"] + said[f"{motion}$,"]
    if started > asked[motion]:
        yield f"{motion} was written {started} times"
    if stored > asked[motion]:
        yield f"{motion} was stored {stored} times"
    if asked[motion] > 1:  # in a long day
        return
    if started and call.move is not None and call.move.sent == "!":
        yield f"{motion} was written, and executed with ! as well"
    if started and (
        (call.move is not None and call.move.sent is None) or isinstance(call.outcome, InvalidCommandError)
    ):
        yield f"{motion} was written, and its caller told that it was not"


def _told_too_often(evidence: Evidence, said: Counter[str]) -> Iterator[str]:
    """Find what was told more often than anybody has asked for; a lost line is no reason to tell it again."""
    calls = evidence.axis.calls
    configured = sum(call.what == "configure" for call in calls)
    asked = Counter(call.detail for call in calls if call.what == "command")
    asked["GOTO 302"] += configured
    asked["GOTO 270"] += 2 * configured  # once more where the first may have got lost
    asked["VP"] += configured
    for text in ("OT O7=1", "VP", "GOTO 302"):
        if said[text] > asked[text]:
            yield f"{evidence.name}: {text!r} was written {said[text]} times, for {asked[text]} calls"
    written = Counter(_canonical("{}={}".format(*call.detail)) for call in calls if call.what == "write")
    for text, times in written.items():
        if said[text] > times:
            yield f"{evidence.name}: {text!r} was written {said[text]} times, for {times} calls"


def _written_for_nobody(evidence: Evidence, said: Counter[str], asked: Counter[str]) -> Iterator[str]:
    """Find motions that were written, and are of no call; whatever befell the line."""
    for text in said:
        if _TARGETED.match(text) and text.rstrip(_SIGNS) not in asked:
            yield f"{evidence.name}: {text!r} was written, and nobody has asked for it"


def _plain(line: Written) -> str:
    """Write a line as a motion is known by, signs and all: frames like lines."""
    if not line.is_frame:
        return _canonical(line.text)
    words = line.text.partition("(")[2].rstrip(")").split()
    if len(words) == 2 and words[0] in {"POSA", "POSR"}:
        return f"{words[0][0]}{words[0][3]}{float(words[1]):.3f}"
    return line.text


def _canonical(text: str) -> str:
    """Write PA12.5$ as PA12.500$, whatever its decimals."""
    found = re.fullmatch(rf"(P[AR]|[PV]\d+=)({_NUMBER})([$,]*)", text)
    return f"{found[1]}{float(found[2]):.3f}{found[3]}" if found else text


def _motions_while_in_doubt(evidence: Evidence) -> Iterator[str]:
    reconciled = [call.asked_at for call in evidence.axis.calls if call.what == "reconcile"]
    for call in evidence.axis.calls:
        if not isinstance(call.outcome, MoveInDoubtError) or call.move is None or call.move.sent is None:
            continue
        assert call.ended_at is not None
        until = min((at for at in reconciled if at >= call.asked_at), default=float("inf"))
        for line in evidence.turns.between(call.ended_at, until):
            if call.ended_at < line.at < until and not line.text.endswith(",") and _is_motion(line):
                yield f"{evidence.name}: {line.text!r} was written at {line.at:.4f}, in doubt since: {call}"


def _is_motion(line: Written) -> bool:
    text = _plain(line)
    return _MOTION.match(text) is not None and " " not in text


def _motions_of_nobody(evidence: Evidence, said: Counter[str], asked: Counter[str]) -> Iterator[str]:
    """Find where the drive went, and nobody had sent it; what it heard, and the client has not said, excuses that."""
    if evidence.axis.plan.left_over or (evidence.axis.plan.knobs.p20 and evidence.befell(*FORGES_TO_DRIVE)):
        return
    heard = Counter(map(_in_short, evidence.happened(LogKind.LINE)))
    forged = heard - said
    begun = Counter(entry.text for entry in evidence.happened(LogKind.MOTION_STARTED))
    relative = _relative(evidence)
    usual = {round(evidence.axis.plan.knobs.position + PROGRAM_TARGET, 2), PANEL_TARGET}
    for text, count in begun.items():
        word, _, target = text.rpartition(" ")
        motion = _canonical(f"PA{target}") if word == "POSA" else ""
        if not motion or float(target) in usual:
            continue
        most = (
            relative.count(float(target))
            + asked[motion]
            + sum(forged[f"{motion}{signs}"] for signs in ("", "$", ",", "$,"))
        )
        if count > most:
            yield f"{evidence.name}: it began {text} {count} times, and was asked to {most} times"
    for word, of_calls in (("POSR ", "PR"), ("POSA HOME", "PH")):
        most = sum(count for text, count in (asked + forged).items() if text.startswith(of_calls))
        if (count := sum(each for text, each in begun.items() if text.startswith(word))) > most:
            yield f"{evidence.name}: it began {word} {count} times, and was asked to {most} times"


def _relative(evidence: Evidence) -> list[float]:
    """List where relative moves were to end: they begin as such, and are continued after a stop by START."""
    moves = [call.move for call in evidence.axis.calls if call.move is not None]
    return [round(move.target, 2) for move in moves if move.plan.distance is not None and move.target is not None]


def _in_short(entry: LogEntry) -> str:
    """Write a line that a drive has heard as a client writes it."""
    text = entry.text.replace(" ", "").upper()
    for long, short in (("POSAHOME", "PH"), ("POSA", "PA"), ("POSR", "PR")):
        if text.startswith(long):
            text = short + text.removeprefix(long)
    return _canonical(text)


# P6 ---------------------------------------------------------------------------------------------------------------


def stop_is_next(case: Case) -> Iterator[str]:
    """P6: stop goes ahead of everything queued, and waits at most for the exchange in flight, or a marker."""
    for name, evidence in case.axes.items():
        for call in evidence.axis.calls:
            if call.what == "stop":
                wrong = _not_next(evidence, call, case.stalled_s)
                if wrong:
                    yield f"{name}: {wrong}: {call}"


def _not_next(evidence: Evidence, call: Call, stalled_s: float) -> str | None:
    stop, index = evidence.settings.dialect.stop, call.asked_index
    lines = evidence.turns.lines
    place = bisect_left(lines, index, key=lambda line: line.index)
    before, after = lines[max(0, place - _LOOKED_BACK) : place], lines[place : place + _LOOKED_BACK]
    if call.detail is not None:
        # Those of a group each begin in a task of their own: another may be quicker by one line.
        after = [line for line in after if line.text == stop or line.at > call.asked_at + _EPSILON_S]
    after = after[:2]
    if not evidence.is_open(index) or isinstance(call.outcome, CancelledError) or stops_already(stop, before):
        return None
    latest = call.asked_at + 2 * evidence.settings.answer_timeout_s + stalled_s + _EPSILON_S
    if evidence.turns.was_free(index) and call.detail is None:
        if not after or after[0].text != stop or after[0].at > call.asked_at + _EPSILON_S:
            return "the line was free, and STOP was not written at once"
        return None
    if not any(line.text == stop and line.at <= latest for line in after):
        if evidence.was_lost(call.asked_at, latest) or _gave_up(evidence, call, before):
            return None
        return f"STOP was not next: {[line.text for line in after]}"
    return None if after[0].text == stop or after[0].is_marker else f"{after[0].text!r} went ahead of STOP"


def _gave_up(evidence: Evidence, call: Call, before: list[Written]) -> bool:
    """
    Whether the last marker of all was outstanding, and was answered in vain or not at all.

    Known: a stop that comes meanwhile fails with it, and is written again a moment later, not at once.
    """
    attempts = evidence.settings.resync_attempts
    last = [line for line in before if line.text != evidence.settings.dialect.stop][-attempts:]
    is_last = len(last) == attempts and all(line.is_marker and line.in_doubt for line in last)
    return is_last and last[-1].over_at is None and call.asked_at < last[-1].at + evidence.settings.answer_timeout_s


def stops_already(stop: str, before: list[Written]) -> bool:
    """Whether a stop was written since anything was that can move: another one joins it, or has nothing to stop."""
    last = next((line for line in reversed(before) if line.text == stop or _is_motion(line)), None)
    return last is not None and last.text == stop


# P7 ---------------------------------------------------------------------------------------------------------------


def own_lines(case: Case) -> Iterator[str]:
    """P7: a line that nothing befalls is never late, whatever the others suffer."""
    for name, evidence in case.axes.items():
        if case.troubled(name) or evidence.axis.plan.left_over or _is_silent(evidence):
            continue
        for call in evidence.axis.calls:
            if call.detail == "all at once":
                continue  # it may be that of another
            is_late = isinstance(call.outcome, AnswerTimeoutError) and call.what != "stop"
            if is_late or (isinstance(call.outcome, ConnectionLostError) and (call.ended_at or 0.0) < evidence.lost_at):
                yield f"{name}: nothing befell its line: {call}"


def _is_silent(evidence: Evidence) -> bool:
    """Whether the drive is one that keeps silent by itself."""
    knobs = evidence.axis.plan.knobs
    return knobs.error_style == "silent" or knobs.position_reached == "final_only" or bool(knobs.baudrate)


def own_lines_exactly(case: Case) -> Iterator[str]:
    """P7 to the last byte: a line that nothing befalls, and no group uses, is what it would be alone."""
    if len(case.axes) < 2 or not case.scenario.troubles:
        return
    for name, evidence in case.axes.items():
        ours = [action for action in case.scenario.actions if name in action.axes]
        if case.troubled(name) or any(len(action.axes) > 1 for action in ours):
            continue
        plan = evidence.axis.plan
        scenario: Scenario = case.scenario.keep([plan.number, *(action.number for action in ours)])
        alone: Seen = simulate(scenario)
        until = alone.left_at
        pairs = zip(_until(evidence.axis.wire, until), _until(alone.axes[name].wire, until), strict=False)
        for seen, expected in pairs:
            if seen[1:] != expected[1:] or abs(seen.at - expected.at) > _EPSILON_S:
                yield f"{name}: nothing befell its line, but {seen} is not {expected} as when it is alone"
                break


def _until(wire: list[WireEntry], until: float) -> list[WireEntry]:
    return [entry for entry in wire if entry.at < until]


# P9 ---------------------------------------------------------------------------------------------------------------


def possible_lines(case: Case) -> Iterator[str]:
    """P9: every byte that is written is of a line that a drive can be told."""
    for name, evidence in case.axes.items():
        for entry in evidence.axis.written():
            if entry.data[:1] < b"\x80" and (entry.data[-1:] != b"\r" or entry.data.count(b"\r") != 1):
                yield f"{name}: {entry.data!r} is not one line"
        for line in evidence.turns.lines:
            allowed = _FRAMES if line.is_frame else _LINES
            if not allowed.fullmatch(line.text) or (not line.is_frame and len(line.text) > _LONGEST_LINE):
                yield f"{name}: {line.text!r} at {line.at:.4f} is no line that a drive can be told"
        for call in evidence.axis.calls:
            if call.what == "impossible" and not isinstance(call.outcome, InvalidCommandError | CancelledError):
                yield f"{name}: what cannot be said was not refused: {call}"
