"""The far end of the torture: one device that works in order, is slow at one question, and notes what it received."""

from __future__ import annotations

import asyncio
import os
import tty
from collections.abc import AsyncIterator, Callable, Iterable, Iterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Final, Protocol

__all__ = ["CompaxLines", "Dialect", "Endpoint", "FarEnd", "ModbusRtu", "ModbusTcp", "Question", "on_port", "on_tcp"]

WORK_S: Final = 0.02
"""What an ordinary answer takes: about what it takes at 9600 baud."""

HOST: Final = "127.0.0.1"


@dataclass(frozen=True, slots=True)
class Question:
    """Something a client may ask, with the answer that is its own, as a COMPAX line and as a Modbus register."""

    name: str
    line: str
    answer: str
    register: int
    value: int
    writes: bool = False

    def owns(self, text: str) -> bool:
        """Say whether *text* is what the device answers to this."""
        return text in {self.answer, str(self.value)}


class Dialect(Protocol):
    """How requests and answers look on the wire; a request is its bytes."""

    def requests(self, buffer: bytearray) -> Iterator[bytes]:
        """Take the complete requests out of *buffer*."""

    def is_asked(self, request: bytes, question: Question) -> bool:
        """Say whether *request* asks *question*."""

    def answer(self, request: bytes, question: Question | None) -> bytes:
        """Write the answer; *question* is None for what the torture does not ask itself."""


class CompaxLines:
    """``S1 CR`` is answered by ``S001: 101.00 CR LF >``, a command by ``CR LF >`` alone (UG p. 160)."""

    _STATUS: Final = {b"S16": "S016: 11010000", b"S17": "S017: 00000010", b"S30": "S030: 0 0", b"P20": "P020: 0"}

    def requests(self, buffer: bytearray) -> Iterator[bytes]:
        """Take lines, without their CR."""
        while (end := buffer.find(b"\r")) >= 0:
            yield bytes(buffer[:end])
            del buffer[: end + 1]

    def is_asked(self, request: bytes, question: Question) -> bool:
        """Compare the line; a motion may carry a sign behind it."""
        return request.rstrip(b"$") == question.line.encode()

    def answer(self, request: bytes, question: Question | None) -> bytes:
        """Answer by the question, or what a drive at rest says."""
        if question is not None:
            text = question.answer
        elif request[:1] == b"S" and request[1:].isdigit():
            text = self._STATUS.get(request, f"S{int(request[1:]):03d}: 0.00")
        else:
            text = self._STATUS.get(request, "")
        return f"{text}\r\n>".encode()


class ModbusRtu:
    """Holding registers: read (3) and write one (6); an answer says neither which register nor which request."""

    _HEAD_BYTES = 0
    _TAIL_BYTES = 2

    def requests(self, buffer: bytearray) -> Iterator[bytes]:
        """Take frames: device, function, register, count or value, in six bytes, and what stands around them."""
        size = self._HEAD_BYTES + 6 + self._TAIL_BYTES
        while len(buffer) >= size:
            yield bytes(buffer[:size])
            del buffer[:size]

    def is_asked(self, request: bytes, question: Question) -> bool:
        """Compare function and register."""
        device_and_pdu = request[self._HEAD_BYTES :]
        function = 6 if question.writes else 3
        return device_and_pdu[1] == function and int.from_bytes(device_and_pdu[2:4], "big") == question.register

    def answer(self, request: bytes, question: Question | None) -> bytes:
        """Answer a read by one register, a write by itself."""
        if request[self._HEAD_BYTES + 1] == 6:
            return request
        value = question.value if question is not None else 0
        device_and_pdu = bytes([request[self._HEAD_BYTES], 3, 2, *value.to_bytes(2, "big")])
        return self._framed(request, device_and_pdu)

    def _framed(self, request: bytes, device_and_pdu: bytes) -> bytes:  # noqa: ARG002  # the other framing needs it
        return device_and_pdu + _crc(device_and_pdu)


class ModbusTcp(ModbusRtu):
    """The same in the framing that was made for TCP: every answer bears the number of its request."""

    _HEAD_BYTES = 6
    _TAIL_BYTES = 0

    def _framed(self, request: bytes, device_and_pdu: bytes) -> bytes:
        return request[:4] + len(device_and_pdu).to_bytes(2, "big") + device_and_pdu


