"""A transport on top of another one: what passes is said differently below, as TLS and telnet do."""

from __future__ import annotations

import asyncio
import socket
from abc import ABC, abstractmethod
from typing import Any, Final

from compax_aio.errors import ConnectionLostError

from .flow import WriteFlow
from .registry import ProtocolFactory

__all__ = ["Layer", "LayeredTransport", "open_layered"]

# What the far end gets to take what is unsent and to answer our farewell, before the line is cut.
_FAREWELL_S: Final = 1.0


class Layer(ABC):
    """
    How bytes are said below, without any I/O.

    Attributes:
        is_ready: Whether the greetings are over, so that bytes of the protocol may pass.
        is_over: Whether the far end has said that nothing more comes.
        answers_farewell: Whether the far end is given a moment to answer :meth:`farewell`.
    """

    is_ready = False
    is_over = False
    answers_farewell = False

    @property
    def held_bytes(self) -> int:
        """How many bytes the layer keeps back because the far end asked for it."""
        return 0

    @abstractmethod
    def receive(self, data: bytes) -> bytes:
        """Take what came from below; return what of it is for the protocol. OSError if the line is of no use."""

    @abstractmethod
    def encode(self, data: bytes | bytearray | memoryview) -> bytes:
        """Return how *data* of the protocol is said below."""

    @abstractmethod
    def bytes_to_send(self) -> bytes:
        """Return, once, what the layer itself has to say below."""

    def may_do_without(self) -> bool:
        """Whether the line can be used although the greetings have not come to their end in time."""
        return False

    def farewell(self) -> bytes:
        """Return what is said below before the line is closed."""
        return b""

    def lost(self, exc: OSError) -> Exception:
        """Return what the protocol is told of *exc*, by which the open line ended."""
        return ConnectionLostError(f"the line broke: {exc.strerror or exc}")


