"""What is wrong with a file is told with its place before anything is sent; a good one is found clean."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compax_aio.errors import InvalidCommandError
from compax_aio.haas.checking import Problem, check_data_file, check_program, raise_for_errors
from compax_aio.haas.language.building import build_program_file
from compax_aio.haas.language.data_file import parse_data_file
from compax_aio.haas.language.program_file import parse_program_file
from compax_aio.haas.problems import MOST_OF_A_KIND
from compax_aio.haas.profiles import CLASSIC, Profile
from compax_aio.severity import Severity

TRACE = b"\n%\nO05555(CS390_Test_NC)\n(Using G0 which travels along dogleg path.)\nN10G90G94G17\nN66465M30\n\n%\n"


def program(*blocks: str) -> str:
    return "\n".join(("%", "O01234", *blocks, "%", ""))


def told(problems: tuple[Problem, ...]) -> list[tuple[int, int, str, str]]:
    """Line, column, severity and what."""
    return [(each.line, each.column, each.severity.value, each.what) for each in problems]


@pytest.mark.parametrize(
    "file",
    [
        TRACE,
        TRACE + b"\x1a" * 40,
        b"\x00\x00\x12" + TRACE + b"\x14",
        program("G0 X1. (50 PERCENT: a comment)", "", "IF [#1 EQ 2] GOTO 10", "DPRNT[X#1[44]*TEXT]", "M30"),
        program("N10 M98 P9001", "/N20 G1 X-1.5 F10.", "O00002 (TWO)", "M99"),
        "%\r\nO1\r\nM30\r\n%",
    ],
)
def test_a_good_program_is_found_clean(file: str | bytes) -> None:
    assert check_program(file) == ()
    assert check_program(parse_program_file(file), for_dnc=True) == ()


@pytest.mark.parametrize(
    ("block", "found"),
    [
        ("G0 X1\xc4\xd6", (3, 6, "error", "'ÄÖ' is no 7-bit ASCII")),
        ("G0 X1;", (3, 6, "error", "a semicolon")),
        ("G0 (A;B)", (3, 6, "error", "a semicolon")),
        ("G0\x13X1", (3, 3, "error", "DC3 (13 hex) in a program")),
        ("G0\x00X1", (3, 3, "error", "NUL (00 hex) in a program")),
        ("G0\x1aX1", (3, 3, "error", "SUB (1A hex) in a program")),
        ("G0\x7fX1", (3, 3, "error", "DEL (7F hex) in a program")),
        ("G0\x07X1", (3, 3, "error", "07 hex in a program")),
        ("G0\tX1", (3, 3, "warning", "a tab")),
        ("g0 X1", (3, 1, "error", "'g' is a small letter outside of a comment")),
        ("G0 (a) goto 5", (3, 8, "error", "'goto' is in small letters outside of a comment")),
        ("G0 X1 %", (3, 7, "error", "a % within a block")),
        ("%G0", (3, 1, "error", "a % within a block")),
        ("(50% FEED)", (3, 4, "warning", "a % within a comment")),
        ("G0 (OPEN", (3, 4, "warning", "a comment that does not end in its line")),
        ("X" * 257, (3, 1, "warning", "a block of 257 bytes")),
        ("O1234", (3, 1, "error", "O1234 is there already, in line 2")),
        ("O8000(PROBE)", (3, 1, "error", "O8000 is protected: probing and the vendor's macros have such numbers")),
        ("O09999", (3, 1, "error", "O09999 is protected: probing and the vendor's macros have such numbers")),
        ("O123456", (3, 1, "error", "'O123456' is no name of a program")),
        ("OOPS", (3, 1, "error", "'OOPS' is no name of a program")),
    ],
)
def test_what_is_wrong_is_told_with_its_place(block: str, found: tuple[int, int, str, str]) -> None:
    file = program(block, "G1")
    assert told(check_program(file)) == [found]
    (problem,) = check_program(file.replace("\n", "\r\n"))
    assert (problem.line, problem.column) == found[:2], "whatever ends the lines"
    data = file.encode("latin-1")
    (problem,) = check_program(data)
    assert data[problem.offset :].startswith(block.encode("latin-1")[problem.column - 1 :])
    assert problem.hint


def test_limits_themselves_are_all_right() -> None:
    assert check_program(program("X" * 256, "O07999", "O10000")) == ()
    assert check_program(program("N100000 M30"), for_dnc=True) == ()


def test_frames_that_are_not_whole() -> None:
    assert told(check_program("O1\nM30\n%\n")) == [(1, 1, "error", "it does not begin with %")]
    assert told(check_program("%\nO1\nM30\n")) == [(3, 5, "error", "it does not end with %")]
    assert [each.what for each in check_program("O1\nM30\n")] == [
        "it does not begin with %", "it does not end with %",
    ]  # fmt: skip
    (cut_short,) = check_program("%\nO1\nM3")
    assert cut_short.alarm is not None
    assert cut_short.alarm.number == 412


def test_programs_wrapped_one_by_one_have_too_many_percents() -> None:
    assert told(check_program("%\nO1\n%\nO2\n%\n")) == [(3, 1, "error", "a % line between the first and the last one")]
    assert [each.line for each in check_program("%\nO1\n%\n%\nO2\n%\n")] == [3, 4]


def test_what_stands_in_front_is_told_and_what_stands_behind_and_would_not_be_sent_is_an_error() -> None:
    problems = check_program("HELLO\n%\nO1\n%\nBYE\n")
    assert told(problems) == [
        (1, 1, "warning", "6 bytes in front of the first %"),
        (5, 1, "error", "4 bytes behind the last %"),
    ]


@pytest.mark.parametrize("file", [b"", "%\n%\n", "%\n\n \n%\n"])
def test_a_file_without_a_program_is_an_error(file: str | bytes) -> None:
    empty = [each for each in check_program(file) if each.what == "there is no program"]
    assert [each.alarm.number for each in empty if each.alarm] == [411]


def test_blocks_in_front_of_a_name() -> None:
    (problem,) = check_program("%\n(HEADER)\nO1\n%\n")
    assert (problem.line, problem.what) == (2, "blocks without the name of a program in front")
    assert problem.alarm is not None
    assert problem.alarm.number == 404
    assert check_program("%\nG0X1\nM30\n%\n", for_dnc=True) == ()


def test_names_are_as_long_as_the_control_has_them() -> None:
    four = replace(CLASSIC, o_digits=4)
    assert check_program("%\nO01234\n%\n", four) == ()
    (problem,) = check_program("%\nO12345\n%\n", four)
    assert problem.alarm is not None
    assert (problem.alarm.number, problem.hint) == (405, "it is O and a number of at most 4 digits")


def test_what_is_protected_is_what_the_profile_says() -> None:
    mine = replace(CLASSIC, protected=((1234, 1234),))
    assert [each.line for each in check_program("%\nO1234\nO9000\n%\n", mine)] == [2]


def test_what_is_meant_is_a_note() -> None:
    assert told(check_program("%\nO9001\n%\n", protected=True)) == [
        (2, 1, "note", "O9001 is protected: probing and the vendor's macros have such numbers"),
    ]
    assert told(check_program(program("G0;"), semicolons=True)) == [(3, 3, "note", "a semicolon")]


def test_what_is_fed_is_not_stored() -> None:
    """So that its name overwrites nothing."""
    assert check_program("%\nO9001\nM30\nO9001\n%\n", for_dnc=True) == ()
    assert [each.severity for each in check_program("%\nO123456\n%\n", for_dnc=True)] == [Severity.ERROR]


@pytest.mark.parametrize("block", ["N100001 G1", "/N 999999999999 G1", "G1 N00123456", "(A)N100001"])
def test_line_numbers_that_crash_a_control_are_refused_in_dnc_alone(block: str) -> None:
    assert check_program(program(block)) == ()
    (problem,) = check_program(program(block), for_dnc=True)
    assert (problem.line, problem.severity) == (3, Severity.ERROR)
    assert problem.column == block.index("N") + 1
    assert "take the N words out" in problem.hint


@pytest.mark.parametrize("block", ["N99999", "(N100001)", "#N100001", "N1 X100001", "GOTO100001"])
def test_what_is_no_high_line_number(block: str) -> None:
    assert check_program(program(block), for_dnc=True) == ()


def test_of_each_kind_the_first_are_told_and_the_others_counted() -> None:
    problems = check_program(program(*["G0;"] * 100, *["g0"] * 21))
    assert len(problems) == 2 * MOST_OF_A_KIND + 2
    assert [each.what for each in problems[-2:]] == [
        "80 more of this kind: semicolons", "1 more of this kind: small letters",
    ]  # fmt: skip
    assert all(each.severity is Severity.NOTE for each in problems[-2:])


def test_no_error_hides_among_what_is_counted() -> None:
    """Tabs are warnings, so that a hundred of them must not swallow a DC3."""
    problems = check_program(program("\t" * 100, "G0\x13", *["(%)"] * 100, "G0 %"))
    assert [each.line for each in problems if each.severity is Severity.ERROR] == [4, 105]


@given(
    st.lists(
        st.sampled_from([b"%", b"O12", b"\n", b"\r\n", b"\r", b"g", b";", b"(", b")", b"\x11", b"\xff", b" ", b"N1"])
    )
)
def test_whatever_comes_places_are_within_the_file_and_in_order(parts: list[bytes]) -> None:
    data = b"".join(parts)
    problems = check_program(data, for_dnc=bool(len(parts) % 2))
    lines = data.splitlines()
    for each in problems:
        assert 0 <= each.offset <= len(data)
        assert 1 <= each.line <= max(1, len(lines))
    assert [each.offset for each in problems] == sorted(each.offset for each in problems)
    if not problems:
        assert bytes(build_program_file(data, eob="lf", for_dnc=True)).count(b"%") == 2


def test_a_character_without_a_code_of_8_bits_cannot_be_looked_at() -> None:
    with pytest.raises(InvalidCommandError, match="line 3, column 1: '€'"):
        check_program(program("€"))


def test_errors_are_raised_all_at_once() -> None:
    raise_for_errors(check_program(program("G0\tX1")))
    with pytest.raises(InvalidCommandError) as raised:
        raise_for_errors(check_program("%\nO123456\ng0\n%\n"))
    assert str(raised.value).splitlines() == [
        "2 errors in the file:",
        "line 2, column 1: error: 'O123456' is no name of a program; it is O and a number of at most 5 digits "
        "(the control would raise alarm 405 (RS-232 ILLEGAL PROG NAME))",
        "line 3, column 1: error: 'g' is a small letter outside of a comment; write capital letters "
        "(the control would raise alarm 407 (RS-232 INVALID CODE))",
    ]
    with pytest.raises(InvalidCommandError, match="1 error in the file:"):
        raise_for_errors(check_program(program("g0")))


# Numbered data --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "file"),
    [
        ("parameters", b"%\nN0 V12345\nN1 V100\n%\n"),
        ("settings", b"\x12%\r\nN0 V12345\r\nN1 V100\r\n%\r\n\x14"),
        ("settings", b"%\nN1 V100\n%\n"),
        ("offsets", b"%\nN1 V-100.5\n\n%"),
        ("macros", b"%\nN100 V1\nN9999 V0\n%\n\x1a\x1a"),
    ],
)
def test_a_good_file_of_data_is_found_clean(kind: str, file: bytes) -> None:
    assert check_data_file(file, kind) == ()
    assert check_data_file(parse_data_file(file, kind)) == ()


@pytest.mark.parametrize(
    ("kind", "file", "found"),
    [
        ("parameters", "%\nN1 V1\n%\n", (2, 1, "error", "there is no N0")),
        ("macros", "%\nN1 V1\n%\n", (2, 1, "error", "there is no N9999")),
        ("macros", "%\nN1 V1\nN0 V5\nN9999 V0\n%\n", (3, 1, "error", "there is an N0")),
        ("settings", "%\nN1 V1\nN1 V2\n%\n", (3, 1, "error", "N1 is there already, in line 2")),
        ("settings", "%\nN0 V1\n%\n", (2, 1, "error", "there is no setting")),
        ("offsets", "%\nN1 V1\nN2 X\n%\n", (3, 4, "error", "behind the number stands V, not 'X'")),
        ("offsets", "%\nN1 V1\n%\nN2 V2\n%\n", (3, 1, "error", "a % line between the first and the last one")),
        ("offsets", "%\nN1 V1\n", (2, 7, "error", "it does not end with %")),
        ("offsets", "N1 V1\n%\n", (1, 1, "error", "it does not begin with %")),
        ("offsets", "READY\n%\nN1 V1\n%\n", (1, 1, "warning", "6 bytes in front of the first %")),
    ],
)
def test_what_is_wrong_with_data_is_told_with_its_place(kind: str, file: str, found: tuple[int, int, str, str]) -> None:
    assert told(check_data_file(file, kind)) == [found]


def test_lines_that_are_none_are_told_with_the_alarm() -> None:
    wrong = check_data_file("%\nN1 V1\nG0\nN2 VX\n%\n", "settings")
    assert [each.alarm.number for each in wrong if each.alarm] == [409, 410]
    many = check_data_file("%\nN1 V1\n" + "G0\n" * 50 + "%\n", "settings")
    assert len(many) == MOST_OF_A_KIND + 1


def test_macro_variables_without_n9999_can_be_forced() -> None:
    (problem,) = check_data_file("%\nN1 V1\n%\n", "macros", force=True)
    assert problem.severity is Severity.WARNING


def test_of_bytes_it_must_be_said_what_they_are() -> None:
    with pytest.raises(InvalidCommandError, match="of what the data are must be said"):
        check_data_file(b"%\n%\n")
    with pytest.raises(InvalidCommandError, match="'tools' is no kind of data"):
        check_data_file(b"%\n%\n", "tools")


@pytest.mark.parametrize("profile", [CLASSIC, Profile(name="bare")])
def test_what_is_built_of_a_good_program_is_good(profile: Profile) -> None:
    built = build_program_file(TRACE, eob=profile.eob, o_digits=profile.o_digits)
    assert check_program(built, profile) == ()
