"""Pick and place: comparators in the drive switch a gripper on the way, to the exact position."""

from __future__ import annotations

import argparse
import asyncio
import sys
from collections.abc import Sequence

import compax_aio
from compax_aio import Comparator

SIMULATED = "sim://compax?machine_zero=-10"

GRIPPER = 9
"""Output O9: 1 holds a part, 0 lets it go."""
CAMERA = 10
"""Output O10: 1 takes a picture."""

PICK, PLACE = 20.0, 320.0

# Distance from the start of the move, output, value. The drive reports each by its place in the list, from 1.
TO_PICK = [Comparator(15, GRIPPER, 1)]
TO_PLACE = [Comparator(295, GRIPPER, 0), Comparator(150, CAMERA, 1)]
BACK = [Comparator(10, CAMERA, 0)]


async def go(axis: compax_aio.Drive, target: float, comparators: Sequence[Comparator]) -> None:
    """Move to *target*, and print each comparator as it is passed."""
    move = axis.move_to(target, comparators=comparators)
    async for number in move.comparators():
        passed = comparators[number - 1]
        print(f"  {passed.distance:g} {axis.unit} on the way: O{passed.output}={passed.value}")
    result = await move
    print(f"at {result.target:g} {axis.unit}")


async def pick_and_place(url: str, parts: int) -> None:
    """Carry *parts* parts from PICK to PLACE."""
    async with compax_aio.connect(url, name="axis") as axis:
        await axis.home()
        for part in range(1, parts + 1):
            print(f"part {part}")
            await go(axis, PICK, TO_PICK)
            await go(axis, PLACE, TO_PLACE)
            await go(axis, 0, BACK)


def main(argv: Sequence[str] | None = None) -> int:
    """Read the command line, run, and return the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__,
        epilog=f"A real axis really moves, up to {PLACE:g} units, and switches O{GRIPPER} and O{CAMERA}. Ctrl-C stops "
        "it; it is no emergency stop. Real lines: serial:///dev/ttyUSB0?baudrate=9600, tcp://192.168.1.50:4001.",
    )
    parser.add_argument("url", nargs="?", default=SIMULATED, help="line of the drive (default: a simulated one)")
    parser.add_argument("--parts", type=int, default=2, help="how many parts are carried (%(default)s)")
    options = parser.parse_args(argv)
    try:
        asyncio.run(pick_and_place(options.url, options.parts))
    except compax_aio.CompaxError as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted; the axis was stopped", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
