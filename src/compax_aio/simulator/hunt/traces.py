"""The promises, held against the recorded conversation with a drive: what held, what was broken where, what is open."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final

from compax_aio.compax.facts.line import COMMAND_END, MAX_LINE_LENGTH
from compax_aio.compax.settings import DriveSettings
from compax_aio.compax.settings_file import settings_from
from compax_aio.errors import InvalidCommandError
from compax_aio.link.contract import Lane
from compax_aio.recording import Conversation
from compax_aio.simulator.compax.binary import frame_length

from .recorded import (
    NO_ANSWER,
    NOT_IN_TRACES,
    SLACK_S,
    Finding,
    Outcome,
    RecordedLine,
    Request,
    Verdict,
    settled,
)
from .testimony import WireKind, longest_opening_s
from .turns import Turns, Ways, Written

__all__ = ["check_drive"]

_POSSIBLE: Final = re.compile(rf"(?=.{{1,{MAX_LINE_LENGTH}}}\Z)(?:[^\r\n$?!,>]+\$?,?|!)")
_PRINTABLE: Final = re.compile(r"[ -~]*")
_POSITIONING: Final = re.compile(r"POS[AR]|P[AHR](?![A-Z])")
_PREPARED_POINT: Final = re.compile(r"(?:POSR|PR).*(?:SPEED|SD|OUTPUT|OT)")
_FRAME: Final = re.compile(r"(?:[0-9A-F]{2} )+\((POS[AR]) (\S+)\)")
_STATUS: Final = frozenset({"S16", "S17"})
_TOLD_AS_LATE: Final = frozenset({"LateEnding", "InStep", "Stray"})
"""What the client says of an answer that nobody waits for: whose it was, that it settles a doubt, or that it is odd."""


def check_drive(conversation: Conversation) -> list[Verdict]:
    """
    Hold the promises against what was recorded of one drive.

    Raises:
        InvalidCommandError: The settings that the trace has of the drive cannot be meant.
    """
    return _Drive(conversation).verdicts()


class _Drive:
    def __init__(self, conversation: Conversation) -> None:
        self.conversation = conversation
        self.line = RecordedLine(conversation)
        self.settings = _settings(conversation.about)
        self.turns = Turns(
            self.line.wire,
            Ways(
                stop=self.settings.dialect.stop,
                decimals=self.settings.decimals,
                answer_timeout_s=self.settings.answer_timeout_s,
                numbers_follow=_numbers_follow(self.line),
                reconciled_at=self.line.resumed_at,
                slack_s=SLACK_S,
            ),
        )
        self.by_index = {each.index: each for each in self.turns.lines}
        self.noticed: dict[int, set[str]] = {}
        """What the client noticed, by how much had been on the wire."""
        self.ended_late: dict[str, int] = {}
        """Where on the wire a line was told as answered late, the last time."""
        for index, _, fact in self.line.noticed:
            self.noticed.setdefault(index, set()).add(fact.event)
            if fact.event == "LateEnding":
                self.ended_late[str((fact.details or {}).get("sent"))] = index

    def verdicts(self) -> list[Verdict]:
        """Say of each promise whether it held."""
        checks: Mapping[str, Callable[[], Iterator[Finding]]] = {
            "P1": self.turns_kept,
            "P2": self.at_most_once,
            "P3": self.settled,
            "P4": self.own_answers,
            "P6": self.stop_is_next,
            "P9": self.possible_lines,
            "P10": self.looked_before_motion,
        }
        told = [self._verdict(promise, check) for promise, check in checks.items()]
        session, line = self.conversation.session, self.conversation.line
        told += [Verdict(each, Outcome.UNKNOWN, session, line, why) for each, why in NOT_IN_TRACES.items()]
        return sorted(told, key=lambda each: int(each.promise[1:]))

    def _verdict(self, promise: str, check: Callable[[], Iterator[Finding]]) -> Verdict:
        session, line = self.conversation.session, self.conversation.line
        if findings := tuple(check()):
            return Verdict(promise, Outcome.BROKEN, session, line, self.line.broken_off, findings)
        if not self.turns.lines:
            return Verdict(promise, Outcome.UNKNOWN, session, line, self.line.broken_off or "nothing was sent")
        return Verdict(promise, Outcome.HELD, session, line, self.line.broken_off)

    # P1 -------------------------------------------------------------------------------------------------------------

    def turns_kept(self) -> Iterator[Finding]:
        """P1: no line is written while an earlier one is unanswered; in doubt, markers and stops alone."""
        for violation in self.turns.violations:
            yield self.line.at(violation.index, violation.how.partition(": ")[2])

    # P2 -------------------------------------------------------------------------------------------------------------

    def at_most_once(self) -> Iterator[Finding]:
        """P2: a motion is written once for each time that it was asked for; none while it is unknown what became."""
        wanted = Counter(_known_by(request.text) for request in self.line.requests)
        written: Counter[str] = Counter()
        for line in self.turns.lines:
            if not self._is_motion(line):
                continue
            motion = _known_by(line.text)
            written[motion] += 1
            if written[motion] > wanted[motion]:
                times = f"{written[motion]} times, and asked for {wanted[motion]} times"
                yield self.line.at(line.index, f"{line.text!r} was written {times}")
            elif line.in_doubt:
                yield self.line.at(line.index, f"{line.text!r}, which can move, was written while in doubt")
        for request in self.line.requests:
            motions = [index for index in request.written if self._moves(index)]
            if len(motions) > 1:
                yield self.line.at(motions[1], f"{request.text!r}, asked for once, was written {len(motions)} times")
        yield from self._motions_in_doubt()

    def _moves(self, index: int) -> bool:
        line = self.by_index.get(index)
        return line is not None and self._is_motion(line)

    def _is_motion(self, line: Written) -> bool:
        text = _known_by(line.text).replace(" ", "").upper()
        if text.endswith(","):
            return False  # it is kept, and not executed
        words = (word.partition("{")[0].replace(" ", "").upper() for word in self.settings.dialect.motions)
        if text == "!" or any(text.startswith(word) for word in words):
            return True
        return _POSITIONING.match(text) is not None and not _PREPARED_POINT.match(text)

    def _motions_in_doubt(self) -> Iterator[Finding]:
        """Find motions behind one of which nobody knew what had become, with no look at the drive between."""
        doubtful: Request | None = None
        looked = False
        by_place = {index: request for request in self.line.requests for index in request.written}
        for line in self.turns.lines:
            if line.text in _STATUS and line.answered_at is not None:
                looked = True
            if not self._is_motion(line):
                continue
            asked_again = doubtful is not None and not looked
            if asked_again and doubtful is not None and doubtful.until <= line.at and not self._resumed(doubtful, line):
                yield self.line.at(
                    line.index,
                    f"{line.text!r} was written, and nobody had looked what had become of {doubtful.text!r}, "
                    f"which ended at {doubtful.until:.3f} as {doubtful.how}",
                )
            request = by_place.get(line.index)
            is_lost = request is not None and request.how in NO_ANSWER
            doubtful, looked = (request, False) if is_lost else (None, True)

    def _resumed(self, doubtful: Request, line: Written) -> bool:
        return any(doubtful.asked.at <= at <= line.at for at in self.line.resumed_at)

    # P3 -------------------------------------------------------------------------------------------------------------

    def settled(self) -> Iterator[Finding]:
        """P3: everything asked for ends in bounded time."""
        settings = self.settings
        patience_s = settings.in_doubt_after_s + longest_opening_s(settings)
        return settled(self.line, 2 * settings.answer_timeout_s, patience_s)

    # P4 -------------------------------------------------------------------------------------------------------------

    def own_answers(self) -> Iterator[Finding]:
        """P4: who has asked is told what came behind his own question; what comes late is told as late."""
        for request in self.line.requests:
            if request.ended is None or request.lane is Lane.STOP:
                continue
            if request.how == "Answered" and not self._was_answered(request):
                yield self.line.of(
                    request.ended, f"{request.text!r} was told {request.answer!r}, which did not come as its answer"
                )
            elif request.how == "Acknowledged" and not self._was_acknowledged(request):
                yield self.line.of(request.ended, f"{request.text!r} was told as taken, and nothing came that says so")
        for late in self.turns.late:
            if not self.noticed.get(late.index + 1, set()) & _TOLD_AS_LATE:
                yield self.line.at(late.index, f"the answer to {late.text!r} came late, and was not told as late")

    def _was_answered(self, request: Request) -> bool:
        return any(
            line.answer == request.answer
            and line.answered_at is not None
            and line.answered_at <= request.until + SLACK_S
            for line in self._lines_for(request)
        )

    def _was_acknowledged(self, request: Request) -> bool:
        is_late = self.ended_late.get(request.text, -1) >= request.index
        return is_late or any(
            line.over_at is not None and line.over_at <= request.until + SLACK_S for line in self._lines_for(request)
        )

    def _lines_for(self, request: Request) -> Iterator[Written]:
        """Find the lines that may be his: written for him, or, where others asked the same before, for them."""
        for line in self.turns.between(request.asked.at - SLACK_S, request.until + SLACK_S):
            if line.index >= request.index and (line.text == request.text or line.index in request.written):
                yield line

    # P6 -------------------------------------------------------------------------------------------------------------

    def stop_is_next(self) -> Iterator[Finding]:
        """P6: a stop goes ahead of everything that waits, and waits for the exchange in flight at most."""
        for request in self.line.requests:
            if request.lane is Lane.STOP and self.line.is_open(request.index) and request.how != "cancelled":
                yield from self._not_next(request)

    def _not_next(self, request: Request) -> Iterator[Finding]:
        after = [line for line in self.turns.lines if line.index >= request.index][:2]
        first = after[0] if after else None
        until = len(self.line.wire) if first is None else first.index
        if self.line.was_lost(request.index, until):
            return
        if self.turns.was_free(request.index):
            if first is None or first.text != request.text or first.at > request.asked.at + SLACK_S:
                yield self.line.of(request.asked, f"the line was free, and {request.text!r} was not written at once")
        elif first is not None and first.text != request.text and not (first.in_doubt and first.is_marker):
            if first.at <= request.until:
                yield self.line.at(first.index, f"{first.text!r} went ahead of {request.text!r}")
        elif first is None and request.until > request.asked.at + 2 * self.settings.answer_timeout_s < self.line.until:
            yield self.line.of(request.asked, f"{request.text!r} was not written")

    # P9 -------------------------------------------------------------------------------------------------------------

    def possible_lines(self) -> Iterator[Finding]:
        """P9: all that is written is lines, or frames, that a drive can be told."""
        for line in self.turns.lines:
            data = self.line.wire[line.index].data
            if line.is_frame:
                if frame_length(data[0]) != len(data) or not line.text.endswith(")"):  # with what it means
                    yield self.line.at(line.index, f"{line.text!r} is no frame")
            elif not data.endswith(COMMAND_END):
                yield self.line.at(line.index, f"{line.text!r} has no end")
            elif not (_POSSIBLE.fullmatch(line.text) and _PRINTABLE.fullmatch(line.text)):
                yield self.line.at(line.index, f"{line.text!r} is no line that a drive can be told")

    # P10 ------------------------------------------------------------------------------------------------------------

    def looked_before_motion(self) -> Iterator[Finding]:
        """P10: on each line that is new it is looked how the drive stands before anything goes that can move."""
        wanted = set(_STATUS)
        opened = iter([*(at for at, entry in enumerate(self.line.wire) if entry.kind is WireKind.OPENED), 1 << 62])
        next_opened = next(opened)
        for line in self.turns.lines:
            while line.index > next_opened:
                wanted, next_opened = set(_STATUS), next(opened)
            if line.over_at is not None and line.text in _STATUS:
                wanted -= {line.text} if line.is_answered else _STATUS  # a drive that refuses has been asked
            if wanted and self._is_motion(line):
                yield self.line.at(
                    line.index, f"{line.text!r} was written on a new line, and {', '.join(sorted(wanted))} not asked"
                )
                wanted = set()


def _numbers_follow(line: RecordedLine) -> bool:
    """Whether the number of a comparator was read before a prompt came behind it."""
    return any(
        fact.event == "ComparatorReached" and index and line.wire[index - 1].data[-1:].isdigit()
        for index, _, fact in line.noticed
    )


def _settings(about: Mapping[str, Any]) -> DriveSettings:
    table = about.get("settings", {})
    if not isinstance(table, dict):
        raise InvalidCommandError("the settings in the trace are no table")
    return settings_from(table)


def _known_by(text: str) -> str:
    """Write a motion as it is known by, whether as a line or as a frame, and whatever the decimals."""
    if found := _FRAME.fullmatch(text):
        text = f"P{found[1][3]}{found[2]}"
    if found := re.fullmatch(r"(P[AR])(-?\d{1,9}(?:\.\d{1,9})?)([$,]*)", text):
        return f"{found[1]}{float(found[2]):.3f}{found[3].replace('$', '')}"
    return text
