"""Where the cable of a simulated device is plugged in: a port or an address, which can go away and come back."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable
from contextlib import AbstractAsyncContextManager, AsyncExitStack

from .line import SimulatedDevice
from .server import serve_pty, serve_tcp

__all__ = ["Outlet", "pty_outlet", "tcp_outlet"]


class Outlet:
    """
    Serves a device while it is plugged in.

    Args:
        serve: Serves it, and gives its URL; called anew for each time it is plugged in, with the last URL, or None.

    Attributes:
        url: Of the device; that of the last time, while it is not plugged in.
    """

    def __init__(self, serve: Callable[[str | None], AbstractAsyncContextManager[str]]) -> None:
        self._serve = serve
        self._stack: AsyncExitStack | None = None
        self._turn = asyncio.Lock()
        self.url: str | None = None

    @property
    def is_plugged(self) -> bool:
        """Whether a program can open it."""
        return self._stack is not None

    async def plug(self) -> None:
        """
        Let programs open the device; nothing happens if they can.

        Raises:
            TransportError: The port, the address or the link cannot be had.
        """
        async with self._turn:
            if self._stack is not None:
                return
            stack = AsyncExitStack()
            self.url = await stack.enter_async_context(self._serve(self.url))
            self._stack = stack

    async def unplug(self) -> None:
        """Hang up, and let nobody open the device; nothing happens if nobody can."""
        async with self._turn:
            stack, self._stack = self._stack, None
            if stack is not None:
                await stack.aclose()


def pty_outlet(device: SimulatedDevice, link: str | os.PathLike[str] | None = None) -> Outlet:
    """Return an outlet on a pseudo-terminal: another one each time, under the same *link* if there is one."""
    return Outlet(lambda _: serve_pty(device, link=link))


def tcp_outlet(device: SimulatedDevice, host: str = "127.0.0.1", port: int = 0) -> Outlet:
    """Return an outlet on TCP, on the same port each time; 0 is a free one."""

    def serve(before: str | None) -> AbstractAsyncContextManager[str]:
        return serve_tcp(device, host, port if before is None else int(before.rpartition(":")[2]))

    return Outlet(serve)
