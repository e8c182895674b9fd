"""Any anyio byte stream (an SSH tunnel, TLS, a test's own) as an asyncio transport."""

from __future__ import annotations

import asyncio

import anyio
from anyio.abc import ByteStream

from compax_aio.errors import ConnectionLostError

from .flow import WriteFlow
from .registry import ProtocolFactory

__all__ = ["ByteStreamTransport", "wrap_byte_stream"]

_PIECE_BYTES = 64 * 1024

# What the stream gets to close before connection_lost is called without it.
_RELEASE_S = 0.5


class ByteStreamTransport(asyncio.Transport):
    """
    An anyio byte stream that is read and written by two tasks; made by :func:`wrap_byte_stream`.

    What is written goes to the stream in the order of writing, and counts as unsent until ``send`` has returned.
    While reading is paused, one piece at most is taken from the stream and kept.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, stream: ByteStream, protocol: asyncio.Protocol) -> None:
        super().__init__({"stream": stream})
        self._loop = loop
        self._stream = stream
        self._protocol: asyncio.Protocol = protocol
        self._flow = WriteFlow(loop, self, protocol)
        self._unsent = bytearray()
        self._in_send_bytes = 0
        self._wake_writer = asyncio.Event()
        self._reading = asyncio.Event()
        self._reading.set()
        self._closing = False
        self._releasing = False
        self._lost = False
        self._tasks: list[asyncio.Task[None]] = []
        self._timer: asyncio.TimerHandle | None = None

    def connect(self) -> None:
        """Tell the protocol that the line is open, and begin to read and write; once."""
        self._tasks += (self._loop.create_task(self._read()), self._loop.create_task(self._write()))
        try:
            self._protocol.connection_made(self)
        except BaseException:
            self.abort()
            raise

    def set_protocol(self, protocol: asyncio.BaseProtocol) -> None:
        """Connect another protocol to the line."""
        assert isinstance(protocol, asyncio.Protocol), "a line needs a protocol that takes bytes"
        self._protocol = self._flow.protocol = protocol

    def get_protocol(self) -> asyncio.BaseProtocol:
        """Return the protocol that is connected to the line."""
        return self._protocol

    # --- reading

    def is_reading(self) -> bool:
        """Return whether what arrives is handed to the protocol."""
        return self._reading.is_set() and not self._closing

    def pause_reading(self) -> None:
        """Leave what arrives with the stream until :meth:`resume_reading`."""
        self._reading.clear()

    def resume_reading(self) -> None:
        """Hand what arrives to the protocol again."""
        self._reading.set()

    async def _read(self) -> None:
        try:
            while True:
                data = await self._stream.receive(_PIECE_BYTES)
                await self._reading.wait()
                if self._closing:
                    return
                self._take(data)
        except anyio.EndOfStream:
            self._release(None)
        except (OSError, anyio.BrokenResourceError, anyio.ClosedResourceError) as exc:
            self._broke(exc)
        except Exception as exc:  # a stream of somebody else's making may raise anything
            self._failed("reading from the stream failed", exc)

    def _take(self, data: bytes) -> None:
        try:
            self._protocol.data_received(data)
        except Exception as exc:  # as asyncio does: what the protocol has understood so far is not known any more
            self._failed("protocol.data_received() failed", exc)

    # --- writing

    def write(self, data: bytes | bytearray | memoryview) -> None:
        """Send *data* as soon as the stream takes it."""
        if not self._closing and data:
            self._unsent += data
            self._wake_writer.set()
            self._flow.update(self.get_write_buffer_size())

    def can_write_eof(self) -> bool:
        """Return False: like a serial line, this one has no end that leaves the other direction open."""
        return False

    def get_write_buffer_size(self) -> int:
        """Return how many bytes the stream has not sent yet."""
        return len(self._unsent) + self._in_send_bytes

    def get_write_buffer_limits(self) -> tuple[int, int]:
        """Return the water marks, low and high."""
        return self._flow.low, self._flow.high

    def set_write_buffer_limits(self, high: int | None = None, low: int | None = None) -> None:
        """Set the water marks."""
        self._flow.set_limits(high, low)
        self._flow.update(self.get_write_buffer_size())

    async def _write(self) -> None:
        try:
            while self._unsent or not self._closing:
                if not self._unsent:
                    self._wake_writer.clear()
                    await self._wake_writer.wait()
                    continue
                data = bytes(self._unsent[:_PIECE_BYTES])
                del self._unsent[:_PIECE_BYTES]
                self._in_send_bytes = len(data)
                await self._stream.send(data)
                self._in_send_bytes = 0
                self._flow.update(self.get_write_buffer_size())
        except (OSError, anyio.BrokenResourceError, anyio.ClosedResourceError) as exc:
            self._broke(exc)
        except Exception as exc:  # a stream of somebody else's making may raise anything
            self._failed("writing to the stream failed", exc)
        else:
            self._release(None)

    # --- the end

    def is_closing(self) -> bool:
        """Return whether the line is closed or on its way there."""
        return self._closing

    def close(self) -> None:
        """Close the stream as soon as it has sent what was written."""
        self._closing = True
        self._wake_writer.set()

    def abort(self) -> None:
        """Close the stream at once; what it has not sent is lost."""
        self._release(None)

    def _broke(self, cause: Exception) -> None:
        lost = ConnectionLostError(f"the line broke: {str(cause) or type(cause).__name__}")
        lost.__cause__ = cause
        self._release(lost)

    def _failed(self, message: str, exc: Exception) -> None:
        self._loop.call_exception_handler(
            {
                "message": message,
                "exception": exc,
                "transport": self,
                "protocol": self._protocol,
            }
        )
        self._release(exc)

    def _release(self, exc: Exception | None) -> None:
        if self._releasing:
            return
        self._closing = self._releasing = True
        for task in self._tasks:
            task.cancel()
        self._unsent.clear()
        closer = self._loop.create_task(self._close_stream())
        self._tasks.append(closer)
        self._timer = self._loop.call_later(_RELEASE_S, self._call_connection_lost, exc)
        closer.add_done_callback(lambda _: self._call_connection_lost(exc))

    async def _close_stream(self) -> None:
        try:
            with anyio.move_on_after(_RELEASE_S / 2):
                await self._stream.aclose()
        except Exception as exc:  # the line is over either way; whoever wrote the stream may want to know
            self._loop.call_exception_handler(
                {
                    "message": "closing the stream failed",
                    "exception": exc,
                    "transport": self,
                }
            )

    def _call_connection_lost(self, exc: Exception | None) -> None:
        if not self._lost:
            self._lost = True
            if self._timer is not None:
                self._timer.cancel()
            self._protocol.connection_lost(exc)


def wrap_byte_stream(stream: ByteStream, protocol_factory: ProtocolFactory) -> asyncio.Transport:
    """
    Connect a protocol of *protocol_factory* to *stream*, which from now on belongs to the transport.

    An opener of a third-party scheme needs no more than a stream and this.

    Returns:
        The transport; ``connection_made`` has run, and ``get_extra_info("stream")`` is *stream*.
    """
    transport = ByteStreamTransport(asyncio.get_running_loop(), stream, protocol_factory())
    transport.connect()
    return transport
