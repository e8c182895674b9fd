"""XMODEM as a simulated control speaks it, both ways: blocks of 128 bytes, a sum, and signs."""

from __future__ import annotations

from math import inf
from typing import Final

from compax_aio.haas.facts.characters import ACK, CAN, EOT, LINE_FEED, NAK, SOH, SUB
from compax_aio.haas.facts.eob import EobPattern
from compax_aio.haas.facts.xmodem import BLOCK_BYTES, CANCELS_TO_STOP, FIRST_BLOCK, FRAME_BYTES

from .dnc import DncSink
from .log import LogKind
from .operations import Port
from .sinks import Sink

__all__ = ["XmodemReceiving", "XmodemSending"]

_END_CANCELS: Final = 3
"""Seen behind EOT."""
_PAUSE_IN_BLOCK_S: Final = 1.0
"""A block that stops for so long in the middle is refused."""
_NUMBERS: Final = 256
_FILL: Final = bytes([SUB])


def _sum(data: bytes, eob: EobPattern, *, as_if_lf: bool) -> int:
    """Add up a block; as if its ends of block were LF, where the control is said to do so."""
    if as_if_lf:
        data = data.replace(eob.data, bytes([LINE_FEED]))
    return sum(data) % _NUMBERS


class _Signs:
    """CAN, counted: two in a row end it."""

    def __init__(self) -> None:
        self._cancels = 0

    def cancels(self, byte: int) -> bool:
        """Take a byte; whether the host ends it."""
        self._cancels = self._cancels + 1 if byte == CAN else 0
        return self._cancels >= CANCELS_TO_STOP


class XmodemReceiving:
    """
    Receives a file, or feeds DNC, by XMODEM: says NAK until a host begins.

    Args:
        port: Of the control.
        what: For people.
        sink: Where it goes.
    """

    buffers = can_fill = False
    signs = b""
    is_full = False

    def __init__(self, port: Port, what: str, sink: Sink | DncSink) -> None:
        self.name = what if isinstance(sink, DncSink) else f"receiving {what}"
        self._port = port
        self._knobs = port.around.knobs
        self._sink = sink
        self._signs = _Signs()
        self._frame = bytearray()
        self._expected = FIRST_BLOCK
        self._has_begun = False
        self._tries = 0
        self._waiting = b""
        self._at = inf

    @property
    def needs(self) -> int:
        """Bytes until a block is whole; a sign is one."""
        return FRAME_BYTES - len(self._frame) if self._frame else 1

    def begin(self, now: float) -> None:
        """Say NAK for the first time."""
        self._say("NAK", now)
        self._at = now + self._knobs.nak_every_s

    # What comes

    def feed(self, data: bytes, at: float, step_s: float) -> int:
        """Take bytes, up to the end of a block or a sign."""
        if self._waiting:  # the host sends though its last block is not acknowledged
            return len(data)
        if not self._frame:
            self._sign(data[0], at)
            return 1
        count = min(len(data), FRAME_BYTES - len(self._frame))
        self._frame += data[:count]
        last_at = at + (count - 1) * step_s
        self._at = last_at + _PAUSE_IN_BLOCK_S
        if len(self._frame) == FRAME_BYTES:
            frame = bytes(self._frame)
            self._frame.clear()
            self._block(frame, last_at)
        return count

    def _sign(self, byte: int, at: float) -> None:
        if self._signs.cancels(byte):
            self._abort("CAN CAN", at)
        elif byte == SOH:
            self._frame.append(byte)
            self._at = at + _PAUSE_IN_BLOCK_S
        elif byte == EOT and self._has_begun:
            self._end(at)

    def _block(self, frame: bytes, at: float) -> None:
        number, data = frame[1], frame[3 : 3 + BLOCK_BYTES]
        right = _sum(data, self._knobs.eob_pattern, as_if_lf=self._knobs.sum_as_if_lf)
        if number + frame[2] != _NUMBERS - 1:
            self._refuse(f"{number}: number", at)
        elif right != frame[-1]:
            self._refuse(f"{number}: sum", at)
        elif self._has_begun and number == (self._expected - 1) % _NUMBERS:
            self._note(f"repeated {number}", at)
            self._at = at + self._knobs.block_wait_s
            if self._knobs.repeated_block == "ack":
                self._say("ACK", at)
        elif number != self._expected:
            self._refuse(f"{number}: not {self._expected}", at)
        elif self._port.trouble.refuses_block():
            self._refuse(f"{number}: trouble", at)
        else:
            self._note(f"took {number}", at)
            self._has_begun = True
            self._tries = 0
            self._expected = (number + 1) % _NUMBERS
            self._waiting = data
            self._take(at)

    def _refuse(self, why: str, at: float) -> None:
        self._note(f"refused {why}", at)
        self._again(at)

    def _again(self, at: float) -> None:
        self._tries += 1
        if self._tries > self._knobs.block_retries:
            self._port.around.alarm("missing-code", "XMODEM", at)
            self._cancel(at)
            self._abort("too many tries", at)
            return
        self._say("NAK", at)
        self._at = at + self._knobs.block_wait_s

    def _take(self, at: float) -> None:
        """Hand a block on; it is acknowledged when all of it is taken."""
        sink = self._sink
        if not sink.tape.is_ended:
            self._waiting = self._waiting[sink.feed(self._waiting, at, 0.0) :]
        if sink.must_stop:
            self._cancel(at)
            self._abort("", at)
        elif not self._waiting or self._is_complete():
            self._waiting = b""
            self._say("ACK", at)
            self._at = at + self._knobs.block_wait_s

    def _is_complete(self) -> bool:
        return self._sink.tape.is_ended

    # Time

    def next_at(self) -> float:
        """When it says NAK again, or executes the next block of a program."""
        at = inf if self._waiting else self._at
        return min(at, self._sink.next_at()) if isinstance(self._sink, DncSink) else at

    def run(self, now: float) -> None:
        """Do what is due."""
        if isinstance(self._sink, DncSink):
            self._sink.run(now)
            if self._sink.must_stop:
                self._cancel(now)
                self._abort("", now)
                return
            if self._waiting:
                self._take(now)
                return
        if now < self._at:
            return
        if self._frame:
            self._frame.clear()
            self._refuse("in the middle", now)
        elif self._has_begun:
            self._again(now)
        else:
            self._say("NAK", now)
            self._at = now + self._knobs.nak_every_s

    # The end

    def _end(self, at: float) -> None:
        if self._knobs.end_answer == "cancel":
            self._port.transmitter.send(bytes([CAN]) * _END_CANCELS, at)
        else:
            self._say("ACK", at)
        if self._is_complete():
            self._sink.end(at)
            self._port.over("RS232 ABORT" if self._sink.must_stop else "RS232 DONE", at)
        else:
            self._port.around.alarm("unexpected-end", at=at)
            self._abort("", at)

    def _cancel(self, at: float) -> None:
        self._port.transmitter.send(bytes([CAN]) * CANCELS_TO_STOP, at)

    def _abort(self, why: str, at: float) -> None:
        if why:
            self._note(f"ended: {why}", at)
        self._sink.abort(at)
        self._port.over("RS232 ABORT", at)

    def abort(self, now: float) -> None:
        """Tell the host that it is over."""
        self._cancel(now)
        self._sink.abort(now)

    def _say(self, sign: str, at: float) -> None:
        if not self._port.trouble.loses(sign):
            self._port.transmitter.send(bytes([ACK if sign == "ACK" else NAK]), at)

    def _note(self, text: str, at: float) -> None:
        self._port.around.note(LogKind.BLOCK, text, at)