def _crc(data: bytes) -> bytes:
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ (0xA001 if crc & 1 else 0)
    return crc.to_bytes(2, "little")


Say = Callable[[bytes], None]


class FarEnd:
    """
    One device: it takes one request after the other, and each answer its time.

    Args:
        dialect: How it talks.
        questions: What it is asked.
        forgets_closed: An answer whose connection is closed is dropped. A device server does not: behind it is one
            serial line, and whoever is connected gets what comes from there.
    """

    def __init__(self, dialect: Dialect, questions: Iterable[Question], *, forgets_closed: bool = False) -> None:
        self.received: list[tuple[float, bytes]] = []
        self.slow: dict[str, float] = {}
        """Names of questions, and how long their answer takes, whenever they are asked."""
        self.deaf: set[str] = set()
        """Names of questions that never get an answer, and take no time."""
        self.connections: list[Say] = []
        self.idle_at = 0.0
        """When everything that was asked so far is answered."""
        self._dialect = dialect
        self._questions = tuple(questions)
        self._forgets_closed = forgets_closed
        self._loop = asyncio.get_running_loop()

    def times_asked(self, question: Question) -> int:
        """Count the requests that ask *question*."""
        return sum(self._dialect.is_asked(request, question) for _, request in self.received)

    def receive(self, buffer: bytearray, say: Say) -> None:
        """Take what is complete in *buffer*, which came from where *say* leads to."""
        now = self._loop.time()
        for request in self._dialect.requests(buffer):
            self.received.append((now, request))
            question = next((each for each in self._questions if self._dialect.is_asked(request, each)), None)
            name = question.name if question is not None else ""
            if name not in self.deaf:
                self.idle_at = max(now, self.idle_at) + self.slow.get(name, WORK_S)
                self._loop.call_at(self.idle_at, self._answer, self._dialect.answer(request, question), say)

    def _answer(self, data: bytes, asker: Say) -> None:
        if asker in self.connections:
            asker(data)
        elif self.connections and not self._forgets_closed:
            self.connections[-1](data)


@dataclass(frozen=True, slots=True)
class Endpoint:
    """Where a far end is reached: a TCP port of this computer, or the path of a serial port."""

    tcp_port: int = 0
    path: str = ""


class _Connection(asyncio.Protocol):
    """One TCP connection to a far end."""

    def __init__(self, far_end: FarEnd, transports: set[asyncio.Transport]) -> None:
        self._far_end = far_end
        self._transports = transports
        self._buffer = bytearray()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        self._transports.add(transport)
        self._say: Say = transport.write
        self._far_end.connections.append(self._say)

    def data_received(self, data: bytes) -> None:
        self._buffer += data
        self._far_end.receive(self._buffer, self._say)

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002  # asyncio's signature
        self._transports.discard(self._transport)
        self._far_end.connections.remove(self._say)


@asynccontextmanager
async def on_tcp(far_end: FarEnd) -> AsyncIterator[Endpoint]:
    """Serve *far_end* on a TCP port that is free."""
    transports: set[asyncio.Transport] = set()
    server = await asyncio.get_running_loop().create_server(lambda: _Connection(far_end, transports), HOST, 0)
    try:
        yield Endpoint(tcp_port=server.sockets[0].getsockname()[1])
    finally:
        server.close()
        for transport in tuple(transports):
            transport.abort()
        await server.wait_closed()


@asynccontextmanager
async def on_port(far_end: FarEnd) -> AsyncIterator[Endpoint]:
    """Serve *far_end* on a pseudo-terminal, for clients that open serial ports."""
    loop = asyncio.get_running_loop()
    device_end, port_end = os.openpty()
    buffer = bytearray()

    def say(data: bytes) -> None:
        os.write(device_end, data)

    def receive() -> None:
        buffer.extend(os.read(device_end, 4096))
        far_end.receive(buffer, say)

    tty.setraw(port_end)
    far_end.connections.append(say)
    loop.add_reader(device_end, receive)
    try:
        yield Endpoint(path=os.ttyname(port_end))
    finally:
        loop.remove_reader(device_end)
        far_end.connections.clear()
        os.close(device_end)
        os.close(port_end)
