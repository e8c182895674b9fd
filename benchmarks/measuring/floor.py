"""The floor: a bare ``asyncio.Protocol`` that writes ``S1``, finds the prompt and sets a future."""

from __future__ import annotations

import asyncio
from typing import Any, Final

__all__ = ["LINE", "PROMPT", "Bare"]

LINE: Final = b"S1\r"
PROMPT: Final = b">"


class Bare(asyncio.Protocol):
    """Knows no time-out, no queue, no error and no end; whoever asks twice at once gets one answer."""

    def __init__(self) -> None:
        self.transport: Any = None
        self._loop = asyncio.get_running_loop()
        self._answer: asyncio.Future[bytes] | None = None
        self._come = b""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Take the transport."""
        self.transport = transport

    def ask(self) -> asyncio.Future[bytes]:
        """Write the line, and return a future of its answer."""
        self._answer = answer = self._loop.create_future()
        self.transport.write(LINE)
        return answer

    def data_received(self, data: bytes) -> None:
        """Look for the prompt."""
        self._come += data
        if PROMPT in data and self._answer is not None:
            self._answer.set_result(self._come)
            self._answer, self._come = None, b""
