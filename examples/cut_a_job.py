"""Cut a job on a Roland CAMM-1 cutter: checked, sent through its buffer, watched, and what was cut is said."""

from __future__ import annotations

import argparse
import asyncio
import sys
from collections.abc import Sequence
from pathlib import Path

import compax_aio
from compax_aio import camm1

SIMULATED = "sim://camm1?baudrate=9600"
STAR = "IN;PA;VS10;PU200,1400;PD2600,1400,700,100,1400,2300,2100,100,200,1400;PU;PU0,0;"


async def watch(cut: camm1.Cut) -> None:
    """Print how far the job is, a line for each state or second."""
    state = ""
    async for progress in cut.progress(interval_s=1.0):
        if progress.state != state:
            state = progress.state
            print(f"{state} ({progress.elapsed_s:.1f} s)")
        x, y = progress.position_steps
        print(f"  {progress.bytes_sent} of {progress.bytes_total} bytes, towards {x / 40:.1f}, {y / 40:.1f} mm")


async def cut_job(url: str, profile: str, job: str | Path, handshake: str) -> None:
    """Cut one job, and print what happens; cancelling this aborts the job and lifts the tool."""
    async with camm1.connect(url, profile=profile) as cutter:
        print(f"{cutter.profile.name}, {cutter.capacity_bytes} bytes of buffer")
        cut = cutter.cut(job, handshake=handshake)  # type: ignore[arg-type]  # the parser knows the choices
        watching = asyncio.create_task(watch(cut))
        try:
            result = await cut
        finally:
            await watching
        for warning in result.warnings:
            print(f"warning: {warning}")
        print(f"cut in {result.duration_s:.1f} s with {result.handshake}, as {result.proved_by} has shown")


def main(argv: Sequence[str] | None = None) -> int:
    """Read the command line, run, and return the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__,
        epilog="A real blade really cuts. Ctrl-C aborts: the vector under way is cut to its end; it is no emergency "
        "stop. Real lines: serial:///dev/ttyUSB0?baudrate=9600, with rtscts=1 for hardwire; tcp://192.168.1.50:4001.",
    )
    parser.add_argument("url", nargs="?", default=SIMULATED, help="its line (default: a simulated one)")
    parser.add_argument("--job", type=Path, help="a file of HP-GL or CAMM-GL (default: a star of 60 mm)")
    parser.add_argument("--profile", default="PNC-1610", help="which machine it is (%(default)s)")
    choices = ("auto", "software", "xonxoff", "enq1", "enq2", "hardwire")
    parser.add_argument("--handshake", choices=choices, default="auto", help="(%(default)s)")
    options = parser.parse_args(argv)
    try:
        asyncio.run(cut_job(options.url, options.profile, options.job or STAR, options.handshake))
    except (compax_aio.CompaxError, OSError) as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted; the job was aborted", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
