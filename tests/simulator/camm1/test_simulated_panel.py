"""Somebody is at the machine: PAUSE, SETUP, VIEW, the lever, the power; and trouble that a test asks for."""

from __future__ import annotations

from typing import Any

import pytest
from tests.simulator.camm1.host import ESC, Host

from compax_aio.errors import TransportError
from compax_aio.simulator.camm1 import Knobs, LogKind, SimulatedCutter

# The panel


def test_a_pause_holds_the_tool_where_it_is() -> None:
    host = Host(vector_time_s=0.0)
    host.send(b"PD4000,0;PU;", 0.5)
    host.cutter.press_pause(host.now)
    assert host.cutter.is_paused
    there = host.cutter.position()
    assert there == pytest.approx((2000, 0, True))
    host.wait(100.0)
    assert host.cutter.position() == there
    assert host.cutter.next_event_at() is None
    assert host.ask("O") & 16
    host.cutter.press_pause(host.now)
    host.wait(0.49)
    assert not host.is_idle()
    host.wait(0.02)
    assert host.is_idle()
    assert host.texts(LogKind.PANEL) == ["pause", "resume"]


def test_pause_and_setup_end_the_job() -> None:
    host = Host()
    host.send(b"PD4000,0;PD0,0;PD4000,0;PD0,0;", 0.1)
    host.cutter.press_pause(host.now)
    host.cutter.press_setup(host.now)
    assert not host.cutter.is_paused
    assert host.cutter.is_ready
    assert host.ask("B") == 1024
    host.until_idle()
    assert [each.x1 for each in host.cutter.cuttings.cut] == [4000]
    assert host.texts(LogKind.PANEL, LogKind.CLEARED) == ["pause", "panel 15", "cancel"]


def test_whoever_goes_on_sending_after_a_cancel_is_read_from_any_byte_on() -> None:
    host = Host(baudrate=9600, time_factor=0)
    host.send(b"PU;" + b"PD1234,5678;" * 20, 0.1)
    host.cutter.press_pause(host.now)
    host.cutter.press_setup(host.now)
    host.until_idle()
    assert host.cutter.data_error == 1


@pytest.mark.parametrize(("knob", "stored"), [(True, 6), (False, 0)])
def test_while_setup_is_off_data_is_held_or_lost(knob: bool, stored: int) -> None:
    host = Host(accept_when_not_ready=knob, time_factor=0)
    host.cutter.press_setup(host.now)
    host.send(b"PU;PA;")
    assert host.cutter.stored_bytes == stored
    assert host.texts(LogKind.REFUSED) == ([] if knob else ["6"])
    assert host.ask("B") == 1024 - stored
    host.cutter.press_setup(host.now)
    assert host.cutter.stored_bytes == 0
    assert host.texts(LogKind.INSTRUCTION) == (["PU", "PA"] if knob else [])


def test_single_bytes_are_lost_as_well() -> None:
    host = Host(accept_when_not_ready=False, ready=False, data_bits=7)
    host.send(b"PU;")
    assert host.texts(LogKind.REFUSED) == ["3"]


def test_a_job_can_say_that_it_is_not_ready() -> None:
    host = Host()
    host.send(b"PD4000,0;!NR;PD0,0;", 100.0)
    assert not host.cutter.is_ready
    assert [each.x1 for each in host.cutter.cuttings.cut] == [4000]
    host.cutter.press_setup(host.now)
    host.until_idle()
    assert [each.x1 for each in host.cutter.cuttings.cut] == [4000, 0]


def test_view_and_the_lever_hold_it_too() -> None:
    host = Host(time_factor=0)
    host.cutter.press_view(host.now)
    host.cutter.raise_lever(host.now)
    host.send(b"PD1,1;")
    host.cutter.press_view(host.now)
    assert host.cutter.stored_bytes == 6
    host.cutter.lower_lever(host.now)
    assert host.cutter.stored_bytes == 0
    assert host.texts(LogKind.PANEL) == ["view", "lever up", "view over", "lever down"]


# Power


def test_without_power_the_vector_ends_where_it_is_and_all_is_forgotten() -> None:
    host = Host(vector_time_s=0.0)
    host.control("M;;;10:")
    host.control("z")
    host.send(b"PU100,0;PD100,4000,200,4000;PD1,1;PU", 0.0025 * 1.0)
    host.wait(0.0060)
    host.wait(0.5)
    host.cutter.power_off(host.now)
    assert host.control("E", 1.0) == b""
    host.cutter.press_pause(host.now)
    host.cutter.power_off(host.now)
    host.cutter.power_on(host.now)
    host.cutter.power_on(host.now)
    assert host.control("E") == b"0\r"
    assert host.cutter.stored_bytes == 0
    assert host.cutter.position() == (0, 0, False)
    vectors = list(host.cutter.cuttings.vectors)
    assert [(each.x1, each.is_down) for each in vectors] == [(100, False), (100, True)]
    assert 1900 < vectors[-1].y1 < 2100
    host.send(b"PD50,50;", 1.0)
    assert host.cutter.cuttings.vectors[-1][:4] == (0, 0, 50, 50)
    assert host.texts(LogKind.POWER) == ["off", "on"]
    host.cutter.new_sheet(host.now)
    assert list(host.cutter.cuttings.vectors) == []
    assert host.cutter.cuttings.marks == []


