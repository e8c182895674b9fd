"""
How many 9600-baud drives does one core serve at the speed of their wires? 1, 10, 100 and 1,000 are polled at once.

A thousand drives are connected, as many bare protocols beside them; so many of either are polled back to back, in
turn. All run in this one thread, the far end in a process on another core. Times of exchanges are from a caller's
asking to its running again, so they hold what the wire takes.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Final

from ..far_ends.paced import EXCHANGE_S, MODULE
from ..measuring import (
    LOOPS,
    Effort,
    FarEnd,
    Figure,
    Measured,
    Results,
    Row,
    at_least,
    far_end,
    interleaved_async,
)
from ..polling import Ask, FarUsage, bare_lines, drives, percentile, poll, room_for

__all__ = ["AT_SPEED", "Found", "full_speed_lines", "measure"]

FLOOR: Final = "floor"
OURS: Final = "drives"
AT_SPEED: Final = 0.98
"""Of what the wires allow: from there on lines count as read at full speed."""

_TARGET_LINES: Final = 1000
_STEP: Final = 25
_TARGET_LOOP: Final = "uvloop"

_SHARE: Final = "% of the wires"
_SLOWEST: Final = "% of the fastest"
_CPU_US: Final = "CPU µs"
_CORE: Final = "% of a core"
_FAR_BUSY: Final = "% of its time"
_MS: Final = "ms"
_P99: Final = "p99 ms"
_PERCENTILES: Final[Mapping[str, float]] = {"p50 ms": 50, _P99: 99, "p99.9 ms": 99.9, "longest ms": 100}


async def _a_round(far: FarEnd, asks: Sequence[Ask], round_s: float) -> Measured:
    """Poll all of them; what the far end did meanwhile is asked before and after."""
    before = far.ask("usage")
    polled = await poll(asks, round_s)
    usage = FarUsage.between(before, far.ask("usage"))
    return {
        _SHARE: 100 * polled.share,
        _SLOWEST: 100 * min(polled.shares) / max(polled.shares),
        _CPU_US: 1e6 * polled.cpu_s_per_exchange,
        _CORE: 100 * polled.cpu_s / polled.wall_s,
        _FAR_BUSY: 100 * usage.at_work,
        "far end late p99": 1000 * usage.late_s["p99"],
        **{name: 1000 * percentile(polled.times_s, of_100) for name, of_100 in _PERCENTILES.items()},
    }


@dataclass(slots=True)
class Found:
    """What one event loop did."""

    loop: str
    counts: Sequence[int]
    results: Results = field(default_factory=Results)
    connecting_s: float = 0.0
    connecting_cpu_s: float = 0.0
    full_speed: Mapping[str, int] = field(default_factory=dict)
    """By who polls, so many lines were read at full speed."""


async def full_speed_lines(asks: Sequence[Ask], for_s: float, *, step: int = _STEP) -> int:
    """Halve what lies between enough and too many until they are *step* apart; return the most that were enough."""
    if await _are_at_speed(asks, for_s):
        return len(asks)
    enough, too_many = 0, len(asks)
    while too_many - enough > step:
        tried = enough + max(1, (too_many - enough) // 2 // step) * step
        if await _are_at_speed(asks[:tried], for_s):
            enough = tried
        else:
            too_many = tried
    return enough


async def _are_at_speed(asks: Sequence[Ask], for_s: float) -> bool:
    """Poll all of them; a second time, if something else may have been in the way."""
    for seed in range(2):
        if (await poll(asks, for_s, seed=seed)).share >= AT_SPEED:
            return True
    return False


async def _measure(effort: Effort, far: FarEnd, loop: str, counts: Sequence[int], probe_s: float) -> Found:
    found, urls = Found(loop, counts), far.where["tcp"]
    began_at, cpu_s = time.monotonic(), time.process_time()
    async with drives(urls) as ours:
        found.connecting_s, found.connecting_cpu_s = time.monotonic() - began_at, time.process_time() - cpu_s
        async with bare_lines(urls) as bare:
            of: Mapping[str, Sequence[Ask]] = {
                FLOOR: [line.ask for line in bare],
                OURS: [drive.position for drive in ours],
            }
            candidates: dict[str, Callable[[], Awaitable[Measured]]] = {
                f"{who} {count}": partial(_a_round, far, asks[:count], effort.round_s)
                for count in counts
                for who, asks in of.items()
            }
            found.results = await interleaved_async(effort, candidates)
            found.full_speed = {who: await full_speed_lines(asks, probe_s) for who, asks in of.items()}
    return found


def _row(found: Found, count: int, who: str, quantity: str, *, note: str = "") -> Row:
    mine, floor = f"{who} {count}", f"{FLOOR} {count}"
    return Row(
        name=f"{count:,} line{'s' * (count > 1)}: {who}",
        value=found.results.median(mine, quantity),
        unit=quantity,
        ratio=found.results.ratio(mine, floor, quantity),
        spread=found.results.spread(mine, quantity),
        note=note,
    )


def _rows(found: Found, count: int, who: str) -> Iterator[Row]:
    """Tell of so many lines: their share of the wires, the CPU, and how long exchanges took."""
    times = ", ".join(
        f"{name.removesuffix(' ms')} {found.results.median(f'{who} {count}', name):.1f}" for name in _PERCENTILES
    )
    yield _row(found, count, who, _SHARE, note=f"{times} ms")
    yield _row(found, count, who, _CPU_US, note="an exchange")
    yield _row(found, count, who, _CORE)
    yield _row(found, count, who, _P99)


def _speed(found: Found) -> Figure:
    most = found.counts[-1]
    mine = f"{OURS} {most}"
    rows = [row for count in found.counts for who in (FLOOR, OURS) for row in _rows(found, count, who)]
    busy = max(found.results.median(each, _FAR_BUSY) for each in found.results.values)
    late = max(found.results.median(each, "far end late p99") for each in found.results.values)
    return Figure(
        name=f"{most:,} lines at once, {found.loop}",
        value=found.results.median(mine, _SHARE),
        unit=_SHARE,
        target=at_least(100 * AT_SPEED) if found.loop == _TARGET_LOOP else None,
        spread=found.results.spread(mine, _SHARE),
        ratio_of="the floor",
        rows=rows,
        notes=[
            f"a line at full speed reads {1 / EXCHANGE_S:.1f} times a second: {1000 * EXCHANGE_S:.2f} ms each",
            f"the far end was at work for {busy:.0f} % of the time at most, and 99 of 100 answers were at most "
            f"{late:.2f} ms late; both in the worst case of these, and waiting for a core counts",
        ],
    )


def _capacity(found: Found) -> Figure:
    """Tell how many were read at full speed, and for how many the CPU time of one core would have been enough."""
    most = found.counts[-1]

    def by_cpu(who: str) -> Row:
        cpu_us = found.results.median(f"{who} {most}", _CPU_US)
        return Row(name=f"{who}: enough CPU time for", value=1e6 * EXCHANGE_S / cpu_us, unit="lines")

    floor, ours = found.full_speed[FLOOR], found.full_speed[OURS]
    return Figure(
        name=f"drives at full speed on one core, {found.loop}",
        value=ours,
        unit="lines",
        target=at_least(_TARGET_LINES) if found.loop == _TARGET_LOOP else None,
        rows=[Row(name="floor: at full speed", value=floor, unit="lines"), by_cpu(FLOOR), by_cpu(OURS)],
        notes=[
            f"found by halving, of {most:,} in steps of {_STEP}; full speed is {AT_SPEED:.0%} of what wires allow",
            f"what one core's CPU time is enough for is reckoned from what an exchange cost with {most:,} lines",
        ],
    )


def _fairness(found: Found) -> Figure:
    most = found.counts[-1]
    mine = f"{OURS} {most}"
    return Figure(
        name=f"slowest line beside the fastest, {most:,} at once, {found.loop}",
        value=found.results.median(mine, _SLOWEST),
        unit=_SLOWEST,
        spread=found.results.spread(mine, _SLOWEST),
        ratio_of="the floor",
        rows=[_row(found, count, who, _SLOWEST) for count in found.counts for who in (FLOOR, OURS)],
    )


def _connecting(found: Found) -> Figure:
    most = found.counts[-1]
    return Figure(
        name=f"connecting {most:,} drives at once, {found.loop}",
        value=found.connecting_s,
        unit="s",
        rows=[Row(name="CPU, a drive", value=1000 * found.connecting_cpu_s / most, unit=_MS)],
        notes=["a connect is a marker, S31 to S39, S18, S17, S16, P20: so many exchanges on a paced line"],
    )


def measure(effort: Effort, loops: Mapping[str, Callable[[], asyncio.AbstractEventLoop]] = LOOPS) -> Sequence[Figure]:
    """Measure on each event loop; the target is that of uvloop."""
    counts = effort.pick((1, 3), (1, 10, 100, 1000), (1, 10, 100, 1000))
    rounds = replace(effort, rounds=effort.pick(1, 2, 7), round_s=effort.pick(0.06, 0.5, 2.0))
    figures = []
    room_for(3 * counts[-1])
    with far_end(MODULE, str(counts[-1])) as far:
        for loop, loop_factory in loops.items():
            with asyncio.Runner(loop_factory=loop_factory) as runner:
                found = runner.run(_measure(rounds, far, loop, counts, effort.pick(0.06, 0.5, 2.0)))
            figures += [_capacity(found), _speed(found), _fairness(found), _connecting(found)]
    return figures
