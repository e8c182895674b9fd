"""
Instructions and allocations of an exchange: what to look at when the machine is too noisy for times.

Counted by callgrind in a fixed run, twice, with the far end in another process; the kernel's work is not counted, so
ratios to the floor are larger than those of CPU times. Memory is what Python's own tracing tells.
"""

from __future__ import annotations

import asyncio
import gc
import sys
import tracemalloc
from collections.abc import Mapping, Sequence
from statistics import median
from typing import Final

from ..far_ends.canned import HOST
from ..measuring import Effort, Figure, Row, far_end
from ..measuring.callgrind import Counted, count_runs, is_installed
from ..measuring.counted_run import CLIENTS

__all__ = ["measure", "per_exchange"]

_RUN: Final = "benchmarks.measuring.counted_run"
_NAMES: Final = {"floor": "floor: bare asyncio.Protocol", "position": "drive.position()"}


def per_exchange(runs: Sequence[Counted], count: int) -> Mapping[str, tuple[float, float | None]]:
    """
    Return by what was counted what one exchange takes, and how much two measurements of it differ, as a share.

    Args:
        runs: Of *count*, twice as many, *count* and twice as many exchanges: what is once a run is in none of it.
        count: Of exchanges.
    """
    first, second = ((runs[each], runs[each + 1]) for each in (0, 2))
    found: dict[str, tuple[float, float | None]] = {}
    for what in ("instructions", "allocations"):
        values = []
        for shorter, longer in (first, second):
            less, more = getattr(shorter, what), getattr(longer, what)
            if less is not None and more is not None:
                values.append((more - less) / count)
        if len(values) == 2:
            found[what] = values[0], abs(values[1] - values[0]) / values[0]
    return found


def _counted(effort: Effort, port: int) -> Sequence[Figure]:
    count = effort.pick(5, 200, 1000)
    counts = [str(each) for each in (count, 2 * count, count, 2 * count)]
    found = {
        client: per_exchange(count_runs(_RUN, [client, HOST, str(port), *counts]), count)
        for client in ("floor", "position")
    }
    figures = []
    for what in ("instructions", "allocations"):
        if any(what not in each for each in found.values()):
            figures.append(_not_counted(what, "this Python tells no names of its functions"))
            continue
        floor, ours = (found[client][what] for client in ("floor", "position"))
        rows = [
            Row(
                name=_NAMES[client],
                value=value,
                unit=what,
                ratio=value / floor[0],
                note=f"a second count differs by {difference:.2%}",
            )
            for client, (value, difference) in (("floor", floor), ("position", ours))
        ]
        rows.append(Row(name="beyond the floor", value=ours[0] - floor[0], unit=what))
        figures.append(
            Figure(
                name=f"{what} an exchange on TCP, asyncio",
                value=ours[0] / floor[0],
                unit="times the floor's",
                ratio_of="the floor",
                rows=rows,
                notes=["in user space: what the kernel does is the same for all, and not counted"],
            )
        )
    return figures


def _not_counted(what: str, why: str) -> Figure:
    return Figure(name=f"{what} an exchange on TCP, asyncio", value=None, notes=[why])


async def _memory(client: str, port: int, count: int) -> tuple[float, float]:
    """Return how many bytes an exchange holds at most while it lasts, and how many blocks it leaves behind."""
    async with CLIENTS[client](HOST, port) as ask:
        for _ in range(count):  # rings are filled, and what is made only once is made
            await ask()
        gc.collect()
        before = sys.getallocatedblocks()
        for _ in range(count):
            await ask()
        gc.collect()
        kept = (sys.getallocatedblocks() - before) / count
        peaks = []
        tracemalloc.start()
        try:
            for _ in range(count):
                held, _ = tracemalloc.get_traced_memory()
                tracemalloc.reset_peak()
                await ask()
                peaks.append(tracemalloc.get_traced_memory()[1] - held)
        finally:
            tracemalloc.stop()
    return median(peaks), kept


def _held(effort: Effort, port: int) -> Figure:
    count = effort.pick(100, 1000, 5000)
    found = {client: asyncio.run(_memory(client, port, count)) for client in _NAMES}
    return Figure(
        name="memory that an exchange holds while it lasts, beyond the floor",
        value=found["position"][0] - found["floor"][0],
        unit="bytes",
        rows=[
            Row(
                name=_NAMES[client],
                value=peak,
                unit="bytes",
                note=f"leaves {kept:+.3f} blocks behind, over {count:,} exchanges",
            )
            for client, (peak, kept) in found.items()
        ],
        notes=["asyncio's own buffer for what it receives, 256 KiB, is in both"],
    )


def measure(effort: Effort) -> Sequence[Figure]:
    """Count on TCP; with the least effort, or without valgrind, only what Python itself can tell."""
    with far_end("benchmarks.far_ends.canned", "0") as far:
        port = far.where["tcp"]
        held = _held(effort, port)
        if effort.name == "least" or not is_installed():
            why = "valgrind is not installed" if not is_installed() else "not with the least effort"
            return [_not_counted("instructions", why), _not_counted("allocations", why), held]
        return [*_counted(effort, port), held]
