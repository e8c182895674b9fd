"""What a drive shows of a record, which may be cut: the same as was written, its beginning, or something else."""

from __future__ import annotations

import re
from collections.abc import Mapping
from decimal import Decimal
from enum import Enum
from typing import Final

from ...errors import InvalidCommandError
from ..facts.line import MAX_LINE_LENGTH
from ..facts.program_commands import RECORD_TEMPLATE
from .printing import record_text, short_text
from .reading import COMMENT, normalise, parse_record
from .records import End, Gosub, Goto, GotoExternal, Record, Repeat, Return

__all__ = ["Shown", "compare", "may_be_cut", "read_shown", "superfluous_ends"]

_SHORTEST_CUT: Final = MAX_LINE_LENGTH - len(RECORD_TEMPLATE.format(n=1, text="")) - 1
"""Characters behind ``N001: ``; one less than fit, for a blank or ``>`` in the last place does not come through."""

_CONTINUATIONS: Final = ("0", ".0", "ACCEL0", "WAIT0", "+0")
"""How a record may go on that could end there."""

_TOKEN: Final = re.compile(r"[0-9]+\.?[0-9]*|\.[0-9]+|[A-Z]+|.")
_NUMBER: Final = re.compile(r"[0-9]+\.?[0-9]*|\.[0-9]+")


class Shown(Enum):
    """How what a drive shows of a record compares to what was written."""

    SAME = "the same, however it is spelt"
    BEGINNING = "the same as far as it goes; the rest, if there is one, is not shown"
    OTHER = "something else"


def compare(text: str, record: Record, *, decimals: int) -> Shown:
    """
    Compare what the drive shows of a record with what it should hold.

    Args:
        text: What the drive sent behind the record's number.
        record: What it should hold.
        decimals: Of positions and distances: 2, or 3 where the unit is inches (UG p. 100).
    """
    whole, is_cut = record_text(record), may_be_cut(text, decimals=decimals)
    # What stands behind a semicolon is a comment in a listing, and in an answer something else.
    if normalise(text) == normalise(whole) and COMMENT not in text:
        return Shown.BEGINNING if is_cut else Shown.SAME
    # It may show the abbreviations with which it was written.
    if is_cut and any(_is_beginning(text, each) for each in (whole, short_text(record))):
        return Shown.BEGINNING
    return Shown.OTHER


def may_be_cut(text: str, *, decimals: int) -> bool:
    """
    Say whether *text*, as the drive sent it behind the record's number, may be the beginning of a longer record.

    The output buffer has 30 characters (UG p. 160), so longer combined commands cannot be shown completely (IBS p. 54).
    A text that fills the buffer is not trusted if it is no record, or one that could go on: ``POSR 10 SPEED 50 ACCEL
    25`` may have been ``ACCEL 250``.
    """
    if len(text) < _SHORTEST_CUT:
        return False
    return not _is_record(text, decimals) or any(_is_record(text + more, decimals) for more in _CONTINUATIONS)


def read_shown(text: str, *, decimals: int) -> Record | None:
    """Read what the drive shows of a record; None if it cannot be read, or may be cut."""
    if may_be_cut(text, decimals=decimals) or not _is_record(text, decimals):
        return None
    return parse_record(text, decimals=decimals)


def superfluous_ends(memory: Mapping[int, Record | None]) -> set[int]:
    """
    Find the END records at the end of a memory that nothing needs.

    Those that close an open REPEAT are needed, one more behind a record that goes on to the next, and those that are
    jumped to.

    Args:
        memory: By number, in order; None stands for a record that could not be read.
    """
    open_, behind, last = 0, list[int](), None
    for number, record in memory.items():
        if isinstance(record, End):
            behind.append(number)
            continue
        # Each END in between has closed a loop, as long as one was open.
        open_ = max(0, open_ - len(behind)) + isinstance(record, Repeat)
        behind, last = [], record
    needed = open_ + (not isinstance(last, Goto | GotoExternal | Return))
    targets = {_target(record) for record in memory.values()}
    return {number for number in behind[needed:] if number not in targets}


def _target(record: Record | None) -> int | None:
    jump = getattr(record, "jump", record)
    return jump.record if isinstance(jump, Goto | Gosub) else None


def _is_record(text: str, decimals: int) -> bool:
    try:
        parse_record(text, decimals=decimals)
    except InvalidCommandError:
        return False
    return True


def _is_beginning(shown: str, whole: str) -> bool:
    """Whether *whole* begins like *shown*, whatever blanks and superfluous zeros stand in either."""
    have, should = _tokens(shown), _tokens(whole)
    if not have or len(have) > len(should):
        return False
    last, its_whole = have[-1], should[len(have) - 1]
    return all(map(_is_same, have[:-1], should)) and (its_whole.startswith(last) or _is_same(last, its_whole))


def _tokens(text: str) -> list[str]:
    return _TOKEN.findall(text.replace(" ", "").upper())


def _is_same(one: str, other: str) -> bool:
    if _NUMBER.fullmatch(one) and _NUMBER.fullmatch(other):
        return Decimal(one) == Decimal(other)
    return one == other
