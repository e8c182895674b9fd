"""The drive's serial port: lines and frames, byte times, Xon and Xoff. It outlives every connection, as a real one."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Final

from compax_aio.compax.facts.line import COMMAND_END, MAX_LINE_LENGTH, XOFF, XON

from .binary import frame_length
from .knobs import Knobs

__all__ = ["Received", "ReceivedFrame", "ReceivedLine", "SerialPort"]

_CR: Final = COMMAND_END[0]
_LF: Final = 0x0A
_BITS_A_BYTE: Final = 10
"""8 data bits, start and stop (UG p. 160)."""
_MAX_WAITING: Final = 65_536
"""Bytes kept in any one direction; more are lost, so that memory is bounded."""


@dataclass(frozen=True, slots=True)
class ReceivedLine:
    """What stood in the entry buffer when CR came."""

    text: str
    too_long: bool

    @property
    def raw(self) -> bytes:
        """What an echo sends back."""
        return self.text.encode("latin-1") + COMMAND_END


@dataclass(frozen=True, slots=True)
class ReceivedFrame:
    """A binary command, all the bytes that its first byte has announced."""

    raw: bytes
    """Also what an echo sends back: no CR came, so none is sent."""


Received = ReceivedLine | ReceivedFrame


class SerialPort:
    """
    Bytes from and to the host, with the time each takes.

    What a byte belongs to is settled when it arrives. With binary transfer on, one that announces a frame begins it if
    the entry buffer is empty; behind half a line it is a character of that line, and spoils it. A frame that has begun
    takes as many bytes as it has announced, whatever they are and whatever P20 says meanwhile: also CR, LF, Xon and
    Xoff, and the line that was sent after a frame was cut. The manual says only that a frame has no end sign and must
    be sent in full (UG p. 166); the rest is the likeliest reading.
    """

    def __init__(self, knobs: Knobs) -> None:
        self._byte_time_s = _BITS_A_BYTE / knobs.baudrate if knobs.baudrate else 0.0
        self._xonxoff = self._binary = False
        self._truncates = knobs.long_line == "truncate"
        self._one_line = knobs.ready_after_answer
        self.reset()
        self._left = bytearray()

    def reset(self) -> None:
        """Forget everything, as without power; what has left has left."""
        self._entry = bytearray()
        self._too_long = False
        self._frame_length = 0
        self._full = False
        self._received: deque[Received] = deque()
        self._kept = 0
        self._arriving: deque[tuple[float, int]] = deque()
        self._input_free_at = 0.0
        self._waiting = bytearray()
        self._departs_at: float | None = None
        self._held = False
        self._queued = self._departed = 0

    # From the host

    def receive(self, data: bytes, now: float) -> None:
        """Take bytes that the host begins to send now."""
        if not self._byte_time_s:
            for byte in data:
                self._arrived(byte, now)
            return
        for byte in data[: _MAX_WAITING - len(self._arriving)]:
            self._input_free_at = max(self._input_free_at, now) + self._byte_time_s
            self._arriving.append((self._input_free_at, byte))

    def next_received(self) -> Received | None:
        """Return the oldest line or frame that has arrived whole; half of one stays until the rest comes."""
        if not self._received:
            return None
        received = self._received.popleft()
        self._kept -= len(received.raw)
        return received

    def set_xonxoff(self, on: bool, now: float) -> None:
        """Heed Xon and Xoff from now on, or no more; output that Xoff holds then goes."""
        self._xonxoff = on
        if not on and self._held:
            self._held = False
            self._depart(now)

    def set_binary(self, on: bool) -> None:
        """Let lines that begin from now on be frames too, or no more."""
        self._binary = on

    def make_room(self) -> None:
        """Receive again, after a line has been answered; matters only to a drive that takes one line at a time."""
        self._full = False

    def _arrived(self, byte: int, now: float) -> None:
        if self._xonxoff and byte in {XON, XOFF} and not self._frame_length:
            self._held = byte == XOFF
            self._depart(now)
        elif not self._full and self._kept < _MAX_WAITING:
            self._enter(byte)

    def _enter(self, byte: int) -> None:
        """Put a byte into the entry buffer; CR completes a line, the last byte that was announced a frame."""
        if self._binary and not self._entry:
            self._frame_length = frame_length(byte)
        if self._frame_length:
            self._entry.append(byte)
            if len(self._entry) == self._frame_length:
                self._complete(ReceivedFrame(bytes(self._entry)))
        elif byte == _CR:
            too_long = self._too_long and not self._truncates
            self._complete(ReceivedLine(self._entry.decode("latin-1"), too_long))
        elif len(self._entry) >= MAX_LINE_LENGTH:
            self._too_long |= byte != _LF
        elif byte != _LF:
            self._entry.append(byte)

    def _complete(self, received: Received) -> None:
        self._received.append(received)
        self._kept += len(received.raw)
        self._entry.clear()
        self._too_long = False
        self._frame_length = 0
        self._full = self._one_line

    # To the host

    def send(self, data: bytes, now: float) -> int:
        """Put bytes behind those that wait; return a mark for :meth:`has_departed`."""
        accepted = data[: _MAX_WAITING - len(self._waiting)]
        self._waiting += accepted
        self._queued += len(accepted)
        self._depart(now)
        return self._queued

    def has_departed(self, mark: int) -> bool:
        """Whether all bytes up to *mark* are on their way."""
        return self._departed >= mark

    def inject(self, data: bytes | bytearray) -> None:
        """Put noise on the line at once, even into the middle of an answer."""
        self._left += data
        del self._left[:-_MAX_WAITING]

    def take(self) -> bytes:
        """Return the bytes that have come out since the last call."""
        data = bytes(self._left)
        self._left.clear()
        return data

    def _depart(self, now: float) -> None:
        """Let bytes go, all at once or one after the other."""
        if self._held or not self._waiting or self._departs_at is not None:
            return
        if self._byte_time_s:
            self._departs_at = now + self._byte_time_s
            return
        self._departed += len(self._waiting)
        self.inject(self._waiting)
        self._waiting.clear()

    # Time

    def next_event_at(self) -> float | None:
        """Return when the next byte has arrived or departed."""
        if not self._arriving:
            return self._departs_at
        arrives_at = self._arriving[0][0]
        return arrives_at if self._departs_at is None else min(arrives_at, self._departs_at)

    def step(self, now: float) -> None:
        """Let the next byte, which must be due, arrive or depart."""
        if self._arriving and self._arriving[0][0] <= now:
            self._arrived(self._arriving.popleft()[1], now)
            return
        # A byte under way is finished even after Xoff.
        self.inject(self._waiting[:1])
        del self._waiting[:1]
        self._departed += 1
        self._departs_at = None
        self._depart(now)
