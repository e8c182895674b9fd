"""
How much of a 9600-baud line do readings back to back get? One line, asked again as soon as its answer has been read.

The far end keeps the time of every byte. What it cannot see, a client's machine that wakes late, is in the floor too: a
bare ``asyncio.Protocol`` on a line of its own, in turn with us.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping, Sequence
from contextlib import AsyncExitStack
from dataclasses import replace
from functools import partial
from typing import Final

from ..far_ends.paced import EXCHANGE_S, MODULE
from ..measuring import LOOPS, Effort, FarEnd, Figure, Measured, Results, Row, at_least, far_end, interleaved_async
from ..polling import Ask, FarUsage, bare_lines, drives, percentile, poll

__all__ = ["FLOOR", "OURS", "WAYS", "measure"]

FLOOR: Final = "floor: bare asyncio.Protocol"
OURS: Final = "drive.position()"
WAYS: Final = ("TCP", "TCP, byte by byte", "pty")
"""How the answer comes."""

_TARGET: Final = at_least(98)
_SHARE: Final = "% of the wire"
_P50: Final = "p50 ms"
_P99: Final = "p99 ms"


async def _a_round(ask: Ask, round_s: float) -> Measured:
    polled = await poll([ask], round_s)
    return {
        _SHARE: 100 * polled.share,
        _P50: 1000 * percentile(polled.times_s, 50),
        _P99: 1000 * percentile(polled.times_s, 99),
    }


async def _measure(effort: Effort, urls: Mapping[str, Sequence[str]]) -> Results:
    """Let the floor and a drive ask on lines of each kind, in turn."""
    candidates: dict[str, Callable[[], Awaitable[Measured]]] = {}
    async with AsyncExitStack() as stack:
        for way, (for_floor, for_us) in urls.items():
            (bare,) = await stack.enter_async_context(bare_lines([for_floor]))
            (drive,) = await stack.enter_async_context(drives([for_us]))
            candidates[f"{FLOOR}, {way}"] = partial(_a_round, bare.ask, effort.round_s)
            candidates[f"{OURS}, {way}"] = partial(_a_round, drive.position, effort.round_s)
        return await interleaved_async(effort, candidates)


def _figure(loop: str, way: str, results: Results, usage: FarUsage) -> Figure:
    rows = []
    for name in (FLOOR, OURS):
        who = f"{name}, {way}"
        median_ms, late_us = results.median(who, _P50), 1e6 * usage.late_s["p99"]
        rows.append(
            Row(
                name=name,
                value=results.median(who, _SHARE),
                unit=_SHARE,
                ratio=results.ratio(who, f"{FLOOR}, {way}", _SHARE),
                spread=results.spread(who, _SHARE),
                note=f"p50 {median_ms:.2f}, p99 {results.median(who, _P99):.2f} ms; wire {1000 * EXCHANGE_S:.2f} ms",
            )
        )
    ours = f"{OURS}, {way}"
    return Figure(
        name=f"one line back to back, {way}, {loop}",
        value=results.median(ours, _SHARE),
        unit=_SHARE,
        target=_TARGET,
        spread=results.spread(ours, _SHARE),
        ratio_of="the floor",
        rows=rows,
        notes=[f"99 of 100 answers were released at most {late_us:.0f} µs late; that, too, counts as lost"],
    )


def _urls(whole: FarEnd, by_byte: FarEnd) -> Mapping[str, Sequence[str]]:
    return dict(zip(WAYS, (whole.where["tcp"], by_byte.where["tcp"], whole.where["pty"]), strict=True))


def measure(effort: Effort, loops: Mapping[str, Callable[[], asyncio.AbstractEventLoop]] = LOOPS) -> Sequence[Figure]:
    """Measure on TCP, with answers whole and byte by byte, and on a pseudo-terminal, on each event loop."""
    ours = replace(effort, rounds=effort.pick(1, 3, 7), round_s=effort.pick(0.05, 0.6, 2.0))
    figures = []
    with far_end(MODULE, "2", "--ptys", "2") as whole, far_end(MODULE, "2", "--by-byte") as by_byte:
        for loop, loop_factory in loops.items():
            far_ends = {way: by_byte if "byte" in way else whole for way in WAYS}
            before = {way: far.ask("usage") for way, far in far_ends.items()}
            with asyncio.Runner(loop_factory=loop_factory) as runner:
                results = runner.run(_measure(ours, _urls(whole, by_byte)))
            after = {id(far): far.ask("usage") for far in (whole, by_byte)}
            figures += [
                _figure(loop, way, results, FarUsage.between(before[way], after[id(far)]))
                for way, far in far_ends.items()
            ]
    return figures
