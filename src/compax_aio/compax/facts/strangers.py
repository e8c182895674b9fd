"""Devices that are found at the far end instead of a COMPAX, and what they say there."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

from .certainty import Certainty

__all__ = ["ECHO", "STRANGERS", "StrangerFact"]


@dataclass(frozen=True, slots=True, kw_only=True)
class StrangerFact:
    """One kind of device that is no COMPAX."""

    name: str
    pattern: re.Pattern[bytes] | None
    """One thing it says that no COMPAX says; None where nothing but what was sent tells."""
    answers: int | None
    """That often, one after each of our queries, is enough to know it; None: only when nothing better has come."""
    remedy: str
    source: str
    certainty: Certainty = Certainty.DOCUMENTED


STRANGERS: Final = (
    StrangerFact(
        name="a Compax3",
        pattern=re.compile(rb"(?<![^\r\n])(?:>|! ?[0-9A-Fa-f]{4}) *\r"),
        answers=2,
        remedy=(
            "a Compax3 has another protocol (objects, O<index>,<subindex>) that is not spoken here; this is for "
            "COMPAX-M, COMPAX-S and COMPAX 1000SL"
        ),
        source="Compax3 I12T11, ASCII record",
        certainty=Certainty.INFERRED,
    ),
    StrangerFact(
        name="a computer or terminal server that asks who you are",
        pattern=re.compile(rb"(?i)\b(?:login|user ?name|password) ?:"),
        answers=None,
        remedy="check the port: this one leads to a login, not to a drive",
        source="the usual words of such devices",
        certainty=Certainty.INFERRED,
    ),
    StrangerFact(
        name="a modem, or something else that takes AT commands",
        pattern=re.compile(rb"(?<![^\r\n])(?:OK|ERROR|NO CARRIER|NO DIALTONE|BUSY)\r\n(?!>)"),
        answers=None,
        remedy="check the port; a wireless or modem adapter must be connected through (data mode) first",
        source="ITU-T V.250, result codes",
        certainty=Certainty.INFERRED,
    ),
)
"""A pattern counts only as long as no prompt of a COMPAX (CR LF >, UG p. 160) has ever come."""

ECHO: Final = StrangerFact(
    name="something that only sends back what it gets",
    pattern=None,
    answers=None,
    remedy=(
        "look for a loop-back plug, receive and transmit bridged in the cable, or an adapter, modem or server that is "
        "in its command mode; a COMPAX answers too, echo or not"
    ),
    source="reasoned: every byte that came is a byte that went out",
    certainty=Certainty.INFERRED,
)
