"""``compax stop``: STOP first, on all lines at once, whatever becomes of the others; and each is told."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.fakes.commands import Commands

from compax_aio import DriveSettings
from compax_aio.compax.settings import Dialect
from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive

X, Y, Z = (f"sim://compax?name={axis}" for axis in "xyz")


@pytest.fixture
def compax(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Iterator[Commands]:
    commands = Commands(monkeypatch, capsys)
    yield commands
    commands.close()


def moving(compax: Commands, name: str, **knobs: float) -> SimulatedDrive:
    """A drive that somebody has set in motion and left alone."""
    drive = compax.drive(name, Knobs(homed=True, nominal_speed=20, **knobs))  # type: ignore[arg-type]
    assert compax("move", f"sim://compax?name={name}", "1000", "--detach").code == 0
    assert drive.moving
    return drive


def lines_since(drive: SimulatedDrive, before: int) -> list[str]:
    return [entry.text for entry in list(drive.log)[before:] if entry.kind is LogKind.LINE]


def test_stop_goes_before_everything(compax: Commands) -> None:
    x = moving(compax, "x")
    before = len(x.log)
    outcome = compax("stop", X, "--name", "x")
    assert outcome.code == 0
    assert outcome.out == f"x has acknowledged STOP and stands at {x.position:.2f} units\n"
    assert lines_since(x, before)[0] == "STOP"
    assert not x.moving


def test_all_are_stopped_at_once_and_one_that_fails_holds_up_none(compax: Commands) -> None:
    x, y, z = (moving(compax, axis) for axis in "xyz")
    y.silent = True
    before = {drive: len(drive.log) for drive in (x, y, z)}
    outcome = compax("stop", X, Y, Z, "loop://nobody", X)
    assert outcome.code == 4
    assert not x.moving
    assert not z.moving
    times = [list(drive.log)[at + 1].at for drive, at in before.items()]
    assert max(times) - min(times) < 0.001, "they were stopped one after the other"
    assert outcome.out.count("has acknowledged STOP and stands") == 2
    assert "STOP was sent, and not acknowledged" in outcome.told
    assert "loop://nobody: STOP was not sent: " in outcome.told


def test_programs_read_of_each_how_it_went(compax: Commands) -> None:
    x = moving(compax, "x")
    outcome = compax("stop", X, "loop://nobody", "--json")
    assert outcome.code == 3
    stopped, failed = outcome.document
    assert (stopped["url"], stopped["stopped"], stopped["position"]) == (X, True, round(x.position, 2))
    assert (failed["stopped"], failed["error"]["kind"]) == (False, "TransportError")
    assert outcome.err == ""


def test_a_drive_that_was_standing_with_a_fault_is_told_of(compax: Commands) -> None:
    compax.drive("x").raise_fault(55, 0.0)
    assert "it reports a fault, which `compax status` shows" in compax("stop", X).told


def test_a_settings_file_that_cannot_be_used_stops_no_stop(compax: Commands, tmp_path: Path) -> None:
    x = moving(compax, "x")
    (tmp_path / "x.toml").write_text("answer_timeout_s = 'soon'")
    outcome = compax("stop", X, "--settings", str(tmp_path / "x.toml"))
    assert outcome.code == 0
    assert "STOP is sent without the settings" in outcome.err
    assert not x.moving


def test_a_recording_that_cannot_be_written_stops_no_stop(compax: Commands, tmp_path: Path) -> None:
    x = moving(compax, "x")
    outcome = compax("stop", X, "--trace", str(tmp_path / "no folder" / "x.trace"))
    assert outcome.code == 0
    assert "STOP is sent without being recorded" in outcome.err
    assert not x.moving


def test_the_word_for_stop_is_that_of_the_settings(compax: Commands, tmp_path: Path) -> None:
    x = moving(compax, "x")
    DriveSettings(dialect=Dialect(stop="HALT")).save(tmp_path / "x.toml")
    outcome = compax("stop", X, "--settings", str(tmp_path / "x.toml"))
    assert outcome.code == 5
    assert "HALT" in x.log.texts(LogKind.LINE)
    assert x.moving


def test_one_name_does_not_fit_several_lines(compax: Commands) -> None:
    assert compax("stop", X, Y, "--name", "x").code == 2


def test_it_wants_a_line(compax: Commands) -> None:
    assert compax("stop").code == 2


def test_an_interrupted_stop_ends_at_the_standstill(compax: Commands) -> None:
    x = moving(compax, "x", stop_ramp_ms=3000)
    compax.after(0.02, lambda: signal.raise_signal(signal.SIGINT))
    outcome = compax("stop", X)
    assert outcome.code == 130
    assert "Interrupted. All drives have acknowledged STOP and stand." in outcome.told
    assert not x.moving


@pytest.mark.parametrize("patience_s", [1.0, 10.0], ids=["which does not come to its end", "which fails"])
def test_an_interrupted_stop_says_of_which_it_is_not_known(compax: Commands, tmp_path: Path, patience_s: float) -> None:
    x, y = moving(compax, "x", stop_ramp_ms=300), moving(compax, "y")
    DriveSettings(standstill_timeout_s=patience_s).save(tmp_path / "all.toml")
    y.silent = True
    compax.after(0.1, lambda: signal.raise_signal(signal.SIGINT))
    outcome = compax("stop", X, Y, "--settings", str(tmp_path / "all.toml"))
    assert outcome.code == 130
    assert f"Whether these stand is not known, look at them: {Y}\n" in outcome.err
    assert not x.moving
