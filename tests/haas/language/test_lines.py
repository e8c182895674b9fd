"""Files as lines: any end of block, every byte kept, places told."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compax_aio.errors import InvalidCommandError
from compax_aio.haas.facts.eob import EobPattern
from compax_aio.haas.language.lines import Lines, as_bytes, eob_of

ANY_FILE = st.lists(
    st.sampled_from([b"%", b"O1234", b"G0X1", b"\r", b"\n", b"\r\n", b" ", b"\x00", b"\x14", b"\x1a", b"(A)", b"\xc4"])
).map(b"".join)


@pytest.mark.parametrize("eob", EobPattern)
def test_the_pattern_of_a_whole_file_is_found(eob: EobPattern) -> None:
    data = eob.data.join([b"", b"%", b"O1", b"G0", b"%", b""])
    assert eob_of(data) is eob
    assert [line.rstrip(b"\r\n") for line in Lines(data).raw] == [b"", b"%", b"O1", b"G0", b"%"]


def test_a_blank_block_does_not_double_the_pattern() -> None:
    assert eob_of(b"\n%\nO1\n\n%\n") is EobPattern.LF
    assert eob_of(b"%\r\rO1\r\r\r\r%\r\r") is EobPattern.CR_CR


def test_ends_that_are_mixed_are_no_pattern() -> None:
    assert eob_of(b"%\r\nO1\n%\r\n") is None
    assert eob_of(b"%") is None
    assert eob_of(b"%\n\n") is EobPattern.LF, "one run proves no doubling"


def test_what_is_told_of_the_pattern_decides_where_the_file_leaves_it_open() -> None:
    data = b"%\n\nO1\n\n%\n\n"
    assert len(Lines(data).raw) == 3
    assert len(Lines(data, "lf").raw) == 6
    assert len(Lines(b"\n\n", "lf lf").raw) == 1
    assert Lines(b"%\r\nO1\r\n", "lf lf").eob is EobPattern.CR_LF, "the file itself knows better"


def test_with_doubled_ends_any_other_end_ends_a_line_as_well() -> None:
    lines = Lines(b"A\n\nB\nC\n\nD", "lf lf")
    assert list(lines.raw) == [b"A\n\n", b"B\n", b"C\n\n", b"D"]


@given(ANY_FILE, st.sampled_from([None, *EobPattern]))
def test_lines_one_behind_the_other_are_the_file(data: bytes, eob: EobPattern | None) -> None:
    lines = Lines(data, eob)
    assert b"".join(lines.raw) == data
    assert all(lines.raw)
    assert lines.offsets[-1] == len(data)
    assert lines.lead_in + lines.payload + lines.tail == data or lines.end is not None
    assert 0 <= lines.first <= len(lines.raw)
    assert lines.first <= lines.behind


@given(ANY_FILE)
def test_each_byte_has_a_place(data: bytes) -> None:
    lines = Lines(data)
    for offset in range(len(data)):
        line, column = lines.place(offset)
        assert lines.offsets[line - 1] + column - 1 == offset
        assert 1 <= column <= len(lines.raw[line - 1])


def test_the_end_of_a_file_has_a_place_too() -> None:
    assert Lines(b"").place(0) == (1, 1)
    assert Lines(b"AB\nCD").place(5) == (2, 3)


@pytest.mark.parametrize(
    ("data", "start", "end"),
    [
        (b"", None, None),
        (b"O1\nM30\n", None, None),
        (b"%\nO1\n", 0, None),
        (b"O1\nM30\n%\n", None, 2),
        (b"\n\n%\n", 2, None),
        (b"%\nO1\n%\nO2\n%\nGARBAGE\n", 0, 4),
        (b"NOISE\n\x12%\nO1\n%\x14", 1, 3),
        (b"%O1\nG0 %\n", None, None),
    ],
)
def test_the_percent_lines_that_hold_the_data(data: bytes, start: int | None, end: int | None) -> None:
    lines = Lines(data)
    assert (lines.start, lines.end) == (start, end)


def test_punch_codes_and_fill_are_no_part_of_what_is_sent_back() -> None:
    lines = Lines(b"\x00\x00\x12%\r\nN1 V2\r\n%\r\n\x14")
    assert lines.payload == b"%\r\nN1 V2\r\n%\r\n"
    assert (lines.lead_in, lines.tail) == (b"\x00\x00\x12", b"\x14")
    assert Lines(b"%\nO1\n%\n\x1a\x1a").payload == b"%\nO1\n%\n"
    assert Lines(b"%\nO1\n%\x14").payload == b"%\nO1\n%"
    assert Lines(b"O1\n").payload == b"O1\n"


def test_a_character_without_a_code_is_refused_with_its_place() -> None:
    with pytest.raises(InvalidCommandError, match="line 2, column 4: '€'"):
        as_bytes("%\nO1(€)")
    assert as_bytes("Ä") == b"\xc4"
    assert as_bytes(bytearray(b"x")) == b"x"


def test_a_number_is_no_file() -> None:
    """``bytes(3)`` would be three NUL."""
    with pytest.raises(TypeError):
        as_bytes(3)  # type: ignore[arg-type]
