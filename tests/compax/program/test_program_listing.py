"""Listings are read into records and printed from them."""

from __future__ import annotations

from contextlib import suppress
from decimal import Decimal

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.compax.program.programs import MANUAL, programs, records

from compax_aio import InvalidCommandError
from compax_aio.compax.facts.program_commands import PROGRAM_COMMANDS
from compax_aio.compax.program import (
    Acceleration,
    Assign,
    Deceleration,
    End,
    Gosub,
    GosubExternal,
    Goto,
    GotoExternal,
    IfCompare,
    IfError,
    IfInputs,
    IfStop,
    Loop,
    MoveBy,
    MoveByCam,
    MoveHome,
    MoveTo,
    Outputs,
    Parameter,
    Password,
    Power,
    PreparedOutput,
    PreparedSpeed,
    Program,
    Record,
    Repeat,
    Return,
    Speed,
    SpeedSync,
    Status,
    Variable,
    Wait,
    WaitDistance,
    WaitPosition,
    WaitStart,
    check,
    listing,
    normalise,
    parse,
    parse_record,
    record_text,
    wire_line,
    wire_lines,
)

V1, P40 = Variable(1), Parameter(40)

FORMS: list[tuple[str, str, Record]] = [
    ("ACCEL 250", "AL250", Acceleration(250)),
    ("ACCEL .P40", "AL.P40", Acceleration(P40)),
    ("ACCEL- 250", "al- 250", Deceleration(250)),
    ("ACCEL- .V1", "ACCEL-.V1", Deceleration(V1)),
    ("SPEED 80.5", "SD 080.500", Speed(Decimal("80.5"))),
    ("SPEED 80 WAIT 100", "SD80WAIT100", Speed(80, 100)),
    ("SPEED SYNC", "SDSYNC", SpeedSync()),
    ("POSA 1250", "PA +1250.", MoveTo(1250)),
    ("POSA -0.5", "PA-.5", MoveTo(Decimal("-0.5"))),
    ("POSA .V39", "PA .V39", MoveTo(Variable(39))),
    ("POSA HOME", "PH", MoveHome()),
    ("POSA HOME", "PA HOME", MoveHome()),
    ("POSR 15.8", "PR15.8", MoveBy(Decimal("15.8"))),
    ("POSR .P49", "PR.P49", MoveBy(Parameter(49))),
    ("POSR CAM", "PR CAM", MoveByCam()),
    ("POSR 10 SPEED 50", "PR10SD50", PreparedSpeed(10, 50)),
    ("POSR 10 SPEED 50 ACCEL .V1", "PR 10 SD 50 AL .V1", PreparedSpeed(10, 50, V1)),
    ("POSR 10 OUTPUT O16=1", "PR 10 OT A16=1", PreparedOutput(10, 16, True)),
    ("WAIT POSA 10", "WAIT PA 10", WaitPosition(10)),
    ("WAIT POSR 10", "WAITPR10", WaitDistance(10)),
    ("OUTPUT O7=1", "OT O07=1", Outputs(7, (True,))),
    ("OUTPUT O9=10100000", "OT A9=1010 0000", Outputs(9, (True, False, True, *(False,) * 5))),
    ("OUTPUT O0=2", "OT A0=2", Power(2)),
    ("WAIT 500", "WAIT500", Wait(500)),
    ("WAIT .V1", "wait .v1", Wait(V1)),
    ("WAIT START", "WAITSTART", WaitStart()),
    ("GOTO 13", "GOTO013", Goto(13)),
    ("GOTO EXT", "GOTOEXT", GotoExternal()),
    ("GOTO 302", "GOTO302", Password(302)),
    ("GOTO 270", "GO TO 270", Password(270)),
    ("GOTO 620", "goto 620", Password(620)),
    ("GOSUB 250", "GOSUB250", Gosub(250)),
    ("GOSUB EXT", "gosub ext", GosubExternal()),
    ("RETURN", "return", Return()),
    ("REPEAT 10", "REPEAT10", Repeat(10)),
    ("REPEAT .P40", "REPEAT.P40", Repeat(P40)),
    ("END", "end", End()),
    ("LOOP 3", "LOOP3", Loop(3)),
    ("IF I7=1 GOTO 9", "IF E7=1 GOTO 9", IfInputs(7, (True,), Goto(9))),
    ("IF I7=10 GOSUB 9", "IFI7=10GOSUB9", IfInputs(7, (True, False), Gosub(9))),
    ("IF ERROR GOTO 9", "IFERRORGOTO9", IfError(Goto(9))),
    ("IF STOP GOSUB 9", "if stop gosub 9", IfStop(Gosub(9))),
    ("IF V1<=5.5 GOTO 9", "IF .V1 <= 5.50 GOTO 9", IfCompare(V1, "<=", Decimal("5.5"), Goto(9))),
    ("IF S1>=P40 GOSUB 9", "IF S1>=.P40 GOSUB 9", IfCompare(Status(1), ">=", P40, Gosub(9))),
    *((f"IF P1{sign}V1 GOTO 9", f"IFP1{sign}V1GOTO9", IfCompare(Parameter(1), sign, V1, Goto(9))) for sign in "=<>"),
    ("IF 1<>S39 GOTO 9", "IF1<>S39GOTO9", IfCompare(1, "<>", Status(39), Goto(9))),
    ("P40=S1", "P040 = S001", Assign(P40, Status(1))),
    ("V1=-3", "V1 = - 3", Assign(V1, -3)),
    *((f"V1=V2{sign}3.5", f"v1 = v2 {sign} 3.5", Assign(V1, Variable(2), sign, Decimal("3.5"))) for sign in "+-*/\\%"),
    ("V50=1", "V50=1", Assign(Variable(50), 1)),
]


