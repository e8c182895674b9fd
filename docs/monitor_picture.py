"""Draw docs/monitor.svg: the monitor with three simulated axes, one of them at fault, from a real run."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable
from contextlib import AsyncExitStack
from pathlib import Path

from textual.pilot import Pilot

from compax_aio import DriveSettings
from compax_aio.cli.monitoring.cell import Cell
from compax_aio.cli.monitoring.screen import Monitor
from compax_aio.cli.monitoring.state import AxisState
from compax_aio.cli.monitoring.wanted import WantedAxis
from compax_aio.simulator.compax import Knobs, SimulatedDrive
from compax_aio.simulator.server import serve_loopback

_SIZE = (106, 39)
_MOVES = {
    "x": (240.0, 60.0, 370.0, 120.0, 310.0, 250.0),
    "y": (180.0, 20.0, 110.0, 60.0, 150.0),
    "z": (70.0, 10.0, 90.0, 25.0, 45.0),
}


def _drives() -> dict[str, SimulatedDrive]:
    return {
        name: SimulatedDrive(
            Knobs(
                homed=True,
                travel_min=-10,
                travel_max=travel,
                nominal_speed=speed,
                acceleration_ms=900,
                answer_time_s=0.015,
                following_error_factor=0.01,
            ),
            name=name,
        )
        for name, travel, speed in (("x", 400, 30.0), ("y", 200, 12.0), ("z", 100, 6.0))
    }


async def _until(condition: Callable[[], object]) -> None:
    while not condition():  # noqa: ASYNC110
        await asyncio.sleep(0.05)


async def _travel(monitor: Monitor, name: str) -> None:
    """Let one axis go to and fro for more than a minute, as a program of somebody else would."""
    drive = next(axis.orders.drive for axis in monitor.cell.axes if axis.name == name)
    assert drive is not None
    for target in _MOVES[name]:
        await drive.move_to(target, speed_percent=80)
        await asyncio.sleep(1.5)


async def _act(monitor: Monitor, pilot: Pilot[bool], far: dict[str, SimulatedDrive]) -> None:
    """Do what shall be seen: a minute of moves, a fault, and a jog that is under way."""
    state: Callable[[int], AxisState] = lambda number: monitor.cell.axes[number].state  # noqa: E731
    await _until(lambda: all(state(number).travel for number in range(3)))
    await asyncio.gather(*(_travel(monitor, name) for name in far))
    far["z"].raise_fault(55)
    await _until(lambda: state(2).error)
    await pilot.press("m", "y", *["plus"] * 6, "left")
    await asyncio.sleep(4)
    monitor.show()
    await pilot.pause()


async def _run() -> str:
    far = _drives()
    async with AsyncExitStack() as stack:
        wanted = []
        for name, drive in far.items():
            url = await stack.enter_async_context(serve_loopback(drive, name))
            wanted.append(WantedAxis(name, url, DriveSettings(unit="mm")))
        cell = Cell(wanted, interval_s=0.2, jog_percent=50)
        monitor = Monitor(cell)
        async with monitor.run_test(size=_SIZE) as pilot:
            await _act(monitor, pilot, far)
            drawing = monitor.export_screenshot(title="compax monitor")
            await cell.close()
        return drawing


def main() -> None:
    """Run the monitor for a minute and keep what is on its screen."""
    # The picture asks nobody for a font, keeps the blanks at the ends of its texts, and leaves no gaps between lines.
    drawing = re.sub(r"@font-face \{.*?\}\s*", "", asyncio.run(_run()), flags=re.DOTALL)
    drawing = drawing.replace("Fira Code", "DejaVu Sans Mono").replace("<svg ", '<svg xml:space="preserve" ', 1)
    drawing = drawing.replace("font-size: 20px", "font-size: 21px")
    Path(__file__).with_name("monitor.svg").write_text(drawing, encoding="utf-8")


if __name__ == "__main__":
    main()
