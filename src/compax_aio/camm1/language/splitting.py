"""Long lists of coordinates in several instructions that draw the same line."""

from __future__ import annotations

import re
from typing import Final

from ..facts.line import MAX_INSTRUCTION_LENGTH
from .instruction import Instruction, Language

__all__ = ["SPLITTABLE", "split_long"]

SPLITTABLE: Final = frozenset({"PD", "PU", "PA", "PR", "D", "M", "I", "R"})
"""Each goes on from where the one before it has led, relative ones too, so that a list may be begun anew anywhere."""

_NUMBER: Final = re.compile(rb"[^\s,]+")


def split_long(instruction: Instruction, longest_bytes: int = MAX_INSTRUCTION_LENGTH) -> tuple[Instruction, ...]:
    """
    Return instructions of no more than *longest_bytes* that draw the same line; or the one as it is.

    It stays as it is if it is short enough, if it is no list of coordinates, if the coordinates are no pairs, if
    device control stands in it, or if not even one pair fits. Each part knows the place in the job of the coordinates
    that it begins with; its name, and what ends it, are added, so that offsets no longer follow from lengths.
    """
    if len(instruction.data) <= longest_bytes or instruction.name not in SPLITTABLE or instruction.holds_control:
        return (instruction,)
    places = [match.span() for match in _NUMBER.finditer(instruction.data, instruction.first, instruction.last)]
    if len(places) % 2:
        return (instruction,)
    name = instruction.data[instruction.begin : instruction.first]
    end = instruction.data[instruction.last :] or (b";" if instruction.language is Language.TWO else b"\n")
    room = longest_bytes - len(name) - len(end)
    rows = _rows(instruction.data, places, room, room - instruction.begin)
    if not rows:
        return (instruction,)
    return tuple(
        _part(instruction, rows, number, name, end) for number in range(len(rows))
    )  # fmt: skip


_Row = tuple[int, bytes]
"""Where the first coordinate stands in the instruction, and the list."""


def _rows(data: bytes, places: list[tuple[int, int]], room: int, first_room: int) -> list[_Row]:
    """Put as many pairs into a row as have room; none at all if one pair has none."""
    rows: list[_Row] = []
    row: list[bytes] = []
    size = start = 0
    for (begin, end), (second_begin, second_end) in zip(places[::2], places[1::2], strict=True):
        pair = data[begin:end] + b"," + data[second_begin:second_end]
        limit = room if rows else first_room
        if row and size + 1 + len(pair) > limit:
            rows.append((start, b",".join(row)))
            row, size, limit = [], 0, room
        if len(pair) > limit:
            return []
        if not row:
            start = begin
        size += len(pair) + bool(row)
        row.append(pair)
    rows.append((start, b",".join(row)))
    return rows


def _part(whole: Instruction, rows: list[_Row], number: int, name: bytes, end: bytes) -> Instruction:
    start, coordinates = rows[number]
    blanks = whole.data[: whole.begin] if number == 0 else b""
    is_last = number == len(rows) - 1
    begin, first = len(blanks), len(blanks) + len(name)
    line, column = whole.line, whole.column
    if number:
        before = whole.data[whole.begin : start]
        lines = re.split(rb"\r\n|\r|\n", before)
        line += len(lines) - 1
        column = len(lines[-1]) + (1 if len(lines) > 1 else whole.column)
    return Instruction(
        blanks + name + coordinates + end,
        whole.name,
        whole.language,
        whole.offset if number == 0 else whole.offset + start,
        line,
        column,
        begin,
        first,
        first + len(coordinates),
        whole.is_complete or not is_last,
    )
