"""A controller between its UART and its machine: entry, execution, result, completion (DCB p. 27)."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum, auto
from random import Random

from compax_aio.smc.facts import CARRIAGE_RETURN, ESCAPE, LINE_FEED, PROMPT, RESET, Mode

from .entry import Entry, entry_of
from .language import Instruction
from .log import Ending, LogKind
from .machine import Machine, RefusedError
from .surroundings import Surroundings
from .trouble import Trouble
from .uart import Receiver, Transmitter, Wire

__all__ = ["Controller"]


class _Cycle(Enum):
    """Where a controller is with a command."""

    OFF = auto()
    """No power, or it begins anew: nothing is heard."""
    ENTRY = auto()
    EXECUTION = auto()
    """The terminator has come; nothing is read for a moment."""
    WAITING = auto()
    """A command waits for the end of another one, or its answer is late: ESC and ^C alone are heard."""


class Controller:
    """
    One controller on a line.

    Args:
        around: Time, knobs and log.
        trouble: Of the line.
        chance: Of the line.

    Attributes:
        machine: What commands do.
        pin: The mode that the input says, which is read at the next reset.
    """

    def __init__(self, around: Surroundings, trouble: Trouble, chance: Random) -> None:
        self._around = around
        self._agenda = around.agenda
        self._knobs = around.knobs
        self._trouble = trouble
        self.machine = Machine(around, self._go_on)
        self.pin = around.knobs.pin
        self._receiver = Receiver(
            around.agenda,
            around.knobs,
            chance,
            steps=lambda: self.machine.mechanics.moving,
            read=self._read,
            lost=self._overrun,
        )
        self._transmitter: Transmitter
        self._entry: Entry = entry_of(self.pin, self, around.knobs)
        self._cycle = _Cycle.ENTRY
        self._pending: tuple[Instruction, str] | None = None

    def connect(self, wire: Wire, gap_s: float = 0.0) -> None:
        """Send on that wire, with a gap between bytes."""
        self._transmitter = Transmitter(self._agenda, wire, self._knobs.byte_time_s, gap_s)

    # From outside

    def arrived(self, byte: int) -> None:
        """Take a character from the line."""
        if self._cycle is not _Cycle.OFF:
            self._receiver.arrived(byte)

    def reset(self, cause: str) -> None:
        """Begin anew: everything in RAM is lost, the input is read again (DCB p. 20)."""
        position = self.machine.mechanics.position
        self.switch_off()
        self._around.note(LogKind.RESET, cause)
        keeps = cause == "^C" and self._knobs.reset_keeps_position
        self.machine.mechanics.set_origin(position if keeps else 0.0)
        self.switch_on()

    def switch_off(self) -> None:
        """Be without power."""
        self._forget_command()
        self.machine.halt(Ending.RESET)
        self._transmitter.reset()
        self._receiver.reset()
        self._agenda.drop((self, "ready"))
        self._cycle = _Cycle.OFF

    def switch_on(self) -> None:
        """Begin, as after every reset."""
        self.machine.begin_anew(self.pin)
        self._agenda.put((self, "ready"), self._agenda.now + self._knobs.reset_time_s, self._ready)

    def jog(self, distance: float) -> None:
        """Have somebody press a jog input, which is looked at while the controller is idle (DCB p. 27)."""
        mechanics = self.machine.mechanics
        if self._cycle is not _Cycle.OFF and not mechanics.moving and not self.machine.program.running:
            mechanics.index(mechanics.position + distance, "jog")

    # The desk at which commands are entered

    @property
    def name(self) -> str:
        """What addresses this axis."""
        return self.machine.name

    def take_name(self, name: str) -> None:
        """Have that name from now on; S would store it."""
        self.machine.name = name
        self._around.note(LogKind.NAMED, repr(name))

    def echo(self, byte: int) -> None:
        """Send a character back."""
        sent = self._trouble.echo(self._around.letter, byte)
        if sent is not None:
            self._transmitter.send(bytes([sent]))

    def say(self, data: bytes) -> None:
        """Send something that is no echo."""
        self._transmitter.send(data)

    def entered(self, text: str) -> None:
        """Take a command; it is executed in a moment."""
        self._cycle = _Cycle.EXECUTION
        self._receiver.hold()
        self._plan(self._knobs.execution_time_s, lambda: self._execute(text))

    # Characters

    def _ready(self) -> None:
        self._entry = entry_of(self.machine.mode, self, self._knobs)
        self._cycle = _Cycle.ENTRY

    def _overrun(self, byte: int) -> None:
        self._around.note(LogKind.OVERRUN, f"{byte:02X}")

    def _read(self, byte: int) -> None:
        if self._trouble.resets():
            self.reset("itself")
            return
        if self._trouble.jogs():
            self.jog(self._knobs.jog_distance)
        self._agenda.drop((self, "stream"))
        if byte == RESET and not self._entry.is_naming:
            self._reset_by_line()
        elif byte == ESCAPE:
            self._abort()
        elif self._cycle is _Cycle.WAITING or (self.machine.program.running and self._knobs.during_program == "deaf"):
            self._entry.pass_by(byte)
        else:
            self._entry.take(byte)

    def _reset_by_line(self) -> None:
        answers = self._answers_all
        self.reset("^C")
        if answers:
            self.echo(RESET)

    def _abort(self) -> None:
        """Stop without a ramp, and be idle (DCB p. 26-27)."""
        self._around.note(LogKind.ABORT)
        self._forget_command()
        self.machine.halt(Ending.ABORT)
        self._cycle = _Cycle.ENTRY
        if self._answers_all:
            self.echo(ESCAPE)
        if self._entry.is_naming:
            self._entry.take(ESCAPE)
        else:
            self._entry.clear()

    @property
    def _answers_all(self) -> bool:
        """Whether a character that names nobody is answered or, in a ring, passed on."""
        return self._entry.relays or self._knobs.abort_echo == "all"

    # Commands

    def _execute(self, text: str) -> None:
        self._cycle = _Cycle.ENTRY
        self._receiver.release()
        if not text.strip(" "):
            self._answer_empty_line()
            return
        try:
            what = self.machine.understood(text)
            if self.machine.inserting is not None:
                self.machine.insert(what, text)
                self._answer("")
            elif self.machine.must_wait(what):
                self._wait_with(what, text)
            else:
                self._perform(what, text)
        except RefusedError as refused:
            self._around.note(LogKind.REFUSED, text)
            self._answer(refused.answer)

    def _wait_with(self, what: Instruction, text: str) -> None:
        self._around.note(LogKind.QUEUED, text)
        self._pending = (what, text)
        self._cycle = _Cycle.WAITING

    def _go_on(self) -> None:
        """Execute what has waited, if that is possible now: an action is over, or the axis stands."""
        if self._pending is not None and not self.machine.must_wait(self._pending[0]):
            pending, self._pending = self._pending, None
            self._cycle = _Cycle.ENTRY
            self._perform(*pending)

    def _perform(self, what: Instruction, text: str) -> None:
        self._around.note(LogKind.COMMAND, text)
        data = self.machine.perform(what, text)
        pause_s = self.machine.pause_s(what) + self._trouble.answer_delay_s(self._around.letter)
        if pause_s:
            self._cycle = _Cycle.WAITING
            self._plan(pause_s, lambda: self._answer_late(data))
        else:
            self._answer(data)
        if what.letter == "Z" and what.numbers[0]:
            self._stream_soon()

    def _answer_late(self, data: str) -> None:
        self._cycle = _Cycle.ENTRY
        self._answer(data)

    def _answer(self, data: str | None) -> None:
        """Send data and the terminator; None: neither."""
        if data is None:
            return
        self._around.note(LogKind.ANSWER, data.strip())
        self.say(data.encode("latin-1"))
        if self.machine.mode is Mode.SINGLE:
            self.echo(CARRIAGE_RETURN)
        self.echo(LINE_FEED)

    def _answer_empty_line(self) -> None:
        if self.machine.mode is not Mode.SINGLE:
            self._answer("")
        elif self._knobs.prompt == "framed":
            self._answer(PROMPT)
        else:
            self.say(PROMPT.encode("ascii"))

    def _stream_soon(self) -> None:
        at = self._agenda.now + self._knobs.stream_interval_s
        self._agenda.put((self, "stream"), at, self._stream)

    def _stream(self) -> None:
        self.say(self.machine.position_text().encode("ascii") + bytes([CARRIAGE_RETURN]))
        self._stream_soon()

    def _plan(self, after_s: float, action: Callable[[], None]) -> None:
        self._agenda.put((self, "command"), self._agenda.now + after_s, action)

    def _forget_command(self) -> None:
        self._pending = None
        self._agenda.drop((self, "command"))
        self._agenda.drop((self, "stream"))
