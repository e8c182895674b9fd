"""Handshakes from the side of the cutter: ENQ and ACK, Xon and Xoff, DTR, presets, power-on; and none at all."""

from __future__ import annotations

import pytest
from tests.simulator.camm1.host import ESC, Host

from compax_aio.simulator.camm1 import LogKind

_LONG = b"PD40000,0;PD0,0;PD40000,0;"
"""Ten seconds and more each."""

# A naive sender


@pytest.mark.parametrize("size", [60, 256, 1024, 15360])
def test_who_sends_without_asking_overflows_it_and_ruins_the_job(size: int) -> None:
    host = Host(baudrate=9600, physical_size=size)
    points = [(n * 37 % 11000, n * 91 % 11000) for n in range(4000)]
    job = "".join(f"PD{x},{y};" for x, y in points).encode()
    host.send(b"PU0,0;" + job)
    host.wait(10_000.0)
    cutter = host.cutter
    assert cutter.lost_bytes > 10_000
    assert host.ask("E", 1.0) == 16
    assert host.ask("E", 1.0) == 0
    made = [(each.x1, each.y1) for each in cutter.cuttings.cut]
    assert made[:3] == points[:3]
    assert made != points
    assert host.texts(LogKind.OVERFLOW)[-1] == str(cutter.lost_bytes)


@pytest.mark.parametrize(("knob", "kept"), [("newest", ["PU", "PA", "PR"]), ("oldest", ["PA", "PR", "IN"])])
def test_the_newest_or_the_oldest_bytes_are_lost(knob: str, kept: list[str]) -> None:
    host = Host.frozen(physical_size=9, overflow_drop=knob)
    host.send(b"PU;PA;PR;IN;")
    assert host.cutter.lost_bytes == 3
    assert host.texts(LogKind.IO_ERROR) == ["16"]
    host.cutter.press_pause(host.now)
    host.until_idle()
    assert host.texts(LogKind.INSTRUCTION) == kept


# ENQ and ACK


@pytest.mark.parametrize(("knob", "answer"), [("gt", b""), ("ge", b"\x06"), ("model", b"")])
def test_as_much_room_as_the_block_is_enough_or_is_not(knob: str, answer: bytes) -> None:
    host = Host.frozen(ack_compare=knob)
    host.control("I1000;5;6:")
    host.send(b";" * 24)
    assert host.send(b"\x05") == answer
    assert Host(model="HP 7475A").send(ESC + b"I1024;5;6:\x05") == b"\x06"


@pytest.mark.parametrize(("letter", "answer"), [("H", b"\x06\r"), ("I", b"\x06")])
def test_ack_comes_when_there_is_room(letter: str, answer: bytes) -> None:
    host = Host.frozen()
    host.control(f"{letter}1000;5;6:")
    host.send(b"PU;" * 8 + b"\x05")
    assert host.texts(LogKind.ENQUIRY) == ["pending"]
    assert host.ask("B") == 1000
    assert host.send(b"\x05") == b""
    assert host.ask("E") == 10
    host.cutter.press_pause(host.now)
    assert host.wait(1.0) == answer
    assert host.texts(LogKind.HANDSHAKE) == ["ACK"]


def test_an_immediate_response_says_that_enq_was_heard() -> None:
    host = Host.frozen()
    host.control("I1000;5;6:")
    host.control("N;33;34:")
    assert host.send(b"\x05") == b'!"\x06'
    host.send(b"PU;" * 8)
    assert host.send(b"\x05") == b'!"'
    host.cutter.press_pause(host.now)
    assert host.wait(1.0) == b"\x06"


def test_mode_1_dresses_its_answers_and_mode_2_delays_them() -> None:
    host = Host()
    host.control("M100;17;0;13;10;0:")
    host.control("H80;5;6:")
    assert host.send(b"\x05", 1.0) == b""
    assert host.send(b"\x11", 0.09) == b""
    assert host.wait(0.02) == b"\x06\r\n"
    host.control("I80;5;6:")
    assert host.send(b"\x05", 0.09) == b""
    assert host.wait(0.02) == b"\x06"


def test_mode_1_without_a_string_sends_the_terminator() -> None:
    host = Host()
    host.control("H80;5:")
    assert host.send(b"\x05") == b"\r"


