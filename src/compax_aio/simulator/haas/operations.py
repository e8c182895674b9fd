"""What a simulated control can be at besides answering requests: sending and receiving a file, byte by byte."""

from __future__ import annotations

from math import inf
from typing import Generic, Protocol, TypeVar

from compax_aio.haas.facts.characters import DC1, DC2, DC3, DC4, NUL, SPACE
from compax_aio.haas.facts.port_settings import Synchronization

from .dnc import DncSink
from .log import LogKind
from .sinks import Sink
from .surroundings import Surroundings
from .transmitter import Transmitter
from .trouble import Trouble

__all__ = ["Feeding", "Operation", "Port", "StreamReceiving", "StreamSending", "begin_reading", "send_code"]

_LEADER_BYTES = 60
_Sink = TypeVar("_Sink", bound=Sink)
_CODES = {"DC1": DC1, "DC2": DC2, "DC3": DC3, "DC4": DC4}


class Port(Protocol):
    """What an operation needs of the control around it."""

    around: Surroundings
    transmitter: Transmitter
    trouble: Trouble

    def over(self, screen: str, at: float) -> None:
        """Take note that the operation is over."""

    def lost(self, count: int) -> None:
        """Take note of bytes that nobody waited for."""


class Operation(Protocol):
    """One of them."""

    name: str
    """For people: ``sending O01234``."""
    buffers: bool
    """What comes goes through the receive buffer."""
    can_fill: bool
    """It may have to leave bytes there."""
    signs: bytes
    """Characters of which the very time of arrival matters."""

    def begin(self, now: float) -> None:
        """Begin."""

    @property
    def is_full(self) -> bool:
        """Whether nothing more can be taken now."""

    @property
    def needs(self) -> int:
        """So many bytes at least before anything can have to be said."""

    def feed(self, data: bytes, at: float, step_s: float) -> int:
        """Take bytes, of which the first came *at*; returns how many were taken."""

    def next_at(self) -> float:
        """When it does something by itself."""

    def run(self, now: float) -> None:
        """Do what is due now."""

    def abort(self, now: float) -> None:
        """End it in the middle."""


def send_code(port: Port, name: str, now: float) -> None:
    """Send a reader or punch code, late by its knob, unless it is dropped."""
    if port.trouble.loses(name):
        port.around.note(LogKind.CODE, f"{name} dropped", now)
        return
    delay_s: float = getattr(port.around.knobs, f"{name.lower()}_delay_s")
    port.around.note(LogKind.CODE, name, now + delay_s)
    not_before = now if not delay_s else max(port.transmitter.ends_at, now) + delay_s
    port.transmitter.send(bytes([_CODES[name]]), not_before)


def begin_reading(port: Port, now: float) -> None:
    """Tell the host that it may send, where Setting 14 has it."""
    knobs = port.around.knobs
    if knobs.mode is Synchronization.DC_CODES:
        send_code(port, "DC1", now)
    elif knobs.mode is Synchronization.XON_XOFF and knobs.xon_at_start:
        port.around.note(LogKind.FLOW, "Xon", now)
        port.transmitter.sign(bytes([DC1]), now)


class StreamSending:
    """
    Sends a file as bytes, between DC2 and DC4 where Setting 14 has it.

    Args:
        port: Of the control.
        what: For people.
        data: The file.
    """

    buffers = can_fill = False
    signs = b""
    is_full = False
    needs = 64

    def __init__(self, port: Port, what: str, data: bytes) -> None:
        self.name = f"sending {what}"
        self._port = port
        self._data = data

    def begin(self, now: float) -> None:
        """Send all of it; the host may stop it."""
        port = self._port
        knobs = port.around.knobs
        has_codes = knobs.mode is Synchronization.DC_CODES
        if has_codes:
            send_code(port, "DC2", now)
        leader = {"none": b"", "blank": bytes([SPACE]), "nul": bytes([NUL])}[knobs.leader]
        port.transmitter.send(leader * _LEADER_BYTES + self._data, now)
        if has_codes:
            send_code(port, "DC4", now)

    def feed(self, data: bytes, at: float, step_s: float) -> int:
        """Lose what comes meanwhile."""
        del at, step_s
        self._port.lost(len(data))
        return len(data)

    def next_at(self) -> float:
        """When all has left."""
        return self._port.transmitter.ends_at

    def run(self, now: float) -> None:
        """Be done, if all has left."""
        if self._port.transmitter.ends_at <= now:
            self._port.over("RS232 DONE", now)

    def abort(self, now: float) -> None:
        """Send no more."""
        self._port.transmitter.abort(now)


