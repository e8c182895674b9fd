"""``compax move``: it says what became of the move, refuses what cannot be said, and stops the axis on a signal."""

from __future__ import annotations

import json
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.fakes.commands import Commands

from compax_aio import DriveSettings
from compax_aio.cli.printing import Printing
from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive

X = "sim://compax?name=x"


@pytest.fixture
def compax(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Iterator[Commands]:
    commands = Commands(monkeypatch, capsys)
    yield commands
    commands.close()


@pytest.fixture
def x(compax: Commands) -> SimulatedDrive:
    return compax.drive("x", Knobs(homed=True))


def test_the_result_says_target_time_confirmation_and_position(compax: Commands, x: SimulatedDrive) -> None:
    outcome = compax("move", X, "120.5", "--name", "x")
    assert outcome.code == 0
    assert outcome.out.startswith("x: 120.50 units reached in 0.8")
    assert outcome.out.endswith("confirmed by the drive's message ($); it stands at 120.50 units\n")
    assert outcome.err.splitlines() == ["x: PA120.5$ is on its way"]


@pytest.mark.parametrize("position", ["-12.5", "-3", "-.5", "-1e2"])
def test_negative_positions_are_positions(compax: Commands, x: SimulatedDrive, position: str) -> None:
    assert compax("move", X, position).code == 0
    assert x.position == float(position)


def test_by_is_a_distance(compax: Commands, x: SimulatedDrive) -> None:
    assert compax("move", X, "10").code == 0
    assert compax("move", X, "-3", "--by").code == 0
    assert x.position == 7.0


def test_speed_and_ramps_are_told_first(compax: Commands, x: SimulatedDrive) -> None:
    words = ("--speed", "20", "--acceleration-ms", "300", "--deceleration-ms", "400")
    assert compax("move", X, "10", *words).code == 0
    assert {"SD20", "AL300", "AL-400"} <= set(x.log.texts(LogKind.LINE))


def test_the_document_has_all_of_the_result(compax: Commands, x: SimulatedDrive) -> None:
    outcome = compax("move", X, "10", "--json", "--name", "x")
    document = outcome.document
    assert document["duration_s"] > 0
    assert (document["drive"], document["target"], document["position"]) == ("x", 10.0, 10.0)
    assert (document["confirmed_by"], document["unit"]) == ("message", "units")
    assert outcome.err == ""


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("1e9",), "within ±4,000,000"),
        (("nan",), "no number"),
        (("10", "--speed", "0"), "speed_percent"),
        (("10", "--acceleration-ms", "65001"), "65"),
        (("10", "--timeout", "0"), "timeout_s must be above 0"),
    ],
)
def test_what_cannot_be_said_is_refused_before_the_line_is_opened(
    compax: Commands, x: SimulatedDrive, words: tuple[str, ...], says: str
) -> None:
    outcome = compax("move", X, *words)
    assert outcome.code == 2
    assert says in outcome.told
    assert len(x.log) == 0


def test_decimals_and_unit_are_those_of_the_settings(compax: Commands, x: SimulatedDrive, tmp_path: Path) -> None:
    DriveSettings(unit="mm", travel=(-5.0, 50.0)).save(tmp_path / "x.toml")
    assert "10.00 mm reached" in compax("move", X, "10", "--settings", str(tmp_path / "x.toml")).out
    lines = len(x.log)
    assert compax("move", X, "51", "--settings", str(tmp_path / "x.toml")).code == 2
    assert len(x.log) == lines


def test_it_is_told_where_positions_count_from_nowhere(compax: Commands) -> None:
    compax.drive("new", Knobs())
    assert "machine zero is not approached" in compax("move", "sim://compax?name=new", "5").err
    assert "machine zero" not in compax("move", "sim://compax?name=new", "5", "--by").err
    assert compax("move", "sim://compax?name=new", "5", "--json").err == ""


def test_a_refusal_of_the_drive_has_its_exit_code(compax: Commands) -> None:
    compax.drive("short", Knobs(homed=True, travel_max=50))
    outcome = compax("move", "sim://compax?name=short", "51")
    assert outcome.code == 5
    assert "E93" in outcome.err


def test_a_move_that_takes_too_long_is_stopped_and_told(compax: Commands, x: SimulatedDrive) -> None:
    outcome = compax("move", X, "1000", "--timeout", "1")
    assert outcome.code == 7
    assert "was not at its target within 1 s and was stopped" in outcome.told
    assert not x.moving


def test_a_detached_move_goes_on(compax: Commands, x: SimulatedDrive) -> None:
    outcome = compax("move", X, "1000", "--detach", "--name", "x")
    assert outcome.code == 0
    assert outcome.out == "x has accepted PA1000$; it goes on, and nobody watches it. `compax stop` stops it.\n"
    assert x.moving
    assert compax("move", X, "5").code == 5, "a move that runs is refused by the drive"


def test_a_detached_move_that_is_refused_is_told(compax: Commands) -> None:
    compax.drive("short", Knobs(homed=True, travel_max=50))
    assert compax("move", "sim://compax?name=short", "51", "--detach").code == 5


# Signals


