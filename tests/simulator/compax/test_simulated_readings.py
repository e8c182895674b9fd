"""S13, S14 and S15 show what parameters choose; diagnosis and identification are there."""

from __future__ import annotations

import pytest
from tests.simulator.compax.terminal import Terminal


@pytest.fixture
def terminal() -> Terminal:
    terminal = Terminal(position=12.5)
    terminal.say("GOTO 302")
    return terminal


def choose(terminal: Terminal, parameter: int, quantity: int) -> None:
    assert terminal.ask(f"P{parameter}={quantity}") == ""
    assert terminal.ask("VP") == ""


@pytest.mark.parametrize(("status", "parameter"), [(13, 233), (14, 234), (15, 182)])
@pytest.mark.parametrize(
    ("quantity", "shown"), [(27, "12.50"), (28, "0.00"), (29, "30.00"), (30, "25.00"), (18, "0.00"), (5, "0.00")]
)
def test_a_parameter_chooses_what_is_shown(
    terminal: Terminal, status: int, parameter: int, quantity: int, shown: str
) -> None:
    """UG p. 211."""
    assert terminal.ask(f"S{status}") == f"S{status:03d}: 0.00"
    choose(terminal, parameter, quantity)
    assert [terminal.ask(f"S{each}") for each in (13, 14, 15)] == [
        f"S{each:03d}: {shown if each == status else '0.00'}" for each in (13, 14, 15)
    ]


def test_a_choice_is_shown_from_vp_on(terminal: Terminal) -> None:
    terminal.say("P182=29")
    assert terminal.ask("S15") == "S015: 0.00"
    terminal.say("VP")
    assert terminal.ask("S15") == "S015: 30.00"


def test_the_encoder_goes_with_the_axis(terminal: Terminal) -> None:
    choose(terminal, 233, 27)
    terminal.say("PA 100", 0.3)
    assert 12.5 < float(terminal.ask("S13").split()[1]) < 100
    terminal.wait(5)
    assert terminal.ask("S13") == "S013: 100.00"


def test_a_program_can_look_at_what_was_chosen(terminal: Terminal) -> None:
    choose(terminal, 233, 27)
    terminal.drive.load_program(["IF S13>10 GOTO 3", "END", "OUTPUT O1=1"])
    terminal.say("START", 1)
    assert terminal.drive.outputs[1]


def test_diagnosis_and_identification_are_four_and_nine_values(terminal: Terminal) -> None:
    """IBS p. 12; their form is unknown, these are placeholders."""
    assert [terminal.ask(f"S{number}") for number in range(23, 27)] == [f"S{n:03d}: 0" for n in range(23, 27)]
    identification = [terminal.ask(f"S{number}") for number in range(31, 40)]
    assert identification[0] == "S031: SIMULATOR 1"
    assert len(set(identification)) == 9
    assert all(len(text) <= 30 for text in identification)


@pytest.mark.parametrize("number", [19, 22, 27, 29, 40])
def test_numbers_of_which_nothing_is_known_are_refused(terminal: Terminal, number: int) -> None:
    assert terminal.ask(f"S{number}") == "E90"
