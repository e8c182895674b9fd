"""What a simulated cutter does with the bytes that arrive: data in pieces, everything else one by one."""

from __future__ import annotations

from math import inf
from typing import Final

from compax_aio.camm1.facts.line import ESCAPE

from ..wire import Wire
from .buffer import Buffer
from .control import Control
from .handshakes import Handshakes
from .log import LogKind
from .machine import Machine
from .surroundings import Surroundings
from .transmitter import Transmitter
from .trouble import Trouble

__all__ = ["Reception"]

_ABORTS: Final = (b"\x1b.J", b"\x1b.R")
_ESC: Final = bytes([ESCAPE])
_OUTPUT: Final = b"O"
_SEVEN_BITS: Final = 0x7F


class Reception:
    """
    Takes bytes in the order of time, and lets the machine do meanwhile what it does.

    Args:
        around: Of the cutter.
        wire: From where they come.
        buffer: Where data goes.
        machine: Who takes it from there.
        transmitter: Whose triggers and echoes are awaited.
        trouble: Which bytes are spoilt.
        handshakes: Who is told of what is stored.
        control: Who takes what is no data.

    Attributes:
        lost_bytes: For which there was no room.
        refused_bytes: That came while the machine was not ready.
        drops_until: Data up to then is dropped.
    """

    def __init__(
        self,
        around: Surroundings,
        *,
        wire: Wire,
        buffer: Buffer,
        machine: Machine,
        transmitter: Transmitter,
        trouble: Trouble,
        handshakes: Handshakes,
        control: Control,
    ) -> None:
        self._around = around
        self._wire = wire
        self._buffer = buffer
        self._machine = machine
        self._transmitter = transmitter
        self._trouble = trouble
        self._handshakes = handshakes
        self._control = control
        self.switch_on()

    def switch_on(self) -> None:
        """Begin anew."""
        self.lost_bytes = self.refused_bytes = 0
        self.drops_until = -inf
        self._heard = b""

    def advance(self, until: float) -> None:
        """Let everything happen that is due until then."""
        while True:
            self._take(until)
            reached = self._machine.run(until)
            self._around.reach(reached)
            if reached >= until and not self._wire.arrived(until):
                break

    def hears_at(self) -> float:
        """Return when something arrives that may have to be answered, or that stops the host."""
        wire = self._wire
        if not len(wire) or wire.is_stopped:
            return inf
        if not self._hears_plainly:
            return wire.at(0)
        at = inf
        for sign in (_ESC, _OUTPUT):  # behind both, two characters at least
            first = wire.first(sign)
            if first is not None:
                at = min(at, wire.at(first + 2))
        if enquiry := self._handshakes.enquiry:
            asked = wire.first(enquiry)
            at = min(at, inf if asked is None else wire.at(asked))
        told = self._handshakes.until_told
        return at if told is None else min(at, wire.at(told))

    @property
    def _hears_plainly(self) -> bool:
        """Whether what comes is data, but for some signs."""
        return (
            self._control.is_idle
            and not self._transmitter.awaits_trigger
            and self._transmitter.discards_from == inf
            and not self._trouble.spoils
            and self.drops_until == -inf
            and self._around.knobs.data_bits == 8
        )

    @property
    def _is_stored(self) -> bool:
        return self._around.is_on and (self._machine.is_ready or self._around.knobs.accept_when_not_ready)

    # In pieces

    def _take(self, until: float) -> None:
        """Take what has arrived."""
        wire = self._wire
        while count := wire.arrived(until):
            if self._hears_plainly:
                count = min(count, wire.before(_ESC + self._handshakes.enquiry))
                if count and self._take_piece(count, until):
                    continue
            self._take_byte()

    def _take_piece(self, count: int, until: float) -> bool:
        """Take data, as much as nobody has to be told of; False if the next byte is one of which somebody has."""
        wire = self._wire
        if not self._is_stored:
            self._machine_at(wire.next_at)
            self._refuse(len(wire.take(count)))
            return True
        headroom = self._handshakes.headroom
        if headroom < count:  # what the machine has read meanwhile is not reckoned in
            self._machine_at(wire.next_at)
            if not wire.arrived(until):
                return True
            headroom = self._handshakes.headroom
            if not headroom:
                return False
        count = min(count, headroom)
        first_at = wire.next_at
        self._buffer.append(wire.take(count), first_at, wire.byte_time_s)
        self._handshakes.stored(count, first_at + (count - 1) * wire.byte_time_s)
        return True

    def _machine_at(self, at: float) -> None:
        """Let the machine do what it does until then."""
        while self._machine.run(at) < at:
            pass
        self._around.reach(at)

    # One by one

    def _take_byte(self) -> None:
        """Take one byte, at the very time at which it arrives."""
        at = self._wire.next_at
        self._machine_at(at)
        if self._wire.next_at != at:  # the host is stopped, or goes on
            return
        byte = self._wire.take(1)[0]
        if not self._around.is_on:
            return
        if self._around.knobs.data_bits == 7:
            byte &= _SEVEN_BITS
        if self._trouble.spoils and (spoilt := self._trouble.spoilt(byte)) is not None:
            self._around.fail(15)
            byte = spoilt
        self._route(byte, at)

    def _route(self, byte: int, at: float) -> None:
        transmitter = self._transmitter
        if transmitter.awaits_trigger:
            if byte == transmitter.format.trigger:
                transmitter.triggered(at)
            else:
                self._listen_for_abort(byte, at)
        elif at >= transmitter.discards_from:
            if byte == transmitter.format.echo_terminator:
                transmitter.discards_from = inf
            else:
                self._listen_for_abort(byte, at)
        elif self._control.byte(byte, at):
            pass
        elif bytes([byte]) == self._handshakes.enquiry:
            self._handshakes.asked(at)
        else:
            self.store(byte, at)

    def _listen_for_abort(self, byte: int, at: float) -> None:
        """Hear ``.J`` and ``.R`` also where all else is ignored, or nobody could end that."""
        self._heard = (self._heard + bytes([byte]))[-3:]
        if self._heard in _ABORTS:
            for each in self._heard:
                self._control.byte(each, at)
            self._heard = b""

    def store(self, byte: int, at: float) -> None:
        """Store a byte of which somebody may have to be told, or that is lost."""
        buffer = self._buffer
        if at <= self.drops_until:
            return
        self.drops_until = -inf
        if not self._is_stored:
            self._refuse(1)
            return
        if not buffer.room:
            self._overflow()
            if self._around.knobs.overflow_drop == "newest":
                return
            buffer.drop_oldest(1)
            self._machine.forget_next()
        if buffer.room:
            buffer.append(bytes([byte]), at, 0.0)
            self._handshakes.stored(1, at)

    def _overflow(self) -> None:
        self.lost_bytes += 1
        log = self._around.log
        if self._around.io_error != 16 and (not log or log[-1].kind is not LogKind.OVERFLOW):
            self._around.fail(16)
        self._around.note_count(LogKind.OVERFLOW, self.lost_bytes)

    def _refuse(self, count: int) -> None:
        """Lose bytes that a machine that is not ready does not take."""
        if self._around.is_on:
            self.refused_bytes += count
            self._around.note_count(LogKind.REFUSED, self.refused_bytes)
