"""Run a program of the drive's memory: download its listing, start it, and watch the axis until it has ended."""

from __future__ import annotations

import argparse
import asyncio
import sys
from collections.abc import Sequence
from pathlib import Path

import compax_aio

SIMULATED = "sim://compax?machine_zero=-10"

LISTING = """
N001: POSA HOME
N002: SPEED 80
N003: REPEAT 2
N004: POSR 50 OUTPUT O9=1     ; prepared for the positioning that follows
N005: POSA 100
N006: WAIT 200
N007: OUTPUT O9=0
N008: POSA 0
N009: END                     ; of REPEAT
N010: END                     ; of the program
"""


async def run(url: str, listing: str | Path, record: int) -> None:
    """Download *listing* to the drive at *url*, run it from *record* on, and print what happens."""
    async with compax_aio.connect(url, name="axis") as axis:
        done = await axis.program.download(listing)
        for warning in done.warnings:
            print(warning)
        print(f"{len(done.changed)} records written, {done.unchanged} were there")

        # From here on Ctrl-C, or leaving the block in any other way, stops program and axis.
        await axis.program.start(record)
        while await axis.program.running():
            print(f"{await axis.position():10.2f} {axis.unit}")
            await asyncio.sleep(0.5)
        await axis.program.wait_finished()  # raises if it was stopped, or ended by a fault
        print(f"the program has ended at {await axis.position():.2f} {axis.unit}")


def main(argv: Sequence[str] | None = None) -> int:
    """Read the command line, run, and return the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__,
        epilog="A real axis really moves, and its records are overwritten. Ctrl-C stops it; it is no emergency "
        "stop. Real lines: serial:///dev/ttyUSB0?baudrate=9600, tcp://192.168.1.50:4001.",
    )
    parser.add_argument("url", nargs="?", default=SIMULATED, help="line of the drive (default: a simulated one)")
    parser.add_argument("--listing", type=Path, metavar="FILE", help="what to run (default: a short tour)")
    parser.add_argument("--record", type=int, default=1, help="where to begin (%(default)s)")
    options = parser.parse_args(argv)
    try:
        asyncio.run(run(options.url, options.listing or LISTING, options.record))
    except (compax_aio.CompaxError, OSError) as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted; the axis was stopped", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
