"""The line to a simulated device: gives it the event loop's time, wakes it, and hands bytes to who is connected."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Protocol, cast, runtime_checkable

from compax_aio.errors import TransportError

from .cable import Cable, Direction, Way

__all__ = ["Connection", "DeviceLine", "Host", "SimulatedDevice"]


class Host(Protocol):
    """Who serves a simulated device."""

    def time(self) -> float:
        """Return the time now."""

    def changed(self) -> None:
        """Take note that the device may have output, or wants to be woken at another time."""


class SimulatedDevice(Protocol):
    """What a simulated device must have to be served: bytes and time in, bytes out."""

    name: str
    served_by: Host | None

    @property
    def baudrate(self) -> int:
        """Baud rate of its serial port; 0: bytes take no time, and any rate will do."""

    def receive(self, data: bytes, now: float) -> None:
        """Take bytes that arrive at *now*."""

    def take_output(self, now: float) -> bytes:
        """Let everything happen until *now*, and return what has come out."""

    def next_event_at(self) -> float | None:
        """Return when something happens by itself next."""

    def connect(self, now: float | None = None) -> None:
        """Take note that somebody is on the line."""

    def disconnect(self, now: float | None = None) -> None:
        """Take note that nobody is on the line."""


@runtime_checkable
class _Holding(Protocol):
    """A device that keeps what a host writes from coming, by a modem line or because its driver is full."""

    @property
    def holds_host(self) -> bool:
        """Whether it does so now."""


@runtime_checkable
class _Heeding(Protocol):
    """A device that a host can keep from sending by a modem line."""

    @property
    def heeds_hold(self) -> bool:
        """Whether it is set so."""

    def hold_output(self, is_held: bool, now: float | None = None) -> None:
        """Stop sending at once, or go on."""


class DeviceLine:
    """
    The one line of a device in one event loop; it exists whether somebody is connected or not.

    A device goes on living while nobody is connected; what it sends then goes nowhere.
    """

    def __init__(self, device: SimulatedDevice, loop: asyncio.AbstractEventLoop) -> None:
        self._device = device
        self._loop = loop
        self._write: Callable[[bytes], None] | None = None
        self._hold: Callable[[bool], None] | None = None
        self._is_held = False
        self._holding = device if isinstance(device, _Holding) else None
        self._is_device_holding = False
        self._cable: Cable | None = None
        self._way: Way | None = None
        self._timer: asyncio.TimerHandle | None = None
        device.served_by = self

    @classmethod
    def of(cls, device: SimulatedDevice) -> DeviceLine:
        """Return the line of *device* in the running event loop, which is always the same one."""
        loop = asyncio.get_running_loop()
        line = device.served_by
        if isinstance(line, DeviceLine) and line._loop is loop:  # noqa: SLF001  # of this class
            return line
        return cls(device, loop)

    @property
    def baudrate(self) -> int:
        """Baud rate of the device; 0: any will do."""
        return self._device.baudrate

    @property
    def occupied(self) -> bool:
        """Whether somebody is connected."""
        return self._write is not None

    @property
    def is_held(self) -> bool:
        """Whether what is written is left with who is connected."""
        return self._is_held

    def lay(self, cable: Cable) -> None:
        """Let what goes over this line befall what *cable* says, from the next connection on."""
        self._cable = cable

    def connect(self, write: Callable[[bytes], None], hold: Callable[[bool], None] | None = None) -> None:
        """
        Connect somebody who is sent bytes by *write*.

        Args:
            write: Called with bytes for them.
            hold: Called to leave what they write with them (True), or to take it again; None: they cannot be held.

        Raises:
            TransportError: Somebody else is connected.
        """
        if self.occupied:
            raise TransportError(
                f"somebody else is connected to the simulated device {self._device.name!r}",
                hint="close that connection first; a serial line has two ends",
            )
        self._device.connect(self._loop.time())
        self._write, self._hold = write, hold
        self._is_device_holding = False
        if self._cable is not None:
            self._way = Way(self._cable, self._arrived, self._cable.cut)
        if self._is_held:
            self.hold(held=True)
        self.changed()

    def receive(self, data: bytes) -> None:
        """Take bytes from who is connected."""
        if self._way is None:
            self._arrived("to_drive", data)
        else:
            self._way.hand_on("to_drive", data)

    def hold(self, held: bool) -> None:
        """Leave what is written to the device with who is connected, now or later, as Xoff does; or take it again."""
        self._is_held = held
        self._tell_held()

    def _tell_held(self) -> None:
        if self._hold is not None:
            self._hold(self._is_held or self._is_device_holding)

    def host_is_full(self, is_full: bool) -> bool:
        """Take note that who is connected has no room, or has again; whether the device heeds that."""
        device = self._device
        if not isinstance(device, _Heeding) or not device.heeds_hold:
            return False
        device.hold_output(is_full, self._loop.time())
        return True

    def disconnect(self) -> None:
        """Let go of who was connected; what was on its way is lost."""
        if self._way is not None:
            self._way.end()
        self._write = self._hold = self._way = None
        self.host_is_full(False)
        self._device.disconnect(self._loop.time())

    def time(self) -> float:
        """Return the time of the event loop."""
        return self._loop.time()

    def changed(self) -> None:
        """Hand on what has come out, and wake the device in time for what comes next."""
        self._pass_on(self._loop.time())

    def _pass_on(self, now: float) -> None:
        output = self._device.take_output(now)
        at = self._device.next_event_at()
        if self._timer is not None and self._timer.when() != at:
            self._timer.cancel()
            self._timer = None
        if self._timer is None and at is not None and not self._loop.is_closed():
            self._timer = self._loop.call_at(at, self._wake, at)
        if self._holding is not None and self._holding.holds_host != self._is_device_holding:
            self._is_device_holding = not self._is_device_holding
            self._tell_held()
        if output and self._way is not None:
            self._way.hand_on("to_host", output)
        elif output:
            self._arrived("to_host", output)

    def _arrived(self, direction: Direction, data: bytes) -> None:
        """Take what has come through: to the device, or to who is connected."""
        if direction == "to_drive":
            self._device.receive(data, self._loop.time())
            self.changed()
        elif self._write is not None:
            self._write(data)

    def _wake(self, at: float) -> None:
        self._timer = None
        # Event loops may call a little early; for the device it is the time it asked for.
        self._pass_on(max(at, self._loop.time()))


class Connection(asyncio.Protocol):
    """
    The device's end of one connection, TCP or in memory.

    While another connection holds the line, a new one is hung up at once, as most terminal servers do. Bytes for a
    host that does not read are lost after its buffers are full, as on a serial line without handshake; a device that
    heeds a modem line of the host keeps them.
    """

    def __init__(self, line: DeviceLine, connections: set[Connection]) -> None:
        self._line = line
        self._connections = connections
        self._transport: asyncio.Transport | None = None
        self._overrun = False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Take the line, or hang up if it is taken."""
        line = cast("asyncio.Transport", transport)  # those of uvloop are no subclasses
        if self._line.occupied:
            line.abort()
            return
        self._transport = line
        self._connections.add(self)
        self._line.connect(self._send, self._hold)

    def data_received(self, data: bytes) -> None:
        """Hand bytes to the device."""
        if self._transport is not None:
            self._line.receive(data)

    def connection_lost(self, _: Exception | None) -> None:
        """Give the line back."""
        if self._transport is not None:
            self._transport = None
            self._connections.discard(self)
            self._line.disconnect()

    def pause_writing(self) -> None:
        """Lose bytes from now on, or let the device keep them."""
        self._overrun = not self._line.host_is_full(True)

    def resume_writing(self) -> None:
        """Send again."""
        self._overrun = False
        self._line.host_is_full(False)

    def abort(self) -> None:
        """Hang up."""
        if self._transport is not None:
            self._transport.abort()

    def _hold(self, held: bool) -> None:
        if self._transport is not None and held:
            self._transport.pause_reading()
        elif self._transport is not None:
            self._transport.resume_reading()

    def _send(self, data: bytes) -> None:
        if self._transport is not None and not self._overrun:
            self._transport.write(data)
