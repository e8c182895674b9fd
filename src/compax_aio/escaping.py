"""What somebody else has worded, written so that it forges nothing: no line of a log, no colour of a terminal."""

from __future__ import annotations

from typing import Final

__all__ = ["escaped", "shown"]

_LONGEST: Final = 60


def escaped(text: str, *, keep: str = "") -> str:
    r"""Write *text* with whatever is not printable as Python writes it, a line feed as ``\n``; *keep* stays."""
    if text.isprintable():
        return text
    return "".join(
        each if each.isprintable() or each in keep else each.encode("unicode_escape").decode("ascii") for each in text
    )


def shown(value: object) -> str:
    """Write *value* as Python does, on one line and no longer than 60 characters, whatever it is."""
    try:
        text = repr(value)
    except Exception:  # an int of thousands of digits cannot be written, and somebody's own kind may raise anything
        text = f"<{type(value).__name__}>"
    return escaped(text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…")