def test_a_question_that_is_being_answered_and_enq_do_not_go_together() -> None:
    host = Host()
    host.control("M100:")
    host.control("I80;5;6:")
    assert host.send(ESC + b"B\x05", 1.0) == b"1024\r"
    assert host.ask("E", 1.0) == 10


def test_the_dummy_answers_while_it_is_paused_and_while_it_answers() -> None:
    host = Host.frozen()
    host.control("M100:")
    assert host.send(ESC + b"B\x05\x05", 1.0) == b"1024\r\x06\x06"


def test_the_last_rule_is_the_one() -> None:
    host = Host()
    host.control("H80;5;65:")
    host.control("I80;6;66:")
    assert host.send(b"\x05\x06") == b"B"
    host.control("I:")
    assert host.send(b"\x05") == b"\x06"


def test_an_hp_7470a_counts_blocks_by_256() -> None:
    host = Host(model="HP 7470A")
    host.control("I300;5;6:")
    assert host.send(b"\x05") == b"\x06"
    assert Host().send(ESC + b"I2000;5;6:\x05") == b""


# Xon and Xoff


def _xon(**knobs: object) -> Host:
    host = Host.frozen(**knobs)
    host.control("I80;;17:")
    host.control("N;19:")
    return host


def test_both_strings_are_needed() -> None:
    host = Host.frozen()
    host.control("I80;;17:")
    assert host.send(b";" * 1000) == b""
    assert host.control("N;19:") == b"\x13"


@pytest.mark.parametrize(
    ("knob", "stored"), [("half", 512), ("free>512", 511), ("stored<=128", 128), ("stored<=512", 512), ("model", 512)]
)
def test_xon_comes_when_so_much_is_left(knob: str, stored: int) -> None:
    host = _xon(xon_rule=knob, instruction_time_s=0.001)
    assert host.send(b"H;" * 500) == b"\x13"
    host.cutter.press_pause(host.now)
    while host.wait(0.001) == b"":
        pass
    assert host.cutter.stored_bytes == stored - stored % 2


def test_xoff_is_repeated_if_data_keeps_coming() -> None:
    host = _xon(xoff_repeat_every=20)
    assert host.send(b";" * 945) == b"\x13"
    assert host.send(b";" * 19) == b""
    assert host.send(b";") == b"\x13"
    assert host.send(b";" * 40) == b"\x13\x13"
    assert _xon().send(b";" * 1024) == b"\x13"


def test_delays_of_xon() -> None:
    host = _xon(delay_on_xon=True)
    host.control("M200:")
    assert host.send(b"PU;" * 330) == b"\x13"
    host.cutter.press_pause(host.now)
    assert host.wait(0.2) == b""
    assert host.wait(0.2) == b"\x11"
    host = _xon()
    host.control("N10;19;19:")
    assert host.send(b"PU;" * 330, 0.0101) == b"\x13"
    assert host.wait(0.01) == b"\x13"


def test_a_lost_xon() -> None:
    host = _xon()
    host.cutter.trouble.xons_to_lose = 1
    host.send(b"PU;" * 330)
    host.cutter.press_pause(host.now)
    assert host.wait(5.0) == b""
    assert host.texts(LogKind.TROUBLE) == ["Xon lost"]
    assert host.ask("B") == 1024


def test_xoff_does_not_wait_for_the_trigger_of_a_reply() -> None:
    host = _xon()
    host.control("M;65:")
    host.send(b";" * 944)
    host.control("B")
    assert host.cutter.stored_bytes == 944
    assert host.send(b"A;") == b"80\r\x13"


# DTR


@pytest.mark.parametrize(("size", "low"), [(1024, 80), (60, 15)])
def test_dtr_falls_when_less_than_a_block_is_free(size: int, low: int) -> None:
    host = Host.frozen(physical_size=size)
    host.send(b";" * (size - low))
    assert host.is_dtr_high()
    host.send(b";")
    assert not host.is_dtr_high()
    assert host.send(b";") == b""
    assert host.cutter.stored_bytes == size - low + 2
    host.cutter.press_pause(host.now)
    host.until_idle()
    assert host.is_dtr_high()
    assert host.texts(LogKind.HANDSHAKE) == ["DTR low", "DTR high"]


