"""The near end of one line: what goes over it is counted, kept for errors, logged; it is let go of within a second."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from math import ceil
from typing import Any, Final

from .stats import LinkStats
from .taps import LetGo, Opened, Received
from .telling import Telling
from .wire import WireHistory, readable

__all__ = ["Port"]

_log = logging.getLogger("compax_aio.link")
_wire_log = logging.getLogger("compax_aio.link.wire")

_CLOSE_GRACE_S: Final = 0.5
_ABORT_GRACE_S: Final = 1.0

_PIECE_BYTES: Final = 64
"""Read at once: two answers, or at worst half a millisecond's work …"""
_BETWEEN_PIECES_S: Final = 0.001
"""… and then not for so long: five times what comes at 115,200 baud, and others have the event loop meanwhile."""
_MOST_UNSENT_BYTES: Final = 1024
"""More than that waits only on a line that takes nothing: one command is outstanding at a time."""
_PART_OF_A_BYTE: Final = 1e-3
"""Times are sums, and not exact: what is missing less than that has left."""


class Port:
    """
    Holds the transport of a line, while there is one.

    Args:
        name: For logs.
        stats: Bytes are counted there.
        history: The last ones are kept there.
        telling: Tells of them, too.
    """

    def __init__(self, name: str, stats: LinkStats, history: WireHistory, telling: Telling) -> None:
        self._name = name
        self._stats = stats
        self._history = history
        self._telling = telling
        self._loop = asyncio.get_running_loop()
        self.transport: asyncio.Transport | None = None
        """None where there is none, or it was let go of."""
        self._unread = bytearray()
        self._end: asyncio.Future[None] | None = None
        self.heard_at = 0.0
        """Loop time at which something came last, or the transport was taken."""
        self.bytes_per_s: float | None = None
        """How fast the line sends, where that is known."""
        self._sent_at = 0.0
        """Loop time at which all is on its way that was written, if the line sends as fast as that."""

    def opened(self, transport: asyncio.Transport) -> None:
        """Take a transport."""
        self.transport = transport
        self._unread.clear()
        self.heard_at = self._sent_at = self._loop.time()
        self._end = self._loop.create_future()
        if self._telling.is_heard:
            self._telling.tell(Opened())

    def extra_info(self, name: str) -> Any:
        """Return what the transport says of itself under *name*; None if it says nothing, or is not there."""
        return self.transport.get_extra_info(name) if self.transport is not None else None

    @property
    def is_stuck(self) -> bool:
        """Whether the far end takes nothing, and more has been written than it will ever be well to send."""
        return self.transport is not None and self.transport.get_write_buffer_size() > _MOST_UNSENT_BYTES

    @property
    def unsent_bytes(self) -> int:
        """
        How many bytes that were written have not left yet, as far as can be told.

        The transport and the driver of a serial port tell what waits with them; what waits behind them, in an adapter
        or a terminal server, is reckoned from the time it takes at :attr:`bytes_per_s`.
        """
        if self.transport is None:
            return 0
        waiting = self.transport.get_write_buffer_size() + _unsent_by_driver(self.transport)
        if self.bytes_per_s is None:
            return waiting
        reckoned = (self._sent_at - self._loop.time()) * self.bytes_per_s
        return max(waiting, ceil(reckoned - _PART_OF_A_BYTE))

    def ended(self) -> None:
        """Take note that the transport has reported its end."""
        self.transport = None
        if self._end is not None and not self._end.done():
            self._end.set_result(None)

    def write(self, data: bytes, now: float, *, goes_on: bool = False) -> None:
        """Hand *data* to the transport, if there is one; *goes_on* with what was written before, or begin a line."""
        if self.transport is None:
            return
        self._stats.bytes_sent += len(data)
        self._history.sent(now, data, goes_on=goes_on)
        if _wire_log.isEnabledFor(logging.DEBUG):
            _wire_log.debug("%s → %s", self._name, readable(data))
        if self.bytes_per_s is not None:
            self._sent_at = max(self._sent_at, now) + len(data) / self.bytes_per_s
        self.transport.write(data)

    def received(self, data: bytes, read: Callable[[bytes, float], None]) -> None:
        """
        Take note of bytes that have come, and hand them to *read*, with the time.

        The first piece is read at once, each other a while later, before more is taken.
        """
        self._stats.bytes_received += len(data)
        self.heard_at = now = self._loop.time()
        self._history.received(now, data)
        if _wire_log.isEnabledFor(logging.DEBUG):
            _wire_log.debug("%s ← %s", self._name, readable(data))
        if len(data) > _PIECE_BYTES or self._unread:
            self._read_in_pieces(data, read)
            return
        if self._telling.is_heard:
            self._telling.tell(Received(data))
        read(data, now)

    def _read_in_pieces(self, data: bytes, read: Callable[[bytes, float], None]) -> None:
        is_at_it = bool(self._unread)
        self._unread += data
        if not is_at_it and self.transport is not None:
            self.transport.pause_reading()
            self._read_piece(self.transport, read)

    def _read_piece(self, transport: asyncio.Transport, read: Callable[[bytes, float], None]) -> None:
        if transport is not self.transport:  # the line was lost meanwhile
            return
        piece = bytes(self._unread[:_PIECE_BYTES])
        del self._unread[:_PIECE_BYTES]
        if self._unread:
            self._loop.call_later(_BETWEEN_PIECES_S, self._read_piece, transport, read)
        if self._telling.is_heard:
            self._telling.tell(Received(piece))
        read(piece, self._loop.time())
        if not self._unread and transport is self.transport:
            transport.resume_reading()

    def hang_up(self) -> None:
        """Let go of the transport at once; it reports its end soon."""
        transport, self.transport = self.transport, None
        if transport is not None:
            self._tell_let_go(transport)
            transport.abort()

    def let_go(self) -> None:
        """
        Let go of the transport when it has sent what waits, within half a second; it reports its end then.

        One that takes nothing is let go of at once.
        """
        if self.is_stuck:
            self.hang_up()
        transport, self.transport = self.transport, None
        end = self._end
        if transport is not None and end is not None:
            self._tell_let_go(transport)
            transport.close()
            self._loop.call_later(_CLOSE_GRACE_S, _abort_unless_ended, transport, end)

    async def close(self) -> bool:
        """Send what waits, and let go of the transport; False if it has not reported its end within a second or so."""
        if self._end is None:
            return True
        if self.transport is not None:
            self._tell_let_go(self.transport)
            self.transport.close()
        abort = self._loop.call_later(_CLOSE_GRACE_S, self.hang_up)
        try:
            await asyncio.wait([self._end], timeout=_CLOSE_GRACE_S + _ABORT_GRACE_S)
        finally:
            abort.cancel()
            self.hang_up()
        if self._end.done():
            return True
        _log.error("%s: the transport did not report its end", self._name)
        return False

    def _tell_let_go(self, transport: asyncio.Transport) -> None:
        if self._telling.is_heard and not transport.is_closing():
            self._telling.tell(LetGo())


def _unsent_by_driver(transport: asyncio.Transport) -> int:
    """Return what the driver of a serial port has not sent; 0 where it is none, or does not say."""
    driver = transport.get_extra_info("serial")
    try:
        return int(getattr(driver, "out_waiting", 0))
    except (OSError, ValueError):  # it went away, which the transport tells soon
        return 0


def _abort_unless_ended(transport: asyncio.Transport, end: asyncio.Future[None]) -> None:
    # After its end, asyncio's own transports of CPython 3.11 do not bear it.
    if not end.done():
        transport.abort()