class _StreamTaking(Generic[_Sink]):
    """
    Takes a file as bytes up to its end, between DC1 and DC3 where Setting 14 has it.

    Args:
        port: Of the control.
        name: For people.
        sink: Where it goes.
    """

    signs = b"%"
    needs = 64

    def __init__(self, port: Port, name: str, sink: _Sink) -> None:
        self.name = name
        self._port = port
        self._sink = sink

    @property
    def is_full(self) -> bool:
        """Whether the sink is."""
        return self._sink.is_full

    def _has_ended(self) -> bool:
        """Whether the last % has come."""
        return self._sink.tape.is_ended

    def begin(self, now: float) -> None:
        """Turn the reader on."""
        begin_reading(self._port, now)

    def _reader_off(self, now: float) -> None:
        if self._port.around.knobs.mode is Synchronization.DC_CODES:
            send_code(self._port, "DC3", now)

    def _stop(self, now: float) -> None:
        self._sink.abort(now)
        self._port.over("RS232 ABORT", now)

    def abort(self, now: float) -> None:
        """Take no more; the sink keeps or drops what has come."""
        self._sink.abort(now)


class StreamReceiving(_StreamTaking[Sink]):
    """
    Receives a file as bytes, and stores it.

    Args:
        port: Of the control.
        what: For people.
        sink: Where it goes.
    """

    buffers = True
    can_fill = False

    def __init__(self, port: Port, what: str, sink: Sink) -> None:
        super().__init__(port, f"receiving {what}", sink)
        self._heard_at = inf

    def begin(self, now: float) -> None:
        """Turn the reader on, and listen from now on."""
        super().begin(now)
        self._heard_at = now

    def feed(self, data: bytes, at: float, step_s: float) -> int:
        """Hand on to the sink, and end where the file does."""
        sink, knobs = self._sink, self._port.around.knobs
        if self._has_ended():
            return self._behind_the_end(data, at, step_s)
        taken = sink.feed(data, at, step_s)
        self._heard_at = at + max(0, taken - 1) * step_s
        if sink.must_stop:
            self._stop(self._heard_at)
        elif self._has_ended() and knobs.end_of_receive == "percent":
            self._done(self._heard_at)
        elif self._has_ended() and taken < len(data):
            return taken + self._behind_the_end(data[taken:], at + taken * step_s, step_s)
        return taken

    def _behind_the_end(self, data: bytes, at: float, step_s: float) -> int:
        """Take what follows the second % where that does not end it yet."""
        if self._port.around.knobs.end_of_receive == "silence":
            self._heard_at = at + (len(data) - 1) * step_s
            place = data.find(b"%")
            if place < 0:
                return len(data)
            self._sink.tape.reopen()
            return place + self.feed(data[place:], at + place * step_s, step_s)
        for place, byte in enumerate(data):
            if byte in b"\r\n":
                self._done(at + place * step_s)
                return place + 1
        return len(data)

    def next_at(self) -> float:
        """When it has waited long enough."""
        knobs = self._port.around.knobs
        if self._has_ended():
            return self._heard_at + knobs.silence_s if knobs.end_of_receive == "silence" else inf
        return self._heard_at + knobs.input_timeout_s if knobs.input_timeout_s else inf

    def run(self, now: float) -> None:
        """End it, if it has waited long enough."""
        if now < self.next_at():
            return
        if self._has_ended():
            self._done(now)
        else:
            self._port.around.alarm("unexpected-end", at=now)
            self._stop(now)

    def _done(self, now: float) -> None:
        self._sink.end(now)
        self._reader_off(now)
        self._port.over("RS232 ABORT" if self._sink.must_stop else "RS232 DONE", now)


class Feeding(_StreamTaking[DncSink]):
    """
    Executes what comes (DNC).

    Args:
        port: Of the control.
        sink: Executes blocks.
    """

    buffers = can_fill = True

    def __init__(self, port: Port, sink: DncSink) -> None:
        super().__init__(port, "dnc", sink)

    def feed(self, data: bytes, at: float, step_s: float) -> int:
        """Hand on what there is room for; behind the last % nothing is taken."""
        if self._has_ended():
            return len(data)
        taken = self._sink.feed(data, at, step_s)
        last_at = at + max(0, taken - 1) * step_s
        if self._has_ended():
            self._reader_off(last_at)
        if self._sink.must_stop:
            self._stop(last_at)
        return taken

    def next_at(self) -> float:
        """When the next block begins, or the last one ends."""
        sink = self._sink
        if sink.is_idle and self._has_ended() and self._port.around.knobs.dnc_ends == "percent":
            return sink.busy_until
        return sink.next_at()

    def run(self, now: float) -> None:
        """Execute, and end behind the last block."""
        self._sink.run(now)
        if self._sink.must_stop:
            self._stop(now)
        elif self._sink.is_idle and self.next_at() <= now:
            self._port.over("RS232 DONE", now)
