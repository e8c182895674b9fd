"""What nobody should pass: texts that would be two commands, numbers that write themselves as they like."""

from __future__ import annotations

import enum
from collections.abc import Callable, Iterator
from decimal import Decimal
from fractions import Fraction
from typing import Any

from hypothesis import strategies as st

__all__ = [
    "STRANGE_NUMBERS",
    "NamedNumber",
    "SignedText",
    "SmuggledInt",
    "any_texts",
    "refusal",
    "strange_numbers",
    "wicked_texts",
]


def refusal(work: Callable[[], object], kind: type[Exception] = ValueError) -> str | None:
    """Return what *work* says if it refuses, with an error of *kind* and of no other; None if it does not."""
    try:
        work()
    except kind as error:
        return str(error)
    return None


LOOKALIKES = (
    *("\0", "\x07", "\n", "\r", "\r\n", "\x11", "\x13", "\x1b[2J", "\x7f", "\x85", "\x9b", "\xa0", "\xad"),
    *("٣", "³", "７", "Ａ", "ﬁ", "ß", "ı", "\u2028", "\u202e", "\u200b", "\u3000", "\ufeff", "\ud800", "\U0001d7d9"),  # noqa: RUF001
    *("$", "?", "!", ",", ">", ";", ":", "=", "{n}", "%s"),
)
"""Control characters, flow control, digits and letters of other scripts, signs of the line."""

wicked_texts = st.builds(
    lambda head, middle, tail: f"{head}{middle}{tail}",
    st.sampled_from(["", "S1", "PA 5", "P40=1", "N1", "STOP", "V1"]),
    st.sampled_from(LOOKALIKES),
    st.sampled_from(["", "PA 500", "S2", "STOP", "$", " "]),
)
any_texts = wicked_texts | st.text(max_size=40) | st.text("SPVNALRHOT0123456789 +-.=:,$?!>\r\n", max_size=40)


class SignedText(str):
    """A text that is not what its methods say."""

    def strip(self, *_: Any) -> str:
        return "PA 500\rPA 600"

    def upper(self) -> str:
        return "PA 500\rPA 600"

    rstrip = lstrip = replace = strip

    def __iter__(self) -> Iterator[str]:
        return iter("S1")

    def __len__(self) -> int:
        return 2

    def __str__(self) -> str:
        return "PA 500\rPA 600"

    def __format__(self, _: str) -> str:
        return "PA 500\rPA 600"


class NamedNumber(int, enum.Enum):
    """From Python 3.12 on a member of such an enumeration writes itself by its name."""

    THIRD = 3

    def __str__(self) -> str:
        return "NamedNumber.THIRD"

    def __format__(self, _: str) -> str:
        return "NamedNumber.THIRD"


class SmuggledInt(int):
    """A whole number that writes itself as a command."""

    def __str__(self) -> str:
        return "1\rPA 500"

    def __format__(self, _: str) -> str:
        return "1\rPA 500"

    def __repr__(self) -> str:
        return "1\rPA 500\x1b[2J"

    def __int__(self) -> int:
        return 777


class SmuggledFloat(float):
    """A number that writes itself as a command."""

    def __str__(self) -> str:
        return "1\rPA 500"

    def __format__(self, _: str) -> str:
        return "1\rPA 500"

    def __round__(self, _: Any = None) -> Any:
        return self


class OfNumpysKind:
    """Can be made a float, and is no number that Python knows."""

    def __float__(self) -> float:
        return 5.0

    def __format__(self, _: str) -> str:
        return "1\rPA 500"


STRANGE_NUMBERS: tuple[Any, ...] = (
    *(float("nan"), float("inf"), -float("inf"), -0.0, 5e-324, 1e308, True, False, None),
    *(10**400, -(10**400), 10**5000, Decimal("NaN"), Decimal("sNaN"), Decimal("Infinity"), Decimal("1E+999999")),
    *(Fraction(1, 3), Fraction(10**400), 1 + 0j, "5", "5\rPA 500", "٣", b"5", [], OfNumpysKind()),
    *(SmuggledInt(3), SmuggledFloat(3.5), NamedNumber.THIRD, SignedText("3")),
)

strange_numbers: st.SearchStrategy[Any] = (
    st.sampled_from(STRANGE_NUMBERS)
    | st.integers()
    | st.integers(-10, 300)
    | st.floats()
    | st.decimals()
    | st.fractions()
    | any_texts
)
