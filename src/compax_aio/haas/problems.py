"""What was found in a file: told where it is, the first ones of a kind one by one, the others counted."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from enum import Enum
from itertools import islice
from typing import TypeVar

from ..problems import MOST_OF_A_KIND, refuse_errors
from ..problems import Problem as AnyProblem
from ..severity import Severity
from .facts.alarms import Alarm
from .language.lines import Lines

__all__ = ["MOST_OF_A_KIND", "Finding", "Kind", "Problem", "raise_for_errors", "some", "told"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem(AnyProblem):
    """One finding."""

    alarm: Alarm | None = None
    """What the control is known to raise for it."""

    @property
    def advice(self) -> str:
        """What to do, and what the control is known to raise else."""
        return self.hint if self.alarm is None else f"{self.hint} (the control would raise {self.alarm})"


class Kind(Enum):
    """What is counted together: all of one kind are equally bad, so that no error is among what is only counted."""

    EIGHT_BITS = "characters of 8 bits"
    CONTROL = "control characters"
    TAB = "tabs"
    SEMICOLON = "semicolons"
    PERCENT_LINE = "% lines"
    PERCENT = "percent signs within blocks"
    PERCENT_IN_COMMENT = "percent signs within comments"
    NAME = "programs without names"
    BAD_NAME = "names that are none"
    DOUBLE = "names that come twice"
    PROTECTED = "protected programs"
    LOWER_CASE = "small letters"
    COMMENT = "comments without end"
    LONG = "long blocks"
    LINE_NUMBER = "line numbers too high for DNC"
    OUTSIDE = "bytes outside of the % lines"
    LINE = "lines that are none"
    NUMBER = "numbers that come twice"
    PARTS = "parts of the file"


@dataclass(frozen=True, slots=True)
class Finding:
    """A problem whose place is not yet a line and a column."""

    kind: Kind
    offset: int
    severity: Severity
    what: str
    hint: str
    alarm: Alarm | None = None
    is_count: bool = False
    """Of those that are not told one by one."""


_T = TypeVar("_T")


def some(found: Iterable[_T], make: Callable[[_T], Finding]) -> Iterator[Finding]:
    """Make findings of the first ones of one kind, and count the others: there may be one in each word of a file."""
    rest = iter(found)
    last = None
    for last in map(make, islice(rest, MOST_OF_A_KIND)):
        yield last
    more = sum(1 for _ in rest)
    if more and last is not None:
        what = f"{more} more of this kind: {last.kind.value}"
        yield Finding(last.kind, last.offset, Severity.NOTE, what, "they are not told one by one", is_count=True)


def told(findings: list[Finding], lines: Lines) -> tuple[Problem, ...]:
    """Put findings in the order of the file, and behind them those that only count."""
    findings.sort(key=lambda finding: (finding.is_count, finding.offset))
    return tuple(_problem(each, lines) for each in findings)


def _problem(finding: Finding, lines: Lines) -> Problem:
    line, column = lines.place(finding.offset)
    return Problem(
        line=line,
        column=column,
        offset=finding.offset,
        severity=finding.severity,
        what=finding.what,
        hint=finding.hint,
        alarm=finding.alarm,
    )


def raise_for_errors(problems: Iterable[Problem]) -> None:
    """
    Do nothing if none of *problems* is an error.

    Raises:
        InvalidCommandError: With all of the errors in its text, one a line.
    """
    refuse_errors(problems, "the file")
