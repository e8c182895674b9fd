"""What is wrong with a listing: where, what, and what to do."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from ...problems import refuse_errors
from ...severity import Severity

__all__ = ["Problem", "Severity", "raise_for_errors"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """One finding."""

    line: int
    """From 1."""
    column: int
    """From 1; each character counts one, a tab as well."""
    severity: Severity
    message: str
    hint: str

    def __str__(self) -> str:
        """Write ``line 3, column 7: error: …; …``."""
        return f"line {self.line}, column {self.column}: {self.severity.value}: {self.message}; {self.hint}"


def raise_for_errors(problems: Iterable[Problem]) -> None:
    """
    Do nothing if none of *problems* is an error.

    Raises:
        InvalidCommandError: With all of the errors in its text, one a line.
    """
    refuse_errors(problems, "the program")
