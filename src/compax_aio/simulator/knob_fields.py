"""How the knobs of any simulated device are checked and read: ranges, choices, and what to tell who errs."""

from __future__ import annotations

import dataclasses
import functools
import math
import typing
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Protocol, TypeVar

from compax_aio.errors import TransportError

__all__ = ["Choice", "Range", "allowed_values", "check_knobs", "impossible", "knobs_from_query"]

_T = TypeVar("_T")


class Choice(Protocol):
    """What a knob may be, as the second part of its ``Annotated`` type; its text says so."""

    def allows(self, value: Any) -> bool:
        """Whether the knob may be that."""


@dataclass(frozen=True, slots=True)
class Range:
    """A number from *low* to *high*."""

    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.low:g} to {self.high:g}"

    def allows(self, value: float) -> bool:
        """Whether *value* lies in it."""
        return math.isfinite(value) and self.low <= value <= self.high


def check_knobs(knobs: Any, device: str) -> None:
    """
    Look whether each knob has a value that it can have.

    Raises:
        TransportError: One has not; says which are possible.
    """
    kind: Any = type(knobs)
    for key, (_, allows, allowed) in _fields(kind).items():
        value = getattr(knobs, key)
        if not allows(value):
            raise impossible(device, key, value, allowed)


def knobs_from_query(kind: Callable[..., _T], device: str, query: Mapping[str, str], defaults: Mapping[str, Any]) -> _T:
    """
    Read knobs from the query of a URL: ``{"echo": "1", "decimals": "3"}``.

    Args:
        kind: The frozen dataclass of the knobs.
        device: Of what they are the knobs, for messages: ``COMPAX``.
        query: Values by name, as text.
        defaults: Values of knobs that the query leaves out, where they differ from those of *kind*.

    Raises:
        TransportError: No knob has that name, or it cannot be set to that value; names those that are possible.
    """
    values = dict(defaults)
    fields = _fields(kind)
    for key, text in query.items():
        if key not in fields:
            raise TransportError(
                f"a simulated {device} has no knob {key!r} (={text!r})", hint=f"its knobs are {', '.join(fields)}"
            )
        read, _, allowed = fields[key]
        try:
            values[key] = read(text)
        except (KeyError, ValueError):
            raise impossible(device, key, text, allowed) from None
    return kind(**values)


def allowed_values(kind: type) -> Mapping[str, str]:
    """Say of each knob, by its name, which values it takes."""
    return {name: allowed for name, (_, _, allowed) in _fields(kind).items()}


def impossible(device: str, key: str, value: object, allowed: str) -> TransportError:
    """Return the error of a knob that cannot have that value."""
    return TransportError(f"a simulated {device} cannot have {key}={value!r}", hint=f"allowed: {allowed}")


_Field = tuple[Callable[[str], Any], Callable[[Any], bool], str]


@functools.cache
def _fields(kind: Any) -> Mapping[str, _Field]:
    """Say of each knob how its text is read, which values it takes, and how to tell the user."""
    hints = typing.get_type_hints(kind, include_extras=True)
    return {field.name: _field(hints[field.name]) for field in dataclasses.fields(kind)}


def _field(hint: Any) -> _Field:
    if typing.get_origin(hint) is Annotated:
        kind, limits = typing.get_args(hint)
        return kind, limits.allows, str(limits)
    values = {"0": False, "1": True} if hint is bool else {str(value): value for value in typing.get_args(hint)}
    return values.__getitem__, list(values.values()).__contains__, ", ".join(values)
