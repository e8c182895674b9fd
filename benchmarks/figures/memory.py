"""
What a drive that is connected and idle takes: how much a process grows from 100 to 1,000 of them.

Each is connected and polled once, in a process of its own for each event loop, so that nothing that was there before is
used again. Growth of the resident set is what the system sees; what Python's allocator was asked for, and by which line
of code, is traced in another process, for tracing takes memory, too. Buffers of the kernel are in neither. A bare
``asyncio.Protocol`` on the same transport is the floor. The far end answers at once: time has no part in it.
"""

from __future__ import annotations

import argparse
import asyncio
import gc
import json
import subprocess
import sys
import tracemalloc
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractAsyncContextManager, AsyncExitStack
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

from ..far_ends.canned import HOST
from ..measuring import LOOPS, Effort, Figure, Row, at_most, far_end
from ..polling import bare_lines, drives, room_for

__all__ = ["DRIVES", "FLOOR", "main", "measure"]

DRIVES: Final = "drives"
FLOOR: Final = "floor"
_WHO: Final[Mapping[str, Callable[[Sequence[str]], AbstractAsyncContextManager[list[Any]]]]] = {
    DRIVES: partial(drives, settings=None),
    FLOOR: bare_lines,
}

_FAR_END: Final = "benchmarks.far_ends.canned"
_TARGET: Final = at_most(16)
_AT_ONCE: Final = 20
"""Connect so many at once: what connecting takes for a while is used again by the next ones."""
_READINGS: Final = 300
"""Fill every ring of a line: of answer times, of the last bytes."""
_BUSY: Final = 200
"""So many of the drives read so often."""
_SHOWN: Final = 12
_KIB: Final = "KiB a drive"
_STATM: Final = Path("/proc/self/statm")
_PACKAGES: Final = ("compax_aio", "asyncio", "uvloop", "benchmarks")


def _resident_bytes() -> int:
    """Ask the system how much of this process is in memory; 0 where it does not say."""
    import resource  # noqa: PLC0415 - not on Windows, where nothing of this runs

    return int(_STATM.read_text().split()[1]) * resource.getpagesize() if _STATM.exists() else 0


def _file_told(filename: str) -> str:
    """Name a file from its package on."""
    parts = Path(filename).parts
    begins = next((parts.index(package) for package in _PACKAGES if package in parts), len(parts) - 1)
    return "/".join(parts[begins:])


def _traced() -> Mapping[str, int]:
    """Return the bytes that are held, by the line of code that asked for them."""
    held: Counter[str] = Counter()
    for statistic in tracemalloc.take_snapshot().statistics("lineno"):
        frame = statistic.traceback[0]
        held[f"{_file_told(frame.filename)}:{frame.lineno}"] += statistic.size
    return held


async def _read(line: Any, times: int) -> None:
    ask = line.ask if hasattr(line, "ask") else line.position
    for _ in range(times):
        await ask()


async def _grow(who: str, url: str, counts: Sequence[int], readings: int) -> Mapping[str, object]:
    """Connect up to each of *counts* in turn; say what the process holds then, and when some have read for a while."""
    held: dict[str, object] = {}
    lines: list[Any] = []
    async with AsyncExitStack() as stack:
        for count in counts:
            while len(lines) < count:
                more = [url] * min(_AT_ONCE, count - len(lines))
                new = await stack.enter_async_context(_WHO[who](more))
                await asyncio.gather(*(_read(line, 1) for line in new))
                lines += new
            held[str(count)] = _held()
        if readings:
            for line in (busy := lines[-_BUSY:]):
                await _read(line, readings)
            held["busy"] = {**_held(), "of": len(busy)}
    return held


def _held() -> Mapping[str, object]:
    gc.collect()
    if tracemalloc.is_tracing():
        return {"traced": tracemalloc.get_traced_memory()[0], "lines": _traced()}
    return {"resident": _resident_bytes()}


