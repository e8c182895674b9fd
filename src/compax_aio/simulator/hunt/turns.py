"""
Reads turns out of a line's bytes alone: what was outstanding when, whether in doubt, and who was out of turn.

It is written from the promise, not from the client: an answer ends the turn of the line that it can answer; a line that
was given up leaves a doubt, which an answer bearing the number of a status query ends.
"""

from __future__ import annotations

import re
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from compax_aio.compax.facts.line import POSITION_REACHED_SIGN, PROMPT, XOFF, XON
from compax_aio.compax.facts.status import MARKERS
from compax_aio.simulator.compax.binary import shown

from .testimony import WireEntry, WireKind

__all__ = ["LateAnswer", "Turns", "Violation", "Ways", "Written"]

_EPSILON_S: Final = 1e-6
_NOT_TEXT: Final = bytes({0, XON, XOFF})
_ANSWER: Final = re.compile(r"([SPVN])0*(\d{1,3})(?!\d)", re.DOTALL)
_QUERY: Final = re.compile(r"([SPVN])0*(\d{1,3})")
_ERROR: Final = re.compile(r"E\d{1,3}(?!\d)")
_NUMBER_BEFORE: Final = re.compile(r"[1-8]\s*(?=[SPVNE$])")
_PLAIN: Final = re.compile(r"[ -~]*")
_FRAME_OF_MOTION: Final = re.compile(rb"\x88[AR]")
_LONGEST_ANSWER: Final = 256
_STOPS_THAT_FILL_A_FRAME: Final = 2


@dataclass(slots=True, eq=False)
class Written:
    """One line, as the client wrote it."""

    index: int
    """Its place among all that happened on the wire."""
    at: float
    text: str
    """Without its CR; of a frame, as the drive's log shows it."""
    is_frame: bool
    in_doubt: bool
    """It was written while nobody knew what the drive would answer next."""
    over_at: float | None = None
    """When its turn was over; None if its time ran out."""
    is_acknowledged: bool = False
    """A bare prompt came to it."""
    is_answered: bool = False
    """An answer that bears its name came to it …"""
    answer: str = ""
    """… and this is it."""
    answered_at: float | None = None
    """When, in its turn or late."""

    @property
    def key(self) -> tuple[str, str] | None:
        """Letter and number that the answer to a query begins with."""
        found = _QUERY.fullmatch(self.text)
        return (found[1], found[2]) if found else None

    @property
    def is_marker(self) -> bool:
        """Whether it can be a query that gets a line in step."""
        key = self.key
        return key is not None and key[0] == "S" and int(key[1]) in MARKERS


@dataclass(frozen=True, slots=True)
class Violation:
    """Something that was out of turn."""

    index: int
    """Its place among all that happened on the wire."""
    how: str

    def __str__(self) -> str:
        return self.how


