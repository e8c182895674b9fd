"""The near end of one line: what goes over it is counted, kept for errors, logged; it is let go of within a second."""

from __future__ import annotations

import asyncio
import logging

from .stats import LinkStats
from .wire import WireHistory, readable

__all__ = ["Port"]

_log = logging.getLogger("compax_aio.link")
_wire_log = logging.getLogger("compax_aio.link.wire")

_CLOSE_GRACE_S = 0.5
_ABORT_GRACE_S = 1.0


class Port:
    """
    Holds the transport of a line, while there is one.

    Args:
        name: For logs.
        stats: Bytes are counted there.
        history: The last ones are kept there.
    """

    def __init__(self, name: str, stats: LinkStats, history: WireHistory) -> None:
        self._name = name
        self._stats = stats
        self._history = history
        self._loop = asyncio.get_running_loop()
        self._transport: asyncio.Transport | None = None
        self._end: asyncio.Future[None] | None = None
        self.heard_at = 0.0
        """Loop time at which something came last, or the transport was taken."""

    @property
    def is_there(self) -> bool:
        """Whether there is a transport that was not let go of."""
        return self._transport is not None

    def opened(self, transport: asyncio.Transport) -> None:
        """Take a transport."""
        self._transport = transport
        self.heard_at = self._loop.time()
        self._end = self._loop.create_future()

    def ended(self) -> None:
        """Take note that the transport has reported its end."""
        self._transport = None
        if self._end is not None and not self._end.done():
            self._end.set_result(None)

    def write(self, data: bytes) -> None:
        """Hand *data* to the transport, if there is one."""
        if self._transport is None:
            return
        self._stats.bytes_sent += len(data)
        self._history.sent(self._loop.time(), data)
        if _wire_log.isEnabledFor(logging.DEBUG):
            _wire_log.debug("%s → %s", self._name, readable(data))
        self._transport.write(data)

    def received(self, data: bytes) -> None:
        """Take note of bytes that have come."""
        self._stats.bytes_received += len(data)
        self.heard_at = self._loop.time()
        self._history.received(self.heard_at, data)
        if _wire_log.isEnabledFor(logging.DEBUG):
            _wire_log.debug("%s ← %s", self._name, readable(data))

    def hang_up(self) -> None:
        """Let go of the transport at once; it reports its end soon."""
        transport, self._transport = self._transport, None
        if transport is not None:
            transport.abort()

    async def close(self) -> bool:
        """Send what waits, and let go of the transport; False if it has not reported its end within a second or so."""
        if self._end is None:
            return True
        if self._transport is not None:
            self._transport.close()
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
