"""What is wrong with a text that a device is to be sent: where, how bad it is, what, and what to do."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, Protocol

from .errors import InvalidCommandError
from .severity import Severity

__all__ = ["MOST_OF_A_KIND", "Found", "Problem", "refuse_errors"]

MOST_OF_A_KIND: Final = 20
"""So many of one kind are told one by one; the others are counted."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """One finding."""

    line: int
    """From 1."""
    column: int
    """From 1, in bytes."""
    offset: int
    """Of a byte of the whole, from 0."""
    severity: Severity
    what: str
    hint: str

    @property
    def advice(self) -> str:
        """What to do, and what comes of it else, where that is known."""
        return self.hint

    def __str__(self) -> str:
        """Write ``line 3, column 7: error: …; …``."""
        return f"line {self.line}, column {self.column}: {self.severity.value}: {self.what}; {self.advice}"


class Found(Protocol):
    """What says itself how bad it is, and the rest as a text."""

    @property
    def severity(self) -> Severity:
        """How bad it is."""


def refuse_errors(problems: Iterable[Found], where: str) -> None:
    """
    Do nothing if none of *problems* is an error.

    Raises:
        InvalidCommandError: With all of the errors in its text, one a line, behind *where* they are: ``"the job"``.
    """
    errors = [str(problem) for problem in problems if problem.severity is Severity.ERROR]
    if errors:
        count = "1 error" if len(errors) == 1 else f"{len(errors)} errors"
        raise InvalidCommandError("\n".join((f"{count} in {where}:", *errors)))
