"""What is wrong with a listing is told with line and column, and what to do."""

from __future__ import annotations

import pytest

from compax_aio import InvalidCommandError
from compax_aio.compax.program import (
    End,
    Goto,
    MoveTo,
    Problem,
    Severity,
    check,
    parse,
    raise_for_errors,
)


def told(text: str) -> list[tuple[int, int, str]]:
    """Where something was found, and how bad it is."""
    return [(problem.line, problem.column, problem.severity.value) for problem in check(text)]


def only(text: str) -> Problem:
    problems = check(text)
    assert len(problems) == 1, problems
    return problems[0]


# Reading --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("record", "column", "message"),
    [
        ("FOO", 6, "no program command begins like 'FOO'"),
        ("", 4, "the record is empty; write a command"),
        ("POSA", 10, "'POSA' breaks off; here may stand: HOME, a position"),
        ("POSA 1 FOO", 13, "'FOO' cannot be read here; here may stand: the end of the record"),
        ("IF I7=1 GOT 9", 14, "here may stand: GOTO, GOSUB"),
        ("IF I7=2 GOTO 9", 12, "1 to 8 digits"),
        ("IF V1 GOTO 9", 12, "here may stand: <=, >=, <>, =, <, …"),
        ("GOTO x", 11, "here may stand: EXT, a record number"),
        ("IF ERROR GOTO x", 20, "a record number"),
        ("POSR 5 SPEED x", 19, "the speed of a speed step (a number, .P40-.P49 or .V1-.V39)"),
        ("POSR 5 OUTPUT O1=x", 23, "0 or 1"),
        ("OUTPUT O0=x", 16, "0, 1 or 2"),
        ("OUTPUT I1=1", 13, "here may stand: O0, A0, O, A"),
        ("POSA 1,5", 12, "the decimal sign is a point"),
        ("POSA 1$", 12, "$ is a sign of the line"),
        ("ACCEL 1  N002: END", 15, "write one record a line"),
        ("POSA 1ü", 12, "printable ASCII"),
        ("POSA 1 000", 11, "a blank stands within the number 1000"),
        ("GOTO 1 3", 11, "a blank stands within the number 13"),
        ("GOTO 30 2", 11, "a blank stands within the number 302"),
        ("V1 = V 1 2", 13, "a blank stands within the number 12"),
        ("WAIT " + "1" * 200, 6, "has 204 characters and is no record"),
    ],
)
def test_what_cannot_be_read_says_where_and_what_could_stand_there(record: str, column: int, message: str) -> None:
    found = [each for each in check(f"\nN1:  {record}\nN2: END") if message in str(each)]
    assert [(each.line, each.column, each.severity) for each in found] == [(2, column, Severity.ERROR)]


@pytest.mark.parametrize(
    ("record", "column", "message"),
    [
        (
            "ACCEL 65001",
            11,
            "an acceleration time of 65001 ms is out of range; from 0 to 65000 is possible (IBS p. 48)",
        ),
        ("ACCEL 0.5", 11, "cannot be held by the drive; write a whole number"),
        ("ACCEL- -1", 12, "out of range"),
        ("SPEED 0", 11, "a speed of 0 % is out of range; above 0 to 600"),
        ("SPEED 600.001", 11, "out of range"),
        ("SPEED 1.0001", 11, "write at most 3 decimals"),
        ("SPEED 5 WAIT -1", 18, "a waiting time of -1 ms is out of range"),
        ("POSA 4000000.01", 10, "a position of 4000000.01 units is out of range"),
        ("POSA 1.234", 10, "write at most 2 decimals (UG p. 100"),
        ("POSR -4000001", 10, "a distance of -4000001 units"),
        ("POSR 0 SPEED 5", 10, "the distance of a prepared point of 0 units is out of range; above 0"),
        ("POSR -5 OUTPUT O1=1", 10, "the distance of a prepared point"),
        ("POSR 5 SPEED 5.5", 18, "write a whole number (UG p. 101"),
        ("POSR 5 OUTPUT O17=1", 20, "17 is not the number of an output"),
        ("POSR 5 OUTPUT O1=10", 22, "10 is not one digit"),
        ("OUTPUT O17=1", 13, "17 is not the number of an output"),
        ("OUTPUT O12=010101", 16, "6 digits from 12 on reach up to 17"),
        ("OUTPUT O1=010101010", 15, "9 digits are too many"),
        ("OUTPUT O0=3", 15, "3 is not 0, 1 or 2"),
        ("IF I17=1 GOTO 1", 9, "17 is not the number of an input"),
        ("GOTO 303", 10, "303 is not a record number"),
        ("GOSUB 302", 11, "302 is not a record number"),
        ("IF STOP GOTO 302", 18, "302 is not a record number"),
        ("REPEAT 0", 12, "a count of 0 is out of range"),
        ("POSA .P50", 10, ".P50 does not exist here; use one of P40-P49"),
        ("POSA .V40", 10, "use one of V1-V39"),
        ("V1=V40", 8, "use one of V1-V39 and V50-V70"),
        ("V40=1", 5, "V40 does not exist here"),
        ("V1=P251", 8, "use one of P1-P250"),
        ("IF S40=1 GOTO 1", 8, "use one of S1-S39"),
        ("V1=8388608", 8, "a constant of 8388608 is out of range"),
        ("V1=" + "9" * 60, 8, "a constant of " + "9" * 20 + " is out of range"),
        ("V" + "9" * 60 + "=1", 5, "does not exist here"),
    ],
)
def test_what_the_drive_does_not_take_is_an_error_at_its_place(record: str, column: int, message: str) -> None:
    found = [each for each in check(f"N1: {record}\nN2: END") if message in str(each)]
    assert [(each.line, each.column, each.severity) for each in found] == [(1, column, Severity.ERROR)]