def test_power_lost_while_paused() -> None:
    host = Host(vector_time_s=0.0)
    host.send(b"PD4000,0;", 0.25)
    host.cutter.press_pause(host.now)
    host.wait(5.0)
    host.cutter.power_cycle(host.now)
    assert [each.x1 for each in host.cutter.cuttings.cut] == [1000]
    assert not host.cutter.is_paused


# Trouble


def test_replies_are_lost_garbled_and_late() -> None:
    host = Host()
    trouble = host.cutter.trouble
    trouble.replies_to_lose = trouble.replies_to_garble = 1
    assert host.control("B") == b""
    garbled = host.control("B")
    assert len(garbled) == 5
    assert garbled != b"1024\r"
    trouble.replies_to_delay_s.append(3.0)
    assert host.control("B", 2.9) == b""
    assert host.wait(0.2) == b"1024\r"
    assert host.ask("B") == 1024
    assert len(host.texts(LogKind.TROUBLE)) == 3


def test_a_spoilt_byte_is_error_15() -> None:
    host = Host.frozen()
    host.cutter.trouble.bytes_to_spoil = 1
    host.send(b";;;")
    assert host.cutter.stored_bytes in {2, 3}
    assert host.ask("E") == 15
    assert host.texts(LogKind.TROUBLE)[0].startswith("3B spoilt")


@pytest.mark.parametrize("knob", ["lose_reply", "garble_reply", "late_reply", "spoil_byte", "stray_byte", "lose_xon"])
def test_trouble_by_chance(knob: str) -> None:
    def trouble(**knobs: Any) -> list[str]:
        host = Host(physical_size=60, instruction_time_s=0.1, **knobs)
        host.control("I10;;17:")
        host.control("N;19:")
        for _ in range(100):
            host.send(b"PU;" * 20 + ESC + b"E", 10.0)
        return host.texts(LogKind.TROUBLE)

    found = trouble(**{knob: 0.05})
    assert 0 < len(found) < 1000
    assert found == trouble(**{knob: 0.05})
    assert found != trouble(**{knob: 0.05, "seed": 1})
    assert trouble() == []


def test_what_comes_out_of_nothing() -> None:
    host = Host()
    host.cutter.inject(b"\x13noise", host.now)
    assert host.cutter.next_event_at() == 0
    assert host.wait(0) == b"\x13noise"


def test_a_slow_machine_and_its_end() -> None:
    host = Host(vector_time_s=0.0)
    host.cutter.slow_down(10.0, host.now)
    host.cutter.trouble.bytes_to_spoil = 5
    host.cutter.heal()
    host.cutter.slow_down(10.0, host.now)
    host.send(b"PD4000,0;", 9.9)
    assert not host.is_idle()
    host.wait(0.2)
    assert host.is_idle()


def test_output_that_nobody_takes_is_bounded() -> None:
    host = Host()
    host.cutter.inject(b"x" * 100_000, host.now)
    assert len(host.wait(0)) == 65_536


# Knobs


def test_knobs_are_read_and_checked() -> None:
    assert Knobs.from_query({"model": "PNC-900", "baudrate": "9600"}) == Knobs(model="PNC-900", baudrate=9600)
    for wrong in (
        {"model": "X"},
        {"answer_a": ""},
        {"physical_size": "1"},
        {"logical_size": "2000"},
        {"physical_size": "60", "logical_size": "61"},
        {"baudrate": "9601"},
    ):
        with pytest.raises(TransportError):
            Knobs.from_query(wrong)
    assert repr(SimulatedCutter(name="c")) == "<SimulatedCutter 'c': PNC-1610, 0 bytes stored>"


def test_knobs_fall_back_to_the_model_and_then_to_the_likeliest() -> None:
    assert Knobs(model="PNC-900").physical_bytes == 2048
    assert Knobs(model="PNC-900").logical_bytes == 1024
    assert Knobs(model="HP 7470A").logical_bytes == 255
    assert Knobs(model="PNC-1050").identity == "1050"
    assert Knobs(model="GS-24").speeds_cm_s == (1, 50)
    assert Knobs(speed_cm_s=80).speeds_cm_s == (1, 80)