def test_the_program_of_the_manual_is_clean_and_comes_back_byte_for_byte() -> None:
    program = parse(MANUAL)
    assert listing(program) == MANUAL
    assert check(MANUAL) == check(program) == []
    assert len(program) == 13
    assert program[4] == IfInputs(7, (True,), Goto(9))


@pytest.mark.parametrize(("long", "other", "record"), FORMS)
def test_every_form_is_read_long_and_otherwise_and_printed_long(long: str, other: str, record: Record) -> None:
    assert parse_record(long) == parse_record(other) == parse(f"n7 {other}")[7] == record
    assert record_text(record) == normalise(other) == long


def test_every_row_of_the_table_is_among_these_forms() -> None:
    assert {type(record) for *_, record in FORMS} == set(Record.__args__)
    assert len({row.long for row in PROGRAM_COMMANDS}) == len(PROGRAM_COMMANDS)
    assert all(row.source and row.meaning for row in PROGRAM_COMMANDS)


@pytest.mark.parametrize(
    "line", ["N005: POSA 250", "N5 POSA 250", "n5:PA250", "\tN 5 :  PO SA  250.00 ; to 250", "N5PA250"]
)
def test_a_line_may_be_written_in_many_ways(line: str) -> None:
    assert parse(line) == Program({5: MoveTo(250)})
    assert normalise(line) == "N005: POSA 250"


def test_empty_lines_and_comments_and_any_line_ends_are_nothing() -> None:
    assert parse("; first\r\n\r\nN2: END ; last\rN1: RETURN\n \n") == {1: Return(), 2: End()}
    assert listing(parse("")) == ""


def test_with_inches_there_are_three_decimals() -> None:
    assert parse("N1: POSA 1.125", decimals=3) == {1: MoveTo(Decimal("1.125"))}
    assert parse_record("POSA 1.125", decimals=3) == MoveTo(Decimal("1.125"))
    with pytest.raises(InvalidCommandError, match="at most 2 decimals"):
        parse("N1: POSA 1.125")


def test_a_program_is_a_mapping_in_order_that_does_not_change() -> None:
    records: dict[int, Record] = {2: End(), 1: Return()}
    program = Program(records)
    records[3] = End()
    assert list(program) == [1, 2]
    assert program | {1: End()} == {1: End(), 2: End()}
    assert repr(program) == "Program({1: Return(), 2: End()})"
    assert Program() == {}


# For the drive --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("POSR 10 SPEED 50", "N005: POSR 10 SPEED 50"),
        ("POSR 1000 SPEED 50 ACCEL 100", "N005: PR 1000 SD 50 AL 100"),
        ("POSR 3999999.99 SPEED 600 ACCEL 65000", "N005:PR3999999.99SD600AL65000"),
        ("POSR 123456.7 OUTPUT O10=1", "N005: PR 123456.7 OT O10=1"),
    ],
)
def test_a_line_for_the_drive_is_abbreviated_only_as_far_as_it_must(text: str, line: str) -> None:
    assert wire_line(5, parse_record(text)) == line
    assert wire_lines({5: parse_record(text), 1: End()}) == ("N001: END", line)


