"""A job comes in pieces of any size; whole instructions come out, byte for byte, each with its place."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compax_aio.camm1.facts.mnemonics import MODE_2
from compax_aio.camm1.language.instruction import Instruction, Language
from compax_aio.camm1.language.tokeniser import Tokeniser
from compax_aio.errors import InvalidCommandError

WORDS = [
    b"PU", b"PD", b"PA", b"pr", b"IN", b"DF", b"LB", b"DT", b"DT#", b"DT;", b"SM", b"SMA", b"PE", b"CO", b"SI", b"ZZ",
    b"10,20", b"-3.5", b",", b" ", b"\r\n", b"\n", b"\r", b";", b"#", b"\x03", b'"', b"P", b"H", b"D", b"M", b"^", b"!",
    b"!PG100", b"^PD", b"\x1b", b"\x1b.", b"\x1b.B", b"\x1b.B:", b"\x1b.I80;;17:", b"\x1b.M", b"\x80", b"Hello; World",
    b"XT", b"T", b"\x00",
]  # fmt: skip
jobs = st.lists(st.one_of(st.sampled_from(WORDS), st.binary(max_size=4)), max_size=30).map(b"".join)
languages = st.sampled_from([None, Language.ONE, Language.TWO])


def taken_apart(*pieces: bytes, language: Language | None = None, longest_bytes: int = 1 << 20) -> list[Instruction]:
    tokeniser = Tokeniser(language=language, longest_bytes=longest_bytes)
    found = [each for piece in pieces for each in tokeniser.feed(piece)]
    return [*found, *tokeniser.finish()]


def seen(job: bytes, language: Language | None = None) -> list[tuple[str, bytes]]:
    """Name and arguments of all but blanks."""
    found = taken_apart(job, language=language)
    return [(each.name, each.arguments) for each in found if each.language is not Language.BLANK]


# Whatever comes -------------------------------------------------------------------------------------------------------


@given(job=jobs, language=languages)
def test_the_instructions_of_a_job_are_the_job(job: bytes, language: Language | None) -> None:
    found = taken_apart(job, language=language)
    assert b"".join(each.data for each in found) == job
    offset = 0
    for each in found:
        assert each.offset == offset
        assert 0 <= each.begin <= each.first <= each.last <= len(each.data) > 0
        offset += len(each.data)


@given(job=jobs, language=languages, data=st.data())
def test_however_a_job_is_cut_into_pieces_the_same_comes_out(
    job: bytes, language: Language | None, data: st.DataObject
) -> None:
    cuts = sorted(data.draw(st.lists(st.integers(0, len(job)), max_size=8)))
    pieces = [job[begin:end] for begin, end in zip([0, *cuts], [*cuts, len(job)], strict=True)]
    whole = taken_apart(job, language=language)
    assert taken_apart(*pieces, language=language) == whole
    assert taken_apart(*(bytes([byte]) for byte in job), language=language) == whole


@given(jobs)
def test_line_and_column_are_those_of_the_name(job: bytes) -> None:
    for each in taken_apart(job):
        lines = re.split(rb"\r\n|\r|\n", job[: each.place])
        if job[: each.place].endswith(b"\r") and job[each.place : each.place + 1] == b"\n":
            continue  # nothing begins in the middle of a line's end but blanks
        assert (each.line, each.column) == (len(lines), len(lines[-1]) + 1)


@given(job=jobs, language=languages)
def test_only_the_last_instruction_can_be_without_its_end(job: bytes, language: Language | None) -> None:
    found = taken_apart(job, language=language)
    assert all(each.is_complete for each in found[:-1])


# Mode 2 ---------------------------------------------------------------------------------------------------------------


def test_instructions_of_mode_2_end_with_a_semicolon_or_where_the_next_begins() -> None:
    assert seen(b"IN;PU10,20PD30,40;pa;PUPD1 2;") == [
        ("IN", b""), ("PU", b"10,20"), ("PD", b"30,40"), ("PA", b""), ("PU", b""), ("PD", b"1 2"),
    ]  # fmt: skip


def test_lines_and_blanks_end_no_list_of_mode_2() -> None:
    assert seen(b"PD10,20,\r\n 30,40;\n") == [("PD", b"10,20,\r\n 30,40")]


def test_an_instruction_is_given_as_soon_as_its_end_has_come() -> None:
    tokeniser = Tokeniser()
    assert not tokeniser.feed(b"PU10,2")
    assert tokeniser.held_bytes == 6
    (found,) = tokeniser.feed(b"0;")
    assert (found.data, found.arguments, tokeniser.held_bytes) == (b"PU10,20;", b"10,20", 0)


def test_a_label_ends_with_etx_and_whatever_stands_in_it_is_text() -> None:
    assert seen(b"LBPU;PD 1,2;\r\nIN;\x03PU;") == [("LB", b"PU;PD 1,2;\r\nIN;"), ("PU", b"")]


def test_dt_has_another_character_end_labels_until_in_df_or_a_bare_dt() -> None:
    assert seen(b"DT#;LBa\x03;#PU;") == [("DT", b"#"), ("LB", b"a\x03;"), ("PU", b"")]
    assert seen(b"DT#LBa#") == [("DT", b"#"), ("LB", b"a")]
    for reset in (b"IN;", b"DF;", b"DT;", b"in;"):
        assert seen(b"DT#;" + reset + b"LBa#\x03PU;")[-2:] == [("LB", b"a#"), ("PU", b"")]


def test_a_symbol_may_be_a_letter_and_ends_with_its_instruction() -> None:
    assert seen(b"SMA;SM*PU;SM;") == [("SM", b"A"), ("SM", b"*"), ("PU", b""), ("SM", b"")]


def test_an_encoded_polyline_is_not_torn_at_its_letters() -> None:
    assert seen(b"PE<=AbCPUPD!^;PU;") == [("PE", b"<=AbCPUPD!^"), ("PU", b"")]


def test_a_comment_in_quotation_marks_is_not_torn() -> None:
    assert seen(b'CO "PU;PD";CO;PU;') == [("CO", b' "PU;PD"'), ("CO", b""), ("PU", b"")]


def test_a_polygon_is_made_of_whole_instructions() -> None:
    assert [name for name, _ in seen(b"PM0;PD1,1,2,2;PM1;PM2;EP;")] == ["PM", "PD", "PM", "PM", "EP"]


def test_what_mode_2_does_not_have_is_of_mode_2_all_the_same_if_it_has_two_letters() -> None:
    (found,) = taken_apart(b"ZZ1,2;")
    assert (found.name, found.language) == ("ZZ", Language.TWO)


@pytest.mark.parametrize("junk", [b"12,13;", b"\x80;", b"!;", b"^;", b"!P;", b"?", b"#"])
def test_what_begins_like_no_instruction_has_no_name(junk: bytes) -> None:
    assert taken_apart(b"PU;" + junk)[1].language is Language.UNKNOWN


# Mode 1 ---------------------------------------------------------------------------------------------------------------


def test_instructions_of_mode_1_end_with_their_line_or_a_semicolon_or_the_next_letter() -> None:
    job = b"H\r\nD100,200,300,400\nM0,0;R5,5I1,1\rS3"
    found = [each for each in taken_apart(job) if each.language is not Language.BLANK]
    assert [(each.name, each.arguments) for each in found] == [
        ("H", b""), ("D", b"100,200,300,400"), ("M", b"0,0"), ("R", b"5,5"), ("I", b"1,1"), ("S", b"3"),
    ]  # fmt: skip
    assert {each.language for each in found} == {Language.ONE}
    assert [(each.line, each.column) for each in found] == [(1, 1), (2, 1), (3, 1), (3, 6), (3, 10), (4, 1)]


def test_p_prints_its_line_behind_other_instructions_of_mode_1() -> None:
    assert seen(b"M0,0\nPAll; this PD10,10 is text\nD1,1\n") == [
        ("M", b"0,0"), ("P", b"All; this PD10,10 is text"), ("D", b"1,1"),
    ]  # fmt: skip


@pytest.mark.parametrize("end", [b"", b";", b"\n", b"10,10;", b" -5,5;"])
def test_p_is_of_mode_2_behind_mode_1_too_if_it_looks_so(end: bytes) -> None:
    assert [name for name, _ in seen(b"M0,0\nPU" + end)] == ["M", "PU"]
    assert [name for name, _ in seen(b"M0,0\nPUT" + end)] == ["M", "P"]


def test_p_is_the_first_letter_of_mode_2_everywhere_else() -> None:
    assert [name for name, _ in seen(b"IN;PA0,0;PU;")] == ["IN", "PA", "PU"]
    assert [name for name, _ in seen(b"M0,0\nIN;PA0,0;PU;")] == ["M", "IN", "PA", "PU"]


def test_one_instruction_of_mode_2_ends_mode_1_for_p() -> None:
    assert [name for name, _ in seen(b"M0,0\nVS5;PAR1,1\n")] == ["M", "VS", "PA", "R"]


def test_a_lone_p_in_mode_2_swallows_no_job() -> None:
    found = taken_apart(b"PU;P 10;PD10,10;PU;")
    assert [each.name for each in found] == ["PU", "P", "PD", "PU"]
    assert found[1].language is Language.UNKNOWN


def test_mode_1_calls_mode_2_with_a_circumflex() -> None:
    assert seen(b"^DF\r\n^PD10,10\nD1,1\n^LBHi;\n\x03H\n") == [
        ("DF", b""), ("PD", b"10,10"), ("D", b"1,1"), ("LB", b"Hi;\n"), ("H", b""),
    ]  # fmt: skip


def test_common_instructions_are_of_both_modes() -> None:
    found = taken_apart(b"!PG100;!FS80;PU;!ST1\nD1,1\n!NR")
    assert [each.name for each in found] == ["!PG", "!FS", "PU", "!ST", "D", "!NR"]
    assert found[0].language is Language.COMMON


def test_a_job_that_is_known_to_be_in_one_mode_is_read_so() -> None:
    assert seen(b"PHello\nHDA1,1;", Language.ONE) == [("P", b"Hello"), ("H", b""), ("D", b""), ("A", b"1,1")]
    found = taken_apart(b"^PU;PA1,1;D1,1;", language=Language.TWO)
    assert [(each.name, each.language) for each in found] == [
        ("PU", Language.TWO), ("PA", Language.TWO), ("D", Language.UNKNOWN),
    ]  # fmt: skip


# Device control -------------------------------------------------------------------------------------------------------


def test_device_control_between_instructions_stands_alone() -> None:
    found = taken_apart(b"PU;\x1b.B\x1b.I80;;17:PD1,1;\x1b.O:\x1b\x1b.qPU;")
    assert [(each.name, each.data) for each in found] == [
        ("PU", b"PU;"), ("ESC.B", b"\x1b.B"), ("ESC.I", b"\x1b.I80;;17:"), ("PD", b"PD1,1;"), ("ESC.O", b"\x1b.O:"),
        ("ESC", b"\x1b"), ("ESC.q", b"\x1b.q"), ("PU", b"PU;"),
    ]  # fmt: skip


def test_device_control_in_the_middle_of_a_list_stays_there_and_is_told() -> None:
    (found,) = taken_apart(b"PD10,\x1b.B20,\x1b.I80;;17:30,40;")
    assert found.holds_control
    assert found.arguments == b"10,\x1b.B20,\x1b.I80;;17:30,40"


def test_unended_device_control_ends_with_the_job() -> None:
    assert [each.data for each in taken_apart(b"PU;\x1b.M5;")] == [b"PU;", b"\x1b.M5;"]
    assert [each.data for each in taken_apart(b"PU;\x1b.")] == [b"PU;", b"\x1b."]


def test_parameters_without_end_are_no_reason_to_hold_the_job() -> None:
    found = taken_apart(b"\x1b.M" + b"1" * 5000 + b":PU;")
    assert [len(each.data) for each in found[:1]] == [4099]
    assert found[-1].name == "PU"


# Bounds ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [1, 7, 1000])
def test_an_instruction_that_never_ends_is_refused_with_its_place(size: int) -> None:
    job = b"IN;\n  PU;\n LB" + b"x" * 2000
    with pytest.raises(InvalidCommandError, match="line 3, column 2: an instruction of more than 1000 bytes"):
        taken_apart(*(job[at : at + size] for at in range(0, len(job), size)), longest_bytes=1000)


@pytest.mark.parametrize("size", [1, 5000])
def test_a_long_instruction_is_refused_whether_its_end_has_come_or_not(size: int) -> None:
    job = b"PU;\nPD" + b"1,1," * 300 + b"1,1;PU;"
    pieces = [job[at : at + size] for at in range(0, len(job), size)]
    with pytest.raises(InvalidCommandError, match="line 2, column 1"):
        taken_apart(*pieces, longest_bytes=1000)
    assert len(taken_apart(*pieces, longest_bytes=2000)) == 3


def test_blanks_without_end_are_not_held() -> None:
    tokeniser = Tokeniser(longest_bytes=10_000)
    for _ in range(100):
        tokeniser.feed(b" \r\n;" * 1000)
        assert tokeniser.held_bytes <= 4096
    assert {each.language for each in tokeniser.finish()} <= {Language.BLANK}


def test_every_plain_instruction_of_mode_2_is_read_by_its_name_in_any_spelling() -> None:
    for name in MODE_2:
        for spelt in (name, name.lower(), name.capitalize()):
            assert taken_apart(spelt.encode() + b"\x03;")[0].name == name


def test_an_instruction_says_what_and_where_it_is() -> None:
    unknown, known = taken_apart(b"12;\n PU;")
    assert (str(unknown), str(known)) == ("unknown at line 1, column 1", "PU at line 2, column 2")
    assert (known.size_bytes, known.place) == (5, 5)
