"""The echo of every character is the only handshake, and who does without it loses characters."""

from __future__ import annotations

from random import Random

import pytest
from tests.simulator.smc.host import Host

from compax_aio.simulator.smc import LogKind
from compax_aio.simulator.smc.agenda import Agenda
from compax_aio.simulator.smc.uart import Transmitter
from compax_aio.simulator.smc.wiring import Bus

STATUS = b"\nX^\n"


# What the manuals show, byte for byte


def test_status_of_a_named_axis() -> None:
    assert Host(axes="X", width=0).type(STATUS) == b"X^0\n"


def test_position_as_printed() -> None:
    assert Host(axes="X", width=0, position=1000).type(b"\nXZ\n") == b"XZ1000\n"


def test_position_padded_and_with_decimals() -> None:
    assert Host(axes="X", width=9, decimals=2, position=1000).type(b"\nXZ\n") == b"XZ  1000.00\n"


def test_a_move_is_answered_when_it_has_begun() -> None:
    host = Host(axes="XY")
    assert host.type(b"\nY-500\n", 0.01) == b"Y-500\n"
    assert host.line.axes["Y"].moving
    host.wait(10)
    assert host.line.axes["Y"].position == -500
    assert not host.line.axes["X"].moving


def test_the_last_of_four_in_a_ring_returns_the_name_behind_its_own() -> None:
    assert Host(mode="daisy", axes="ABCD").type(b"\nA") == b"\nE"


def test_first_contact_with_a_789a() -> None:
    host = Host(mode="single", sign_on="mcpherson-2.55")
    assert host.type(b" \r") == b" v2.55\r\n#\r\n"
    assert host.type(b" \r") == b" #\r\n"


def test_a_command_without_data_in_single_mode() -> None:
    host = Host(mode="single")
    host.type(b" ")
    assert host.type(b"V500\r") == b"V500\r\n"
    assert host.axis.parameters.slew_speed == 500


# Echoes and overruns


def test_a_whole_string_loses_all_but_the_last_character_where_bytes_take_no_time() -> None:
    host = Host()
    assert host.send(b"\nAR500\n") == b""
    assert host.texts(LogKind.OVERRUN, axis="A") == ["0A", "41", "52", "35", "30", "30"]
    assert not host.axis.moving


def test_a_whole_string_arrives_at_9600_baud_while_the_axis_stands() -> None:
    host = Host(baudrate=9600)
    assert host.send(b"\nAR500\n") == b"AR500\n"
    assert host.texts(LogKind.OVERRUN) == []


def test_a_whole_string_loses_characters_at_9600_baud_while_the_axis_steps() -> None:
    host = Host(baudrate=9600)
    host.send(b"\nAM2000\n")
    assert host.send(b"\nA^\n") != b"A^         3\n"
    assert host.texts(LogKind.OVERRUN)


@pytest.mark.parametrize("baudrate", [0, 1200, 9600, 38400])
def test_who_waits_for_echoes_loses_nothing_whatever_the_axis_does(baudrate: int) -> None:
    host = Host(baudrate=baudrate, jitter=1.0, seed=5)
    host.type(b"\n")
    assert host.echoed(b"AM2000\n") == b"AM2000\n"
    for _ in range(20):
        assert host.echoed(b"A@ 0") == b"A@ 0"
        host.send(b"\n")
    assert host.texts(LogKind.OVERRUN) == []


def test_at_9600_baud_an_echo_takes_two_byte_times_and_the_service_time() -> None:
    host = Host(baudrate=9600)
    host.type(b"\n")
    began = host.now
    assert host.echoed(b"A") == b"A"
    assert host.now - began == pytest.approx(2 * 10 / 9600 + 0.0004)


def test_a_deeper_uart_keeps_more() -> None:
    assert Host(uart_depth=7).send(b"\nAR500\n") == b"AR500\n"
    host = Host(uart_depth=6)
    host.send(b"\nAR500\n")
    assert host.texts(LogKind.OVERRUN) == ["30"]


def test_an_overrun_keeps_the_newer_character_or_the_older() -> None:
    host = Host(uart_depth=2)
    host.type(b"\n")
    assert host.send(b"A12") == b"A2"
    host = Host(uart_depth=2, overrun="drop")
    host.type(b"\n")
    assert host.send(b"A12") == b"A1"
    assert host.texts(LogKind.OVERRUN) == ["32"]


def test_service_times_are_knobs() -> None:
    host = Host(idle_service_s=0.5, stepping_service_s=0.8)
    host.send(b"\n", 1)
    assert host.send(b"A", 0.49) == b""
    assert host.wait(0.02) == b"A"
    host.echoed(b"M500\n")
    host.wait(0)
    assert host.axis.moving
    host.send(b"\n", 1)
    assert host.send(b"A", 0.79) == b""
    assert host.wait(0.02) == b"A"


def test_jitter_makes_services_longer_and_comes_from_the_seed() -> None:
    def echo_times(seed: int) -> list[float]:
        host = Host(jitter=1.0, seed=seed)
        host.type(b"\n")
        times = []
        for _ in range(10):
            began = host.now
            host.echoed(b"A")
            times.append(round(host.now - began, 9))
        return times

    assert echo_times(1) == echo_times(1) != echo_times(2)
    assert all(0.0004 <= each <= 0.0008 for each in echo_times(3))
    assert len(set(echo_times(1))) > 5


# Rules of the party line


