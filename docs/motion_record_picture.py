"""Draw docs/motion-record.svg: three simulated axes on 9600-baud lines, recorded while they move."""

from __future__ import annotations

import asyncio
import tempfile
from dataclasses import replace
from pathlib import Path

import compax_aio
from compax_aio.recording import read_record, record
from compax_aio.recording.plot import draw, save_plot
from compax_aio.simulator.clock import VirtualClockLoop

_URLS = {
    "x": "sim://compax?name=x&baudrate=9600&homed=1&nominal_speed=150",
    "y": "sim://compax?name=y&baudrate=9600&homed=1&nominal_speed=90",
    "z": "sim://compax?name=z&baudrate=9600&homed=1&nominal_speed=45",
}
_QUANTITIES = ("position", "target", "following_error")


async def _record(path: Path) -> None:
    settings = compax_aio.DriveSettings(unit="mm")
    async with (
        compax_aio.DriveGroup.connect(_URLS, settings=settings) as group,
        record(group, path, quantities=_QUANTITIES),
    ):
        await group.move_to(x=240, y=155.5, z=-60, speed_percent=60)
        await group.move_to(x=80, y=10.25, z=0)
        await asyncio.sleep(0.3)


def main() -> None:
    """Record and draw."""
    with tempfile.TemporaryDirectory() as folder, asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
        path = Path(folder) / "acceptance.csv"
        runner.run(_record(path))
        read = read_record(path)
        assert read.started is not None
        # The picture does not change with the day on which it is made.
        read = replace(read, started=read.started.replace(2026, 1, 1, 12, 0, 0))
        save_plot(draw([read], title="Acceptance: x, y and z together"), Path(__file__).with_name("motion-record.svg"))


if __name__ == "__main__":
    main()