class LayeredTransport(asyncio.Transport):
    """A line whose bytes go through a :class:`Layer` to a TCP line below; made by :func:`open_layered`."""

    def __init__(self, loop: asyncio.AbstractEventLoop, layer: Layer) -> None:
        super().__init__()
        self._loop = loop
        self.layer = layer
        self.ready: asyncio.Future[None] = loop.create_future()
        self._below: asyncio.Transport | None = None
        self._protocol: asyncio.Protocol = asyncio.Protocol()
        self._flow = WriteFlow(loop, self, self._protocol)
        self._early = b""
        self._connected = False
        self._reading = True
        self._closing = False
        self._loss: Exception | None = None
        self._farewell: asyncio.TimerHandle | None = None

    def __repr__(self) -> str:
        state = "closed" if self._below is None else "closing" if self._closing else "open"
        return f"<LayeredTransport of {type(self.layer).__name__} {state}>"

    def connect(self, protocol: asyncio.Protocol) -> None:
        """Tell *protocol* that the line is open, and hand it what arrives from now on; once."""
        self.set_protocol(protocol)
        self._connected = True
        try:
            protocol.connection_made(self)
        except BaseException:
            self.abort()
            raise
        if self._reading:
            self.resume_reading()
        if self.layer.is_over:
            self._loop.call_soon(self.close)

    def set_protocol(self, protocol: asyncio.BaseProtocol) -> None:
        """Connect another protocol to the line."""
        assert isinstance(protocol, asyncio.Protocol), "a line needs a protocol that takes bytes"
        self._protocol = self._flow.protocol = protocol

    def get_protocol(self) -> asyncio.BaseProtocol:
        """Return the protocol that is connected to the line."""
        return self._protocol

    def get_extra_info(self, name: str, default: Any = None) -> Any:
        """Return what the line below knows (``socket``, ``peername``), and the layer for the name ``layer``."""
        if name == "layer":
            return self.layer
        return self._below.get_extra_info(name, default) if self._below is not None else default

    # --- reading

    def is_reading(self) -> bool:
        """Return whether what arrives is handed to the protocol."""
        return self._reading and not self._closing

    def pause_reading(self) -> None:
        """Leave what arrives with the line below until :meth:`resume_reading`."""
        self._reading = False
        if self._below is not None and not self._closing:
            self._below.pause_reading()

    def resume_reading(self) -> None:
        """Hand what arrives to the protocol again."""
        self._reading = True
        if self._below is not None and not self._closing:
            self._below.resume_reading()
            if self._early:
                self._loop.call_soon(self._deliver_early)

    def _deliver_early(self) -> None:
        if self.is_reading():
            self._deliver(b"")

    def _deliver(self, data: bytes) -> None:
        data, self._early = self._early + data, b""
        if not data:
            return
        try:
            self._protocol.data_received(data)
        except Exception as exc:  # as asyncio does: what the protocol has understood so far is not known any more
            self._loop.call_exception_handler(
                {
                    "message": "protocol.data_received() failed",
                    "exception": exc,
                    "transport": self,
                    "protocol": self._protocol,
                }
            )
            self._fail(exc)

    # --- writing

    def write(self, data: bytes | bytearray | memoryview) -> None:
        """Send *data* as the layer says it."""
        if not self._closing and data:
            self._send(self.layer.encode(data))

    def _send(self, data: bytes) -> None:
        if self._below is not None:
            if data:
                self._below.write(data)
            self._flow.update(self.get_write_buffer_size())

    def can_write_eof(self) -> bool:
        """Return False: like a serial line, this one has no end that leaves the other direction open."""
        return False

    def get_write_buffer_size(self) -> int:
        """Return how many bytes, as the layer says them, the far end has not taken yet."""
        below = self._below.get_write_buffer_size() if self._below is not None else 0
        return below + self.layer.held_bytes

    def get_write_buffer_limits(self) -> tuple[int, int]:
        """Return the water marks, low and high."""
        return self._flow.low, self._flow.high

    def set_write_buffer_limits(self, high: int | None = None, low: int | None = None) -> None:
        """Set the water marks."""
        self._flow.set_limits(high, low)
        self._tell_below_the_mark()
        self._flow.update(self.get_write_buffer_size())

    def _tell_below_the_mark(self) -> None:
        # Both marks at our low one: so we hear whenever it falls to that, and look for ourselves.
        if self._below is not None:
            self._below.set_write_buffer_limits(high=self._flow.low, low=self._flow.low)

    # --- the end

    def is_closing(self) -> bool:
        """Return whether the line is closed or on its way there."""
        return self._closing

    def close(self) -> None:
        """Send what is unsent and say farewell, for a second at most, then hang up."""
        if self._closing:
            return
        self._closing = True
        if self._below is None:
            return
        below = self._below
        below.write(self.layer.farewell())
        self._farewell = self._loop.call_later(_FAREWELL_S, self.abort)
        if self.layer.answers_farewell:
            below.resume_reading()
        else:
            below.close()

    def abort(self) -> None:
        """Hang up at once; what is unsent is lost."""
        self._closing = True
        if self._below is not None:
            self._below.abort()

    def _fail(self, exc: Exception) -> None:
        if self._loss is None:
            self._loss = exc
        self.abort()

    # --- what the line below tells

    def made_below(self, below: asyncio.Transport) -> None:
        """Take note of the line below, and begin with the greetings."""
        self._below = below
        self._tell_below_the_mark()
        self._send(self.layer.bytes_to_send())
        self._greeted(b"")

    def received_below(self, data: bytes) -> None:
        """Take what came from below, in pieces of any size."""
        try:
            received = self.layer.receive(data)
        except OSError as exc:
            self._send(self.layer.bytes_to_send())  # an alert may say why
            self._fail(self.layer.lost(exc) if self._connected else exc)
            return
        self._send(self.layer.bytes_to_send())
        if self._closing:
            if self.layer.is_over and self._below is not None:
                self._below.close()
        elif not self._connected:
            self._greeted(received)
        else:
            self._deliver(received)
            if self.layer.is_over:
                self.close()

    def _greeted(self, received: bytes) -> None:
        self._early += received
        if self.layer.is_ready and not self.ready.done():
            self.ready.set_result(None)
            if self._below is not None:  # at most what came in this piece is kept until somebody is there to take it
                self._below.pause_reading()

    def lost_below(self, exc: Exception | None) -> None:
        """Tell the protocol that the line is over."""
        self._below = None
        self._closing = True
        if self._farewell is not None:
            self._farewell.cancel()
        if not self._connected:
            if not self.ready.done():
                self.ready.set_exception(self._loss or exc or ConnectionResetError("the far end hung up"))
                self.ready.exception()  # if nobody waits any more, nobody has to be told
            return
        self._protocol.connection_lost(self._loss or exc)

    def writing_below_changed(self) -> None:
        """Look whether our own marks are crossed."""
        self._flow.update(self.get_write_buffer_size())


class _Below(asyncio.Protocol):
    """The protocol of the line below."""

    def __init__(self, above: LayeredTransport) -> None:
        self._above = above

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self._above.made_below(transport)

    def data_received(self, data: bytes) -> None:
        self._above.received_below(data)

    def pause_writing(self) -> None:
        self._above.writing_below_changed()

    def resume_writing(self) -> None:
        self._above.writing_below_changed()

    def connection_lost(self, exc: Exception | None) -> None:
        self._above.lost_below(exc)


async def open_layered(
    sock: socket.socket, layer: Layer, protocol_factory: ProtocolFactory, *, greetings_s: float
) -> LayeredTransport:
    """
    Exchange the greetings of *layer* over *sock*, which is connected, and connect a protocol to the line.

    Returns:
        The transport; ``connection_made`` has run.

    Raises:
        TimeoutError: The greetings were not over after *greetings_s*.
        OSError: They failed.
    """
    loop = asyncio.get_running_loop()
    transport = LayeredTransport(loop, layer)
    await loop.create_connection(lambda: _Below(transport), sock=sock)
    try:
        await _greetings(transport, greetings_s)
        protocol = protocol_factory()
    except BaseException:
        transport.abort()
        raise
    transport.connect(protocol)
    return transport


async def _greetings(transport: LayeredTransport, greetings_s: float) -> None:
    # Who can do without the rest of them does so after half the time.
    for _ in range(2):
        try:
            async with asyncio.timeout(greetings_s / 2):
                return await asyncio.shield(transport.ready)
        except TimeoutError:
            if transport.ready.done():
                raise
            if transport.layer.may_do_without():
                return None
    raise TimeoutError