def test_a_name_counts_only_right_behind_an_lf() -> None:
    host = Host(axes="AB")
    assert host.type(b"A^\n") == b""
    assert host.type(b"xA^\n") == b""
    assert host.type(b"A^\n") == b"A^         0\n"
    assert host.type(b"B^\n") == b"B^         0\n"
    assert host.type(b"C^\n") == b""
    assert host.type(b"a^\n") == b""


def test_blanks_and_commas_may_stand_between() -> None:
    host = Host()
    for text in ("Z0", "Z 0", " Z 0", "Z", "Z,0", " Z"):
        assert host.command("A", text) == "         0"
    host.command("A", "K 5 7")
    assert (host.axis.parameters.slope_up, host.axis.parameters.slope_down) == (5, 7)
    host.command("A", "K6,8")
    assert (host.axis.parameters.slope_up, host.axis.parameters.slope_down) == (6, 8)


def test_an_lf_alone_behind_a_name_is_answered_by_an_lf() -> None:
    assert Host().type(b"\nA\n") == b"A\n"


def test_in_a_party_line_backspace_is_a_character() -> None:
    host = Host()
    assert host.type(b"\nAR5\b0\n") == b"AR5\b0\n"
    assert host.texts(LogKind.REFUSED) == ["R5\x080"]


@pytest.mark.parametrize(("half_entered", "target"), [("execute", 0), ("clear", 50)])
def test_an_lf_in_the_middle_of_a_command(half_entered: str, target: float) -> None:
    host = Host(half_entered=half_entered, position=50)
    assert host.type(b"\nAR\n") == b"AR\n"
    host.wait(5)
    assert host.axis.position == target


@pytest.mark.parametrize("half_entered", ["execute", "clear"])
def test_half_a_number_is_a_number(half_entered: str) -> None:
    host = Host(half_entered=half_entered)
    host.type(b"\nAR50\n")
    host.wait(5)
    assert host.axis.position == 50


def test_the_leading_lf_is_echoed_by_all_if_the_knob_says_so() -> None:
    host = Host(axes="AB", echo_leading_lf=True)
    assert host.type(b"\n") == b"\n"
    assert host.type(b"A^\n") == b"A^         0\n"
    assert host.type(b"\nB^\n") == b"\nB^         0\n"


@pytest.mark.parametrize(
    ("overlong", "echo", "position"),
    [
        ("ignore", b"AR000000000123\n", 12),
        ("beep", b"AR00000000012\x07\n", 12),
        ("abort", b"AR00000000012", 0),
    ],
)
def test_the_thirteenth_character(overlong: str, echo: bytes, position: float) -> None:
    host = Host(overlong=overlong, decimals=2)
    assert host.type(b"\nAR000000000123\n") == echo
    host.wait(5)
    assert host.axis.position == position
    assert host.type(b"\nA^\n") == b"A^         0\n"


def test_the_longest_command_is_a_knob() -> None:
    host = Host(command_length=3)
    host.type(b"\nAR1234\n")
    host.wait(5)
    assert host.axis.position == 12


# Collisions


@pytest.mark.parametrize(
    ("collision", "answer"), [("merge", b"          \x000\n"), ("first", b"         0\n0\n"), ("garble", None)]
)
def test_answers_of_two_axes_at_one_time_collide(collision: str, answer: bytes | None) -> None:
    host = Host(axes="AB", collision=collision, baudrate=1200, seed=1, execution_time_s=0)
    host.line.delay_next_answer("A", 0.22)
    host.type(b"\n")
    host.echoed(b"AZ\n", 0.05)
    assert host.type(b"\nBZ", 0.05) == b"BZ"
    collided = host.send(b"\n")
    assert collided == answer or (answer is None and not collided.isascii())
    assert host.type(b"\nBZ\n", 0.2) == b"BZ         0\n"


def test_the_rest_of_a_lost_byte_spoils_the_next_one() -> None:
    agenda = Agenda()
    came: list[tuple[float, int]] = []
    bus = Bus(lambda byte: came.append((agenda.now, byte)), "merge", Random(0))
    fast, slow = Transmitter(agenda, bus, 1.0), Transmitter(agenda, bus, 10.0)
    fast.send(b"\x0f")
    slow.send(b"\xfe")
    agenda.run(1.5)
    fast.send(b"\x3f\x7f")
    agenda.run(10.5)
    fast.send(b"\xff")
    agenda.run(20.0)
    assert came == [(1.0, 0x0E), (2.5, 0x3E), (3.5, 0x7E), (11.5, 0xFF)]


def test_a_collided_byte_has_the_bits_of_both_or_is_the_first_or_any() -> None:
    for collision, expected in (("merge", b"\x1b"), ("first", b"\x1b")):
        host = Host(axes="ABC", collision=collision, abort_echo="all")
        assert host.send(b"\x1b") == expected
    host = Host(axes="ABC", collision="garble", abort_echo="all")
    echoes = b"".join(host.send(b"\x1b") for _ in range(20))
    assert len(echoes) == 20
    assert len(set(echoes)) > 5


def test_nobody_answers_esc_and_reset_by_default() -> None:
    host = Host(axes="AB")
    assert host.send(b"\x1b") == b""
    assert host.send(b"\x03") == b""
    alone = Host(abort_echo="all")
    assert alone.send(b"\x1b") == b"\x1b"
    assert alone.send(b"\x03") == b"\x03"
