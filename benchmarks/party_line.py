"""
How much of a 9600-baud party line is left? Positions of three axes are read back to back, character by character.

Run it with ``python -m benchmarks.party_line``. Beside the client of this project the same is done by a bare
``asyncio.Protocol`` on the same transport, which waits for echoes and knows no time-outs, no queue and no errors; and
the time is computed that the bytes and the simulated firmware take alone. Rounds of all of them alternate.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import logging
import os
import platform
import sys
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping, Sequence
from contextlib import AbstractAsyncContextManager, AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field
from statistics import median
from typing import Final

from compax_aio import smc
from compax_aio.transports import TransportURL, open_transport

from .party_line_far_end import AXES, far_end, floor_s
from .torture import table

__all__ = ["CLIENTS", "HEAD", "Rounds", "main", "measure", "ratios", "rows"]

HEAD: Final = ("line", "client", "reads/s", "of the limit", "of bare", "CPU ms/read", "CPU of bare")

_BARE: Final = "bare protocol"
_LF: Final = b"\n"
_QUIET_S: Final = 0.1

Read = Callable[[float], Awaitable[int]]
"""Reads positions of all axes in turn until then, and returns how many."""


class _Bare(asyncio.Protocol):
    """The handshake and nothing else: a character out, its echo in, and the line feed with the answer before it."""

    def __init__(self) -> None:
        self._transport: asyncio.Transport
        self._rest = b""
        self._echo = b""
        self._result = bytearray()
        self._answer: asyncio.Future[float] | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport

    def clear(self) -> None:
        """Let the axes look for their names."""
        self._transport.write(_LF)

    def position(self, axis: str) -> asyncio.Future[float]:
        """Ask one axis."""
        self._answer = asyncio.get_running_loop().create_future()
        self._rest = f"{axis}Z\n".encode()
        self._result.clear()
        self._next()
        return self._answer

    def _next(self) -> None:
        self._echo, self._rest = self._rest[:1], self._rest[1:]
        self._transport.write(self._echo)

    def data_received(self, data: bytes) -> None:
        if self._answer is None:
            return
        if self._echo != _LF:
            assert data == self._echo
            self._next()
            return
        self._result += data
        if data.endswith(_LF):
            self._answer.set_result(float(self._result))
            self._answer = None

    def close(self) -> None:
        self._transport.close()


@asynccontextmanager
async def _bare(url: str) -> AsyncIterator[Read]:
    protocol = _Bare()
    await open_transport(TransportURL.parse(url), lambda: protocol)
    protocol.clear()
    await asyncio.sleep(_QUIET_S)

    async def read(until: float) -> int:
        count = 0
        while time.perf_counter() < until:
            for axis in AXES:
                await protocol.position(axis)
                count += 1
        return count

    try:
        yield read
    finally:
        protocol.close()


@asynccontextmanager
async def _in_turn(url: str) -> AsyncIterator[Read]:
    async with smc.connect(url, axes=AXES) as line:

        async def read(until: float) -> int:
            count = 0
            while time.perf_counter() < until:
                for axis in line.axes.values():
                    await axis.position()
                    count += 1
            return count

        yield read


@asynccontextmanager
async def _in_tasks(url: str) -> AsyncIterator[Read]:
    async with smc.connect(url, axes=AXES) as line:

        async def read_one(axis: smc.SmcAxis, until: float) -> int:
            count = 0
            while time.perf_counter() < until:
                await axis.position()
                count += 1
            return count

        async def read(until: float) -> int:
            return sum(await asyncio.gather(*(read_one(axis, until) for axis in line.axes.values())))

        yield read


CLIENTS: Final[Mapping[str, Callable[[str], AbstractAsyncContextManager[Read]]]] = {
    _BARE: _bare,
    "compax_aio, one task": _in_turn,
    "compax_aio, a task for each axis": _in_tasks,
}
"""By name, what opens a URL and gives a :data:`Read`."""


@dataclass(slots=True)
class Rounds:
    """What one client has done on one line, round by round."""

    reads_per_s: list[float] = field(default_factory=list)
    cpu_s_per_read: list[float] = field(default_factory=list)

    async def add(self, read: Read, round_s: float) -> None:
        """Measure one more round."""
        begun_at, cpu = time.perf_counter(), time.process_time()
        count = await read(begun_at + round_s)
        self.reads_per_s.append(count / (time.perf_counter() - begun_at))
        self.cpu_s_per_read.append((time.process_time() - cpu) / count)


Measured = Mapping[tuple[str, str], Rounds]
"""By line and client."""


async def measure(rounds: int, round_s: float) -> Measured:
    """Let every client read on each kind of line, in turn."""
    async with AsyncExitStack() as stack:
        urls = await stack.enter_async_context(far_end(len(CLIENTS)))
        readers = {
            (line, client): await stack.enter_async_context(CLIENTS[client](url))
            for line, of_line in urls.items()
            for client, url in zip(CLIENTS, of_line, strict=True)
        }
        measured = {key: Rounds() for key in readers}
        for number in range(rounds):
            print(f"round {number + 1} of {rounds} …", file=sys.stderr)
            for key, read in readers.items():
                await measured[key].add(read, round_s)
    return measured


def ratios(measured: Measured, line: str, client: str) -> Mapping[str, float]:
    """Return the medians of one client on one line, and how they compare."""
    mine, bare = measured[line, client], measured[line, _BARE]
    reads, cpu = median(mine.reads_per_s), median(mine.cpu_s_per_read)
    return {
        "reads_per_s": reads,
        "of_limit": reads * floor_s(),
        "of_bare": reads / median(bare.reads_per_s),
        "cpu_ms_per_read": 1000 * cpu,
        "cpu_of_bare": cpu / median(bare.cpu_s_per_read),
    }


def rows(measured: Measured) -> list[Sequence[str]]:
    """Fill the table, beginning each line with what its bytes and firmware allow."""
    filled: list[Sequence[str]] = []
    for line in dict.fromkeys(line for line, _ in measured):
        filled.append([line, "(limit)", f"{1 / floor_s():.1f}", "1.000", "", "", ""])
        for client in CLIENTS:
            told = ratios(measured, line, client)
            compared = f"{told['of_limit']:.3f}", f"{told['of_bare']:.3f}"
            cpu = f"{told['cpu_ms_per_read']:.2f}", f"{told['cpu_of_bare']:.2f}"
            filled.append([line, client, f"{told['reads_per_s']:.1f}", *compared, *cpu])
    return filled


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, print a table and the same as JSON, and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("--rounds", type=int, default=7, help="how often each is measured (7)")
    parser.add_argument("--round-s", type=float, default=2.0, help="how long, in seconds (2)")
    options = parser.parse_args(argv)
    logging.disable(logging.CRITICAL)
    measured = asyncio.run(measure(options.rounds, options.round_s))
    conditions = {
        "python": platform.python_version(),
        "system": platform.system(),
        "cores": os.cpu_count(),
        "rounds": options.rounds,
        "round_s": options.round_s,
        "limit_reads_per_s": 1 / floor_s(),
    }
    print(f"python {conditions['python']}, {conditions['system']}, {conditions['cores']} cores", end="\n\n")
    print(table(HEAD, rows(measured)), end="\n\n")
    found = [{"line": line, "client": client, **ratios(measured, line, client)} for line, client in measured]
    print(json.dumps({**conditions, "measured": found}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
