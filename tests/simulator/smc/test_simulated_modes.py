"""A terminal on one controller, a ring whose names are dealt out, and what resets and missing power do."""

from __future__ import annotations

import pytest
from tests.simulator.smc.host import Host

from compax_aio.simulator.smc import LogKind
from compax_aio.smc.facts import Mode

SIGN_ON = b"1342     4038 ADVANCED MICRO SYSTEMS, INC\r\nMAX-2000 v1.15i\r\n"


def signed_on(**knobs: object) -> Host:
    host = Host(mode="single", **knobs)
    host.type(b" ")
    return host


# A terminal


@pytest.mark.parametrize(
    ("knobs", "answer"),
    [
        ({}, b" " + SIGN_ON + b"#"),
        ({"sign_on": "ams-pre-1.14"}, b" AMS 1.12\r\n#"),
        ({"sign_on": "mcpherson-2.55"}, b" v2.55\r\n"),
        ({"sign_on": "mcpherson-2.55", "sign_on_prompt": "framed"}, b" v2.55\r\n#\r\n"),
        ({"sign_on": "Hello\r\n"}, b" Hello\r\n#"),
        ({"sign_on_prompt": "none"}, b" " + SIGN_ON),
        ({"sign_on": "mcpherson-2.55", "sign_on_prompt": "bare"}, b" v2.55\r\n#"),
    ],
)
def test_the_first_space_brings_the_sign_on(knobs: dict[str, str], answer: bytes) -> None:
    host = Host(mode="single", **knobs)
    assert host.type(b" ") == answer
    assert host.type(b" ") == b" "


@pytest.mark.parametrize(("prompt", "answer"), [("framed", b"#\r\n"), ("bare", b"#")])
def test_an_empty_line_is_answered_by_the_prompt(prompt: str, answer: bytes) -> None:
    host = signed_on(prompt=prompt)
    assert host.type(b"\r") == answer
    assert host.type(b"  \r") == b"  " + answer


def test_data_comes_before_cr_lf_and_behind_the_echo() -> None:
    host = signed_on(position=7)
    assert host.type(b"Z0\r") == b"Z0         7\r\n"
    assert host.type(b"Z0\r\n") == b"Z0         7\r\n"
    assert host.type(b"Q\r") == b"Q\r\n"


@pytest.mark.parametrize(("backspace", "echo"), [("erase", b"\b \b"), ("back", b"\b")])
def test_backspace_takes_a_character_back(backspace: str, echo: bytes) -> None:
    host = signed_on(backspace=backspace)
    assert host.type(b"V5\b\b\b\bV700\r") == b"V5" + 2 * echo + b"V700\r\n"
    assert host.axis.parameters.slew_speed == 700


def test_a_command_that_is_too_long_can_be_the_end_of_it() -> None:
    host = signed_on(overlong="abort")
    assert host.type(b"R000000000123\r") == b"R00000000012#\r\n"


def test_esc_and_cr_give_the_prompt() -> None:
    host = signed_on()
    host.typed("M2000")
    assert host.type(b"V7\x1b\r") == b"V7#\r\n"
    assert not host.axis.moving
    assert host.axis.parameters.slew_speed == 3000
    assert signed_on(abort_echo="all").type(b"\x1b\r") == b"\x1b#\r\n"


def test_a_name_is_typed_once_shown_by_x_and_stored_by_s() -> None:
    host = Host(mode="single")
    assert host.type(b"Q") == b"Q"
    assert host.type(b"abc\r") == b""
    assert host.type(b" ") == b" " + SIGN_ON + b"#"
    assert host.type(b"X\r").startswith(b"X Q\r\nY= 5/25 E= 200 K= 10/10 H=vr\r\nI= 400")
    assert (host.axis.name, host.axis.stored_name) == ("Q", "A")
    assert host.typed("S") == ""
    assert (host.axis.stored_name, host.axis.memory_writes) == ("Q", 1)
    host.axis.pin = Mode.PARTY
    host.send(b"\x03")
    assert host.axis.mode is Mode.PARTY
    assert host.type(b"\nA\n") == b""
    assert host.command("Q", "^") == "         0"


def test_a_name_that_was_not_stored_is_forgotten() -> None:
    host = Host(mode="single")
    host.type(b"Q \x03", 0.2)
    assert host.axis.name == "A"