def interrupted_when_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let Ctrl-C come while the result is printed."""
    show = Printing.show

    def show_and_interrupt(printing: Printing, *told: Any) -> None:
        show(printing, *told)
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(Printing, "show", show_and_interrupt)


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)], ids=str
)
def test_a_signal_stops_the_axis_and_says_where_it_stands(
    compax: Commands, x: SimulatedDrive, number: signal.Signals, code: int
) -> None:
    compax.after(1.0, lambda: signal.raise_signal(number))
    outcome = compax("move", X, "1000", "--name", "x")
    assert outcome.code == code
    assert "Stopping x …" in outcome.err
    assert f"Interrupted. x has acknowledged STOP and stands at {x.position:.2f} units." in outcome.told
    assert not x.moving
    assert 0 < x.position < 1000


def test_a_program_reads_of_it_as_well(compax: Commands, x: SimulatedDrive) -> None:
    compax.after(1.0, lambda: signal.raise_signal(signal.SIGINT))
    outcome = compax("move", X, "1000", "--name", "x", "--json")
    assert outcome.code == 130
    assert outcome.document == {"drive": "x", "interrupted": True, "stopped": True, "position": round(x.position, 2)}


def test_a_signal_before_the_drive_has_accepted_stops_a_detached_move_too(compax: Commands, x: SimulatedDrive) -> None:
    x.extra_answer_delay_s = 0.3

    def interrupt_once_it_moves() -> None:
        if x.moving:
            signal.raise_signal(signal.SIGINT)
        else:
            compax.loop.call_later(0.02, interrupt_once_it_moves)

    compax.after(0.0, interrupt_once_it_moves)
    outcome = compax("move", X, "1000", "--detach", "--name", "x")
    assert outcome.code == 130
    assert not x.moving


def test_a_signal_after_a_detached_move_was_accepted_says_that_it_goes_on(
    compax: Commands, x: SimulatedDrive, monkeypatch: pytest.MonkeyPatch
) -> None:
    interrupted_when_shown(monkeypatch)
    outcome = compax("move", X, "1000", "--detach", "--name", "x")
    assert outcome.code == 130
    assert "Interrupted. x has accepted PA1000$; it goes on, and nobody watches it." in outcome.told
    assert "was stopped" not in outcome.told
    assert x.moving


def test_a_signal_after_the_target_was_reached_does_not_say_that_it_was_stopped(
    compax: Commands, x: SimulatedDrive
) -> None:
    def interrupt_while_the_position_is_read() -> None:
        if x.log.texts(LogKind.MOTION_REACHED):
            x.extra_answer_delay_s = 0.5
            compax.loop.call_later(0.3, signal.raise_signal, signal.SIGINT)
        else:
            compax.loop.call_later(0.001, interrupt_while_the_position_is_read)

    compax.after(0.0, interrupt_while_the_position_is_read)
    outcome = compax("move", X, "10", "--name", "x")
    assert outcome.code == 130
    assert outcome.told.endswith("Interrupted. x had reached 10.00 units before.")
    assert "STOP" not in x.log.texts(LogKind.LINE)


def test_a_signal_before_anything_was_sent_says_nothing_of_an_axis_that_stands(compax: Commands) -> None:
    compax.drive("mute", Knobs()).silent = True
    compax.after(0.2, lambda: signal.raise_signal(signal.SIGINT))
    outcome = compax("move", "sim://compax?name=mute", "5")
    assert outcome.code == 130
    assert outcome.err.strip() == "Interrupted. Nothing goes on that this command had set in motion."


def test_a_stop_that_is_not_acknowledged_is_said_to_be_none(compax: Commands, x: SimulatedDrive) -> None:
    def fall_silent_and_interrupt() -> None:
        x.silent = True
        signal.raise_signal(signal.SIGINT)

    compax.after(1.0, fall_silent_and_interrupt)
    outcome = compax("move", X, "4000", "--name", "x")
    assert outcome.code == 4
    assert "x may be moving: look at it, and use the emergency stop if it does." in outcome.told
    assert "STOP was not acknowledged" in outcome.told
    assert "stands" not in outcome.told.replace("look whether the machine stands", "")


def test_a_second_signal_says_what_is_not_known_and_the_axis_is_waited_for(compax: Commands) -> None:
    slow = compax.drive("slow", Knobs(homed=True, stop_ramp_ms=3000))
    for seconds in (1.0, 1.5):
        compax.after(seconds, lambda: signal.raise_signal(signal.SIGINT))
    outcome = compax("move", "sim://compax?name=slow", "4000", "--name", "slow")
    assert outcome.code == 130
    assert "Still at it: a stop is under way" in outcome.told
    assert "slow has acknowledged STOP and stands" in outcome.told
    assert not slow.moving


# Lines


def test_a_drive_that_is_silent_for_a_while_is_waited_for(compax: Commands, x: SimulatedDrive) -> None:
    compax.after(1.0, lambda: setattr(x, "silent", True))
    compax.after(4.0, lambda: setattr(x, "silent", False))
    outcome = compax("move", X, "1000", "--name", "x")
    assert outcome.code == 0
    assert "1000.00 units reached" in outcome.out


def test_nobody_there_is_told_with_its_exit_code(compax: Commands) -> None:
    assert compax("move", "loop://nobody", "5").code == 3
    compax.drive("mute", Knobs()).silent = True
    outcome = compax("move", "sim://compax?name=mute", "5", "--json")
    assert outcome.code == 4
    assert json.loads(outcome.err.splitlines()[-1])["error"]["kind"] == "AnswerTimeoutError"


def test_doubt_is_told_as_doubt_even_if_the_line_cannot_be_closed_with_a_stop(
    compax: Commands, x: SimulatedDrive
) -> None:
    compax.after(1.0, lambda: setattr(x, "silent", True))
    outcome = compax("move", X, "1000", "--name", "x")
    assert outcome.code == 8
    assert "MoveInDoubtError" in outcome.err
    assert "as the line was closed: x: STOP was not acknowledged" in outcome.told
