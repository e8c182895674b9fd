"""Far ends of lines for the conformance suite: they read only when they are asked to."""

from __future__ import annotations

import asyncio
import os
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from typing import Protocol

__all__ = ["DescriptorFarEnd", "FarEnd", "StreamFarEnd", "listening_on_tcp"]


class FarEnd(Protocol):
    """
    The other end of the line under test.

    It takes bytes from the line only while :meth:`read` waits for them (small buffers aside), so that a far end that
    is left alone holds the line.
    """

    async def read(self, count: int) -> bytes:
        """Return the next *count* bytes; EOFError if the line ends before."""

    async def write(self, data: bytes) -> None:
        """Send *data*; return when the line has taken it."""

    async def hang_up(self) -> None:
        """End the line, whatever is under way."""


class StreamFarEnd:
    """The side that listens, as asyncio streams; :meth:`accept` is what a server calls."""

    LIMIT_BYTES = 4096

    def __init__(self) -> None:
        self._connected: asyncio.Future[tuple[asyncio.StreamReader, asyncio.StreamWriter]] = (
            asyncio.get_running_loop().create_future()
        )

    def accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Be the far end of this connection, the only one."""
        if self._connected.done():
            writer.transport.abort()
        else:
            self._connected.set_result((reader, writer))

    def protocol(self) -> asyncio.Protocol:
        """Return a protocol whose transport becomes this far end."""
        return asyncio.StreamReaderProtocol(asyncio.StreamReader(limit=self.LIMIT_BYTES), self.accept)

    async def read(self, count: int) -> bytes:
        reader, _ = await asyncio.shield(self._connected)
        return await reader.readexactly(count)

    async def write(self, data: bytes) -> None:
        _, writer = await asyncio.shield(self._connected)
        writer.write(data)
        await writer.drain()

    async def hang_up(self) -> None:
        _, writer = await asyncio.shield(self._connected)
        writer.close()

    async def close(self) -> None:
        """Leave nothing open."""
        if not self._connected.cancel():
            _, writer = self._connected.result()
            writer.transport.abort()
            with suppress(OSError):
                await writer.wait_closed()


@asynccontextmanager
async def listening_on_tcp(host: str = "127.0.0.1") -> AsyncIterator[tuple[int, StreamFarEnd]]:
    """Listen for one connection; give the port number and the far end that it will have."""
    far = StreamFarEnd()
    server = await asyncio.start_server(far.accept, host, 0, limit=far.LIMIT_BYTES)
    try:
        yield server.sockets[0].getsockname()[1], far
    finally:
        server.close()
        await far.close()
        await server.wait_closed()


class DescriptorFarEnd:
    """A non-blocking file descriptor: the master of a pty, or a serial port."""

    def __init__(self, descriptor: int) -> None:
        os.set_blocking(descriptor, False)
        self._descriptor = descriptor
        self._open = True

    async def read(self, count: int) -> bytes:
        data = bytearray()
        loop = asyncio.get_running_loop()
        while len(data) < count:
            try:
                piece = os.read(self._descriptor, count - len(data))
            except BlockingIOError:
                await _turn(self._descriptor, loop.add_reader, loop.remove_reader)
                continue
            except OSError as exc:
                raise EOFError from exc
            if not piece:
                raise EOFError
            data += piece
        return bytes(data)

    async def write(self, data: bytes) -> None:
        loop = asyncio.get_running_loop()
        while data:
            try:
                data = data[os.write(self._descriptor, data) :]
            except BlockingIOError:
                await _turn(self._descriptor, loop.add_writer, loop.remove_writer)

    async def hang_up(self) -> None:
        self.close()

    def close(self) -> None:
        """Leave nothing open."""
        if self._open:
            self._open = False
            os.close(self._descriptor)


async def _turn(descriptor: int, add: Callable[..., object], remove: Callable[[int], object]) -> None:
    ready = asyncio.Event()
    add(descriptor, ready.set)
    try:
        await ready.wait()
    finally:
        remove(descriptor)
