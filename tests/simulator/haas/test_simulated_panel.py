"""Keys, power, hands and knobs of a simulated control."""

from __future__ import annotations

from typing import Any

import pytest
from tests.simulator.haas.host import Host

from compax_aio.errors import TransportError
from compax_aio.haas.facts.port_settings import Parity, Synchronization
from compax_aio.simulator.haas import Knobs, LogKind, SimulatedControl
from compax_aio.simulator.knob_descriptions import describe_knobs

_FILE = b"%\nO00077\nM30\n%\n"


def test_a_key_ends_what_was_under_way() -> None:
    host = Host()
    host.receive()
    assert host.control.doing == "receiving programs"
    host.control.press_send("O00010", host.now)
    assert host.texts(LogKind.SCREEN) == ["RS232 ABORT", "RS232 DONE"]


def test_the_corner_of_the_display_is_cleared_by_the_next_key() -> None:
    host = Host()
    host.load(_FILE)
    assert host.control.screen == "RS232 DONE"
    host.receive()
    assert host.control.screen == ""


def test_reset_clears_alarms_and_drops_what_was_not_sent() -> None:
    host = Host(baudrate=9600)
    host.load(b"%\nX1\n%\n")
    assert host.control.alarms
    host.control.press_send("O00010", host.now)
    sent = host.wait(0.1)
    host.control.press_reset(host.now)
    sent += host.wait(10.0)
    assert 80 < len(sent) < 95
    assert host.control.screen == "RS232 ABORT"
    assert not host.control.alarms


def test_without_power_nothing_is_heard_or_done() -> None:
    host = Host(baudrate=9600)
    host.load(_FILE)
    host.control.press_send("O00010", host.now)
    host.wait(0.01)
    host.control.power_off(host.now)
    host.control.power_off(host.now)
    assert host.control.doing == "off"
    assert host.wait(1.0) == b""
    assert host.send(b"Q100\r\n", 10.0) == b""
    host.control.press_recv("programs", host.now)
    host.control.press_reset(host.now)
    host.control.dprnt("X", host.now)
    assert host.control.next_event_at() is None
    host.control.power_on(host.now)
    host.control.power_on(host.now)
    assert host.control.doing == "nothing"
    assert host.wait(10.0) == b""
    assert host.control.memory.programs["O00077"] == "O00077\nM30"
    assert host.send(b"Q300\r", 1.0) == b"\x02P.O. TIME, 00000:00:10\x17\r\n>"
    assert host.texts(LogKind.POWER) == ["off", "on"]


def test_a_control_that_loses_power_cannot_tell_the_host() -> None:
    host = Host(profile="xmodem")
    assert host.receive() == b"\x15"
    host.control.power_off(host.now)
    assert host.wait(10.0) == b""
    host.control.power_on(host.now)
    assert host.wait(10.0) == b""
    assert host.send(b"Q201\r")


# Hands


@pytest.mark.parametrize(
    ("knobs", "after_s"),
    [
        ({}, 0.0),
        ({"profile": "rts/cts"}, 0.0),
        ({"xon_at_start": True}, 1.0),
        ({"profile": "dc codes"}, 1.0),
        ({"profile": "xmodem", "press_after_s": 5.0}, 5.0),
    ],
)
def test_recv_is_pressed_when_somebody_comes_or_after_a_while_if_a_sign_tells_it(
    knobs: dict[str, Any], after_s: float
) -> None:
    host = Host(press="recv", **knobs)
    host.wait(100.0)
    assert host.control.doing == "nothing"
    host.control.connect(host.now)
    if after_s:
        host.wait(after_s - 0.1)
        assert host.control.doing == "nothing"
    host.wait(0.1)
    assert host.control.doing == "receiving programs"


def test_keys_that_were_pressed_are_not_pressed_again() -> None:
    host = Host(press="recv")
    host.control.connect(host.now)
    host.wait()
    host.send(_FILE)
    host.wait(100.0)
    assert host.control.doing == "nothing"
    host.control.connect(host.now)
    host.wait(100.0)
    assert host.control.doing == "nothing"


def test_what_was_received_is_sent_back_to_be_compared() -> None:
    host = Host(press="recv,send:last", press_pause_s=2.0)
    host.control.connect(host.now)
    host.send(_FILE)
    assert host.wait(1.9) == b""
    assert host.wait(0.2) == b"\r\n%\r\nO00077\r\nM30\r\n\r\n%\r\n"