def test_how_the_drive_takes_a_record_is_a_template() -> None:
    assert wire_line(5, MoveTo(250), template="N{n} {text}") == "N5 POSA 250"


def test_what_does_not_fit_the_drive_is_refused() -> None:
    record = parse_record("IF V10<>-8388606.123456 GOSUB 250")
    with pytest.raises(InvalidCommandError, match=r"has 35 characters; .* takes 30"):
        wire_line(5, record)


@pytest.mark.parametrize("template", ["{", "{m} {text}", "{n.x}", "{n:q}", "{0}"])
def test_a_bad_template_is_refused(template: str) -> None:
    with pytest.raises(InvalidCommandError, match="template"):
        wire_line(5, End(), template=template)


def test_no_line_end_gets_into_a_line() -> None:
    with pytest.raises(InvalidCommandError, match="printable"):
        wire_line(5, End(), template="N{n}:\r{text}")


@pytest.mark.parametrize(
    "record",
    [
        MoveTo(Decimal("nan")),
        MoveTo(Decimal("1e999999999")),
        MoveTo(Decimal("1e-999999999")),
        MoveTo("1\rN002: POSA 5"),  # type: ignore[arg-type]
        MoveTo(0.1),  # type: ignore[arg-type]
        MoveTo(None),  # type: ignore[arg-type]
        Assign(V1, 1, "+"),
        "END",
    ],
)
def test_what_is_no_record_cannot_be_written(record: Record) -> None:
    for write in (record_text, lambda each: wire_line(1, each), lambda each: listing({1: each})):
        with pytest.raises(InvalidCommandError):
            write(record)


def test_nothing_is_written_for_minus_nothing() -> None:
    assert record_text(MoveTo(Decimal("-0.00"))) == "POSA 0"
    assert record_text(Assign(V1, Decimal("1E+2"))) == "V1=100"
    assert record_text(Outputs(1, (True, False))) == "OUTPUT O1=10"


@pytest.mark.parametrize("text", ["POSA 1\nEND", "", "N5: END", "END END", "POSA 1.234"])
def test_one_record_is_one_record(text: str) -> None:
    with pytest.raises(InvalidCommandError, match="1 error in the program:\nline 1, column"):
        parse_record(text)


@pytest.mark.parametrize(
    ("text", "normal"),
    [
        ("foo bar", "FOOBAR"),
        ("N5 foo", "N005: FOO"),
        ("N5:", "N005:"),
        ("POSA " + "1" * 5000, "POSA" + "1" * 5000),
        ("POSA 9999999.125", "POSA 9999999.125"),
        ("; nothing\n\nend", "END"),
        ("straße", "STRAßE"),
    ],
)
def test_what_is_no_record_is_compared_as_it_is(text: str, normal: str) -> None:
    assert normalise(text) == normal


# Whatever comes -------------------------------------------------------------------------------------------------------


@given(programs)
def test_what_is_printed_is_read_back(program: Program) -> None:
    text = listing(program)
    assert parse(text) == program
    assert listing(parse(text)) == text
    check(program)


@given(st.integers(1, 250), records)
def test_what_the_drive_is_sent_says_the_same(number: int, record: Record) -> None:
    try:
        line = wire_line(number, record)
    except InvalidCommandError:
        return
    assert len(line) <= 30
    assert parse(line) == {number: record}
    assert normalise(line) == listing({number: record}).rstrip()


TEXTS = st.one_of(
    st.text(),
    st.text(alphabet="N01239 .:;=<>+-*/\\%$?!,POSARIFGTUBEVWLCDHMXY\n\r\t"),
    st.lists(
        st.sampled_from([*"N.:=<+-109ß\n;", "99", "302", "P40", ".V1", "S1", "N1:", "POSA", "PR", "IF", "GOTO", "O"])
    ).map(" ".join),
    st.tuples(programs, st.integers(0, 200), st.text(max_size=3)).map(
        lambda each: listing(each[0])[: each[1]] + each[2] + listing(each[0])[each[1] + 1 :]
    ),
)


@given(TEXTS)
def test_no_text_raises_anything_but_the_documented_error(text: str) -> None:
    problems = check(text)
    assert all(problem.line >= 1 and problem.column >= 1 and problem.hint for problem in problems)
    normal = normalise(text)
    assert normalise(normal) == normal
    for reads in (parse, parse_record):
        with suppress(InvalidCommandError):
            reads(text)
