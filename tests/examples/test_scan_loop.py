"""The scan tells its run in documents, and whatever ends it early, the axis stands before the last of them."""

from __future__ import annotations

import asyncio
import contextlib
import importlib.util
import json
import signal
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import compax_aio
from compax_aio.testing import Faults, SimulatedAxis, VirtualTime

EXAMPLE = Path(__file__).parents[2] / "examples" / "scan_loop.py"

Documents = list[tuple[str, dict[str, Any]]]


@pytest.fixture(name="example")
def load() -> ModuleType:
    spec = importlib.util.spec_from_file_location("example_scan_loop", EXAMPLE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@asynccontextmanager
async def devices(example: ModuleType, axis: SimulatedAxis) -> AsyncIterator[tuple[Any, Any]]:
    async with compax_aio.connect(axis.url, name="axis") as drive:
        motor = example.Motor("x", drive)
        yield motor, example.Detector("counts", motor, 50.0, 0.1)


async def collected(example: ModuleType, axis: SimulatedAxis, *, pause: Any = None, num: int = 5) -> Documents:
    """Scan from 0 to 100."""
    documents: Documents = []
    async with devices(example, axis) as (motor, detector):
        await example.scan(
            [detector], motor, 0, 100, num, lambda *document: documents.append(document), pause or example.Pause()
        )
    return documents


async def test_a_run_is_told_in_documents_that_belong_together(
    example: ModuleType, simulated_drive: SimulatedAxis
) -> None:
    documents = await collected(example, simulated_drive)
    names = [name for name, _ in documents]
    assert names == ["start", "descriptor", "event", "event", "event", "event", "event", "stop"]
    start, descriptor, *events, stop = (document for _, document in documents)
    assert start["num_points"] == 5
    assert descriptor["run_start"] == stop["run_start"] == start["uid"]
    assert {event["descriptor"] for event in events} == {descriptor["uid"]}
    assert [event["seq_num"] for event in events] == [1, 2, 3, 4, 5]
    assert set(descriptor["data_keys"]) == set(events[0]["data"]) == set(events[0]["timestamps"]) == {"x", "counts"}
    assert descriptor["data_keys"]["x"]["units"] == "units"
    assert [event["data"]["x"] for event in events] == [0, 25, 50, 75, 100]
    assert max(events, key=lambda event: float(event["data"]["counts"]))["data"] == {"x": 50, "counts": 1000}
    assert (stop["exit_status"], stop["num_events"]) == ("success", {"primary": 5})
    assert len({document["uid"] for _, document in documents}) == len(documents)
    assert "STOP" not in simulated_drive.lines


async def test_one_point_is_the_first(example: ModuleType, simulated_drive: SimulatedAxis) -> None:
    documents = await collected(example, simulated_drive, num=1)
    assert [document["data"]["x"] for name, document in documents if name == "event"] == [0]


async def test_a_pause_holds_it_between_two_points(
    example: ModuleType, simulated_drive: SimulatedAxis, virtual_time: VirtualTime
) -> None:
    pause = example.Pause()
    scanning = asyncio.create_task(collected(example, simulated_drive, pause=pause))
    await simulated_drive.until(lambda axis: axis.position > 30)
    pause.pause()
    await asyncio.sleep(100)
    simulated_drive.assert_standing()
    assert simulated_drive.position == 50
    pause.resume()
    assert (await scanning)[-1][1]["exit_status"] == "success"
    assert virtual_time.now > 100


async def test_cancelling_it_stops_the_axis(example: ModuleType, simulated_drive: SimulatedAxis) -> None:
    scanning = asyncio.create_task(collected(example, simulated_drive))
    await simulated_drive.until(lambda axis: axis.position > 30)
    scanning.cancel()
    with pytest.raises(asyncio.CancelledError):
        await scanning
    simulated_drive.assert_stopped()
    simulated_drive.assert_never_commanded_outside(0, 50)


@pytest.mark.parametrize(("trouble", "status"), [("fault", "fail"), ("stop", "abort")])
async def test_what_ends_a_move_ends_the_scan(
    example: ModuleType, simulated_drive: SimulatedAxis, faults: Faults, trouble: str, status: str
) -> None:
    documents: Documents = []
    async with devices(example, simulated_drive) as (motor, detector):

        def emit(*document: Any) -> None:
            documents.append(document)

        scanning = asyncio.create_task(example.scan([detector], motor, 0, 100, 5, emit, example.Pause()))
        await simulated_drive.until(lambda axis: axis.position > 30)
        if trouble == "fault":
            faults.raise_fault(55)
        else:
            await motor.stop()
        with pytest.raises(compax_aio.MoveError):
            await scanning
    name, stop = documents[-1]
    assert (name, stop["exit_status"], stop["num_events"]) == ("stop", status, {"primary": 2})
    assert ("E55" in stop["reason"]) == (trouble == "fault")
    simulated_drive.assert_standing()


async def test_a_status_is_what_bluesky_expects_of_one(example: ModuleType, simulated_drive: SimulatedAxis) -> None:
    told: list[Any] = []
    async with devices(example, simulated_drive) as (motor, _):
        status = motor.set(10)
        status.add_callback(told.append)
        assert (status.done, status.success, status.exception(), told) == (False, False, None, [])
        await status
        assert (status.done, status.success, status.exception(), told) == (True, True, None, [status])
        assert await motor.locate() == {"setpoint": 10, "readback": 10}
        assert motor.hints == {"fields": ["x"]}
        status = motor.set(500)
        await asyncio.sleep(0.5)
        await motor.stop(success=False)
        assert isinstance(status.exception(), compax_aio.MoveStoppedError)
        status.add_callback(told.append)
        assert told[-1] is status, "it is over, so it is told at once"
        cancelled = motor.set(500)
        cancelled.future.cancel()
        assert isinstance(cancelled.exception(), asyncio.CancelledError)
        assert not cancelled.success


# The command


def test_it_prints_a_table(
    example: ModuleType, simulated_drive: SimulatedAxis, virtual_time: VirtualTime, capsys: pytest.CaptureFixture[str]
) -> None:
    assert example.main([simulated_drive.url, "--num", "3"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "point             x      counts",
        "    1          0.00        0.00",
        "    2         50.00     1000.00",
        "    3        100.00        0.00",
        "success: 3 points",
    ]


def test_it_prints_documents(
    example: ModuleType, simulated_drive: SimulatedAxis, virtual_time: VirtualTime, capsys: pytest.CaptureFixture[str]
) -> None:
    assert example.main([simulated_drive.url, "--num", "2", "--json"]) == 0
    documents = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [name for name, _ in documents] == ["start", "descriptor", "event", "event", "stop"]


def test_ctrl_c_stops_the_axis(
    example: ModuleType, simulated_drive: SimulatedAxis, virtual_time: VirtualTime, capsys: pytest.CaptureFixture[str]
) -> None:
    run = example.run

    async def interrupted(*arguments: Any) -> None:
        asyncio.get_running_loop().call_later(3.0, signal.raise_signal, signal.SIGINT)
        await run(*arguments)

    vars(example)["run"] = interrupted
    assert example.main([simulated_drive.url, "--stop", "5000"]) == 130
    told = capsys.readouterr()
    assert told.err == "interrupted; the axis was stopped\n"
    assert told.out.splitlines()[-1].startswith("abort: 1 points")
    simulated_drive.assert_stopped()


@pytest.mark.parametrize(
    ("option", "value", "says"),
    [
        ("--stop", "nan", "must be finite"),
        ("--stop", "9e9", "must be within"),
        ("--num", "0", "1 or more"),
        ("--exposure", "nan", "0 or more"),
    ],
)
def test_a_scan_that_cannot_be_does_not_even_home(  # noqa: PLR0917
    example: ModuleType,
    simulated_drive: SimulatedAxis,
    virtual_time: VirtualTime,
    capsys: pytest.CaptureFixture[str],
    option: str,
    value: str,
    says: str,
) -> None:
    with contextlib.suppress(SystemExit):
        assert example.main([simulated_drive.url, option, value]) == 1
    assert says in capsys.readouterr().err
    simulated_drive.assert_never_moved()


def test_without_bluesky_it_says_so(example: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    if importlib.util.find_spec("bluesky") is not None:
        pytest.skip("it is installed here")
    assert example.main(["--bluesky"]) == 1
    assert capsys.readouterr().err == "ModuleNotFoundError: No module named 'bluesky'\n"


@pytest.mark.real_time
def test_blueskys_own_engine_takes_the_same_devices(example: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    """Where it is installed."""
    pytest.importorskip("bluesky")
    assert example.main(["sim://compax?nominal_speed=10000", "--bluesky", "--num", "3"]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "success: 3 points"
