"""The twenty byte vectors of the fact sheet (§12), seen from the device's side."""

from __future__ import annotations

import pytest
from tests.simulator.camm1.host import ESC, Host

from compax_aio.simulator.camm1 import LogKind


def test_1_an_idle_cutter_tells_1024_free_bytes() -> None:
    assert Host().send(bytes.fromhex("1B2E42")) == bytes.fromhex("313032340D")


def test_2_what_is_stored_is_not_free() -> None:
    host = Host.frozen()
    assert host.send(b"IN;") == b""
    assert host.send(bytes.fromhex("1B2E42")) == bytes.fromhex("313032310D")


def test_3_there_is_no_error() -> None:
    assert Host().send(bytes.fromhex("1B2E45")) == bytes.fromhex("300D")


def test_4_an_unknown_letter_is_error_11_once() -> None:
    host = Host()
    assert host.send(bytes.fromhex("1B2E71")) == b""
    assert host.control("E") == bytes.fromhex("31310D")
    assert host.control("E") == bytes.fromhex("300D")


def test_5_the_terminator_becomes_lf() -> None:
    host = Host()
    host.send(bytes.fromhex("1B2E4D3B3B3B31303A"))
    assert host.control("E") == bytes.fromhex("300A")


def test_6_the_terminator_becomes_cr_lf() -> None:
    host = Host()
    host.send(bytes.fromhex("1B2E4D3B3B3B31333B31303A"))
    assert host.control("B") == bytes.fromhex("313032340D0A")


def test_7_mode_1_acknowledges_with_the_terminator() -> None:
    host = Host()
    host.send(bytes.fromhex("1B2E483132383B353B363A"))
    assert host.send(b"\x05") == bytes.fromhex("060D")


def test_8_mode_2_acknowledges_without_it() -> None:
    host = Host()
    host.send(bytes.fromhex("1B2E493132383B353B363A"))
    assert host.send(b"\x05") == bytes.fromhex("06")


def test_9_the_dummy_handshake_acknowledges_with_a_full_buffer_too() -> None:
    host = Host.frozen()
    host.send(bytes.fromhex("1B2E493A"))
    host.send(b"PU;" * 341 + b"P")
    assert host.ask("B") == 0
    assert host.send(b"\x05") == bytes.fromhex("06")


def test_10_xoff_comes_when_79_bytes_are_free() -> None:
    host = Host.frozen()
    host.send(bytes.fromhex("1B2E4938303B3B31373A") + bytes.fromhex("1B2E4E3B31393A"))
    assert host.send(b";" * (1024 - 80)) == b""
    assert host.send(b";") == bytes.fromhex("13")


def test_11_xon_comes_when_512_are_stored() -> None:
    host = Host.frozen(instruction_time_s=0.001)
    host.send(ESC + b"I80;;17:" + ESC + b"N;19:")
    assert host.send(b"PU;" * 320) == bytes.fromhex("13")
    host.cutter.press_pause(host.now)
    came = host.wait(0.1485)
    assert host.cutter.stored_bytes > 512
    assert came == b""
    assert host.wait(0.001) == bytes.fromhex("11")
    assert host.cutter.stored_bytes == 510


def test_12_a_reply_waits_for_its_trigger() -> None:
    host = Host()
    host.send(bytes.fromhex("1B2E4D3B31373A"))
    assert host.send(bytes.fromhex("1B2E42"), 5.0) == b""
    assert host.send(b"PU;\x10") == b""
    assert host.send(bytes.fromhex("11")) == b"1024\r"
    assert host.cutter.stored_bytes == 0


def test_13_what_comes_before_the_echo_terminator_is_dropped() -> None:
    host = Host.frozen()
    host.send(bytes.fromhex("1B2E4D3B3B31303A"))
    assert host.send(bytes.fromhex("1B2E42")) == b"1024\r"
    host.send(bytes.fromhex("494E3B0A50553B"))
    assert host.cutter.stored_bytes == 3
    host.cutter.press_pause(host.now)
    host.until_idle()
    assert host.texts(LogKind.INSTRUCTION) == ["PU"]


def test_14_a_second_question_is_error_10() -> None:
    host = Host()
    host.control("M100:")
    assert host.send(bytes.fromhex("1B2E421B2E42"), 1.0) == b"1024\r"
    assert host.ask("E", 1.0) == 10


def test_15_one_byte_too_many_is_error_16() -> None:
    host = Host.frozen()
    host.send(b";" * 1025)
    assert host.send(bytes.fromhex("1B2E45")) == bytes.fromhex("31360D")


@pytest.mark.parametrize(("model", "answer"), [("PNC-900", "380D"), ("PNC-1610", "3236340D")])
def test_16_an_idle_cutter_tells_its_status(model: str, answer: str) -> None:
    assert Host(model=model).send(bytes.fromhex("1B2E4F")) == bytes.fromhex(answer)


def test_17_a_parameter_too_many_is_error_14() -> None:
    host = Host()
    host.send(bytes.fromhex("1B2E4D303B303B303B31333B303B303B303A"))
    assert host.control("E") == bytes.fromhex("31340D")


def test_18_it_tells_its_model() -> None:
    assert Host().send(bytes.fromhex("1B2E413A")) == bytes.fromhex("313631300D")


def test_19_k_clears_the_buffer_and_lets_the_vector_end() -> None:
    host = Host()
    host.send(b"PD40000,0;PD0,0;" + b"PU;" * 161)
    host.wait(1.0)
    assert host.cutter.stored_bytes == 483
    host.control("K")
    assert host.control("B") == bytes.fromhex("313032340D")
    host.until_idle()
    assert [(each.x1, each.y1) for each in host.cutter.cuttings.vectors] == [(40000, 0)]
    assert host.cutter.position() == (40000, 0, True)


def test_20_r_brings_cr_back() -> None:
    host = Host()
    host.send(bytes.fromhex("1B2E4D3B3B3B31303A"))
    host.send(bytes.fromhex("1B2E52"))
    assert host.control("E") == bytes.fromhex("300D")
