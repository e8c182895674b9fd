"""Device control instructions: how they are read, what they answer, and what knobs make of them."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.simulator.camm1.host import ESC, Host

from compax_aio.camm1.facts.models import MODELS
from compax_aio.simulator.camm1 import LogKind

# Reading


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("M;;;256:", 13),
        ("M32768:", 13),
        ("Mx:", 12),
        ("M 5:", 12),
        ("H15359:", 13),
        ("P4:", 13),
        ("P0;1:", 14),
        ("I1;2;3;4;5;6;7;8;9;10;11;12;13:", 14),
        ("a", 11),
        ("\x00", 11),
        ("M99999999999999999999:", 13),
        ("M0:", 0),
    ],
)
def test_what_is_wrong_with_an_instruction_is_told(text: str, error: int) -> None:
    host = Host()
    host.control(text)
    assert host.ask("E") == error


def test_parameters_before_a_bad_one_are_taken_and_it_has_its_default() -> None:
    host = Host()
    host.control("M;;;10;999:")
    assert host.control("E") == b"13\n"
    host.control("M;;;13;1x;5:")
    assert host.control("E") == b"12\r"


def test_codes_above_127_are_no_characters_for_an_hp() -> None:
    host = Host(model="HP 7475A")
    host.control("M;;;200:")
    assert host.ask("E") == 13


def test_blanks_between_parameters_can_be_allowed() -> None:
    host = Host(allow_spaces=True)
    host.control("M ; ;; 10:")
    assert host.control("E") == b"0\n"


def test_another_esc_begins_anew() -> None:
    host = Host()
    assert host.send(b"\x1b\x1b.\x1b.B") == b"1024\r"
    host.send(ESC + b"M;;;10")
    assert host.send(ESC + b"E") == b"0\r"
    applied = Host(unfinished="apply")
    applied.send(ESC + b"M;;;10")
    assert applied.send(ESC + b"E") == b"0\n"


@pytest.mark.parametrize(("knob", "stored"), [("drop", 0), ("data", 2)])
def test_esc_without_a_dot(knob: str, stored: int) -> None:
    host = Host.frozen(stray_esc=knob)
    host.send(b"\x1bA")
    assert host.cutter.stored_bytes == stored


@pytest.mark.parametrize(("knob", "stored"), [("swallow", 2), ("to_buffer", 3)])
def test_a_colon_behind_a_bare_question(knob: str, stored: int) -> None:
    host = Host.frozen(bare_colon=knob)
    assert host.send(ESC + b"B:PU") == b"1024\r"
    assert host.cutter.stored_bytes == stored
    assert host.send(ESC + b"B" + ESC + b"E") == f"{1024 - stored}\r0\r".encode()


def test_a_colon_can_be_required() -> None:
    host = Host(bare_colon="required")
    assert host.control("B") == b""
    assert host.send(b":") == b"1024\r"
    assert host.send(ESC + b"BPU;") == b""
    assert host.send(ESC + b"E:") == b"14\r"
    assert host.send(ESC + b"B5:") == b"1024\r"
    assert host.send(ESC + b"E:") == b"14\r"


def test_an_instruction_that_comes_in_pieces_over_a_slow_line_is_the_same() -> None:
    host = Host(baudrate=1200)
    assert host.send(ESC + b"B", 0.024) == b""
    assert host.wait(0.001) == b""
    assert host.wait(0.045) == b"1024\r"


# Answers


def test_the_model_decides_what_there_is() -> None:
    host = Host(model="PNC-900")
    for text in ("A", "P0:"):
        host.control(text)
        assert host.ask("E") == 11
        host.send(b";")
    assert Host(model="PNC-900", answer_a="X1").control("A") == b"X1\r"
    host = Host(answer_a="none")
    host.control("A")
    assert host.ask("E") == 11
    host.control("@;0:")
    assert host.ask("E") == 11
    assert Host(model="HP 7475A").control("(") == b""


def test_empty_means_no_error_on_some() -> None:
    host = Host(empty_e=True)
    assert host.control("E") == b"\r"
    host.control("z")
    assert host.ask("E") == 11


@pytest.mark.parametrize(("knob", "error"), [("last", 14), ("first", 11)])
def test_one_of_several_errors_is_kept(knob: str, error: int) -> None:
    host = Host(error_latch=knob)
    host.control("z")
    host.control("P0;0:")
    assert host.ask("E") == error
    assert host.ask("E") == 0
    assert host.texts(LogKind.IO_ERROR) == ["11", "14"]


def test_the_word_tells_what_was_drawn_and_the_pause() -> None:
    host = Host(word_bit5=1, time_factor=0)
    assert host.ask("O") == 256 + 32 + 8
    host.cut(b"PD100,100;PU;")
    assert host.ask("O") == 256 + 32 + 8 + 2
    host.cutter.press_pause(host.now)
    host.send(b"PU;")
    assert host.ask("O") == 256 + 32 + 16 + 2


def test_an_hp_tells_view_and_the_lever() -> None:
    host = Host(model="HP 7475A")
    host.cutter.press_view(host.now)
    assert host.ask("O") == 24
    host.cutter.raise_lever(host.now)
    assert host.ask("O") == 40
    host.cutter.lower_lever(host.now)
    host.cutter.press_view(host.now)
    assert host.ask("O") == 8


def test_the_style_of_the_status_can_be_chosen() -> None:
    host = Host.frozen(status_style="codes")
    host.send(b"PU;")
    assert host.ask("O") == 16


@pytest.mark.parametrize(("knob", "waits"), [("model", True), ("1", True), ("0", False)])
def test_the_size_is_told_once_the_buffer_is_empty(knob: str, waits: bool) -> None:
    host = Host(l_waits_empty=knob)
    host.send(b"PD40000,0;PD0,0;PD5,5;")
    answer = host.control("L")
    if waits:
        assert answer == b""
        host.control("B")
        assert host.cutter.io_error == 10
        assert host.until_idle() == b"1024\r"
    else:
        assert answer == b"1024\r"


def test_output_is_aborted_with_what_is_owed() -> None:
    host = Host(baudrate=1200)
    host.send(b"PD40000,0;PD0,0;PD5,5;PD1,1;" + ESC + b"L", 2.0)
    host.control("J", 1.0)
    assert host.ask("E", 1.0) == 0
    assert host.until_idle() == b""
    host.control("M500:", 1.0)
    assert host.send(ESC + b"B" + ESC + b"J", 2.0) == b""
    host.control("M;17:", 1.0)
    assert host.send(ESC + b"B", 1.0) == b""
    assert host.send(b"xx" + ESC + b"R" + ESC + b"E", 1.0) == b"0\r"


def test_half_an_answer_has_left_when_output_is_aborted() -> None:
    host = Host(baudrate=1200)
    host.control("N500:", 1.0)
    host.control("B", 1.3)
    assert host.control("J", 1.0) == b""
    host = Host()
    host.control("N500:")
    host.cutter.receive(ESC + b"B", 0.0)
    assert host.wait(1.2) == b"10"
    assert host.control("J", 5.0) == b""


def test_delays_come_before_the_first_character_and_each_of_them() -> None:
    host = Host()
    host.control("M500:")
    host.control("N5:")
    assert host.control("B", 0.5049) == b""
    assert host.wait(0.0002) == b"1"
    assert host.cutter.next_event_at() == pytest.approx(0.51)
    assert host.wait(0.02) == b"024\r"


def test_an_initiator_takes_the_place_of_a_second_terminator() -> None:
    host = Host()
    host.control("M;;;13;10;2:")
    assert host.control("B") == b"\x021024\r"
    host.control("M;;;0:")
    assert host.control("E") == b"0"


def test_seven_bits_have_parity_and_nothing_above() -> None:
    host = Host(data_bits=7)
    assert host.send(bytes(byte | 0x80 for byte in ESC + b"B")) == bytes([0xB1, 0x30, 0xB2, 0xB4, 0x8D])


def test_the_buffer_tells_less_or_more_than_there_is() -> None:
    assert Host(hidden_slack=-8).ask("B") == 1016
    assert Host(hidden_slack=64).ask("B") == 1088
    host = Host.frozen(physical_size=2048, logical_size=1024)
    host.send(b";" * 1000)
    assert host.ask("B") == 1024
    host.send(b";" * 100)
    assert host.ask("B") == 948
    host = Host.frozen(model="PNC-900")
    host.send(b";" * 2040)
    assert host.ask("B") == 8
    assert host.ask("L") == 1024


def test_dtr_control_may_set_the_size() -> None:
    host = Host(model="PNC-900", dtr_control="size")
    host.control("@500;0:")
    assert host.ask("B") == 500
    assert Host(dtr_control="dtr").control("@500;0:") == b""


# Abort and reset


@pytest.mark.parametrize(("drops", "instructions"), [(True, ["PU"]), (False, ["PD5,10", "PU"])])
def test_half_an_instruction_at_k(drops: bool, instructions: list[str]) -> None:
    host = Host.frozen(k_drops_partial=drops, time_factor=0)
    host.send(b"IN;PD5,1")
    host.control("K")
    assert host.ask("B") == 1024
    host.send(b"0;PU;" if not drops else b";PU;")
    assert host.cutter.stored_bytes == (5 if not drops else 4)
    host.cutter.press_pause(host.now)
    host.until_idle()
    assert host.texts(LogKind.INSTRUCTION) == instructions
    assert host.cutter.stored_bytes == 0
    assert host.ask("B") == 1024


def test_data_soon_after_k_can_be_dropped() -> None:
    host = Host(k_window_ms=10, time_factor=0)
    host.send(ESC + b"KPU;", 0.005)
    host.send(b"PD;" + ESC + b"B", 0.02)
    host.send(b"SP1;PA;")
    assert host.texts(LogKind.INSTRUCTION) == ["SP1", "PA"]


def test_what_k_drops_was_not_done() -> None:
    host = Host()
    host.send(b"PD40000,0;PR;PU10,10,10,10;PD1,1;")
    host.wait(1.0)
    host.control("K")
    assert host.send(b"OC;", 0.001) == b"40000,0,1\r"
    host.until_idle()
    assert [(each.x1, each.y1) for each in host.cutter.cuttings.vectors] == [(40000, 0)]
    assert host.texts(LogKind.CLEARED) == ["K 6"]


@pytest.mark.parametrize(("knob", "error"), [(True, 0), (False, 11)])
def test_r_and_k_clear_errors_on_some(knob: bool, error: int) -> None:
    for letter in "RK":
        host = Host(reset_clears_error=knob)
        host.control("z")
        host.control(letter)
        assert host.ask("E") == error


def test_an_instruction_can_be_split_by_a_question() -> None:
    host = Host(esc_splits_instruction=True, time_factor=0)
    host.send(b"PU;PD10,2" + ESC + b"B0;")
    host.until_idle()
    assert host.texts(LogKind.INSTRUCTION)[:2] == ["PU", "PD10,2"]
    assert host.cutter.data_error == 1
    whole = Host(time_factor=0)
    whole.send(b"PU;PD10,2" + ESC + b"B0;")
    assert [(each.x1, each.y1) for each in whole.cutter.cuttings.cut] == [(10, 20)]


# Whatever comes


@settings(max_examples=150)
@given(
    st.lists(
        st.one_of(
            st.binary(max_size=12),
            st.sampled_from([ESC + b"B", ESC + b"M1;17;10;13:", b"\x05", b"\x11", ESC + b"J", b"LBab\x03", b"PD1,1;"]),
        ),
        max_size=25,
    ),
    st.sampled_from(sorted(MODELS)),
    st.sampled_from([0, 9600]),
)
def test_whatever_comes_nothing_is_raised_and_it_can_be_reset(pieces: list[bytes], model: str, baudrate: int) -> None:
    host = Host(model=model, baudrate=baudrate, time_factor=0, physical_size=60)
    for each in pieces:
        host.send(each, 0.01)
        assert 0 <= host.cutter.stored_bytes <= 60
    host.wait(1.0)
    host.send(ESC + b"J" + ESC + b"J" + ESC + b"R" + ESC + b"K", 1.0)
    host.send(ESC + b"E", 1.0)
    assert host.ask("B", 1.0) == 60


@settings(max_examples=60)
@given(st.data())
def test_pieces_and_looks_of_any_size_change_nothing(data: st.DataObject) -> None:
    job = b"IN;PU100,0;PD200,50,300,0;" + ESC + b"B" + b"LBtext\x03PD10,10;PU;" * 8 + ESC + b"O" + b"OA;"
    knobs: dict[str, Any] = {"baudrate": 9600, "physical_size": 60, "time_factor": 0.3}

    def outcome(pieces: list[bytes], looks: list[float]) -> tuple[bytes, list[Any], list[str]]:
        host = Host(**knobs)
        for each in pieces:
            host.cutter.receive(each, 0.0)
        out = b"".join(host.wait(each) for each in looks) + host.wait(10.0)
        kinds = [kind for kind in LogKind if kind not in {LogKind.OVERFLOW, LogKind.IO_ERROR}]
        notes = [f"{entry.at:.9f} {entry.kind} {entry.text}" for entry in host.cutter.log if entry.kind in kinds]
        return out, list(host.cutter.cuttings.vectors), sorted(notes)

    cuts = sorted(data.draw(st.lists(st.integers(0, len(job)), max_size=8)))
    edges = [0, *cuts, len(job)]
    pieces = [job[begin:end] for begin, end in pairwise(edges)]
    looks = data.draw(st.lists(st.floats(0, 0.05), max_size=20))
    assert outcome(pieces, looks) == outcome([job], [])
