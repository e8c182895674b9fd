"""Commissioning looks first, moves nothing before it was told to, measures, and tells all of it in a report."""

from __future__ import annotations

import asyncio
import importlib.util
import io
import re
import signal
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pexpect
import pytest

from compax_aio.simulator.compax import SimulatedDrive
from compax_aio.simulator.server import serve_pty
from compax_aio.testing import Faults, SimulatedAxis, SimulatedGroup, VirtualTime

EXAMPLE = Path(__file__).parents[2] / "examples" / "commissioning.py"

LOOKING = ["identity", "serial interface", "state", "unit and travel", "parameters saved"]
MOVING = ["machine zero", "small moves", "stop"]

pytestmark = pytest.mark.usefixtures("folder", "nobody_at_the_terminal")


@pytest.fixture(name="example")
def load() -> ModuleType:
    spec = importlib.util.spec_from_file_location("example_commissioning", EXAMPLE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def nobody_at_the_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO())


def outcomes(path: str = "report.md") -> dict[str, str]:
    """Read the table of the report."""
    rows = re.findall(r"^\| ([^|]+) \| ([^|]+) \|$", Path(path).read_text(), re.MULTILINE)
    return dict(rows[1:])


def test_everything_is_found_in_order(
    example: ModuleType, simulated_group: SimulatedGroup, virtual_time: VirtualTime, capsys: pytest.CaptureFixture[str]
) -> None:
    axis = simulated_group.add("axis", machine_zero=-10.0, following_error_factor=0.01)
    assert example.main([axis.url, "--yes", "--output", "9", "--report", "report.md"]) == 0
    assert outcomes() == dict.fromkeys([*LOOKING, *MOVING, "comparator"], "ok")
    told = Path("report.md").read_text()
    assert told.startswith("# Commissioning of test://axis\n")
    assert "- to 10 units: 1.01 s, told by message, then +0.000 off; following error up to 0.100 in " in told
    assert re.search(r"STOP at 5 %: standstill was seen 0\.\d+ s later, 0\.\d+ units further on", told)
    assert re.search(r"O9 = 1 at 5 units; it was told when the axis was at 4\.\d+", told)
    assert "250 parameters are in report.parameters.toml" in told
    assert (
        "P20 = 0" in Path("report.parameters.toml").read_text() or "P20" in Path("report.parameters.toml").read_text()
    )
    axis.assert_never_commanded_outside(0, 10)
    assert "stopped" in [motion.ended_by for motion in axis.motions]
    assert axis.position == 0
    assert axis.far_end.outputs[9] is False
    assert "the report is in report.md" in capsys.readouterr().out


def test_the_other_direction_is_a_negative_distance(
    example: ModuleType, simulated_drive: SimulatedAxis, virtual_time: VirtualTime
) -> None:
    arguments = [
        simulated_drive.url,
        "--yes",
        "--distance=-8",
        "--speed",
        "20",
        "--output",
        "9",
        "--report",
        "report.md",
    ]
    assert example.main(arguments) == 0
    simulated_drive.assert_never_commanded_outside(-8, 0)


def test_without_anybody_to_ask_nothing_moves(
    example: ModuleType, simulated_drive: SimulatedAxis, virtual_time: VirtualTime
) -> None:
    assert example.main([simulated_drive.url, "--report", "report.md"]) == 1
    assert outcomes() == dict.fromkeys(LOOKING, "ok") | dict.fromkeys(MOVING, "not done")
    simulated_drive.assert_never_moved()


def test_a_fault_and_suppressed_errors_are_to_be_looked_at(
    example: ModuleType, simulated_group: SimulatedGroup, virtual_time: VirtualTime
) -> None:
    axis = simulated_group.add("axis", p20=3)
    axis.far_end.raise_fault(70)
    assert example.main([axis.url, "--report", "report.md"]) == 1
    told = outcomes()
    assert (told["serial interface"], told["state"], told["identity"]) == ("look", "look", "ok")
    assert "a refused command looks like an accepted one; change P20" in Path("report.md").read_text()


def test_a_message_that_does_not_come_is_to_be_looked_at(
    example: ModuleType, simulated_drive: SimulatedAxis, virtual_time: VirtualTime, faults: Faults
) -> None:
    faults.lose_position_reached(3)
    assert example.main([simulated_drive.url, "--yes", "--report", "report.md"]) == 1
    assert outcomes()["small moves"] == "look"
    assert "the status has told it" in Path("report.md").read_text()


def test_a_stop_that_comes_too_late_shows_nothing(
    example: ModuleType, simulated_group: SimulatedGroup, virtual_time: VirtualTime
) -> None:
    axis = simulated_group.add("axis", answer_time_s=0.2)
    assert example.main([axis.url, "--yes", "--distance", "1", "--speed", "100", "--report", "report.md"]) == 1
    assert outcomes()["stop"] == "look"


