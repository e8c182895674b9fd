"""Promises that the bytes on the line keep or break: turns, at most once, stops first, possible lines."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Final

from compax_aio.errors import CompaxError, ConnectionLostError, InvalidCommandError, MoveError, MoveInDoubtError

from ..hunt.testimony import WireEntry, WireKind
from .evidence import Case
from .spoken import SpokenLine
from .testimony import WHOLE_LINE, AxisCall

__all__ = ["at_most_once", "doubt_is_followed", "possible_lines", "refused_at_once", "stop_is_next", "turns"]

_HARMLESS: Final = re.compile(r"|\^|Z|Z0|Z 0|@|O|O0|\]|\][01]|A129|A8|Q|X|S|P\d+|[VIDE]\d+|[KY]\d+ \d+|U1|B")
_ESC: Final = b"\x1b"
_RESET: Final = b"\x03"
_SLACK_S: Final = 1e-6


def turns(case: Case) -> Iterator[str]:
    """P1: a character goes out after the echo of the last one, or its time, and one at a time."""
    yield from case.spoken.wrongs


def possible_lines(case: Case) -> Iterator[str]:
    """P1, P9: whole lines are what somebody has asked for, of that axis."""
    names = {case.name(letter): letter for letter in case.axes}
    for line in case.spoken.lines:
        if not line.is_whole:
            continue
        name = line.name if case.mode != "single" else ""
        text = line.text[len(name) :]
        if len(text) > 12 or not all(" " <= each <= "~" for each in line.text):
            yield f"{line.text!r} was said, which is no command"
        if _HARMLESS.fullmatch(text):
            continue
        letter = names.get(name)
        if case.forged_to_host(line.at - 0.01, line.ended_at) and case.excuse("answer forged"):
            continue  # what came between was taken for an echo, or looked like one
        if letter is None or not _is_asked(case, letter, text, line):
            yield f"{line.text!r} was said, and nobody has asked for it"


def refused_at_once(case: Case) -> Iterator[str]:
    """P9: what cannot be said is refused, and nothing is written meanwhile."""
    for call in case.testimony.calls:
        if call.what != "impossible" or call.ended_at is None or _is_cancelled(call):
            continue
        written = [each for each in case.testimony.wire[call.asked_index : call.ended_index] if _is_written(each)]
        if not isinstance(call.outcome, InvalidCommandError):
            yield f"{call}: not refused as impossible"
        elif written:
            yield f"{call}: something was written before it was refused"


def _is_written(entry: WireEntry) -> bool:
    return entry.kind is WireKind.WRITTEN


def _is_cancelled(call: AxisCall) -> bool:
    return isinstance(call.outcome, BaseException) and not isinstance(call.outcome, Exception)


def _is_asked(case: Case, letter: str, text: str, line: SpokenLine) -> bool:
    for call in case.calls(letter):
        if call.asked_at > line.at + _SLACK_S:
            continue
        if case.text_of(call) == text or (call.what == "raw" and call.detail.strip() == text):
            return True
        if call.what in {"write program", "edit program"} and (text[0] in "W+-J" or text in str(call.detail)):
            return True
    return False


# At most once ---------------------------------------------------------------------------------------------------------


def at_most_once(case: Case) -> Iterator[str]:
    """P2: each motion is said whole at most once, and executed at most once; nothing else moves an axis."""
    for letter in case.axes:
        moves = case.moves(letter)
        for call in moves:
            yield from _said_once(case, letter, call)
        yield from _executed_once(case, letter, moves)


def _said_once(case: Case, letter: str, call: AxisCall) -> Iterator[str]:
    text = case.name(letter) + case.text_of(call)
    begun = [
        line
        for line in case.spoken.between(call.asked_index, len(case.testimony.wire))
        if line.text == text or (len(line.text) > max(1, len(case.name(letter))) and text.startswith(line.text))
    ]
    alike = [line for line in begun if not _is_of_another(case, letter, call, line)]
    if len(alike) > 1:
        yield f"{letter}: {call}: its motion was typed {len(alike)} times"


def _is_of_another(case: Case, letter: str, call: AxisCall, line: SpokenLine) -> bool:
    """Whether a line, or a part of one, may be another call's."""
    if (
        call.ended_at is not None
        and line.at > call.ended_at + _SLACK_S
        and line.text != case.name(letter) + case.text_of(call)
    ):
        return True
    if call.move is not None and call.move.started_at is not None and line.at < call.move.started_at - _SLACK_S:
        return line.text != case.name(letter) + case.text_of(call)
    return any(
        other is not call
        and (case.name(letter) + case.text_of(other)).startswith(line.text)
        and other.asked_at <= line.at + _SLACK_S
        and (other.ended_at is None or line.at <= other.ended_at + _SLACK_S)
        for other in case.moves(letter)
    )


def _executed_once(case: Case, letter: str, moves: list[AxisCall]) -> Iterator[str]:
    taken: set[int] = set()
    for entry in case.axes[letter].commanded(0.0, float("inf")):
        text = entry.text.strip()
        whole = next(
            (
                call
                for call in moves
                if case.text_of(call) == text and call.asked_at <= entry.at + _SLACK_S and id(call) not in taken
            ),
            None,
        )
        if whole is not None:
            taken.add(id(whole))
            continue
        if any(case.text_of(call) == text and call.asked_at <= entry.at for call in moves):
            yield f"{letter}: {text!r} was executed once more at {entry.at:.4f} s"
            continue
        yield from _damaged(case, letter, moves, text, entry.at)


