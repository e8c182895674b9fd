"""What a COMPAX sends, as patterns: answers that begin like their query, comparators, and bytes that are no text."""

from __future__ import annotations

import re
from typing import Final

from .facts.limits import MAX_PREPARED_POINTS
from .facts.line import XOFF, XON

__all__ = ["ANSWER", "COMPARATOR", "COMPARATOR_BEFORE", "NOT_TEXT", "as_text"]

ANSWER: Final = re.compile(r"([SPVN])0*(\d{1,3})(?!\d)\s*[:=]?\s*(.*)", re.DOTALL)
"""Letter, number and value of an answer to a query (UG p. 209)."""

COMPARATOR: Final = re.compile(rf"[1-{MAX_PREPARED_POINTS}]")
"""The number of a comparator that was passed (UG p. 162)."""

COMPARATOR_BEFORE: Final = re.compile(rf"([1-{MAX_PREPARED_POINTS}])\s*(?=[SPVNE$])")
"""The running text of UG p. 162 prints prompt, then number: such a number stands right before the next answer."""

NOT_TEXT: Final = bytes({0, XON, XOFF})
"""Flow control comes anywhere, in the middle of a prompt too."""


def as_text(raw: bytes) -> str:
    """Decode what came, whatever it is."""
    return raw.translate(None, NOT_TEXT).decode("latin-1")
