"""A regular expression that somebody else words: refused if there are texts on which it could take for ever."""

from __future__ import annotations

import re
from typing import Final

from ..errors import InvalidCommandError
from ..escaping import shown

__all__ = ["expect_bounded_pattern"]

_MAX_LENGTH: Final = 200
_MAX_REPEATS: Final = 2
"""Two without an upper limit try each pair of places in a text of 256 bytes: that is some milliseconds."""
_MAX_CHOICES: Final = 64
"""So often may all be tried again, for ``?``, ``|`` and ``{1,3}``."""

_ESCAPED: Final = re.compile(r"\\.", re.DOTALL)
_CLASS: Final = re.compile(r"\[\^?\]?[^\]]*\]")
_GROUP_SIGNS: Final = re.compile(r"\(\?(?:P<\w+>|<?[=!]|[aiLmsux-]*:|>|[aiLmsux]+\))")
_COUNTED: Final = re.compile(r"\{([0-9]*)(,?)([0-9]*)\}[?+]?")
_UNBOUNDED: Final = re.compile(r"[*+][?+]?")


def expect_bounded_pattern(pattern: str) -> None:
    r"""
    Do nothing if *pattern* is quickly done with any text of 256 bytes, for all that can be told by looking at it.

    Repeats of groups, more than two repeats without a limit, and very many choices are not allowed: a pattern that
    finds an error in an answer, as ``E(\d{1,3})`` does, needs none of them.

    Raises:
        InvalidCommandError: It might not be.
    """
    bare = _GROUP_SIGNS.sub("(", _CLASS.sub("x", _ESCAPED.sub("x", pattern)))
    choices = 1 << min(bare.count("|"), 20)
    repeats = 0
    for low, comma, high in _COUNTED.findall(bare):
        if comma and (not high or len(high) > 2):
            repeats += 1
        elif comma:
            choices *= max(int(high) - int(low or 0) + 1, 1)
    rest = _COUNTED.sub("#", bare)
    repeats += len(_UNBOUNDED.findall(rest))
    rest = _UNBOUNDED.sub("*", rest)
    choices <<= min(rest.count("?"), 20)
    is_nested = ")*" in rest or ")#" in rest
    if len(pattern) > _MAX_LENGTH or is_nested or repeats > _MAX_REPEATS or choices > _MAX_CHOICES:
        raise InvalidCommandError(
            f"error_pattern {shown(pattern)} might take for ever on some answers",
            hint="repeat no groups, and at most two parts without a limit: (\\d{1,3}) rather than (\\d+)",
        )
