"""The bytes that the simulated drive says: answers, errors, messages and what it sends at power-on."""

from __future__ import annotations

from typing import Final

from compax_aio.compax.facts.line import MAX_LINE_LENGTH, PROMPT

from .knobs import Knobs
from .machine import Message, MessageKind
from .refusals import Refusal

__all__ = ["answer", "error_text", "message", "power_on_text"]

_BANNER: Final = b"COMPAX simulator"
"""What a drive really sends at power-on, if anything, is unknown (row 19)."""


def answer(text: str) -> bytes:
    """Return *text* and a prompt (UG p. 160)."""
    return text.encode("latin-1") + PROMPT


def error_text(refusal: Refusal, knobs: Knobs, *, suppressed: bool) -> str | None:
    """Return what is answered to a refused line, *suppressed* by P20 or not; None for not even a prompt."""
    if suppressed:
        return None if knobs.error_style == "silent" else ""
    if knobs.error_style == "text":
        return f"E{refusal.code} {refusal.text}"[:MAX_LINE_LENGTH]
    return f"E{refusal.code}"


def message(what: Message, knobs: Knobs) -> bytes:
    """Return what is sent unasked (UG p. 160, 162)."""
    if what.kind is MessageKind.COMPARATOR and knobs.comparator_form == "prompt_first":
        return PROMPT + what.text.encode()
    return answer(what.text)


def power_on_text(knobs: Knobs) -> bytes:
    """Return what is sent when the power comes."""
    return {"nothing": b"", "prompt": PROMPT, "banner": _BANNER + PROMPT}[knobs.power_on_text]