def test_keys_are_pressed_again_and_again() -> None:
    host = Host(press="send:O00010,send:settings", press_again=True)
    host.control.connect(host.now)
    assert b"O00010" in host.wait(1.0)
    assert [b"O00010" in host.wait(3.0) for _ in range(4)] == [False, True, False, True]


def test_all_keys_can_be_pressed() -> None:
    host = Host(press="send:O77,send:last,cycle,dnc,recv:offsets", press_pause_s=1.0)
    host.control.connect(host.now)
    assert host.wait(1.5) == b""
    assert "there is no program 'O77'" in host.texts(LogKind.KEY)[0]
    assert host.wait(1.0).startswith(b"\r\n%\r\nO00010")
    host.wait(1.0)
    assert host.control.running.is_cycling
    host.wait(1.0)
    assert host.control.doing == "dnc"
    host.control.press_reset(host.now)
    host.wait(1.0)
    assert host.control.doing == "receiving offsets"


def test_after_power_on_hands_begin_anew() -> None:
    host = Host(press="recv")
    host.control.connect(host.now)
    host.control.power_off(host.now)
    host.wait(1.0)
    assert host.control.doing == "off"
    host.control.power_on(host.now)
    assert host.control.doing == "receiving programs"


# Knobs


def test_each_knob_has_a_meaning_values_and_a_default_that_can_be_written() -> None:
    described = describe_knobs(Knobs)
    assert all(each.meaning and each.values and "``" not in each.meaning for each in described)
    assert Knobs.from_query({each.name: each.default for each in described}) == Knobs()


def test_sets_of_settings_have_names() -> None:
    knobs = Knobs.named("xmodem", host_queue=10)
    assert (knobs.baudrate, knobs.bits, knobs.parity_bit) == (115_200, 8, Parity.NONE)
    assert (knobs.mode, knobs.eob_pattern.value, knobs.host_queue) == (Synchronization.XMODEM, "lf", 10)
    classic = Knobs.named("classic")
    assert (classic.baudrate, classic.bits, classic.stop_bit_count, classic.byte_bits) == (9600, 7, 2, 11)
    assert (classic.spaces, classic.collection, classic.echoes) == (True, "rs-232", False)
    assert Knobs.named("dc_codes").mode is Synchronization.DC_CODES
    assert Knobs.from_query({"synchronization": "dc_codes"}).mode is Synchronization.DC_CODES
    assert Knobs(profile="xmodem", synchronization="rts/cts").mode is Synchronization.RTS_CTS
    with pytest.raises(TransportError, match="profile"):
        Knobs.named("none")


@pytest.mark.parametrize(
    ("knobs", "which"),
    [
        ({"lwm": 192}, "lwm"),
        ({"synchronization": "xmodem"}, "data_bits"),
        ({"parity_in_bytes": True, "data_bits": 8}, "parity_in_bytes"),
        ({"parity_in_bytes": True, "parity": "none"}, "parity_in_bytes"),
        ({"press": "everything"}, "press"),
        ({"dprnt": "\r"}, "dprnt"),
        ({"profile": "none"}, "profile"),
        ({"baudrate": 1234}, "baudrate"),
    ],
)
def test_what_cannot_be_is_refused(knobs: dict[str, object], which: str) -> None:
    with pytest.raises(TransportError, match=which):
        Knobs(**knobs)  # type: ignore[arg-type]


def test_a_control_says_what_it_is_at() -> None:
    control = SimulatedControl(name="mill")
    assert repr(control) == "<SimulatedControl 'mill': nothing>"
    control.press_recv("settings")
    assert repr(control) == "<SimulatedControl 'mill': receiving settings>"
    assert control.received_bytes == 0
    assert control.command_end == b"\r"


def test_programs_have_as_many_blocks_as_a_knob_says() -> None:
    for blocks in (1, 2, 3, 12, 500):
        text = Host(program_blocks=blocks).control.memory.programs["O00010"]
        assert text.count("\n") == blocks
        assert text.endswith("M30")


def test_a_setting_that_is_no_number_is_as_the_knobs_have_it() -> None:
    host = Host()
    host.control.memory.settings[41] = "?"
    assert b"G90 G54" in host.fetch("O00010")