def test_a_fault_on_the_way_ends_it(
    example: ModuleType, simulated_drive: SimulatedAxis, virtual_time: VirtualTime, faults: Faults, capsys: Any
) -> None:
    faults.after(2.5).raise_fault(55)
    assert example.main([simulated_drive.url, "--yes", "--report", "report.md"]) == 1
    told = outcomes()
    assert [title for title, outcome in told.items() if outcome == "failed"] == [list(told)[-1]]
    assert "E55, emergency stop" in Path("report.md").read_text()
    assert "DriveFaultError" in capsys.readouterr().err
    simulated_drive.assert_standing()


def test_ctrl_c_stops_the_axis_and_keeps_the_report(
    example: ModuleType, simulated_drive: SimulatedAxis, virtual_time: VirtualTime, capsys: pytest.CaptureFixture[str]
) -> None:
    commission = example.commission

    async def interrupted(*arguments: Any) -> None:
        asyncio.get_running_loop().call_later(2.0, signal.raise_signal, signal.SIGINT)
        await commission(*arguments)

    vars(example)["commission"] = interrupted
    assert example.main([simulated_drive.url, "--yes", "--distance", "500", "--report", "report.md"]) == 130
    assert "interrupted; the axis was stopped, if it moved; report.md says how far it came" in capsys.readouterr().err
    assert outcomes()["small moves"] == "not done"
    simulated_drive.assert_stopped()


def test_what_cannot_be_written_ends_it_before_anything_moves(
    example: ModuleType, simulated_drive: SimulatedAxis, virtual_time: VirtualTime, capsys: pytest.CaptureFixture[str]
) -> None:
    assert example.main([simulated_drive.url, "--yes", "--report", "nowhere/report.md"]) == 1
    assert capsys.readouterr().err.startswith("FileNotFoundError: ")
    simulated_drive.assert_never_moved()


def test_a_move_of_no_length_is_refused(example: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        example.main(["--distance", "0"])
    assert "a move of no length shows nothing" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("option", "value", "says"),
    [
        ("--distance", "nan", "must be finite"),
        ("--distance", "9e9", "within"),
        ("--speed", "0", "above 0"),
        ("--speed", "900", "at most 100"),
        ("--output", "99", "outputs 1 to 16"),
    ],
)
def test_what_no_drive_can_be_told_is_refused_before_the_line_is_opened(  # noqa: PLR0917
    example: ModuleType,
    simulated_drive: SimulatedAxis,
    capsys: pytest.CaptureFixture[str],
    option: str,
    value: str,
    says: str,
) -> None:
    with pytest.raises(SystemExit):
        example.main([simulated_drive.url, "--yes", option, value])
    assert says in capsys.readouterr().err
    assert simulated_drive.lines == []


def test_a_distance_outside_of_the_travel_ends_it_before_anything_moves(
    example: ModuleType, simulated_group: SimulatedGroup, virtual_time: VirtualTime
) -> None:
    axis = simulated_group.add("short", travel_min=-5.0, travel_max=5.0)
    assert example.main([axis.url, "--yes", "--report", "report.md"]) == 1
    assert outcomes()["unit and travel"] == "failed"
    axis.assert_never_moved()


def test_the_axis_is_stopped_before_the_disk_is_asked_for_anything(
    example: ModuleType, simulated_drive: SimulatedAxis, faults: Faults, virtual_time: VirtualTime
) -> None:
    written = example.replace_file
    moving = []

    def looking(*arguments: Any) -> None:
        moving.append(simulated_drive.moving)
        written(*arguments)

    vars(example)["replace_file"] = looking
    faults.at(2.0).silent(for_s=1.5)
    options = ["--yes", "--distance", "500", "--speed", "5", "--report", "report.md"]
    assert example.main([simulated_drive.url, *options]) == 1
    assert outcomes()["small moves"] == "failed"
    assert not any(moving)


def test_a_report_has_a_name_of_its_own_and_no_password_in_it(
    example: ModuleType, virtual_time: VirtualTime, capsys: pytest.CaptureFixture[str]
) -> None:
    assert example.main([]) == 1
    (report,) = Path().glob("commissioning-*.md")
    assert outcomes(str(report))["comparator"] == "not done"
    assert example.main(["tcp://me:secret@nowhere:1"]) == 1
    assert "secret" not in capsys.readouterr().err


@pytest.mark.real_time
@pytest.mark.parametrize(("answer", "status"), [("yes\n", 0), ("\n", 1), ("\x03", 130)])
async def test_somebody_at_the_terminal_is_asked(answer: str, status: int, tmp_path: Path) -> None:
    far_end = SimulatedDrive()
    async with serve_pty(far_end) as url:
        arguments = [str(EXAMPLE), url, "--distance", "2", "--speed", "50", "--report", str(tmp_path / "report.md")]
        child = pexpect.spawn(sys.executable, arguments, timeout=60, encoding="utf-8", dimensions=(40, 120))
        await child.expect("a hand on the emergency stop\\? \\[yes/N\\] ", async_=True)
        assert not far_end.moving
        child.send(answer)
        await child.expect(pexpect.EOF, async_=True)
        child.close()
        assert child.exitstatus == status
    assert bool([line for line in far_end.log if line.kind.value == "motion_started"]) is (status == 0)