def test_a_second_reset_becomes_the_name() -> None:
    host = signed_on()
    host.type(b"\x03", 0.2)
    assert host.texts(LogKind.RESET) == ["^C"]
    assert host.type(b"\x03") == b"\x03"
    assert host.texts(LogKind.RESET) == ["^C"]
    assert host.axis.name == "\x03"
    host.type(b" S\r")
    assert host.axis.stored_name == "\x03"
    assert host.type(b"X\r").startswith(b"X \x03\r\n")


@pytest.mark.parametrize("stray", [b"\r", b"\n", b"\x1b", b"\x00", b"\xff", b"7"])
def test_a_stray_byte_becomes_the_name(stray: bytes) -> None:
    host = Host(mode="single")
    host.type(stray)
    assert host.axis.name == stray.decode("latin-1")
    assert host.texts(LogKind.NAMED) == [repr(stray.decode("latin-1"))]


def test_a_name_that_no_character_can_be_is_never_heard_in_a_party_line() -> None:
    host = Host(mode="single")
    host.type(b"\n S\r")
    host.axis.pin = Mode.PARTY
    host.send(b"\x03")
    assert host.type(b"\n\n\n^\n") == b""


# A ring


@pytest.mark.parametrize("count", [1, 4, 26, 32])
@pytest.mark.parametrize("baudrate", [0, 9600])
def test_names_are_dealt_out_around_the_ring(count: int, baudrate: int) -> None:
    letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdef"
    host = Host(mode="daisy", axes=letters[:count], baudrate=baudrate)
    assert host.type(b"\nA", 1) == b"\n" + {1: b"B", 4: b"E", 26: b"a", 32: b"g"}[count]
    assert [axis.name for axis in host.line.axes.values()] == list(letters[:count])
    assert host.echoed(b"\n") == b"\n"
    last = letters[count - 1].encode()
    assert host.echoed(last + b"V700") == last + b"V700"
    assert host.send(b"\n", 1) == b"\n"
    assert [axis.parameters.slew_speed for axis in host.line.axes.values()] == (count - 1) * [3000] + [700]


def test_dealing_may_begin_with_any_name_and_skips_what_can_be_none() -> None:
    host = Host(mode="daisy", axes="ABC")
    assert host.type(b"\ny") == b"\n|"
    assert [axis.name for axis in host.line.axes.values()] == ["y", "z", "{"]
    host = Host(mode="daisy", axes="ABC")
    assert host.type(b"xx\n\n@?") == b"\nC"
    assert [axis.name for axis in host.line.axes.values()] == ["?", "A", "B"]
    host = Host(mode="daisy", axes="AB")
    assert host.type(b"\n\x1a") == b"\n\x1d"


def test_a_ring_is_silent_until_names_are_dealt_out_and_forgets_them_at_a_reset() -> None:
    host = Host(mode="daisy", axes="AB")
    assert host.type(b"A^x") == b""
    assert host.type(b"\nA") == b"\nC"
    assert host.type(b"\nB^\n") == b"\nB^         0\n"
    assert host.send(b"\x03") == b"\x03"
    assert host.type(b"\nB^\n", 0.1)[:2] != b"\nB"
    host.send(b"\x03")
    assert host.type(b"\nA") == b"\nC"


def test_data_and_actions_go_around_the_ring() -> None:
    host = Host(mode="daisy", axes="ABC", position=12)
    host.type(b"\nA")
    assert host.type(b"\nAZ\n") == b"\nAZ        12\n"
    assert host.type(b"\nBR500\n") == b"\nBR500\n"
    host.wait(5)
    assert [axis.position for axis in host.line.axes.values()] == [12, 500, 12]
    assert host.type(b"\nDZ\n") == b"\nDZ\n"
    host.type(b"\nCM500\n")
    assert host.send(b"\x1b") == b"\x1b"
    assert not host.line.axes["C"].moving


def test_a_unit_in_single_mode_breaks_the_ring() -> None:
    host = Host(mode="daisy", axes="AB")
    host.line.axes["B"].pin = Mode.SINGLE
    host.send(b"\x03")
    assert host.type(b"\nA") == b"\n"
    assert host.line.axes["B"].name == "\n"


# Resets and power


