"""Keys of a simulated control in words: ``recv:settings``, ``send:O00010,recv``."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

from compax_aio.haas.facts.data_files import DataKind

__all__ = ["ALL", "PROGRAMS", "KeyWords", "Press", "presses_of", "program_number"]

PROGRAMS: Final = "programs"
ALL: Final = "ALL"
_LAST: Final = "last"
_NAME: Final = re.compile(r"O?0*(\d{1,5})")


@dataclass(frozen=True, slots=True)
class Press:
    """A key, and what is chosen when it is pressed."""

    key: str
    """``recv``, ``send``, ``dnc`` or ``cycle``."""
    what: str = ""


def program_number(name: str) -> int | None:
    """Return the number in ``O01234``, ``O1234`` or ``1234``; None: it names no program."""
    found = _NAME.fullmatch(name.upper())
    return int(found[1]) if found else None


def presses_of(text: str) -> tuple[Press, ...]:
    """
    Read keys.

    Raises:
        ValueError: Something is no key.
    """
    return tuple(_press(each.strip()) for each in text.split(",")) if text else ()


def _press(text: str) -> Press:
    key, _, what = text.partition(":")
    kinds = set(DataKind)
    is_key = (
        (key == "recv" and (not what or what == PROGRAMS or what in kinds))
        or (key == "send" and (what in kinds or what in {ALL, _LAST} or program_number(what) is not None))
        or (key in {"dnc", "cycle"} and not what)
    )
    if not is_key:
        raise ValueError(f"{text!r} is no key")
    return Press(key, what or (PROGRAMS if key == "recv" else ""))


class KeyWords:
    """What the knob ``press`` may be."""

    def __str__(self) -> str:
        return (
            "nothing, or keys with commas: recv, recv:KIND, send:O00010, send:ALL, send:last, send:KIND, dnc, cycle; "
            f"KIND: {', '.join(DataKind)}"
        )

    def allows(self, value: str) -> bool:
        """Whether all words are keys."""
        try:
            presses_of(value)
        except ValueError:
            return False
        return True