def test_the_block_of_i_is_the_level_of_dtr() -> None:
    host = Host.frozen()
    host.control("I200:")
    host.send(b";" * 825)
    assert not host.is_dtr_high()


def test_the_levels_of_dtr_can_be_set() -> None:
    host = Host.frozen(dtr_low_below=100, dtr_high_at=500, instruction_time_s=0.001)
    host.send(b"PU;" * 309)
    assert not host.is_dtr_high()
    host.cutter.press_pause(host.now)
    while not host.is_dtr_high():
        host.wait(0.001)
    assert 500 <= host.cutter.free_bytes < 506


def test_a_wired_dtr_stops_the_host_within_a_byte() -> None:
    for overshoot in (0, 16):
        host = Host.frozen(baudrate=9600, dtr_wired=True, dtr_overshoot=overshoot)
        host.send(b"PU;" * 1000, 60.0)
        assert host.cutter.stored_bytes == 1024 - 80 + 1 + overshoot
        assert host.cutter.holds_host
        host.cutter.press_pause(host.now)
        host.until_idle()
        assert host.cutter.lost_bytes == 0
        assert len(host.texts(LogKind.INSTRUCTION)) == 1000


def test_a_wired_dtr_stops_bytes_that_take_no_time() -> None:
    host = Host(dtr_wired=True, physical_size=60)
    host.send(b"PU1,1;" * 2000)
    host.until_idle()
    assert host.cutter.lost_bytes == 0
    assert host.cutter.cuttings.vectors.total == 2000


def test_dtr_can_be_turned_off() -> None:
    host = Host.frozen(model="PNC-900", physical_size=1024)
    host.send(b";" * 1000)
    assert not host.is_dtr_high()
    host.control("@;0:")
    assert host.is_dtr_high()
    host.control("@:")
    assert not host.is_dtr_high()
    host.control("@;2:")
    assert host.is_dtr_high()


# Presets and power-on


def test_presets_have_their_traps() -> None:
    host = Host.frozen()
    host.control("P1:")
    assert host.control("B", 0.2) == b"1024\r"
    host.send(b"lost\nPU;", 1.0)
    assert host.cutter.stored_bytes == 3
    host.control("P2:")
    assert host.control("B", 1.0) == b""
    assert host.send(b"\x11", 1.0) == b"1021\r"
    assert host.send(b"\n\x05", 1.0) == b"\x06"
    host.control("P3:")
    assert host.ask("B") == 1021
    host.control("P:")
    assert host.send(b"\x05") == b"\x06"


def test_preset_1_is_xon_xoff() -> None:
    host = Host.frozen()
    host.control("P1:")
    assert host.send(b";" * 1000, 0.1) == b"\x13"
    assert host.is_dtr_high()


@pytest.mark.parametrize(
    ("knob", "dtr", "out"),
    [("model", False, b""), ("hardwire", False, b""), ("dummy", True, b""), ("xonxoff", True, b"\x13")],
)
def test_what_rules_after_power_on(knob: str, dtr: bool, out: bytes) -> None:
    host = Host.frozen(power_on_handshake=knob)
    assert host.send(b";" * 1000) == out
    assert host.is_dtr_high() == dtr


@pytest.mark.parametrize(("knob", "out"), [(False, b""), (True, b"\x13")])
def test_r_may_bring_the_handshake_of_power_on_back(knob: bool, out: bytes) -> None:
    host = Host.frozen(power_on_handshake="xonxoff", reset_restores_dip=knob)
    host.control("R")
    assert host.send(b";" * 1000) == out


# When bytes become free


@pytest.mark.parametrize(("knob", "free"), [("fetch", 1024), ("finish", 1024 - 16)])
def test_bytes_become_free_when_they_are_read_or_when_the_vector_ends(knob: str, free: int) -> None:
    host = Host(free_on=knob)
    host.send(_LONG[:16], 0.1)
    assert host.ask("B") == free
    host.until_idle()
    assert host.ask("B") == 1024


def test_an_instruction_longer_than_the_buffer_never_gets_through() -> None:
    host = Host(physical_size=60, time_factor=0)
    host.send(b"PD" + b",".join([b"100,200"] * 20))
    assert host.ask("B") == 0
    assert host.cutter.cuttings.vectors.total == 0
    host.control("K")
    assert host.ask("B") == 60
