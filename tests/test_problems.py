"""What is wrong with a text is said with its place, and all errors at once."""

from __future__ import annotations

import pytest

from compax_aio.errors import InvalidCommandError
from compax_aio.problems import Problem, refuse_errors
from compax_aio.severity import Severity


def problem(severity: Severity, line: int = 1) -> Problem:
    return Problem(line=line, column=2, offset=9, severity=severity, what="a tab", hint="write a blank")


def test_a_problem_says_where_how_bad_what_and_what_to_do() -> None:
    assert str(problem(Severity.NOTE, 3)) == "line 3, column 2: note: a tab; write a blank"


def test_what_has_no_errors_is_not_refused() -> None:
    refuse_errors([], "the job")
    refuse_errors([problem(Severity.WARNING), problem(Severity.NOTE)], "the job")


def test_all_errors_are_told_at_once_and_nothing_else() -> None:
    found = [problem(Severity.ERROR, 1), problem(Severity.WARNING, 2), problem(Severity.ERROR, 3)]
    with pytest.raises(InvalidCommandError) as caught:
        refuse_errors(found, "the job")
    assert str(caught.value).splitlines()[:3] == [
        "2 errors in the job:",
        "line 1, column 2: error: a tab; write a blank",
        "line 3, column 2: error: a tab; write a blank",
    ]
    with pytest.raises(InvalidCommandError, match=r"^1 error in the file:"):
        refuse_errors(found[:1], "the file")
