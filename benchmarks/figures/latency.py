"""
How late is ``$`` told, and how soon is a stop on the wire? With 64 drives polled back to back, in one event loop.

Both are measured from the far end's own times, on the clock that all processes of the machine share (CLOCK_MONOTONIC):

- ``$``: from just before the far end writes it, until the task that awaits the move runs. So it holds the far end's
  system call, the kernel's loopback, and everything on this side.
- stop: from ``stop()`` being called to the kernel's having taken the last byte of STOP in at the far end; and what of
  it came after the exchange in flight, that is after the far end began to write the answer before it. A thousand reads
  of a thousand names are queued on that drive all the while, for equal reads would share one exchange.

Meanwhile nobody else, or 64 drives are polled, or these and a neighbour whose line has stalled: it was connected, then
reads and says nothing any more, and is asked, times out, is tried again and asked again all the while. What the machine
alone makes late shows in the floor: bare protocols, 64 of them polled, and eight that wait for ``$``.
"""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections import defaultdict
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from random import Random
from typing import Any, Final

import compax_aio
from compax_aio import CompaxError, Drive, DriveSettings
from compax_aio.transports import TransportURL, open_transport

from ..far_ends.paced import EXCHANGE_S, MODULE
from ..measuring import LOOPS, Effort, FarEnd, Figure, Row, at_most, far_end
from ..polling import bare_lines, drives, percentile, room_for

__all__ = ["CIRCUMSTANCES", "Found", "after_exchange", "measure", "pair"]

ALONE: Final = "nobody else"
POLLED: Final = "64 polled"
STALLED: Final = "64 polled, a neighbour stalled"
FLOOR: Final = "floor: bare protocols, 64 polled"
CIRCUMSTANCES: Final = (ALONE, POLLED, STALLED)

_DRIVES: Final = 64
_MESSAGE_TARGET: Final = at_most(1.0)
_STOP_TARGET: Final = at_most(2.0, "≤ the exchange in flight + 2 ms")
_QUEUED: Final = 1000
_MOVERS: Final = 8
"""So many drives move at a time, and so many have reads queued and are stopped."""
_PAUSE_S: Final = (0.01, 0.05)
_PERCENTILES: Final[Mapping[str, float]] = {"p50": 50, "p99": 99, "longest": 100}

Event = tuple[int, float]
"""On which line, and when."""


@dataclass(slots=True)
class Found:
    """Latencies in seconds, by circumstance."""

    messages_s: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    stops_s: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    """From being called to the last byte."""
    after_exchange_s: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    """From the end of the exchange in flight, if there was one, to the last byte."""


def pair(here: Sequence[Event], there: Sequence[Sequence[float]]) -> list[tuple[float, Sequence[float]]]:
    """
    Match what happened on this side with what the far end tells, on each line one after the other.

    Raises:
        RuntimeError: On some line there are more or fewer: then nobody knows which belongs to which.
    """
    by_line: dict[int, list[Sequence[float]]] = defaultdict(list)
    for line, *times in there:
        by_line[int(line)].append(times)
    matched = []
    for line, at in here:
        if not by_line[line]:
            raise RuntimeError(f"line {line} has seen more of them than its far end")
        matched.append((at, by_line[line].pop(0)))
    if rest := {line for line, left in by_line.items() if left}:
        raise RuntimeError(f"the far ends of lines {sorted(rest)} have seen more of them than there were here")
    return matched


# Circumstances ------------------------------------------------------------------------------------------------------


async def _keep(ask: Callable[[], Awaitable[object]], wait_s: float) -> None:
    """Ask again and again, beginning some time later: whoever polls must not be in step with the others."""
    await asyncio.sleep(wait_s)
    while True:
        await ask()


async def _keep_trying(drive: Drive) -> None:
    while True:
        await asyncio.gather(drive.position(), drive.query("P1"), drive.command("SD50"), return_exceptions=True)
        await asyncio.sleep(0.001)


@asynccontextmanager
async def _all_the_while(*awaitables: Awaitable[None]) -> AsyncIterator[None]:
    tasks = [asyncio.ensure_future(each) for each in awaitables]
    try:
        yield
    finally:
        for task in tasks:
            task.cancel()
        if tasks:
            await asyncio.wait(tasks)
        for task in tasks:
            if not task.cancelled():
                task.result()  # it should have gone on for ever: whatever ended it is worth knowing


