"""What commands answer, and each knob about entry and answers does what its row says."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest
from tests.simulator.smc.host import Host

from compax_aio.errors import TransportError
from compax_aio.simulator.smc import Knobs, LogKind, SimulatedPartyLine
from compax_aio.simulator.smc.language import PROGRAMMABLE, arguments
from compax_aio.smc.facts import COMMANDS, MAX_POSITION


def test_every_known_command_is_executed() -> None:
    for letter in COMMANDS:
        host = Host(x_in_party=True)
        numbers = " ".join("1" for _ in arguments(letter, host.line.knobs))
        host.command("A", letter + numbers)
        assert host.texts(LogKind.REFUSED) == [], letter
        assert host.texts(LogKind.COMMAND) == [letter + numbers]


@pytest.mark.parametrize(
    ("width", "decimals", "position", "flags"),
    [(10, 0, "      -125", "         0"), (0, 2, "-125.00", "0"), (12, 2, "     -125.00", "           0")],
)
def test_numbers_have_a_width_and_positions_decimals(width: int, decimals: int, position: str, flags: str) -> None:
    host = Host(width=width, decimals=decimals, position=-125)
    assert host.command("A", "Z") == position
    assert host.command("A", "^") == flags


def test_fractions_of_steps_count_where_there_are_decimals() -> None:
    host = Host(decimals=2)
    host.command("A", "+0.01", 5)
    assert host.command("A", "Z") == "      0.01"
    host.command("A", "R-8.29", 5)
    assert host.command("A", "Z") == "     -8.29"
    host = Host()
    host.command("A", "R-8.99", 5)
    assert host.command("A", "Z") == "        -8"
    host.command("A", "R.5", 5)
    assert host.command("A", "Z") == "         0"


def test_a_position_close_to_zero_has_no_sign() -> None:
    host = Host(position=-0.2)
    assert host.command("A", "Z") == "         0"


@pytest.mark.parametrize(("unknown", "answer"), [("terminator", "\n"), ("?", "?\n"), ("#", "#\n"), ("nothing", "")])
def test_the_answer_to_an_unknown_command(unknown: str, answer: str) -> None:
    host = Host(unknown=unknown)
    for text in ("N1", "r100", "R1x", "R1-2", "X"):
        assert host.type(b"\nA" + text.encode() + b"\n", 0.05).decode() == f"A{text}" + answer
    assert host.texts(LogKind.REFUSED) == ["N1", "r100", "R1x", "R1-2", "X"]
    assert host.motions() == []


@pytest.mark.parametrize(
    ("out_of_range", "answer", "speed"), [("clamp", "", 20), ("ignore", "", 3000), ("error", "?", 3000)]
)
def test_a_value_out_of_range(out_of_range: str, answer: str, speed: int) -> None:
    host = Host(out_of_range=out_of_range)
    assert host.command("A", "V19") == answer
    assert host.axis.parameters.slew_speed == speed
    host.command("A", "V20")
    assert host.axis.parameters.slew_speed == 20
    assert host.command("A", "M-19", 5) == answer
    assert host.axis.speed == (-20 if out_of_range == "clamp" else 0)


def test_values_are_clamped_at_both_ends() -> None:
    host = Host(max_speed=60_000, min_speed=36, decimals=2)
    host.command("A", "V99999")
    host.command("A", "I1")
    assert (host.axis.parameters.slew_speed, host.axis.parameters.initial_speed) == (60_000, 36)
    host.command("A", "R9999999", 1000)
    assert host.axis.position == MAX_POSITION
    host.command("A", "+1000", 5)
    assert host.axis.position == MAX_POSITION
    host = Host(position=8_388_600)
    host.command("A", "+1000", 5)
    assert host.axis.position == 8_388_607


def test_parameters_are_set_by_their_commands() -> None:
    host = Host()
    for text in ("I100", "V1000", "K5 6", "D2", "H0", "Y10 50", "E7", "l1"):
        host.command("A", text)
    values = dataclasses.astuple(host.axis.parameters)
    assert values == (100, 1000, 5, 6, 2, 0, 10, 50, 7, 1)
    host.command("A", "K9")
    assert (host.axis.parameters.slope_up, host.axis.parameters.slope_down) == (9, 9)
    assert dataclasses.astuple(host.axis.stored_parameters) == (400, 3000, 10, 10, 4, 1, 5, 25, 200, 0)
    host.command("A", "C0")
    assert host.axis.parameters.slew_speed == 1000
    host.command("A", "C1")
    assert host.axis.parameters == host.axis.stored_parameters


def test_outputs_are_written_and_the_port_is_read() -> None:
    host = Host()
    host.axis.inputs = 5
    host.command("A", "A255")
    assert host.axis.outputs == 0
    host.command("A", "A40")
    assert host.axis.outputs == 40
    assert host.number("A", "A129") == 45
    assert host.number("A", "A 129") == 45


def test_parameters_are_shown_in_a_party_line_only_if_the_knob_says_so() -> None:
    assert Host().command("A", "X") == ""
    lines = Host(x_in_party=True).command("A", "X").split("\n")
    assert lines == [" A", "Y= 5/25 E= 200 K= 10/10 H=vr", "I= 400 D=4 l=0 A=0 V= 3000"]


def test_a_stream_of_positions_goes_on_until_something_else_comes() -> None:
    host = Host(stream_interval_s=0.2)
    host.command("A", "M1000")
    assert host.command("A", "Z1", 0.1).strip().isdigit()
    stream = host.wait(1.0)
    assert stream.count(b"\r") == 5
    positions = [int(each) for each in stream.split(b"\r")[:-1]]
    assert positions == sorted(set(positions))
    assert not host.type(b"\n").endswith(b"\r")
    assert host.wait(5) == b""


def test_an_answer_takes_the_execution_time() -> None:
    host = Host(execution_time_s=0.5)
    host.type(b"\n")
    host.echoed(b"A^")
    assert host.send(b"\n", 0.49) == b""
    assert host.wait(0.02).endswith(b"0\n")


def test_the_first_character_behind_a_command_waits_in_the_uart_while_that_is_executed() -> None:
    host = Host(execution_time_s=0.5)
    host.type(b"\n")
    host.echoed(b"AV500")
    host.send(b"\n", 0.1)
    host.send(b"\n", 0.1)
    host.send(b"A", 0.1)
    assert host.texts(LogKind.OVERRUN) == ["0A"]
    assert host.wait(1) == b"\nA"


# Knobs themselves


def test_every_knob_can_be_read_from_a_query() -> None:
    query = {
        field.name: str(int(value)) if isinstance(value := getattr(Knobs(), field.name), bool) else str(value)
        for field in dataclasses.fields(Knobs)
    }
    assert Knobs.from_query(query) == Knobs()
    assert Knobs.from_query({"axes": "AB", "baudrate": "9600", "sign_on": "X\r\n"}).axes == "AB"


@pytest.mark.parametrize(
    ("knobs", "message"),
    [
        ({"axes": ""}, "1 to 32 different letters"),
        ({"axes": "AA"}, "1 to 32 different letters"),
        ({"axes": "A1"}, "1 to 32 different letters"),
        ({"mode": "single", "axes": "AB"}, "one axis in single mode"),
        ({"mode": "duplex"}, "allowed: single, party, daisy"),
        ({"baudrate": 300}, "allowed: 0, 1200"),
        ({"uart_depth": 17}, "allowed: 1 to 16"),
        ({"limit_min": 5, "limit_max": 5}, "less than limit_max, 5"),
        ({"min_speed": 30_000}, "at most max_speed, 20000"),
        ({"sign_on": "é"}, "characters of ASCII"),
        ({"instruction_bytes": "V"}, "commands and their bytes"),
        ({"instruction_bytes": "B4"}, "commands and their bytes"),
        ({"lose_echo": 1.1}, "allowed: 0 to 1"),
        ({"seed": -1}, "allowed: 0 to"),
    ],
)
def test_a_knob_says_what_it_allows(knobs: dict[str, Any], message: str) -> None:
    with pytest.raises(TransportError, match=message):
        Knobs(**knobs)


def test_an_unknown_knob_is_refused() -> None:
    with pytest.raises(
        TransportError, match=r"a simulated SMC line has no knob 'echo' \(='1'\).*its knobs are mode, axes"
    ):
        Knobs.from_query({"echo": "1"})
    with pytest.raises(TransportError, match="cannot have seed='x'"):
        Knobs.from_query({"seed": "x"})


def test_an_axis_can_have_knobs_of_its_own() -> None:
    host = Host(axes="AB")
    host.line = SimulatedPartyLine(Knobs(axes="AB"), axis_knobs={"B": Knobs(width=0, limit_max=50)})
    host.command("A", "R100", 5)
    host.command("B", "R100", 5)
    assert host.command("A", "Z") == "       100"
    assert host.command("B", "Z") == "50"


def test_what_cannot_stand_in_a_program_is_known() -> None:
    assert frozenset(COMMANDS) - PROGRAMMABLE == set("PQXS^Z]")
