"""The numbers of an instruction."""

from __future__ import annotations

import re
from typing import Final

__all__ = ["numbers", "written_number"]

_SIGNS: Final = b"0123456789+-., \t\r\n\f\v"
_SEPARATOR: Final = re.compile(rb"\s*,\s*|\s+")


def numbers(arguments: bytes) -> list[float]:
    """
    Read decimal numbers with commas or blanks between them.

    Raises:
        ValueError: Something else stands there, and says what.
    """
    if arguments.translate(None, _SIGNS):
        raise ValueError(f"{arguments.decode('latin-1').strip()!r} is no number")
    try:
        return list(map(float, arguments.split(b",")))
    except ValueError:
        return _read_slowly(arguments.strip())


def _read_slowly(text: bytes) -> list[float]:
    values = []
    for each in _SEPARATOR.split(text) if text else ():
        try:
            values.append(float(each))
        except ValueError:
            told = each.decode("latin-1")
            raise ValueError(f"{told!r} is no number" if told else "a number is missing beside a comma") from None
    return values


def written_number(value: float) -> str:
    """Write a number of a cutting language: whole ones without a point, others with three decimals at most."""
    text = f"{value:.3f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text
