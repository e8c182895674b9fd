"""The line between a client and a simulated drive: does what troubles say, and notes every byte at both its ends."""

from __future__ import annotations

import asyncio
from collections import deque
from dataclasses import dataclass
from typing import Any, Final, Literal

from compax_aio.compax.facts.line import COMMAND_END, PROMPT
from compax_aio.errors import TransportError
from compax_aio.simulator.compax.drive import SimulatedDrive
from compax_aio.simulator.line import DeviceLine, SimulatedDevice
from compax_aio.transports.loopback import LoopbackListener, LoopbackTransport, create_pair

from .testimony import WireEntry, WireKind

__all__ = ["Direction", "Tamper", "TamperKind", "TroubledLine"]

Direction = Literal["to_drive", "to_host"]

TamperKind = Literal["lose", "garble", "flip", "double", "insert", "cut", "lose_end"]

_MOTION_BEGINS: Final = (b"P", b"!")
_TOKEN_KEPT: Final = 64


@dataclass(slots=True)
class Tamper:
    """Something that will be done to bytes of one direction, once."""

    direction: Direction
    kind: TamperKind
    skip: int = 0
    """So many bytes pass before."""
    count: int = 1
    """How many bytes are lost, garbled or doubled."""
    data: bytes = b""
    """What is inserted."""


class TroubledLine(LoopbackListener):
    """
    ``loop://name`` for a client, and at its far end a simulated device, with all that can befall a line in between.

    Args:
        name: Of the line.
        device: At its far end.
        wire: Where everything is noted.
        strangers: Where other drives are noted that were on it.

    Attributes:
        delay_s: By direction: how much later bytes arrive; those behind them wait.
        piece: The most bytes that are handed on at once; None: as they come.
        vanishing: Half open: bytes vanish both ways, and nobody is told.
        refused: Nobody can connect.
        keeps: What the device says while nobody is connected is kept for who connects next, as device servers do.
    """

    def __init__(
        self, name: str, device: SimulatedDevice, wire: list[WireEntry], strangers: list[SimulatedDrive] | None = None
    ) -> None:
        super().__init__(name, asyncio.Protocol)
        self.delay_s: dict[Direction, float] = {"to_drive": 0.0, "to_host": 0.0}
        self.piece: int | None = None
        self.vanishing = False
        self.refused = False
        self.keeps = False
        self._loop = asyncio.get_running_loop()
        self._device = device
        self._wire = wire
        self._strangers = [] if strangers is None else strangers
        self._kept: list[bytes] | None = None
        self._tampers: list[Tamper] = []
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

    def add(self, tamper: Tamper) -> None:
        """Let something happen to the bytes that come next."""
        self._tampers.append(tamper)

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
        self._tampers.clear()
        self.delay_s = {"to_drive": 0.0, "to_host": 0.0}
        self.piece = None
        self.refused = False
        self.hold(held=False)

    @property
    def is_usual(self) -> bool:
        """Whether nothing is done to bytes now."""
        return not (self._tampers or self.vanishing or self.piece or any(self.delay_s.values()))

    # What is noted

    def note(self, what: str) -> None:
        """Note something that befell the line."""
        self._wire.append(WireEntry(self._loop.time(), WireKind.BEFELL, text=what))

    def note_bytes(self, kind: WireKind, data: bytes = b"") -> None:
        """Note bytes, or the beginning or end of a connection."""
        self._wire.append(WireEntry(self._loop.time(), kind, data))

    def tampered(self, direction: Direction, data: bytes) -> tuple[bytes, bool]:
        """Do to *data* what is due; also say whether the connection is cut behind it."""
        if not self._tampers:
            return data, False
        for tamper in [each for each in self._tampers if each.direction == direction]:
            if tamper.kind == "lose_end":
                if data.startswith(_MOTION_BEGINS) and data.endswith(COMMAND_END):
                    self._spend(tamper)
                    data = data.removesuffix(COMMAND_END)
            elif tamper.skip >= len(data):
                tamper.skip -= len(data)
            else:
                self._spend(tamper)
                at = tamper.skip
                if tamper.kind == "cut":
                    return data[:at], True
                data = data[:at] + _changed(tamper, data[at : at + tamper.count]) + data[at + tamper.count :]
        return data, False

    def _spend(self, tamper: Tamper) -> None:
        self._tampers.remove(tamper)
        self.note(f"{tamper.kind} {tamper.direction}")


def _flipped(byte: int) -> int:
    """Make another digit, letter or sign of one, as two wrong bits do where nobody checks parity."""
    return byte ^ 1 if chr(byte).isalnum() and chr(byte ^ 1).isalnum() else byte


def _changed(tamper: Tamper, data: bytes) -> bytes:
    if tamper.kind == "garble":
        return bytes(byte | 0x80 for byte in data)  # a parity or framing error
    if tamper.kind == "flip":
        return bytes(_flipped(byte) for byte in data)
    if tamper.kind == "double":
        return data + data
    return tamper.data + data if tamper.kind == "insert" else b""


class _Way(asyncio.Protocol):
    """The far end of one connection: hands bytes on, as fast or slowly as the line lets them."""

    def __init__(self, line: TroubledLine, device: DeviceLine) -> None:
        self._line = line
        self._device = device
        self._loop = asyncio.get_running_loop()
        self._transport: LoopbackTransport | None = None
        self._waiting: dict[Direction, deque[bytes]] = {"to_drive": deque(), "to_host": deque()}
        self._open_at: dict[Direction, float] = {"to_drive": 0.0, "to_host": 0.0}
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
        self._hand_on("to_drive", data)

    def connection_lost(self, _: Exception | None) -> None:
        if self._transport is not None:
            self._transport = None
            self._device.disconnect()
            self._line.hung_up(self._device)

    def to_host(self, data: bytes) -> None:
        """Take what the drive sends."""
        self._token = (self._token + data)[-_TOKEN_KEPT:]
        if self._token.endswith(PROMPT):
            self.last_token, self._token = self._token, b""
        self._hand_on("to_host", data)

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
            self._device.disconnect()
            transport.abort()
            self._line.hung_up(self._device)

    def _hand_on(self, direction: Direction, data: bytes) -> None:
        if self._transport is None:
            return
        line = self._line
        if line.is_usual and not self._waiting[direction]:
            self._deliver(direction, data)
            return
        if line.vanishing:
            line.note(f"vanished {direction}")
            return
        data, is_cut = self._line.tampered(direction, data)
        piece = self._line.piece or len(data) or 1
        for begin in range(0, len(data), piece):
            self._later(direction, data[begin : begin + piece])
        if is_cut:
            self._later(direction, b"")

    def _later(self, direction: Direction, data: bytes) -> None:
        """Hand *data* on when its time has come; a line that is not in trouble does so at once."""
        waiting, now = self._waiting[direction], self._loop.time()
        at = now + self._line.delay_s[direction] * (1 if self._line.piece is None else 0.25)
        if not waiting and at <= now and self._line.piece is None:
            self._deliver(direction, data)
            return
        self._open_at[direction] = max(at, self._open_at[direction])
        waiting.append(data)
        self._loop.call_at(self._open_at[direction], self._deliver_next, direction)

    def _deliver_next(self, direction: Direction) -> None:
        if self._waiting[direction]:
            self._deliver(direction, self._waiting[direction].popleft())

    def _deliver(self, direction: Direction, data: bytes) -> None:
        if self._transport is None:
            return
        if not data:
            self._line.note("cut")
            self.end()
        elif direction == "to_drive":
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
