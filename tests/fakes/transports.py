"""Transports that misbehave."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

__all__ = ["DeafTransport"]


class DeafTransport(asyncio.Transport):
    """Takes bytes, and reports the end of the line late, or never (*lost_after_s* is None)."""

    def __init__(self, protocol: asyncio.Protocol, *, lost_after_s: float | None = None) -> None:
        super().__init__()
        self._protocol = protocol
        self._lost_after_s = lost_after_s
        self.written: list[bytes] = []
        self.calls: list[str] = []
        protocol.connection_made(self)

    def write(self, data: bytes | bytearray | memoryview) -> None:
        self.written.append(bytes(data))

    def get_write_buffer_size(self) -> int:
        return 0

    def is_closing(self) -> bool:
        return bool(self.calls)

    def close(self) -> None:
        self._end("close")

    def abort(self) -> None:
        self._end("abort")

    def _end(self, how: str) -> None:
        if not self.calls and self._lost_after_s is not None:
            lose: Callable[[None], None] = self._protocol.connection_lost
            asyncio.get_running_loop().call_later(self._lost_after_s, lose, None)
        self.calls.append(how)
