"""Questions are checked before they are sent, and answers become values, or are told to be none."""

from __future__ import annotations

from datetime import timedelta
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compax_aio.errors import CommandRejectedError, CompaxError, InvalidCommandError, UnexpectedAnswerError
from compax_aio.haas.answers import (
    Answer,
    Belongs,
    Busy,
    ProgramStatus,
    Request,
    VariableValue,
    Written,
    belonging,
    decode,
)
from compax_aio.haas.facts.queries import QUERIES

SPINDLE = Request.of_variable(3027)


@pytest.mark.parametrize(
    ("what", "sent"),
    [
        ("Q100", "Q100"),
        (" q100 ", "Q100"),
        ("?Q100\r\n", "Q100"),
        (100, "Q100"),
        ("Q600 3027", "Q600 3027"),
        ("?q600   03027", "Q600 3027"),
        ("Q505", "Q505"),
        ("Q505 3", "Q505 3"),
    ],
)
def test_questions_are_read_as_people_write_them(what: str | int, sent: str) -> None:
    request = Request.of(what)
    assert request.text == sent
    assert Request.sent_as(sent) == request


@pytest.mark.parametrize(
    ("what", "why"),
    [
        ("", "no question"),
        ("100", "no question"),
        ("Q1\nQ2", "no question"),
        (True, "no question"),
        (1.5, "no question"),
        (-1, "from 0 to 9999"),
        ("Q600", "needs the number"),
        ("Q100 5", "takes no number"),
        ("Q600 100000", "number of a variable"),
        ("E5 1", "write_variable"),
        ("?e 5 1", "write_variable"),
    ],
)
def test_what_is_no_question_is_refused(what: Any, why: str) -> None:
    with pytest.raises(InvalidCommandError, match=why):
        Request.of(what)


def test_a_write_has_its_number_and_value() -> None:
    request = Request.writing(10_900, "123.456")
    assert request.text == "E10900 123.456"
    assert request.is_writing
    assert Request.sent_as(request.text) == request


@pytest.mark.parametrize("row", QUERIES.values(), ids=lambda row: row.command)
def test_every_known_answer_is_read_in_both_forms(row: Any) -> None:
    request = (
        Request.writing(3027, "1.")
        if row.command == "E"
        else Request(row.command, 3027 if row.takes_variable else None)
    )
    for text in (row.classic_example, row.ethernet_example):
        assert belonging(request, text) in {Belongs.YES, Belongs.PERHAPS}
        assert type(decode(request, text)) is not Answer


@pytest.mark.parametrize(
    ("asked", "text", "value"),
    [
        ("Q100", "S/N, 1234567", "1234567"),
        ("Q100", "serial  number ,1234567", "1234567"),
        ("Q104", "MODE, (ZERO RET)", "ZERO RET"),
        ("Q104", "MODE, ZERO", "ZERO"),
        ("Q200", "TOOL CHANGES, 0035", 35),
        ("Q300", "P.O. TIME, 06282:17:13", timedelta(hours=6282, minutes=17, seconds=13)),
        ("Q403", "M30 #2, 380", 380),
        ("Q600 3027", "MACRO, 3027,    0.0000", 0.0),
        ("Q600 3027", "MACRO, 0.0", 0.0),
        ("Q600 3027", "MACRO, 3027, -.5", -0.5),
        ("Q600 3027", "MACRO, 3027, 1.", 1.0),
        ("Q600 3027", "MACRO, 3027, 1.5E-3", 0.0015),
    ],
)
def test_answers_become_values(asked: str, text: str, value: Any) -> None:
    assert decode(Request.of(asked), text).value == value  # type: ignore[attr-defined]


@pytest.mark.parametrize("empty", ["NaN", "nan", "-nan(ind)", "#0", "", "1.#QNAN"])
def test_an_empty_variable_has_no_value(empty: str) -> None:
    assert decode(SPINDLE, f"MACRO, 3027, {empty}").value is None  # type: ignore[attr-defined]


def test_a_variable_says_whether_the_answer_names_it() -> None:
    named, bare = decode(SPINDLE, "MACRO, 3027, 1.0, X"), decode(SPINDLE, "MACRO, 1.0")
    assert isinstance(named, VariableValue)
    assert isinstance(bare, VariableValue)
    assert (named.named, named.extra, bare.named, bare.variable) == (True, ("X",), False, 3027)


