"""Characters in bytes: parity that is made and checked here, and what cannot be a character of seven bits."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compax_aio.haas.line_code import LineCode
from compax_aio.haas.profiles import CLASSIC, CLASSIC_XMODEM, Parity

EVEN = LineCode(replace(CLASSIC, parity="even", parity_in="bytes"))
ODD = LineCode(replace(CLASSIC, parity="odd", parity_in="bytes"))
ZERO = LineCode(replace(CLASSIC, parity="zero", parity_in="bytes"))
BY_PORT = LineCode(CLASSIC)
EIGHT_BITS = LineCode(CLASSIC_XMODEM)


def decoded(code: LineCode, data: bytes) -> tuple[bytes, list[int]]:
    """Return the characters, and where they are damaged."""
    text, places = b"", []
    for piece, is_damaged in code.decode(data):
        if is_damaged:
            places.append(len(text))
        text += piece
    return text, places


def test_even_parity_makes_the_number_of_ones_even() -> None:
    assert EVEN.encode(b"A%C") == bytes((0x41, 0xA5, 0xC3))


def test_odd_parity_makes_it_odd() -> None:
    assert ODD.encode(b"A%C") == bytes((0xC1, 0x25, 0x43))


def test_zero_parity_leaves_bit_7_clear() -> None:
    assert ZERO.encode(b"A%C\xff") == b"A%C\x7f"


@pytest.mark.parametrize("code", [EVEN, ODD, ZERO])
@given(text=st.binary().map(lambda data: bytes(byte & 0x7F for byte in data)))
def test_what_is_encoded_comes_back_whole(code: LineCode, text: bytes) -> None:
    assert decoded(code, code.encode(text)) == (text, [])


@pytest.mark.parametrize("code", [EVEN, ODD])
@given(data=st.data())
def test_one_bit_that_is_turned_is_found_at_its_place(code: LineCode, data: st.DataObject) -> None:
    text = data.draw(st.text(st.characters(max_codepoint=0x7F), min_size=1)).encode()
    place, bit = data.draw(st.integers(0, len(text) - 1)), data.draw(st.integers(0, 7))
    sent = bytearray(code.encode(text))
    sent[place] ^= 1 << bit
    assert decoded(code, bytes(sent))[1] == [place]


def test_several_damaged_bytes_are_each_found_also_side_by_side() -> None:
    sent = bytearray(EVEN.encode(b"N10 G01 X1."))
    for place in (0, 1, 7, 10):
        sent[place] ^= 0x80
    assert decoded(EVEN, bytes(sent)) == (b"N10 G01 X1.", [0, 1, 7, 10])


def test_parity_of_the_port_leaves_bytes_as_they_are_and_one_above_7f_is_damage() -> None:
    assert BY_PORT.encode(b"N10\r\n") == b"N10\r\n"
    assert decoded(BY_PORT, b"N1\xb0\r\n") == (b"N1\xb0\r\n", [2])


def test_with_eight_data_bits_no_byte_is_damage() -> None:
    data = bytes(range(256))
    assert not EIGHT_BITS.finds_damage
    assert EIGHT_BITS.encode(data) == data
    assert decoded(EIGHT_BITS, data) == (data, [])


@pytest.mark.parametrize("parity", ["even", "odd", "zero"])
def test_nothing_is_nothing(parity: Parity) -> None:
    code = LineCode(replace(CLASSIC, parity=parity, parity_in="bytes"))
    assert code.encode(b"") == b""
    assert decoded(code, b"") == (b"", [])
