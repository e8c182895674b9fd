"""Where a file begins and ends: percent signs alone in their lines."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compax_aio.haas.transfers.framing import FileEnd, FileStart

from .bench import in_pieces


def started(*pieces: bytes) -> tuple[bytes, bytes | None]:
    """Return what stood in front, and the file."""
    start, before = FileStart(), b""
    for index, piece in enumerate(pieces):
        foreign, begun = start.find(piece)
        before += foreign
        if begun is not None:
            return before, begun + b"".join(pieces[index + 1 :])
    return before, None


def is_closed(*pieces: bytes) -> bool:
    end = FileEnd()
    for piece in pieces:
        end.read(piece)
    return end.is_closed


def test_a_file_begins_at_the_percent_sign_with_the_ends_of_blocks_in_front_of_it() -> None:
    assert started(b"\n%\nO1\n") == (b"\n", b"\n%\nO1\n")
    assert started(b"\r", b"\n", b"%\r\n") == (b"\r\n", b"\r\n%\r\n")


def test_what_is_printed_in_front_of_it_is_none_of_it() -> None:
    assert started(b"PART 7\r\n%\r\nO1") == (b"PART 7\r\n", b"%\r\nO1")
    assert started(b"PART 7\r", b"\n", b"\n%\nO1") == (b"PART 7\r\n\n", b"\n%\nO1")


@pytest.mark.parametrize("pieces", [(b"50% DONE\r",), (b"50", b"% DONE\r"), (b"X ", b" % ")])
def test_a_percent_sign_within_a_line_begins_nothing(pieces: tuple[bytes, ...]) -> None:
    assert started(*pieces)[1] is None


def test_blanks_in_front_of_the_percent_sign_are_blank_tape() -> None:
    assert started(b"   ", b"  %\n")[1] == b"%\n"


def test_very_many_ends_of_blocks_in_front_of_it_are_cut_off() -> None:
    assert started(b"\n" * 5000 + b"%\n")[1] == b"\n" * 8 + b"%\n"


@pytest.mark.parametrize("text", [b"%\r\nO1\r\nM30\r\n%", b"%\nO1\n%\n", b"\n%\nO1\n \n % \r\n\n", b"%\n%", b"%\r%\r"])
def test_a_file_is_closed_by_a_percent_sign_alone(text: bytes) -> None:
    assert is_closed(text)


@pytest.mark.parametrize(
    "text", [b"%", b"\n%", b"\n%\n", b"%\nO1\n", b"%\nO1 %", b"%\nO1\n%X", b"%\nO1\n%\nO2", b"% \n"]
)
def test_nothing_else_closes_it(text: bytes) -> None:
    assert not is_closed(text)


FILES = st.lists(st.sampled_from([b"%", b"\r", b"\n", b" ", b"O1", b"(50%)", b"N1 V2", b"X", b" " * 40]), max_size=20)


@given(parts=FILES, cuts=st.lists(st.integers(0, 200), max_size=8))
def test_pieces_of_any_size_make_no_difference(parts: list[bytes], cuts: list[int]) -> None:
    data = b"".join(parts)
    pieces = in_pieces(data, cuts) or [b""]
    assert started(*pieces) == started(data)
    assert is_closed(*pieces) == is_closed(data)
