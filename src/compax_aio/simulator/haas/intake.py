"""How bytes reach a simulated control: in time, past the parity check, through a buffer that tells the host to stop."""

from __future__ import annotations

from math import inf
from typing import Final, Protocol

from compax_aio.haas.facts.characters import DC1, DC3
from compax_aio.haas.facts.port_settings import Synchronization

from ..wire import Wire
from .log import LogKind
from .operations import Operation
from .parity import ByteForm
from .surroundings import Surroundings
from .transmitter import Transmitter
from .trouble import Trouble

__all__ = ["Intake", "Listener"]

_SIGNS: Final = bytes([DC1, DC3])
_SIGNED_MODES: Final = frozenset({Synchronization.XON_XOFF, Synchronization.DC_CODES})
_PART_OF_A_BYTE: Final = 1e-6


class Listener(Protocol):
    """Who takes what comes."""

    @property
    def operation(self) -> Operation | None:
        """What the control is at; None: it answers requests."""

    def heard(self, data: bytes, at: float, step_s: float) -> int:
        """Take bytes; returns how many, and the rest has to wait."""

    def damaged(self, alarm: str, at: float) -> None:
        """Take note of a byte that the port could not read, or had no room for."""

    def lost(self, count: int) -> None:
        """Take note of bytes that nobody takes."""

    @property
    def awaits_requests(self) -> bool:
        """Whether somebody listens while the control is at nothing."""


