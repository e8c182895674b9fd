"""What a simulated control takes for a block of a program, what it makes of one that is none, and how it sends one."""

from __future__ import annotations

import re
from typing import Final

__all__ = ["comment_of", "fault_of", "is_name", "sent_block"]

_NUMBER: Final = r"[-+]?(?:\d{1,9}(?:\.\d{0,9})?|\.\d{1,9})"
_EXPRESSION: Final = r"\[[A-Z0-9#+\-*/.\[\] ]*\]"
_VARIABLE: Final = rf"[-+]?#+(?:\d+|{_EXPRESSION})"
_WORD: Final = rf"[A-Z] *(?:{_NUMBER}|{_VARIABLE}|[-+]?{_EXPRESSION})"
_COMMENT: Final = r"\([ -'*-~]*\)"
_MACRO: Final = (
    rf"(?:#[#\d\[\]A-Z +\-*/.]*=|IF *{_EXPRESSION}|WHILE *{_EXPRESSION}|THEN|GOTO|END *\d|DO *\d|"
    r"POPEN|PCLOS|DPRNT *\[[ -~]*\])[#\d\[\]A-Z +\-*/.=]*"
)
_BLOCK: Final = re.compile(rf" *(?:/ *\d? *)?(?:(?:{_WORD}|{_COMMENT}) *)*(?:{_MACRO})? *(?:{_COMMENT} *)?")
_NAME: Final = re.compile(r" *O *(\d+) *((?:\(.*\) *)?)")
_LONG_NUMBER: Final = re.compile(r"[A-Z] *[-+]?(?:\d{10,}|\d+\.\d{10,})")
_WITHOUT_COMMENTS: Final = re.compile(r"\([^()]*\)")
_PLAIN: Final = re.compile(r"[A-Z0-9#+\-*/.=\[\]() ]*")
_NOT_PLAIN: Final = re.compile(r"[\[#=]")
_COMMENTS: Final = re.compile(r"(\([^)]*\))")
_BETWEEN_WORDS: Final = re.compile(r"(?<=[\d.])(?=[A-Z])")


def is_name(block: str) -> re.Match[str] | None:
    """Return what a block that names a program says: its digits, and its comment."""
    return _NAME.fullmatch(block)


def fault_of(block: str) -> str | None:
    """Return the name of the alarm that a block of a program raises; None: it is one."""
    if _BLOCK.fullmatch(block):
        return None
    if _LONG_NUMBER.search(block):
        return "number-range"
    if _PLAIN.fullmatch(_WITHOUT_COMMENTS.sub("", block)):
        return "missing-code"
    return "invalid-code"


def comment_of(block: str) -> str:
    """Make a comment of what is no block (Haas 11596-8000)."""
    text = "".join(each if " " <= each <= "~" else "?" for each in block if each not in "()")
    return f"({text.strip()})"


def sent_block(block: str, *, spaced: bool) -> str:
    """Return a block as it is sent, with or without spaces between words (Setting 41)."""
    if _NOT_PLAIN.search(_WITHOUT_COMMENTS.sub("", block)):
        return block.strip()
    parts = [each if each.startswith("(") else each.replace(" ", "") for each in _COMMENTS.split(block)]
    if not spaced:
        return "".join(parts)
    return " ".join(each if each.startswith("(") else _BETWEEN_WORDS.sub(" ", each) for each in parts if each)
