"""Numbers of somebody else: checked before they are used, and written as short as they go."""

from __future__ import annotations

from decimal import Decimal
from math import isfinite
from numbers import Real
from sys import float_info

from .errors import InvalidCommandError
from .escaping import shown

__all__ = ["check_number", "check_time", "check_whole", "written"]


def check_number(what: str, value: object) -> float:
    """
    Return *value* as a float.

    Raises:
        InvalidCommandError: It is no number, or not finite; *what* names it.
    """
    if isinstance(value, bool) or not (isinstance(value, Real | Decimal)):
        raise InvalidCommandError(f"{what} must be a number, not {shown(value)}")
    try:
        number = float(value)
    except (OverflowError, ValueError):
        raise InvalidCommandError(f"{what} must be finite and in range, not {shown(value)}") from None
    if not isfinite(number):
        raise InvalidCommandError(f"{what} must be finite, not {shown(value)}")
    return number


def check_whole(what: str, value: object, lowest: int, highest: int, *, source: str = "") -> int:
    """
    Return *value* as a plain int from *lowest* to *highest*; 500.0 is one.

    Raises:
        InvalidCommandError: It is no number, not whole, or out of range; *what* names it, *source* says who says so.
    """
    number = check_number(what, value)
    if number != int(number) or not lowest <= number <= highest:
        by = f" ({source})" if source else ""
        raise InvalidCommandError(f"{what} is a whole number from {lowest} to {highest}{by}, not {shown(value)}")
    return int(number)


def check_time(what: str, value: object) -> None:
    """
    Do nothing if *value* can be waited for.

    Raises:
        InvalidCommandError: It is no finite number of seconds above 0; *what* names it.
    """
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value <= float_info.max:
        raise InvalidCommandError(f"{what} is a time above 0 in seconds, not {shown(value)}")


def written(number: float, decimals: int) -> str:
    """Write *number* as short as it goes: bytes on the wire are the cost."""
    text = f"{number:.{decimals}f}"
    if decimals:
        text = text.rstrip("0").rstrip(".")
    return "0" if text == "-0" else text