class XmodemSending:
    """
    Sends a file by XMODEM: waits for NAK, then block by block.

    Args:
        port: Of the control.
        what: For people.
        data: The file.
    """

    buffers = can_fill = False
    signs = b""
    is_full = False
    needs = 1

    def __init__(self, port: Port, what: str, data: bytes) -> None:
        self.name = f"sending {what}"
        self._port = port
        self._knobs = port.around.knobs
        self._data = data
        self._signs = _Signs()
        self._place = -BLOCK_BYTES
        self._tries = 0
        self._at = inf

    def begin(self, now: float) -> None:
        """Wait for the host."""

    def feed(self, data: bytes, at: float, step_s: float) -> int:
        """Take a sign."""
        del step_s
        sign = data[0]
        if self._signs.cancels(sign):
            self._note("ended: CAN CAN", at)
            self._port.over("RS232 ABORT", at)
        elif sign == NAK and at >= self._port.transmitter.ends_at:
            if self._place < 0:
                self._next(at)
            else:
                self._again(at)
        elif sign == ACK and self._place >= 0:
            self._next(at)
        return 1

    def _next(self, at: float) -> None:
        if self._place >= len(self._data):
            self._port.over("RS232 DONE", at)
            return
        self._place += BLOCK_BYTES
        self._tries = 0
        self._say("sent", at)

    def _again(self, at: float) -> None:
        self._tries += 1
        if self._tries > self._knobs.block_retries:
            self._port.transmitter.send(bytes([CAN]) * CANCELS_TO_STOP, at)
            self._note("ended: too many tries", at)
            self._port.over("RS232 ABORT", at)
        else:
            self._say("again", at)

    def _say(self, word: str, at: float) -> None:
        """Send the block, or EOT behind the last one."""
        transmitter = self._port.transmitter
        number = (self._place // BLOCK_BYTES + FIRST_BLOCK) % _NUMBERS
        if self._place >= len(self._data):
            self._note(f"{word} EOT", at)
            transmitter.send(bytes([EOT]), at)
        else:
            data = self._data[self._place : self._place + BLOCK_BYTES].ljust(BLOCK_BYTES, _FILL)
            added = _sum(data, self._knobs.eob_pattern, as_if_lf=self._knobs.sum_as_if_lf)
            if self._port.trouble.spoils_block():
                added ^= 1
            self._note(f"{word} {number}", at)
            transmitter.send(bytes([SOH, number, _NUMBERS - 1 - number]) + data + bytes([added]), at)
        self._at = max(transmitter.ends_at, at) + self._knobs.block_wait_s

    def next_at(self) -> float:
        """When the host has not answered for too long."""
        return self._at

    def run(self, now: float) -> None:
        """Send it again."""
        if now >= self._at:
            self._again(now)

    def abort(self, now: float) -> None:
        """Tell the host that it is over."""
        self._port.transmitter.abort(now)
        self._port.transmitter.send(bytes([CAN]) * CANCELS_TO_STOP, now)

    def _note(self, text: str, at: float) -> None:
        self._port.around.note(LogKind.BLOCK, text, at)
