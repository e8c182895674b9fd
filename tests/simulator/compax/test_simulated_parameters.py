"""Parameters and variables: written, protected, made valid, and felt by the axis."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.simulator.compax.terminal import PROMPT, Terminal

from compax_aio.simulator.compax import LogKind


@pytest.fixture
def terminal() -> Terminal:
    return Terminal()


@pytest.fixture
def open_terminal() -> Terminal:
    """The password is active."""
    terminal = Terminal()
    terminal.say("GOTO 302")
    return terminal


def reached_after(terminal: Terminal, line: str) -> float:
    """Move, and say how long it took."""
    terminal.say(line, 60)
    started, reached = (
        entry.at
        for entry in list(terminal.drive.log)[-4:]
        if entry.kind in {LogKind.MOTION_STARTED, LogKind.MOTION_REACHED}
    )
    return reached - started


def test_control_parameters_and_variables_need_no_password(terminal: Terminal) -> None:
    assert terminal.ask("P40=1.5") == ""
    assert terminal.ask("V5=12.3") == ""
    assert terminal.ask("P 040") == "P040: 1.5"
    assert terminal.ask("V5") == "V005: 12.3"
    assert terminal.ask("P049 = -.25") == ""
    assert terminal.ask("P49") == "P049: -0.25"


def test_all_decimals_are_written_if_wanted() -> None:
    assert Terminal(trailing_zeros="none").ask("P2") == "P002: 100"
    terminal = Terminal(trailing_zeros="all", reply_padding="unit")
    terminal.say("P40=1.5")
    assert terminal.ask("P40") == "P040: 1.500"
    assert terminal.ask("P11") == "P011: 4000000.000 mm"
    assert terminal.ask("V1") == "V001: 0.000"


@pytest.mark.parametrize("query", ["P0", "P251", "V0", "V40", "V49", "V71", "P0=1", "P251=1", "V40=1", "V1=V40", "S99"])
def test_what_does_not_exist_is_neither_read_nor_written(open_terminal: Terminal, query: str) -> None:
    assert open_terminal.ask(query) == "E90"


@pytest.mark.parametrize(
    "line", ["P40=", "P40=1,5", "P40=x", "P40==1", "V1=1+", "V1=1+2+3", "P40=1$", "P1000=1", "VP 1"]
)
def test_what_cannot_be_read_is_a_syntax_error(open_terminal: Terminal, line: str) -> None:
    assert open_terminal.ask(line) == "E90"


@pytest.mark.parametrize(
    "line", ["P2=0", "P2=601", "P6=65001", "P90=4", "P20=256", "P14=-1", "V1=8388608", "P3=-9000000"]
)
def test_what_a_parameter_cannot_be_is_refused(open_terminal: Terminal, line: str) -> None:
    assert open_terminal.ask(line) == "E91"


@pytest.mark.parametrize(
    ("number", "stored"),
    [(3, "1.234"), (5, "1.234"), (7, "1"), (21, "1.234321"), (29, "1"), (33, "1.234"), (36, "1.234321"), (45, "1.234"),
     (60, "1"), (99, "1.234"), (186, "1"), (196, "1.234"), (250, "1")],
)  # fmt: skip
def test_a_parameter_is_as_fine_as_it_is_stored(number: int, stored: str) -> None:
    """IBS p. 24."""
    terminal = Terminal(password="off", trailing_zeros="none")
    terminal.say(f"P{number}=1.2343214")
    assert terminal.ask(f"P{number}") == f"P{number:03d}: {stored}"


@pytest.mark.parametrize("password", ["GOTO 302", "GOTO 620"])
def test_other_parameters_need_a_password(terminal: Terminal, password: str) -> None:
    assert terminal.ask("P2=50") == "E89"
    assert terminal.ask("P2") == "P002: 100.000"
    terminal.say(password)
    assert terminal.ask("P2=50") == ""
    terminal.say("GOTO 270")
    assert terminal.ask("P2=60") == "E89"
    assert terminal.ask("P2") == "P002: 50.000"


def test_a_drive_may_need_no_password() -> None:
    assert Terminal(password="off").ask("P2=50") == ""


def test_a_written_parameter_is_felt_after_vp(open_terminal: Terminal) -> None:
    """P2 and P6 count where no SPEED and no ACCEL was given (IBS p. 33)."""
    open_terminal.say("P2=50")
    open_terminal.say("P6=500")
    assert reached_after(open_terminal, "PA 100") == pytest.approx(0.5 + 0.25)
    assert open_terminal.ask("VP") == ""
    assert reached_after(open_terminal, "PA 0") == pytest.approx(1 + 0.25)
    open_terminal.say("SD 100")
    assert reached_after(open_terminal, "PA 100") == pytest.approx(0.5 + 0.5)


def test_a_written_parameter_may_be_felt_at_once() -> None:
    terminal = Terminal(vp="at_once", password="off")
    terminal.say("P2=50")
    assert reached_after(terminal, "PA 100") == pytest.approx(1 + 0.125)


def test_vc_is_accepted_and_makes_no_parameter_valid() -> None:
    terminal = Terminal(password="off", parameter_reading="valid")
    terminal.say("P2=50")
    assert terminal.ask("P2") == "P002: 100.000"
    assert terminal.ask("VC") == ""
    assert terminal.ask("P2") == "P002: 100.000"
    assert terminal.ask("VP") == ""
    assert terminal.ask("P2") == "P002: 50.000"


def test_what_was_not_made_valid_is_lost_without_power(open_terminal: Terminal) -> None:
    open_terminal.say("P2=50")
    open_terminal.say("VP")
    open_terminal.say("P2=60")
    open_terminal.drive.power_cycle()
    assert open_terminal.ask("P2") == "P002: 50.000"


def test_the_travel_range_is_p11_and_p12(open_terminal: Terminal) -> None:
    open_terminal.say("P11=100")
    open_terminal.say("P12=-50.5")
    open_terminal.say("VP")
    assert open_terminal.ask("PA 100.01") == "E93"
    assert open_terminal.ask("PA -51") == "E93"
    assert open_terminal.ask("PA -50.5") == ""


def test_the_stop_ramp_is_p10(open_terminal: Terminal) -> None:
    open_terminal.say("P10=2000")
    open_terminal.say("VP")
    open_terminal.say("PA 1000", 1)
    open_terminal.say("STOP", 1.9)
    assert open_terminal.drive.moving
    open_terminal.wait(0.2)
    assert not open_terminal.drive.moving


def test_inches_have_three_decimals(open_terminal: Terminal) -> None:
    """UG p. 100; P90=2 for inches is a placeholder."""
    assert open_terminal.ask("PA 1.005") == "E91"
    open_terminal.say("P90=2")
    open_terminal.say("VP")
    assert open_terminal.ask("PA 1.005") == ""
    open_terminal.wait(5)
    assert open_terminal.ask("S1") == "S001: 1.005"
    open_terminal.say("P90=3")
    open_terminal.say("VP")
    assert open_terminal.ask("PA 1.005") == "E91"


def test_p20_switches_errors_off_and_on(open_terminal: Terminal) -> None:
    """UG p. 166."""
    open_terminal.say("P20=2")
    assert open_terminal.ask("XY") == "E90"
    open_terminal.say("VP")
    assert open_terminal.ask("XY") == ""
    open_terminal.say("P20=0")
    open_terminal.say("VP")
    assert open_terminal.ask("XY") == "E90"


def test_p20_switches_the_handshake_and_lets_held_output_go() -> None:
    terminal = Terminal(password="off", vp="at_once", p20=1)
    assert terminal.send(b"\x13P20=0\r") == PROMPT
    assert terminal.ask("\x13S1") == "E90"
    assert Terminal(p20=3).ask("XY") == ""
    assert Terminal(p20=3, error_style="silent").say("XY") == b""


@pytest.mark.parametrize(
    ("line", "value"),
    [("V1=2+3", "5"), ("V1=.V2*.P40", "15"), ("V1=V2-P40", "7"), ("V1=V2/4", "2.5"), ("V1=V2\\4", "2"),
     ("V1=V2%4", "2"), ("V1=-7\\2", "-3"), ("V1=-7%2", "-1"), ("V1=-1--2", "1"), ("V1=S1+1", "21"),
     ("V1=1/3", "0.333")],
)  # fmt: skip
def test_arithmetic(line: str, value: str) -> None:
    terminal = Terminal(position=20)
    terminal.say("V2=10")
    terminal.say("P40=1.5" if "*" in line else "P40=3")
    assert terminal.ask(line) == ""
    assert terminal.ask("V1") == f"V001: {value}"


@pytest.mark.parametrize("line", ["V1=1/0", "V1=1\\V2", "V1=1%0", "V1=8000000*2"])
def test_what_cannot_be_calculated_is_refused(terminal: Terminal, line: str) -> None:
    assert terminal.ask(line) == "E91"


def test_a_parameter_or_variable_stands_in_place_of_a_number(terminal: Terminal) -> None:
    """UG p. 100, CAN p. 61."""
    terminal.say("V3=12.3456")
    terminal.say("P40=9")
    assert terminal.ask("PR .P40 OT O1=1") == ""
    assert terminal.say("PA .V3$", 5) == PROMPT + b"1\r\n>$\r\n>"
    assert terminal.ask("S1") == "S001: 12.35"
    assert terminal.ask("PA .P2") == "E90"
    assert terminal.ask("PA .V50") == "E90"
    assert terminal.ask("SD .V4") == "E91"


@given(st.floats(-8e6, 8e6))
def test_what_is_written_is_read_again(value: float) -> None:
    terminal = Terminal()
    assert terminal.ask(f"V1={value:.3f}") == ""
    assert float(terminal.ask("V1").removeprefix("V001: ")) == pytest.approx(value, abs=0.0006)
