"""The far end of the party line: lines of three simulated axes with 9600 baud, in a process of its own."""

from __future__ import annotations

import asyncio
import json
import selectors
import sys
from collections.abc import AsyncIterator, Mapping
from contextlib import AsyncExitStack, asynccontextmanager
from typing import Final

from compax_aio.simulator.server import serve_pty, serve_tcp
from compax_aio.simulator.smc import Knobs, SimulatedPartyLine

__all__ = ["AXES", "KNOBS", "far_end", "floor_s"]

AXES: Final = "ABC"
KNOBS: Final = Knobs(axes=AXES, baudrate=9600)
_QUESTION: Final = 2
"""A name and ``Z``; an LF comes behind it."""


def floor_s(knobs: Knobs = KNOBS) -> float:
    """Return what reading a position takes the far end alone: every byte on the wire, and its firmware's own time."""
    there = (_QUESTION + 1) * (knobs.byte_time_s + knobs.idle_service_s)
    back = (_QUESTION + knobs.width + 1) * knobs.byte_time_s
    return there + knobs.execution_time_s + back


async def _serve(clients: int) -> None:
    """Serve a line of each kind to each client, say where they are, and end when nobody listens any more."""
    async with AsyncExitStack() as stack:
        urls: dict[str, list[str]] = {"TCP": [], "pty": []}
        for _ in range(clients):
            urls["TCP"].append(await stack.enter_async_context(serve_tcp(SimulatedPartyLine(KNOBS))))
            urls["pty"].append(await stack.enter_async_context(serve_pty(SimulatedPartyLine(KNOBS))))
        print(json.dumps(urls), flush=True)
        await asyncio.to_thread(sys.stdin.read)


@asynccontextmanager
async def far_end(clients: int) -> AsyncIterator[Mapping[str, list[str]]]:
    """Start it, for so many *clients*; gives a URL for each, by kind of line."""
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        __name__,
        str(clients),
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


def _make_loop() -> asyncio.AbstractEventLoop:
    # select() takes fractions of a millisecond, where epoll rounds up to the next one: about as long as a byte.
    return asyncio.SelectorEventLoop(selectors.SelectSelector())


if __name__ == "__main__":
    with asyncio.Runner(loop_factory=_make_loop) as runner:
        runner.run(_serve(int(sys.argv[1])))