@asynccontextmanager
async def _stalled_neighbour(far: FarEnd, line: int) -> AsyncIterator[None]:
    """Connect to one more drive, let its line stall, and have somebody ask it all the while."""
    impatient = DriveSettings(answer_timeout_s=0.5, reconnect_first_s=0.05, reconnect_slowest_s=0.2, stop_timeout_s=1)
    drive = await compax_aio.connect(far.where["tcp"][line], name="the neighbour", settings=impatient)
    try:
        far.ask(f"stall {line}")
        async with _all_the_while(_keep_trying(drive)):
            yield
    finally:
        with contextlib.suppress(CompaxError):
            await drive.close()
        far.ask(f"mend {line}")


@asynccontextmanager
async def _circumstance(name: str, far: FarEnd, polled: Sequence[Drive]) -> AsyncIterator[None]:
    async with AsyncExitStack() as stack:
        if name == STALLED:
            await stack.enter_async_context(_stalled_neighbour(far, len(polled)))
        if name != ALONE:
            random = Random(64)
            keeping = (_keep(drive.position, random.random() * EXCHANGE_S) for drive in polled)
            await stack.enter_async_context(_all_the_while(*keeping))
        yield


# Messages -----------------------------------------------------------------------------------------------------------


async def _move_in_turn(numbered: Sequence[tuple[int, Drive]], until: float, reached: list[Event]) -> None:
    """Move these drives, one after the other; a far end says ``$`` some time after it has acknowledged the move."""
    target = 0.0
    while True:
        target += 1.0
        for line, drive in numbered:
            result = await drive.move_to(target % 100)
            reached.append((line, time.monotonic()))
            if result.confirmed_by != "message":
                raise RuntimeError(f"{drive.name} has confirmed a move by its {result.confirmed_by}, not by $")
            if time.monotonic() >= until:
                return


async def _measure_messages(far: FarEnd, moved: Sequence[Drive], round_s: float) -> list[float]:
    far.ask("happened")
    until, reached = time.monotonic() + round_s, list[Event]()
    numbered = list(enumerate(moved))
    await asyncio.gather(*(_move_in_turn(numbered[mover::_MOVERS], until, reached) for mover in range(_MOVERS)))
    return [woken_at - sent_at for woken_at, (sent_at,) in pair(reached, far.ask("happened")["messages"])]


class _BareMover(asyncio.Protocol):
    """Starts moves, and waits for ``$``."""

    def __init__(self) -> None:
        self.transport: Any = None
        self._reached: asyncio.Future[None] | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport = transport

    def move(self) -> asyncio.Future[None]:
        """Start one; the future is done at its ``$``."""
        self._reached = asyncio.get_running_loop().create_future()
        self.transport.write(b"PA1$\r")
        return self._reached

    def data_received(self, data: bytes) -> None:
        if b"$" in data and self._reached is not None:
            self._reached.set_result(None)


async def _keep_moving(line: int, mover: _BareMover, until: float, reached: list[Event]) -> None:
    while True:
        await mover.move()
        reached.append((line, time.monotonic()))
        if time.monotonic() >= until:
            return


async def _measure_floor(far: FarEnd, lines: int, round_s: float) -> list[float]:
    """Poll bare protocols, and let others of them wait for ``$`` on the lines behind the neighbour."""
    urls, movers = far.where["tcp"], list[_BareMover]()
    async with AsyncExitStack() as stack:
        for url in urls[lines + 1 :]:
            movers.append(mover := _BareMover())
            transport = await open_transport(TransportURL.parse(url), lambda mover=mover: mover)  # type: ignore[misc]
            stack.callback(transport.close)
        bare = await stack.enter_async_context(bare_lines(urls[:lines]))
        random = Random(64)
        keeping = (_keep(line.ask, random.random() * EXCHANGE_S) for line in bare)
        await stack.enter_async_context(_all_the_while(*keeping))
        far.ask("happened")
        until, reached = time.monotonic() + round_s, list[Event]()
        await asyncio.gather(
            *(_keep_moving(lines + 1 + number, each, until, reached) for number, each in enumerate(movers))
        )
        return [woken_at - sent_at for woken_at, (sent_at,) in pair(reached, far.ask("happened")["messages"])]


# Stops --------------------------------------------------------------------------------------------------------------