def _damaged(case: Case, letter: str, moves: list[AxisCall], text: str, at: float) -> Iterator[str]:
    """Look whose command *text* is a part of, and whether that was told."""
    begun = [
        line
        for line in case.spoken.lines
        if line.at <= at + _SLACK_S
        and line.text[len(case.name(letter)) :]
        and line.name in {case.name(letter), *line.text[: case.mode == "single"]}
    ]
    said = begun[-1].text[len(case.name(letter)) :] if begun else ""
    owner = next(
        (
            call
            for call in reversed(moves)
            if call.asked_at <= at + _SLACK_S and said and case.text_of(call).startswith(said)
        ),
        None,
    )
    if owner is None:
        if case.forged_to_axis(at - 1.0, at) and case.excuse("command forged"):
            return
        yield f"{letter}: {text!r} was executed at {at:.4f} s, and nobody has asked for that"
    elif owner.move is not None and owner.ended_at is not None and _hides(owner.outcome):
        yield f"{letter}: {text!r} was executed at {at:.4f} s of {owner}, which says nothing of it"
    elif owner.ended_at is not None and not isinstance(owner.outcome, BaseException):
        if owner.move is not None and case.forged_to_axis(owner.asked_at, at) and owner.ended_at >= at:
            return  # whether the result is true is looked at elsewhere
        yield f"{letter}: {text!r} was executed at {at:.4f} s of {owner}, which was told as well"


def _hides(outcome: object) -> bool:
    """Whether somebody is told that a motion failed, and not that the axis may have moved."""
    return isinstance(outcome, CompaxError) and not isinstance(outcome, (MoveError, ConnectionLostError))


def doubt_is_followed(case: Case) -> Iterator[str]:
    """P2: an axis in doubt takes no motion until somebody has looked."""
    for letter in case.axes:
        doubtful: AxisCall | None = None
        for call in sorted(case.calls(letter), key=lambda each: each.asked_at):
            doubts = [
                other
                for other in case.calls(letter)
                if other.ended_at is not None
                and other.ended_at <= call.asked_at
                and isinstance(other.outcome, MoveInDoubtError)
                and other.move is not None
                and other.move.sent is not None
            ]
            doubtful = max(doubts, key=lambda each: each.ended_at or 0.0, default=None)
            if doubtful is None or call.move is None or call.move.sent is None:
                continue
            since = doubtful.ended_at or 0.0
            if not _is_reconciled(case, letter, since, call.asked_at):
                yield f"{letter}: {call} was sent, although in doubt since {since:.4f} s"


def _is_reconciled(case: Case, letter: str, since: float, until: float) -> bool:
    looked = any(
        other.ended_at is not None
        and since <= other.ended_at <= until
        and other.what == "reconcile"
        and not isinstance(other.outcome, BaseException)
        for other in case.calls(letter)
    )
    return (
        looked
        or any(
            since <= other.asked_at <= until and other.what in {"reset", "name_axis"} for other in case.calls(letter)
        )
        or bool(
            case.testimony.events
            and any(
                type(event).__name__ == "AxesReset" and since <= event.at <= until for event in case.testimony.events
            )
        )
    )


# Stops ----------------------------------------------------------------------------------------------------------------


def stop_is_next(case: Case) -> Iterator[str]:
    """P6: a stop goes ahead of everything but the exchange in flight; ESC and ^C go out at once."""
    for call in case.testimony.calls:
        if call.what in {"abort_all", "reset"}:
            yield from _at_once(case, call)
        elif call.what == "stop" and not call.joins_stop and call.is_open_then:
            yield from _next(case, call)


def _at_once(case: Case, call: AxisCall) -> Iterator[str]:
    if not call.is_open_then:
        return
    if call.what == "reset" and not any(each.axis for each in case.testimony.calls):
        return  # where no axis is known, nobody waits until ^C is out, and closing takes it back
    if call.what == "reset":
        written = [entry.data for entry in case.testimony.wire[call.asked_index :]]
        if _RESET not in written and _no_loss(case, call.asked_index, len(case.testimony.wire)):
            yield f"{call}: it was not written"
        return
    for entry in case.testimony.wire[call.asked_index :]:
        if entry.kind in {WireKind.LOST, WireKind.CLOSED}:
            return
        if entry.kind is WireKind.WRITTEN:
            if entry.at > call.asked_at + _SLACK_S or entry.data != _ESC:
                yield f"{call}: {entry} came first"
            return
    yield f"{call}: nothing was written"


def _next(case: Case, call: AxisCall) -> Iterator[str]:
    if case.mode != "single" and any(
        other.what in {"write program", "edit program"}
        and other.asked_at <= call.asked_at
        and (other.ended_at is None or other.ended_at >= call.asked_at)
        for other in case.calls(call.axis)
    ):
        return  # program entry is ended first: a stop would be stored
    if call.axis == WHOLE_LINE:
        return
    mine = case.name(call.axis) + "@"
    for line in case.spoken.between(call.asked_index, len(case.testimony.wire)):
        if call.ended_at is not None and line.at > call.ended_at:
            return
        text = line.text[len(case.name(call.axis)) :]
        if mine.startswith(line.text) and (line.text == mine or not line.is_whole):
            return  # it was tried, at least
        if line.is_whole and text and not text.startswith("@") and _no_loss(case, call.asked_index, line.index):
            yield f"{call}: {line.text!r} went ahead of it at {line.at:.4f} s"
            return


def _no_loss(case: Case, first: int, end: int) -> bool:
    return not any(
        entry.kind in {WireKind.LOST, WireKind.CLOSED, WireKind.OPENED} for entry in case.testimony.wire[first:end]
    )
