"""
Whether a job of megabytes gets through a small buffer, whole, and with the wire always busy.

Run it with ``python -m benchmarks.cutting``. A simulated cutter that is faster than the line is sent a job with each
handshake and each size of its buffer, at 9600 baud in virtual time; what it cut is compared with the job, vector by
vector. The limit of the wire is the time that all bytes take which went out, job and handshake, back to back; its share
is counted from the first byte of the job to the end of its proof. A sender without any handshake is sent through, too.
"""

from __future__ import annotations

import argparse
import asyncio
import logging
import re
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from random import Random
from typing import Final

from compax_aio import camm1
from compax_aio.camm1.pacing import HANDSHAKES, Handshake
from compax_aio.simulator.camm1 import Knobs, SimulatedCutter
from compax_aio.simulator.clock import VirtualClockLoop
from compax_aio.simulator.server import cutter_named

from .torture import table

__all__ = ["HEAD", "SIZES", "Outcome", "job_of", "main", "measure", "naive", "rows"]

HEAD: Final = ("handshake", "buffer", "vectors", "lost or doubled", "of the wire's limit", "job of all bytes", "CPU s")
SIZES: Final = (60, 256, 1024, 15_360)

_BAUD: Final = 9600
_BITS: Final = 10
_FAST: Final = 0.02
"""Of the times that a simulated cutter takes otherwise: the line is what it waits for."""

_Vector = tuple[int, int, int, int, bool]


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of one job."""

    handshake: Handshake
    size: int
    vectors: int
    is_whole: bool
    """Every vector of the job was cut, once, in its order."""
    wire_share: float
    job_share: float
    cpu_s: float


def job_of(size_bytes: int, seed: int = 1) -> str:
    """Make up a job of paths of short vectors."""
    random = Random(seed)
    parts, size = ["IN;PA;"], 6
    while size < size_bytes:
        x, y = random.randrange(0, 11_000), random.randrange(0, 9_000)
        parts.append(f"PU{x},{y};")
        size += len(parts[-1])
        for _ in range(12):
            x, y = max(0, x + random.randrange(-40, 41)), max(0, y + random.randrange(-40, 41))
            parts.append(f"PD{x},{y};")
            size += len(parts[-1])
    return "".join([*parts, "PU;"])


def expected(job: str) -> Iterator[_Vector]:
    """Follow the tool through such a job."""
    x = y = 0
    for match in re.finditer(r"P([UD])(\d+),(\d+);", job):
        to_x, to_y = int(match[2]), int(match[3])
        yield x, y, to_x, to_y, match[1] == "D"
        x, y = to_x, to_y


def _is_whole(far: SimulatedCutter, job: str) -> bool:
    far.advance()
    made = far.cuttings.vectors
    count = 0
    for vector, wanted in zip(made, expected(job), strict=False):
        if vector[:5] != wanted:
            return False
        count += 1
    return count == len(made) == sum(1 for _ in expected(job)) and not far.lost_bytes


async def _cut(handshake: Handshake, size: int, job: str) -> Outcome:
    wired = handshake == "hardwire"
    name = f"{handshake}-{size}"
    far = cutter_named(name, Knobs(baudrate=_BAUD, physical_size=size, time_factor=_FAST, dtr_wired=wired))
    loop = asyncio.get_running_loop()
    async with camm1.connect(f"sim://camm1?name={name}", settings=camm1.CutterSettings(baud_rate=_BAUD)) as cutter:
        sent, began, cpu = cutter.stats.bytes_sent, loop.time(), time.process_time()
        result = await cutter.cut(job, handshake=handshake, check=False)
        took_s, cpu_s = loop.time() - began, time.process_time() - cpu
        sent = cutter.stats.bytes_sent - sent
        return Outcome(
            handshake,
            size,
            len(far.cuttings.vectors),
            result.bytes == len(job) and _is_whole(far, job),
            sent * _BITS / _BAUD / took_s,
            len(job) / sent,
            cpu_s,
        )


def measure(handshake: Handshake, size: int, job: str) -> Outcome:
    """Cut *job* in virtual time."""
    with asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
        return runner.run(_cut(handshake, size, job))


def naive(size: int, job: str) -> tuple[int, bool]:
    """Send *job* without any handshake; return how many bytes were lost, and whether it was cut all the same."""
    far = SimulatedCutter(Knobs(baudrate=_BAUD, physical_size=size))
    far.connect(0.0)
    far.receive(job.encode(), 0.0)
    far.advance(len(job) * _BITS / _BAUD + 1)
    return far.lost_bytes, _is_whole(far, job)


def rows(outcomes: Sequence[Outcome]) -> list[tuple[str, ...]]:
    """Write outcomes in columns."""
    return [
        (
            each.handshake,
            str(each.size),
            f"{each.vectors:,}",
            "none" if each.is_whole else "YES",
            f"{each.wire_share:.1%}",
            f"{each.job_share:.1%}",
            f"{each.cpu_s:.1f}",
        )
        for each in outcomes
    ]


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, and print a table; 1 if a job was not cut whole, or the wire was idle for more than 3 %."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.cutting", description=__doc__)
    parser.add_argument("--megabytes", type=float, default=5.0, help="of each job (default: 5)")
    parser.add_argument("--handshake", choices=HANDSHAKES, action="append", help="only this one; may be repeated")
    parser.add_argument("--buffer", type=int, action="append", help="only this size; may be repeated")
    asked = parser.parse_args(arguments)
    logging.disable(logging.WARNING)
    job = job_of(round(asked.megabytes * 1_000_000))
    outcomes = []
    for handshake in asked.handshake or HANDSHAKES:
        for size in asked.buffer or SIZES:
            outcomes.append(measure(handshake, size, job))
            print(" ".join(rows(outcomes)[-1]), file=sys.stderr, flush=True)
    print(f"a job of {len(job):,} bytes, {_BAUD} baud, a cutter that is never the bottleneck\n")
    print(table(HEAD, rows(outcomes)))
    lost, is_whole = naive(1024, job[:20_000])
    print(
        f"\nwithout a handshake, 20,000 bytes into 1024: {lost:,} bytes lost, cut whole: {'yes' if is_whole else 'no'}"
    )
    return 0 if all(each.is_whole and each.wire_share >= 0.97 for each in outcomes) else 1


if __name__ == "__main__":
    sys.exit(main())
