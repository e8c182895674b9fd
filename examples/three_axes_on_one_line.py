"""Three stepper axes on one party line: home them in turn, move them together, and watch them on their way."""

from __future__ import annotations

import argparse
import asyncio
import sys
from collections.abc import Sequence

import compax_aio
from compax_aio import smc

SIMULATED = "sim://smc?axes=XYZ&baudrate=9600&home=-300"
POINTS = ((9000, 4000, 1500), (0, 0, 0))


async def watch(line: smc.PartyLine, moves: Sequence[smc.AxisMove]) -> None:
    """Print where all axes are, until all moves are over."""
    while not all(move.done() for move in moves):
        positions = [f"{name} {await axis.position():7.0f}" for name, axis in line.axes.items()]
        print("  ".join(positions))
        await asyncio.sleep(0.5)


async def report(move: smc.AxisMove) -> None:
    """Await one move, and say how it ended."""
    result = await move
    print(f"{result.drive} has reached {result.target:.0f} after {result.duration_s:.2f} s")


async def tour(url: str, axes: str, speed_steps_s: int, direction: int) -> None:
    """Home three axes, move them twice, and print what happens."""
    async with smc.connect(url, axes=axes, name="table") as line:
        for name, axis in line.axes.items():
            await axis.home(speed_steps_s, direction=direction)
            print(f"{name} is at home")
        for targets in POINTS:
            # Each is on its way at once. If one fails, leaving the block stops the others; so does cancelling this.
            moves = [axis.move_to(target) for axis, target in zip(line.axes.values(), targets, strict=True)]
            await asyncio.gather(watch(line, moves), *map(report, moves))


def main(argv: Sequence[str] | None = None) -> int:
    """Read the command line, run, and return the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__,
        epilog="Real axes really move, up to 9000 steps. Ctrl-C stops them; it is no emergency stop. "
        "Real lines: serial:///dev/ttyUSB0?baudrate=9600, tcp://192.168.1.50:4001.",
    )
    parser.add_argument("url", nargs="?", default=SIMULATED, help="their line (default: a simulated one)")
    parser.add_argument("--axes", default="XYZ", help="the names of three axes (%(default)s)")
    parser.add_argument("--speed", type=int, default=1000, help="to search for home at, in steps/s (%(default)s)")
    parser.add_argument("--direction", type=int, default=1, help="to begin that search in, 0 or 1 (%(default)s)")
    options = parser.parse_args(argv)
    if len(options.axes) != len(POINTS[0]):
        parser.error(f"--axes are three letters, not {options.axes!r}")
    try:
        asyncio.run(tour(options.url, options.axes, options.speed, options.direction))
    except compax_aio.CompaxError as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted; the axes were stopped", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
