"""
A drive at rest that answers at once, from a table: the far end of exchanges whose cost is measured.

One process serves a TCP port, for any number of connections, and as many pseudo-terminals as it is told.
"""

from __future__ import annotations

import asyncio
import json
import os
import sys
import tty
from typing import Any, Final

from ..measuring.far_end_process import stay
from ..measuring.loops import fastest_loop

__all__ = ["HOST", "POSITION", "Canned", "answer"]

HOST: Final = "127.0.0.1"
POSITION: Final = 120.5
"""What S1 is."""

_PROMPT: Final = b"\r\n>"
_SAID: Final[dict[bytes, bytes]] = {
    b"S1": b"S001: %.2f" % POSITION,
    b"S16": b"S016: 11010000",
    b"S17": b"S017: 00000010",
    b"S18": b"S018: 0",
    b"S30": b"S030: 0 0",
    b"P20": b"P020: 0",
}
_AT_ONCE: Final = {line + b"\r": said + _PROMPT for line, said in _SAID.items()}
"""What answers a whole line that comes in one piece, as nearly all do: one look-up."""


def answer(line: bytes) -> bytes:
    """Say what a drive at rest does."""
    if line in _SAID:
        return _SAID[line] + _PROMPT
    is_status = line[:1] == b"S" and line[1:].isdigit()
    return (b"S%03d: 0.00" % int(line[1:]) if is_status else b"") + _PROMPT


class Canned(asyncio.Protocol):
    """One connection."""

    def __init__(self) -> None:
        self._transport: Any = None
        self._entry = b""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Take the connection."""
        self._transport = transport

    def data_received(self, data: bytes) -> None:
        """Answer what is whole."""
        if (at_once := _AT_ONCE.get(data)) is not None and not self._entry:
            self._transport.write(at_once)
        else:
            *lines, self._entry = (self._entry + data).split(b"\r")
            self._transport.write(b"".join(map(answer, lines)))


class _Descriptor:
    """The device's end of a pseudo-terminal; what it writes is always taken, for one line is outstanding at a time."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._protocol = Canned()
        self._protocol.connection_made(self)  # type: ignore[arg-type]

    def write(self, data: bytes) -> None:
        os.write(self._descriptor, data)

    def read(self) -> None:
        self._protocol.data_received(os.read(self._descriptor, 4096))


async def _serve(terminals: int) -> None:
    loop = asyncio.get_running_loop()
    server = await loop.create_server(Canned, HOST, 0, backlog=2048)
    names = []
    for _ in range(terminals):
        device_end, port_end = os.openpty()
        tty.setraw(port_end)
        names.append(os.ttyname(port_end))
        loop.add_reader(device_end, _Descriptor(device_end).read)
    try:
        await stay({"tcp": server.sockets[0].getsockname()[1], "pty": names, "loop": type(loop).__module__})
    finally:
        server.close()


if __name__ == "__main__":
    with asyncio.Runner(loop_factory=fastest_loop()) as runner:
        runner.run(_serve(json.loads(sys.argv[1])))
