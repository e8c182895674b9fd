"""
A cutter's line, sans-IO: one thing is asked at a time, and a job goes out in bursts as its handshake allows.

What answers, answers in the form that was agreed on with ``.M``: CR ends it, and a sign stands in front of it, its
output initiator. That sign is another one after every doubt. So a reply is known to be the one that is awaited, and one
that comes late is known to be late, whatever it says: ``.B``, ``.E`` and ``OE;`` all answer with nothing but a number,
and no query has an answer that could not be another's.

After a time-out, ``.J`` aborts output (PNC-900 p. 21), and what still comes for a moment is dropped. Then the status is
asked for in the old form: a cutter that answers without the sign has been switched off and on, and its buffer is empty;
nothing goes on before that is known. Only then a new sign is agreed on, and a reply that bears it ends the doubt. A
line that is new begins with that. The status is what is asked because reading it clears nothing, unlike ``.E``, and
needs nothing to be cut first, unlike ``OI;``. There is one query at a time, and ``.J`` before a new one, so error 10
does not come of it.
"""

from __future__ import annotations

from typing import Final

from ..errors import LinkProtocolError
from ..link.contract import Event, GoesOn, Hold, InStep, LateEnding, Stranger
from ..link.level import LineLevel
from .bursting import Burst, BurstWriter
from .facts.line import CARRIAGE_RETURN, ESCAPE, LINE_FEED
from .handshakes import HEARD
from .pacing import FLOW_SIGNS, Doing, Pacing
from .protocol_events import Answered, BurstOver, CutShort, SettingsLost, StatusSeen, Stray, Unreadable
from .protocol_states import BUSY, DOUBTFUL, TRANSITIONS, State, Step
from .settings import CutterSettings
from .signs import Signs

__all__ = ["AGREED_FORMAT", "CutterProtocol"]

_ESC: Final = chr(ESCAPE)
ABORT_OUTPUT: Final = f"{_ESC}.J"
ABORT_JOB: Final = f"{_ESC}.K"

AGREED_FORMAT: Final = f"{_ESC}.M:"
"""Stands in a text for the form of replies that is agreed on when it is sent, behind something that resets it."""

_MOST_OF_A_REPLY: Final = 80
_MOST_OF_A_STRAY: Final = 64
_MOST_DIGITS: Final = 5
_PLAIN_ATTEMPTS: Final = 2
"""So many markers on a new line are as usual; from then on what a cutter may wait for is sent in front."""
_WAITED_FOR: Final = "\x11\r\n"
"""A trigger and echo terminators by custom (HP7470 p. 10-15; presets 1 and 2, DXY-1150A p. 36); no cutting data."""


