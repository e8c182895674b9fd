"""
The COMPAX line, sans-IO: one line out, then nothing until its prompt is back (UG p. 160).

In step, every answer belongs to the one line that is outstanding. After a time-out, and on a new line, the protocol is
in doubt: a ledger holds what was sent and not answered, oldest first, and a *marker* (a status query whose number no
other entry bears) is asked until its answer comes. The drive works in order, so that answer proves all before it
answered, refused or lost. A lone CR would be shorter and is never sent: it executes half a line that may stand in the
drive's buffer, perhaps a motion. A motion in binary has no end sign; where one may have been cut, not even a marker is
sent, for it could be taken for the rest.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Final, TypeGuard

from ..errors import LinkProtocolError
from ..link.contract import Event, Hold, HoldOver, InStep, LateEnding, MarkerSpent, Stranger, TurnOver
from .answers import ANSWER, COMPARATOR, COMPARATOR_BEFORE, LINE_ENDS, NOT_TEXT, PLAIN_ANSWER, as_text
from .binary import encode_ascii, is_motion_frame
from .facts.line import ERROR_PATTERN, POSITION_REACHED_SIGN, PROMPT
from .ledger import Ledger, Sent
from .protocol_events import (
    Acknowledged,
    Answered,
    ComparatorReached,
    MessageForm,
    PositionReached,
    Rejected,
    Stray,
    UnexpectedAnswer,
)
from .protocol_states import (
    AHEAD,
    AWAITING,
    BUSY,
    DOUBTFUL,
    HELD,
    MEANINGS,
    TRANSITIONS,
    CommandSent,
    LineOpened,
    MarkerSent,
    MotionFrameSent,
    Resumed,
    SentAhead,
    State,
    TimeRanOut,
)
from .recognition import Recognition

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

_AWAITING_ANSWER: Final = State.AWAITING_ANSWER
"""What each answer is read in; to find a member in its enum costs CPython 3.11 as much as some twenty steps."""

_MAX_TOKEN: Final = 256
"""Bytes kept while no prompt comes; the longest answer documented has 29 (UG p. 209)."""

_STOPS_THAT_FILL_A_FRAME: Final = 2
"""Half a frame answers nothing, so one answer after a stop shows that there is none; one may have been of no stop."""


class CompaxProtocol:
    """
    The host's end of a COMPAX line; see :class:`~compax_aio.link.contract.DeviceProtocol` for its doors.

    Args:
        message_form: What the drive answers to a command with ``$``, if that is known; else it is learnt.
        encode: Writes a line as it goes out; :class:`~compax_aio.compax.binary.BinaryTransfer` does it in binary. It
            counts from the next line on, and whatever goes out, a line is known and told by its text.
        error_pattern: Finds an error in an answer; its first group is the code.
    """

    patience_s: float | None = None
    """As long as any answer."""

    def __init__(
        self,
        message_form: MessageForm = MessageForm.UNKNOWN,
        encode: Callable[[str], bytes] = encode_ascii,
        error_pattern: str = ERROR_PATTERN,
    ) -> None:
        self.state = State.IN_DOUBT
        self.is_busy = False
        """Whether a line is outstanding."""
        self.in_doubt = True
        """Whether it is unknown what the drive will answer next."""
        self.message_form = message_form
        self.encode = encode
        self._error = re.compile(error_pattern)
        self._ledger = Ledger()
        self._recognition: Recognition | None = Recognition()
        """None once a prompt has come: only a COMPAX sends it."""
        self._motion_frame = ""
        self._stops_answered = 0
        self._received = b""
        self._to_send: list[bytes] = []
        self._events: list[Event] = []
        self._number_may_follow = False
        self._flood = ""

    # What the link asks ---------------------------------------------------------------------------------------------

    @property
    def held(self) -> Hold | None:
        """Why nothing but a stop may be sent: a binary motion was not answered, and half of it would wait for more."""
        if self.state not in HELD:
            return None
        return Hold(
            f"the binary motion {self._motion_frame!r} may have arrived cut, and whatever is sent could complete it to "
            "a motion somewhere else",
            "look at the machine: stop() works still, but may be taken for the rest of it at first; when nothing can "
            "happen, best after the drive was switched off and on (UG p. 167), call reconcile()",
        )

    def stranger(self, *, time_is_over: bool) -> Stranger | None:
        """Say which other device is at the far end, as long as no prompt of a COMPAX has ever come."""
        return self._recognition.stranger(time_is_over=time_is_over) if self._recognition is not None else None

    # What the link does ---------------------------------------------------------------------------------------------

    def line_opened(self) -> None:
        """Take note that the line is new; what stands in the drive's buffer is unknown, or known to be dangerous."""
        self._received = b""
        self._to_send.clear()
        self._flood = ""
        self._number_may_follow = False
        # Queries of the old line may still be answered, by a device server; a prompt on the new one proves nothing.
        self._ledger.forget_commands()
        if self._recognition is not None:
            self._recognition.line_opened()
        self._stops_answered = 0
        self._step(LineOpened)

    def line_lost(self) -> None:
        """Give up what is outstanding."""
        if self.is_busy:
            self._step(TimeRanOut)

    def send(self, text: str) -> None:
        """Begin the exchange of *text*, one line without its CR."""
        wire = self.encode(text)
        if is_motion_frame(wire):
            self._step(MotionFrameSent)
            self._motion_frame = text
            self._stops_answered = 0
        else:
            self._step(CommandSent)
        self._write(text, wire)

    def send_marker(self) -> None:
        """Ask a status value whose number tells its answer from every other that may still come."""
        self._step(MarkerSent)
        marker = self._ledger.choose_marker()
        self._write(marker, encode_ascii(marker))

    def send_ahead(self, text: str) -> None:
        """Send *text*, a stop, although in doubt; whatever comes next ends its turn and proves nothing."""
        self._step(SentAhead)
        self._write(text, encode_ascii(text))

    def preempt(self, text: str) -> None:
        """Refuse: a COMPAX heeds nothing while a line is outstanding."""
        raise LinkProtocolError("a COMPAX can be told nothing out of turn", sent=text, hint="send STOP in its turn")

    def time_ran_out(self) -> None:
        """Give the outstanding line up; its answer, should it come, is late."""
        self._step(TimeRanOut)

    def resume(self) -> None:
        """Take a person's word that half a binary motion can do no harm any more; else it does nothing."""
        if self.state in HELD:
            self._step(Resumed)
            # The next prompt may be that of a frame which a marker has completed: it acknowledges no motion.
            self._ledger.forget_commands()

    def bytes_to_send(self) -> bytes:
        """Take what is to be written now."""
        if not self._to_send:
            return b""
        data = b"".join(self._to_send)
        self._to_send.clear()
        return data

    def receive(self, data: bytes) -> None:
        """Read *data*, a piece of any size; see :meth:`events`."""
        if not self._read_plain_answer(self._received + data):
            self._read(data.translate(None, NOT_TEXT))

    def events(self) -> list[Event]:
        """Take what has been noticed since the last call, in order."""
        events, self._events = self._events, []
        return events

    # Turns ----------------------------------------------------------------------------------------------------------

    def _step(self, what: type[Event]) -> None:
        try:
            self.state = state = TRANSITIONS[self.state, what]
        except KeyError:
            raise LinkProtocolError(
                f"{what.__name__} is not possible while {self.state.value}",
                sent=self._ledger.last.text if self._ledger.last else None,
                hint="wait for the turn to be over",
            ) from None
        # What the state means to the link, which asks it far more often than it changes.
        self.is_busy, self.in_doubt = MEANINGS[state]

    def _notice(self, event: Event) -> None:
        self._step(type(event))
        self._events.append(event)

    def _write(self, text: str, wire: bytes) -> None:
        self._ledger.note(text, wire)
        if self._recognition is not None:
            self._recognition.sent(wire)
        self._to_send.append(wire)

    @property
    def _outstanding(self) -> Sent | None:
        """The line whose answer comes next, in step."""
        return self._ledger.last if self.state in AWAITING else None

    @property
    def _is_command_outstanding(self) -> bool:
        return self._outstanding is not None and self._outstanding.key is None

    def _end_turn(self, outcome: TurnOver) -> None:
        if not isinstance(outcome, UnexpectedAnswer):
            self._ledger.settle()
        self._notice(outcome)

    # Reading --------------------------------------------------------------------------------------------------------

    def _read_plain_answer(self, received: bytes) -> bool:
        """
        Read *received*, all that has come since the last prompt, if it is the answer as it nearly always is.

        Returns:
            False if it is not: then it is for :meth:`_read`, which would have made the same of it.
        """
        if self.state is not _AWAITING_ANSWER or self._flood or not received.endswith(PROMPT):
            return False
        text, asked = as_text(received), self._ledger.last
        plain = PLAIN_ANSWER.fullmatch(text) if len(text) <= _MAX_TOKEN else None
        if plain is None or asked is None or plain.groups() != asked.key:
            return False
        self._received, self._number_may_follow = b"", False
        self._ledger.settle()
        self._notice(Answered(text[: -len(PROMPT)]))
        return True

    def _read(self, text: bytes) -> None:
        if self._recognition is not None and self._recognition.received(text) and self.state in BUSY & DOUBTFUL:
            self._notice(MarkerSpent())
        received, begin = self._received + text, 0
        while True:
            if self._number_may_follow and len(received) > begin:
                begin += self._read_number_after_prompt(received[begin : begin + 1])
            end = received.find(PROMPT, begin)
            if end < 0:
                break
            self._recognition = None
            self._read_token(received[begin:end])
            begin = end + len(PROMPT)
        self._received = received[begin:]
        if len(self._received) > _MAX_TOKEN + len(PROMPT) - 1:
            self._begin_flood(self._received)
            self._received = self._received[1 - len(PROMPT) :]

    def _read_number_after_prompt(self, sign: bytes) -> int:
        """
        Read the comparator number that may follow a prompt nobody waited for (the running text of UG p. 162).

        Returns:
            How many bytes it has: 1, or 0 if *sign* is none.
        """
        self._number_may_follow = False
        number = COMPARATOR.match(as_text(sign))
        if number is None:
            return 0
        self._notice(ComparatorReached(int(number[0])))
        return len(sign)

    def _begin_flood(self, data: bytes) -> None:
        """Note that more has come than any answer has; once, until the next prompt."""
        if not self._flood:
            self._flood = as_text(data[:_MAX_TOKEN])
            self._notice(Stray(self._flood))

    def _end_flood(self) -> None:
        """Read the prompt that ends a flood: it acknowledges nothing."""
        text, self._flood = self._flood, ""
        if self._is_command_outstanding:
            self._end_turn(UnexpectedAnswer(text))

    def _read_token(self, raw: bytes) -> None:
        """Read what stood before one prompt: usually one line or none, after noise or an echo more."""
        if len(raw) > _MAX_TOKEN:
            self._begin_flood(raw)
        if self._flood:
            self._end_flood()
            return
        if raw:
            self._read_lines(as_text(self._without_frame(raw)))
        else:
            self._read_prompt()

    def _read_lines(self, text: str) -> None:
        lines = [line.strip(" \t>") for line in LINE_ENDS.split(text)]
        lines = [rest for line in lines if (rest := self._without_echo(line))]
        for line in lines[:-1]:
            self._read_unterminated(line)
        self._read_line(lines[-1] if lines else "")

    def _without_frame(self, raw: bytes) -> bytes:
        """Take off an echo of the frame that is outstanding; it may hold any byte."""
        sent = self._ledger.last
        return raw.removeprefix(sent.wire.translate(None, NOT_TEXT)) if sent is not None and sent.is_frame else raw

    def _without_echo(self, line: str) -> str:
        """Take off an echo of the line that is outstanding, with its CR or glued to the answer."""
        sent = self._ledger.last
        if sent is None or not line.startswith(sent.text):
            return line
        rest = line[len(sent.text) :].lstrip()
        if sent.key is None:
            return rest if not rest or rest[0] in "SPVNE$" else line
        # "N5 END" is the answer to "N5", with a blank for a colon; "N5N005: END" is an echo and the answer.
        answer = ANSWER.fullmatch(rest)
        is_echo = not rest or (answer is not None and (answer[1], answer[2]) == sent.key)
        return rest if is_echo or re.fullmatch(r"E\d{1,3}", line[len(sent.text) :]) else line

    def _read_unterminated(self, line: str) -> None:
        """Read a line whose prompt did not come through; it ends no turn."""
        self._notice(Stray(line))

    def _read_line(self, line: str) -> None:
        if before := COMPARATOR_BEFORE.match(line):
            self._notice(ComparatorReached(int(before[1])))
            line = line[before.end() :]
        if line == POSITION_REACHED_SIGN:
            self._read_position_reached()
        elif COMPARATOR.fullmatch(line):
            self._notice(ComparatorReached(int(line)))
        elif not line:
            self._read_prompt()
        elif answer := ANSWER.fullmatch(line):
            self._read_answer((answer[1], answer[2]), line)
        elif (error := self._error.search(line)) and (error[1] or "").isdecimal():  # the pattern may be a user's
            self._read_error(int(error[1]), line)
        elif self._is_command_outstanding:
            self._end_turn(UnexpectedAnswer(line))
        else:
            self._notice(Stray(line))

    def _read_prompt(self) -> None:
        if self._outstanding is not None and self._outstanding.key is None:
            if self._outstanding.wants_message and self.message_form is MessageForm.UNKNOWN:
                self.message_form = MessageForm.PROMPT_FIRST
            self._end_turn(Acknowledged())
        elif self._is_ahead_unanswered:
            # Its own prompt, or a late one of an earlier line; a marker will tell, nothing else can.
            self._notice_ahead_spent()
        elif self.in_doubt and self._can_be_late(sent := self._ledger.only_command):
            self._end_late(sent, Acknowledged())
        else:
            self._number_may_follow = True
            self._notice(Stray(""))

    @property
    def _is_ahead_unanswered(self) -> bool:
        """Whether a stop is unanswered that went ahead of everything, in its turn or, where it is held, late."""
        last = self._ledger.last
        return self.state in AHEAD or (self.state is State.FRAME_IN_DOUBT and last is not None and not last.is_frame)

    def _notice_ahead_spent(self) -> None:
        """Note that a line sent ahead was answered; two that were have filled up any frame that was cut."""
        self._notice(MarkerSpent())
        if self.state in HELD:
            self._stops_answered += 1
            if self._stops_answered >= _STOPS_THAT_FILL_A_FRAME:
                self._notice(HoldOver())
                # The next prompt may be that of the frame: it acknowledges no motion.
                self._ledger.forget_commands()

    def _can_be_late(self, sent: Sent | None) -> TypeGuard[Sent]:
        """Whether an answer without a name that comes while in doubt is that of *sent*, which alone could have it."""
        if sent is None:
            return False
        if sent.is_frame:
            # What was sent since may have completed a frame that was cut: then it is not what we said that was done.
            return sent is self._ledger.last
        return self.state is not State.FRAME_IN_DOUBT

    def _read_answer(self, key: tuple[str, str], line: str) -> None:
        asked = self._ledger.asked(key)
        if asked is None:
            self._notice(Stray(line))
        elif asked is self._outstanding:
            self._end_turn(Answered(line))
        elif self.state is State.AWAITING_MARKER and asked is self._ledger.last:
            self._ledger.settle()
            self._notice(InStep())
        else:
            self._end_late(asked, Answered(line))

    def _read_error(self, code: int, line: str) -> None:
        only = self._ledger.last if len(self._ledger) == 1 else None
        if self._outstanding is not None:
            self._end_turn(Rejected(code, line))
        elif self.state in (State.IN_DOUBT, State.FRAME_IN_DOUBT) and self._can_be_late(only):
            self._end_late(only, Rejected(code, line))
        elif self.state is State.AWAITING_MARKER and only is not None:
            # Half a line stood in the drive's buffer and has taken ours with it; the buffer is clean now.
            self._ledger.settle()
            self._notice(MarkerSpent())
        elif self._is_ahead_unanswered:
            self._notice_ahead_spent()
        else:
            # Of an earlier line or of the marker: no telling. The marker's answer or its time-out decides.
            self._notice(Stray(line))

    def _read_position_reached(self) -> None:
        waiting = self._ledger.owed_message()
        if waiting is None or self.message_form is MessageForm.PROMPT_FIRST:
            self._notice(PositionReached())
        elif waiting is self._outstanding:
            self._end_turn(Acknowledged(by_message=True))
            self._notice(PositionReached())
        else:
            self._end_late(waiting, Acknowledged(by_message=True))
            self._notice(PositionReached())

    def _end_late(self, sent: Sent, outcome: TurnOver) -> None:
        """Credit an answer to the oldest line it can belong to; all that is older was lost or refused."""
        self._ledger.settle_up_to(sent)
        self._notice(LateEnding(sent.text, outcome))
        if not self._ledger:
            self._notice(InStep())
