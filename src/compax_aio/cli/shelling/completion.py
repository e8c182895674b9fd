"""Completion while one types: by name, by part of a name, or by meaning, with the meaning beside each."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from typing import Final

from prompt_toolkit.completion import CompleteEvent, Completer, Completion
from prompt_toolkit.document import Document

from .entries import Entry, Kind
from .vocabulary import Vocabulary, subsequence
from .words import WORDS

__all__ = ["LineCompleter"]

_MOST: Final = 60
_WATCHED: Final = {
    "position": "actual position, S1",
    "target": "target position, S2",
    "following_error": "set minus actual position, S3",
    "speed": "traverse speed, S4",
    "torque": "motor torque, S5",
    "status": "S16 and S17",
    "error": "the error that is present, S30",
    "off": "watch no longer",
}
_CAN_BE_WATCHED: Final = {Kind.STATUS, Kind.PARAMETER, Kind.VARIABLE}
_SHELL_WORDS: Final = {entry.word for entry in WORDS}


class LineCompleter(Completer):
    """
    Completes what can be typed to one drive.

    Args:
        vocabulary: Of the drive.
    """

    def __init__(self, vocabulary: Vocabulary) -> None:
        self._vocabulary = vocabulary

    def get_completions(self, document: Document, complete_event: CompleteEvent) -> Iterator[Completion]:  # noqa: ARG002
        """Give what could stand in place of what is typed before the cursor, the nearest first."""
        yield from islice(self._completions(document.text_before_cursor.lstrip()), _MOST)

    def _completions(self, typed: str) -> Iterator[Completion]:
        word, blank, rest = typed.partition(" ")
        match word.lower() if blank else "":
            case "help":
                yield from self._entries(rest.lstrip(), lambda _: True)
            case "raw":
                yield from self._entries(rest.lstrip(), lambda entry: entry.is_typed and entry.kind != Kind.WORD)
            case "watch":
                last = rest.rpartition(" ")[2]
                yield from _named(_WATCHED.items(), last)
                yield from self._entries(last, lambda entry: entry.kind in _CAN_BE_WATCHED)
            case "params":
                numbers = ((each.word[1:], each.in_short) for each in self._of_kind(Kind.PARAMETER))
                yield from _named(numbers, rest.rpartition(" ")[2])
            case other if other not in _SHELL_WORDS:
                yield from self._entries(typed, lambda entry: entry.is_typed)

    def _of_kind(self, kind: str) -> Iterator[Entry]:
        return (each for each in self._vocabulary.entries if each.kind == kind)

    def _entries(self, typed: str, fits: Callable[[Entry], bool]) -> Iterator[Completion]:
        for entry in self._vocabulary.search(typed):
            if fits(entry):
                yield _completion(_name(entry, typed), typed, entry.in_short)


def _named(rows: Iterable[tuple[str, str]], typed: str) -> Iterator[Completion]:
    for name, meaning in rows:
        if name.startswith(typed.lower()):
            yield _completion(name, typed, meaning)


def _name(entry: Entry, typed: str) -> str:
    """Return the form of the word that was begun: long for who types POS, short for who types PA."""
    names, upper = (entry.word, *entry.aliases), typed.upper()
    begun = [each for each in names if each.upper().startswith(upper)]
    meant = [each for each in names if subsequence(upper, each.upper())]
    return next(iter((*begun, *meant, entry.word)))


def _completion(name: str, typed: str, meaning: str) -> Completion:
    return Completion(name, start_position=-len(typed), display_meta=meaning)
