"""Blocks are made and known as the trace of a real control shows them."""

from __future__ import annotations

import pytest

from compax_aio.errors import InvalidCommandError
from compax_aio.haas.facts.xmodem import checksum
from compax_aio.haas.xmodem.blocks import block, block_count, has_header, sums_with_eob_as_line_feed

TRACE = (
    b"\n%\nO05555(CS390_Test_NC)\n(Using G0 which travels along dogleg path.)\n"
    b"(T1 D=2. CR=0. - ZMIN=-0.125 - face mill)\n(T3 D=0.5 CR=0. -"
)
"""The data of the first block that a control has sent (OpenDNC)."""


def test_the_first_block_of_the_trace_has_the_sum_98() -> None:
    made = block(TRACE, 1)
    assert made[:9] == bytes.fromhex("01 01 fe 0a 25 0a 4f 30 35")
    assert made[-1] == 0x98
    assert len(TRACE) == 128
    assert len(made) == 132


def test_the_last_block_is_filled_up_with_sub() -> None:
    made = block(b"%\n", 1)
    assert made[3:5] == b"%\n"
    assert made[5:131] == b"\x1a" * 126


def test_a_block_that_is_full_is_not_followed_by_an_empty_one() -> None:
    assert block_count(128) == 1
    assert block_count(129) == 2
    with pytest.raises(InvalidCommandError, match="no block 2"):
        block(b"x" * 128, 2)


def test_there_is_no_block_before_the_first() -> None:
    with pytest.raises(InvalidCommandError, match="no block 0"):
        block(b"x" * 128, 0)


def test_numbers_go_on_from_255_to_0_to_1() -> None:
    data = b"x" * 128 * 257
    assert [block(data, index)[1:3] for index in (255, 256, 257)] == [b"\xff\x00", b"\x00\xff", b"\x01\xfe"]


@pytest.mark.parametrize("begun", [b"\x01", b"\x01\x04", b"\x01\x04\xfb", b"\x01\x04\xfbx"])
def test_what_may_become_a_block_is_known(begun: bytes) -> None:
    assert has_header(begun)


@pytest.mark.parametrize("begun", [b"", b"\x02", b"\x01\x04\xfa", b"\x04\x01\xfe"])
def test_what_cannot_become_a_block_is_known(begun: bytes) -> None:
    assert not has_header(begun)


@pytest.mark.parametrize("eob", [b"\r\n", b"\r", b"\r\r", b"\n\n"])
def test_a_sum_may_be_computed_as_if_each_end_were_one_line_feed(eob: bytes) -> None:
    data = (b"N1 G0 X1." + eob) * 20
    sums = list(sums_with_eob_as_line_feed(data[:128], eob))
    assert checksum(data[:128].replace(eob, b"\n")) in sums


def test_an_end_that_two_blocks_share_may_count_for_either() -> None:
    body = b"a" * 126
    sums = set(sums_with_eob_as_line_feed(b"\n" + body + b"\r", b"\r\n", is_half_before=True))
    assert {checksum(body), checksum(body + b"\n"), checksum(b"\n" + body + b"\n")} <= sums
