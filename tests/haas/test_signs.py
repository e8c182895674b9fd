"""DC1 and DC3 outside of files."""

from __future__ import annotations

import pytest

from compax_aio.haas.profiles import CLASSIC, CLASSIC_DC_CODES, CLASSIC_RTS_CTS, CLASSIC_XMODEM, Profile
from compax_aio.haas.protocol_events import ReaderOff, ReaderOn
from compax_aio.haas.signs import FlowSigns


def test_with_xon_xoff_the_last_one_counts() -> None:
    signs = FlowSigns(CLASSIC)
    assert signs.take(b"A\x13B\x11C\x13") == (b"ABC", [])
    assert signs.is_held
    assert signs.take(b"\x11") == (b"", [])
    assert not signs.is_held


def test_with_dc_codes_they_tell_of_the_reader() -> None:
    signs = FlowSigns(CLASSIC_DC_CODES)
    assert signs.take(b"A\x13\x11") == (b"A", [ReaderOff(), ReaderOn()])
    assert signs.is_reader_on
    assert not signs.is_held


@pytest.mark.parametrize("profile", [CLASSIC_RTS_CTS, CLASSIC_XMODEM])
def test_otherwise_they_are_bytes_like_others(profile: Profile) -> None:
    signs = FlowSigns(profile)
    assert signs.take(b"A\x13\x11") == (b"A\x13\x11", [])
    assert not signs.is_held
    assert not signs.is_reader_on


def test_a_new_line_is_not_held() -> None:
    signs = FlowSigns(CLASSIC)
    signs.take(b"\x13")
    signs.forget()
    assert not signs.is_held
