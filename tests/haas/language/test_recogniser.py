"""The recogniser tells the same of a file, however its bytes come."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compax_aio.haas.facts.eob import EobPattern
from compax_aio.haas.language.lines import Lines
from compax_aio.haas.language.program_file import parse_program_file
from compax_aio.haas.language.recogniser import Recogniser

ANY_FILE = st.lists(
    st.sampled_from([b"%", b"O1234", b"o1", b"G0X1", b"\r", b"\n", b"\r\n", b" ", b"\x00", b"\x14", b"\x1a", b"%%"])
).map(b"".join)


def seen(data: bytes, cuts: list[int]) -> tuple[bool, bool, int, int, int, int]:
    recogniser = Recogniser()
    places = sorted({0, len(data), *(cut % (len(data) + 1) for cut in cuts)})
    for begin, end in zip(places, [*places[1:], len(data)], strict=True):
        recogniser.feed(data[begin:end])
    assert recogniser.offset == len(data)
    return (
        recogniser.has_begun,
        recogniser.has_ended,
        recogniser.percents,
        recogniser.programs,
        recogniser.lines,
        recogniser.offset,
    )


@given(ANY_FILE, st.lists(st.integers(0, 300)))
def test_it_does_not_matter_in_which_pieces_a_file_comes(data: bytes, cuts: list[int]) -> None:
    assert seen(data, cuts) == seen(data, [])
    assert seen(data, list(range(len(data)))) == seen(data, [])


@given(ANY_FILE)
def test_it_counts_the_percent_lines_that_the_parser_finds(data: bytes) -> None:
    begun, ended, percents, _, ends, _ = seen(data, [])
    lines = Lines(data, "lf")  # single ends
    assert percents == len(lines.percents)
    assert begun == bool(lines.percents)
    last = lines.percents[-1] if lines.percents else -1
    assert ended == (percents > 1 and all(map(lines.is_blank, range(last + 1, len(lines.raw)))))
    assert ends == sum(line.endswith((b"\r", b"\n")) for line in lines.raw)


@pytest.mark.parametrize("eob", EobPattern)
def test_a_file_has_ended_at_its_last_percent_and_not_before(eob: EobPattern) -> None:
    data = eob.data.join([b"", b"%", b"O00001", b"G0X1", b"", b"O00002", b"M30", b"", b"%"])
    recogniser = Recogniser()
    begun_at = ended_at = -1
    for at, byte in enumerate(data):
        recogniser.feed(bytes((byte,)))
        if recogniser.has_begun and begun_at < 0:
            begun_at = at
        if recogniser.has_ended and ended_at < 0:
            ended_at = at
    assert begun_at == data.index(b"%")
    assert ended_at == len(data) - 1
    assert recogniser.programs == len(parse_program_file(data).programs) == 2


def ends_of(recogniser: Recogniser, *pieces: bytes) -> list[bool]:
    """Whether the file has ended behind each piece."""
    ends = []
    for piece in pieces:
        recogniser.feed(piece)
        ends.append(recogniser.has_ended)
    return ends


def test_what_has_ended_may_go_on() -> None:
    recogniser = Recogniser()
    assert ends_of(recogniser, b"%\nO1\n%\n", b"O2\nM3", b"0\n%\n\x14") == [True, False, True]
    assert (recogniser.programs, recogniser.percents) == (2, 3)


def test_a_percent_within_a_block_is_no_end() -> None:
    assert ends_of(Recogniser(), b"%\nO1(50% FEED)\nG0 %", b"\n%", b"X") == [False, True, False]


def test_nothing_fed_changes_nothing() -> None:
    recogniser = Recogniser()
    recogniser.feed(b"%\r")
    recogniser.feed(b"")
    recogniser.feed(b"\n")
    assert recogniser.lines == 1
    assert not recogniser.has_ended


def test_names_in_front_of_the_data_are_no_programs() -> None:
    recogniser = Recogniser()
    recogniser.feed(b"OVERLOAD\n%\nO1\n%")
    assert recogniser.programs == 1


def test_it_keeps_nothing_of_a_line_however_long_it_is() -> None:
    recogniser = Recogniser()
    for _ in range(1000):
        recogniser.feed(b"X" * 1000)
    assert sum(len(getattr(recogniser, name)) for name in recogniser.__slots__ if name == "_line") == 1
