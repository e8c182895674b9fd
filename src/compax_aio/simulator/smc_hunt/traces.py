"""The promises, held against the recorded conversation with axes on one line: what its handshake shows of them."""

from __future__ import annotations

import re
from bisect import bisect_left
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, replace
from typing import Any, Final

from compax_aio.errors import InvalidCommandError
from compax_aio.escaping import shown
from compax_aio.link.contract import Lane
from compax_aio.recording import Conversation
from compax_aio.smc.facts import MAX_COMMAND_LENGTH
from compax_aio.smc.settings import SmcSettings

from ..hunt.recorded import (
    NOT_IN_TRACES,
    SLACK_S,
    Finding,
    Outcome,
    RecordedLine,
    Request,
    Verdict,
    settled,
)
from ..hunt.testimony import WireKind
from .spoken import Spoken, SpokenLine

__all__ = ["check_party_line"]

_MODES: Final = ("single", "party", "daisy")
_MOTION: Final = re.compile(r"[R+\-MFG]")
_PRINTABLE: Final = re.compile(r"[ -~]*")
_LOST_S: Final = 60.0
"""Greeting a line that is back, with the most axes, all of them slow."""
_NOT_IN_THIS_TRACE: Final = {"P10": "which axes there are is not known from the bytes alone"}


def check_party_line(conversation: Conversation) -> list[Verdict]:
    """
    Hold the promises against what was recorded of one line.

    Raises:
        InvalidCommandError: The settings that the trace has of the line cannot be meant.
    """
    return _PartyLine(conversation).verdicts()


