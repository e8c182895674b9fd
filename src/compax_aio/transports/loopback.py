"""Open ``loop://`` lines: both ends in one event loop, bytes handed over in memory."""

from __future__ import annotations

import asyncio
from collections import deque
from types import TracebackType
from typing import Final
from weakref import WeakKeyDictionary

from compax_aio.errors import TransportError

from .flow import WriteFlow
from .registry import ProtocolFactory
from .url import TransportURL

__all__ = ["LoopbackListener", "LoopbackTransport", "create_pair", "listen", "open_loopback"]

_FORM: Final = "loop://name"


class LoopbackTransport(asyncio.Transport):
    """
    One end of an in-memory line; made by :func:`create_pair`.

    Bytes arrive in later turns of the event loop, in the pieces in which they were written, and stay with the writer,
    counted, while the far end has paused reading. When one end closes, the other one gets what was written and then
    ``connection_lost(None)``; when one end aborts, the other one gets ``connection_lost(ConnectionResetError)``.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, protocol: asyncio.Protocol, name: str) -> None:
        super().__init__({"name": name})
        self._loop = loop
        self._protocol: asyncio.Protocol = protocol
        self._peer: LoopbackTransport = self
        self._flow = WriteFlow(loop, self, protocol)
        self._unread: deque[bytes] = deque()
        self._unread_bytes = 0
        self._delivering = False
        self._reading = True
        self._closing = False
        self._lost = False

    def __repr__(self) -> str:
        state = "closed" if self._lost else "closing" if self._closing else "open"
        return f"<LoopbackTransport {self.get_extra_info('name')!r} {state}>"

    def set_protocol(self, protocol: asyncio.BaseProtocol) -> None:
        """Connect another protocol to this end."""
        assert isinstance(protocol, asyncio.Protocol), "a line needs a protocol that takes bytes"
        self._protocol = self._flow.protocol = protocol

    def get_protocol(self) -> asyncio.BaseProtocol:
        """Return the protocol that is connected to this end."""
        return self._protocol

    # --- reading

    def is_reading(self) -> bool:
        """Return whether what arrives is handed to the protocol."""
        return self._reading and not self._closing

    def pause_reading(self) -> None:
        """Leave what arrives with the far end until :meth:`resume_reading`."""
        self._reading = False

    def resume_reading(self) -> None:
        """Hand what arrives to the protocol again."""
        self._reading = True
        self._peer._schedule_delivery()  # noqa: SLF001  # the other half of one object

    # --- writing

    def write(self, data: bytes | bytearray | memoryview) -> None:
        """Send *data*; it arrives in a later turn of the event loop."""
        if self._closing or not data:
            return
        self._unread.append(bytes(data))
        self._unread_bytes += len(self._unread[-1])
        self._schedule_delivery()
        self._flow.update(self._unread_bytes)

    def can_write_eof(self) -> bool:
        """Return False: like a serial line, this one has no end that leaves the other direction open."""
        return False

    def get_write_buffer_size(self) -> int:
        """Return how many bytes the far end has not taken yet."""
        return self._unread_bytes

    def get_write_buffer_limits(self) -> tuple[int, int]:
        """Return the water marks, low and high."""
        return self._flow.low, self._flow.high

    def set_write_buffer_limits(self, high: int | None = None, low: int | None = None) -> None:
        """Set the water marks."""
        self._flow.set_limits(high, low)
        self._flow.update(self._unread_bytes)

    def _schedule_delivery(self) -> None:
        if self._unread and not self._delivering:
            self._delivering = True
            self._loop.call_soon(self._deliver)

    def _deliver(self) -> None:
        self._delivering = False
        if self._lost:
            return
        # What is written meanwhile waits for the next turn, so that two ends in conversation starve nobody.
        for _ in range(len(self._unread)):
            if not (self._unread and self._peer.is_reading()):
                break
            data = self._unread.popleft()
            self._unread_bytes -= len(data)
            self._peer._take(data)  # noqa: SLF001
        if self._peer.is_reading():
            self._schedule_delivery()
        self._flow.update(self._unread_bytes)
        if self._closing and not self._unread:
            self._finish(None, None)

    def _take(self, data: bytes) -> None:
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
            self._finish(exc, ConnectionResetError("the far end failed"))

    # --- the end

    def is_closing(self) -> bool:
        """Return whether this end is closed or on its way there."""
        return self._closing

    def close(self) -> None:
        """Hang up as soon as the far end has taken what was written."""
        if not self._closing:
            self._closing = True
            # Two ends that both close read no more: neither waits for the other.
            if not self._unread or self._peer.is_closing():
                self._finish(None, None)

    def abort(self) -> None:
        """Hang up at once; what the far end has not taken is lost."""
        self._finish(None, ConnectionResetError("the far end hung up"))

    def fail(self, error: Exception) -> None:
        """Hang up at once, and let the far end be told *error* as what has ended the line."""
        self._finish(None, error)

    def _finish(self, mine: Exception | None, theirs: Exception | None) -> None:
        self._lose(mine)
        self._peer._lose(theirs)  # noqa: SLF001

    def _lose(self, exc: Exception | None) -> None:
        if not self._lost:
            self._lost = self._closing = True
            self._unread.clear()
            self._unread_bytes = 0
            self._loop.call_soon(self._call_connection_lost, exc)

    def _call_connection_lost(self, exc: Exception | None) -> None:
        self._protocol.connection_lost(exc)


def create_pair(
    protocol_a: asyncio.Protocol,
    protocol_b: asyncio.Protocol,
    loop: asyncio.AbstractEventLoop,
    *,
    name: str = "",
) -> tuple[LoopbackTransport, LoopbackTransport]:
    """
    Connect two protocols of *loop* by a line in memory; ``connection_made`` of both has run.

    Args:
        protocol_a: What the first transport talks to.
        protocol_b: What the second transport talks to; its ``connection_made`` is the first to run.
        loop: The event loop in which both live.
        name: What ``get_extra_info("name")`` of both returns.
    """
    a, b = LoopbackTransport(loop, protocol_a, name), LoopbackTransport(loop, protocol_b, name)
    a._peer, b._peer = b, a  # noqa: SLF001
    protocol_b.connection_made(b)
    try:
        protocol_a.connection_made(a)
    except BaseException:
        a.abort()
        raise
    return a, b


_listeners: WeakKeyDictionary[asyncio.AbstractEventLoop, dict[str, LoopbackListener]] = WeakKeyDictionary()


class LoopbackListener:
    """The far end of ``loop://name``; made by :func:`listen`, closed by :meth:`close` or at the end of its block."""

    def __init__(self, name: str, protocol_factory: ProtocolFactory) -> None:
        self.name = name
        self._protocol_factory = protocol_factory
        self._names = _listeners.setdefault(asyncio.get_running_loop(), {})
        if name in self._names:
            raise TransportError(f"{self.url} is taken", hint="give each listener of one event loop its own name")
        self._names[name] = self

    @property
    def url(self) -> str:
        """The URL that opens a line to this listener."""
        return f"loop://{self.name}"

    def connect(self, protocol: asyncio.Protocol) -> LoopbackTransport:
        """Connect *protocol* to a new protocol of this listener."""
        near, _ = create_pair(protocol, self._protocol_factory(), asyncio.get_running_loop(), name=self.name)
        return near

    def close(self) -> None:
        """Take no more connections; those that exist stay."""
        if self._names.get(self.name) is self:
            del self._names[self.name]

    def __enter__(self) -> LoopbackListener:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, exc: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()


async def listen(name: str, protocol_factory: ProtocolFactory) -> LoopbackListener:
    """
    Be the far end of ``loop://name`` for everybody who opens it in this event loop.

    Raises:
        TransportError: Another listener has that name.
    """
    return LoopbackListener(name, protocol_factory)


async def open_loopback(url: TransportURL, protocol_factory: ProtocolFactory) -> asyncio.Transport:
    """
    Open ``loop://name``, where :func:`listen` listens in this event loop; it has no options.

    Raises:
        TransportError: Nobody listens by that name; the hint lists who does.
    """
    url.expect(_FORM, host=True)
    names = _listeners.get(asyncio.get_running_loop(), {})
    listener = names.get(url.host)
    if listener is None:
        raise TransportError(
            f"nobody listens on loop://{url.host} in this event loop",
            hint=f"names that listen: {', '.join(sorted(names)) or 'none'}",
        )
    return listener.connect(protocol_factory())
