"""
The COMPAX line, sans-IO: one line out, then nothing until its prompt is back (UG p. 160).

In step, every answer belongs to the one line that is outstanding. After a time-out, and on a new line, the protocol is
in doubt: a ledger holds what was sent and not answered, oldest first, and a *marker* (a status query whose number no
other entry bears) is asked until its answer comes. The drive works in order, so that answer proves all before it
answered, refused or lost. A lone CR would be shorter and is never sent: it executes half a line that may stand in the
drive's buffer, perhaps a motion.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Final

from ..errors import LinkProtocolError
from ..link.contract import Event, InStep, LateEnding, MarkerSpent, TurnOver
from .facts.limits import MAX_PREPARED_POINTS
from .facts.line import COMMAND_END, POSITION_REACHED_SIGN, PROMPT, XOFF, XON
from .facts.status import MARKERS

__all__ = [
    "TRANSITIONS",
    "Acknowledged",
    "Answered",
    "ComparatorReached",
    "CompaxProtocol",
    "MessageForm",
    "PositionReached",
    "Rejected",
    "State",
    "Stray",
    "UnexpectedAnswer",
]

_MAX_TOKEN: Final = 256
"""Bytes kept while no prompt comes; the longest answer documented has 29 (UG p. 209)."""

_MAX_LEDGER: Final = 16_384
"""Lines remembered as unanswered: as markers, 64 KiB, which is what a transport takes before it says it is full."""


class State(Enum):
    """Whose turn it is, and whether that is certain."""

    READY = "in step, nothing outstanding"
    AWAITING_ANSWER = "in step, one line outstanding"
    IN_DOUBT = "it is unknown what the drive will answer next"
    AWAITING_MARKER = "in doubt, a marker is outstanding"
    AWAITING_AHEAD = "in doubt, a line sent ahead is outstanding"


class MessageForm(Enum):
    """What a drive answers to a command that carries ``$``."""

    UNKNOWN = "not seen yet"
    PROMPT_FIRST = "its prompt at once, and the message at position reached"
    FINAL_ONLY = "nothing but the message at position reached"


@dataclass(frozen=True, slots=True)
class Acknowledged(TurnOver):
    """The command was accepted: a bare prompt came (or, *by_message*, its ``$`` did instead)."""

    by_message: bool = False


@dataclass(frozen=True, slots=True)
class Answered(TurnOver):
    """The query was answered with *text*, prompt and echo taken off."""

    text: str


@dataclass(frozen=True, slots=True)
class Rejected(TurnOver):
    """The line was refused with an error number; *text* is all that came."""

    code: int
    text: str


@dataclass(frozen=True, slots=True)
class UnexpectedAnswer(TurnOver):
    """A command was answered with *text*, which is neither a prompt nor an error; the line is in doubt."""

    text: str


@dataclass(frozen=True, slots=True)
class PositionReached(Event):
    """The drive sent ``$`` (UG p. 160)."""


@dataclass(frozen=True, slots=True)
class ComparatorReached(Event):
    """The drive sent the number of a comparator, counted in the order of programming (UG p. 162)."""

    number: int


@dataclass(frozen=True, slots=True)
class Stray(Event):
    """Something came that answers nothing outstanding: noise, a doubled or late answer, a text nobody asked for."""

    text: str


@dataclass(frozen=True, slots=True)
class _CommandSent(Event):
    pass


@dataclass(frozen=True, slots=True)
class _MarkerSent(Event):
    pass


@dataclass(frozen=True, slots=True)
class _SentAhead(Event):
    pass


@dataclass(frozen=True, slots=True)
class _TimeRanOut(Event):
    pass


@dataclass(frozen=True, slots=True)
class _LineOpened(Event):
    pass


TRANSITIONS: Final[Mapping[tuple[State, type[Event]], State]] = {
    (State.READY, _CommandSent): State.AWAITING_ANSWER,
    (State.AWAITING_ANSWER, Acknowledged): State.READY,
    (State.AWAITING_ANSWER, Answered): State.READY,
    (State.AWAITING_ANSWER, Rejected): State.READY,
    (State.AWAITING_ANSWER, UnexpectedAnswer): State.IN_DOUBT,
    (State.AWAITING_ANSWER, _TimeRanOut): State.IN_DOUBT,
    # Something unasked for in a quiet moment means that turns were miscounted, here or there: find out.
    (State.READY, Stray): State.IN_DOUBT,
    (State.AWAITING_ANSWER, Stray): State.AWAITING_ANSWER,
    (State.IN_DOUBT, Stray): State.IN_DOUBT,
    (State.AWAITING_MARKER, Stray): State.AWAITING_MARKER,
    (State.AWAITING_AHEAD, Stray): State.AWAITING_AHEAD,
    # In doubt: markers, and what may go ahead of them.
    (State.IN_DOUBT, _MarkerSent): State.AWAITING_MARKER,
    (State.IN_DOUBT, _SentAhead): State.AWAITING_AHEAD,
    (State.AWAITING_MARKER, _TimeRanOut): State.IN_DOUBT,
    (State.AWAITING_AHEAD, _TimeRanOut): State.IN_DOUBT,
    (State.AWAITING_MARKER, MarkerSpent): State.IN_DOUBT,
    (State.AWAITING_AHEAD, MarkerSpent): State.IN_DOUBT,
    (State.IN_DOUBT, LateEnding): State.IN_DOUBT,
    (State.AWAITING_MARKER, LateEnding): State.AWAITING_MARKER,
    (State.AWAITING_AHEAD, LateEnding): State.AWAITING_AHEAD,
    (State.IN_DOUBT, InStep): State.READY,
    (State.AWAITING_MARKER, InStep): State.READY,
    (State.AWAITING_AHEAD, InStep): State.READY,
    # Messages come unasked (UG p. 160, 162); the prompt that ends one frees no command.
    **{(state, message): state for state in State for message in (PositionReached, ComparatorReached)},
    **{(state, _LineOpened): State.IN_DOUBT for state in State},
}

_BUSY: Final = frozenset({State.AWAITING_ANSWER, State.AWAITING_MARKER, State.AWAITING_AHEAD})
_DOUBTFUL: Final = frozenset({State.IN_DOUBT, State.AWAITING_MARKER, State.AWAITING_AHEAD})

_QUERY: Final = re.compile(r"([SPVN])0*(\d{1,3})")
_ANSWER: Final = re.compile(r"([SPVN])0*(\d{1,3})(?!\d)\s*[:=]?\s*(.*)", re.DOTALL)
# "E" and digits anywhere on the line, with or without text around them; the manual's page on it was not available.
_ERROR: Final = re.compile(r"(?<![A-Z0-9.])E(\d{1,3})(?!\d|\.\d)")
_COMPARATOR: Final = re.compile(rf"[1-{MAX_PREPARED_POINTS}]")
# The running text of UG p. 162 prints prompt, then number: such a number stands right before the next answer.
_COMPARATOR_BEFORE: Final = re.compile(rf"([1-{MAX_PREPARED_POINTS}])\s*(?=[SPVNE$])")
_NOT_TEXT: Final = bytes({0, XON, XOFF})


@dataclass(frozen=True, slots=True)
class _Sent:
    """A line that was sent, and what its answer looks like."""

    text: str
    key: tuple[str, str] | None
    """Letter and number that a query's answer begins with; None for a command."""

    @classmethod
    def of(cls, text: str) -> _Sent:
        query = _QUERY.fullmatch(text.replace(" ", ""))
        return cls(text, (query[1], query[2]) if query else None)

    @property
    def wants_message(self) -> bool:
        return self.text.endswith(POSITION_REACHED_SIGN)