def _names() -> list[str]:
    """Name a thousand things that a drive can be asked for; each is an exchange of its own."""
    return [f"{letter}{number:03d}" for letter, number in product("SPVN", range(1, _QUEUED // 4 + 1))]


async def _stop_again_and_again(line: int, drive: Drive, until: float, called: list[Event]) -> None:
    random = Random(line)
    while True:
        await asyncio.sleep(random.uniform(*_PAUSE_S))
        called.append((line, time.monotonic()))
        await drive.stop()
        if time.monotonic() >= until:
            return


def after_exchange(called_at: float, there_at: float, *answered_at: float) -> float:
    """
    Return how long a stop took from the end of the exchange in flight, or from being called if there was none.

    Args:
        called_at: When ``stop()`` was called.
        there_at: When STOP was there.
        answered_at: When the last answers before it were written, oldest first. The first of them behind the call ends
            the exchange that was in flight; should STOP have waited for another one, that counts against it.
    """
    return there_at - next((at for at in answered_at if at > called_at), called_at)


async def _measure_stops(far: FarEnd, stopped: Mapping[int, Drive], round_s: float) -> tuple[list[float], list[float]]:
    far.ask("happened")
    called = list[Event]()
    queued = [_keep(partial(drive.query, name), 0) for drive in stopped.values() for name in _names()]
    async with _all_the_while(*queued):
        until = time.monotonic() + round_s
        await asyncio.gather(*(_stop_again_and_again(*each, until, called) for each in stopped.items()))
    matched = pair(called, far.ask("happened")["stops"])
    return (
        [there_at - called_at for called_at, (there_at, *_) in matched],
        [after_exchange(called_at, *there) for called_at, there in matched],
    )


# All of it ----------------------------------------------------------------------------------------------------------


async def _measure(effort: Effort, far: FarEnd, lines: int) -> Found:
    found = Found()
    async with drives(far.where["tcp"][:lines]) as polled:
        for drive in polled:  # from their first move on it is known how they say $
            await drive.move_to(50)
        stopped = dict(list(enumerate(polled))[:_MOVERS])
        for _ in range(effort.rounds):
            effort.noise.sample()
            found.messages_s[FLOOR] += await _measure_floor(far, lines, effort.round_s)
            for circumstance in CIRCUMSTANCES:
                async with _circumstance(circumstance, far, polled):
                    found.messages_s[circumstance] += await _measure_messages(far, polled, effort.round_s)
                    stops_s, after_exchange_s = await _measure_stops(far, stopped, effort.round_s)
                    found.stops_s[circumstance] += stops_s
                    found.after_exchange_s[circumstance] += after_exchange_s
    return found


def _rows(what: str, latencies_s: Mapping[str, Sequence[float]]) -> list[Row]:
    return [
        Row(
            name=f"{what}, {circumstance}: {name}",
            value=1000 * percentile(of_circumstance, of_100),
            unit="ms",
            note=f"of {len(of_circumstance)}" if name == "p50" else "",
        )
        for circumstance, of_circumstance in latencies_s.items()
        for name, of_100 in _PERCENTILES.items()
    ]


def _figures(loop: str, found: Found) -> list[Figure]:
    def p99_ms(latencies_s: Mapping[str, Sequence[float]], circumstance: str) -> float:
        return 1000 * percentile(latencies_s[circumstance], 99)

    figures = []
    for circumstance in (POLLED, STALLED):
        figures.append(
            Figure(
                name=f"$ to the waiter running, p99, {circumstance}, {loop}",
                value=p99_ms(found.messages_s, circumstance),
                unit="ms",
                target=_MESSAGE_TARGET,
                rows=_rows("$", {each: found.messages_s[each] for each in (circumstance, FLOOR)}),
            )
        )
        figures.append(
            Figure(
                name=f"stop() to its last byte, after the exchange in flight, p99, {circumstance}, {loop}",
                value=p99_ms(found.after_exchange_s, circumstance),
                unit="ms",
                target=_STOP_TARGET,
                rows=[
                    *_rows("after the exchange", {circumstance: found.after_exchange_s[circumstance]}),
                    *_rows("all of it", {circumstance: found.stops_s[circumstance]}),
                ],
                notes=[f"{_QUEUED:,} reads were queued on each drive that was stopped, {_MOVERS} of the {_DRIVES}"],
            )
        )
    alone = [
        *_rows("$", {ALONE: found.messages_s[ALONE]}),
        *_rows("stop, after the exchange", {ALONE: found.after_exchange_s[ALONE]}),
    ]
    figures.append(
        Figure(name=f"the same with nobody else, {loop}", value=p99_ms(found.messages_s, ALONE), unit="ms", rows=alone)
    )
    return figures


def measure(effort: Effort, loops: Mapping[str, Callable[[], asyncio.AbstractEventLoop]] = LOOPS) -> Sequence[Figure]:
    """Measure on each event loop."""
    ours = replace(effort, rounds=effort.pick(1, 2, 8), round_s=effort.pick(0.1, 1.0, 3.0))
    lines = effort.pick(_MOVERS, _DRIVES, _DRIVES)
    room_for(lines)
    figures = []
    with far_end(MODULE, str(lines + 1 + _MOVERS)) as far:
        for loop, loop_factory in loops.items():
            with asyncio.Runner(loop_factory=loop_factory) as runner:
                found = runner.run(_measure(ours, far, lines))
            figures += _figures(loop, found)
    return figures