@pytest.mark.parametrize(
    ("text", "line", "column", "message"),
    [
        ("ACCEL 1\nN1: END", 1, 1, "'ACCEL1' has no record number; begin the line like N001:"),
        ("N1: END\n  N251: END", 2, 3, "N251 is no record; records are N001 to N250"),
        ("N0: END", 1, 1, "N0 is no record"),
        ("N" + "9" * 5000 + ": END", 1, 1, "is no record"),
        ("N 1 2: END", 1, 3, "a blank stands within the record number"),
        ("N1: END\n\n N01 END", 3, 2, "N001 is there twice, first in line 1"),
    ],
)
def test_numbers_of_records_are_1_to_250_and_each_is_there_once(
    text: str, line: int, column: int, message: str
) -> None:
    problem = only(text)
    assert (problem.line, problem.column) == (line, column)
    assert message in str(problem)


def test_a_record_is_there_twice_also_if_the_first_could_not_be_read() -> None:
    assert [str(each)[:40] for each in check("N1: FOO\nN1: END")][1] == "line 2, column 1: error: N001 is there t"
    assert parse("N1: END", decimals=3)[1] == End()


def test_german_letters_are_read_and_told() -> None:
    text = "N1: OT A7=1\nN2: OT A0=1\nN3: PR 1 OT A2=1\nN4: PR 2\nN5: IF E7=1 GOTO 1\nN6: END"
    assert told(text) == [(1, 8, "note"), (2, 8, "note"), (3, 13, "note"), (5, 8, "note")]
    assert "A is the German letter; read as O" in str(check(text)[0])
    assert len(parse(text)) == 6


def test_all_errors_are_in_the_text_of_the_one_that_is_raised() -> None:
    with pytest.raises(InvalidCommandError) as caught:
        parse("N1: FOO\nN2: V1=V2\nN3: POSA\nN4: OT A1=1")
    lines = str(caught.value).split("\n")
    assert lines[0] == "2 errors in the program:"
    assert [each[:16] for each in lines[1:]] == ["line 1, column 5", "line 3, column 9"]
    raise_for_errors(check("N1: V1=V2\nN2: END"))


# The way through the program ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("record", "column"),
    [("GOTO 99", 10), ("GOSUB 99", 11), ("IF I1=1 GOTO 99", 18), ("IF ERROR GOSUB 99", 20), ("IF S1>5 GOTO 99", 18)],
)
def test_a_jump_leads_to_a_record_that_is_there(record: str, column: int) -> None:
    first = check(f"N1: {record}\nN2: END")[0]
    assert (first.line, first.column, first.severity) == (1, column, Severity.ERROR)
    assert "99, but there is no N099; write that record, or correct the number" in str(first)


def test_passwords_are_no_jumps() -> None:
    assert check("N1: GOTO 302\nN2: GOTO 620\nN3: GOTO 270\nN4: END") == []


@pytest.mark.parametrize("last", ["WAIT 5", "IF I1=1 GOTO 1", "GOSUB 1", "GOTO 302"])
def test_a_program_does_not_run_on_behind_its_last_record(last: str) -> None:
    problem = only(f"N1: ACCEL 5\nN2:  {last}")
    assert (problem.line, problem.column, problem.severity) == (2, 6, Severity.ERROR)
    assert "END is missing" in problem.message


@pytest.mark.parametrize("last", ["END", "GOTO 1", "GOTO EXT", "RETURN"])
def test_these_may_be_the_last_record(last: str) -> None:
    assert check(f"N1: ACCEL 5\nN2: {last}") == []


def test_the_end_of_a_repeat_is_not_the_end_of_the_program() -> None:
    problem = only("N1: REPEAT 5\nN2: POSR 5\nN3: END")
    assert (problem.line, problem.column) == (3, 5)
    assert "END is missing" in problem.message
    nested = "N1: REPEAT 5\nN2: REPEAT 5\nN3: POSR 5\nN4: END\nN5: END\nN6: END"
    assert check(nested) == []


def test_a_repeat_has_its_end() -> None:
    text = "N1: REPEAT 5\nN2: REPEAT 5\nN3: END\nN4: GOTO 1"
    problem = only(text)
    assert (problem.line, problem.column, problem.severity) == (1, 5, Severity.ERROR)
    assert problem.message == "N001: REPEAT without END"


