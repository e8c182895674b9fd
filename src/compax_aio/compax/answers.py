"""What a COMPAX sends, as patterns: answers that begin like their query, comparators, and bytes that are no text."""

from __future__ import annotations

import re
from typing import Final

from .facts.limits import MAX_PREPARED_POINTS
from .facts.line import XOFF, XON

__all__ = ["ANSWER", "COMPARATOR", "COMPARATOR_BEFORE", "LINE_ENDS", "NOT_TEXT", "PLAIN_ANSWER", "as_text"]

ANSWER: Final = re.compile(r"([SPVN])0*(\d{1,3})(?!\d)\s*[:=]?\s*(.*)", re.DOTALL)
"""Letter, number and value of an answer to a query (UG p. 209)."""

PLAIN_ANSWER: Final = re.compile(r"([SPVN])0*([0-9]{1,3})[ \t]*[:=][^\r\n\0\x11\x13]*(?<![ \t>])\r\n>")
"""
An answer with its prompt that is one line of nothing but text, ends with no blank, and is no echo of its query with an
answer behind it: by its sign, which no query has.
"""

LINE_ENDS: Final = re.compile(r"[\r\n]+")

COMPARATOR: Final = re.compile(rf"[1-{MAX_PREPARED_POINTS}]")
"""The number of a comparator that was passed (UG p. 162)."""

COMPARATOR_BEFORE: Final = re.compile(rf"([1-{MAX_PREPARED_POINTS}])\s*(?=[SPVNE$])")
"""The running text of UG p. 162 prints prompt, then number: such a number stands right before the next answer."""

NOT_TEXT: Final = bytes({0, XON, XOFF})
"""Flow control comes anywhere, in the middle of a prompt too."""


def as_text(raw: bytes) -> str:
    """Decode what came, whatever it is; :data:`NOT_TEXT` has been taken out."""
    return raw.decode("latin-1")
