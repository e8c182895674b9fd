"""One drive: find machine zero, move, and watch the axis travel."""

from __future__ import annotations

import argparse
import asyncio
import sys
from collections.abc import Sequence

import compax_aio

SIMULATED = "sim://compax?machine_zero=-40"


async def travel(url: str, target: float, speed_percent: float) -> None:
    """Home the drive at *url*, move it to *target*, and print what happens."""
    async with compax_aio.connect(url, name="axis") as axis:
        print(f"connected; the axis is at {await axis.position():.2f} {axis.unit}")
        await axis.home()
        print("machine zero found")

        move = axis.move_to(target, speed_percent=speed_percent)
        await move.accepted
        print(f"the drive has accepted {move.sent}")
        async for position in move.positions(interval_s=0.25):
            print(f"{position:10.2f} {axis.unit}")
        result = await move
        print(f"{result.target:.2f} {axis.unit} reached in {result.duration_s:.1f} s, told by {result.confirmed_by}")


def main(argv: Sequence[str] | None = None) -> int:
    """Read the command line, run, and return the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__,
        epilog="A real axis really moves: choose a target that it can reach. Ctrl-C stops it; it is no emergency stop. "
        "Real lines: serial:///dev/ttyUSB0?baudrate=9600, tcp://192.168.1.50:4001.",
    )
    parser.add_argument("url", nargs="?", default=SIMULATED, help="line of the drive (default: a simulated one)")
    parser.add_argument("--target", type=float, default=120.5, metavar="UNITS", help="from machine zero (%(default)s)")
    parser.add_argument("--speed", type=float, default=50, metavar="PERCENT", help="of nominal speed (%(default)s)")
    options = parser.parse_args(argv)
    try:
        asyncio.run(travel(options.url, options.target, options.speed))
    except compax_aio.CompaxError as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted; the axis was stopped", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
