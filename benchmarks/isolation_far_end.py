"""The far ends of the isolation: a drive that behaves, and devices that do not, each kind in a process of its own."""

from __future__ import annotations

import asyncio
import json
import os
import sys
import termios
import tty
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import AsyncExitStack, asynccontextmanager
from typing import Final

from compax_aio.simulator.compax import Knobs, SimulatedDrive
from compax_aio.simulator.server import serve_pty, serve_tcp

__all__ = ["BEHAVES_S", "FLOODS", "HELD_S", "FarEnds", "far_ends"]

HOST: Final = "127.0.0.1"
BEHAVES_S: Final = 0.3
"""A device in trouble behaves for so long after it was connected to, so that somebody gets to know it."""
FLOODS: Final[Mapping[str, bytes]] = {"text": b"noise " * 700, "prompts": b"\r\n>" * 1400, "errors": b"E92\r\n>" * 700}
"""What floods may be made of, by name."""

HELD_S: Final = 5.0
"""Longer than any round."""
_XON: Final = b"\x11"
_XOFF: Final = b"\x13"
_QUIET: Final = "quiet"
_PROMPT: Final = b"\r\n>"
_STATUS: Final = {b"S16": b"S016: 11010000", b"S17": b"S017: 00000010", b"S30": b"S030: 0 0", b"P20": b"P020: 0"}

FarEnds = Mapping[str, str]
"""URLs by name."""


def _answer(line: bytes) -> bytes:
    """Say what a drive at rest does."""
    is_status = line[:1] == b"S" and line[1:].isdigit()
    return _STATUS.get(line, b"S%03d: 0.00" % int(line[1:]) if is_status else b"") + _PROMPT


class _Device(asyncio.Protocol):
    """Answers as a drive at rest does, until its trouble begins."""

    def __init__(self) -> None:
        self._transport: asyncio.Transport
        self._entry = b""
        self._is_in_trouble = False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        asyncio.get_running_loop().call_later(BEHAVES_S, self._begin)

    def _begin(self) -> None:
        self._is_in_trouble = True
        if not self._transport.is_closing():
            self.suffer()

    def suffer(self) -> None:
        """Keep silent: what comes is read, and not answered."""

    def data_received(self, data: bytes) -> None:
        if self._is_in_trouble:
            return
        *lines, self._entry = (self._entry + data).split(b"\r")
        for line in lines:
            self._transport.write(_answer(line))


class _Held(_Device):
    """Reads no more, so what is sent to it stays where it is."""

    def suffer(self) -> None:
        self._transport.pause_reading()


class _HangsUp(_Device):
    """Hangs up; who connects again finds the same."""

    def suffer(self) -> None:
        self._transport.abort()


class _Floods(_Device):
    """Sends as fast as it is taken."""

    def __init__(self, noise: bytes) -> None:
        super().__init__()
        self._noise = noise
        self._is_full = False

    def suffer(self) -> None:
        for _ in range(16):
            if self._is_full or self._transport.is_closing():
                return
            self._transport.write(self._noise)
        asyncio.get_running_loop().call_soon(self.suffer)

    def pause_writing(self) -> None:
        self._is_full = True

    def resume_writing(self) -> None:
        self._is_full = False
        self.suffer()


@asynccontextmanager
async def _on_tcp(make: Callable[[], asyncio.Protocol]) -> AsyncIterator[str]:
    server = await asyncio.get_running_loop().create_server(make, HOST, 0)
    try:
        yield f"tcp://{HOST}:{server.sockets[0].getsockname()[1]}"
    finally:
        server.close()


class _HeldPort:
    """A serial port whose far end answers for a while, then says Xoff and reads no more; opened anew, it is as new."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._device_end, self._port_end = os.openpty()
        tty.setraw(self._port_end)
        self.url = f"serial://{os.ttyname(self._port_end)}?xonxoff=1"
        self._entry = b""
        self._loop.add_reader(self._device_end, self._receive)
        self._holding: asyncio.TimerHandle | None = None

    def _receive(self) -> None:
        *lines, self._entry = (self._entry + os.read(self._device_end, 4096)).split(b"\r")
        for line in lines:
            os.write(self._device_end, _answer(line))
        if self._holding is None:
            self._holding = self._loop.call_later(BEHAVES_S, self._hold)

    def _hold(self) -> None:
        os.write(self._device_end, _XOFF)
        self._loop.remove_reader(self._device_end)
        self._loop.call_later(HELD_S, self._let_go)

    def _let_go(self) -> None:
        self._holding, self._entry = None, b""
        termios.tcflush(self._device_end, termios.TCIFLUSH)
        os.write(self._device_end, _XON)
        self._loop.add_reader(self._device_end, self._receive)


async def _serve(kind: str) -> None:
    """Serve the far ends of one kind, say where they are, and end when nobody listens any more."""
    async with AsyncExitStack() as stack:
        urls: dict[str, str] = {}
        if kind == _QUIET:
            knobs = Knobs(answer_time_s=0.001)
            urls["tcp"] = await stack.enter_async_context(serve_tcp(SimulatedDrive(knobs, name="on TCP")))
            urls["pty"] = await stack.enter_async_context(serve_pty(SimulatedDrive(knobs, name="on a pty")))
        else:
            devices = {"silent": _Device, "held": _Held, "hangs up": _HangsUp, "floods": lambda: _Floods(FLOODS[kind])}
            for name, make in devices.items():
                urls[name] = await stack.enter_async_context(_on_tcp(make))
            urls["Xoff"] = _HeldPort().url
        print(json.dumps(urls), flush=True)
        await asyncio.to_thread(sys.stdin.read)


@asynccontextmanager
async def far_ends(kind: str) -> AsyncIterator[FarEnds]:
    """Start those of a *kind* in a process of their own: ``quiet``, or one of :data:`FLOODS`."""
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        __name__,
        kind,
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        yield json.loads(await process.stdout.readline())
    finally:
        process.stdin.close()
        await process.wait()


if __name__ == "__main__":
    asyncio.run(_serve(sys.argv[1]))
