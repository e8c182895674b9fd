"""Blocks are found the same in whatever pieces they come, and the names of keys are read."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compax_aio.haas.facts.eob import EobPattern
from compax_aio.simulator.haas.presses import Press, presses_of, program_number
from compax_aio.simulator.haas.tape import Tape


def _read(pieces: list[bytes], eob: EobPattern) -> tuple[list[bytes], int, bool]:
    tape = Tape(eob)
    lines: list[bytes] = []
    taken = 0
    for piece in pieces:
        rest = piece
        while rest and not tape.is_ended:
            count, found = tape.feed(rest)
            lines += found
            taken += count
            rest = rest[count:]
    return lines, taken, tape.is_ended


@given(
    data=st.text("%\r\n;AO1 \x00", max_size=40).map(str.encode),
    cuts=st.lists(st.integers(0, 40)),
    eob=st.sampled_from(EobPattern),
)
def test_pieces_make_no_difference(data: bytes, cuts: list[int], eob: EobPattern) -> None:
    places = [0, *sorted(min(cut, len(data)) for cut in cuts), len(data)]
    pieces = [data[begin:end] for begin, end in pairwise(places)]
    whole, taken, is_ended = _read([data], eob)
    in_pieces, taken_in_pieces, is_ended_in_pieces = _read(pieces, eob)
    assert (in_pieces, is_ended_in_pieces) == (whole, is_ended)
    assert taken_in_pieces == taken


def test_a_percent_sign_within_a_block_ends_nothing() -> None:
    lines, _, is_ended = _read([b"%\nO1 (100% SURE)\nM30\n"], EobPattern.LF)
    assert lines == [b"O1 (100% SURE)", b"M30"]
    assert not is_ended


def test_text_behind_the_first_percent_sign_is_a_block() -> None:
    assert _read([b"%O00001\nM30\n%"], EobPattern.LF) == ([b"O00001", b"M30"], 13, True)


def test_a_block_without_an_end_never_fills_the_memory() -> None:
    lines, _, _ = _read([b"%\n" + b"A" * 5000, b"B" * 5000], EobPattern.LF)
    assert [len(line) for line in lines] == [5000, 5000]


def test_keys_are_read() -> None:
    assert presses_of("") == ()
    assert presses_of("recv, send:last,recv:settings,dnc,cycle,send:O1234") == (
        Press("recv", "programs"),
        Press("send", "last"),
        Press("recv", "settings"),
        Press("dnc"),
        Press("cycle"),
        Press("send", "O1234"),
    )
    for wrong in ("press", "send", "send:nothing", "recv:O1", "dnc:1", "recv,,dnc"):
        with pytest.raises(ValueError, match="no key"):
            presses_of(wrong)
    assert [program_number(name) for name in ("O00010", "10", "o1234", "O123456", "X1", "")] == [
        10,
        10,
        1234,
        None,
        None,
        None,
    ]
