"""A profile says how a control is set up, and what is not known; a line is opened as it says, or not at all."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from compax_aio.errors import InvalidCommandError, TransportError
from compax_aio.haas.line_url import bytes_per_s, completed, profile_for
from compax_aio.haas.profiles import (
    CLASSIC,
    CLASSIC_DC_CODES,
    CLASSIC_RTS_CTS,
    CLASSIC_XMODEM,
    DATA_COLLECTION,
    DATA_COLLECTION_19200,
    NEXT_GENERATION,
    PROFILES,
    Profile,
    profile_named,
)
from compax_aio.transports.line_settings import LineSettings
from compax_aio.transports.url import TransportURL

PORT = "serial:///dev/ttyUSB0"
IN_BYTES = replace(CLASSIC, parity_in="bytes")


def _line(url: str) -> LineSettings:
    return LineSettings.of(TransportURL.parse(url))


def test_a_profile_is_found_however_its_name_is_written() -> None:
    for name in ("classic xmodem", "CLASSIC_XMODEM", "Classic-XModem"):
        assert profile_named(name) is CLASSIC_XMODEM
    assert all(profile_named(name) is profile for name, profile in PROFILES.items())
    with pytest.raises(InvalidCommandError, match="no profile 'fanuc'"):
        profile_named("fanuc")


def test_the_working_sets_that_were_seen_are_there() -> None:
    classic = (CLASSIC.baudrate, CLASSIC.data_bits, CLASSIC.parity, CLASSIC.stop_bits, CLASSIC.synchronization)
    assert classic == (9600, 7, "even", 2, "xon/xoff")
    assert (CLASSIC.eob_bytes, CLASSIC_XMODEM.eob_bytes) == (b"\r\n", b"\n")
    assert (CLASSIC_XMODEM.baudrate, CLASSIC_XMODEM.data_bits, CLASSIC_XMODEM.parity) == (115200, 8, "none")
    assert (DATA_COLLECTION.data_bits, DATA_COLLECTION.parity, DATA_COLLECTION.echo) == (8, "none", False)
    assert DATA_COLLECTION_19200.synchronization is None
    assert (NEXT_GENERATION.data_collection, NEXT_GENERATION.request_prefix) == ("ethernet", "?")


def test_a_character_has_its_bits() -> None:
    assert CLASSIC.bits_per_character == 1 + 7 + 1 + 2
    assert CLASSIC_XMODEM.bits_per_character == 10
    assert NEXT_GENERATION.bits_per_character is None


def test_programs_of_the_vendor_are_protected() -> None:
    assert [CLASSIC.protects(number) for number in (7999, 8000, 9999, 10000)] == [False, True, True, False]


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("name", " "),
        ("baudrate", 14400),
        ("parity", "E"),
        ("stop_bits", 1.5),
        ("synchronization", "none"),
        ("eob", ";"),
        ("eob", None),
        ("data_bits", 5),
        ("add_spaces", 1),
        ("o_digits", 6),
        ("data_collection", True),
        ("request_prefix", "!"),
        ("request_end", ""),
        ("parity_in", "driver"),
        ("protected", ((9999, 8000),)),
        ("protected", [(8000, 9999)]),
        ("remarks", None),
    ],
)
def test_what_means_nothing_is_refused(field: str, value: Any) -> None:
    with pytest.raises(InvalidCommandError, match=f"{field} of a profile is "):
        replace(CLASSIC, **{field: value})


def test_what_cannot_go_together_is_refused() -> None:
    with pytest.raises(InvalidCommandError, match="XMODEM needs 8 data bits"):
        replace(CLASSIC, synchronization="xmodem")
    with pytest.raises(InvalidCommandError, match="needs 7 data bits and a parity"):
        replace(DATA_COLLECTION, parity_in="bytes")
    with pytest.raises(InvalidCommandError, match="Ethernet has no synchronization"):
        replace(CLASSIC, data_collection="ethernet")


# Lines ---------------------------------------------------------------------------------------------------------------


def test_a_port_is_opened_as_the_profile_says() -> None:
    assert _line(completed(PORT, CLASSIC)) == LineSettings(baudrate=9600, bytesize=7, parity="E", stopbits=2)
    assert _line(completed(PORT, CLASSIC_DC_CODES)).xonxoff is False
    assert _line(completed(PORT, CLASSIC_RTS_CTS)).rtscts is True
    assert _line(completed("rfc2217://host:1", CLASSIC_XMODEM)) == LineSettings(baudrate=115200)
    assert _line(completed(f"{PORT}?", CLASSIC_XMODEM)).baudrate == 115200


def test_a_parity_bit_in_the_bytes_needs_a_port_of_eight_bits() -> None:
    assert _line(completed(PORT, IN_BYTES)) == LineSettings(baudrate=9600, bytesize=8, parity="N", stopbits=2)
    zero = replace(CLASSIC, parity="zero")
    assert _line(completed(PORT, zero)) == LineSettings(baudrate=9600, bytesize=8, parity="N", stopbits=2)
    for url in (f"{PORT}?bytesize=7", f"{PORT}?parity=E"):
        for profile in (IN_BYTES, zero):
            with pytest.raises(InvalidCommandError, match="contradicts the profile"):
                profile_for(url, profile)
    assert profile_for(f"{PORT}?bytesize=8&parity=N", IN_BYTES) == IN_BYTES


def test_what_the_url_says_of_the_port_stands() -> None:
    url = f"{PORT}?baudrate=19200&parity=N&bytesize=8&stopbits=1"
    profile = profile_for(url, CLASSIC)
    assert profile == replace(CLASSIC, baudrate=19200, parity="none", data_bits=8, stop_bits=1)
    assert completed(url, profile) == url
    assert _line(completed(f"{PORT}?baudrate=4800", profile_for(f"{PORT}?baudrate=4800", CLASSIC))).bytesize == 7
    assert profile_for(f"{PORT}?rtscts=1", CLASSIC) == CLASSIC


def test_other_lines_than_ports_have_no_settings_of_their_own() -> None:
    for url in ("tcp://host:4001", "sim://haas?baudrate=9600", "loop://x"):
        assert completed(url, CLASSIC) == url
        assert profile_for(url, CLASSIC) is CLASSIC


def test_a_line_on_which_the_control_cannot_be_is_refused() -> None:
    with pytest.raises(InvalidCommandError, match="take DC1 and DC3 off the line"):
        profile_for(f"{PORT}?xonxoff=1", CLASSIC)
    with pytest.raises(InvalidCommandError, match="rtscts=0 contradicts"):
        profile_for(f"{PORT}?rtscts=0", CLASSIC_RTS_CTS)
    with pytest.raises(InvalidCommandError, match="another line than a control has: XMODEM needs 8"):
        profile_for(f"{PORT}?bytesize=7", CLASSIC_XMODEM)
    with pytest.raises(InvalidCommandError, match="another line than a control has: baudrate"):
        profile_for(f"{PORT}?baudrate=14400", CLASSIC)
    with pytest.raises(InvalidCommandError, match="another line than a control has: stop_bits"):
        profile_for(f"{PORT}?stopbits=1.5", CLASSIC)
    with pytest.raises(InvalidCommandError, match="another line than a control has: parity"):
        profile_for(f"{PORT}?parity=M", CLASSIC)
    with pytest.raises(TransportError):
        profile_for("no url", CLASSIC)


def test_how_fast_a_line_is_is_known_where_it_is_said() -> None:
    assert bytes_per_s(completed(PORT, CLASSIC), CLASSIC, None) == 9600 / 11
    assert bytes_per_s("sim://haas?baudrate=4800", CLASSIC, None) == 4800 / 11
    assert bytes_per_s("loop://control", CLASSIC, None) is None
    assert bytes_per_s("tcp://host:4001", CLASSIC, 19200) == 19200 / 11
    assert bytes_per_s("sim://haas?baudrate=no", NEXT_GENERATION, None) is None
    assert bytes_per_s(PORT, Profile(name="x"), None) == 9600 / 11


def test_behind_a_network_a_line_is_as_fast_as_the_control_so_that_nothing_gathers_on_the_way() -> None:
    assert bytes_per_s("tcp://host:4001", CLASSIC, None) == 9600 / 11
    assert bytes_per_s("tls://host:4001", CLASSIC_XMODEM, None) == 11520
    assert bytes_per_s("tcp://host:5051", NEXT_GENERATION, None) is None
