"""RFC 2217 without I/O: bytes survive in pieces of any size, settings are asked for, and nothing hostile does harm."""

from __future__ import annotations

from contextlib import suppress
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compax_aio.transports.line_settings import LineSettings
from compax_aio.transports.rfc2217_codec import Rfc2217Layer

IAC, DONT, DO, WONT, WILL, SB, SE = (bytes([code]) for code in (255, 254, 253, 252, 251, 250, 240))
BINARY, ECHO, COM_PORT = b"\x00", b"\x01", b"\x2c"
AGREED = IAC + DO + COM_PORT


def answer(command: int, value: bytes) -> bytes:
    return IAC + SB + COM_PORT + bytes([100 + command]) + value.replace(IAC, IAC + IAC) + IAC + SE


ACKNOWLEDGED = (
    answer(1, (9600).to_bytes(4)) + answer(2, b"\x08") + answer(3, b"\x01") + answer(4, b"\x01") + answer(5, b"\x01")
)


@pytest.fixture
def layer() -> Rfc2217Layer:
    """A line whose settings the server has acknowledged."""
    layer = Rfc2217Layer(LineSettings())
    layer.bytes_to_send()
    assert layer.receive(AGREED + ACKNOWLEDGED) == b""
    assert layer.is_ready
    layer.bytes_to_send()
    return layer


def test_no_setting_is_sent_before_the_server_agrees_to_take_some() -> None:
    layer = Rfc2217Layer(LineSettings())
    greeting = layer.bytes_to_send()
    assert IAC + WILL + COM_PORT in greeting
    assert IAC + WILL + BINARY in greeting
    assert IAC + DO + BINARY in greeting
    assert SB not in greeting
    layer.receive(AGREED)
    asked = layer.bytes_to_send()
    assert IAC + SB + COM_PORT + b"\x01" + (9600).to_bytes(4) + IAC + SE in asked
    assert not layer.is_ready


@pytest.mark.parametrize(
    ("settings", "command", "value"),
    [
        (LineSettings(baudrate=255), 1, b"\x00\x00\x00\xff\xff"),
        (LineSettings(baudrate=115200), 1, b"\x00\x01\xc2\x00"),
        (LineSettings(bytesize=7), 2, b"\x07"),
        (LineSettings(parity="O"), 3, b"\x02"),
        (LineSettings(parity="E"), 3, b"\x03"),
        (LineSettings(parity="M"), 3, b"\x04"),
        (LineSettings(parity="S"), 3, b"\x05"),
        (LineSettings(stopbits=2), 4, b"\x02"),
        (LineSettings(stopbits=1.5), 4, b"\x03"),
        (LineSettings(xonxoff=True), 5, b"\x02"),
        (LineSettings(rtscts=True), 5, b"\x03"),
    ],
)
def test_settings_are_asked_for_by_the_numbers_of_the_rfc(settings: LineSettings, command: int, value: bytes) -> None:
    layer = Rfc2217Layer(settings)
    layer.receive(AGREED)
    assert IAC + SB + COM_PORT + bytes([command]) + value + IAC + SE in layer.bytes_to_send()


def test_a_server_that_offers_instead_of_agreeing_is_understood_too() -> None:
    layer = Rfc2217Layer(LineSettings())
    layer.bytes_to_send()
    layer.receive(IAC + WILL + COM_PORT)
    assert layer.bytes_to_send().startswith(IAC + DO + COM_PORT + IAC + SB)


def test_the_line_is_ready_when_the_last_setting_is_acknowledged_in_any_order() -> None:
    layer = Rfc2217Layer(LineSettings(baudrate=4800))
    layer.receive(AGREED + answer(5, b"\x01") + answer(4, b"\x01") + answer(2, b"\x08") + answer(3, b"\x01"))
    assert layer.unacknowledged == "baudrate=4800"
    before = layer.is_ready
    layer.receive(answer(1, (4800).to_bytes(4) + bytes(4)))  # one server is known to append four bytes
    assert (before, layer.is_ready) == (False, True)
    assert not layer.unacknowledged


@pytest.mark.parametrize(
    ("reply", "what"),
    [
        (answer(1, (19200).to_bytes(4)), "asked for baudrate=9600, and has baudrate=19200"),
        (answer(1, b""), "asked for baudrate=9600, and has baudrate=0"),
        (answer(2, b"\x07"), "bytesize=8, and has bytesize=7"),
        (answer(3, b"\x03"), "parity=N, and has parity=E"),
        (answer(3, b"\x09"), "parity=N, and has parity=9"),
        (answer(4, b"\x03"), "stopbits=1, and has stopbits=1.5"),
        (answer(5, b"\x02"), "handshake=none, and has handshake=xonxoff"),
        (IAC + DONT + BINARY, "refused BINARY"),
        (IAC + WONT + BINARY, "refused BINARY"),
    ],
)
def test_a_setting_that_is_refused_says_what_the_port_has_instead(reply: bytes, what: str) -> None:
    layer = Rfc2217Layer(LineSettings())
    with pytest.raises(ConnectionRefusedError, match=what):
        layer.receive(AGREED + reply)
    assert not layer.is_ready


