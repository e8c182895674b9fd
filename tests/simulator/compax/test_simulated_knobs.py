"""Every knob does what its row says, and says what it allows."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest
from tests.simulator.compax.terminal import PROMPT, Terminal

from compax_aio.errors import TransportError
from compax_aio.simulator.compax import Knobs, LogKind
from compax_aio.simulator.compax.refusals import REFUSALS


@pytest.mark.parametrize(
    ("error_style", "answer", "p20"),
    [("code", b"E90\r\n>", 0), ("text", b"E90 syntax error\r\n>", 0), ("prompt_only", PROMPT, 2), ("silent", b"", 2)],
)
def test_error_style(error_style: str, answer: bytes, p20: int) -> None:
    terminal = Terminal(error_style=error_style)
    assert terminal.say("XY") == answer
    assert terminal.ask("P20") == f"P020: {p20}"


def test_every_error_text_fits_the_output_buffer() -> None:
    assert all(len(f"E{refusal.code} {refusal.text}") <= 30 for refusal in REFUSALS)
    assert len({refusal.code for refusal in REFUSALS}) == len(REFUSALS)


def test_position_reached_is_the_only_answer() -> None:
    terminal = Terminal(position_reached="final_only")
    assert terminal.say("PA 100$") == b""
    assert terminal.ask("S17") == "S017: 00100010"
    assert terminal.ask("PA 5$") == "E92"
    assert terminal.wait(5) == b"$\r\n>"
    assert terminal.say("PA 50") == PROMPT


@pytest.mark.parametrize("line", ["STOP", "BREAK", None])
def test_position_reached_on_stop(line: str | None) -> None:
    terminal = Terminal(position_reached_on_stop=True)
    terminal.say("PA 100$")
    terminal.wait(0.3)
    if line is None:
        terminal.drive.raise_fault(55)
        assert terminal.wait(1) == b"$\r\n>"
    else:
        assert terminal.say(line, 1) == PROMPT + b"$\r\n>"
    assert terminal.say("START", 5) == PROMPT


def test_position_reached_on_home() -> None:
    terminal = Terminal(position_reached_on_home=False, machine_zero=5)
    assert terminal.say("PH$", 5) == PROMPT
    assert terminal.drive.homed
    assert terminal.say("PA 5$", 5) == PROMPT + b"$\r\n>"


def test_comparator_messages_with_sign() -> None:
    terminal = Terminal(comparator_messages="with_sign")
    terminal.say("PR 1 OT O1=1")
    assert terminal.say("PA 2", 5) == PROMPT
    assert terminal.drive.outputs[1]
    terminal.say("PR 1 OT O1=0")
    assert terminal.say("PA 4$", 5) == PROMPT + b"1\r\n>$\r\n>"


def test_comparator_form_prompt_first() -> None:
    terminal = Terminal(comparator_form="prompt_first")
    terminal.say("PR 1 OT O1=1")
    assert terminal.say("PA 2$", 5) == PROMPT + b"\r\n>1$\r\n>"


@pytest.mark.parametrize(("comparator_numbering", "number"), [("comparators", b"1"), ("points", b"2")])
def test_comparator_numbering(comparator_numbering: str, number: bytes) -> None:
    terminal = Terminal(comparator_numbering=comparator_numbering)
    terminal.say("PR 1 SD 50")
    terminal.say("PR 2 OT O1=1")
    assert terminal.say("PA 3", 5) == PROMPT + number + PROMPT


@pytest.mark.parametrize(
    ("reply_padding", "s1", "s9", "p2"),
    [
        ("none", "S001: 1.50", "S009: 0", "P002: 100.000"),
        ("blanks", "S001:         1.50 ", "S009:            0 ", "P002:      100.000 "),
        ("unit", "S001: 1.50 mm", "S009: 0", "P002: 100.000 %"),
    ],
)
def test_reply_padding(reply_padding: str, s1: str, s9: str, p2: str) -> None:
    terminal = Terminal(reply_padding=reply_padding, position=1.5)
    assert (terminal.ask("S1"), terminal.ask("S9"), terminal.ask("P2")) == (s1, s9, p2)
    assert terminal.ask("S6").isascii()
    assert terminal.ask("S16") == "S016: 11010000"


def test_decimals() -> None:
    terminal = Terminal(decimals=3, position=1.2345, unit="inch")
    assert terminal.ask("S1") == "S001: 1.234"
    assert terminal.say("PA 1.235") == PROMPT
    assert terminal.ask("P90") == "P090: 2.000"
    assert Knobs.from_query({"unit": "inch"}).decimals == 3
    assert Knobs.from_query({"unit": "inch", "decimals": "2"}).decimals == 2


def test_status_bits_blank() -> None:
    terminal = Terminal(status_bits_blank=True)
    assert terminal.ask("S16") == "S016: 1101 0000"
    assert terminal.ask("S17") == "S017: 0000 0010"


def test_fault_numbers() -> None:
    terminal = Terminal(fault_numbers="one")
    assert terminal.ask("S30") == "S030: 0"
    terminal.drive.raise_fault(7)
    assert terminal.ask("S30") == "S030: 7"
    assert terminal.drive.log.texts(LogKind.FAULT) == ["E07"]


def test_echo_sign_and_execute() -> None:
    terminal = Terminal()
    assert terminal.say("PA 5?") == b"PA 5?\r\n>"
    assert terminal.ask("S1?") == "S1?"
    assert terminal.ask("S99?") == "E90"
    assert terminal.ask("PA 5,?") == "PA 5,?"
    assert terminal.motions() == ["motion_started POSA 5.00"]


def test_echo_sign_only() -> None:
    terminal = Terminal(echo_sign="echo_only")
    assert terminal.say("PA 5?", 5) == b"PA 5?\r\n>"
    assert terminal.motions() == []


@pytest.mark.parametrize(("store", "answer"), [("until_executed", ""), ("until_next_line", "E96")])
def test_store(store: str, answer: str) -> None:
    terminal = Terminal(store=store)
    terminal.say("PA 5,")
    assert terminal.say("!") == PROMPT
    terminal.wait(5)
    terminal.say("PA 5,")
    terminal.ask("S1")
    assert terminal.ask("!") == answer


def test_long_line() -> None:
    assert Terminal().ask("POSR 0000000000100 OUTPUT O16=1") == "E90"
    assert Terminal().ask("POSR 000000000100 OUTPUT O16=1") == ""
    cut = Terminal(long_line="truncate")
    assert cut.ask("PA 5" + 30 * " " + "5") == ""
    assert cut.drive.log.texts(LogKind.MOTION_STARTED) == ["POSA 5.00"]


def test_exactly_thirty_characters_fit() -> None:
    terminal = Terminal()
    assert terminal.ask("PA 5".ljust(30)) == ""
    assert terminal.ask("S1".ljust(31)) == "E90"
    assert terminal.ask("S1".ljust(30)).startswith("S001")


def test_echo() -> None:
    terminal = Terminal(echo=True)
    assert terminal.send(b"S 1\r\n") == b"S 1\rS001: 0.00\r\n>"
    terminal.drive.silent = True
    assert terminal.say("S1") == b""


@pytest.mark.parametrize(
    ("power_on_text", "text"), [("nothing", b""), ("prompt", PROMPT), ("banner", b"COMPAX simulator\r\n>")]
)
def test_power_on_text(power_on_text: str, text: bytes) -> None:
    terminal = Terminal(power_on_text=power_on_text)
    assert terminal.wait(0) == b""
    terminal.drive.power_cycle()
    assert terminal.wait(0) == text
    terminal.drive.silent = True
    terminal.drive.power_cycle()
    assert terminal.wait(0) == b""


def test_lower_case() -> None:
    terminal = Terminal(lower_case="error")
    assert terminal.ask("s1") == "E90"
    assert terminal.ask("S1") == "S001: 0.00"


def test_ready_after_answer() -> None:
    lines = b"S1\r\nS2\r\nS3\r\n"
    assert Terminal().send(lines) == b"S001: 0.00\r\n>S002: 0.00\r\n>S003: 0.00\r\n>"
    terminal = Terminal(ready_after_answer=True)
    assert terminal.send(lines) == b"S001: 0.00\r\n>"
    assert terminal.ask("S2") == "S002: 0.00"


def test_xonxoff() -> None:
    terminal = Terminal(xonxoff=True)
    assert terminal.ask("P20") == "P020: 1"
    assert terminal.send(b"\x13S1\r") == b""
    assert terminal.send(b"PA 5$\r", 5) == b""
    assert terminal.send(b"\x11") == b"S001: 0.00\r\n>\r\n>"
    assert terminal.wait(2) == b"$\r\n>"
    assert Terminal().send(b"\x13S1\r") == b"E90\r\n>"


def test_answer_time_s() -> None:
    terminal = Terminal(answer_time_s=1.5)
    assert terminal.say("S1", 1.49) == b""
    assert terminal.wait(0.02) == b"S001: 0.00\r\n>"
    assert Terminal(answer_time_s=0).say("S1", 0) == b"S001: 0.00\r\n>"


def test_self_test_s() -> None:
    terminal = Terminal(self_test_s=3)
    assert terminal.ask("S16") == "S016: 11010000"
    terminal.drive.power_cycle()
    assert terminal.ask("S16") == "S016: 01000000"
    assert terminal.ask("PA 5") == "E94"
    terminal.wait(3)
    assert terminal.ask("S16") == "S016: 11010000"
    assert terminal.say("PA 5") == PROMPT


def test_mechanics() -> None:
    terminal = Terminal(
        nominal_speed=1000,
        speed_percent=10,
        acceleration_ms=500,
        stop_ramp_ms=0,
        position=-20,
        homed=True,
        following_error_factor=0,
    )
    assert terminal.ask("S1") == "S001: -20.00"
    assert terminal.ask("S16") == "S016: 11110000"
    assert terminal.ask("P2") == "P002: 10.000"
    assert terminal.ask("P10") == "P010: 0"
    terminal.say("PA 80")
    terminal.wait(0.5)
    assert terminal.ask("S3") == "S003: 0.00"
    assert terminal.ask("S4") == "S004: 10.00"
    terminal.say("STOP")
    assert terminal.ask("S17") == "S017: 00000010"
    terminal.say("PH", 10)
    assert terminal.drive.position == 0


def test_knobs_are_read_from_a_query() -> None:
    query = {"error_style": "text", "echo": "1", "baudrate": "9600", "nominal_speed": "12.5", "acceleration_ms": "7"}
    assert Knobs.from_query(query) == Knobs(
        error_style="text", echo=True, baudrate=9600, nominal_speed=12.5, acceleration_ms=7
    )
    assert Knobs.from_query({}) == Knobs()


def test_every_knob_reads_its_own_default() -> None:
    defaults = {
        field.name: str(int(value)) if isinstance(value := getattr(Knobs(), field.name), bool) else str(value)
        for field in dataclasses.fields(Knobs)
    }
    assert Knobs.from_query(defaults) == Knobs()


@pytest.mark.parametrize(
    ("query", "message"),
    [
        ({"ecko": "1"}, "no knob 'ecko' .='1'.; its knobs are error_style, .*echo"),
        ({"echo": "yes"}, "echo='yes'; allowed: 0, 1"),
        ({"error_style": "loud"}, "error_style='loud'; allowed: code, text, prompt_only, silent"),
        ({"baudrate": "19200"}, "baudrate='19200'; allowed: 0, 9600, 4800"),
        ({"answer_time_s": "soon"}, "answer_time_s='soon'; allowed: 0 to 3600"),
        ({"answer_time_s": "-1"}, "answer_time_s=-1.0; allowed: 0 to 3600"),
        ({"position": "nan"}, "position=nan; allowed: -4e.06 to 4e.06"),
        ({"nominal_speed": "inf"}, "nominal_speed=inf"),
        ({"acceleration_ms": "1.5"}, "acceleration_ms='1.5'; allowed: 0 to 65000"),
        ({"travel_min": "5", "travel_max": "5"}, "travel_min=5.0; allowed: less than travel_max, 5"),
    ],
)
def test_what_no_knob_allows_is_refused(query: dict[str, str], message: str) -> None:
    with pytest.raises(TransportError, match=message):
        Knobs.from_query(query)


@pytest.mark.parametrize("knobs", [{"decimals": 4}, {"speed_percent": 0}, {"unit": "furlong"}])
def test_impossible_knobs_cannot_be_made(knobs: dict[str, Any]) -> None:
    with pytest.raises(TransportError, match="allowed"):
        Knobs(**knobs)
