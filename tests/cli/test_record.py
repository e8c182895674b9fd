"""``compax record``: it ends when it should, says how much was recorded, and stops the axis where it moved one."""

from __future__ import annotations

import asyncio
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pexpect
import pytest
from tests.fakes.commands import Commands
from tests.promises.cable import Cable, outage

from compax_aio.recording import motion_file, read_record
from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive
from compax_aio.simulator.server import serve_tcp

X = "x=sim://compax?name=x"


@pytest.fixture
def compax(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Iterator[Commands]:
    commands = Commands(monkeypatch, capsys)
    yield commands
    commands.close()


@pytest.fixture
def x(compax: Commands) -> SimulatedDrive:
    return compax.drive("x", Knobs(homed=True, baudrate=9600))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "run.csv"


def test_so_many_seconds_are_recorded_and_the_rate_is_told(compax: Commands, x: SimulatedDrive, path: Path) -> None:
    outcome = compax("record", X, "-o", str(path), "--seconds", "10")
    assert outcome.code == 0
    read = read_record(path)
    assert read.duration_s == pytest.approx(10, abs=0.1)
    assert (read.ended, read.cut) == ("as asked", None)
    assert outcome.err == f"recording x to {path}; Ctrl-C ends it\n"
    rate = read.samples / read.duration_s
    assert outcome.out == f"{path}: {read.samples} values in 10.0 s; values a second: x {rate:.1f}\n"
    assert rate > 40


def test_the_document_has_all_that_is_told(compax: Commands, x: SimulatedDrive, path: Path) -> None:
    outcome = compax("record", X, "-o", str(path), "--seconds", "1", "--json")
    document = outcome.document
    read = read_record(path)
    assert read.started is not None
    assert document["started"] == read.started.isoformat()
    assert (document["file"], document["samples"]) == (str(path), read.samples)
    assert (document["missing"], document["rows_lost"], document["move"]) == (0, 0, None)
    assert document["samples_per_s"]["x"] == pytest.approx(read.samples / read.duration_s, abs=0.1)
    assert outcome.err == ""


def test_ctrl_c_ends_the_record_and_that_is_no_failure(compax: Commands, x: SimulatedDrive, path: Path) -> None:
    compax.after(2.0, lambda: signal.raise_signal(signal.SIGINT))
    outcome = compax("record", X, "-o", str(path))
    assert outcome.code == 0
    assert "values a second: x" in outcome.out
    assert "Interrupted" not in outcome.told
    read = read_record(path)
    assert read.cut is None
    assert read.duration_s == pytest.approx(2, abs=0.5)
    assert not x.log.texts(LogKind.MOTION_STARTED)


def test_a_move_is_recorded_to_a_little_after_its_end(compax: Commands, x: SimulatedDrive, path: Path) -> None:
    outcome = compax("record", X, "-o", str(path), "--move", "100", "--speed", "50", "--tail", "0.3")
    assert outcome.code == 0
    assert outcome.out.startswith("x: 100.00 units reached in 1.")
    assert x.position == 100
    read = read_record(path)
    accepted, *_, reached = read.marks
    assert (accepted.word, reached.word) == ("accepted", "reached")
    assert read.duration_s - reached.time_s == pytest.approx(0.3, abs=0.05)


def test_a_move_to_a_negative_position_is_one(compax: Commands, x: SimulatedDrive, path: Path) -> None:
    outcome = compax("record", X, "-o", str(path), "--move", "-12.5", "--json")
    assert outcome.code == 0
    assert x.position == -12.5
    assert outcome.document["move"]["target"] == -12.5


def test_ctrl_c_on_a_move_stops_the_axis_and_says_so(compax: Commands, x: SimulatedDrive, path: Path) -> None:
    compax.after(2.0, lambda: signal.raise_signal(signal.SIGINT))
    outcome = compax("record", X, "-o", str(path), "--move", "1000")
    assert outcome.code == 130
    assert f"Interrupted. x has acknowledged STOP and stands at {x.position:.2f} units." in outcome.told
    assert "values a second: x" in outcome.out
    assert not x.moving
    read = read_record(path)
    assert (read.ended, read.cut) == ("CancelledError", None)
    assert {"accepted", "cancelled", "standstill"} <= {mark.word for mark in read.marks}


def test_a_move_that_fails_has_its_exit_code_and_its_record(compax: Commands, x: SimulatedDrive, path: Path) -> None:
    compax.after(2.0, lambda: x.raise_fault(55))
    outcome = compax("record", X, "-o", str(path), "--move", "1000")
    assert outcome.code == 7
    assert "E55" in outcome.err
    assert "fault" in [mark.word for mark in read_record(path).marks]


def test_several_axes_are_recorded_into_one_file(compax: Commands, x: SimulatedDrive, path: Path) -> None:
    y = compax.drive("y", Knobs(homed=True, position=7))
    outcome = compax(
        "record", X, "y=sim://compax?name=y", "-o", str(path), "--seconds", "1", "-q", "position", "--interval", "0.1"
    )
    assert outcome.code == 0
    read = read_record(path)
    assert list(read.axes) == ["x", "y"]
    assert list(read.axes["y"].traces) == ["position"]
    assert next(read.axes["y"].traces["position"].samples())[1] == y.position
    assert 9 <= len(read.axes["x"].traces["position"]) <= 11


def test_settings_of_one_axis_and_a_trace_are_taken(compax: Commands, x: SimulatedDrive, tmp_path: Path) -> None:
    (tmp_path / "x.toml").write_text('unit = "mm"\n')
    path, trace = tmp_path / "run.csv", tmp_path / "run.jsonl"
    words = ("--settings", f"x={tmp_path / 'x.toml'}", "--trace", str(trace), "--seconds", "1")
    assert compax("record", X, "-o", str(path), *words).code == 0
    assert read_record(path).axes["x"].unit == "mm"
    assert "S1" in trace.read_text()


def test_what_is_missing_is_told(compax: Commands, x: SimulatedDrive, path: Path) -> None:
    outcome = compax("record", X, "-o", str(path), "-q", "S40", "-q", "position", "--seconds", "1")
    assert outcome.code == 0
    assert "1 were asked for and not said" in outcome.out
    assert "S40 cannot be recorded" in outcome.err


def test_a_file_that_is_there_is_kept_unless_force_is_said(compax: Commands, x: SimulatedDrive, path: Path) -> None:
    path.write_text("mine")
    outcome = compax("record", X, "-o", str(path), "--seconds", "1")
    assert outcome.code == 2
    assert "is there already" in outcome.err
    assert path.read_text() == "mine"
    assert compax("record", X, "-o", str(path), "--seconds", "1", "--force").code == 0


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--seconds", "0"), "--seconds must be above 0"),
        (("--tail", "-1"), "--tail must not be below 0"),
        (("--speed", "10"), "there is no --move"),
        (("--move", "5", "--seconds", "5"), "take one of both"),
        (("--move", "1e9"), "within ±4,000,000"),
        (("--move", "5", "--speed", "0"), "speed_percent"),
        (("y=sim://compax", "--move", "5"), "--move is for one axis"),
        (("-q", "postion"), "'postion' cannot be recorded; possible are position"),
        (("--interval", "0"), "interval_s must be above 0"),
        (("--line-share", "2"), "line_share is above 0 and at most 1"),
    ],
)
def test_what_means_nothing_is_refused_before_a_line_is_opened(
    compax: Commands, x: SimulatedDrive, path: Path, words: tuple[str, ...], says: str
) -> None:
    outcome = compax("record", X, *words, "-o", str(path))
    assert outcome.code == 2
    assert says in outcome.told
    assert len(x.log) == 0
    assert not path.exists()


