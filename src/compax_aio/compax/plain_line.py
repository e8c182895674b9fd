"""One plain line as a caller words it: checked before a byte is sent, and told apart by what it does."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Final

from ..errors import InvalidCommandError
from ..escaping import shown
from .facts.line import ECHO_SIGN, EXECUTE_SIGN, MAX_LINE_LENGTH, POSITION_REACHED_SIGN, STORE_SIGN

__all__ = ["as_index", "check_line", "is_positioning", "is_query", "starts_motion"]

_SIGNS: Final = frozenset({POSITION_REACHED_SIGN, STORE_SIGN, EXECUTE_SIGN, ECHO_SIGN, ">"})
_QUERY: Final = re.compile(r"[SPVN]\d{1,3}")
_MOTION: Final = re.compile(r"POS[AR]|P[AHR]|LOOP|START|WAITPOS[AR]")
_POSITIONING: Final = re.compile(r"POS[AR]|P[AHR]")
_PREPARED_POINT: Final = re.compile(r"(POSR|PR).*(SPEED|SD|OUTPUT|OT)")


def check_line(text: str, *, room_for_sign: bool = False) -> str:
    """
    Return *text* without blanks around it, if it is one line that the drive can be told.

    Raises:
        InvalidCommandError: It is empty, longer than the entry buffer (30 characters, UG p. 160), not printable
            ASCII, or holds a character that carries meaning: CR, LF, ``$ ? ! , >``.
    """
    if not isinstance(text, str):
        raise InvalidCommandError(f"a line is a text, not {shown(text)}")
    line = str.strip(text, " ")  # not as somebody's own kind of text would do it
    for character in line:
        if character in _SIGNS:
            raise InvalidCommandError(
                f"{character!r} in {shown(line)} is a sign of the line, not part of a command",
                hint="moves ask for their message themselves; send one plain command at a time",
            )
        if not " " <= character <= "~":
            raise InvalidCommandError(
                f"{character!r} in {shown(line)} cannot be sent: a line is printable ASCII (UG p. 160)",
                hint="send one command at a time, without its end sign",
            )
    longest = MAX_LINE_LENGTH - room_for_sign
    if not line or len(line) > longest:
        raise InvalidCommandError(
            f"{shown(line)} has {len(line)} characters; the drive's entry buffer takes 1 to {longest} (UG p. 160)",
            hint="use the short forms of the commands (PA, PR, SD, AL, OT) and leave out blanks"
            if line
            else "an empty line is never sent: its CR executes what stands in the drive's buffer",
        )
    return line


def as_index(number: object) -> int | None:
    """
    Return *number* if it is a whole number, and no flag, as a plain one; else None.

    A member of an enumeration may be one, and would write itself into a line by its name.
    """
    return int.__int__(number) if isinstance(number, int) and not isinstance(number, bool) else None


def is_query(line: str) -> bool:
    """Whether *line* asks for a status, parameter, variable or record, and its answer begins with the same."""
    return _QUERY.fullmatch(_compact(line)) is not None


def starts_motion(line: str, words: Iterable[str] = ()) -> bool:
    """
    Whether *line* sets the axis in motion (UG p. 162), or the program that may; prepared points do not.

    Args:
        line: As it is sent.
        words: What else does so on this drive, by its dialect; what stands behind ``{`` is not compared.
    """
    compact = _compact(line)
    if any(compact.startswith(_compact(word.partition("{")[0])) for word in words):
        return True
    return _MOTION.match(compact) is not None and not _PREPARED_POINT.match(compact)


def is_positioning(line: str) -> bool:
    """Whether *line* is a motion that ends before the drive takes another one: not a program (UG p. 162)."""
    compact = _compact(line)
    return _POSITIONING.match(compact) is not None and not _PREPARED_POINT.match(compact)


def _compact(line: str) -> str:
    """Take out blanks, which mean nothing, and small letters, which mean the same at most."""
    return line.replace(" ", "").upper()
