"""The line between a client and a simulated drive: does what troubles say, and notes every byte at both its ends."""

from __future__ import annotations

import asyncio
from typing import Any, Final

from compax_aio.compax.facts.line import PROMPT
from compax_aio.errors import TransportError
from compax_aio.simulator.cable import Cable, Direction, Tamper, Way
from compax_aio.simulator.compax.drive import SimulatedDrive
from compax_aio.simulator.line import DeviceLine, SimulatedDevice
from compax_aio.transports.loopback import LoopbackListener, LoopbackTransport, create_pair

from .testimony import WireEntry, WireKind

__all__ = ["Direction", "Tamper", "TroubledLine"]

_TOKEN_KEPT: Final = 64


class TroubledLine(LoopbackListener, Cable):
    """
    ``loop://name`` for a client, and at its far end a simulated device, with all that can befall a line in between.

    Args:
        name: Of the line.
        device: At its far end.
        wire: Where everything is noted.
        strangers: Where other drives are noted that were on it.

    Attributes:
        refused: Nobody can connect.
        keeps: What the device says while nobody is connected is kept for who connects next, as device servers do.
    """

    def __init__(
        self, name: str, device: SimulatedDevice, wire: list[WireEntry], strangers: list[SimulatedDrive] | None = None
    ) -> None:
        LoopbackListener.__init__(self, name, asyncio.Protocol)
        Cable.__init__(self)
        self.refused = False
        self.keeps = False
        self._loop = asyncio.get_running_loop()
        self._device = device
        self._wire = wire
        self._strangers = [] if strangers is None else strangers
        self._kept: list[bytes] | None = None
        self._way: _Way | None = None
        self._is_held = False

    def __repr__(self) -> str:
        return f"<TroubledLine {self.name}>"

    def connect(self, protocol: asyncio.Protocol) -> LoopbackTransport:
        """Connect a client."""
        if self.refused:
            self.note("refused")
            raise TransportError(f"{self.url} refuses the connection, for this is a test")
        line = DeviceLine.of(self._device)
        if line.occupied and self._way is not None:
            self._way.end()  # as a device server does with a connection that has gone silent
        kept, self._kept = self._kept or [], None
        if line.occupied:
            line.disconnect()
        way = _Way(self, line)
        near, _ = create_pair(_Witness(self, protocol), way, self._loop, name=self.name)
        for data in kept:
            way.to_host(data)
        return near

    def hung_up(self, line: DeviceLine) -> None:
        """Take note that nobody is connected any more; keep what the device says, if that is wanted."""
        if self.keeps and not line.occupied:
            self._kept = []
            line.connect(self._kept.append)

    # What troubles do

    def hold(self, held: bool) -> None:
        """Hold what the client writes, as Xoff does: it stays in the client's buffer."""
        self._is_held = held
        if self._way is not None:
            self._way.hold(held)

    def cut(self) -> None:
        """Cut the connection: what is on its way is lost."""
        if self._way is not None:
            self.note("cut")
            self._way.end()

    def repeat(self) -> None:
        """Let the last answer or message come a second time."""
        if self._way is not None and self._way.last_token:
            self.note("repeated to_host")
            self._way.to_host(self._way.last_token)

    def from_elsewhere(self, data: bytes) -> None:
        """Let *data* of another host arrive at the drive."""
        self.note("another host to_drive")
        self.note_bytes(WireKind.BEFELL, data)
        line = DeviceLine.of(self._device)
        line.receive(data)

    def exchange_device(self, device: SimulatedDevice) -> None:
        """Let whoever connects next find *device*."""
        if self._kept is not None:
            self._kept = None
            DeviceLine.of(self._device).disconnect()
        self._device = device

    def stranger(self, device: SimulatedDrive) -> None:
        """Let whoever connects next find *device*, which is none of ours."""
        self._strangers.append(device)
        self.exchange_device(device)

    def heal(self) -> None:
        """End all troubles of the line."""
        super().heal()
        self.refused = False
        self.hold(held=False)

    # What is noted

    def note(self, what: str) -> None:
        """Note something that befell the line."""
        self._wire.append(WireEntry(self._loop.time(), WireKind.BEFELL, text=what))

    def note_bytes(self, kind: WireKind, data: bytes = b"") -> None:
        """Note bytes, or the beginning or end of a connection."""
        self._wire.append(WireEntry(self._loop.time(), kind, data))