class Intake:
    """
    The way from the host.

    Args:
        around: Of the control.
        wire: From where bytes come; stopped and let go by pin 4.
        transmitter: Where Xon and Xoff are sent, and what the host stops by its own.
        trouble: What befalls bytes.
        form: What the port makes of them.
        listener: Who takes them.

    Attributes:
        is_stopped: The host was told to stop, and not to go on.
    """

    def __init__(
        self,
        around: Surroundings,
        *,
        wire: Wire,
        transmitter: Transmitter,
        trouble: Trouble,
        form: ByteForm,
        listener: Listener,
    ) -> None:
        knobs = around.knobs
        self._around = around
        self._wire = wire
        self._transmitter = transmitter
        self._trouble = trouble
        self._form = form
        self._listener = listener
        self._mode = knobs.mode
        self._take_time_s = 1 / knobs.take_bytes_s if knobs.take_bytes_s else 0.0
        self._hwm, self._lwm, self._size = knobs.hwm, knobs.lwm, knobs.hwm + knobs.slack
        self._data = bytearray()
        self._next_take_at = 0.0
        self.is_stopped = False

    @property
    def filled(self) -> int:
        """Bytes in the buffer."""
        return len(self._data)

    def clear(self, now: float) -> None:
        """Begin anew with an empty buffer; the host may send, if anybody listens."""
        self._data.clear()
        if self.is_stopped:
            self._go_on(now)
        self.set_idle_line(now)

    def set_idle_line(self, now: float) -> None:
        """Set pin 4 as it is while nothing is received, or is about to be."""
        if self._mode is not Synchronization.RTS_CTS or self._around.knobs.pin4_idle == "high":
            return
        is_wanted = self._may_store or self._listener.awaits_requests
        if is_wanted == self._wire.is_stopped:
            self._set_line(is_wanted, now)

    # Time

    def step(self, until: float) -> bool:
        """Do the next thing that is due by then; whether there was one."""
        if self._data and self._drain(min(until, self._wire.next_at)):
            return True
        if self._wire.next_at > until or not self._wire.arrived(until):
            return False
        self._arrive(until)
        return True

    def next_at(self) -> float:
        """When something may happen that the host is told."""
        operation, wire = self._listener.operation, self._wire
        at = inf
        if self._data and operation is not None and not operation.is_full:
            at = self._taken_at(len(self._data) - (self._lwm if self.is_stopped else 0))
            signs = [place for sign in operation.signs if (place := self._data.find(sign)) >= 0]
            at = min(at, self._taken_at(min(signs) + 1)) if signs else at
        if len(wire) and not wire.is_stopped:
            count = min(len(wire), operation.needs if operation is not None else 64)
            for sign in operation.signs if operation is not None else b"\r\n":
                first = wire.first(bytes([sign]))
                count = count if first is None else min(count, first + 1)
            if operation is not None and operation.buffers and not self.is_stopped:
                count = min(count, max(1, self._hwm - len(self._data)))
            at = min(at, wire.at(count - 1))
        return at

    def _taken_at(self, count: int) -> float:
        return self._next_take_at + (max(1, count) - 1) * self._take_step_s

    @property
    def _take_step_s(self) -> float:
        return max(self._take_time_s, self._wire.byte_time_s) if self._take_time_s else 0.0

    # What arrives

    def _arrive(self, until: float) -> None:
        """Take what has come, as far as it is all alike."""
        wire, operation = self._wire, self._listener.operation
        count = wire.arrived(until)
        if self._mode in _SIGNED_MODES:
            count = min(count, self._before_sign(count))
            if not count:
                self._obey(wire.next_at)
                return
        if operation is not None:
            fault = self._trouble.fault_within(count)
            if fault is not None and not fault[0]:
                self._befall(fault[1])
                return
            count = count if fault is None else fault[0]
            if operation.buffers and (self._take_time_s or operation.can_fill):
                room = (self._size if self.is_stopped or not self._may_stop else self._hwm) - self.filled
                count = max(1, min(count, room))
        at = wire.next_at
        data, wrong = self._form.heard(wire.take(count))
        if operation is not None:
            self._trouble.came(count)
        if wrong is not None and operation is not None:
            self._hand(data[:wrong], at)
            if self._listener.operation is operation:
                self._listener.damaged("parity-error", at + wrong * wire.byte_time_s)
            data, at = data[wrong + 1 :], at + (wrong + 1) * wire.byte_time_s
        if data:
            self._hand(data, at)

    def _before_sign(self, count: int) -> int:
        signs = _SIGNS if not self._around.knobs.parity_in_bytes else _SIGNS + self._form.sent(_SIGNS)
        return min(count, self._wire.before(bytes(sorted(set(signs)))))

    def _obey(self, at: float) -> None:
        """Take Xon or Xoff of the host."""
        (sign,), wrong = self._form.heard(self._wire.take(1))
        if wrong is not None:
            return
        if sign == DC3:
            self._around.note(LogKind.FLOW, "host Xoff", at)
            self._transmitter.hold(at)
        else:
            self._around.note(LogKind.FLOW, "host Xon", at)
            self._transmitter.release(at)

    def _befall(self, alarm: str) -> None:
        at = self._wire.next_at
        self._wire.take(1)
        self._trouble.came(1)
        self._listener.damaged(alarm, at)

    def _hand(self, data: bytes, at: float) -> None:
        """Hand bytes to who takes them, or store them."""
        step_s = self._wire.byte_time_s
        while data:
            operation = self._listener.operation
            buffers = operation is not None and operation.buffers
            if buffers and (self._data or self._take_time_s or (operation is not None and operation.is_full)):
                self._store(data, at, step_s)
                return
            taken = self._listener.heard(data, at, step_s)
            data, at = data[taken:], at + taken * step_s

    # The buffer

    def _store(self, data: bytes, at: float, step_s: float) -> None:
        room = self._size - self.filled
        if len(data) > room:
            lost = len(data) - room
            data = data[:room]
            self._listener.lost(lost)
            self._listener.damaged("buffer-overflow", at)
            if not self._may_store:
                return
        if not self._data:
            self._next_take_at = max(self._next_take_at, at + self._take_time_s)
        self._data += data
        last_at = at + max(0, len(data) - 1) * step_s
        self._drain(last_at)
        if self._may_stop and not self.is_stopped and self.filled >= self._hwm:
            self._stop(last_at)

    @property
    def _may_store(self) -> bool:
        operation = self._listener.operation
        return operation is not None and operation.buffers

    @property
    def _may_stop(self) -> bool:
        return self._mode is not Synchronization.XMODEM

    def _drain(self, until: float) -> bool:
        """Let what is stored be taken as fast as it is; whether anything was."""
        has_taken = False
        while self._data and self._may_store:
            operation = self._listener.operation
            if operation is None or operation.is_full or self._next_take_at > until:
                break
            count = self._due(until)
            step_s = self._take_step_s
            data = bytes(self._data[:count])
            taken = self._listener.heard(data, self._next_take_at, step_s)
            if not taken:
                break
            has_taken = True
            del self._data[:taken]
            last_at = self._next_take_at + (taken - 1) * step_s
            self._next_take_at = last_at + step_s
            if self.is_stopped and self.filled <= self._lwm:
                self._go_on(last_at)
        if self._data and not self._may_store:  # the operation is over: what is left is for whoever listens now
            left = bytes(self._data)
            self._data.clear()
            self._listener.heard(left, self._next_take_at, 0.0)
            if self.is_stopped:
                self._go_on(self._next_take_at)
            has_taken = True
        return has_taken

    def _due(self, until: float) -> int:
        count = self.filled
        if self.is_stopped:
            count = max(1, count - self._lwm)
        step_s = self._take_step_s
        if step_s:
            count = min(count, int((until - self._next_take_at) / step_s + _PART_OF_A_BYTE) + 1)
        return count

    def room_made(self, now: float) -> None:
        """Take note that who was full takes more from now on."""
        self._next_take_at = max(self._next_take_at, now)

    # Stopping the host

    def _stop(self, at: float) -> None:
        self.is_stopped = True
        if self._mode is Synchronization.RTS_CTS:
            self._set_line(False, at)
        elif not self._trouble.loses("Xoff"):
            self._around.note(LogKind.FLOW, "Xoff", at)
            self._transmitter.sign(bytes([DC3]), at)

    def _go_on(self, at: float) -> None:
        self.is_stopped = False
        if self._mode is Synchronization.RTS_CTS:
            self._set_line(True, at)
        elif self._mode is Synchronization.DC_CODES and not self._may_store:
            pass  # the reader is off
        elif not self._trouble.loses("Xon"):
            self._around.note(LogKind.FLOW, "Xon", at)
            self._transmitter.sign(bytes([DC1]), at)

    def _set_line(self, is_high: bool, at: float) -> None:
        self._around.note(LogKind.FLOW, "pin 4 high" if is_high else "pin 4 low", at)
        if is_high:
            self._wire.go_on(at)
        else:
            self._wire.stop(at)
