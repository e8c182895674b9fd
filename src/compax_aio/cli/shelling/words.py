"""The words of the shell itself, beside the language of the drive."""

from __future__ import annotations

from typing import Final

from .entries import Entry, Kind

__all__ = ["STOP_KEY", "WORDS"]

STOP_KEY: Final = "Ctrl-X"
"""One byte, so that every terminal delivers it at once; Esc and the function keys are sequences of several."""


def _word(word: str, meaning: str, *more: str) -> Entry:
    return Entry(word=word, kind=Kind.WORD, meaning=meaning, more=more)


WORDS: Final = (
    _word(
        "move",
        "move to a position and tell when it is reached",
        "move 100            to the position 100",
        "move 100 at 20      at 20 % of nominal speed",
        "move by -5          by a distance",
    ),
    _word("home", "find machine zero and tell when it is found"),
    _word(
        "stop",
        f"stop the axis, ahead of everything that waits; as {STOP_KEY} does",
        "the answer comes when the drive has acknowledged STOP and stands",
    ),
    _word("status", "say how the drive stands: S16, S17, position, error"),
    _word("error", "say which error is present (S30), and what to do"),
    _word("history", "say which errors there were (S18)"),
    _word("params", "read parameters with their meaning", "params 20", "params 11-16"),
    _word(
        "watch",
        "print values whenever they change, above the prompt",
        "watch position",
        "watch position torque S6 P40",
        "watch off           no longer",
        "by name: position, target, following_error, speed, torque, status, error; by number: S, P and V",
    ),
    _word("quit", "acknowledge an error at the drive (QUIT); to leave, type exit"),
    _word("reconcile", "look at the drive after a motion was in doubt; from then on it takes motion again"),
    _word(
        "raw",
        "send the rest of the line as it is, and show whatever comes back",
        "raw XYZ 5           for lines that are in no table; everything else needs no such word",
    ),
    _word("help", "explain a word, a number, a code, or find what has to do with something", "help S16", "help torque"),
    _word("exit", "leave; what was started here is stopped"),
)
