"""What is wrong with a file for a control, as commands tell it; and what was meant to be so."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Final

from cyclopts import Parameter
from rich.text import Text

from compax_aio import InvalidCommandError
from compax_aio.escaping import escaped
from compax_aio.haas.checking import Problem, check_data_file, check_program
from compax_aio.haas.profiles import Profile
from compax_aio.severity import Severity

from .files import NamedFile

__all__ = ["Meant", "as_data", "expect_sound", "has_errors", "problems_of", "told"]

_LOOKS: Final = {Severity.ERROR: "bold red", Severity.WARNING: "yellow", Severity.NOTE: "dim"}
_MOST_TOLD: Final = 10
"""Errors that are told where a file is refused; `check` tells them all."""


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


def has_errors(problems: Sequence[Problem]) -> bool:
    """Whether one of them keeps the file from being sent."""
    return any(each.severity is Severity.ERROR for each in problems)


def told(name: str, problems: Sequence[Problem]) -> Text:
    """Write *problems* for people, a line each, as compilers do."""
    text = Text()
    for each in problems:
        text.append(f"{name}:{each.line}:{each.column}: ")
        text.append(f"{each.severity.value}: ", style=_LOOKS[each.severity])
        text.append(f"{escaped(each.what)}; ")
        raised = f" (the control would raise {each.alarm})" if each.alarm is not None else ""
        text.append(f"{escaped(each.hint)}{raised}\n", style="dim")
    return text


def as_data(problem: Problem) -> dict[str, Any]:
    """Return a problem as programs read it."""
    return {
        "line": problem.line,
        "column": problem.column,
        "offset": problem.offset,
        "severity": problem.severity.value,
        "what": problem.what,
        "hint": problem.hint,
        "alarm": None if problem.alarm is None else str(problem.alarm),
    }


def expect_sound(file: NamedFile, problems: Sequence[Problem]) -> None:
    """
    Do nothing if nothing keeps the file from being sent.

    Raises:
        InvalidCommandError: With the first of the errors in it.
    """
    errors = [each for each in problems if each.severity is Severity.ERROR]
    if not errors:
        return
    lines = [f"{each.line}:{each.column}: {each.what}; {each.hint}" for each in errors[:_MOST_TOLD]]
    if len(errors) > _MOST_TOLD:
        lines.append(f"and {len(errors) - _MOST_TOLD} more, which `compax haas check` tells")
    count = "there is an error" if len(errors) == 1 else f"there are {len(errors)} errors"
    raise InvalidCommandError("\n  ".join([f"{count} in the file:", *lines]), device=file.name)