class CompaxProtocol:
    """
    The host's end of a COMPAX line; see :class:`~compax_aio.link.contract.DeviceProtocol` for its doors.

    Args:
        message_form: What the drive answers to a command with ``$``, if that is known; else it is learnt.
    """

    def __init__(self, message_form: MessageForm = MessageForm.UNKNOWN) -> None:
        self.state = State.IN_DOUBT
        self.message_form = message_form
        self._ledger: deque[_Sent] = deque(maxlen=_MAX_LEDGER)
        self._received = bytearray()
        self._to_send: list[bytes] = []
        self._events: list[Event] = []
        self._next_marker = 0
        self._number_may_follow = False
        self._flood = ""

    # What the link asks ---------------------------------------------------------------------------------------------

    @property
    def in_doubt(self) -> bool:
        """Whether it is unknown what the drive will answer next."""
        return self.state in _DOUBTFUL

    @property
    def is_busy(self) -> bool:
        """Whether a line is outstanding."""
        return self.state in _BUSY

    # What the link does ---------------------------------------------------------------------------------------------

    def line_opened(self) -> None:
        """Take note that the line is new; what stands in the drive's buffer is unknown."""
        self._received.clear()
        self._to_send.clear()
        self._flood = ""
        self._number_may_follow = False
        # Queries of the old line may still be answered, by a device server; a prompt on the new one proves nothing.
        self._ledger = deque((sent for sent in self._ledger if sent.key), maxlen=_MAX_LEDGER)
        self._step(_LineOpened())

    def send(self, text: str) -> None:
        """Begin the exchange of *text*, one line without its CR."""
        self._step(_CommandSent())
        self._write(text)

    def send_marker(self) -> None:
        """Ask a status value whose number tells its answer from every other that may still come."""
        self._step(_MarkerSent())
        self._write(self._choose_marker())

    def send_ahead(self, text: str) -> None:
        """Send *text* although in doubt; whatever comes next ends its turn and proves nothing."""
        self._step(_SentAhead())
        self._write(text)

    def time_ran_out(self) -> None:
        """Give the outstanding line up; its answer, should it come, is late."""
        self._step(_TimeRanOut())

    def bytes_to_send(self) -> bytes:
        """Take what is to be written now."""
        data = b"".join(self._to_send)
        self._to_send.clear()
        return data

    def receive(self, data: bytes) -> None:
        """Read *data*, a piece of any size; see :meth:`events`."""
        # Flow control comes anywhere, in the middle of a prompt too.
        self._received += data.translate(None, _NOT_TEXT)
        while (end := self._received.find(PROMPT)) >= 0:
            self._read_number_after_prompt()
            end = self._received.find(PROMPT)
            token = bytes(self._received[: min(end, _MAX_TOKEN + 1)])
            del self._received[: end + len(PROMPT)]
            if len(token) > _MAX_TOKEN:
                self._begin_flood(token)
            if self._flood:
                self._end_flood()
            else:
                self._read_token(token)
        self._read_number_after_prompt()
        if len(self._received) > _MAX_TOKEN + len(PROMPT) - 1:
            self._begin_flood(bytes(self._received))
            del self._received[: 1 - len(PROMPT)]

    def events(self) -> list[Event]:
        """Take what has been noticed since the last call, in order."""
        events, self._events = self._events, []
        return events

    # Turns ----------------------------------------------------------------------------------------------------------

    def _step(self, event: Event) -> None:
        try:
            self.state = TRANSITIONS[self.state, type(event)]
        except KeyError:
            raise LinkProtocolError(
                f"{type(event).__name__.lstrip('_')} is not possible while {self.state.value}",
                sent=self._ledger[-1].text if self._ledger else None,
                hint="wait for the turn to be over",
            ) from None

    def _notice(self, event: Event) -> None:
        self._step(event)
        self._events.append(event)

    def _write(self, text: str) -> None:
        self._ledger.append(_Sent.of(text))
        self._to_send.append(text.encode("ascii") + COMMAND_END)

    def _choose_marker(self) -> str:
        unanswered = {sent.key for sent in self._ledger}
        for _ in MARKERS:
            number = MARKERS[self._next_marker % len(MARKERS)]
            self._next_marker += 1
            if ("S", str(number)) not in unanswered:
                break
        return f"S{number}"

    def _end_turn(self, outcome: TurnOver) -> None:
        if not isinstance(outcome, UnexpectedAnswer):
            self._ledger.clear()
        self._notice(outcome)

    # Reading --------------------------------------------------------------------------------------------------------

    def _read_number_after_prompt(self) -> None:
        """Read the comparator number that may follow a prompt nobody waited for (the running text of UG p. 162)."""
        if self._number_may_follow and self._received:
            self._number_may_follow = False
            if number := _COMPARATOR.match(self._received[:1].decode("latin-1")):
                del self._received[:1]
                self._notice(ComparatorReached(int(number[0])))

    def _begin_flood(self, data: bytes) -> None:
        """Note that more has come than any answer has; once, until the next prompt."""
        if not self._flood:
            self._flood = _as_text(data[:_MAX_TOKEN])
            self._notice(Stray(self._flood))

    def _end_flood(self) -> None:
        """Read the prompt that ends a flood: it acknowledges nothing."""
        text, self._flood = self._flood, ""
        if self.state is State.AWAITING_ANSWER and self._ledger[-1].key is None:
            self._end_turn(UnexpectedAnswer(text))

    def _read_token(self, raw: bytes) -> None:
        """Read what stood before one prompt: usually one line or none, after noise or an echo more."""
        lines = [line.strip(" \t>") for line in re.split(r"[\r\n]+", _as_text(raw))]
        lines = [rest for line in lines if (rest := self._without_echo(line))]
        for line in lines[:-1]:
            self._read_unterminated(line)
        self._read_line(lines[-1] if lines else "")

    def _without_echo(self, line: str) -> str:
        """Take off an echo of the line that is outstanding, with its CR or glued to the answer."""
        if not self._ledger or not line.startswith((sent := self._ledger[-1]).text):
            return line
        rest = line[len(sent.text) :].lstrip()
        if sent.key is None:
            return rest if not rest or rest[0] in "SPVNE$" else line
        # "N5 END" is the answer to "N5", with a blank for a colon; "N5N005: END" is an echo and the answer.
        answer = _ANSWER.fullmatch(rest)
        is_echo = not rest or (answer is not None and (answer[1], answer[2]) == sent.key)
        return rest if is_echo or re.fullmatch(r"E\d{1,3}", line[len(sent.text) :]) else line

    def _read_unterminated(self, line: str) -> None:
        """Read a line whose prompt did not come through; it ends no turn."""
        self._notice(Stray(line))

    def _read_line(self, line: str) -> None:
        if before := _COMPARATOR_BEFORE.match(line):
            self._notice(ComparatorReached(int(before[1])))
            line = line[before.end() :]
        if line == POSITION_REACHED_SIGN:
            self._read_position_reached()
        elif _COMPARATOR.fullmatch(line):
            self._notice(ComparatorReached(int(line)))
        elif not line:
            self._read_prompt()
        elif answer := _ANSWER.fullmatch(line):
            self._read_answer((answer[1], answer[2]), line)
        elif error := _ERROR.search(line):
            self._read_error(int(error[1]), line)
        elif self.state is State.AWAITING_ANSWER and self._ledger[-1].key is None:
            self._end_turn(UnexpectedAnswer(line))
        else:
            self._notice(Stray(line))

    def _read_prompt(self) -> None:
        commands = [sent for sent in self._ledger if sent.key is None]
        if self.state is State.AWAITING_ANSWER and commands:
            if commands[-1].wants_message and self.message_form is MessageForm.UNKNOWN:
                self.message_form = MessageForm.PROMPT_FIRST
            self._end_turn(Acknowledged())
        elif self.state is State.AWAITING_AHEAD:
            # Its own prompt, or a late one of an earlier line; a marker will tell, nothing else can.
            self._notice(MarkerSpent())
        elif self.in_doubt and len(commands) == 1:
            self._end_late(commands[0], Acknowledged())
        else:
            self._number_may_follow = True
            self._notice(Stray(""))

    def _read_answer(self, key: tuple[str, str], line: str) -> None:
        asked = next((sent for sent in self._ledger if sent.key == key), None)
        if asked is None:
            self._notice(Stray(line))
        elif self.state is State.AWAITING_ANSWER:
            self._end_turn(Answered(line))
        elif self.state is State.AWAITING_MARKER and asked is self._ledger[-1]:
            self._ledger.clear()
            self._notice(InStep())
        else:
            self._end_late(asked, Answered(line))

    def _read_error(self, code: int, line: str) -> None:
        if self.state is State.AWAITING_ANSWER:
            self._end_turn(Rejected(code, line))
        elif self.state is State.IN_DOUBT and len(self._ledger) == 1:
            self._end_late(self._ledger[0], Rejected(code, line))
        elif self.state is State.AWAITING_MARKER and len(self._ledger) == 1:
            # Half a line stood in the drive's buffer and has taken ours with it; the buffer is clean now.
            self._ledger.clear()
            self._notice(MarkerSpent())
        elif self.state is State.AWAITING_AHEAD:
            self._notice(MarkerSpent())
        else:
            # Of an earlier line or of the marker: no telling. The marker's answer or its time-out decides.
            self._notice(Stray(line))

    def _read_position_reached(self) -> None:
        waiting = next((sent for sent in self._ledger if sent.wants_message), None)
        if waiting is None or self.message_form is MessageForm.PROMPT_FIRST:
            self._notice(PositionReached())
        elif self.state is State.AWAITING_ANSWER:
            self._end_turn(Acknowledged(by_message=True))
            self._notice(PositionReached())
        else:
            self._end_late(waiting, Acknowledged(by_message=True))
            self._notice(PositionReached())

    def _end_late(self, sent: _Sent, outcome: TurnOver) -> None:
        """Credit an answer to the oldest line it can belong to; all that is older was lost or refused."""
        while self._ledger.popleft() is not sent:
            pass
        self._notice(LateEnding(sent.text, outcome))
        if not self._ledger:
            self._notice(InStep())


def _as_text(raw: bytes) -> str:
    return raw.translate(None, _NOT_TEXT).decode("latin-1")
