"""Real zero: P1 shifts S1, and one word makes it the place where the axis is."""

from __future__ import annotations

import pytest
from tests.simulator.compax.terminal import PROMPT, Terminal

from compax_aio.errors import TransportError
from compax_aio.simulator.compax import Knobs, LogKind


@pytest.fixture
def terminal() -> Terminal:
    """The axis is at 30 from machine zero; the password is active."""
    terminal = Terminal(position=30, homed=True)
    terminal.say("GOTO 302")
    return terminal


def test_p1_shifts_positions_when_it_is_valid(terminal: Terminal) -> None:
    """UG p. 104; in which direction is a choice."""
    assert terminal.ask("P1=12.5") == ""
    assert terminal.ask("S1") == "S001: 30.00"
    assert terminal.ask("VP") == ""
    assert (terminal.ask("S1"), terminal.ask("S2"), terminal.ask("S3")) == (
        "S001: 17.50", "S002: 17.50", "S003: 0.00",
    )  # fmt: skip
    assert terminal.motions() == []
    terminal.say("PA 0", 5)
    terminal.ask("P1=0")
    terminal.ask("VP")
    assert terminal.ask("S1") == "S001: 12.50"


def test_p1_shifts_at_once_where_no_vp_is_needed() -> None:
    terminal = Terminal(vp="at_once", password="off", position=30)
    assert terminal.ask("P1=10") == ""
    assert terminal.ask("S1") == "S001: 20.00"


def test_machine_zero_stays_where_it_is(terminal: Terminal) -> None:
    terminal.say("P1=12.5")
    terminal.say("VP")
    terminal.say("PH", 5)
    assert terminal.ask("S1") == "S001: -12.50"
    assert terminal.ask("S2") == "S002: -12.50"
    assert terminal.drive.homed
    assert terminal.motions() == ["motion_started POSA HOME -12.50", "motion_reached -12.50"]
    terminal.say("PA 0", 5)
    terminal.say("PH", 5)
    assert terminal.motions()[2:4] == ["motion_started POSA 0.00", "motion_reached 0.00"]
    assert terminal.ask("S1") == "S001: -12.50"


def test_p1_waits_for_the_end_of_a_move(terminal: Terminal) -> None:
    terminal.say("P1=10")
    terminal.say("PA 100", 0.5)
    before = terminal.drive.position
    terminal.say("VP", 0)
    assert terminal.drive.position == pytest.approx(before, abs=1)
    terminal.wait(5)
    assert terminal.motions()[-1] == "motion_reached 100.00"
    assert terminal.ask("S1") == "S001: 90.00"
    assert terminal.ask("S2") == "S002: 90.00"


def test_a_stopped_move_still_ends_at_the_same_place(terminal: Terminal) -> None:
    terminal.say("PA 200", 0.5)
    terminal.say("STOP", 1)
    terminal.say("P1=50")
    terminal.say("VP")
    terminal.say("START", 5)
    assert terminal.ask("S1") == "S001: 150.00"
    terminal.say("P1=0")
    terminal.say("VP")
    assert terminal.ask("S1") == "S001: 200.00"


@pytest.mark.parametrize("word", ["REALZERO", "REAL ZERO", "realzero"])
def test_real_zero_is_taken_where_the_axis_is(terminal: Terminal, word: str) -> None:
    assert terminal.ask(word) == ""
    assert terminal.ask("S1") == "S001: 0.00"
    assert terminal.ask("P1") == "P001: 30.000"
    terminal.say("PA 10", 5)
    terminal.ask(word)
    assert terminal.ask("P1") == "P001: 40.000"
    assert terminal.ask("S1") == "S001: 0.00"
    terminal.say("PH", 5)
    assert terminal.ask("S1") == "S001: -40.00"


def test_a_real_zero_between_two_steps_of_p1_is_as_fine_as_p1(terminal: Terminal) -> None:
    terminal.say("PA 200", 0.5)
    terminal.say("STOP", 1)
    stopped_at = terminal.drive.position
    terminal.say("REALZERO")
    assert float(terminal.ask("P1").split()[1]) == round(stopped_at, 3)
    assert abs(terminal.drive.position) <= 0.0005


def test_a_p1_that_waits_for_vp_is_overruled(terminal: Terminal) -> None:
    terminal.say("P1=5")
    terminal.say("REALZERO")
    assert terminal.ask("P1") == "P001: 30.000"
    terminal.say("VP")
    assert terminal.ask("S1") == "S001: 0.00"


def test_real_zero_is_not_taken_on_the_way(terminal: Terminal) -> None:
    terminal.say("PA 200", 0.5)
    assert terminal.ask("REALZERO") == "E92"
    terminal.wait(5)
    assert terminal.ask("S1") == "S001: 200.00"


def test_prepared_points_are_cancelled(terminal: Terminal) -> None:
    terminal.say("PR 5 OT O1=1")
    terminal.say("REALZERO")
    assert terminal.drive.prepared_points == 0
    assert terminal.say("PA 20$", 5) == PROMPT + b"$\r\n>"


def test_real_zero_outlives_the_power_and_the_position_does_not(terminal: Terminal) -> None:
    terminal.say("REALZERO")
    terminal.drive.power_cycle()
    assert terminal.ask("P1") == "P001: 30.000"
    assert not terminal.drive.homed
    terminal.say("PH", 5)
    assert terminal.ask("S1") == "S001: -30.00"


def test_a_real_zero_that_p1_cannot_hold_is_refused() -> None:
    terminal = Terminal(position=4_000_000, password="off", vp="at_once")
    terminal.say("P1=8388607")
    assert terminal.ask("S1") == "S001: -4388607.00"
    terminal.say("P1=-8388607")
    terminal.say("PA -3000000", 1e6)
    assert terminal.ask("REALZERO") == "E91"
    assert terminal.ask("P1") == "P001: -8388607.000"


def test_the_word_is_one_of_your_own() -> None:
    terminal = Terminal(real_zero_word="SET ZERO", position=5)
    assert terminal.ask("REALZERO") == "E90"
    assert terminal.ask("SETZERO 1") == "E90"
    assert terminal.ask("SETZERO") == ""
    assert terminal.ask("S1") == "S001: 0.00"
    assert terminal.ask("N1 SETZERO") == "E90"
    assert Knobs.from_query({"real_zero_word": "RZ"}).real_zero_word == "RZ"


@pytest.mark.parametrize("word", ["", "R", "rz", "RZ1", "STOP", "PA", "POSA HOME", "VP", " RZ", 21 * "R"])
def test_a_word_that_could_mean_something_else_is_refused(word: str) -> None:
    with pytest.raises(TransportError, match=r"real_zero_word=.*allowed: 2 to 20 capitals"):
        Knobs(real_zero_word=word)


def test_nothing_of_this_moves_the_axis(terminal: Terminal) -> None:
    for line in ("P1=12.5", "VP", "REALZERO"):
        terminal.say(line, 1)
    assert terminal.drive.log.texts(LogKind.MOTION_STARTED) == []
