"""What a simulated cutter does when it is asked, told to abort, or has made room: the middle of all its parts."""

from __future__ import annotations

from compax_aio.camm1.facts.handshakes import OutputKind
from compax_aio.camm1.facts.line import SEMICOLON

from ..wire import Wire
from .buffer import Buffer
from .control import Control
from .handshakes import Handshakes
from .knobs import Knobs
from .log import Log, LogKind
from .machine import Machine
from .reception import Reception
from .reports import output, status
from .surroundings import Surroundings
from .transmitter import Transmitter
from .trouble import Trouble

__all__ = ["Interior"]


class Interior:
    """
    All parts of one cutter, and what they want of each other.

    Args:
        knobs: Of the cutter.
        log: Where it notes what it does.
    """

    def __init__(self, knobs: Knobs, log: Log) -> None:
        self.around = around = Surroundings(knobs, log)
        self.trouble = Trouble(knobs, lambda text: around.note(LogKind.TROUBLE, text))
        self.buffer = Buffer(knobs.physical_bytes)
        self.wire = Wire(knobs.byte_time_s, knobs.dtr_overshoot)
        self.transmitter = Transmitter(knobs.byte_time_s, knobs.data_bits)
        self.machine = Machine(around, self.buffer, self)
        self.handshakes = Handshakes(around, self.buffer, self.wire, self.transmitter, self.trouble)
        self.control = Control(knobs, self.handshakes, self.transmitter, self)
        self.reception = Reception(
            around,
            wire=self.wire,
            buffer=self.buffer,
            machine=self.machine,
            transmitter=self.transmitter,
            trouble=self.trouble,
            handshakes=self.handshakes,
            control=self.control,
        )
        self.owes_size = False

    # What the machine tells

    def freed(self, now: float) -> bool:
        """Let the host go on, if that is what it waits for; whether it sends at once."""
        if self.owes_size and not self.buffer.stored:
            self.owes_size = False
            self._reply("L", str(self.handshakes.logical_bytes), now)
        return self.handshakes.freed(now) if self.handshakes.waits_for_room else False

    def asked(self, name: str, now: float) -> None:
        """Answer an output instruction, unless another answer is unfinished."""
        if self._is_answering(now):
            self.around.fail(10)
        else:
            self._reply(name, output(name, self.machine, self.around.knobs, now), now)

    @property
    def is_watched(self) -> bool:
        """Whether somebody is told of what the machine does next."""
        return (
            self.handshakes.waits_for_room
            or self.owes_size
            or self.around.log.on_entry is not None
            or b"O" in self.buffer.data
        )

    # What device control instructions do

    def obey(self, text: str, now: float) -> None:
        """Note a device control instruction."""
        self.around.reach(now)
        self.around.note(LogKind.CONTROL, text)
        if self.around.knobs.esc_splits_instruction and self.buffer.room and self.machine.partial():
            self.buffer.append(bytes([SEMICOLON]), now, 0.0)
        if stray := self.trouble.stray():
            self.transmitter.inject(stray)

    def answer(self, letter: str, now: float) -> None:
        """Answer a question, unless another answer is unfinished."""
        around, knobs = self.around, self.around.knobs
        if self._is_answering(now):
            around.fail(10)
        elif letter == "B":
            self._reply(letter, str(self.handshakes.told_free), now)
        elif letter == "E":
            error, around.io_error = around.io_error, 0
            self._reply(letter, "" if not error and knobs.empty_e else str(error), now)
        elif letter == "O":
            self._reply(letter, str(status(self.machine, knobs, is_empty=not self.buffer.stored)), now)
        elif letter == "A":
            self._reply(letter, knobs.model_answer, now)
        elif knobs.size_waits and self.buffer.stored:
            self.owes_size = True
        else:
            self._reply(letter, str(self.handshakes.logical_bytes), now)

    def abort_output(self, now: float) -> None:
        """Drop what has not left, and what would be said later (``.J``)."""
        self.transmitter.abort(now)
        self.handshakes.abort()
        self.owes_size = False

    def clear(self, now: float) -> None:
        """Throw away all instructions but the one that is carried out (``.K``)."""
        knobs = self.around.knobs
        self.clear_buffer("K", now, kept=0 if knobs.k_drops_partial else self.machine.partial())
        if knobs.k_window_ms:
            self.reception.drops_until = now + knobs.k_window_ms / 1000
        if knobs.reset_clears_error:
            self.around.io_error = 0

    def reset(self, now: float) -> None:
        """Do what ``.R`` does besides what it stands for."""
        if self.around.knobs.reset_restores_dip:
            self.handshakes.power_on()
            self.handshakes.look(now)
        if self.around.knobs.reset_clears_error:
            self.around.io_error = 0

    def put(self, data: bytes, now: float) -> None:
        """Store what was no device control instruction after all."""
        for byte in data:
            self.reception.store(byte, now)

    def note_io_error(self, code: int, now: float) -> None:
        """Keep an error of a device control instruction."""
        self.around.reach(now)
        self.around.fail(code)

    def clear_buffer(self, by: str, now: float, *, kept: int = 0) -> None:
        """Throw away what is stored, and what was read and not begun."""
        self.machine.drop_waiting()
        dropped = self.buffer.clear(kept=kept)
        self.machine.forget_next()
        self.around.note(LogKind.CLEARED, f"{by} {dropped}", now)
        self.freed(now)

    def _is_answering(self, now: float) -> bool:
        return self.owes_size or self.transmitter.is_busy(now)

    def _reply(self, asked: str, text: str, now: float) -> None:
        self.around.note(LogKind.ANSWER, f"{asked} {text}", now)
        reply, late_s = self.trouble.reply(text.encode())
        if reply is not None:
            self.transmitter.send(reply, OutputKind.REPLY, now, late_s=late_s)
