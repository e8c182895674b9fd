"""Long lists in parts that draw the same line, what is taken out of a job, and the job itself."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.camm1.little_plotter import segments

from compax_aio.camm1.control_parser import ControlParser, DataFound
from compax_aio.camm1.language.instruction import Instruction
from compax_aio.camm1.language.job import Job, as_bytes, instructions_of, parse
from compax_aio.camm1.language.numbers import numbers, written_number
from compax_aio.camm1.language.splitting import split_long
from compax_aio.camm1.language.stripping import is_output, stripped
from compax_aio.camm1.profiles import DXY_1300, HP_7475A
from compax_aio.errors import InvalidCommandError

coordinate = st.integers(-9999, 9999).map(str) | st.decimals(-999, 999, places=2).map(str)
separator = st.sampled_from([",", " ", " , ", ",\n"])


@st.composite
def lists(draw: st.DrawFn, words: tuple[str, ...], separators: st.SearchStrategy[str], end: str) -> str:
    values = draw(st.lists(st.tuples(coordinate, coordinate), max_size=30))
    flat = [each for pair in values for each in pair]
    text = "".join(each + (draw(separators) if index < len(flat) - 1 else "") for index, each in enumerate(flat))
    return draw(st.sampled_from(["", "\n", " "])) + draw(st.sampled_from(words)) + text + end


jobs_of_mode_2 = st.lists(lists(("PU", "PD", "PA", "PR"), separator, ";"), max_size=6).map("".join)
jobs_of_mode_1 = st.lists(
    lists(("D", "M", "I", "R"), st.sampled_from([",", " "]), "\n").filter(lambda text: any(map(str.isdigit, text))),
    max_size=6,
).map("".join)


def one(text: bytes) -> Instruction:
    (found,) = parse(text, DXY_1300).instructions
    return found


# Splitting ------------------------------------------------------------------------------------------------------------


@given(job=jobs_of_mode_2 | jobs_of_mode_1, longest=st.integers(24, 80))
def test_parts_of_long_lists_draw_the_same_line(job: str, longest: int) -> None:
    parsed = parse(job, DXY_1300)
    parts = [part for each in parsed for part in split_long(each, longest)]
    assert segments(b"".join(part.data for part in parts)) == segments(job.encode())
    assert all(len(part.data) <= longest for part in parts)


@given(jobs_of_mode_2)
def test_a_part_stands_where_its_first_coordinate_stands(job: str) -> None:
    parsed = parse(job, DXY_1300)
    for each in parsed:
        for part in split_long(each, 24)[1:]:
            lines = job[: part.offset].split("\n")
            assert job.encode()[part.offset :].startswith(part.arguments.split(b",")[0])
            assert (part.line, part.column) == (len(lines), len(lines[-1]) + 1)


def test_blanks_in_front_stay_in_front_and_spelling_stays() -> None:
    parts = split_long(one(b" pd1,2,3,4,5,6;"), 10)
    assert [part.data for part in parts] == [b" pd1,2;", b"pd3,4,5,6;"]
    assert [part.begin for part in parts] == [1, 0]


def test_parts_are_as_long_as_they_may_be_and_have_their_names() -> None:
    parts = split_long(one(b"PD1,2,3,4,5,6,7,8;"), 10)
    assert [part.data for part in parts] == [b"PD1,2,3,4;", b"PD5,6,7,8;"]
    assert [(part.name, part.arguments) for part in parts] == [("PD", b"1,2,3,4"), ("PD", b"5,6,7,8")]
    assert [part.offset for part in parts] == [0, 10]


def test_a_list_that_nothing_ended_is_ended_in_its_parts() -> None:
    assert [part.data for part in split_long(one(b"PD1,2,3,4"), 7)] == [b"PD1,2;", b"PD3,4;"]
    assert [part.data for part in split_long(one(b"D1,2,3,4"), 6)] == [b"D1,2\n", b"D3,4\n"]
    assert [part.is_complete for part in split_long(one(b"PD1,2,3,4"), 7)] == [True, False]


@pytest.mark.parametrize(
    "whole",
    [
        b"PD1,2;",
        b"PD1,2,3,4,5;",
        b"LB1,2,3,4,5,6,7,8\x03",
        b"PE1234567890;",
        b"PD1,2,\x1b.B3,4,5,6;",
        b"PD123456789,123456789;",
        b"CI12345678901;",
        b"^PU;",
    ],
)
def test_what_cannot_be_parted_stays_whole(whole: bytes) -> None:
    instruction = one(whole)
    assert split_long(instruction, 8) == (instruction,)


# Stripping ------------------------------------------------------------------------------------------------------------

control = st.sampled_from([b"\x1b.B", b"\x1b.O:", b"\x1b.I80;;17:", b"\x1b.M:", b"\x1b.K", b"\x1b.@;0:", b"\x1b.q"])
piece = st.sampled_from([b"PD1,2", b"3,4;", b",5,6", b"LBab", b"\x03", b"PU;", b"D7,8\n", b" "])


@given(st.lists(control | piece, max_size=12).map(b"".join))
def test_what_is_left_is_what_the_machine_would_cut(job: bytes) -> None:
    found = ControlParser().feed(job)
    left = b"".join(each.data for each in found if isinstance(each, DataFound))
    kept = [stripped(each) for each in parse(job) if not is_output(each)]
    assert b"".join(each.data for each in kept if each) == left


def test_instructions_without_device_control_stay_as_they_are() -> None:
    instruction = one(b"PD1,2;")
    assert stripped(instruction) is instruction


def test_device_control_within_a_list_is_taken_out_of_it() -> None:
    left = stripped(one(b"PD1,\x1b.B2,\x1b.I80;;17:3,4;"))
    assert left
    assert (left.data, left.arguments, left.offset) == (b"PD1,2,3,4;", b"1,2,3,4", 0)


@pytest.mark.parametrize("out", [b"OA;", b"oi;", b"OS;", b"\x1b.B", b"\x1b.I80;;17:"])
def test_what_answers_and_what_is_device_control_is_left_out(out: bytes) -> None:
    assert stripped(one(out)) is None


# Numbers --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "values"),
    [
        (b"", []),
        (b" \n", []),
        (b"1,2", [1, 2]),
        (b"1 2", [1, 2]),
        (b" 1 , -2.5\r\n,+3 ", [1, -2.5, 3]),
        (b".5,5.", [0.5, 5]),
    ],
)
def test_numbers_have_commas_or_blanks_between_them(text: bytes, values: list[float]) -> None:
    assert numbers(text) == values


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (b"1,,2", "a number is missing beside a comma"),
        (b"1,2,", "a number is missing beside a comma"),
        (b"1_0", "'1_0' is no number"),
        (b"nan", "'nan' is no number"),
        (b"1e5", "'1e5' is no number"),
        (b"1-2,3", "'1-2' is no number"),
        (b"--1", "'--1' is no number"),
        (b"\xb2", "'²' is no number"),
    ],
)
def test_what_is_no_number_is_told(text: bytes, why: str) -> None:
    with pytest.raises(ValueError) as caught:  # noqa: PT011  # its text is what is asked for
        numbers(text)
    assert str(caught.value) == why


@given(st.floats(-1e6, 1e6))
def test_a_number_is_written_short_and_read_again(value: float) -> None:
    text = written_number(value)
    assert abs(float(text) - value) <= 0.0005001
    assert "e" not in text
    assert not text.startswith("-0") or text.startswith("-0.")


# Jobs -----------------------------------------------------------------------------------------------------------------


def test_a_job_knows_its_bytes() -> None:
    job = parse("IN;PU1,2;\n")
    assert (job.data, len(job), [each.name for each in job]) == (b"IN;PU1,2;\n", 10, ["IN", "PU", ""])
    assert (len(Job(())), Job(()).data) == (0, b"")


def test_characters_go_over_the_line_as_one_byte_each() -> None:
    assert as_bytes("LBä\x03") == b"LB\xe4\x03"
    assert as_bytes(bytearray(b"PU;")) == b"PU;"  # type: ignore[arg-type]


def test_a_character_without_a_code_is_told_with_its_place() -> None:
    with pytest.raises(InvalidCommandError, match="line 2, column 3: '€' has no code of 8 bits"):
        parse("IN;\nLB€\x03")


def test_a_machine_without_mode_1_reads_no_mode_1() -> None:
    assert [each.name for each in parse(b"M1,1\nPA1,1;", HP_7475A)] == ["M", "PA"]
    assert parse(b"M1,1\n", HP_7475A).instructions[0].language.value == "unknown"


def test_pieces_of_text_and_bytes_are_one_job() -> None:
    found = [*instructions_of(["IN;P", b"U1,", "2;"])]
    assert [each.data for each in found] == [b"IN;", b"PU1,2;"]
