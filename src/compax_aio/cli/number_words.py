"""Numbers among the words of a command: read as people write them, and refused where they would be rounded."""

from __future__ import annotations

import re
from collections.abc import Sequence
from math import isfinite
from typing import Any, Final, get_args, get_origin

from cyclopts import Parameter, Token

__all__ = ["NUMBER", "WHOLE", "number_of"]

_WHOLE: Final = re.compile(r"[+-]?[0-9]{1,18}")
_NUMBER: Final = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
"""What Python takes besides, as 1_0 for 10, is more likely a slip; and a slip may be a way to go."""


def _whole(kind: Any, tokens: Sequence[Token]) -> Any:
    """Read a whole number, or several for a tuple; 800.5 is refused, and not rounded."""
    numbers = tuple(_whole_number(token.value) for token in tokens)
    is_several = any(get_origin(each) is tuple for each in (kind, *get_args(kind)))
    return numbers if is_several else numbers[0]


def _whole_number(text: str) -> int:
    if _WHOLE.fullmatch(text) is None:
        raise ValueError(f"{text!r} is no whole number")
    return int(text)


def _number(_kind: Any, tokens: Sequence[Token]) -> float:
    return number_of(tokens[0].value)


def number_of(text: str) -> float:
    """
    Read a number that is one: nan and inf are none.

    Raises:
        ValueError: It is none.
    """
    if _NUMBER.fullmatch(text) is None or not isfinite(number := float(text)):
        raise ValueError(f"{text!r} is no number; write 12.5, with a point")
    return number


WHOLE: Final = Parameter(converter=_whole)
"""Stands in the type of every parameter that is a whole number."""

NUMBER: Final = Parameter(converter=_number)
"""Stands in the type of every parameter that is another number."""