@dataclass(frozen=True, slots=True)
class LateAnswer:
    """An answer to a line whose time had run out."""

    index: int
    at: float
    text: str
    """Of the line."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ways:
    """How a drive and its client speak, as far as turns depend on it."""

    stop: str
    """The word for STOP."""
    decimals: int
    answer_timeout_s: float
    numbers_follow: bool = False
    """The number of a comparator comes behind a prompt of its own."""
    reconciled_at: Sequence[float] = ()
    """When somebody said that half a frame does no harm."""
    slack_s: float = _EPSILON_S
    """By so much the times of the wire may be wrong."""


class Turns:
    """
    The turns of one line.

    Args:
        wire: What was written and read on it, and when it was opened.
        ways: How the two ends speak.

    Attributes:
        lines: All that the client wrote, in order.
        violations: What was out of turn.
        late: Answers that came when nobody waited for them any more.
    """

    def __init__(self, wire: Sequence[WireEntry], ways: Ways) -> None:
        self.lines: list[Written] = []
        self.violations: list[Violation] = []
        self.late: list[LateAnswer] = []
        self._ways = ways
        self._index = 0
        self._outstanding: Written | None = None
        self._unanswered: list[Written] = []
        self._in_doubt = True
        self._is_sure = True
        """Nothing came since the last line that the client may have read otherwise."""
        self._frame: Written | None = None
        self._cut_frame_at: float | None = None
        self._answers_to_go = 0
        self._received = bytearray()
        self._changes: list[tuple[int, bool]] = []
        for index, entry in enumerate(wire):
            self._index = index
            self._take(index, entry)
            self._changes.append((index, self._is_free))

    def was_free(self, index: int) -> bool:
        """Whether, before what happened at *index*, a line could be written at once."""
        place = bisect_right(self._changes, (index - 1, True))
        return place > 0 and self._changes[place - 1][1]

    def between(self, since: float, until: float) -> list[Written]:
        """List what was written from *since* to *until*."""
        first = bisect_left(self.lines, since, key=lambda line: line.at)
        return self.lines[first : bisect_right(self.lines, until, key=lambda line: line.at)]

    @property
    def _is_free(self) -> bool:
        return self._outstanding is None and not self._in_doubt and self._is_sure

    def _take(self, index: int, entry: WireEntry) -> None:
        if entry.kind is WireKind.WRITTEN:
            self._write(index, entry)
        elif entry.kind is WireKind.READ:
            self._received += entry.data.translate(None, _NOT_TEXT)
            while (end := self._received.find(PROMPT)) >= 0:
                token = bytes(self._received[:end])
                del self._received[: end + len(PROMPT)]
                self._read(token, entry.at)
        elif entry.kind is WireKind.OPENED:
            self._received.clear()
            self._outstanding = None
            self._unanswered = [line for line in self._unanswered if line.key]
            self._in_doubt = True

    # Written --------------------------------------------------------------------------------------------------------

    def _write(self, index: int, entry: WireEntry) -> None:
        is_frame = entry.data[:1] >= b"\x80"
        text = shown(entry.data, self._ways.decimals) if is_frame else entry.data.removesuffix(b"\r").decode("latin-1")
        if self._outstanding is not None:
            self._give_up(entry, text)
        line = Written(index, entry.at, text, is_frame, self._in_doubt)
        if self._in_doubt and not (line.is_marker or text == self._ways.stop):
            self._violated(f"{entry.at:.4f}: {text!r} was written while in doubt")
        if self._cut_frame_at is not None and text != self._ways.stop:
            if any(at >= self._cut_frame_at for at in self._ways.reconciled_at):
                self._cut_frame_at = None
            else:
                self._violated(f"{entry.at:.4f}: {text!r} was written behind a frame that may be cut")
        if is_frame and _FRAME_OF_MOTION.match(entry.data):
            self._frame = line
        self._outstanding, self._is_sure = line, True
        self._unanswered.append(line)
        self.lines.append(line)

    def _give_up(self, entry: WireEntry, text: str) -> None:
        before = self._outstanding
        assert before is not None
        if entry.at - before.at < self._ways.answer_timeout_s - self._ways.slack_s:
            self._violated(
                f"{entry.at:.4f}: {text!r} was written {entry.at - before.at:.4f} s after {before.text!r}, which was "
                "not answered"
            )
        self._in_doubt = True
        if before is self._frame and self._cut_frame_at is None:
            self._cut_frame_at = before.at
            self._answers_to_go = _STOPS_THAT_FILL_A_FRAME

    def _violated(self, how: str) -> None:
        self.violations.append(Violation(self._index, how))

    # Read -----------------------------------------------------------------------------------------------------------

    def _read(self, token: bytes, at: float) -> None:
        text, is_plain = self._last_line(token)
        line = self._outstanding
        if not is_plain and line is not None:  # noise: no telling what the client may make of it
            self._over(line, at)
            line = None
            self._is_sure = False
        if text == POSITION_REACHED_SIGN:
            self._read_message(line, at)
        elif len(text) == 1 and text in "12345678":
            if self._ways.numbers_follow:
                self._read_prompt(line, at)
        elif not text:
            self._read_prompt(line, at)
        elif found := _ANSWER.match(text):
            self._read_answer((found[1], found[2]), text, at)
        else:
            self._read_text(line, at, is_error=_ERROR.search(text) is not None)

    def _last_line(self, token: bytes) -> tuple[str, bool]:
        """Return what stands before a prompt, without echo, and whether that is all plain."""
        sent = self._unanswered[-1].text if self._unanswered else None
        lines = [line.strip(" \t>") for line in re.split(r"[\r\n]+", token.decode("latin-1"))]
        if sent is not None:
            lines = [_without_echo(line, sent) for line in lines]
        lines = [line for line in lines if line]
        text = lines[-1] if lines else ""
        if before := _NUMBER_BEFORE.match(text):
            text = text[before.end() :]
        is_plain = len(lines) <= 1 and _PLAIN.fullmatch(text) is not None and len(token) <= _LONGEST_ANSWER
        return text, is_plain

    def _over(self, line: Written, at: float) -> None:
        line.over_at = at
        if self._outstanding is line:
            self._outstanding = None

    def _settle_up_to(self, line: Written) -> None:
        """Take note that all up to *line* is answered, refused or lost."""
        if line in self._unanswered:
            del self._unanswered[: self._unanswered.index(line) + 1]
        if not self._unanswered:
            self._in_doubt = False

    def _answered_something(self) -> None:
        if self._cut_frame_at is not None:
            self._answers_to_go -= 1
            if self._answers_to_go <= 0:
                self._cut_frame_at = None

    def _read_message(self, line: Written | None, at: float) -> None:
        waiting = next((each for each in self._unanswered if POSITION_REACHED_SIGN in each.text), None)
        if waiting is not None:
            self._settle_up_to(waiting)
            if waiting is line:
                self._over(waiting, at)

    def _read_prompt(self, line: Written | None, at: float) -> None:
        self._answered_something()
        commands = [each for each in self._unanswered if each.key is None]
        if line is not None and line.key is None:
            self._over(line, at)
            line.is_acknowledged = not self._in_doubt
            if not self._in_doubt:
                self._unanswered.clear()
                return
        if len(commands) == 1:
            self._settle_up_to(commands[0])

    def _read_answer(self, key: tuple[str, str], text: str, at: float) -> None:
        asked = next((each for each in self._unanswered if each.key == key), None)
        if asked is not None:
            last = self._unanswered[-1]
            # In doubt, the newest of a number is meant only if no older one is unanswered.
            self._settle_up_to(asked)
            asked.is_answered, asked.answer, asked.answered_at = True, text, at
            if asked is self._outstanding:
                self._over(asked, at)
            elif asked.over_at is None:  # else something unreadable came first
                self.late.append(LateAnswer(self._index, at, asked.text))
            if asked is last:
                self._in_doubt = False

    def _read_text(self, line: Written | None, at: float, *, is_error: bool) -> None:
        self._answered_something()
        if is_error and self._in_doubt:
            self._is_sure = False  # of an earlier line or of the last: the client may wait
        if line is not None and (is_error or line.key is None):
            self._over(line, at)
            if not self._in_doubt and is_error:
                self._unanswered.clear()
        elif line is None and is_error and len(self._unanswered) == 1:
            self._settle_up_to(self._unanswered[0])
        if is_error and len(self._unanswered) == 1:
            self._unanswered.clear()


def _without_echo(line: str, sent: str) -> str:
    rest = line[len(sent) :].strip()
    return rest if line.startswith(sent) and (not rest or rest[0] in "SPVNE$") else line
