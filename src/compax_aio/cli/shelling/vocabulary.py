"""What can be typed to one drive: found by its name, by part of it, or by what it means."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

from ...compax.facts.parameters import MAX_PARAMETER
from ...compax.facts.program_commands import RECORD_NUMBERS
from ...compax.facts.status import Form
from ...compax.readings import MAX_STATUS
from ...compax.settings import DriveSettings
from .entries import Entry, Kind, drive_entries, error_entry, parameter_entry, record_entry

__all__ = ["Vocabulary", "subsequence"]

_NUMBERED: Final = re.compile(r"([SPVNE])0*([1-9][0-9]{0,2})")
_AFTER_A_NAME: Final = frozenset("-+.=:$0123456789")
_LEAST_LETTERS: Final = 3
"""Of a word that is looked for in meanings: fewer are in nearly all of them."""


class Vocabulary:
    """
    All that can be typed to one drive or looked up.

    Args:
        settings: Of the drive: its unit, and its own words.
        words: Of the shell itself.
    """

    def __init__(self, settings: DriveSettings, words: Sequence[Entry]) -> None:
        self._unit = settings.unit
        self.entries = (*words, *drive_entries(settings))
        self._by_word = {_compact(each): entry for entry in reversed(self.entries) for each in _names(entry)}

    def find(self, text: str) -> tuple[Entry, ...]:
        """
        Return what *text* names: one entry, the word of the shell and the command of one name, or nothing.

        ``POSA 100`` finds POSA, ``s016`` finds S16, and every S, P, V, N and E with a number that exists is found.
        """
        named = tuple(each for each in self.entries if _compact(text) in map(_compact, _names(each)))
        if named:
            return named
        if (numbered := self._numbered(_compact(text))) is not None:
            return (numbered,)
        words = text.split()
        return self.find(" ".join(words[:-1])) if len(words) > 1 else self._glued(_compact(text))

    def search(self, text: str) -> tuple[Entry, ...]:
        """Return the entries that *text* is part of, by name or by meaning, the nearest first."""
        ranked = [(rank, each) for each in self.entries if (rank := _rank(each, text)) is not None]
        return tuple(each for _, each in sorted(ranked, key=lambda pair: pair[0]))

    def _numbered(self, compact: str) -> Entry | None:
        """Return what is no row of a table, but exists: P3, E7, N12."""
        match = _NUMBERED.fullmatch(compact)
        if match is None:
            return None
        letter, number = match[1], int(match[2])
        if (known := self._by_word.get(f"{letter}{number}")) is not None:
            return known
        if letter == "S" and number <= MAX_STATUS:
            return Entry(
                word=f"S{number}", kind=Kind.STATUS, meaning="no page at hand has it", range=Form.UNKNOWN.value
            )
        if letter == "P" and number <= MAX_PARAMETER:
            return parameter_entry(number, self._unit)
        if letter == "N" and number in RECORD_NUMBERS:
            return record_entry(number)
        return error_entry(number) if letter == "E" else None

    def _glued(self, compact: str) -> tuple[Entry, ...]:
        """Find what begins *compact* and is followed by a number or sign: PA100, P14=5, the longest there is."""
        for end in range(len(compact) - 1, 0, -1):
            begin, next_one = compact[:end], compact[end]
            if next_one in _AFTER_A_NAME and not (begin[-1].isdigit() and next_one.isdigit()):
                if begin in self._by_word:
                    return (self._by_word[begin],)
                if (numbered := self._numbered(begin)) is not None:
                    return (numbered,)
        return ()


def _names(entry: Entry) -> tuple[str, ...]:
    return (entry.word, *entry.aliases)


def _compact(text: str) -> str:
    return text.replace(" ", "").upper()


def _rank(entry: Entry, text: str) -> int | None:
    """Say how near *entry* is to *text*; None: not at all."""
    typed = _compact(text)
    names = tuple(map(_compact, _names(entry)))
    if typed in names:
        return 0
    if any(name.startswith(typed) for name in names):
        return 1
    words = text.lower().split()
    if words and all(len(each) >= _LEAST_LETTERS for each in words):
        begins = re.findall(r"\w+", entry.meaning.lower())
        if all(any(begin.startswith(each) for begin in begins) for each in words):
            return 2
    return 3 if typed.isalpha() and len(typed) > 1 and any(subsequence(typed, name) for name in names) else None


def subsequence(letters: str, word: str) -> bool:
    """Whether *letters* stand in *word* in this order, the first one first: ``SPD`` in ``SPEED``."""
    if not word.startswith(letters[:1]):
        return False
    rest = iter(word)
    return all(letter in rest for letter in letters)
