"""What is wrong with a job is told with its place before anything is sent; a good one is found clean."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compax_aio import camm1
from compax_aio.camm1.checking import MOST_OF_A_KIND, Checker, Problem, Sheet, check, raise_for_errors
from compax_aio.camm1.language.job import parse
from compax_aio.camm1.profiles import CX_24, DXY_1300, GS_24, HP_7475A, PNC_900, Profile
from compax_aio.errors import InvalidCommandError
from compax_aio.severity import Severity

SHEET = Sheet(100, 50)


def told(job: str | bytes, profile: Profile = PNC_900, sheet: Sheet | None = None) -> list[tuple[str, str]]:
    """Severity and what."""
    return [(each.severity.value, each.what) for each in check(job, profile, sheet)]


@pytest.mark.parametrize(
    "job",
    [
        "",
        "\r\n ; \n",
        "IN;PA;VS5;PU100,100;PD200,100,200,200;PU;PU0,0;!PG100;",
        "H\r\nD100,200\r\nR1,1\r\nP12 a;b\r\nL-5\nQ3\nH\n",
        "^DF\r\n^PU10,10\r\nM0,0\n",
        "IN;DT#;LBa\x03b#PU;",
        "PR1,1,2,2;PD1,1;PU-3,-3;",
        "PA100,100;CI50;AA100,50,90;EA20,20;WG10,0,90;PU;",
    ],
)
def test_a_good_job_is_found_clean(job: str) -> None:
    assert check(job, PNC_900, SHEET) == ()


@pytest.mark.parametrize(
    ("job", "line", "column", "severity", "what"),
    [
        ("PU;\nZZ5;", 2, 1, "error", "'ZZ5;' is no instruction"),
        ("PU;\n  12,13;", 2, 3, "error", "'12,13;' is no instruction"),
        ("PU;!XY;", 1, 4, "error", "'!XY;' is no instruction"),
        ("PU;SP1;", 1, 4, "error", "PNC-900 is not known to have SP (select a pen)"),
        ("PU;PD1;PU;", 1, 4, "error", "PD takes pairs of numbers, not 1"),
        ("CI;", 1, 1, "error", "CI takes 1 or 2, not 0"),
        ("PU1,,2;", 1, 1, "error", "PU: a number is missing beside a comma"),
        ("PU1,2_3;", 1, 1, "error", "PU: '1,2_3' is no number"),
        ("PU1,67108864;", 1, 1, "error", "PU: a number beyond ±67108863"),
        ("PU-67108864,1;", 1, 1, "error", "PU: a number beyond ±67108863"),
        ("VS21;", 1, 1, "error", "VS21: speed, cm/s, is from 1 to 20"),
        ("!PG1601;", 1, 1, "error", "!PG1601: feed the sheet, mm, is from -1600 to 1600"),
        ("!ST2;", 1, 1, "error", "!ST2: tool 0 or 1, is from 0 to 1"),
        ("IM256;", 1, 1, "error", "IM256: mask of errors, is from 0 to 255"),
        ("X0,5,0\n", 1, 1, "error", "X0: axis with ticks, is from 1 to 32767"),
        ("Q4\n", 1, 1, "error", "Q4: rotation of text, by 90°, is from 0 to 3"),
        ("PU;\n\nLBno end", 3, 1, "error", "the text of LB has no end"),
        ("PU;PU", 1, 4, "warning", "PU at the end of the job is not ended"),
        ("PU;OA;", 1, 4, "warning", "OA has the machine answer"),
        ("PU;\x1b.B", 1, 4, "warning", "device control '\\x1b.B' in a job"),
        ("PU1,\x1b.B2;", 1, 1, "warning", "device control '\\x1b.B' in a job"),
        ("LB\xe4\x03", 1, 1, "warning", "a character of 8 bits"),
        ("LB\x13\x03", 1, 1, "error", "DC1, DC3 or ENQ in a job"),
        ("PU;\nPD10,10;", 2, 1, "warning", "the tool is left down at the end of the job"),
        ("M0,0\nD10,10\n", 2, 1, "warning", "the tool is left down at the end of the job"),
    ],
)
def test_what_is_wrong_is_told_with_its_place(job: str, line: int, column: int, severity: str, what: str) -> None:
    (problem,) = check(job, PNC_900, SHEET)
    assert (problem.line, problem.column, problem.severity.value, problem.what) == (line, column, severity, what)
    assert problem.hint
    assert str(problem) == f"line {line}, column {column}: {severity}: {what}; {problem.hint}"
    lines = job[: problem.offset].split("\n")
    assert (len(lines), len(lines[-1]) + 1) == (line, column)


def test_what_a_profile_is_not_documented_to_lack_is_a_warning() -> None:
    assert told("SP1;", CX_24) == [("warning", "CX-24 is not known to have SP (select a pen)")]
    assert told("SP1;", HP_7475A) == []
    assert told("!FS80;", GS_24) == []
    assert told("!FS400;", GS_24) == [("error", "!FS400: force, gf, is from 30 to 350")]
    assert told("SP9;", DXY_1300) == [("error", "SP9: select a pen, is from 0 to 8")]


# Outside --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("job", "severity", "what"),
    [
        ("PU4001,0;", "warning", "PU goes to x = 100.0 mm, outside of the sheet"),
        ("PU0,2001;", "warning", "PU goes to y = 50.0 mm, outside of the sheet"),
        ("PD-4,-4;PU;", "error", "PD cuts to x = -0.1 mm, y = -0.1 mm, outside of the sheet"),
        ("PR;PD3000,0,3000,0;PU;", "error", "PD cuts to x = 150.0 mm, outside of the sheet"),
        ("PA100,100;CI200;", "error", "CI cuts to x = -2.5 mm, y = -2.5 mm, outside of the sheet"),
        ("PA100,100;EA5000,100;", "error", "EA cuts to x = 125.0 mm, outside of the sheet"),
        ("I5000,0\nH\n", "error", "I cuts to x = 125.0 mm, outside of the sheet"),
        ("R0,-40\nH\n", "warning", "R goes to y = -1.0 mm, outside of the sheet"),
        ("C100,100,200,0,270\nH\n", "error", "C cuts to x = -2.5 mm, y = -2.5 mm, outside of the sheet"),
    ],
)
def test_ways_are_followed_through_relative_moves_and_arcs(job: str, severity: str, what: str) -> None:
    assert told(job, DXY_1300, SHEET) == [(severity, what)]


def test_without_a_sheet_the_largest_one_counts_as_a_warning() -> None:
    assert told("PU0,2001;PD4001,0;PU;") == []
    assert told("PD1000000,0;PU;") == [("warning", "PD cuts to x = 25000.0 mm, outside of what PNC-900 can cut")]
    assert told("PD1000000,0;PU;", DXY_1300) == []
    assert told("PD-40,0;PU;", DXY_1300) == [("warning", "PD cuts to x = -1.0 mm, outside of what can be cut")]


def test_of_ways_that_nobody_can_follow_nothing_is_said() -> None:
    assert told("LBHello\x03PR;PU9999,9999;PA;PU0,0;", PNC_900, SHEET) == []
    assert told("SC0,1,0,1;PA9999,9999;", PNC_900, SHEET) == []


@pytest.mark.parametrize("sides", [(0, 1), (1, -1), (float("inf"), 1), (float("nan"), 1), ("1", 1), (True, 1)])
def test_a_sheet_has_two_sides(sides: tuple[float, float]) -> None:
    with pytest.raises(InvalidCommandError, match="two sides above 0 mm"):
        Sheet(*sides)


# Buffer ---------------------------------------------------------------------------------------------------------------


def test_what_does_not_fit_into_the_buffer_is_told_unless_it_can_be_parted() -> None:
    label = b"LB" + b"x" * 100 + b"\x03"
    assert check(label, PNC_900) == ()
    assert [each.what for each in check(label, PNC_900, buffer_bytes=60)] == ["LB has 103 bytes, the buffer 60"]
    assert [each.what for each in check(label, replace(PNC_900, buffer_bytes=102))] == [
        "LB has 103 bytes, the buffer 102"
    ]
    assert check(b"PU" + b"1,1," * 50 + b"1,1;", PNC_900, buffer_bytes=60) == ()


# Many, and any --------------------------------------------------------------------------------------------------------


def test_of_one_kind_some_are_told_and_the_others_counted() -> None:
    problems = check("ZZ;" * 1000 + "PU1;")
    assert len(problems) == MOST_OF_A_KIND + 2
    assert (problems[-1].severity, problems[-1].what) == (Severity.NOTE, "980 more of this kind: unknown instructions")


def test_a_job_is_checked_in_pieces_as_it_is_at_once() -> None:
    job = "IN;ZZ;PD1;\nPD10,10;LBx"
    whole = check(job)
    assert check(iter(job)) == whole
    assert check(job.encode()) == whole
    assert check(parse(job)) == whole
    checker = Checker()
    found = [problem for each in parse(job) for problem in checker.take(each)]
    assert {*found, *checker.finish()} == {*whole}
    assert [each.offset for each in whole] == sorted(each.offset for each in whole)
    assert checker.tracker.position_steps == (10.0, 10.0)


@given(st.binary(max_size=200), st.sampled_from([PNC_900, HP_7475A, DXY_1300]))
def test_whatever_it_is_it_is_checked(job: bytes, profile: Profile) -> None:
    for problem in check(job, profile, SHEET):
        assert isinstance(problem, Problem)
        assert 0 <= problem.offset < len(job)
        assert str(problem).isprintable()


def test_errors_are_raised_all_at_once_and_warnings_never() -> None:
    raise_for_errors(check("PD10,10;"))
    with pytest.raises(InvalidCommandError) as caught:
        raise_for_errors(check("ZZ;PD1;PD10,10;"))
    assert str(caught.value).splitlines()[0] == "2 errors in the job:"
    assert "line 1, column 4: error: PD takes pairs of numbers" in str(caught.value)
    with pytest.raises(InvalidCommandError, match=r"^1 error in the job:\nline 1"):
        raise_for_errors(check("ZZ;"))


def test_a_job_that_cannot_be_taken_apart_is_refused() -> None:
    with pytest.raises(InvalidCommandError, match="no code of 8 bits"):
        check("LB€\x03")


def test_the_names_that_people_use_are_there() -> None:
    job = camm1.parse("IN;PD5,5;", camm1.PNC_1610)
    assert [each.what for each in camm1.check(job, camm1.PNC_1610)] == ["the tool is left down at the end of the job"]
    assert all(hasattr(camm1, name) for name in camm1.__all__)
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = camm1.nonsense
