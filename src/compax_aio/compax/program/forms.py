"""Which record has which forms, and the forms cut into words, signs and places: for the reader and the printer."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

from ..facts.program_commands import GERMAN_LETTERS, PROGRAM_COMMANDS
from . import records
from .records import Record

__all__ = ["FORMS", "FORMS_OF", "Form", "Piece"]


@dataclass(frozen=True, slots=True)
class Piece:
    """A word or sign, in all its spellings; or a place, with its name."""

    spellings: tuple[str, ...] = ()
    place: str | None = None


@dataclass(frozen=True, slots=True)
class Form:
    """One form of a record, long and short."""

    kind: type[Record]
    long: str
    short: str
    patterns: tuple[tuple[Piece, ...], ...]
    """What a reader looks for: the long form with each word long or short, and the short form as it is."""

    @property
    def places(self) -> tuple[str, ...]:
        """Names of the places, in the order of the record's fields."""
        return tuple(piece.place for piece in self.patterns[0] if piece.place)


_KINDS: Final[dict[str, type[Record]]] = {
    "ACCEL- {ramp_ms}": records.Deceleration,
    "ACCEL {ramp_ms}": records.Acceleration,
    "SPEED SYNC": records.SpeedSync,
    "SPEED {percent}": records.Speed,
    "SPEED {percent} WAIT {wait_ms}": records.Speed,
    "POSA HOME": records.MoveHome,
    "POSA {position}": records.MoveTo,
    "POSR CAM": records.MoveByCam,
    "POSR {distance}": records.MoveBy,
    "POSR {point} SPEED {step_percent}": records.PreparedSpeed,
    "POSR {point} SPEED {step_percent} ACCEL {ramp_ms}": records.PreparedSpeed,
    "POSR {point} OUTPUT O{output}={level}": records.PreparedOutput,
    "WAIT POSA {position}": records.WaitPosition,
    "WAIT POSR {distance}": records.WaitDistance,
    "WAIT START": records.WaitStart,
    "WAIT {wait_ms}": records.Wait,
    "OUTPUT O0={mode}": records.Power,
    "OUTPUT O{output}={levels}": records.Outputs,
    "GOTO EXT": records.GotoExternal,
    "GOTO {password}": records.Password,
    "GOTO {record}": records.Goto,
    "GOSUB EXT": records.GosubExternal,
    "GOSUB {record}": records.Gosub,
    "RETURN": records.Return,
    "REPEAT {count}": records.Repeat,
    "END": records.End,
    "LOOP {count}": records.Loop,
    "IF ERROR {jump}": records.IfError,
    "IF STOP {jump}": records.IfStop,
    "IF I{input}={levels} {jump}": records.IfInputs,
    "IF {value}{comparison}{value} {jump}": records.IfCompare,
    "{target}={value}": records.Assign,
    "{target}={value}{arithmetic}{value}": records.Assign,
}

_PIECE: Final = re.compile(r"\{(\w+)\}|([A-Z]+[0-9]?-?|=)")

_ABBREVIATIONS: Final = {
    long: short
    for row in PROGRAM_COMMANDS
    if len(row.long.split()) == len(row.short.split())
    for long, short in zip(row.long.split(), row.short.split(), strict=True)
    if long != short
}
"""POSA: PA, and so on: words of the long forms and what the short forms have in their place."""


def _cut(form: str) -> tuple[Piece, ...]:
    pieces = []
    for place, word in _PIECE.findall(form):
        others = (each[word] for each in (_ABBREVIATIONS, GERMAN_LETTERS) if word in each)
        pieces.append(Piece(place=place) if place else Piece(spellings=(word, *others)))
    return tuple(pieces)


FORMS: Final = tuple(
    Form(_KINDS[row.long], row.long, row.short, tuple(dict.fromkeys((_cut(row.long), _cut(row.short)))))
    for row in PROGRAM_COMMANDS
)
"""In the order in which a reader tries them."""

FORMS_OF: Final = {
    kind: {len(form.places): form for form in FORMS if form.kind is kind} for kind in {form.kind for form in FORMS}
}
"""By record type and by how many of its fields are given."""