def test_a_reset_brings_back_what_is_stored_and_zeroes_the_position() -> None:
    host = Host(axes="AB")
    host.command("A", "V700")
    host.command("B", "V800")
    host.command("B", "S")
    host.command("A", "R5000", 0.5)
    assert host.send(b"\x03", 0) == b""
    host.wait(0.005)
    a, b = host.line.axes["A"], host.line.axes["B"]
    assert (a.position, a.moving, a.place > 0) == (0, False, True)
    assert (a.parameters.slew_speed, b.parameters.slew_speed) == (3000, 800)
    assert host.motions()[-1].startswith("reset at ")
    assert host.type(b"\nA^\n", 0.03) == b""
    host.wait(0.1)
    assert host.command("A", "^") == "         0"


def test_the_dead_time_is_a_knob() -> None:
    host = Host(reset_time_s=0.5)
    host.send(b"\x03", 0.4)
    assert host.type(b"\nA", 0.01) == b""
    host.wait(0.1)
    assert host.type(b"\nA", 0.01) == b"A"


def test_a_reset_can_keep_the_position_but_no_other_loss_of_ram_does() -> None:
    host = Host(reset_keeps_position=True)
    host.command("A", "R50", 5)
    host.send(b"\x03")
    assert host.number("A", "Z") == 50
    host.axis.reset(host.now)
    host.wait(1)
    assert host.number("A", "Z") == 0


def test_a_spontaneous_reset_is_of_one_axis() -> None:
    host = Host(axes="AB")
    for name in "AB":
        host.command(name, "R5000")
        host.command(name, "V700")
    host.line.axes["A"].reset(host.now)
    assert [axis.moving for axis in host.line.axes.values()] == [False, True]
    assert [axis.parameters.slew_speed for axis in host.line.axes.values()] == [3000, 700]
    assert host.texts(LogKind.RESET, axis="A") == ["itself"]
    assert host.texts(LogKind.RESET, axis="B") == []


def test_a_reset_forgets_a_command_that_waits() -> None:
    host = Host()
    host.command("A", "R5000")
    host.type(b"\nAR100\n", 0.01)
    host.send(b"\x03", 60)
    assert host.motions()[-1].startswith("reset")
    assert host.wait(60) == b""


def test_without_power_nothing_is_heard_and_non_volatile_memory_alone_is_kept() -> None:
    host = Host()
    host.command("A", "V700")
    host.command("A", "S")
    host.command("A", "V800")
    host.command("A", "P0")
    host.command("A", "R5")
    host.command("A", "P0")
    host.command("A", "A8")
    host.command("A", "R5000", 0.5)
    place = host.axis.place
    host.line.power_off(host.now)
    host.line.power_off(host.now)
    host.wait(1)
    assert place <= host.axis.place <= place + 1
    assert host.type(b"\nA^\n") == b""
    host.axis.jog(100, host.now)
    host.wait(1)
    assert host.axis.place <= place + 1
    host.line.power_on(host.now)
    host.line.power_on(host.now)
    host.wait(1)
    assert (host.axis.parameters.slew_speed, host.axis.outputs, host.axis.position) == (700, 0, 0)
    assert host.command("A", "Q").split("\n") == ["", "0 R 5.00"]
    assert host.texts(LogKind.POWER) == ["off", "on"]


def test_a_power_cycle_takes_no_time() -> None:
    host = Host()
    host.command("A", "R5000", 0.5)
    host.line.power_cycle(host.now)
    assert host.texts(LogKind.POWER) == ["off", "on"]
    assert host.axis.position == 0


def test_characters_on_their_way_are_not_heard_without_power() -> None:
    host = Host(baudrate=1200)
    host.send(b"\nA", 0)
    host.line.power_off(host.now)
    host.wait(1)
    host.line.power_on(host.now)
    assert host.wait(1) == b""


def test_an_answer_under_way_ends_with_the_power() -> None:
    host = Host(baudrate=1200)
    host.type(b"\n")
    host.echoed(b"AZ")
    assert host.send(b"\n", 0.05) == b"    "
    host.line.power_cycle(host.now)
    assert len(host.wait(1)) == 1  # that is on the wire already


def test_a_character_that_has_not_been_read_goes_with_the_power() -> None:
    host = Host(idle_service_s=0.5)
    host.send(b"\n", 0.1)
    host.line.power_cycle(host.now)
    host.wait(0.6)
    assert host.send(b"A", 1) == b""
