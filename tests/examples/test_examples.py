"""The examples do what they say, on simulated drives, and end as they promise: in time, and with the axis standing."""

from __future__ import annotations

import asyncio
import importlib.util
import signal
import sys
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from compax_aio.errors import ConnectionLostError
from compax_aio.simulator.clock import VirtualClockLoop
from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive
from compax_aio.simulator.server import drive_named, line_named, serve_tcp
from compax_aio.simulator.smc import Ending, SimulatedPartyLine
from compax_aio.simulator.smc import Knobs as SmcKnobs
from compax_aio.simulator.smc import LogKind as SmcLogKind

EXAMPLES = Path(__file__).parents[2] / "examples"
APPLICATIONS = {"commissioning", "fastapi_service", "from_pyserial", "haas_nightly_backup", "scan_loop"}
"""Whole applications; the others are sketches."""
NAMES = sorted(path.stem for path in EXAMPLES.glob("*.py"))


def load(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"example_{name}", EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def loop_of_main(monkeypatch: pytest.MonkeyPatch) -> VirtualClockLoop:
    """Let main() run on a virtual clock."""
    loop = VirtualClockLoop()

    def run(work: Coroutine[Any, Any, None]) -> None:
        with asyncio.Runner(loop_factory=lambda: loop) as runner:
            runner.run(work)

    monkeypatch.setattr(asyncio, "run", run)
    return loop


@pytest.fixture
def virtual_clock(loop_of_main: VirtualClockLoop) -> Callable[[str], SimulatedDrive]:
    """Give a function that makes a drive for main() in advance, to look at its log after."""

    def drive(name: str) -> SimulatedDrive:
        async def make() -> SimulatedDrive:
            return drive_named(name, Knobs(machine_zero=-40.0))

        return loop_of_main.run_until_complete(make())

    return drive


@pytest.fixture
def party_line(loop_of_main: VirtualClockLoop) -> SimulatedPartyLine:
    """Make a line for main() in advance, ``sim://smc?name=table``."""

    async def make() -> SimulatedPartyLine:
        return line_named("table", SmcKnobs(axes="XYZ", home=-300, baudrate=9600))

    return loop_of_main.run_until_complete(make())


def lines_of(captured: pytest.CaptureFixture[str]) -> list[str]:
    return captured.readouterr().out.splitlines()


# Every example


@pytest.mark.parametrize("name", NAMES)
def test_the_help_says_which_lines_are_possible(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        load(name).main(["--help"])
    assert ended.value.code == 0
    told = capsys.readouterr().out
    assert "default" in told or "sim://" in told
    assert "Ctrl-C" in told or "SIGTERM" in told or "nc " in told


@pytest.mark.parametrize("name", NAMES)
def test_an_error_is_printed_without_traceback(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    url = "sim://compax?speed=1"
    assert load(name).main([url] if name != "several_axes" else ["--x", url]) == 1
    told = capsys.readouterr().err
    assert "has no knob 'speed'" in told
    assert "Traceback" not in told


@pytest.mark.parametrize("name", NAMES)
def test_it_is_short(name: str) -> None:
    assert len((EXAMPLES / f"{name}.py").read_text().splitlines()) <= (330 if name in APPLICATIONS else 80)


# One drive


def test_one_drive_homes_moves_and_is_watched(
    virtual_clock: Callable[[str], SimulatedDrive], capsys: pytest.CaptureFixture[str]
) -> None:
    drive = virtual_clock("one")
    assert load("one_drive").main(["sim://compax?name=one"]) == 0
    told = lines_of(capsys)
    assert told[1:3] == ["machine zero found", "the drive has accepted PA120.5$"]
    assert told[-1].startswith("120.50 units reached in 1.3")
    assert len(told) > 7, "it was not watched on its way"
    assert drive.log.texts(LogKind.MOTION_REACHED)[-1] == "120.50"


def test_one_drive_tells_of_a_target_that_is_refused(
    virtual_clock: Callable[[str], SimulatedDrive], capsys: pytest.CaptureFixture[str]
) -> None:
    drive = virtual_clock("one")
    assert load("one_drive").main(["sim://compax?name=one", "--target", "1e9"]) == 1
    assert "InvalidCommandError: position must be within ±4,000,000 units" in capsys.readouterr().err
    assert drive.log.texts(LogKind.MOTION_STARTED) == ["POSA HOME -40.00"]


def test_ctrl_c_stops_the_drive(
    virtual_clock: Callable[[str], SimulatedDrive], capsys: pytest.CaptureFixture[str]
) -> None:
    drive = virtual_clock("one")
    example = load("one_drive")
    travel = example.travel

    async def interrupted(*arguments: Any) -> None:
        asyncio.get_running_loop().call_later(2.0, signal.raise_signal, signal.SIGINT)
        await travel(*arguments)

    vars(example)["travel"] = interrupted
    assert example.main(["sim://compax?name=one", "--target", "1000"]) == 130
    assert "interrupted; the axis was stopped" in capsys.readouterr().err
    assert drive.log.texts(LogKind.MOTION_STOPPED)
    assert not drive.moving


# Several axes


def test_several_axes_are_homed_together_and_moved_as_one(
    virtual_clock: Callable[[str], SimulatedDrive], capsys: pytest.CaptureFixture[str]
) -> None:
    drives = {axis: virtual_clock(axis) for axis in "xyz"}
    arguments = [word for axis in "xyz" for word in (f"--{axis}", f"sim://compax?name={axis}")]
    assert load("several_axes").main(arguments) == 0
    told = lines_of(capsys)
    assert told[0] == "machine zero found on x, y and z"
    assert told[1].startswith("x 100.00, y 50.00, z 10.00; x took longest")
    assert told[-1].startswith("x 0.00, y 0.00, z 0.00;")
    begun = [[at for at, kind, _ in _entries(drive) if kind is LogKind.MOTION_STARTED] for drive in drives.values()]
    assert max(times[0] for times in begun) - min(times[0] for times in begun) < 0.05, "homed one after the other"


def test_a_fault_of_one_axis_stops_the_others(
    virtual_clock: Callable[[str], SimulatedDrive], capsys: pytest.CaptureFixture[str]
) -> None:
    drives = {axis: virtual_clock(axis) for axis in "xyz"}
    example = load("several_axes")
    tour = example.tour

    async def disturbed(*urls: str) -> None:
        asyncio.get_running_loop().call_later(0.6, drives["y"].raise_fault, 55)
        await tour(*urls)

    vars(example)["tour"] = disturbed
    arguments = [word for axis in "xyz" for word in (f"--{axis}", f"sim://compax?name={axis}")]
    assert example.main(arguments) == 1
    told = capsys.readouterr().err
    assert "E55, emergency stop" in told
    assert "x: move_to(100) was stopped" in told
    assert drives["x"].log.texts(LogKind.MOTION_STOPPED)


# Axes on one line


def test_three_axes_on_one_line_are_homed_in_turn_and_moved_together(
    party_line: SimulatedPartyLine, capsys: pytest.CaptureFixture[str]
) -> None:
    assert load("three_axes_on_one_line").main(["sim://smc?name=table"]) == 0
    told = lines_of(capsys)
    assert told[:3] == ["X is at home", "Y is at home", "Z is at home"]
    assert [line.split(" after")[0] for line in told if "reached" in line] == [
        f"table axis {axis} has reached {target}"
        for axis, target in (("Z", 1500), ("Y", 4000), ("X", 9000), ("Z", 0), ("Y", 0), ("X", 0))
    ]
    assert sum("X  " in line for line in told) > 6, "they were not watched on their way"
    assert party_line.log.texts(SmcLogKind.MOTION_STARTED, axis="X") == ["F1000 1", "R9000", "R0"]
    begun = [entry.at for entry in party_line.log if entry.text in {"R9000", "R4000", "R1500"}]
    assert max(begun) - min(begun) < 0.3, "moved one after the other"


def test_ctrl_c_stops_all_axes_of_a_line(party_line: SimulatedPartyLine, capsys: pytest.CaptureFixture[str]) -> None:
    example = load("three_axes_on_one_line")
    tour = example.tour

    async def interrupted(*arguments: Any) -> None:
        asyncio.get_running_loop().call_later(6.0, signal.raise_signal, signal.SIGINT)
        await tour(*arguments)

    vars(example)["tour"] = interrupted
    assert example.main(["sim://smc?name=table"]) == 130
    assert "interrupted; the axes were stopped" in capsys.readouterr().err
    assert Ending.STOP in party_line.log.texts(SmcLogKind.MOTION_ENDED, axis="X")
    assert not any(axis.moving for axis in party_line.axes.values())


def test_an_axis_that_fails_leaves_the_others_of_its_line_standing(
    party_line: SimulatedPartyLine, capsys: pytest.CaptureFixture[str]
) -> None:
    example = load("three_axes_on_one_line")
    tour = example.tour

    async def disturbed(*arguments: Any) -> None:
        asyncio.get_running_loop().call_later(6.0, party_line.axes["X"].reset)
        await tour(*arguments)

    vars(example)["tour"] = disturbed
    assert example.main(["sim://smc?name=table"]) == 1
    assert "MoveStoppedError: table axis X: move to 9000 steps ended at 0.00 steps" in capsys.readouterr().err
    assert not any(axis.moving for axis in party_line.axes.values())


@pytest.mark.parametrize("axes", ["XY", "XYZA"])
def test_no_more_and_no_fewer_than_three_axes_are_moved(
    party_line: SimulatedPartyLine, capsys: pytest.CaptureFixture[str], axes: str
) -> None:
    with pytest.raises(SystemExit):
        load("three_axes_on_one_line").main(["sim://smc?name=table", "--axes", axes])
    assert "--axes are three letters" in capsys.readouterr().err
    assert not party_line.log.texts(SmcLogKind.RECEIVED)


# Pick and place


def test_the_gripper_is_switched_on_the_way(
    virtual_clock: Callable[[str], SimulatedDrive], capsys: pytest.CaptureFixture[str]
) -> None:
    drive = virtual_clock("one")
    assert load("pick_and_place").main(["sim://compax?name=one", "--parts", "1"]) == 0
    assert lines_of(capsys) == [
        "part 1",
        "  15 units on the way: O9=1",
        "at 20 units",
        "  150 units on the way: O10=1",
        "  295 units on the way: O9=0",
        "at 320 units",
        "  10 units on the way: O10=0",
        "at 0 units",
    ]
    assert drive.log.texts(LogKind.OUTPUT) == ["O9=1", "O10=1", "O9=0", "O10=0"]


# A program of the drive


def test_a_program_is_downloaded_run_and_watched(
    virtual_clock: Callable[[str], SimulatedDrive], capsys: pytest.CaptureFixture[str]
) -> None:
    drive = virtual_clock("one")
    assert load("run_program").main(["sim://compax?name=one"]) == 0
    told = lines_of(capsys)
    assert told[0] == "8 records written, 2 were there"
    assert told[-1] == "the program has ended at 0.00 units"
    assert len(told) > 8, "it was not watched on its way"
    assert drive.log.texts(LogKind.OUTPUT) == ["O9=1", "O9=0"] * 2


@pytest.mark.parametrize(("text", "says"), [("N001: POSA 5\nN002: GOTO 9\n", "no N009"), (None, "FileNotFoundError: ")])
def test_a_listing_that_cannot_be_run_is_told_and_nothing_moves(
    virtual_clock: Callable[[str], SimulatedDrive],
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    text: str | None,
    says: str,
) -> None:
    drive = virtual_clock("one")
    path = tmp_path / "listing.txt"
    if text is not None:
        path.write_text(text)
    assert load("run_program").main(["sim://compax?name=one", "--listing", str(path)]) == 1
    assert says in capsys.readouterr().err
    assert drive.log.texts(LogKind.MOTION_STARTED, LogKind.PROGRAM) == []


@pytest.mark.parametrize(
    ("disturb", "status", "told"), [("fault", 1, "DriveFaultError: axis: a fault"), ("ctrl-c", 130, "was stopped")]
)
def test_a_program_that_is_disturbed_leaves_the_axis_standing(
    virtual_clock: Callable[[str], SimulatedDrive],
    capsys: pytest.CaptureFixture[str],
    disturb: str,
    status: int,
    told: str,
) -> None:
    drive = virtual_clock("one")
    example = load("run_program")
    run = example.run

    async def disturbed(*arguments: Any) -> None:
        loop = asyncio.get_running_loop()
        if disturb == "fault":
            loop.call_later(1.0, drive.raise_fault, 55)
        else:
            loop.call_later(1.0, signal.raise_signal, signal.SIGINT)
        await run(*arguments)

    vars(example)["run"] = disturbed
    assert example.main(["sim://compax?name=one"]) == status
    assert told in capsys.readouterr().err
    assert not drive.moving
    assert not drive.log.texts(LogKind.PROGRAM)[-1].startswith(("started", "continued"))


# The service


@asynccontextmanager
async def service(capsys: pytest.CaptureFixture[str], url: str) -> AsyncIterator[tuple[asyncio.Task[None], int]]:
    serving = asyncio.create_task(load("service").serve(url, 0))
    told = ""
    while "serving on port" not in told:
        await asyncio.sleep(0.01)
        assert not serving.done()
        told += capsys.readouterr().out
    yield serving, int(told.split("serving on port ")[1].split()[0])
    serving.cancel()
    await asyncio.wait([serving])


async def test_the_service_does_jobs(capsys: pytest.CaptureFixture[str]) -> None:
    async with service(capsys, "sim://compax") as (_, port):
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(b"120.5\nwhere\nup\nnan\n")
        assert await reader.readline() == b"reached 120.50\n"
        assert await reader.readline() == b"at 120.50\n"
        assert (await reader.readline()).startswith(b"error: could not convert")
        assert (await reader.readline()).startswith(b"error: position must be finite")
        writer.close()
        await writer.wait_closed()


async def test_one_client_of_the_service_stops_the_move_of_another(capsys: pytest.CaptureFixture[str]) -> None:
    async with service(capsys, "sim://compax") as (_, port):
        mover, to_mover = await asyncio.open_connection("127.0.0.1", port)
        other, to_other = await asyncio.open_connection("127.0.0.1", port)
        to_mover.write(b"1000\n")
        await asyncio.sleep(1)
        to_other.write(b"5\nstop\n")
        assert b"move_to(1000) is running" in await other.readline()
        assert (await other.readline()).startswith(b"stopped at ")
        assert b"was stopped at" in await mover.readline()
        for writer in (to_mover, to_other):
            writer.close()
            await writer.wait_closed()


async def test_the_service_is_cancelled_in_the_middle_of_a_move_and_leaves_its_axis_standing(
    capsys: pytest.CaptureFixture[str],
) -> None:
    drive = drive_named("axis")
    async with service(capsys, "sim://compax?name=axis") as (serving, port):
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(b"1000\n")
        await asyncio.sleep(1)
        moved = drive.log.texts(LogKind.MOTION_STARTED)
        assert moved[-1] == "POSA 1000.00"
        serving.cancel()
        await asyncio.wait([serving])
        assert serving.cancelled()
        assert not drive.moving
        assert 0 < drive.position < 1000
        (stopped,) = drive.log.texts(LogKind.MOTION_STOPPED)
        assert float(stopped) == pytest.approx(drive.position, abs=0.01)
        assert [entry.kind for entry in drive.log][-1] is LogKind.DISCONNECTED
        assert await reader.read() == b"", "the client was not hung up on"
        writer.close()
        await writer.wait_closed()


async def test_the_service_ends_when_its_line_is_lost(capsys: pytest.CaptureFixture[str]) -> None:
    async with serve_tcp(SimulatedDrive()) as url:
        serving = asyncio.create_task(load("service").serve(url, 0))
        await asyncio.sleep(5)
        assert not serving.done()
    with pytest.raises(ExceptionGroup) as failure:
        await serving
    assert [type(error) for error in failure.value.exceptions] == [ConnectionLostError]


@pytest.mark.real_time
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
async def test_the_service_ends_on_a_signal(number: signal.Signals) -> None:
    process = await asyncio.create_subprocess_exec(
        sys.executable, EXAMPLES / "service.py", "--port", "0", stdout=asyncio.subprocess.PIPE
    )
    assert process.stdout is not None
    line = await process.stdout.readline()
    assert line.startswith(b"serving on port ")
    _, writer = await asyncio.open_connection("127.0.0.1", int(line.split()[-1]))
    writer.write(b"1000\n")
    await writer.drain()
    process.send_signal(number)
    told = await process.stdout.read()
    assert await process.wait() == 0
    assert b"terminated; the axis was stopped and its line closed" in told
    writer.close()


def _entries(drive: SimulatedDrive) -> list[tuple[float, LogKind, str]]:
    return [(entry.at, entry.kind, entry.text) for entry in drive.log]