def test_a_server_that_lets_nobody_set_its_port_says_so() -> None:
    with pytest.raises(ConnectionRefusedError, match="does not let anybody set"):
        Rfc2217Layer(LineSettings()).receive(IAC + DONT + COM_PORT)


def test_what_came_before_the_settings_is_discarded_and_what_comes_after_is_not() -> None:
    layer = Rfc2217Layer(LineSettings())
    assert layer.receive(b"garbage" + IAC + IAC + AGREED + b"garbage" + ACKNOWLEDGED + b"S1\r") == b"S1\r"
    assert layer.heard == b"garbagegarbage"


def test_acknowledgements_can_be_done_without_once_the_server_has_agreed() -> None:
    layer = Rfc2217Layer(LineSettings())
    assert not layer.may_do_without()
    layer.receive(AGREED)
    assert layer.may_do_without()
    assert layer.receive(b"$") == b"$"
    assert "baudrate=9600" in layer.unacknowledged


def test_a_setting_that_changes_later_ends_nothing(layer: Rfc2217Layer) -> None:
    assert layer.receive(answer(1, (1200).to_bytes(4)) + IAC + DONT + BINARY + b"x") == b"x"


def test_options_that_nobody_needs_are_declined_once(layer: Rfc2217Layer) -> None:
    layer.receive(IAC + WILL + ECHO + IAC + DO + ECHO)
    assert layer.bytes_to_send() == IAC + DONT + ECHO + IAC + WONT + ECHO
    layer.receive((IAC + WILL + ECHO + IAC + DO + ECHO) * 1000)
    assert layer.bytes_to_send() == b""


def test_telnet_commands_and_notes_about_modem_lines_are_no_data(layer: Rfc2217Layer) -> None:
    nop, modem_lines, other_option = IAC + b"\xf1", answer(7, b"\xb0"), IAC + SB + b"\x18\x01" + IAC + SE
    assert layer.receive(b"a" + nop + b"b" + modem_lines + b"c" + other_option + b"d") == b"abcd"


def test_a_subnegotiation_that_is_never_ended_swallows_no_command_after_it(layer: Rfc2217Layer) -> None:
    assert layer.receive(IAC + SB + COM_PORT + b"\x6b" + IAC + WILL + ECHO + b"data") == b"data"
    assert layer.bytes_to_send() == IAC + DONT + ECHO


def test_a_subnegotiation_without_end_takes_no_memory(layer: Rfc2217Layer) -> None:
    for _ in range(100):
        assert layer.receive((IAC + SB if _ == 0 else b"") + b"\x2c" * 10_000) == b""
    assert len(layer._subnegotiation) < 100
    assert layer.receive(IAC + SE + b"data") == b"data"


def test_what_is_sent_has_every_255_doubled(layer: Rfc2217Layer) -> None:
    assert layer.encode(b"a\xffb\xff\xff") == b"a\xff\xffb\xff\xff\xff\xff"
    assert layer.encode(memoryview(b"\r\x00\r\n")) == b"\r\x00\r\n"


SUSPEND, RESUME = (IAC + SB + COM_PORT + bytes([code]) + IAC + SE for code in (108, 109))


def test_a_server_that_suspends_us_gets_nothing_until_it_resumes(layer: Rfc2217Layer) -> None:
    layer.receive(SUSPEND)
    assert layer.encode(b"one ") == b""
    assert layer.encode(b"two\xff") == b""
    assert layer.bytes_to_send() == b""
    assert layer.held_bytes == 9
    layer.receive(RESUME)
    assert layer.bytes_to_send() == b"one two\xff\xff"
    assert layer.held_bytes == 0
    assert layer.encode(b"three") == b"three"


def test_what_a_suspended_line_holds_is_sent_at_its_end(layer: Rfc2217Layer) -> None:
    layer.receive(SUSPEND)
    layer.encode(b"!")
    assert layer.farewell() == b"!"


@given(data=st.binary(max_size=200), cuts=st.lists(st.integers(0, 500), max_size=10))
def test_bytes_survive_in_pieces_of_any_size(data: bytes, cuts: list[int]) -> None:
    layer = Rfc2217Layer(LineSettings())
    wire = AGREED + ACKNOWLEDGED + answer(7, b"\xff") + layer.encode(data) + IAC + DO + ECHO
    edges = sorted({0, *(cut % len(wire) for cut in cuts), len(wire)})
    received = b"".join(layer.receive(wire[a:b]) for a, b in pairwise(edges))
    assert received == data


telnet = st.sampled_from([IAC, SB, SE, WILL, WONT, DO, DONT, COM_PORT, BINARY, b"\x65", b"\x6c", b"\x6d", b"x"])


@given(pieces=st.lists(st.lists(telnet).map(b"".join) | st.binary(max_size=20), max_size=30), ready=st.booleans())
def test_whatever_arrives_is_data_or_ignored_or_a_refusal_and_little_is_answered(
    pieces: list[bytes], ready: bool
) -> None:
    layer = Rfc2217Layer(LineSettings())
    with suppress(ConnectionRefusedError):
        if ready:
            layer.receive(AGREED + ACKNOWLEDGED)
        received = sum(len(layer.receive(piece)) for piece in pieces)
        assert received <= sum(map(len, pieces))
    assert len(layer.bytes_to_send()) <= 4 * 256 * 3 + 200
    assert layer.held_bytes == 0
