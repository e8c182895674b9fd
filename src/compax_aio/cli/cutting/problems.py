"""What is wrong with a job, as commands tell it; and the sheet that it is checked against."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Annotated, Any, Final

from cyclopts import Parameter, Token
from rich.text import Text

from compax_aio import InvalidCommandError, camm1
from compax_aio.escaping import escaped

from .jobs import NamedJob

__all__ = ["SheetSize", "as_data", "expect_sound", "has_errors", "told"]

_SIZE: Final = re.compile(r"([0-9]+(?:\.[0-9]+)?)\s*[xX*\u00d7]\s*([0-9]+(?:\.[0-9]+)?)")
_LOOKS: Final = {camm1.Severity.ERROR: "bold red", camm1.Severity.WARNING: "yellow", camm1.Severity.NOTE: "dim"}
_MOST_TOLD: Final = 10
"""Errors that are told where a job is refused; `check` tells them all."""


def _sheet(_kind: Any, tokens: Sequence[Token]) -> camm1.Sheet:
    """Read ``400x280``."""
    text = tokens[0].value
    found = _SIZE.fullmatch(text.strip())
    if found is None:
        raise ValueError(f"{text!r} is no size of a sheet; write mm along x and y, as in 400x280")
    return camm1.Sheet(float(found[1]), float(found[2]))


SheetSize = Annotated[
    camm1.Sheet | None,
    Parameter(
        name="--sheet",
        converter=_sheet,
        n_tokens=1,
        accepts_keys=False,
        help="What lies in the machine: mm along x and y, as in 400x280.",
    ),
]


def has_errors(problems: Sequence[camm1.Problem]) -> bool:
    """Whether one of them keeps the job from being cut."""
    return any(each.severity is camm1.Severity.ERROR for each in problems)


def told(name: str, problems: Sequence[camm1.Problem]) -> Text:
    """Write *problems* for people, a line each, as compilers do."""
    text = Text()
    for each in problems:
        text.append(f"{name}:{each.line}:{each.column}: ")
        text.append(f"{each.severity.value}: ", style=_LOOKS[each.severity])
        text.append(f"{escaped(each.what)}; ")
        text.append(f"{escaped(each.hint)}\n", style="dim")
    return text


def as_data(problem: camm1.Problem) -> dict[str, Any]:
    """Return a problem as programs read it."""
    return {
        "line": problem.line,
        "column": problem.column,
        "offset": problem.offset,
        "severity": problem.severity.value,
        "what": problem.what,
        "hint": problem.hint,
    }


def expect_sound(named: NamedJob, problems: Sequence[camm1.Problem]) -> None:
    """
    Do nothing if nothing keeps the job from being cut.

    Raises:
        InvalidCommandError: With the first of the errors in it.
    """
    errors = [each for each in problems if each.severity is camm1.Severity.ERROR]
    if not errors:
        return
    lines = [f"{each.line}:{each.column}: {each.what}; {each.hint}" for each in errors[:_MOST_TOLD]]
    if len(errors) > _MOST_TOLD:
        lines.append(f"and {len(errors) - _MOST_TOLD} more")
    count = "there is an error" if len(errors) == 1 else f"there are {len(errors)} errors"
    raise InvalidCommandError(
        "\n  ".join([f"{count} in the job:", *lines]),
        device=named.name,
        hint="`compax camm1 preview` shows where; --no-check sends it all the same",
    )