class _PartyLine:
    def __init__(self, conversation: Conversation) -> None:
        self.conversation = conversation
        self.line = RecordedLine(conversation)
        self.mode = conversation.about.get("mode")
        if self.mode not in _MODES:
            raise InvalidCommandError(f"the mode of a line is one of {', '.join(_MODES)}, not {shown(self.mode)}")
        self.settings = _settings(conversation.about)
        self.spoken = Spoken(self.line.wire, self.settings, self.mode, slack_s=SLACK_S)
        self.by_index = {each.index: each for each in self.spoken.lines}

    def verdicts(self) -> list[Verdict]:
        """Say of each promise whether it held."""
        checks: Mapping[str, Callable[[], Iterator[Finding]]] = {
            "P1": self.turns_kept,
            "P2": self.at_most_once,
            "P3": self.settled,
            "P4": self.own_answers,
            "P6": self.stop_is_next,
            "P9": self.possible_lines,
        }
        told = [self._verdict(promise, check) for promise, check in checks.items()]
        session, line = self.conversation.session, self.conversation.line
        unknown = {**NOT_IN_TRACES, **_NOT_IN_THIS_TRACE}
        told += [Verdict(each, Outcome.UNKNOWN, session, line, why) for each, why in unknown.items()]
        return sorted(told, key=lambda each: int(each.promise[1:]))

    def _verdict(self, promise: str, check: Callable[[], Iterator[Finding]]) -> Verdict:
        session, line = self.conversation.session, self.conversation.line
        if findings := tuple(check()):
            return Verdict(promise, Outcome.BROKEN, session, line, self.line.broken_off, findings)
        if not self.spoken.lines:
            return Verdict(promise, Outcome.UNKNOWN, session, line, self.line.broken_off or "nothing was sent")
        return Verdict(promise, Outcome.HELD, session, line, self.line.broken_off)

    def turns_kept(self) -> Iterator[Finding]:
        """P1: a character goes out when the last one has come back, or its time is over; one at a time."""
        for index, how in self.spoken.wrong_at:
            yield self.line.at(index, how)

    def at_most_once(self) -> Iterator[Finding]:
        """P2: a motion is ended with its terminator once for each time that it was asked for, and so executed."""
        wanted = Counter(request.text for request in self.line.requests)
        said: Counter[str] = Counter()
        for line in self.spoken.lines:
            if not (line.is_whole and self._is_motion(line)):
                continue
            said[line.text] += 1
            if said[line.text] > wanted[line.text]:
                times = f"{said[line.text]} times, and asked for {wanted[line.text]} times"
                yield self.line.at(line.index, f"{line.text!r} was said {times}")
        for request in self.line.requests:
            motions = [at for at in request.written if at in self.by_index and self._is_motion(self.by_index[at])]
            if len(motions) > 1:
                yield self.line.at(motions[1], f"{request.text!r}, asked for once, was typed {len(motions)} times")

    def _is_motion(self, line: SpokenLine) -> bool:
        return _MOTION.match(line.text[self.mode != "single" :]) is not None

    def settled(self) -> Iterator[Finding]:
        """P3: everything asked for ends in bounded time."""
        settings = self.settings
        idle_s = 2 * max(settings.answer_timeout_s, settings.profile.reset_time_s)
        lost_s = settings.in_doubt_after_s + 2 * (settings.reconnect_slowest_s + _LOST_S)
        return settled(self.line, idle_s, lost_s)

    def own_answers(self) -> Iterator[Finding]:
        """P4: who has asked is told what came between his own question and its end."""
        wire = self.line.wire
        for request in self.line.requests:
            if request.how != "Answered" or request.ended is None or not request.answer:
                continue
            first = request.written[-1] if request.written else self._shared(request)
            heard = b""
            if first is not None:
                end = bisect_left(wire, request.until + SLACK_S, key=lambda entry: entry.at)
                heard = b"".join(entry.data for entry in wire[first:end] if entry.kind is WireKind.READ)
            if "".join(request.answer.split()) not in "".join(heard.decode("latin-1").split()):
                yield self.line.of(
                    request.ended, f"{request.text!r} was told {request.answer!r}, which did not come behind it"
                )

    def _shared(self, request: Request) -> int | None:
        """Find where the same was written for somebody else who had asked before."""
        of_others = (at for other in self.line.requests if other.text == request.text for at in other.written)
        return next((at for at in of_others if at >= request.index), None)

    def stop_is_next(self) -> Iterator[Finding]:
        """P6: a stop goes ahead of all that waits; ESC and ^C are written when they are asked for, and never wait."""
        starts = sorted((at, request) for request in self.line.requests for at in request.written[:1])
        for stop in self.line.requests:
            if stop.lane is not Lane.STOP or stop.how == "cancelled" or not self.line.is_open(stop.index):
                continue
            place = bisect_left(starts, stop.index, key=lambda start: start[0])
            for at, other in starts[place:]:
                if other.lane is Lane.STOP or at >= min(stop.written, default=len(self.line.wire)):
                    break
                if self.line.wire[at].at > stop.until or self.line.was_lost(stop.index, at):
                    break
                yield self.line.at(at, f"{other.text!r} went ahead of {stop.text!r}")
                break

    def possible_lines(self) -> Iterator[Finding]:
        """P9: all that is typed whole is a command, printable and no longer than a buffer."""
        for line in self.spoken.lines:
            text = line.text[self.mode != "single" :]
            if line.is_whole and (len(text) > MAX_COMMAND_LENGTH or not _PRINTABLE.fullmatch(line.text)):
                yield self.line.at(line.index, f"{line.text!r} is no command that an axis can be told")


def _settings(about: Mapping[str, Any]) -> SmcSettings:
    """Make settings of what the trace says of them; of the profile only times count here."""
    table = about.get("settings", {})
    if not isinstance(table, dict):
        raise InvalidCommandError("the settings in the trace are no table")
    known = {each.name for each in fields(SmcSettings)} - {"profile"}
    try:
        settings = SmcSettings(**{name: value for name, value in table.items() if name in known})
    except OverflowError:
        raise InvalidCommandError("a setting in the trace is larger than any number can be meant") from None
    profile = table.get("profile", {})
    reset_time_s = profile.get("reset_time_s") if isinstance(profile, dict) else None
    if reset_time_s is None:
        return settings
    return replace(settings, profile=replace(settings.profile, reset_time_s=reset_time_s))
