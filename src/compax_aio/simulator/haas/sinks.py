"""Where what a simulated control receives goes: blocks of programs, and numbered data, into memory."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Final, Protocol

from compax_aio.haas.facts.data_files import CHECKSUM_NUMBER, DATA_FILES, LAST_NUMBER, DataKind, Presence

from .blocks import comment_of, fault_of, is_name
from .log import LogKind
from .memory import name_of
from .surroundings import Surroundings
from .tape import Tape

__all__ = ["Checksum", "ProgramSink", "Sink", "TableSink"]

Checksum = Callable[[DataKind, Mapping[int, str]], int]
"""Makes the value of N0."""

_LINE: Final = re.compile(r"\s*N\s*(\d{1,6})\s*V\s*([-+]?(?:\d{1,12}(?:\.\d{0,12})?|\.\d{1,12}))\s*")
_NUMBER: Final = re.compile(r"\s*N\s*(\d{1,6})(?!\d)")


class Sink(Protocol):
    """Takes what comes in between."""

    tape: Tape
    must_stop: bool
    """Something was wrong so that the receive operation ends here."""

    @property
    def is_full(self) -> bool:
        """Whether it can take nothing now."""

    def feed(self, data: bytes, at: float, step_s: float) -> int:
        """Take bytes that came one after the other; returns how many were taken."""

    def end(self, at: float) -> None:
        """Take note that all has come."""

    def abort(self, at: float) -> None:
        """Take note that no more comes."""


class ProgramSink:
    """
    Stores programs.

    Args:
        around: Of the control.

    Attributes:
        tape: Of the file.
        must_stop: See :class:`Sink`.
        stored: Names of the programs that were stored, in their order.
    """

    is_full = False

    def __init__(self, around: Surroundings) -> None:
        self._around = around
        self.tape = Tape(around.knobs.eob_pattern)
        self.must_stop = False
        self.stored: list[str] = []
        self._name = ""
        self._blocks: list[str] = []
        self._bytes = 0
        self._room = around.knobs.memory_bytes - around.memory.used_bytes
        self._is_empty = True

    def feed(self, data: bytes, at: float, step_s: float) -> int:
        """Take bytes; each block at about the time of its end."""
        taken, lines = self.tape.feed(data)
        when = at + max(0, taken - 1) * step_s
        for line in lines:
            self._take(line.decode("latin-1"), when)
            if self.must_stop:
                break
        if self.tape.is_ended and self._blocks and not self._blocks[-1]:  # the empty block in front of the last %
            self._blocks.pop()
        return taken

    def _take(self, block: str, at: float) -> None:
        if block.lstrip().startswith("O"):
            self._is_empty = False
            self._begin(block, at)
            return
        if not block.strip():
            if self._name:
                self._keep("", at)
            return
        self._is_empty = False
        if not self._name:
            self._stop("no-program-name", block, at)
            return
        fault = fault_of(block) if self._around.knobs.garbled_as_comment else None
        if fault is not None:
            self._around.alarm(fault, block, at)
            block = comment_of(block)
        self._keep(block.strip(), at)

    def _begin(self, block: str, at: float) -> None:
        self._store(at)
        found = is_name(block)
        if found is None or len(found[1]) > self._around.knobs.o_digits or not int(found[1]):
            self._stop("illegal-program-name", block, at)
            return
        name = name_of(int(found[1]))
        programs = self._around.memory.programs
        if name not in programs and len(programs) >= self._around.knobs.max_programs:
            self._stop("too-many-programs", name, at)
            return
        self._name = name
        self._room += len(programs.get(name, ""))
        self._keep(name + found[2].strip(), at)

    def _keep(self, block: str, at: float) -> None:
        self._room -= len(block) + 1
        if self._room < 0:
            self._stop("insufficient-memory", self._name, at)
            return
        self._blocks.append(block)

    def _stop(self, alarm: str, detail: str, at: float) -> None:
        self._around.alarm(alarm, detail, at)
        self.must_stop = True

    def end(self, at: float) -> None:
        """Store the last program."""
        if self._is_empty:
            self._around.alarm("empty-program", at=at)
        self._store(at)

    def abort(self, at: float) -> None:
        """Store what has come."""
        if self._around.knobs.keeps_partial:
            self._store(at)

    def _store(self, at: float) -> None:
        if not self._name:
            return
        self._around.memory.programs[self._name] = "\n".join(self._blocks)
        self.stored.append(self._name)
        self._around.note(LogKind.STORED, self._name, at)
        self._name, self._blocks = "", []


class TableSink:
    """
    Stores numbered data when all of it has come; alarms keep it from nothing (Haas 11596-8000).

    Args:
        around: Of the control.
        kind: Of the data.
        checksum: Makes the value that N0 must have.

    Attributes:
        tape: Of the file.
        must_stop: See :class:`Sink`.
    """

    is_full = False

    def __init__(self, around: Surroundings, kind: DataKind, checksum: Checksum) -> None:
        self._around = around
        self._kind = kind
        self._rules = DATA_FILES[kind]
        self._checksum = checksum
        self.tape = Tape(around.knobs.eob_pattern)
        self.must_stop = False
        self._values: dict[int, str] = {}
        self._told: str | None = None
        self._has_last = False

    def feed(self, data: bytes, at: float, step_s: float) -> int:
        """Take bytes."""
        taken, lines = self.tape.feed(data)
        when = at + max(0, taken - 1) * step_s
        for line in lines:
            if line.strip():
                self._take(line.decode("latin-1"), when)
        return taken

    def _take(self, line: str, at: float) -> None:
        found = _LINE.fullmatch(line)
        if found is None:
            self._around.alarm("invalid-v-code" if _NUMBER.match(line) else "invalid-n-code", line, at)
            return
        number, value = int(found[1]), found[2]
        if number == CHECKSUM_NUMBER and self._rules.checksum is not Presence.ABSENT:
            self._told = value
        elif number == LAST_NUMBER and self._rules.last_line is not Presence.ABSENT:
            self._has_last = True
        elif self._around.memory.has_place(self._kind, number):
            self._values[number] = value
        else:
            self._around.alarm("invalid-n-code", line, at)

    def end(self, at: float) -> None:
        """Look at N0 and N9999, and load."""
        around = self._around
        if self._told is None and self._rules.checksum is Presence.MANDATORY:
            around.alarm("wrong-checksum", "there is no N0", at)
            if around.knobs.parameters_without_n0 == "refuse":
                self.must_stop = True
                return
        elif self._told is not None and not self._is_right(self._told):
            around.alarm("wrong-checksum", f"N0 V{self._told}", at)
        if not self._has_last and self._rules.last_line is Presence.MANDATORY and around.knobs.needs_n9999:
            around.alarm("unexpected-end", f"there is no N{LAST_NUMBER}", at)
        self._load(at)

    def _is_right(self, told: str) -> bool:
        return told.isdigit() and int(told) == self._checksum(self._kind, self._values)

    def abort(self, at: float) -> None:
        """Load what has come."""
        if self._around.knobs.keeps_partial and self._values:
            self._load(at)

    def _load(self, at: float) -> None:
        for number, value in self._values.items():
            self._around.memory.put(self._kind, number, value)
        self._around.note(LogKind.STORED, f"{self._kind}: {len(self._values)} values", at)
