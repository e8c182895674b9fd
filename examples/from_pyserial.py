"""One job twice: as it is often written with pyserial's blocking reads, and with compax_aio; both really run."""

from __future__ import annotations

import argparse
import asyncio
import sys
import time
from collections.abc import Sequence

import serial

import compax_aio
from compax_aio.simulator.compax import Knobs, SimulatedDrive
from compax_aio.simulator.server import serve_pty

TARGET = 100.0
SIMULATED = Knobs(machine_zero=-20.0, nominal_speed=100.0, baudrate=9600)


def job_with_pyserial(port: str, target: float) -> str:
    """Home, move, and say where the axis is: typical code, with its faults."""
    with serial.Serial(port, 9600, timeout=0.5) as line:

        def ask(command: str) -> str:
            line.write(command.encode() + b"\r")
            answer = line.read(100)  # 1: reads until the timeout, for nobody looks for the prompt
            return answer.decode("ascii", "ignore").strip(" \r\n>")  # 2: what is no answer looks like one

        ask("POSA HOME")  # 3: nobody looks whether it was accepted, or an E and two digits came
        time.sleep(2)  # 4: long enough, on the day when it was written
        ask(f"POSA {target}")
        time.sleep(1.5)
        # 5: does it stand, or still move? is there a fault?  6: an exception, or Ctrl-C, leaves the axis moving
        return f"S1 answers {ask('S1')!r}"


async def job_with_compax_aio(url: str, target: float) -> str:
    """Do the same; what can go wrong is an exception, and leaving the block stops the axis."""
    async with compax_aio.connect(url, name="axis") as axis:
        await axis.home()
        result = await axis.move_to(target)
        return f"at {await axis.position():.2f} {axis.unit}, {result.duration_s:.2f} s, told by {result.confirmed_by}"


async def compare(target: float) -> None:
    """Do the job both ways, each on a simulated drive of its own, and tell what each says and how the axis stands."""
    for way in ("pyserial", "compax_aio"):
        drive = SimulatedDrive(SIMULATED)
        async with serve_pty(drive) as url:
            begun_at = time.monotonic()
            if way == "pyserial":  # in a thread: it blocks, and would hold up all else meanwhile
                told = await asyncio.to_thread(job_with_pyserial, url.removeprefix("serial://"), target)
            else:
                told = await job_with_compax_aio(url, target)
            print(f"{way} says after {time.monotonic() - begun_at:.1f} s: {told}")
            print(f"  really: at {drive.position:.2f}, and the axis {'moves' if drive.moving else 'stands'}")


async def run(url: str | None, target: float) -> None:
    """Compare on simulated drives; on a line of yours only the new way runs."""
    if url is None:
        await compare(target)
    else:
        print(await job_with_compax_aio(url, target))


def main(argv: Sequence[str] | None = None) -> int:
    """Read the command line, run, and return the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__,
        epilog="A real axis really moves. Ctrl-C stops it; it is no emergency stop. "
        "Real lines: serial:///dev/ttyUSB0?baudrate=9600, tcp://192.168.1.50:4001.",
    )
    parser.add_argument(
        "url", nargs="?", help="line of a drive, for the new way alone (default: a simulated one, for both)"
    )
    parser.add_argument("--target", type=float, default=TARGET, metavar="UNITS", help="from machine zero (%(default)s)")
    options = parser.parse_args(argv)
    try:
        asyncio.run(run(options.url, options.target))
    except (compax_aio.CompaxError, OSError) as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted; the new way has stopped its axis, the old one never does", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
