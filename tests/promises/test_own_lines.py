"""P7: trouble stays on its line; the times of another line are those of an undisturbed one."""

from __future__ import annotations

import asyncio
import contextlib

import pytest
from tests.promises.bench import bench, now, until

from compax_aio import CompaxError, Drive, DriveSettings
from compax_aio.simulator.compax import Knobs, SimulatedDrive
from compax_aio.simulator.server import drive_named

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


async def times_of(drive: Drive) -> list[float]:
    """Return when each step of an ordinary program was over, counted from its beginning."""
    begun_at = now()
    times = []

    def note() -> None:
        times.append(round(now() - begun_at, 9))

    for _ in range(20):
        await drive.position()
        note()
    await drive.move_to(100, speed_percent=50)
    note()
    await drive.status()
    note()
    move = drive.move_by(-1000)
    async for _ in move.positions():
        note()
        if len(times) > 40:
            break
    await move.stop()
    note()
    with contextlib.suppress(CompaxError):
        await move
    return times


async def keep_asking(drive: Drive) -> None:
    while True:
        with contextlib.suppress(CompaxError):
            await asyncio.gather(drive.position(), drive.command("SD50"), drive.query("P1"))
        await asyncio.sleep(0)


async def flood(far: SimulatedDrive, pause_s: float = 0.005) -> None:
    while True:
        for noise in (b"x" * 400, b"\r\n>" * 20, b"S001: 1.00\r\n>" * 5, bytes(range(256))):
            far.inject(noise)
            await asyncio.sleep(pause_s)


@pytest.mark.parametrize("baudrate", [0, 9600])
async def test_a_deaf_and_a_flooding_drive_delay_no_other(baudrate: int) -> None:
    async with bench("quiet", baudrate=baudrate) as (drive, _):
        undisturbed = await times_of(drive)
    async with (
        bench("deaf", settings=DriveSettings(stop_timeout_s=1)) as (deaf, far_deaf),
        bench("flooding") as (flooding, far_flooding),
        bench("third", baudrate=baudrate) as (third, _),
    ):
        far_deaf.deaf = True
        disturbing = [
            asyncio.ensure_future(each) for each in (keep_asking(deaf), keep_asking(flooding), flood(far_flooding))
        ]
        await asyncio.sleep(2.5)
        assert await times_of(third) == undisturbed
        assert deaf.stats.timeouts > 0
        assert flooding.stats.bytes_received > 10_000
        for task in disturbing:
            task.cancel()
        await asyncio.wait(disturbing)


async def test_a_drive_that_floods_can_still_be_stopped() -> None:
    """Its axis stands at once; that nobody can hear it say so is told in time."""
    async with bench(settings=DriveSettings(stop_timeout_s=5)) as (drive, far):
        move = drive.move_to(100_000)
        await asyncio.sleep(1)
        flooding = asyncio.ensure_future(flood(far, 0.05))
        await asyncio.sleep(0.2)
        begun_at = now()
        stopping = asyncio.ensure_future(drive.stop())
        await until(lambda: not far.moving)
        assert now() - begun_at < 2.5
        await asyncio.gather(stopping, move, return_exceptions=True)
        assert now() - begun_at < 30
        assert move.exception() is not None
        assert stopping.exception() is None or isinstance(stopping.exception(), CompaxError)
        flooding.cancel()
        await asyncio.wait([flooding])


async def test_a_drive_that_cannot_be_reached_delays_no_other_that_connects() -> None:
    drive_named("deaf", Knobs()).deaf = True

    async def connect(name: str) -> float:
        with contextlib.suppress(CompaxError):
            async with bench(name) as (drive, _):
                await drive.position()
        return now()

    deaf_at, quick_at = await asyncio.gather(connect("deaf"), connect("quick"))
    assert quick_at < 0.05
    assert deaf_at >= 3
