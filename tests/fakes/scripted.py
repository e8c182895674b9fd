"""The far end of an in-memory line, played by a script: a function from the line that came to what is said to it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from tests.fakes.answers import as_drive

__all__ = ["Script", "ScriptedFarEnd"]

Script = Callable[[str], bytes | None]


class ScriptedFarEnd(asyncio.Protocol):
    """
    Takes lines that end with *end* and answers them in order, each *delay_s* after the one before at the earliest.

    *script* and *delay_s* may be changed at any time; they count for the lines that come from then on. A script that
    gives None keeps silent. ``lines`` and ``times`` hold every line that came, and when.
    """

    def __init__(self, script: Script = as_drive, *, delay_s: float = 0.0, end: bytes = b"\r") -> None:
        self.script = script
        self.delay_s = delay_s
        self.lines: list[str] = []
        self.times: list[float] = []
        self.writes: list[bytes] = []
        self.is_lost = False
        self._end = end
        self._unfinished = b""
        self._free_at = 0.0
        self._transport: asyncio.Transport | None = None

    @property
    def transport(self) -> asyncio.Transport:
        assert self._transport is not None
        return self._transport

    def say(self, data: bytes) -> None:
        """Send *data* at once, asked or not."""
        self.transport.write(data)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport

    def data_received(self, data: bytes) -> None:
        loop = asyncio.get_running_loop()
        self.writes.append(data)
        *lines, self._unfinished = (self._unfinished + data).split(self._end)
        for line in lines:
            self.lines.append(line.decode())
            self.times.append(loop.time())
            if (reply := self.script(line.decode())) is not None:
                self._free_at = max(self._free_at, loop.time()) + self.delay_s
                loop.call_at(self._free_at, self.say, reply)

    def connection_lost(self, exc: Exception | None) -> None:
        self.is_lost = True