def test_a_busy_control_is_a_state() -> None:
    status = decode(Request.of("Q500"), "STATUS, BUSY")
    assert isinstance(status, ProgramStatus)
    assert status.is_busy
    assert (status.program, status.status, status.parts) == (None, None, None)
    assert isinstance(decode(Request.of("Q200"), "STATUS,  BUSY"), Busy)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("PROGRAM, O00010, IDLE, PARTS, 42", ("O00010", "IDLE", 42, ())),
        ("PROGRAM, MDI, FEED HOLD, PARTS, 380", ("MDI", "FEED HOLD", 380, ())),
        ("PROGRAM, O1, ALARM ON", ("O1", "ALARM ON", None, ())),
        ("PROGRAM, O1, RUNNING, PARTS, 1, S, 500", ("O1", "RUNNING", 1, ("S", "500"))),
        ("PROGRAM, O1, IDLE, STH, 1", ("O1", "IDLE", None, ("STH", "1"))),
    ],
)
def test_program_status_and_parts(text: str, expected: tuple[Any, ...]) -> None:
    status = decode(Request.of("Q500"), text)
    assert isinstance(status, ProgramStatus)
    assert (status.program, status.status, status.parts, status.extra) == expected


def test_a_question_that_is_not_known_here_is_answered_raw() -> None:
    answer = decode(Request.of("Q505"), "SOMETHING, 1, 2")
    assert type(answer) is Answer
    assert answer.fields == ("SOMETHING", "1", "2")


@pytest.mark.parametrize("text", ["UNKNOWN", "unknown", "?, ?Q999"])
def test_a_question_that_the_control_does_not_know_is_told(text: str) -> None:
    with pytest.raises(CommandRejectedError, match="does not know Q999"):
        decode(Request.of("Q999"), text)


@pytest.mark.parametrize(("text", "done"), [("!", True), ("OK", False)])
def test_whatever_answers_a_write_is_taken(text: str, done: bool) -> None:
    written = decode(Request.writing(500, "1."), text)
    assert isinstance(written, Written)
    assert written.says_done is done


@pytest.mark.parametrize(
    ("asked", "text"),
    [
        ("Q100", "MODE, (MDI)"),
        ("Q100", "S/N"),
        ("Q100", "!"),
        ("Q100", "?, ?Q101"),
        ("Q100", "S/M, 1234567"),
        ("Q402", "M30 #2, 380"),
        ("Q200", "TOOL CHANGES, -1"),
        ("Q300", "P.O. TIME, 1:60:00"),
        ("Q500", "PROGRAM, O1"),
        ("Q500", "PROGRAM, O1, IDLE, PARTS, x"),
        ("Q600 3027", "MACRO, 3026, 1.0"),
        ("Q600 3027", "MACRO, 3027, x"),
        ("Q600 3027", "MACRO, 3027, 1E999"),
        ("Q600 3027", "MACRO"),
    ],
)
def test_what_is_no_answer_to_a_question_is_told(asked: str, text: str) -> None:
    with pytest.raises(UnexpectedAnswerError) as error:
        decode(Request.of(asked), text)
    assert error.value.sent == asked
    assert error.value.received == text


@pytest.mark.parametrize(
    ("asked", "text", "belongs"),
    [
        ("Q100", "S/N, 1", Belongs.YES),
        ("Q100", "MODE, (MDI)", Belongs.NO),
        ("Q100", "STATUS, BUSY", Belongs.PERHAPS),
        ("Q100", "UNKNOWN", Belongs.PERHAPS),
        ("Q100", "HELLO", Belongs.UNKNOWN),
        ("Q505", "HELLO", Belongs.PERHAPS),
        ("Q505", "S/N, 1", Belongs.NO),
        ("Q600 3027", "MACRO, 3027, 1", Belongs.YES),
        ("Q600 3027", "MACRO, 3026, 1", Belongs.NO),
        ("Q600 3027", "MACRO, 1", Belongs.PERHAPS),
    ],
)
def test_whose_answer_it_can_be(asked: str, text: str, belongs: Belongs) -> None:
    assert belonging(Request.of(asked), text) is belongs


@given(
    text=st.text(st.characters(min_codepoint=0x20, max_codepoint=0x7E), max_size=250),
    asked=st.sampled_from([*(row.command for row in QUERIES.values() if not row.takes_variable), "Q600 3027", "Q9"]),
)
def test_whatever_comes_is_a_value_or_an_error_of_ours(text: str, asked: str) -> None:
    try:
        answer = decode(Request.of(asked), text)
    except CompaxError:
        return
    assert answer.text == text