def test_records_that_nothing_leads_to_are_told_once_for_each_row() -> None:
    text = "N1: GOTO 4\nN2: ACCEL 1\nN3: WAIT 5\nN4: END\nN5: END\n"
    assert told(text) == [(2, 5, "warning"), (5, 5, "warning")]
    first, second = check(text)
    assert first.message == "N002: nothing in the program leads to N002 to N003"
    assert second.message == "N005: nothing in the program leads to N005"


def test_calls_and_handlers_and_inputs_lead_to_records() -> None:
    assert check("N1: IF ERROR GOTO 4\nN2: GOSUB 5\nN3: END\nN4: END\nN5: RETURN") == []
    assert check("N1: GOTO EXT\nN9: END") == []
    assert told("N1: GOSUB EXT\nN9: END") == [(1, 5, "warning")], "the gap behind N1"


def test_a_program_does_not_run_into_a_gap() -> None:
    problem = only("N1: ACCEL 5\nN5: END")
    assert (problem.line, problem.column, problem.severity) == (1, 5, Severity.WARNING)
    assert "runs on into N002, which is not in this listing" in problem.message
    assert "GOTO 5" in problem.hint
    assert check("N1: GOTO 5\nN5: END") == []


def test_where_records_could_not_be_read_the_way_is_not_judged() -> None:
    assert told("N1: FOO\nN2: GOTO 1\nN3: ACCEL 5") == [(1, 5, "error")]


# Variables and points -------------------------------------------------------------------------------------------------


def test_a_variable_that_is_read_is_written_somewhere() -> None:
    text = "N1: POSA .V5\nN2: IF V5>V6 GOTO 1\nN3: V7=V7+1\nN4: P40=V8\nN5: V50=V51\nN6: END"
    assert told(text) == [(1, 10, "warning"), (2, 11, "warning"), (4, 9, "warning")]
    assert check(text)[0].message == "N001: V5 is read, but no record writes it"


def test_parameters_that_are_not_for_programs_are_told() -> None:
    problem = only("N1: P14=5\nN2: END")
    assert (problem.column, problem.severity) == (5, Severity.WARNING)
    assert "P14 is none of the control parameters" in problem.message


def points(first: int, count: int) -> str:
    return "".join(f"N{first + n}: POSR {n + 1} SPEED 5\n" for n in range(count))


@pytest.mark.parametrize("motion", ["POSA 5", "POSR 5", "POSA HOME", "POSR CAM", "LOOP 1"])
def test_eight_points_are_prepared_for_one_positioning(motion: str) -> None:
    assert check(points(1, 8) + f"N9: {motion}\n" + points(10, 8) + f"N18: {motion}\nN19: END") == []
    problem = only(points(1, 8) + f"N9: POSR 9 OUTPUT O1=1\nN10: {motion}\nN11: END")
    assert (problem.line, problem.column, problem.severity) == (9, 5, Severity.ERROR)
    assert "the 9th prepared point" in problem.message


def test_points_of_ways_that_exclude_each_other_are_not_added() -> None:
    apart = "N1: IF I1=1 GOTO 8\n" + points(2, 5) + "N7: GOTO 13\n" + points(8, 5) + "N13: POSA 5\nN14: END"
    assert check(apart) == []
    joined = "N1: IF I1=1 GOTO 8\n" + points(2, 5) + "N7: GOTO 8\n" + points(8, 5) + "N13: POSA 5\nN14: END"
    assert only(joined).line == 11


def test_what_a_call_does_with_the_points_is_not_guessed() -> None:
    text = points(1, 8) + "N9: GOSUB 20\n" + points(10, 8) + "N18: POSA 5\nN19: END\nN20: POSA 1\nN21: RETURN"
    assert check(text) == []


# Length ---------------------------------------------------------------------------------------------------------------


def test_a_record_that_does_not_fit_even_abbreviated_is_an_error() -> None:
    text = "N1: IF P100<>-8388606.5 GOSUB 2\nN2: END"
    assert check(text) == []
    assert check("N1: V1=-8388606.123456*8388606.5\nN2: END")[0].column == 5
    problem = only("N1: IF P100<>-8388606.555 GOSUB 2\nN2: END")
    assert (problem.line, problem.column, problem.severity) == (1, 5, Severity.ERROR)
    assert "31 characters even if abbreviated; the drive's entry buffer takes 30" in problem.message
    assert check("N1: ACCEL 5\nN2: END", template="WRITE INTO RECORD NUMBER {n:03d} TEXT {text}")[0].line == 1


# Programs that are no text --------------------------------------------------------------------------------------------


def test_a_program_of_records_is_checked_by_its_listing() -> None:
    problems = check({1: MoveTo(5_000_000), 300: End(), 2: Goto(7)})
    assert [(each.line, each.column) for each in problems] == [(1, 12), (2, 12), (3, 1)]
    assert check({}) == check("") == []
    with pytest.raises(InvalidCommandError, match="no record"):
        check({1: "END"})  # type: ignore[dict-item]
