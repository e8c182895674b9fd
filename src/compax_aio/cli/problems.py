"""What is wrong with a job or a file, as commands tell it, and refuse it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from rich.text import Text

from compax_aio import InvalidCommandError
from compax_aio.escaping import escaped
from compax_aio.problems import Problem
from compax_aio.severity import Severity

__all__ = ["as_data", "expect_sound", "has_errors", "told"]

_LOOKS: Final = {Severity.ERROR: "bold red", Severity.WARNING: "yellow", Severity.NOTE: "dim"}
_MOST_TOLD: Final = 10
"""Errors that are told where something is refused; `check` tells them all."""


def has_errors(problems: Sequence[Problem]) -> bool:
    """Whether one of them keeps it from being sent."""
    return any(each.severity is Severity.ERROR for each in problems)


def told(name: str, problems: Sequence[Problem]) -> Text:
    """Write *problems* for people, a line each, as compilers do."""
    text = Text()
    for each in problems:
        text.append(f"{name}:{each.line}:{each.column}: ")
        text.append(f"{each.severity.value}: ", style=_LOOKS[each.severity])
        text.append(f"{escaped(each.what)}; ")
        text.append(f"{escaped(each.advice)}\n", style="dim")
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
    }


def expect_sound(
    name: str, problems: Sequence[Problem], where: str, *, all_told_by: str = "", hint: str | None = None
) -> None:
    """
    Do nothing if nothing keeps it from being sent.

    Args:
        name: Of what is to be sent.
        problems: Of it.
        where: They are: ``"the job"``.
        all_told_by: The command that tells all of them; empty: none.
        hint: What to do.

    Raises:
        InvalidCommandError: With the first of the errors in it.
    """
    errors = [each for each in problems if each.severity is Severity.ERROR]
    if not errors:
        return
    lines = [f"{each.line}:{each.column}: {each.what}; {each.hint}" for each in errors[:_MOST_TOLD]]
    if len(errors) > _MOST_TOLD:
        told_by = f", which `{all_told_by}` tells" if all_told_by else ""
        lines.append(f"and {len(errors) - _MOST_TOLD} more{told_by}")
    count = "there is an error" if len(errors) == 1 else f"there are {len(errors)} errors"
    raise InvalidCommandError("\n  ".join([f"{count} in {where}:", *lines]), device=name, hint=hint)