def test_another_form_of_file_is_refused(compax: Commands, x: SimulatedDrive, tmp_path: Path) -> None:
    outcome = compax("record", X, "-o", str(tmp_path / "run.xls"))
    assert outcome.code == 2
    assert "ends in .csv or .parquet" in outcome.told


def test_a_line_that_cannot_be_opened_leaves_no_file(compax: Commands, path: Path) -> None:
    outcome = compax("record", "tcp://127.0.0.1:1", "-o", str(path))
    assert outcome.code == 3
    assert not path.exists()


def test_the_display_shows_values_rate_and_a_line_that_is_lost(
    compax: Commands, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    far, cable = SimulatedDrive(Knobs(homed=True, position=12.5), name="x"), Cable()
    compax.loop.run_until_complete(cable.plug(far))
    compax.after(2.0, lambda: compax.loop.create_task(outage(cable, far, 1.0)))
    outcome = compax("record", f"x={cable.url}", "-o", str(path), "--seconds", "8")
    compax.loop.run_until_complete(cable.pull())
    assert outcome.code == 0
    assert "/s   position 12.50   target 12.50   following error 0.00" in outcome.err
    assert "Ctrl-C ends it" in outcome.err
    assert "the line is lost, and tried again" in outcome.err
    assert [mark.word for mark in read_record(path).marks] == ["connection lost", "connection restored"]


def test_rows_that_are_lost_are_told(
    compax: Commands, x: SimulatedDrive, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(motion_file, "_MAX_WAITING", 10)
    outcome = compax("record", X, "-o", str(path), "--seconds", "3")
    assert outcome.code == 0
    assert f"{read_record(path).rows_lost} rows were lost, for the disk was too slow" in outcome.out


def test_a_status_value_is_recorded_by_its_number_and_half_of_the_line_is_left(
    compax: Commands, x: SimulatedDrive, path: Path
) -> None:
    outcome = compax("record", X, "-o", str(path), "-q", "S5", "--seconds", "1", "--line-share", "0.5")
    assert outcome.code == 0
    assert read_record(path).axes["x"].traces["S5"].unit == "%"


@pytest.mark.real_time
async def test_at_a_terminal_rate_and_values_are_shown_until_ctrl_c(tmp_path: Path) -> None:
    drive = SimulatedDrive(Knobs(homed=True, position=12.5, baudrate=9600), name="terminal")
    async with serve_tcp(drive) as url:
        words = ["-m", "compax_aio.cli", "record", f"x={url}", "-o", str(tmp_path / "run.csv")]
        code, told = await asyncio.to_thread(_watch_and_interrupt, words)
    assert code == 0
    assert "position 12.50" in told
    assert "/s" in told
    assert "Ctrl-C ends it" in told
    assert "values a second: x" in told
    assert read_record(tmp_path / "run.csv").cut is None


def _watch_and_interrupt(words: list[str]) -> tuple[int | None, str]:
    terminal: Any = pexpect.spawn(sys.executable, words, dimensions=(30, 150), timeout=60, encoding="utf-8")
    try:
        terminal.expect("position 12.50")
        told = terminal.before + terminal.after
        terminal.expect("Ctrl-C ends it")
        told += terminal.before + terminal.after
        terminal.sendintr()
        terminal.expect(pexpect.EOF)
        return terminal.wait(), told + terminal.before
    finally:
        terminal.close(force=True)
