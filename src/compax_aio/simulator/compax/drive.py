"""A simulated COMPAX: bytes and time in, bytes out; one line at a time, messages between answers, faults on demand."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from enum import Enum, auto
from typing import Any, Final

from compax_aio.compax.facts.line import COMMAND_END

from ..served_device import ServedDevice
from . import replies
from .binary import shown
from .console import Console
from .inputs import Inputs
from .knobs import Knobs
from .log import MAX_ENTRIES, Log, LogKind
from .machine import Machine, Message, MessageKind
from .port import Received, ReceivedFrame, ReceivedLine, SerialPort
from .refusals import RefusedError
from .state import read_state, read_state_file, written_state

__all__ = ["SimulatedDrive"]

_LAST_CODE: Final = 97
"""98 and 99 are marks of the error history, and a code there has two digits (UG p. 209)."""


class _Turn(Enum):
    """Where the drive is in answering a line."""

    READY = auto()
    """For the next line."""
    PREPARING = auto()
    """A line has come; it is executed when the time for that is over."""
    HOLDING = auto()
    """The line has been executed; its answer has not begun."""
    SENDING = auto()
    """The answer is on the wire."""


class SimulatedDrive(ServedDevice):
    """
    One COMPAX and its axis; does no I/O. Time goes by as for any :class:`.ServedDevice`.

    Args:
        knobs: Behaviour and mechanics.
        name: For messages and tests.
        log_entries: How much of what it has done is kept.

    Attributes:
        log: What the drive has done, oldest first.
        silent: Fault hook: everything is executed, nothing is sent.
        deaf: Fault hook: nothing that arrives is received.
        lose_answers: Fault hook: so many answers or messages are still kept from the wire.
        lose_position_reached: Fault hook: so many ``$`` messages are still kept from the wire.
        delay_position_reached_s: Fault hook: ``$`` is sent so much later than it should be.
    """

    def __init__(self, knobs: Knobs | None = None, *, name: str = "drive", log_entries: int = MAX_ENTRIES) -> None:
        super().__init__(name)
        self.knobs = knobs or Knobs()
        self.log = Log(log_entries)
        self.silent = False
        self.deaf = False
        self.lose_answers = 0
        self.lose_position_reached = 0
        self.delay_position_reached_s = 0.0
        self._extra_answer_delay_s = 0.0
        self._now = 0.0
        self._machine = Machine(self.knobs, self.log, name)
        self._port = SerialPort(self.knobs)
        self._console = Console(self._machine)
        self._heed_p20()
        self._machine.inputs.before_change = self.advance
        self._powered = True
        self._forget_conversation()

    def __repr__(self) -> str:
        return f"<SimulatedDrive {self.name!r} at {self.position:g} {self._machine.unit}>"

    # The line

    @property
    def baudrate(self) -> int:
        """Baud rate of the serial port, as the knob says; 0: bytes take no time, and any rate will do."""
        return self.knobs.baudrate

    @property
    def command_end(self) -> bytes:
        """CR."""
        return COMMAND_END

    def receive(self, data: bytes, now: float) -> None:
        """Take bytes that the host sends at time *now*."""
        self._run(now)
        if self._powered and not self.deaf:
            self._port.receive(data, self._now)
            self._after_departure()
            self._take_line()
            self._run(self._now)

    def take_output(self, now: float) -> bytes:
        """Return the bytes that have come out by *now* and were not taken yet."""
        self._run(now)
        return self._port.take()

    def next_event_at(self) -> float | None:
        """Return when something happens by itself next; None if nothing will, unless bytes come."""
        event = self._next_event()
        return None if event is None else max(event[0], self._now)

    def connect(self, now: float | None = None) -> None:
        """Note that somebody is on the line; what came out while nobody was there is gone."""
        self.advance(now)
        self._port.take()
        self.log.add(self._now, LogKind.CONNECTED)

    def disconnect(self, now: float | None = None) -> None:
        """Note that nobody is on the line; entry buffer, position and everything else stay as they are."""
        self.advance(now)
        self.log.add(self._now, LogKind.DISCONNECTED)

    # What tests look at

    @property
    def position(self) -> float:
        """Where the axis is now."""
        self.advance()
        return self._machine.axis.position(self._now)

    @property
    def moving(self) -> bool:
        """Whether a positioning runs now."""
        self.advance()
        return self._machine.moving

    @property
    def homed(self) -> bool:
        """Whether machine zero has been found."""
        self.advance()
        return self._machine.homed

    @property
    def outputs(self) -> Mapping[int, bool]:
        """O1-O16 as they are now."""
        self.advance()
        return dict(self._machine.outputs)

    @property
    def inputs(self) -> Inputs:
        """I1-I16, to be read and set: ``drive.inputs[7] = True``."""
        return self._machine.inputs

    @property
    def program(self) -> Mapping[int, str]:
        """The records that hold something else than END."""
        return self._machine.memory.written

    def load_program(self, records: Iterable[str], first: int = 1) -> None:
        """
        Write records from *first* on.

        Raises:
            ValueError: One of them is no record of a program.
        """
        for record, text in enumerate(records, first):
            try:
                self._machine.memory.write(record, text.upper(), self._machine.decimals)
            except RefusedError as refused:
                raise ValueError(f"N{record:03d}: {text!r} is refused: {refused}") from None

    def save_state(self, now: float | None = None) -> dict[str, Any]:
        """
        Return what this drive keeps without power, as plain data; it goes on as it was.

        That is what a real one keeps, as far as known: valid parameters, the program and the error history; by choice
        variables and the counts of S9 and S10, too. Unlike a real one it also remembers its axis. Knobs are no state.
        """
        self.advance(now)
        return written_state(self._machine.kept(self._now))

    def load_state(self, state: Mapping[str, Any], now: float | None = None) -> None:
        """
        Switch off and on, and have kept *state*: of :meth:`save_state`, or of :func:`.read_state_file`.

        Parameters that are not in it are as the knobs say. An error that was present is closed with 98 (UG p. 209).

        Raises:
            ValueError: It is no such state, or holds something that no drive can keep; then nothing has changed.
        """
        kept = read_state(state)
        self.advance(now)
        self.power_off(now)
        self.power_on(now)
        self._machine.put_back(kept, self._now)
        self._heed_p20()
        self._changed()

    @staticmethod
    def read_state_file(path: str | os.PathLike[str]) -> dict[str, Any]:
        """
        Read a file of a state.

        Raises:
            ValueError: It is no such file, or holds something that no drive can keep; says what and where.
            OSError: It cannot be read.
        """
        return read_state_file(path)

    @property
    def fault(self) -> int | None:
        """The fault or warning that is present, as S30 tells it."""
        return self._machine.faults.present

    @property
    def prepared_points(self) -> int:
        """How many speed steps and comparators wait for the next positioning."""
        return self._machine.preparation.points

    # What tests do to it

    @property
    def extra_answer_delay_s(self) -> float:
        """Fault hook: answers that have not begun yet begin so much later; their lines are executed in time."""
        return self._extra_answer_delay_s

    @extra_answer_delay_s.setter
    def extra_answer_delay_s(self, seconds: float) -> None:
        self.advance()
        self._extra_answer_delay_s = seconds
        self._changed()

    def raise_fault(self, code: int, now: float | None = None) -> None:
        """Let fault E1-E57 stop the axis, or let a warning (E58-E97) come."""
        if not 1 <= code <= _LAST_CODE:
            raise ValueError(f"a fault code is 1 to {_LAST_CODE}, not {code}")
        self.act(now, lambda: self._machine.raise_fault(code, self._now))

    def power_off(self, now: float | None = None) -> None:
        """Take the power away; until it is back nothing is received, sent or moved."""
        self.advance(now)
        self._powered = False
        self._port.reset()
        self._forget_conversation()
        self._machine.power_off(self._now)
        self._changed()

    def power_on(self, now: float | None = None) -> None:
        """Give the power back."""
        self.advance(now)
        self._powered = True
        self._machine.power_on(self._now)
        if not self.silent:
            self._port.send(replies.power_on_text(self.knobs), self._now)
        self._changed()

    def inject(self, data: bytes, now: float | None = None) -> None:
        """Put noise on the line to the host."""
        self.act(now, lambda: self._port.inject(data))

    # Time

    def _last_told(self) -> float:
        return self._now

    def _run(self, until: float) -> None:
        while (event := self._next_event()) is not None and event[0] <= until:
            self._now = max(self._now, event[0])
            event[1]()
        self._now = max(self._now, until)

    def _next_event(self) -> tuple[float, Callable[[], None]] | None:
        """Find what happens next; of events at the same time the first of this list."""
        # Written out, for it is asked several times a line.
        first_at, event = self._machine.next_event_at(), self._machine_event
        if (at := self._port.next_event_at()) is not None and (first_at is None or at < first_at):
            first_at, event = at, self._port_event
        if (at := self._turn_ends_at()) is not None and (first_at is None or at < first_at):
            first_at, event = at, self._turn_event
        if self._delayed and (first_at is None or self._delayed[0][0] < first_at):
            first_at, event = self._delayed[0][0], self._delayed_event
        return None if first_at is None else (first_at, event)

    def _turn_ends_at(self) -> float | None:
        turn = self._turn
        if turn is _Turn.PREPARING:
            return self._prepared_at
        if turn is _Turn.HOLDING:
            return self._prepared_at + self._extra_answer_delay_s
        return None

    def _machine_event(self) -> None:
        what = self._machine.step(self._now)
        self._heed_p20()  # a record of the program may have written it
        if what is None:
            return
        if what.kind is MessageKind.POSITION_REACHED and self.delay_position_reached_s > 0:
            self._delayed.append((self._now + self.delay_position_reached_s, what))
            self._delayed.sort(key=lambda due: due[0])
        else:
            self._say(what)

    def _delayed_event(self) -> None:
        self._say(self._delayed.pop(0)[1])

    def _port_event(self) -> None:
        self._port.step(self._now)
        self._after_departure()
        self._take_line()

    # One line after the other

    def _forget_conversation(self) -> None:
        self._turn = _Turn.READY
        self._prepared_at = 0.0
        self._line: Received = ReceivedLine("", too_long=False)
        self._answer: str | None = None
        self._answer_mark = 0
        self._answer_is_of_motion = False
        self._behind_answer: list[Message] = []
        self._delayed: list[tuple[float, Message]] = []
        self._console.forget()

    def _take_line(self) -> None:
        if self._turn is not _Turn.READY:
            return
        line = self._port.next_received()
        if line is None:
            return
        self._line = line
        self._prepared_at = self._now + self.knobs.answer_time_s
        self._turn = _Turn.PREPARING
        text = shown(line.raw, self._machine.decimals) if isinstance(line, ReceivedFrame) else line.text
        self.log.add(self._now, LogKind.LINE, text)
        if self.knobs.echo and not self.silent:
            self._port.send(line.raw, self._now)

    def _turn_event(self) -> None:
        if self._turn is _Turn.PREPARING:
            self._execute_line()
            self._turn = _Turn.HOLDING
        else:
            self._send_answer()

    def _send_answer(self) -> None:
        """Put the answer on the wire, and behind it what has waited for it."""
        self._answer_mark = 0
        if self._answer is not None and not self._is_lost(self._answer):
            self.log.add(self._now, LogKind.ANSWER, self._answer)
            self._answer_mark = self._port.send(replies.answer(self._answer), self._now)
        self._turn = _Turn.SENDING
        waiting, self._behind_answer = self._behind_answer, []
        for what in waiting:
            self._say(what)
        self._after_departure()
        self._take_line()

    def _after_departure(self) -> None:
        if self._turn is _Turn.SENDING and self._port.has_departed(self._answer_mark):
            self._turn = _Turn.READY
            self._port.make_room()

    def _say(self, what: Message) -> None:
        """Send a message, but never what a motion does before the answer to the command that began it."""
        if self._turn is _Turn.HOLDING and self._answer_is_of_motion:
            self._behind_answer.append(what)
            return
        if what.kind is MessageKind.POSITION_REACHED and self.lose_position_reached > 0:
            self.lose_position_reached -= 1
            self.log.add(self._now, LogKind.LOST, what.text)
        elif not self._is_lost(what.text):
            self.log.add(self._now, LogKind.MESSAGE, what.text)
            self._port.send(replies.message(what, self.knobs), self._now)

    def _is_lost(self, text: str) -> bool:
        """Take an answer or message for a fault hook, if one wants it."""
        if not self.silent:
            if self.lose_answers <= 0:
                return False
            self.lose_answers -= 1
        self.log.add(self._now, LogKind.LOST, text)
        return True

    def _execute_line(self) -> None:
        suppressed = self._machine.errors_suppressed
        try:
            self._answer = self._console.respond(self._line, self._now)
        except RefusedError as refused:
            self._answer = replies.error_text(refused.refusal, self.knobs, suppressed=suppressed)
        self._answer_is_of_motion = self._console.began_motion
        self._heed_p20()

    def _heed_p20(self) -> None:
        """Let the port work as the valid P20 says; to be called whenever that may have changed."""
        self._port.set_xonxoff(self._machine.xonxoff, self._now)
        self._port.set_binary(self._machine.binary)
