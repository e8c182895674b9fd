"""``compax home``: machine zero found, or said why not."""

from __future__ import annotations

import signal
from collections.abc import Iterator

import pytest
from tests.fakes.commands import Commands

from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive

X = "sim://compax?name=x"


@pytest.fixture
def compax(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Iterator[Commands]:
    commands = Commands(monkeypatch, capsys)
    yield commands
    commands.close()


@pytest.fixture
def x(compax: Commands) -> SimulatedDrive:
    return compax.drive("x", Knobs(machine_zero=-400.0))


def test_machine_zero_is_found(compax: Commands, x: SimulatedDrive) -> None:
    outcome = compax("home", X, "--name", "x")
    assert outcome.code == 0
    assert outcome.out.startswith("x: machine zero reached in ")
    assert "confirmed by the drive's status (S16, S17)" in outcome.out
    assert x.homed


def test_programs_read_a_target_of_none(compax: Commands, x: SimulatedDrive) -> None:
    document = compax("home", X, "--json").document
    assert document["target"] is None
    assert document["position"] == 0.0


def test_ctrl_c_stops_the_search(compax: Commands, x: SimulatedDrive) -> None:
    compax.after(1.0, lambda: signal.raise_signal(signal.SIGINT))
    outcome = compax("home", X, "--name", "x")
    assert outcome.code == 130
    assert "x has acknowledged STOP and stands at" in outcome.told
    assert not x.moving
    assert not x.homed


def test_a_search_that_takes_too_long_is_stopped(compax: Commands, x: SimulatedDrive) -> None:
    assert compax("home", X, "--timeout", "0.5").code == 7
    assert not x.moving
    lines = len(x.log)
    assert compax("home", X, "--timeout", "-1").code == 2
    assert len(x.log) == lines
    assert x.log.texts(LogKind.MOTION_STARTED) == ["POSA HOME -400.00"]
