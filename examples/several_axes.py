"""Several axes: home all of them side by side, then move them as one group."""

from __future__ import annotations

import argparse
import asyncio
import sys
from collections.abc import Sequence

import compax_aio

SIMULATED = "sim://compax?machine_zero="


async def tour(x_url: str, y_url: str, z_url: str) -> None:
    """Move three axes through three points, and print what happens."""
    async with (
        compax_aio.connect(x_url, name="x") as x,
        compax_aio.connect(y_url, name="y") as y,
        compax_aio.connect(z_url, name="z") as z,
    ):
        await asyncio.gather(x.home(), y.home(), z.home())
        print("machine zero found on x, y and z")

        # If one axis is refused or fails, the others are stopped; cancelling the move stops all of them.
        group = compax_aio.DriveGroup(x=x, y=y, z=z)
        for point in ({"x": 100, "y": 50, "z": 10}, {"x": 20, "y": 80}, {"x": 0, "y": 0, "z": 0}):
            results = await group.move_to(speed_percent=80, **point)
            slowest = max(results.values(), key=lambda result: result.duration_s)
            positions = ", ".join(f"{axis} {position:.2f}" for axis, position in (await group.positions()).items())
            print(f"{positions}; {slowest.drive} took longest, {slowest.duration_s:.2f} s")


def main(argv: Sequence[str] | None = None) -> int:
    """Read the command line, run, and return the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__,
        epilog="Real axes really move, up to 100 units. Ctrl-C stops all of them; it is no emergency stop. "
        "Real lines: serial:///dev/ttyUSB0?baudrate=9600, tcp://192.168.1.50:4001.",
    )
    for axis, machine_zero in (("x", -40), ("y", -25), ("z", 5)):
        simulated = f"{SIMULATED}{machine_zero}"
        parser.add_argument(f"--{axis}", metavar="URL", default=simulated, help=f"line of axis {axis} (%(default)s)")
    options = parser.parse_args(argv)
    try:
        asyncio.run(tour(options.x, options.y, options.z))
    except compax_aio.CompaxError as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        # How the other axes ended is told in notes.
        print(*getattr(error, "__notes__", ()), sep="\n", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted; the axes were stopped", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
