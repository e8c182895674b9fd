"""Lines that are polled: many drives connected at once, or bare protocols, each asked again as soon as it answers."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from functools import partial
from random import Random
from statistics import quantiles
from typing import Any, Final, Self

import compax_aio
from compax_aio import Drive, DriveSettings
from compax_aio.transports import TransportURL, open_transport

from .far_ends.paced import EXCHANGE_S
from .measuring.floor import Bare

__all__ = ["PATIENT", "Ask", "FarUsage", "Polled", "bare_lines", "drives", "percentile", "poll", "room_for"]

PATIENT: Final = DriveSettings(answer_timeout_s=10.0)
"""What it costs is the same; and that a machine which has other things to do is slow is no trouble of a line."""

_SPARE_DESCRIPTORS: Final = 256

Ask = Callable[[], Awaitable[object]]
"""Reads a position once."""


def room_for(lines: int) -> None:
    """Let this process, and those it starts, have so many lines open; as many as it may, if that is less."""
    try:
        import resource  # noqa: PLC0415 - Windows has none, and needs none
    except ImportError:
        return
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = 2 * lines + _SPARE_DESCRIPTORS
    if soft < wanted and hard != soft:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted if hard < 0 else min(wanted, hard), hard))


@asynccontextmanager
async def drives(urls: Sequence[str], settings: DriveSettings | None = PATIENT) -> AsyncIterator[list[Drive]]:
    """Connect to all at once, and close all; if one cannot be connected to, the others are closed, too."""
    names = (f"drive {number}" for number in range(len(urls)))
    connecting = (_connect(url, name, settings) for url, name in zip(urls, names, strict=True))
    made = await asyncio.gather(*connecting, return_exceptions=True)
    connected = [each for each in made if isinstance(each, Drive)]
    try:
        for each in made:
            if isinstance(each, BaseException):
                raise each
        yield connected
    finally:
        await asyncio.gather(*(drive.close() for drive in connected))


async def _connect(url: str, name: str, settings: DriveSettings | None) -> Drive:
    return await compax_aio.connect(url, name=name, settings=settings)


@asynccontextmanager
async def bare_lines(urls: Sequence[str]) -> AsyncIterator[list[Bare]]:
    """Open the same lines for the floor, one after the other."""
    lines: list[Bare] = []
    try:
        for url in urls:
            lines.append(line := Bare())
            await open_transport(TransportURL.parse(url), partial(_itself, line))
        yield lines
    finally:
        for line in lines:
            if line.transport is not None:
                line.transport.close()


def _itself(line: Bare) -> Bare:
    return line


def percentile(values: Sequence[float], of_100: float) -> float:
    """Return what so many of a hundred values do not exceed; all of them, where there are too few to tell."""
    if len(values) < 2:
        return values[0]
    return max(values) if of_100 >= 100 else quantiles(values, n=1000, method="inclusive")[round(10 * of_100) - 1]


@dataclass(frozen=True, slots=True)
class FarUsage:
    """
    What a paced far end did in a while.

    Attributes:
        at_work: The share of the time in which it had anything to do; waiting for a core counts, too.
        late_s: How much later than due it released what it had to, by percentile: ``p50``, ``p99``, ``max``.
    """

    at_work: float
    late_s: dict[str, float]

    @classmethod
    def between(cls, before: dict[str, float], after: dict[str, Any]) -> Self:
        """Compare two answers to ``usage``."""
        idle_s = after["idle_s"] - before["idle_s"]
        late_s = {name: us / 1e6 for name, us in after["late_us"].items() if name != "count"}
        return cls(1 - idle_s / (after["at_s"] - before["at_s"]), late_s)


@dataclass(slots=True)
class Polled:
    """
    What a while of polling has given.

    Attributes:
        shares: Of each line, its share of what the wire allows.
        times_s: Of all exchanges: from being asked to the caller running again.
    """

    wall_s: float = 0.0
    cpu_s: float = 0.0
    shares: list[float] = field(default_factory=list)
    times_s: list[float] = field(default_factory=list)

    @property
    def exchanges(self) -> int:
        """How many there were, on all lines."""
        return len(self.times_s)

    @property
    def share(self) -> float:
        """The mean of all lines: what all of them read, of what the wires allow."""
        return sum(self.shares) / len(self.shares)

    @property
    def cpu_s_per_exchange(self) -> float:
        """What one exchange costs this process, everything that happens meanwhile included."""
        return self.cpu_s / self.exchanges


async def poll(asks: Sequence[Ask], for_s: float, *, seed: int = 0) -> Polled:
    """Ask on all lines for so long, each beginning at some time of its first exchange, as independent tasks would."""
    polled, random = Polled(), Random(seed)
    loop = asyncio.get_running_loop()
    begun_at, cpu_s = time.monotonic(), time.process_time()
    until = begun_at + for_s
    tasks = [loop.create_task(_poll(ask, random.random() * EXCHANGE_S, until, polled)) for ask in asks]
    await asyncio.gather(*tasks)
    polled.wall_s, polled.cpu_s = time.monotonic() - begun_at, time.process_time() - cpu_s
    return polled


async def _poll(ask: Ask, begins_after_s: float, until: float, polled: Polled) -> None:
    await asyncio.sleep(begins_after_s)
    note, clock, count = polled.times_s.append, time.monotonic, 0
    first_at = asked_at = clock()
    while asked_at < until:
        await ask()
        count += 1
        now = clock()
        note(now - asked_at)
        asked_at = now
    if count:
        polled.shares.append(count * EXCHANGE_S / (asked_at - first_at))
