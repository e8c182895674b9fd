"""What `help` prints: meaning, unit, range, source and certainty of what can be typed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from rich.text import Text

from .entries import Entry, Kind
from .replies import Reply
from .vocabulary import Vocabulary
from .words import STOP_KEY, WORDS

__all__ = ["explained", "overview"]

_MOST_FOUND: Final = 15


def overview() -> Reply:
    """Explain the shell on one screen."""
    text = Text.assemble(
        ("Lines go to the drive as they are", "bold"),
        ": S1 asks the position, P20 a parameter, SD50 sets the speed, PA100 moves.\n",
        "A positioning with $ behind it, POSA 100$, is awaited, as move 100 is.\n\n",
        ("Words of this shell", "bold"),
    )
    for entry in WORDS:
        text.append(f"\n  {entry.word:<10}", "cyan").append(entry.meaning)
    text.append("\n\nhelp WORD explains a word, a command, a status value, a parameter, an error code: ")
    text.append("help S16, help E55, help POSA", "cyan")
    text.append(".\nTab completes, by name or by meaning. ")
    text.append(STOP_KEY, "bold red").append(" stops the axis at any time. Ctrl-C stops what was started here, ")
    text.append("clears the line, or gives up waiting. Ctrl-D leaves.")
    return Reply(data={"words": {entry.word: entry.meaning for entry in WORDS}}, people=text)


def explained(vocabulary: Vocabulary, text: str) -> Reply:
    """Explain what *text* names; else list what has to do with it."""
    found = vocabulary.find(text)
    if found:
        return Reply(
            data={"entries": [_document(each) for each in found]}, people=Text("\n\n").join(map(_explanation, found))
        )
    near = vocabulary.search(text)
    if not near:
        return Reply(
            data={"entries": []},
            people=Text(f"Nothing in the tables is called {text!r}, or has to do with it. The manual's own lists of "
                        "parameters and errors were not available."),
        )  # fmt: skip
    return Reply(data={"entries": [_document(each) for each in near]}, people=_list(near, text))


def _list(near: Sequence[Entry], text: str) -> Text:
    lines = Text(f"What has to do with {text!r}:", "bold")
    for entry in near[:_MOST_FOUND]:
        lines.append(f"\n  {entry.word:<12}", "cyan").append(entry.in_short)
    if len(near) > _MOST_FOUND:
        lines.append(f"\n  and {len(near) - _MOST_FOUND} more", "dim")
    return lines


def _explanation(entry: Entry) -> Text:
    also = f", {', '.join(entry.aliases)}" if entry.aliases else ""
    text = Text.assemble((f"{entry.word}{also}", "bold cyan"), f"  {entry.kind}\n  ", (entry.meaning, "bold"))
    for label, value in (("unit", entry.unit), ("values", entry.range)):
        if value:
            text.append(f"\n  {label:<8}", "dim").append(value)
    for line in entry.more:
        text.append(f"\n    {line}")
    if entry.kind != Kind.WORD:
        text.append("\n  source  ", "dim").append(entry.source or "none")
        if entry.certainty is not None:
            text.append(f"; {entry.certainty.name.lower()}: {entry.certainty.value}")
    return text


def _document(entry: Entry) -> dict[str, Any]:
    return {
        "word": entry.word,
        "aliases": entry.aliases,
        "kind": entry.kind,
        "meaning": entry.meaning,
        "unit": entry.unit,
        "range": entry.range,
        "more": entry.more,
        "source": entry.source,
        "certainty": entry.certainty,
    }
