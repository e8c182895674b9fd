"""The near end of a line to a simulated device: keeps what it hears, and how it was held back."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from compax_aio.transports.registry import open_transport

__all__ = ["NearEnd", "opened", "until"]


class NearEnd(asyncio.Protocol):
    """What a program at the line sees."""

    def __init__(self) -> None:
        self.heard = bytearray()
        self.pauses: list[str] = []

    def data_received(self, data: bytes) -> None:
        self.heard += data

    def pause_writing(self) -> None:
        self.pauses.append("paused")

    def resume_writing(self) -> None:
        self.pauses.append("resumed")

    async def until_heard(self, end: bytes) -> bytes:
        """Wait until what is heard ends so; return all of it, and forget it."""
        async with asyncio.timeout(100):
            await until(lambda: self.heard.endswith(end))
        heard = bytes(self.heard)
        self.heard.clear()
        return heard


async def until(is_so: Callable[[], bool], look_every_s: float = 0.01) -> None:
    """Wait until something is so."""
    while not is_so():  # noqa: ASYNC110  # a log has no event to wait for
        await asyncio.sleep(look_every_s)


async def opened(url: str) -> tuple[asyncio.Transport, NearEnd]:
    """Open the line of *url*."""
    near = NearEnd()
    return await open_transport(url, lambda: near), near
