"""
A control's line, sans-IO: files go over it as their synchronisation has it, and one question at a time.

To get in step nothing is sent, for a control that collects no data answers nothing, and files go over its line all the
same: it is a pause, and when nothing has come in it, nothing is on its way. A question is sent only when the line has
been silent for a moment, so not while a program prints; a control that was polled without pause has frozen.

An answer that did not come in time is *owed*. Most answers name what they answer, but not all: ``STATUS, BUSY`` is one
to anything. So while something is owed, a question whose answer could be mistaken is preceded by another one whose
answer cannot; when that has come, what was owed is lost, for a control answers in order.

A transfer is one turn. The bytes that come in it are the file's, and those of a late answer are taken out.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from ..errors import InvalidCommandError, LinkProtocolError
from ..link.contract import Event, GoesOn, Hold, InStep, MarkerSpent, Stranger
from ..link.level import LineLevel
from .facts.characters import ETB, PROMPT, STX
from .frames import Broken, Frame, Outside, Part
from .line_code import LineCode
from .listening import Listener, Pause, on_the_wire_s
from .profiles import Profile
from .protocol_events import Answered, CutShort, HeldBack, TransferOver, Unreadable
from .protocol_states import BUSY, DOUBTFUL, TRANSITIONS, State, Step
from .questions import Questions
from .settings import ControlSettings
from .signs import FlowSigns
from .transfers.account import Ending, Phase
from .transfers.strategy import Strategy

__all__ = ["HaasProtocol"]

_ANSWER_BYTES: Final = 64
"""Answers have a dozen to fifty characters, and what was asked may come back in front of one."""


class HaasProtocol:
    """
    The host's end of a control's line.

    Args:
        profile: How the control is set up.
        settings: How long things take.

    Attributes:
        level: What is known of the line that bytes go out on; set it before the line is opened.
    """

    def __init__(self, profile: Profile, settings: ControlSettings) -> None:
        self.state = State.IN_DOUBT
        self.level = LineLevel()
        self._profile = profile
        self._settings = settings
        self._code = LineCode(profile)
        self._listener = Listener(profile)
        self._questions = Questions()
        self._loaded: Strategy | None = None
        self._strategy: Strategy | None = None
        """Of the transfer that is the turn."""
        self._signs = FlowSigns(profile)
        self._pause = Pause()
        self._babbles = False
        """Whether something never stops coming."""
        self._to_send: list[bytes] = []
        self._events: list[Event] = []

    # What the link asks ---------------------------------------------------------------------------------------------

    @property
    def in_doubt(self) -> bool:
        """Whether what comes next may belong to anything that was before."""
        return self.state in DOUBTFUL

    @property
    def is_busy(self) -> bool:
        """Whether an answer, a file, or the end of a pause is awaited."""
        return self.state in BUSY

    @property
    def patience_s(self) -> float | None:
        """How long what is awaited may take; the bytes that must leave first have their time."""
        settings = self._settings
        if self.state is State.TRANSFERRING:
            return self._transfer.pause_s
        if self.state is State.QUIETING:
            return self._pause.lasts_s(settings.quiet_s, self.level)
        if self.state is State.CALMING:
            return settings.silence_timeout_s if self._signs.is_held else self._calm_s
        takes_s = self.level.leaves_s(self._unwritten_bytes) + on_the_wire_s(_ANSWER_BYTES, self.level)
        return settings.answer_timeout_s + takes_s

    @property
    def _calm_s(self) -> float:
        """How long the line is silent before something is sent."""
        is_file_in_doubt = self._strategy is not None and self._questions.owes
        at_least_s = self._settings.quiet_s if is_file_in_doubt else self._settings.gap_s
        return self._pause.lasts_s(at_least_s, self.level)

    @property
    def held(self) -> Hold | None:
        """Nothing: to get in step, nothing is sent."""
        return None

    def stranger(self, *, time_is_over: bool) -> Stranger | None:
        """Say that something never stops sending."""
        if not (time_is_over and self._babbles):
            return None
        return Stranger(
            "a control that sends, and nobody has waited for it",
            "wait until it is done, or press RESET at the control; if what comes is garbled, compare baud rate, parity "
            "and data bits with its Settings 11, 12 and 37",
        )

    # What the link does ---------------------------------------------------------------------------------------------

    def line_opened(self) -> None:
        """Take note that the line is new: what is on its way is unknown."""
        self._step(Step.LINE_OPENED)
        self._begin_anew()

    def line_lost(self) -> None:
        """Give up what is outstanding: nobody will answer it."""
        self._step(Step.LINE_LOST)
        if self._strategy is not None:
            self._strategy.line_lost()
        self._begin_anew()

    def _begin_anew(self) -> None:
        self._strategy = None
        self._questions.line_is_new()
        self._listener.forget_answer()
        self._listener.forget_print()
        self._signs.forget()
        self._babbles = False
        self._to_send.clear()

    def load(self, strategy: Strategy) -> None:
        """Have *strategy* ready: sending its label begins it."""
        self._loaded = strategy

    def send(self, text: str) -> None:
        """
        Begin the transfer of that label, or ask the question that is its text.

        Raises:
            InvalidCommandError: It is neither.
        """
        if self._loaded is not None and text == self._loaded.label:
            self._strategy, self._loaded = self._loaded, None
            if self._strategy.sends or self._strategy.takes_all:
                self._begin_pause(Step.SEND_BEGUN)
            else:
                self._begin_transfer()
        else:
            self._questions.begin(text)
            self._begin_pause(Step.SEND_BEGUN)

    def send_marker(self) -> None:
        """Send nothing, for a while."""
        self._begin_pause(Step.PAUSE_BEGUN)

    def send_ahead(self, text: str) -> None:
        """Send nothing either: there is no stop that a control heeds over this line."""
        raise InvalidCommandError(f"{text!r} cannot be sent ahead: a control has no stop over this line")

    def preempt(self, text: str) -> None:  # noqa: ARG002  # it is the outstanding turn that is meant
        """Give up what is outstanding, a transfer as its synchronisation has it, and wait until the line is quiet."""
        if self._strategy is not None:
            self._strategy.give_up()
            self._listener.drops_file |= self.state is State.TRANSFERRING and not self._strategy.sends
            self._events.append(TransferOver(self._strategy.account()))
            self._strategy = None
        elif (asked := self._questions.asked) is not None:
            self._questions.give_up()
            self._events.append(CutShort(asked))
        self._begin_pause(Step.PREEMPTED)

    def time_ran_out(self) -> None:
        """Go on after a pause, or take note that what was awaited did not come."""
        if self.state is State.TRANSFERRING:
            self._transfer.time_ran_out()
            self._note_transfer()
        elif self.state is State.QUIETING:
            self._get_in_step()
        elif self.state is State.CALMING:
            self._end_calm()
        else:
            if (nobody_answers := self._questions.give_up()) is not None:
                self._events.append(nobody_answers)
            self._step(Step.TIME_RAN_OUT)

    def resume(self) -> None:
        """Do nothing: the line is never held."""

    def bytes_to_send(self) -> bytes:
        """Take what is to be written now."""
        data = b"".join(self._to_send)
        self._to_send.clear()
        return self._code.encode(data)

    def receive(self, data: bytes) -> None:
        """Read *data*, a piece of any size; see :meth:`events`."""
        for piece, is_damaged in self._code.decode(data):
            self._read(piece, is_damaged)

    def events(self) -> list[Event]:
        """Take what has been noticed since the last call, in order."""
        events, self._events = self._events, []
        return events

    # Reading --------------------------------------------------------------------------------------------------------

    def _read(self, data: bytes, is_damaged: bool) -> None:
        if self.state is State.TRANSFERRING:
            self._read_in_transfer(data, is_damaged)
            return
        was_held = self._signs.is_held
        rest, told = self._signs.take(data)
        self._events += told
        if self.state is State.CALMING and self._signs.is_held is not was_held:
            self._events.append(GoesOn())
        is_damaged &= rest[:1] == data[:1]  # a sign that came damaged was none
        data = rest
        self._read_answers(data, is_damaged)
        self._put_off_pause(len(data))

    def _put_off_pause(self, came_bytes: int) -> None:
        if not came_bytes or self.state not in {State.QUIETING, State.CALMING}:
            return
        if self._pause.put_off(came_bytes):
            if not (self.state is State.CALMING and self._signs.is_held):
                self._events.append(GoesOn())
        elif self.state is State.QUIETING:
            self._babbles = True
            self._step(Step.BABBLED)
            self._events.append(MarkerSpent())
        else:
            self._hold_back(by_xoff=False)

    def _read_answers(self, data: bytes, is_damaged: bool) -> None:
        for part in self._listener.split(data, is_damaged=is_damaged):
            if isinstance(part, Frame):
                self._read_frame(part.text)
            elif isinstance(part, Broken):
                self._note_answer(self._questions.read_broken(part.data.decode("latin-1")))
            elif isinstance(part, Outside):
                self._read_outside(part.data, part.is_damaged)

    def _read_outside(self, data: bytes, is_damaged: bool) -> None:
        self._events += self._listener.outside(data, is_damaged=is_damaged)

    def _read_frame(self, text: str) -> None:
        self._events += self._listener.answer_begins()
        if (event := self._questions.read(text)) is not None:
            self._note_answer(event)
        else:
            self._begin_pause(Step.CAUGHT_UP)
            self._events.append(GoesOn())

    def _note_answer(self, event: Event) -> None:
        self._events.append(event)
        if isinstance(event, Answered):
            self._step(Step.ANSWERED)
        elif isinstance(event, Unreadable):
            self._step(Step.UNREADABLE)

    # Pauses ---------------------------------------------------------------------------------------------------------

    def _forget_begun(self) -> None:
        """Expect no more of an answer of which only the beginning has come."""
        for begun in self._listener.forget_answer():
            self._note_answer(self._questions.read_broken(begun))

    def _get_in_step(self) -> None:
        self._forget_begun()
        self._events += self._listener.forget_print()
        self._babbles = False
        self._step(Step.QUIET)
        self._events.append(InStep())

    def _begin_pause(self, step: Step) -> None:
        self._step(step)
        self._pause.begin()

    def _end_calm(self) -> None:
        self._forget_begun()
        if self._signs.is_held:
            self._hold_back(by_xoff=True)
        elif self._strategy is not None:
            self._begin_transfer()
        else:
            self._ask()

    def _ask(self) -> None:
        text = self._profile.request_prefix + self._questions.next_text()
        self._step(Step.PROBE_SENT if self._questions.is_probing else Step.QUERY_SENT)
        self._listener.expect_echo(text, earlier_may_come=self._questions.owes)
        self._write((text + self._profile.request_end).encode("ascii"))

    def _hold_back(self, *, by_xoff: bool) -> None:
        """Send nothing of what was to be sent; the next one is sent all the same, for an Xon may be lost."""
        sent = self._strategy.label if self._strategy is not None else self._questions.asked
        assert sent is not None  # it is one of them
        self._strategy = None
        self._questions.drop()
        self._signs.is_held = False
        self._step(Step.HELD_BACK)
        self._events.append(HeldBack(sent, by_xoff))

    # Transfers ------------------------------------------------------------------------------------------------------

    @property
    def _transfer(self) -> Strategy:
        assert self._strategy is not None  # there is one in the state that has one
        return self._strategy

    def _begin_transfer(self) -> None:
        is_reader_on, self._signs.is_reader_on = self._signs.is_reader_on, False
        self._step(Step.TRANSFER_BEGUN)
        level = LineLevel(self.level.bytes_per_s, lambda: self.level.unsent() + self._unwritten_bytes)
        self._transfer.begin(level, self._write, reader_is_on=is_reader_on)
        self._events += self._transfer.take_notes()

    def _read_in_transfer(self, data: bytes, is_damaged: bool) -> None:
        strategy = self._transfer
        while data:
            may_answer = self._may_answer(strategy)
            end = _behind_answer(data) if may_answer or strategy.phase is Phase.WAIT_START else len(data)
            if may_answer:
                for part in self._listener.split(data[:end], is_damaged=is_damaged):
                    self._read_part_in_transfer(strategy, part)
            else:
                self._give(strategy, data[:end], is_damaged, self._read_answers)
            data, is_damaged = data[end:], False
        self._note_transfer()

    def _may_answer(self, strategy: Strategy) -> bool:
        """Whether what comes next may belong to an answer, although a file is on its way."""
        return not strategy.takes_all and (strategy.sends or self._questions.owes or self._listener.awaits_prompt)

    def _read_part_in_transfer(self, strategy: Strategy, part: Part) -> None:
        if isinstance(part, Frame):
            self._read_frame(part.text)
        elif isinstance(part, Outside):
            self._give(strategy, part.data, part.is_damaged, self._read_outside)
        elif isinstance(part, Broken):  # what began like an answer and is none was the file's
            self._give(strategy, bytes((STX,)) + part.data, True, self._read_outside)

    def _give(self, strategy: Strategy, data: bytes, is_damaged: bool, read: Callable[[bytes, bool], None]) -> None:
        """Give *data* to the transfer, and have *read* what of it is another's."""
        if is_damaged:
            strategy.note_damage()
        if foreign := strategy.receive(data):
            read(foreign, is_damaged)
        self._events += strategy.take_notes()

    def _note_transfer(self) -> None:
        strategy = self._transfer
        self._events += strategy.take_notes()
        if strategy.ending is None:
            if strategy.take_moved():
                self._events.append(GoesOn())
            return
        is_whole = strategy.ending is Ending.COMPLETE
        self._strategy = None
        self._listener.forget_answer()
        self._listener.drops_file = not (is_whole or strategy.sends)
        self._events.append(TransferOver(strategy.account()))
        self._step(Step.TRANSFER_OVER if is_whole else Step.TRANSFER_BROKEN)

    # Small things ---------------------------------------------------------------------------------------------------

    def _write(self, data: bytes) -> None:
        self._to_send.append(data)

    @property
    def _unwritten_bytes(self) -> int:
        return sum(map(len, self._to_send))

    def _step(self, step: Step) -> None:
        try:
            self.state = TRANSITIONS[self.state, step]
        except KeyError:
            raise LinkProtocolError(f"{step.value} while {self.state.value}") from None


def _behind_answer(data: bytes) -> int:
    """Return the place behind the first sign that can end an answer."""
    ends = [at + 1 for sign in (ETB, PROMPT) if (at := data.find(sign)) >= 0]
    return min(ends, default=len(data))
