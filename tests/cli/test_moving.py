"""What is seen at a terminal while an axis moves, and what keys do there: in this process, on a virtual clock."""

from __future__ import annotations

import os
import pty
import signal
import sys
from collections.abc import Callable, Iterator
from functools import partial

import pytest
from tests.fakes.commands import Commands

from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive

X = "sim://compax?name=x"


@pytest.fixture
def compax(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Iterator[Commands]:
    commands = Commands(monkeypatch, capsys)
    monkeypatch.setattr(type(sys.stderr), "isatty", lambda _: True)
    monkeypatch.setenv("TERM", "xterm")
    yield commands
    commands.close()


@pytest.fixture
def x(compax: Commands) -> SimulatedDrive:
    return compax.drive("x", Knobs(homed=True))


@pytest.fixture
def types(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[bytes], object]]:
    """A terminal as the input, and what types at it."""
    ours, theirs = pty.openpty()
    with os.fdopen(theirs) as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        yield partial(os.write, ours)
    os.close(ours)


def test_a_bar_goes_from_start_to_target(compax: Commands, x: SimulatedDrive) -> None:
    outcome = compax("move", X, "100", "--name", "x")
    assert outcome.code == 0
    for each in ("x → 100.00 units", "PA100$ is on its way", "━"):
        assert each in outcome.err


def test_a_distance_has_its_target_as_soon_as_it_is_known(compax: Commands, x: SimulatedDrive) -> None:
    x.extra_answer_delay_s = 0.3
    outcome = compax("move", X, "-100", "--by", "--name", "x")
    assert "x → …" in outcome.err
    assert "move_by(-100) waits to be sent" in outcome.err
    assert "PR-100$ was sent, and not accepted yet" in outcome.err
    assert "x → -100.00 units" in outcome.err


def test_a_move_to_where_the_axis_is_has_no_way_to_go(compax: Commands, x: SimulatedDrive) -> None:
    assert compax("move", X, "0").code == 0


def test_a_search_has_no_target(compax: Commands) -> None:
    compax.drive("far", Knobs(machine_zero=-200))
    outcome = compax("home", "sim://compax?name=far", "--name", "far")
    assert "far → …" in outcome.err
    assert "PH is on its way" in outcome.err


def test_nothing_is_drawn_for_programs(compax: Commands, x: SimulatedDrive) -> None:
    assert compax("move", X, "100", "--json").err == ""


def test_a_line_that_is_lost_is_told_in_the_bar(compax: Commands, x: SimulatedDrive) -> None:
    compax.after(0.8, lambda: setattr(x, "silent", True))
    compax.after(60.0, lambda: setattr(x, "silent", False))
    outcome = compax("move", X, "4000", "--name", "x")
    assert outcome.code == 8
    for each in ("PA4000$ is on its way", "the line is lost, and tried again; the axis may be moving"):
        assert each in outcome.err


def test_a_program_that_runs_shows_where_the_axis_is(compax: Commands, x: SimulatedDrive) -> None:
    x.load_program(["POSA 300", "END"])
    outcome = compax("program", "run", X, "--wait", "--name", "x")
    assert "x runs its program" in outcome.err
    assert "300.00 units" in outcome.out


def test_long_readings_have_a_bar(compax: Commands, x: SimulatedDrive) -> None:
    assert "250/250" in compax("params", "get", X).err


# Jogging by keys


def test_keys_move_and_leave(compax: Commands, x: SimulatedDrive, types: Callable[[bytes], object]) -> None:
    compax.after(1.0, lambda: types(b"\x1b[C"))
    compax.after(3.0, lambda: types(b"\x1b[D"))
    compax.after(5.0, lambda: types(b"q"))
    outcome = compax("jog", X, "--step", "5", "--name", "x")
    assert outcome.code == 0
    assert x.log.texts(LogKind.MOTION_STARTED) == ["POSR 5.00", "POSR 0.00"]  # by their targets
    assert "Nothing that was started here moves x; it is at 0.00 units." in outcome.told


@pytest.mark.parametrize(("keys", "code"), [(b"\x1b", 0), (b"\x04", 0), (b"Q", 0), (b"\x03", 130)])
def test_whoever_leaves_leaves_a_standing_axis(
    compax: Commands, x: SimulatedDrive, types: Callable[[bytes], object], keys: bytes, code: int
) -> None:
    compax.after(1.0, lambda: types(b"\x1b[C"))
    compax.after(2.0, lambda: types(keys))
    outcome = compax("jog", X, "--step", "1000", "--name", "x")
    assert outcome.code == code
    assert f"x has acknowledged STOP and stands at {x.position:.2f} units." in outcome.told
    assert not x.moving


def test_what_was_typed_before_is_not_heard(
    compax: Commands, x: SimulatedDrive, types: Callable[[bytes], object]
) -> None:
    types(b"\x1b[C\x1b[C\n")
    compax.after(2.0, lambda: types(b"q"))
    assert compax("jog", X).code == 0
    assert x.log.texts(LogKind.MOTION_STARTED) == []


def test_a_signal_while_jogging_stops_the_axis(
    compax: Commands, x: SimulatedDrive, types: Callable[[bytes], object]
) -> None:
    compax.after(1.0, lambda: types(b"\x1b[C"))
    compax.after(2.0, lambda: signal.raise_signal(signal.SIGTERM))
    outcome = compax("jog", X, "--step", "1000", "--name", "x")
    assert outcome.code == 143
    assert "Interrupted. x has acknowledged STOP and stands." in outcome.told
    assert not x.moving


def test_a_terminal_that_goes_away_ends_jogging(
    compax: Commands, x: SimulatedDrive, monkeypatch: pytest.MonkeyPatch
) -> None:
    ours, theirs = pty.openpty()
    compax.after(1.0, lambda: os.write(ours, b"\x1b[C"))
    compax.after(2.0, lambda: os.close(ours))
    with os.fdopen(theirs) as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        outcome = compax("jog", X, "--step", "1000")
    assert not x.moving
    assert "Traceback" not in outcome.told