class CutterProtocol:
    """
    The host's end of a cutter's line.

    Args:
        settings: How long things take.
        status_query: What asks for the status (``ESC.O``).
        free_space_query: What asks for free space (``ESC.B``).

    Attributes:
        pacing: How the job goes through the buffer, while there is one.
        level: What is known of the line.
    """

    def __init__(
        self,
        settings: CutterSettings,
        *,
        status_query: str = f"{_ESC}.O",
        free_space_query: str = f"{_ESC}.B",
    ) -> None:
        self.state = State.IN_DOUBT
        self.pacing: Pacing | None = None
        self.level = LineLevel()
        self._settings = settings
        self._status_query = status_query
        self._free_space_query = free_space_query
        self._signs = Signs(settings.turnaround_ms)
        self._is_agreed = False
        """Whether the cutter has been told how replies shall look, and has shown that it knows."""
        self._markers = 0
        """Sent on this line until it was in step."""
        self._sent = ""
        self._given_up = ""
        """What was asked last and not answered."""
        self._owes = False
        """Whether an output instruction may stand in the cutter's buffer that was given up."""
        self._writer: BurstWriter | None = None
        self._loaded: Burst | None = None
        self._held_s = 0.0
        """For how long what was written last could not leave."""
        self._line = bytearray()
        self._is_too_long = False
        self._signals = bytearray()
        self._to_send: list[bytes] = []
        self._events: list[Event] = []

    # What the link asks ---------------------------------------------------------------------------------------------

    @property
    def in_doubt(self) -> bool:
        """Whether what comes next may belong to anything sent before."""
        return self.state in DOUBTFUL

    @property
    def is_busy(self) -> bool:
        """Whether a reply, an acknowledgement or the end of a pause is awaited."""
        return self.state in BUSY

    @property
    def patience_s(self) -> float | None:
        """How long what is awaited may take; the bytes that must leave first have their time."""
        if self.state in {State.BURSTING, State.QUESTIONING, State.ENDING}:
            return self._paces().pause_s
        leaves_s = self.level.leaves_s(self._unwritten_bytes)
        if self.state is State.SETTLING:
            return leaves_s + self._settings.settle_s
        if self.state is State.DRAINING:
            return leaves_s + self._settings.drained_after_s
        if self.state is State.ASKING and _waits_for_cutting(self._sent):
            return leaves_s + self._settings.cutting_timeout_s
        if self.state is State.ASKING and self._may_be_held:
            return leaves_s + self._settings.held_timeout_s
        return leaves_s + self._settings.answered_after_s

    @property
    def _may_be_held(self) -> bool:
        """Whether what was asked may wait in the cable, or behind it, where nobody sees it."""
        return self.pacing is not None and self.pacing.may_hold_line

    @property
    def held(self) -> Hold | None:
        """Nothing: what gets the line in step does no harm."""
        return None

    def stranger(self, *, time_is_over: bool) -> Stranger | None:  # noqa: ARG002
        """Nobody: other devices do not give themselves away."""
        return None

    @property
    def has_signs(self) -> bool:
        """Whether replies bear a sign; if not, late ones are told by their time alone, and power cycles go unseen."""
        return self._signs.are_used

    # What the link does ---------------------------------------------------------------------------------------------

    def line_opened(self) -> None:
        """Take note that the line is new: in which form the cutter answers is unknown."""
        self._step(Step.LINE_OPENED)
        self._begin_anew()

    def line_lost(self) -> None:
        """Give up what is outstanding."""
        self._step(Step.LINE_LOST)
        self._begin_anew()

    def _begin_anew(self) -> None:
        self._is_agreed = self._owes = False
        self._markers = 0
        self._writer = None
        self._given_up = ""
        self._forget_received()
        self._to_send.clear()

    def load(self, burst: Burst) -> None:
        """Have *burst* ready: sending its label begins it."""
        self._loaded = burst

    def send(self, text: str) -> None:
        """Begin the exchange of *text*: a burst by its label; or instructions of which the last one answers."""
        self._forget_received()
        self._sent = text
        if self._loaded is not None and text == self._loaded.label:
            burst, self._loaded = self._loaded, None
            if self.pacing is None:
                raise LinkProtocolError("a burst has no handshake")
            self._step(Step.BURST_BEGUN)
            self._writer = BurstWriter(burst, self.pacing, self.level, self._settings)
            self._go_on(is_begin=True)
        else:
            self._step(Step.QUERY_SENT)
            self._write(text.replace(AGREED_FORMAT, self._signs.form()))

    def send_marker(self) -> None:
        """Abort output, and ask in the old form; on a new line, agree on a form at once."""
        self._forget_received()
        self._markers += 1
        if self._is_agreed or not self._signs.are_used:
            self._clear()
        else:
            in_front = _WAITED_FOR if self._markers > _PLAIN_ATTEMPTS else ""
            self._write(in_front + ABORT_OUTPUT)
            self._agree()

    def send_ahead(self, text: str) -> None:
        """Send the ``.K`` of *text*, a stop, although in doubt, and a marker: what it asks would be asked too early."""
        if text.startswith(ABORT_JOB):
            self._write(ABORT_JOB)
        self._clear()

    def _clear(self) -> None:
        self._step(Step.CLEARED)
        self._write((ABORT_JOB if self._owes else "") + ABORT_OUTPUT)

    def preempt(self, text: str) -> None:
        """Send ``.K``, which is heeded at any time; the turn that is outstanding is over by it."""
        if self.state in {State.ASKING, State.BURSTING, State.QUESTIONING, State.WITHDRAWING, State.ENDING}:
            self._events.append(CutShort(self._sent, text))
            self._give_up()
        self._step(Step.PREEMPTED)
        self._to_send.clear()
        self._write(text)

    def time_ran_out(self) -> None:
        """Go on after a pause, or give up what is awaited; a question that the line holds back has its time yet."""
        if self._is_held_back():
            return
        if self.state is State.SETTLING:
            self._step(Step.SETTLED)
        elif self.state is State.DRAINING:
            self._end_draining()
        elif self.state in {State.BURSTING, State.ENDING}:
            self._end_pause()
        elif self.state is State.QUESTIONING:
            self._end_pause_in_question()
        else:
            if self.state is State.SIGNING:
                self._signs.give_up()
            self._step(Step.TIME_RAN_OUT)
            self._give_up()

    def _is_held_back(self) -> bool:
        """Whether what was written could not leave, so that nobody can have answered it; not for ever."""
        if self.state in {State.BURSTING, State.ENDING} or not self.level.waiting(self._unwritten_bytes):
            return False
        self._held_s += self.patience_s or 0.0
        return self._held_s < self._settings.held_timeout_s

    def resume(self) -> None:
        """Do nothing: the line is never held."""

    def bytes_to_send(self) -> bytes:
        """Take what is to be written now."""
        data = b"".join(self._to_send)
        self._to_send.clear()
        return data

    def receive(self, data: bytes) -> None:
        """Read *data*, a piece of any size; see :meth:`events`."""
        for byte in data:
            if byte in FLOW_SIGNS:
                self._read_flow(byte)
            elif self.state is State.QUESTIONING and self._paces().pacing.acknowledgement:
                self._read_signal(byte)
            elif byte == CARRIAGE_RETURN:
                self._read_line()
            elif byte != LINE_FEED:
                self._collect(byte)
        if len(self._line) > _MOST_OF_A_STRAY and not self.is_busy:
            self._read_line()  # noise without an end is told as it comes

    def events(self) -> list[Event]:
        """Take what has been noticed since the last call, in order."""
        events, self._events = self._events, []
        return events

    # Replies --------------------------------------------------------------------------------------------------------

    def _collect(self, byte: int) -> None:
        if len(self._line) < _MOST_OF_A_REPLY:
            self._line.append(byte)
        elif not self._is_too_long:
            self._is_too_long = True
            if self.state in {State.ASKING, State.QUESTIONING, State.WITHDRAWING}:
                self._fail(self._take_line())

    def _take_line(self) -> str:
        text = self._line.decode("latin-1")
        self._line.clear()
        return text

    def _forget_received(self) -> None:
        self._line.clear()
        self._signals.clear()
        self._is_too_long = False

    def _read_line(self) -> None:
        text, was_too_long, self._is_too_long = self._take_line(), self._is_too_long, False
        if self.pacing is not None and self.pacing.acknowledgement:
            text = text.lstrip((self.pacing.acknowledgement + HEARD).decode())  # one that came late
        sign, rest = self._signs.parted(text)
        if was_too_long:
            self._stray(text)
        elif sign:
            self._read_signed(sign, rest)
        elif text or (not self._signs.are_used and self.state is State.ASKING):  # .E of some is empty
            self._read_plain(text)

    def _read_signed(self, sign: str, text: str) -> None:
        if self.state is State.PROBING and self._signs.may_be_known(sign):
            self._events.append(StatusSeen(text))
            self._agree()
        elif self._signs.is_last(sign):
            self._read_known(text)
        else:
            self._note_late(text)

    def _read_known(self, text: str) -> None:
        """Read a reply in the form that was agreed on."""
        if self.state is State.SIGNING:
            self._get_in_step(text)
        elif self.state is State.DRAINING:
            self._note_late(text)
        else:
            self._read_answer(text)

    def _read_plain(self, text: str) -> None:
        if not self._signs.are_used:
            self._read_known(text)
        elif self.state is State.PROBING and _is_number(text):
            self._events.append(SettingsLost(text))
            self._agree()
        elif self.state is State.SIGNING and _is_number(text):
            self._signs.note_plain()
        elif self.state in {State.ASKING, State.QUESTIONING, State.WITHDRAWING}:
            self._fail(text)  # damaged; or the cutter was switched off and on, which the marker finds out
        else:
            self._stray(text)

    def _read_answer(self, text: str) -> None:
        if self.state is State.ASKING:
            self._step(Step.ANSWERED)
            self._events.append(Answered(text))
        elif self.state in {State.QUESTIONING, State.WITHDRAWING}:
            self._read_free_space(text)
        else:
            self._stray(text)

    def _read_free_space(self, text: str) -> None:
        if not _is_number(text) or not self._paces().pacing.answered(int(text)):
            self._fail(text)
        elif self.state is State.WITHDRAWING:
            self._end_burst(is_full=True)
        else:
            self._step(Step.QUESTION_ANSWERED)
            self._go_on()

    def _fail(self, text: str) -> None:
        self._step(Step.UNREADABLE)
        self._events.append(Unreadable(self._sent, text[:_MOST_OF_A_STRAY]))
        self._give_up()

    def _note_late(self, text: str) -> None:
        if self._given_up:
            self._events.append(LateEnding(self._given_up, Answered(text)))
            self._given_up = ""
        else:
            self._stray(text)

    def _stray(self, text: str) -> None:
        self._events.append(Stray(text[:_MOST_OF_A_STRAY]))

    # Signals of handshakes ------------------------------------------------------------------------------------------

    def _read_flow(self, sign: int) -> None:
        if self.pacing is None:
            return
        self.pacing.flow(sign)
        if self.state is State.BURSTING:
            self._go_on()

    def _read_signal(self, byte: int) -> None:
        """Read the acknowledgement, or the immediate response, of ENQ."""
        writer = self._paces()
        if byte in {CARRIAGE_RETURN, LINE_FEED}:
            return
        self._signals.append(byte)
        if self._signals.endswith(HEARD):
            self._signals.clear()
            writer.heard()
            self._go_on()
        elif self._signals.endswith(writer.pacing.acknowledgement):
            self._signals.clear()
            writer.pacing.acknowledged()
            self._step(Step.QUESTION_ANSWERED)
            self._go_on()
        elif len(self._signals) > _MOST_OF_A_STRAY:
            self._stray(self._signals.decode("latin-1"))
            self._signals.clear()

    # Bursts ---------------------------------------------------------------------------------------------------------

    def _paces(self) -> BurstWriter:
        assert self._writer is not None  # there is one in every state that has a burst
        return self._writer

    def _go_on(self, *, is_begin: bool = False) -> None:
        """Write what may be written; the link is told of an end when it listens."""
        doing, has_asked = self._paces().go_on(self._unwritten_bytes, self._to_send.append)
        if has_asked:
            self._held_s = 0.0
            self._step(Step.QUESTION_SENT)
        if doing not in {Doing.FULL, Doing.DONE}:
            self._events.append(GoesOn())
        elif is_begin:
            self._step(Step.WRITTEN)
        else:
            self._end_burst(is_full=doing is Doing.FULL)

    def _end_pause(self) -> None:
        writer = self._paces()
        if self.state is State.ENDING:
            self._end_burst(is_full=writer.burst.next_bytes is not None)
        else:
            writer.end_pause()
            self._go_on()

    def _end_pause_in_question(self) -> None:
        writer = self._paces()
        if writer.end_pause_in_question():
            self._go_on()
        elif writer.pacing.acknowledgement:
            self._step(Step.WITHDRAWN)
            self._forget_received()
            self._write(ABORT_OUTPUT + self._free_space_query)
        else:
            self._step(Step.TIME_RAN_OUT)
            self._give_up()

    def _end_burst(self, *, is_full: bool) -> None:
        self._step(Step.BURST_OVER)
        self._writer = None
        self._events.append(BurstOver(is_full))

    # Getting in step ------------------------------------------------------------------------------------------------

    def _give_up(self) -> None:
        """Take note that what is outstanding may still be answered."""
        self._owes = self._owes or (_waits_for_cutting(self._sent) and self._sent.endswith(";"))
        self._given_up = self._sent or self._given_up
        self._sent = ""
        self._writer = None
        self._forget_received()

    def _end_draining(self) -> None:
        self._forget_received()
        if self._signs.are_used and self._is_agreed:
            self._step(Step.DRAINED)
            self._write(self._status_query)
        else:
            self._agree()

    def _agree(self) -> None:
        """Tell the cutter the form of replies, and ask for one."""
        self._step(Step.SIGN_SENT)
        self._signs.change()
        self._write(self._signs.form() + self._status_query)
        self._events.append(GoesOn())

    def _get_in_step(self, status: str) -> None:
        self._step(Step.SIGNED)
        self._events.append(StatusSeen(status))
        self._signs.confirm()
        self._is_agreed = True
        self._owes = False
        self._given_up = ""
        self._markers = 0
        self._events.append(InStep())

    # Small things ---------------------------------------------------------------------------------------------------

    def _write(self, text: str) -> None:
        self._held_s = 0.0
        self._to_send.append(text.encode("latin-1"))

    @property
    def _unwritten_bytes(self) -> int:
        return sum(map(len, self._to_send))

    def _step(self, step: Step) -> None:
        try:
            self.state = TRANSITIONS[self.state, step]
        except KeyError:
            raise LinkProtocolError(f"{step.value} while {self.state.value}") from None


def _is_number(text: str) -> bool:
    return text.isascii() and text.isdigit() and len(text) <= _MOST_DIGITS


def _waits_for_cutting(text: str) -> bool:
    """Whether the answer comes only when all before it was cut: an output instruction, or ``.L`` on some machines."""
    return text.endswith((";", f"{_ESC}.L", f"{_ESC}.L:"))