class _Way(asyncio.Protocol):
    """The far end of one connection: hands bytes on, as fast or slowly as the line lets them."""

    def __init__(self, line: TroubledLine, device: DeviceLine) -> None:
        self._line = line
        self._device = device
        self._transport: LoopbackTransport | None = None
        self._way = Way(line, self._deliver, self.end)
        self._token = b""
        self.last_token = b""
        """The last answer or message that has come, with its prompt."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, LoopbackTransport)
        self._transport = transport
        self._line._way = self  # noqa: SLF001  # of one line
        self._line.note_bytes(WireKind.OPENED)
        self._device.connect(self.to_host)
        self.hold(self._line._is_held)  # noqa: SLF001

    def data_received(self, data: bytes) -> None:
        self._way.hand_on("to_drive", data)

    def connection_lost(self, _: Exception | None) -> None:
        if self._transport is not None:
            self._transport = None
            self._way.end()
            self._device.disconnect()
            self._line.hung_up(self._device)

    def to_host(self, data: bytes) -> None:
        """Take what the drive sends."""
        self._token = (self._token + data)[-_TOKEN_KEPT:]
        if self._token.endswith(PROMPT):
            self.last_token, self._token = self._token, b""
        self._way.hand_on("to_host", data)

    def hold(self, held: bool) -> None:
        """Leave what the client writes with the client, or take it."""
        if self._transport is not None and held:
            self._transport.pause_reading()
        elif self._transport is not None:
            self._transport.resume_reading()

    def end(self) -> None:
        """Hang up."""
        if self._transport is not None:
            transport, self._transport = self._transport, None
            self._way.end()
            self._device.disconnect()
            transport.abort()
            self._line.hung_up(self._device)

    def _deliver(self, direction: Direction, data: bytes) -> None:
        if self._transport is None:
            return
        if direction == "to_drive":
            self._line.note_bytes(WireKind.ARRIVED, data)
            self._device.receive(data)
        else:
            self._transport.write(data)


class _Witness(asyncio.Protocol):
    """Stands between the client's protocol and its transport, and notes what passes."""

    def __init__(self, line: TroubledLine, protocol: asyncio.Protocol) -> None:
        self._line = line
        self._protocol = protocol

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, LoopbackTransport)
        self._protocol.connection_made(_WitnessedTransport(self._line, transport))

    def data_received(self, data: bytes) -> None:
        self._line.note_bytes(WireKind.READ, data)
        self._protocol.data_received(data)

    def connection_lost(self, exc: Exception | None) -> None:
        self._line.note_bytes(WireKind.LOST)
        self._protocol.connection_lost(exc)

    def pause_writing(self) -> None:
        self._protocol.pause_writing()

    def resume_writing(self) -> None:
        self._protocol.resume_writing()


class _WitnessedTransport(asyncio.Transport):
    """A transport that notes what is written, at the moment when it is."""

    def __init__(self, line: TroubledLine, transport: LoopbackTransport) -> None:
        super().__init__()
        self._line = line
        self._transport = transport

    def write(self, data: Any) -> None:
        if self._transport.is_closing():
            return
        self._line.note_bytes(WireKind.WRITTEN, bytes(data))
        self._transport.write(data)

    def get_extra_info(self, name: str, default: Any = None) -> Any:
        return self._transport.get_extra_info(name, default)

    def get_write_buffer_size(self) -> int:
        return self._transport.get_write_buffer_size()

    def is_closing(self) -> bool:
        return self._transport.is_closing()

    def is_reading(self) -> bool:
        return self._transport.is_reading()

    def pause_reading(self) -> None:
        self._transport.pause_reading()

    def resume_reading(self) -> None:
        self._transport.resume_reading()

    def close(self) -> None:
        if not self._transport.is_closing():
            self._line.note_bytes(WireKind.CLOSED)
        self._transport.close()

    def abort(self) -> None:
        if not self._transport.is_closing():
            self._line.note_bytes(WireKind.CLOSED)
        self._transport.abort()
