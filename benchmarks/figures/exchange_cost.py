"""
What ``await drive.position()`` costs, beside a bare ``asyncio.Protocol`` that knows nothing of time-outs and errors.

All clients are open at once, each on a line of its own, and ask in turn, round by round. Costs are CPU times of this
process; the far end is another one, and it is measured, too.
"""

from __future__ import annotations

import asyncio
import socket
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from functools import partial
from typing import Final

import serial_asyncio

import compax_aio
from compax_aio.compax.protocol import CompaxProtocol
from compax_aio.link.contract import Lane
from compax_aio.link.link import Link
from compax_aio.transports import TransportURL, open_transport

from ..far_ends.canned import HOST
from ..measuring import LOOPS, Effort, FarEnd, Figure, Measured, Results, Row, at_most, far_end, interleaved_async
from ..measuring.exchanges import CPU_US, WALL_US, a_round_async
from ..measuring.floor import LINE, PROMPT, Bare, Least

__all__ = ["FLOOR", "MEDIA", "OURS", "measure"]

FLOOR: Final = "floor: bare asyncio.Protocol"
PYSERIAL_FLOOR: Final = "the same on pyserial-asyncio's own transport"
LEAST: Final = "the least: a turn, a time-out, the right answer, a number"
LINK: Final = "Link.exchange()"
QUERY: Final = "drive.query()"
OURS: Final = "drive.position()"

MEDIA: Final = ("TCP", "pty")

_TARGET: Final = at_most(1.5)
_CAPACITY_LINES: Final = 8

Ask = Callable[[], Awaitable[object]]


@asynccontextmanager
async def _bare(url: str) -> AsyncIterator[Ask]:
    protocol = Bare()
    transport = await open_transport(TransportURL.parse(url), lambda: protocol)
    try:
        yield protocol.ask
    finally:
        transport.close()


@asynccontextmanager
async def _least(url: str) -> AsyncIterator[Ask]:
    protocol = Least()
    transport = await open_transport(TransportURL.parse(url), lambda: protocol)
    try:
        yield protocol.position
    finally:
        transport.close()


@asynccontextmanager
async def _bare_on_pyserial(url: str) -> AsyncIterator[Ask]:
    path = TransportURL.parse(url).path
    loop = asyncio.get_running_loop()
    transport, protocol = await serial_asyncio.create_serial_connection(loop, Bare, path, baudrate=9600)
    try:
        yield protocol.ask
    finally:
        transport.close()


@asynccontextmanager
async def _link(url: str) -> AsyncIterator[Ask]:
    link = Link(
        CompaxProtocol(),
        name="link",
        answer_timeout_s=1.0,
        resync_attempts=3,
        on_event=lambda _: None,
        on_lost=lambda _: None,
    )
    await link.open(url)
    try:
        yield partial(link.exchange, "S1", Lane.READ)
    finally:
        await link.close()


@asynccontextmanager
async def _query(url: str) -> AsyncIterator[Ask]:
    async with compax_aio.connect(url) as drive:
        yield partial(drive.query, "S1")


@asynccontextmanager
async def _position(url: str) -> AsyncIterator[Ask]:
    async with compax_aio.connect(url) as drive:
        yield drive.position


_STEPS: Final = {FLOOR: _bare, LEAST: _least, LINK: _link, QUERY: _query, OURS: _position}
_ON: Final = {"TCP": _STEPS, "pty": {FLOOR: _bare, PYSERIAL_FLOOR: _bare_on_pyserial, **_STEPS}}


def urls_of(far: FarEnd, medium: str) -> Sequence[str]:
    """Name lines of *medium*, one for each step at least."""
    if medium == "pty":
        return [f"serial://{path}" for path in far.where["pty"]]
    return [f"tcp://{HOST}:{far.where['tcp']}"] * len(_ON[medium])


async def _measure(effort: Effort, far: FarEnd, medium: str) -> tuple[Results, float]:
    """Return what all rounds gave, and the share of the time in which the far end was busy."""
    async with AsyncExitStack() as stack:
        candidates: dict[str, Callable[[], Awaitable[Measured]]] = {}
        for (name, open_it), url in zip(_ON[medium].items(), urls_of(far, medium), strict=False):
            ask = await stack.enter_async_context(open_it(url))
            candidates[name] = partial(a_round_async, ask, effort.round_s)
        wall, cpu = time.perf_counter(), far.cpu_s
        results = await interleaved_async(effort, candidates)
        return results, (far.cpu_s - cpu) / (time.perf_counter() - wall)


def _figure(loop: str, medium: str, results: Results, far_busy: float) -> Figure:
    rows = [
        Row(
            name=step,
            value=results.median(step, CPU_US),
            unit=CPU_US,
            ratio=results.ratio(step, FLOOR, CPU_US),
            spread=results.spread(step, CPU_US),
            note=f"{results.median(step, WALL_US):.0f} µs on the wall, {results.ratio(step, FLOOR, WALL_US):.2f} times",
        )
        for step in _ON[medium]
    ]
    return Figure(
        name=f"await drive.position() on {medium}, {loop}",
        value=results.ratio(OURS, FLOOR, CPU_US),
        unit="times the floor's CPU",
        target=_TARGET,
        spread=results.ratio_spread(OURS, FLOOR, CPU_US),
        ratio_of="the floor",
        rows=rows,
        notes=[f"the far end was busy for {far_busy:.0%} of the time: it waits for who asks, not they for it"],
    )


def _capacity(effort: Effort, far: FarEnd) -> Figure:
    """How many exchanges the far end serves to a client that blocks and does nothing else, on several lines at once."""
    lines = [socket.create_connection((HOST, far.where["tcp"])) for _ in range(_CAPACITY_LINES)]
    try:
        count, wall, cpu, own = 0, time.perf_counter(), far.cpu_s, time.process_time()
        until = time.perf_counter() + effort.round_s * effort.rounds
        while time.perf_counter() < until:
            for line in lines:
                line.sendall(LINE)
            for line in lines:
                while not line.recv(64).endswith(PROMPT):
                    pass
            count += len(lines)
        took_s, far_s, own_s = time.perf_counter() - wall, far.cpu_s - cpu, time.process_time() - own
    finally:
        for line in lines:
            line.close()
    return Figure(
        name=f"far end alone, on TCP, {far.where['loop']}",
        value=count / took_s,
        unit="exchanges/s",
        rows=[
            Row(name="its CPU", value=1e6 * far_s / count, unit=CPU_US),
            Row(name="its own limit", value=count / far_s, unit="exchanges/s"),
            Row(name=f"a client that blocks, {len(lines)} lines at once", value=1e6 * own_s / count, unit=CPU_US),
        ],
    )


def measure(effort: Effort, loops: Mapping[str, Callable[[], asyncio.AbstractEventLoop]] = LOOPS) -> Sequence[Figure]:
    """Measure on TCP and on a pseudo-terminal, with asyncio's own event loop and with uvloop where it is installed."""
    figures = []
    with far_end("benchmarks.far_ends.canned", str(len(_ON["pty"]))) as far:
        figures.append(_capacity(effort, far))
        for loop, loop_factory in loops.items():
            for medium in MEDIA:
                with asyncio.Runner(loop_factory=loop_factory) as runner:
                    results, far_busy = runner.run(_measure(effort, far, medium))
                figures.append(_figure(loop, medium, results, far_busy))
    return figures