def main(argv: Sequence[str] | None = None) -> int:
    """Measure in this process, which does nothing else, and print JSON."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("who", choices=[*_WHO])
    parser.add_argument("loop", choices=[*LOOPS])
    parser.add_argument("url", help="where a far end takes any number of connections")
    parser.add_argument("counts", type=int, nargs="+", help="how many, growing")
    parser.add_argument("--readings", type=int, default=0, help="let each read so often at the end (0)")
    parser.add_argument("--traced", action="store_true", help="say which lines of code have asked for it")
    options = parser.parse_args(argv)
    room_for(options.counts[-1])
    if options.traced:
        tracemalloc.start()
    with asyncio.Runner(loop_factory=LOOPS[options.loop]) as runner:
        print(json.dumps(runner.run(_grow(options.who, options.url, options.counts, options.readings))))
    return 0


# Who measures -------------------------------------------------------------------------------------------------------


def _measured(who: str, loop: str, url: str, counts: Sequence[int], *more: str) -> Mapping[str, Any]:
    """Run :func:`main` in a process of its own."""
    command = [sys.executable, "-m", __name__, who, loop, url, *map(str, counts), *more]
    done = subprocess.run(command, stdout=subprocess.PIPE, check=True, text=True)
    held = json.loads(done.stdout)
    assert isinstance(held, dict)
    return held


def _growth(held: Mapping[str, Any], counts: tuple[int, int], quantity: str) -> float:
    """Return how much it grew a drive, in KiB."""
    first, most = counts
    grown = held[str(most)][quantity] - held[str(first)][quantity]
    return float(grown) / (most - first) / 1024


def _growth_when_busy(held: Mapping[str, Any], most: int) -> float:
    """Return how much those grew that have read for a while, in KiB."""
    busy = held["busy"]
    return float((busy["resident"] - held[str(most)]["resident"]) / busy["of"]) / 1024


def _where(held: Mapping[str, Any], counts: tuple[int, int]) -> list[Row]:
    """Say which files, and which lines of code of all files, have asked for most of it."""
    first, most = counts
    before, after = held[str(first)]["lines"], held[str(most)]["lines"]
    by_line = Counter({line: size - before.get(line, 0) for line, size in after.items()})
    by_file: Counter[str] = Counter()
    for line, size in by_line.items():
        by_file[line.rpartition(":")[0]] += size
    return [
        Row(name=f"of it by {kind}: {place}", value=size / (most - first) / 1024, unit=_KIB)
        for kind, sizes in (("file", by_file), ("line", by_line))
        for place, size in sizes.most_common(_SHOWN)
    ]


def _figure(loop: str, url: str, counts: Sequence[int], readings: int) -> Figure:
    last = (counts[-2], counts[-1])
    ours = _measured(DRIVES, loop, url, counts, "--readings", str(readings))
    floor = _measured(FLOOR, loop, url, last)
    traced, floor_traced = (_measured(who, loop, url, last, "--traced") for who in (DRIVES, FLOOR))
    rows = [
        Row(name="floor, resident", value=_growth(floor, last, "resident"), unit=_KIB),
        *(
            Row(name=f"resident, {low:,} to {high:,}", value=_growth(ours, (low, high), "resident"), unit=_KIB)
            for low, high in pairwise(counts)
        ),
        Row(name=f"and more after {readings} readings each", value=_growth_when_busy(ours, counts[-1]), unit=_KIB),
        Row(name="floor, traced", value=_growth(floor_traced, last, "traced"), unit=_KIB),
        Row(name="traced", value=_growth(traced, last, "traced"), unit=_KIB),
        *_where(traced, last),
    ]
    return Figure(
        name=f"memory of an idle drive, {last[0]:,} to {last[1]:,} of them, {loop}",
        value=_growth(ours, last, "resident"),
        unit=_KIB,
        target=_TARGET,
        rows=rows,
        notes=["resident: what the system sees, without the kernel's buffers; traced: what Python was asked for"],
    )


def measure(effort: Effort) -> Sequence[Figure]:
    """Measure on each event loop."""
    counts = effort.pick((2, 4), (100, 1000), (1, 10, 100, 1000))
    readings = effort.pick(2, _READINGS, _READINGS)
    with far_end(_FAR_END, "0") as far:
        url = f"tcp://{HOST}:{far.where['tcp']}"
        return [_figure(loop, url, counts, readings) for loop in LOOPS]


if __name__ == "__main__":
    sys.exit(main())
