"""
A fixed run of exchanges, to be counted instead of timed: the program that :mod:`.callgrind` runs.

The far end is another process, and what the kernel does is not counted. Between runs the program calls ``getppid``,
which does nothing else here, and is the mark by which the counts are told apart.
"""

from __future__ import annotations

import asyncio
import os
import sys
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from importlib import import_module
from typing import Final

from .floor import Bare

__all__ = ["CLIENTS", "NEVER_S", "Ask", "main"]

NEVER_S: Final = 3600.0
"""A time-out that does not run out, however slow the machine is made by counting."""

Ask = Callable[[], Awaitable[object]]


@asynccontextmanager
async def _floor(host: str, port: int) -> AsyncIterator[Ask]:
    transport, protocol = await asyncio.get_running_loop().create_connection(Bare, host, port)
    try:
        yield protocol.ask
    finally:
        transport.close()


@asynccontextmanager
async def _position(host: str, port: int) -> AsyncIterator[Ask]:
    compax_aio = import_module("compax_aio")  # the floor is counted without it
    settings = import_module("compax_aio.compax.settings").DriveSettings(answer_timeout_s=NEVER_S, reconnect=False)
    async with compax_aio.connect(f"tcp://{host}:{port}", settings=settings) as drive:
        yield drive.position


CLIENTS: Final[Mapping[str, Callable[[str, int], AbstractAsyncContextManager[Ask]]]] = {
    "floor": _floor,
    "position": _position,
}
"""By name, what opens a line and gives what asks over it."""


async def _run(client: str, host: str, port: int, counts: list[int]) -> None:
    async with CLIENTS[client](host, port) as ask:
        for _ in range(counts[0]):  # what is made only once is made now
            await ask()
        for count in counts:
            os.getppid()
            for _ in range(count):
                await ask()
        os.getppid()


def main(arguments: list[str]) -> None:
    """Run ``client host port count…``: so many exchanges between each two marks."""
    client, host, port, *counts = arguments
    asyncio.run(_run(client, host, int(port), [int(count) for count in counts]))


if __name__ == "__main__":
    main(sys.argv[1:])
