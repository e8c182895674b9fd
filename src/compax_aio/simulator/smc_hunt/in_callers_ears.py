"""Promises about what callers are told: that it comes, that it is theirs, and that it is true."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from typing import Final

from compax_aio.errors import (
    CompaxError,
    InvalidCommandError,
    MoveError,
    MoveInDoubtError,
)
from compax_aio.motion.moves import MoveResult
from compax_aio.smc.codecs import AxisStatus

from .evidence import AxisEvidence, Case, Said
from .testimony import WHOLE_LINE, AxisCall

__all__ = ["bounded_memory", "nothing_invented", "own_answers", "safe_to_cancel", "settled"]

_HEAVIEST: Final = 40_000
"""Bytes of a line with five axes."""
_LONGEST_S: Final = 120.0
"""Of anything but a motion: many of them wait for one another, on a line that is lost and slow."""
_NEAR: Final = 1.0
"""Steps."""
_SLACK_S: Final = 1e-6


def settled(case: Case) -> Iterator[str]:
    """P3: everything ends, in bounded time, with a result or an error of ours; nothing is left behind."""
    yield from case.testimony.complaints
    for task in case.testimony.left:
        yield f"left behind: {task}"
    for call in case.testimony.calls:
        if call.ended_at is None:
            yield f"{call}: never ended"
        elif isinstance(call.outcome, BaseException) and not isinstance(
            call.outcome, (CompaxError, asyncio.CancelledError)
        ):
            yield f"{call}: an error of another kind"
        elif call.ended_at - call.asked_at > _LONGEST_S:
            yield f"{call}: took {call.ended_at - call.asked_at:.0f} s"


# Answers --------------------------------------------------------------------------------------------------------------


def own_answers(case: Case) -> Iterator[str]:
    """P4: what is told is what that axis answered between question and telling."""
    for call in case.testimony.calls:
        told = _told(call)
        if told is None or call.ended_at is None:
            continue
        letter, value = told
        said = [
            each
            for each in case.axes[letter].answers
            if call.asked_at - _SLACK_S <= each.asked_at and each.at <= call.ended_at + _SLACK_S
        ]
        if any(
            each.command[:1] == ("^" if "^" in call.what or call.what == "status" else "Z") and each.number == value
            for each in said
        ):
            continue
        if case.forged_to_host(call.asked_at - 0.01, call.ended_at) and case.excuse("answer forged"):
            continue
        yield f"{letter}: {call}: it said {[(each.command, each.data) for each in said][-4:]}"


def _told(call: AxisCall) -> tuple[str, float] | None:
    """Return which axis, and which number was told of it."""
    if call.axis == WHOLE_LINE or isinstance(call.outcome, BaseException):
        return None
    if call.what in {"position", "probe", "settle"}:
        return call.axis, float(call.outcome)
    if call.what in {"raw Z", "raw Z0", "raw ^"}:
        try:
            return call.axis, float(call.outcome)
        except ValueError:
            return None  # no number was told
    if isinstance(call.outcome, AxisStatus):
        return (call.axis, float(call.outcome.raw)) if call.what == "status" else None
    return None


# Cancelling and leaving -----------------------------------------------------------------------------------------------


def safe_to_cancel(case: Case) -> Iterator[str]:
    """P5: after all trouble the line works; what was started here has ended when the block is left."""
    for call in case.testimony.calls:
        if call.what == "probe" and isinstance(call.outcome, CompaxError):
            if case.axes[call.axis].runs_program(call.asked_at) and case.excuse("program of its own"):
                continue
            if case.ring_is_broken(call.asked_at) and case.excuse("names dealt anew"):
                continue
            if case.may_be_programming(call.axis, call.asked_at) and case.excuse("in program entry"):
                continue
            if case.overran(call.asked_at - 1.0, call.ended_at or 0.0) and case.excuse("unheard neighbours"):
                continue
            yield f"{call.axis}: {call}: nothing is wrong with the line any more"
        if call.what == "stop move" and call.outcome is None and call.moving_then and not _detached(case, call):
            yield from _still_moving(case, call)
    yield from _left(case)


def _detached(case: Case, call: AxisCall) -> bool:
    """Whether the move that was stopped had been let go of, or never begun."""
    return any(
        each.item == call.item and each.move is not None and (each.on_cancel == "detach" or each.move.sent is None)
        for each in case.moves(call.axis)
    )


def _left(case: Case) -> Iterator[str]:
    testimony = case.testimony
    closes = [call for call in testimony.calls if call.what == "close" and call.ended_at is not None]
    if not closes or any(isinstance(call.outcome, BaseException) for call in closes):
        return  # that it may move was told
    closed_at = min(call.ended_at for call in closes if call.ended_at is not None)
    for letter, evidence in case.axes.items():
        if any(
            call.move is not None and call.on_cancel == "detach" and call.move.sent is not None
            for call in case.calls(letter)
        ):
            continue
        later = [each for each in evidence.motions if each.at > closed_at and each.kind.value == "motion_started"]
        if any(each.text != "jog" for each in later):
            yield f"{letter}: {later[0].text!r} began after the line was closed"
        elif (
            letter in testimony.moving_when_closed
            and not any(at <= testimony.lasted_s for at in evidence.jogs[-1:])
            and not _is_lost_for_good(case)
        ):
            yield f"{letter}: it moves after the line was closed at {closed_at:.4f} s"


def _is_lost_for_good(case: Case) -> bool:
    """Whether the line was lost and not opened again: nothing can be stopped then."""
    return not any(call.what == "probe" for call in case.testimony.calls)


def _still_moving(case: Case, call: AxisCall) -> Iterator[str]:
    """Tell of an axis that moves although a stop has returned, unless somebody else has begun that since."""
    assert call.ended_at is not None
    evidence = case.axes[call.axis]
    last = [each for each in evidence.motions if each.at <= call.ended_at and each.kind.value == "motion_started"]
    if last and last[-1].text == "jog":
        return
    since = evidence.last_position(call.ended_at)
    if since is not None and last and last[-1].at >= since.asked_at:
        return
    if evidence.runs_program(call.ended_at) and case.excuse("program of its own"):
        return
    if last and _is_of_later_call(case, call, last[-1].text, last[-1].at):
        return
    if case.forged_to_host(call.asked_at, call.ended_at) and case.excuse("answer forged"):
        return
    yield f"{call.axis}: {call}: it moves"


def _is_of_later_call(case: Case, call: AxisCall, text: str, at: float) -> bool:
    return any(
        other.asked_at >= call.asked_at and case.text_of(other) == text.strip() and at >= other.asked_at
        for other in case.moves(call.axis)
    )


# Memory ---------------------------------------------------------------------------------------------------------------


def bounded_memory(case: Case) -> Iterator[str]:
    """P8: a line keeps no more than it needs."""
    if case.testimony.weight > _HEAVIEST:
        yield f"the line keeps {case.testimony.weight} bytes"


# Truth ----------------------------------------------------------------------------------------------------------------


def nothing_invented(case: Case) -> Iterator[str]:
    """P10: what is told of a motion is true."""
    for letter, evidence in case.axes.items():
        for call in case.calls(letter):
            if call.axis != letter or call.ended_at is None:
                continue
            if isinstance(call.outcome, MoveResult):
                yield from _arrived(case, evidence, call)
            elif call.what == "stop" and not isinstance(call.outcome, BaseException) and call.moving_then:
                yield from _still_moving(case, call)
            elif call.move is not None and isinstance(call.outcome, CompaxError):
                yield from _not_arrived(case, evidence, call)
        yield from _references(case, evidence)


def _arrived(case: Case, evidence: AxisEvidence, call: AxisCall) -> Iterator[str]:
    assert call.ended_at is not None
    target = call.outcome.target
    seen = evidence.last_position(call.ended_at)
    if seen is not None and evidence.disturbed(seen.asked_at, call.ended_at) and case.excuse("changed in that moment"):
        return
    is_forged = case.forged_to_host(call.asked_at, call.ended_at)
    if call.moving_then and not (evidence.runs_program(call.ended_at) and case.excuse("program of its own")):
        if not (is_forged and case.excuse("answer forged")):
            yield f"{call.axis}: {call}: it moves"
        return
    if target is None:
        return
    if abs(call.position_then - target) >= _NEAR:
        if not (is_forged and case.excuse("answer forged")):
            yield f"{call.axis}: {call}: it stands at {call.position_then:g}"
        return
    executed = evidence.commanded(call.asked_at, call.ended_at)
    resets = [at for at in evidence.resets if executed and executed[-1].at <= at <= call.ended_at]
    if resets and not (abs(target) < _NEAR and case.excuse("reset at zero")):
        yield f"{call.axis}: {call}: it was reset at {resets[-1]:.4f} s, on the way"
    before = evidence.last_position(call.move.started_at) if call.move.started_at is not None else None
    was_there = before is not None and before.number is not None and abs(before.number - target) < _NEAR
    if (
        not executed
        and not was_there
        and not (case.forged_to_axis(call.asked_at, call.ended_at) and case.excuse("command forged"))
    ):
        yield f"{call.axis}: {call}: it was never told to move"


def _not_arrived(case: Case, evidence: AxisEvidence, call: AxisCall) -> Iterator[str]:
    """Look whether a motion that is told as over, or as never begun, is so."""
    assert call.ended_at is not None
    if isinstance(call.outcome, MoveInDoubtError) or call.on_cancel == "detach":
        return
    text = case.text_of(call)
    later = [each for each in evidence.commanded(call.ended_at + _SLACK_S, float("inf")) if each.text.strip() == text]
    others = [each for each in case.moves(call.axis) if each is not call and case.text_of(each) == text]
    if later and not others:
        yield f"{call.axis}: {call}: it began at {later[0].at:.4f} s, after that"
    if isinstance(call.outcome, InvalidCommandError):
        return
    begun = evidence.commanded(call.asked_at, call.ended_at)
    if call.moving_then and begun and not _is_closed(call):
        yield from _still_moving(case, call)
    if not isinstance(call.outcome, MoveError) and any(each.text.strip() == text for each in begun):
        stood = [each for each in evidence.motions if each.at <= call.ended_at]
        if not _is_closed(call) and stood and stood[-1].kind.value == "motion_started" and call.moving_then:
            yield f"{call.axis}: {call}: it was begun, and goes on"


def _is_closed(call: AxisCall) -> bool:
    """Whether the line was lost for good or closed: who is told that knows no more."""
    return "closed" in str(call.outcome) or "lost" in str(call.outcome)


# What positions are counted from --------------------------------------------------------------------------------------


def _references(case: Case, evidence: AxisEvidence) -> Iterator[str]:
    """After a reset that shows, no move to a position is told to have arrived, nor even sent."""
    yield from _looked_before(case, evidence)
    for reset_at in evidence.resets:
        shown = _shows(evidence, reset_at)
        for call in case.calls(evidence.letter):
            if call.what != "move_to" or call.move is None or call.move.started_at is None:
                continue
            if _is_renewed(case, evidence, reset_at, call.move.started_at) or call.move.started_at < reset_at:
                continue
            if any(each > reset_at and each <= call.move.started_at for each in evidence.resets):
                continue
            if shown is None:
                case.excuse("reset did not show")
            elif shown.at + _SLACK_S < call.asked_at:
                if case.forged_to_host(shown.asked_at, shown.at + 0.1) and case.excuse("answer forged"):
                    continue
                if _had_unknown_motion(case, evidence, shown.at) and case.excuse("unknown motion"):
                    continue
                yield (
                    f"{evidence.letter}: {call} was sent, although it was reset at {reset_at:.4f} s, and said 0 at "
                    f"{shown.at:.4f} s"
                )


def _looked_before(case: Case, evidence: AxisEvidence) -> Iterator[str]:
    """Tell of moves to a position that were sent on a look from before a reset."""
    for call in case.calls(evidence.letter, "move_to"):
        executed = [each for each in evidence.commanded(call.asked_at, float("inf")) if each.text.strip() == call.text]
        if not executed:
            continue
        at = executed[0].at
        looks = [each for each in evidence.answers if each.is_position and call.asked_at <= each.asked_at <= at]
        if not looks or looks[-1].number == 0:
            continue
        between = [each for each in evidence.resets if looks[-1].at < each <= at]
        if between and at - between[-1] > case.plan.knobs.reset_time_s:
            yield f"{evidence.letter}: {call}: it was reset at {between[-1]:.4f} s, after the last look at it"


def _shows(evidence: AxisEvidence, reset_at: float) -> Said | None:
    """Return the answer by which a reset shows: 0, where it was not 0 before and nobody has moved it."""
    positions = [each for each in evidence.answers if each.is_position and each.number is not None]
    before = [each for each in positions if each.at <= reset_at]
    after = [each for each in positions if each.asked_at > reset_at]
    if not before or not after or before[-1].number == 0 or after[0].number != 0:
        return None
    moved = [each for each in evidence.motions if before[-1].asked_at <= each.at <= after[0].asked_at]
    counted = evidence.commanded(before[-1].asked_at, after[0].asked_at, "O")
    if counted or (moved and not _left_zero_behind(evidence, before, reset_at)):
        return None
    return after[0]


def _left_zero_behind(evidence: AxisEvidence, before: list[Said], reset_at: float) -> bool:
    """Whether it was on its way to a position, away from 0, and read so, when it was reset."""
    begun = [each for each in evidence.motions if each.at <= reset_at and each.kind.value == "motion_started"]
    since = [each for each in evidence.motions if begun and begun[-1].at < each.at]
    if not begun or not begun[-1].text.startswith("R") or begun[-1].at > before[-1].asked_at or len(since) > 1:
        return False
    target, position = float(begun[-1].text[1:]), before[-1].number or 0.0
    return abs(target) > abs(position) and target * position > 0


def _had_unknown_motion(case: Case, evidence: AxisEvidence, until: float) -> bool:
    """Whether it was sent a motion that nobody watched, and was not read since."""
    return any(
        call.asked_at <= until and (case.raw_motion(call) or call.detail in {"U1", "B"})
        for call in case.calls(evidence.letter, "raw", "change_speed")
    )


def _is_renewed(case: Case, evidence: AxisEvidence, since: float, until: float) -> bool:
    """Whether the user has said what positions count from, or taken them as they are."""
    return any(
        call.what in {"set_origin", "reconcile", "home", "name_axis"}
        and call.ended_at is not None
        and since <= call.ended_at <= until + _SLACK_S
        and not isinstance(call.outcome, BaseException)
        for call in case.calls(evidence.letter)
    ) or bool(evidence.commanded(since, until, "O"))
