"""
Does trouble stay on its line? A drive is polled on TCP and on a pty, alone and beside others that are in trouble.

Run it with ``python -m benchmarks.isolation``. Beside it in the same event loop are then: a device that floods as fast
as it is taken, one that is silent, one that does not read, one that holds its line by Xoff, one that takes every
connection and hangs up; a port that hangs while it is opened, and a search for ports that takes a second. Rounds with
and without them alternate. All far ends are in other processes.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import logging
import os
import platform
import sys
import time
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field
from statistics import median, quantiles
from typing import Any, Final
from unittest.mock import patch

import compax_aio
from compax_aio import CompaxError, Drive, DriveSettings
from compax_aio.transports import serial

from .isolation_far_end import BEHAVES_S, FLOODS, HELD_S, FarEnds, far_ends
from .torture import table

__all__ = ["ALLOWED_S", "HEAD", "Times", "main", "measure", "rows"]

ALLOWED_S: Final = 0.002
"""So much later the median may come beside trouble."""
HEAD: Final = ("line", "beside", "exchanges", "median ms", "p99 ms", "longest ms", "later by ms")

_ALONE: Final = "nobody"
_LAG: Final = "(event loop's lag)"
_SLEEP_S: Final = 0.001
_HANGS_S: Final = 1.0


@dataclass(slots=True)
class Times:
    """How long exchanges took, and how late the event loop was, in all rounds of one kind."""

    by_line: dict[str, list[float]] = field(default_factory=dict)

    def add(self, line: str, seconds: float) -> None:
        """Take note of one."""
        self.by_line.setdefault(line, []).append(seconds)


async def _poll(line: str, drive: Drive, until: float, times: Times) -> None:
    while (begun_at := time.perf_counter()) < until:
        await drive.position()
        times.add(line, time.perf_counter() - begun_at)


async def _watch_loop(times: Times) -> None:
    while True:
        begun_at = time.perf_counter()
        await asyncio.sleep(_SLEEP_S)
        times.add(_LAG, max(0.0, time.perf_counter() - begun_at - _SLEEP_S))


async def _keep_asking(drive: Drive) -> None:
    while True:
        await asyncio.gather(drive.position(), drive.command("SD50"), drive.query("P1"), return_exceptions=True)
        await asyncio.sleep(_SLEEP_S)


async def _keep_searching() -> None:
    while True:
        await serial.list_ports()


async def _keep_opening() -> None:
    while True:
        with contextlib.suppress(CompaxError):
            await compax_aio.connect("serial:///dev/ttyHangs")


def _hang(*_: Any, **__: Any) -> Any:
    time.sleep(_HANGS_S)
    raise FileNotFoundError


def _search_slowly() -> list[Any]:
    time.sleep(_HANGS_S)
    return []


async def _connected(name: str, url: str, settings: DriveSettings) -> Drive:
    """Connect, and be patient: a line may still be held from the round before."""
    async with asyncio.timeout(2 * HELD_S):
        while True:
            with contextlib.suppress(CompaxError):
                return await compax_aio.connect(url, name=name, settings=settings)


@asynccontextmanager
async def _in_trouble(urls: FarEnds) -> AsyncIterator[None]:
    """Have others in trouble all the while; opening and closing them is part of it."""
    settings = DriveSettings(answer_timeout_s=0.2, reconnect_first_s=0.01, reconnect_slowest_s=0.01, stop_timeout_s=1)
    drives = [await _connected(name, url, settings) for name, url in urls.items()]
    open_port = serial.open_port  # type: ignore[attr-defined]

    def open_or_hang(backend: str, name: str, *rest: Any, **options: Any) -> Any:
        return _hang() if "Hangs" in name else open_port(backend, name, *rest, **options)

    with (
        patch.object(serial, "open_port", open_or_hang),
        patch("compax_aio.transports.serial_ports.pyserial_list_ports.comports", _search_slowly),
    ):
        await asyncio.sleep(2 * BEHAVES_S)
        tasks = [asyncio.ensure_future(_keep_asking(drive)) for drive in drives]
        tasks += [asyncio.ensure_future(_keep_searching()), asyncio.ensure_future(_keep_opening())]
        try:
            yield
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.wait(tasks)
            await asyncio.gather(*(drive.close() for drive in drives), return_exceptions=True)


async def _round(quiet: Mapping[str, Drive], times: Times, round_s: float) -> None:
    watching = asyncio.ensure_future(_watch_loop(times))
    until = time.perf_counter() + round_s
    await asyncio.gather(*(_poll(line, drive, until, times) for line, drive in quiet.items()))
    watching.cancel()
    await asyncio.wait([watching])


async def measure(floods: Sequence[str], rounds: int, round_s: float) -> Mapping[str, Times]:
    """Poll the quiet drives alone, and beside trouble with a flood of each kind, in turn."""
    measured = {_ALONE: Times(), **{f"trouble, flood of {flood}": Times() for flood in floods}}
    async with AsyncExitStack() as stack:
        urls = await stack.enter_async_context(far_ends("quiet"))
        troubled = [await stack.enter_async_context(far_ends(flood)) for flood in floods]
        settings = DriveSettings(answer_timeout_s=10)
        quiet = {
            line: await stack.enter_async_context(compax_aio.connect(url, name=line, settings=settings))
            for line, url in urls.items()
        }
        for number in range(rounds):
            print(f"round {number + 1} of {rounds} …", file=sys.stderr)
            for times, others in zip(measured.values(), (None, *troubled), strict=True):
                async with _in_trouble(others) if others else contextlib.nullcontext():
                    await _round(quiet, times, round_s)
    return measured


def later_by_s(measured: Mapping[str, Times], beside: str, line: str) -> float:
    """Return by how much the median of *line* comes later *beside* that."""
    return median(measured[beside].by_line[line]) - median(measured[_ALONE].by_line[line])


def rows(measured: Mapping[str, Times]) -> list[Sequence[str]]:
    """Fill the table, lines side by side."""
    filled: list[Sequence[str]] = []
    for line in measured[_ALONE].by_line:
        for beside, times in measured.items():
            each = times.by_line[line]
            p99 = quantiles(each, n=100)[98] if len(each) > 1 else each[0]
            figures = [f"{1000 * seconds:.2f}" for seconds in (median(each), p99, max(each))]
            later = "" if beside == _ALONE else f"{1000 * later_by_s(measured, beside, line):+.2f}"
            filled.append([line, beside, str(len(each)), *figures, later])
    return filled


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, print a table, and return the exit status: 1 if a median came more than 2 ms later beside trouble."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("--rounds", type=int, default=5, help="how often each is measured (5)")
    parser.add_argument("--round-s", type=float, default=1.0, help="how long, in seconds (1)")
    parser.add_argument("--flood", choices=[*FLOODS], action="append", help="only floods of that; may be repeated")
    options = parser.parse_args(argv)
    logging.disable(logging.CRITICAL)
    measured = asyncio.run(measure(options.flood or [*FLOODS], options.rounds, options.round_s))
    print(f"python {platform.python_version()}, {platform.system()}, {os.cpu_count()} cores", end="\n\n")
    print(table(HEAD, rows(measured)))
    lines = [line for line in measured[_ALONE].by_line if line != _LAG]
    late = [later_by_s(measured, beside, line) > ALLOWED_S for beside in measured for line in lines]
    return int(any(late))


if __name__ == "__main__":
    sys.exit(main())
