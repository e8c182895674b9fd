"""All knobs of a kind of simulated device, as its dataclass describes them."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import re
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from .knob_fields import allowed_values

__all__ = ["KnobDescription", "describe_knobs"]


@dataclass(frozen=True, slots=True)
class KnobDescription:
    """
    One knob.

    Attributes:
        name: As it is written in ``name=value``.
        values: Which it takes, for people.
        default: As it is written.
        meaning: What it does.
    """

    name: str
    values: str
    default: str
    meaning: str


def describe_knobs(kind: type) -> tuple[KnobDescription, ...]:
    """Describe each knob of *kind*, a dataclass whose fields have a string below them that says what they mean."""
    meanings, values = dict(_meanings(kind)), allowed_values(kind)
    return tuple(
        KnobDescription(field.name, values[field.name], _written(field.default), meanings.get(field.name, ""))
        for field in dataclasses.fields(kind)
    )


def _meanings(kind: type) -> Iterator[tuple[str, str]]:
    (definition,) = ast.parse(textwrap.dedent(inspect.getsource(kind))).body
    assert isinstance(definition, ast.ClassDef)
    name = ""
    for statement in definition.body:
        if isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name):
            name = statement.target.id
        elif name and isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
            yield name, re.sub(r"\s+", " ", str(statement.value.value).replace("``", "")).strip()
            name = ""


def _written(value: Any) -> str:
    if isinstance(value, bool):
        return str(int(value))
    return f"{value:.12g}" if isinstance(value, float) else str(value)
