"""What is wrong with a file for a control, as commands tell it; and what was meant to be so."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from cyclopts import Parameter

from compax_aio.haas.checking import Problem, check_data_file, check_program
from compax_aio.haas.profiles import Profile

from .. import problems
from .files import NamedFile

__all__ = ["Meant", "as_data", "expect_sound", "problems_of"]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Meant:
    """What is meant, although it looks wrong."""

    dnc: Annotated[bool, Parameter(negative=())] = False
    """The program is fed while the machine runs it (DNC), and not stored: its name does not matter, its N words do."""
    protected: Annotated[bool, Parameter(negative=())] = False
    """Programs 8000 to 9999, of probes and the vendor, may be overwritten."""
    semicolons: Annotated[bool, Parameter(negative=())] = False
    """Each semicolon may make a blank line."""
    without_n9999: Annotated[bool, Parameter(negative=())] = False
    """Macro variables may lack their N9999."""


def problems_of(file: NamedFile, profile: Profile, meant: Meant) -> tuple[Problem, ...]:
    """
    Say what is wrong with a file.

    Raises:
        InvalidCommandError: Nobody knows what it is.
    """
    if file.expect_kind() == "program":
        return check_program(
            file.data, profile, for_dnc=meant.dnc, protected=meant.protected, semicolons=meant.semicolons
        )
    return check_data_file(file.data, file.data_kind, force=meant.without_n9999)


def as_data(problem: Problem) -> dict[str, Any]:
    """Return a problem as programs read it."""
    return {**problems.as_data(problem), "alarm": None if problem.alarm is None else str(problem.alarm)}


def expect_sound(file: NamedFile, found: Sequence[Problem]) -> None:
    """
    Do nothing if nothing keeps the file from being sent.

    Raises:
        InvalidCommandError: With the first of the errors in it.
    """
    problems.expect_sound(file.name, found, "the file", all_told_by="compax haas check")
