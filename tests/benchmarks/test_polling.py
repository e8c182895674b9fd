"""Lines are polled back to back, and what is told of it is reckoned right."""

from __future__ import annotations

import asyncio
import resource
from types import SimpleNamespace

import pytest
from benchmarks.far_ends.paced import EXCHANGE_S
from benchmarks.polling import FarUsage, Polled, bare_lines, drives, percentile, poll, room_for

import compax_aio
from compax_aio import TransportError


@pytest.fixture(autouse=True)
def simulated_time(monkeypatch: pytest.MonkeyPatch) -> None:
    def now() -> float:
        return asyncio.get_running_loop().time()

    monkeypatch.setattr("benchmarks.polling.time", SimpleNamespace(monotonic=now, process_time=now))


class Paced:
    """A line on which a reading takes so much longer than the wire does."""

    def __init__(self, slowness: float) -> None:
        self._slowness = slowness
        self.asked = 0

    async def ask(self) -> None:
        self.asked += 1
        await asyncio.sleep(self._slowness * EXCHANGE_S)


async def test_a_line_that_loses_nothing_gets_all_of_the_wire() -> None:
    polled = await poll([Paced(1.0).ask, Paced(1.25).ask], 1.0)
    assert sorted(polled.shares) == pytest.approx([0.8, 1.0])
    assert polled.share == pytest.approx(0.9)
    assert percentile(polled.times_s, 0.1) == pytest.approx(EXCHANGE_S)
    assert percentile(polled.times_s, 100) == pytest.approx(1.25 * EXCHANGE_S)


async def test_lines_begin_at_different_times_and_go_on_until_the_time_is_over() -> None:
    lines = [Paced(1.0) for _ in range(50)]
    polled = await poll([line.ask for line in lines], 1.0)
    assert polled.exchanges == sum(line.asked for line in lines)
    assert 1.0 <= polled.wall_s <= 1.0 + EXCHANGE_S
    assert polled.shares == pytest.approx([1.0] * 50)


def test_what_an_exchange_costs_is_of_all_that_happened() -> None:
    assert Polled(wall_s=2.0, cpu_s=0.5, shares=[1.0], times_s=[0.1] * 1000).cpu_s_per_exchange == pytest.approx(5e-4)


@pytest.mark.parametrize(("of_100", "value"), [(50, 50.0), (99, 99.0), (99.9, 99.9), (100, 100.0)])
def test_percentiles(of_100: float, value: float) -> None:
    assert percentile([float(number) for number in range(101)], of_100) == pytest.approx(value)
    assert percentile([7.0], of_100) == 7.0


def test_the_far_end_was_at_work_when_it_was_not_idle() -> None:
    before = {"at_s": 10.0, "idle_s": 4.0}
    after = {"at_s": 14.0, "idle_s": 7.0, "late_us": {"count": 9, "p50": 5.0, "p99": 100.0, "max": 1500.0}}
    usage = FarUsage.between(before, after)
    assert usage.at_work == pytest.approx(0.25)
    assert usage.late_s == pytest.approx({"p50": 5e-6, "p99": 1e-4, "max": 1.5e-3})


async def test_drives_are_connected_at_once_and_closed() -> None:
    loop = asyncio.get_running_loop()
    async with drives(["sim://compax?baudrate=9600"]) as (one,):
        took_s = loop.time()
        assert await one.position() == 0.0
    assert not one.is_open
    began_at = loop.time()
    async with drives(["sim://compax?baudrate=9600"] * 5) as several:
        assert loop.time() - began_at < 2 * took_s
        assert [drive.name for drive in several] == [f"drive {number}" for number in range(5)]
    assert not any(drive.is_open for drive in several)


async def test_if_one_cannot_be_connected_to_the_others_are_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    connected: list[compax_aio.Drive] = []
    connect = compax_aio.connect

    async def remembered(*args: object, **options: object) -> compax_aio.Drive:
        drive = await connect(*args, **options)  # type: ignore[arg-type]
        connected.append(drive)
        return drive

    monkeypatch.setattr("benchmarks.polling.compax_aio", SimpleNamespace(connect=remembered))
    with pytest.raises(TransportError, match="nobody"):
        async with drives(["sim://compax", "loop://nobody"]):
            pytest.fail("there is nobody")
    assert [drive.is_open for drive in connected] == [False]


async def test_the_floor_reads_the_same_lines() -> None:
    async with bare_lines(["sim://compax"]) as (line,):
        assert await line.ask() == b"S001: 0.00\r\n>"
    assert line.transport.is_closing()


@pytest.mark.parametrize(
    ("limits", "wanted", "then"),
    [
        ((1024, 4096), 1000, (2256, 4096)),
        ((1024, 2000), 1000, (2000, 2000)),
        ((1024, -1), 1000, (2256, -1)),
        ((4096, 4096), 1000, None),
        ((1024, 1024), 1000, None),
    ],
)
def test_room_is_made_for_all_lines_as_far_as_it_may(
    monkeypatch: pytest.MonkeyPatch, limits: tuple[int, int], wanted: int, then: tuple[int, int] | None
) -> None:
    made: list[tuple[int, int]] = []
    monkeypatch.setattr(resource, "getrlimit", lambda _: limits)
    monkeypatch.setattr(resource, "setrlimit", lambda _, new: made.append(new))
    room_for(wanted)
    assert made == ([then] if then else [])
