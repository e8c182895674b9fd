"""Files that nobody has written in good faith: read in little room and in one pass, or refused."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compax_aio.errors import InvalidCommandError
from compax_aio.haas.checking import check_data_file, check_program
from compax_aio.haas.comparing import first_difference
from compax_aio.haas.language.data_file import parse_data_file
from compax_aio.haas.language.lines import Lines
from compax_aio.haas.language.program_file import parse_program_file

SIZE = 500_000

HOSTILE = {
    "ends of blocks": b"\n" * SIZE,
    "percent signs": b"%" * SIZE + b"\n",
    "comments": b"(\n" * (SIZE // 2),
    "leader": b"\0" * SIZE + b"\n",
    "blanks behind N": b"N" + b" " * SIZE + b"\n",
    "zeros behind N": b"N" + b"0" * SIZE + b"\n",
}


def room_of(do: Callable[[], object]) -> int:
    """Return the highest number of bytes that *do* has taken."""
    tracemalloc.start()
    try:
        do()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("what", HOSTILE)
def test_a_hostile_file_takes_a_few_times_its_own_room(what: str) -> None:
    data = b"%\nO1\n" + HOSTILE[what] + b"%\n"
    assert room_of(lambda: parse_program_file(data)) < 12 * SIZE
    file = parse_program_file(data)
    assert bytes(file) == data
    assert room_of(lambda: check_program(file, for_dnc=True)) < 12 * SIZE
    assert room_of(lambda: first_difference(file, file)) < 12 * SIZE


def test_more_programs_than_there_are_numbers_are_refused() -> None:
    with pytest.raises(InvalidCommandError, match="more than 100000 programs"):
        parse_program_file(b"%\n" + b"O1\n" * 100_001 + b"%\n")
    assert len(parse_program_file(b"%\n" + b"O1\n" * 1000 + b"%\n").programs) == 1000


def test_more_percent_lines_than_there_are_programs_are_refused() -> None:
    with pytest.raises(InvalidCommandError, match="more than 100000 lines that are % alone"):
        parse_program_file(b"%\n" * 100_002)


@pytest.mark.parametrize("line", [b"N1V1\n", b"X\n"])
def test_more_data_than_any_control_has_are_refused(line: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("compax_aio.haas.language.data_file._MOST_DATA", 1000)
    data = b"%\n" + line * 1001 + b"%\n"
    with pytest.raises(InvalidCommandError, match="more than 1000 lines of data"):
        check_data_file(data, "macros")
    with pytest.raises(InvalidCommandError):
        parse_data_file(data, "macros")
    assert check_data_file(b"%\n" + line * 1000 + b"\n\n%\n", "macros")


@given(
    st.lists(st.sampled_from([b"\r", b"\n", b"A", b"O1", b"%", b" ", b"\0"])), st.sampled_from(["lf", "lf lf", "cr cr"])
)
def test_blocks_are_a_sequence_like_any_other(pieces: list[bytes], eob: str) -> None:
    data = b"".join(pieces)
    assert list(Lines(data, "cr lf").raw[1:]) == list(Lines(data, "cr lf").raw)[1:]
    for program, again in zip(parse_program_file(data, eob=eob), parse_program_file(data, eob=eob), strict=True):
        every = list(program.blocks)
        assert len(program.blocks) == len(every)
        assert [program.blocks[at] for at in range(len(every))] == every
        assert program.blocks[-1] == every[-1]
        assert program.blocks[1:3] == tuple(every[1:3])
        assert bytes(program) == b"".join(block.raw for block in every)
        assert program == again
        assert hash(program.blocks) == hash(again.blocks)
        assert program.blocks != every
        trimmed = list(program.blocks.without_blank_end())
        assert not trimmed or not trimmed[-1].is_blank
        assert all(block.is_blank for block in every[len(trimmed) :])
        assert f"lines {every[0].line} to {every[-1].line}" in repr(program.blocks)
