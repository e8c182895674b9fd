"""Write-side flow control: when a transport tells its protocol to pause writing and to resume."""

from __future__ import annotations

import asyncio

__all__ = ["WriteFlow"]

_HIGH_WATER_BYTES = 64 * 1024


class WriteFlow:
    """The water marks of one transport, and what its protocol was told last."""

    def __init__(
        self, loop: asyncio.AbstractEventLoop, transport: asyncio.Transport, protocol: asyncio.BaseProtocol
    ) -> None:
        self._loop = loop
        self._transport = transport
        self.protocol = protocol
        self.high = _HIGH_WATER_BYTES
        self.low = _HIGH_WATER_BYTES // 4
        self._paused = False

    def set_limits(self, high: int | None, low: int | None) -> None:
        """Set the water marks by the rules of :meth:`asyncio.WriteTransport.set_write_buffer_limits`."""
        if high is None:
            high = _HIGH_WATER_BYTES if low is None else 4 * low
        if low is None:
            low = high // 4
        if not high >= low >= 0:
            raise ValueError(f"high ({high}) must be >= low ({low}) must be >= 0")
        self.high, self.low = high, low

    def update(self, size_bytes: int) -> None:
        """Take note that *size_bytes* wait to be sent, and tell the protocol if that crosses a mark."""
        if not self._paused and size_bytes > self.high:
            self._paused = True
            self._tell("pause_writing")
        elif self._paused and size_bytes <= self.low:
            self._paused = False
            self._tell("resume_writing")

    def _tell(self, method: str) -> None:
        try:
            getattr(self.protocol, method)()
        except Exception as exc:  # as asyncio does: a defect of the protocol is reported and stops no bytes
            self._loop.call_exception_handler(
                {
                    "message": f"protocol.{method}() failed",
                    "exception": exc,
                    "transport": self._transport,
                    "protocol": self.protocol,
                }
            )
