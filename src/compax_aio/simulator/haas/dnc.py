"""DNC of a simulated control: blocks are executed as they come, a few are read ahead, and nothing is stored."""

from __future__ import annotations

import re
from collections import deque
from math import inf
from typing import Final

from .blocks import fault_of
from .log import LogKind
from .surroundings import Surroundings
from .tape import Tape

__all__ = ["DncSink"]

_END_OF_BLOCK: Final = re.compile(rb"[\r\n]")
_LINE_NUMBER: Final = re.compile(r" *N *(\d+)")


class DncSink:
    """
    Executes blocks.

    Args:
        around: Of the control.

    Attributes:
        tape: Of the file.
        must_stop: A block was none: nothing more is executed.
    """

    def __init__(self, around: Surroundings) -> None:
        self._around = around
        self._knobs = around.knobs
        self.tape = Tape(around.knobs.eob_pattern)
        self.must_stop = False
        self._ahead: deque[tuple[str, float]] = deque()
        self._busy_until = -inf

    @property
    def is_full(self) -> bool:
        """Whether enough is read ahead."""
        return len(self._ahead) >= self._knobs.look_ahead

    @property
    def is_idle(self) -> bool:
        """Whether nothing is left to execute, unless more comes."""
        return not self._ahead

    @property
    def busy_until(self) -> float:
        """When the block ends that is executed."""
        return self._busy_until

    def feed(self, data: bytes, at: float, step_s: float) -> int:
        """Take blocks until enough is read ahead."""
        taken = 0
        while taken < len(data) and not self.must_stop and not self.tape.is_ended:
            self.run(at + taken * step_s)
            if self.is_full:
                break
            end = _END_OF_BLOCK.search(data, taken)
            piece = data[taken:] if end is None else data[taken : end.end()]
            count, lines = self.tape.feed(piece)
            taken += count
            for line in lines:
                if line.strip():
                    self._ahead.append((line.decode("latin-1").strip(), at + (taken - 1) * step_s))
        if taken:
            self.run(at + (taken - 1) * step_s)
        return taken

    def next_at(self) -> float:
        """When the next block begins."""
        if not self._ahead or self.must_stop:
            return inf
        return max(self._busy_until, self._ahead[0][1])

    def run(self, now: float) -> None:
        """Begin what is due."""
        while (at := self.next_at()) <= now:
            self._execute(self._ahead.popleft()[0], at)

    def _execute(self, block: str, at: float) -> None:
        number = _LINE_NUMBER.match(block)
        most = self._knobs.dnc_crash_above_n
        if most and number is not None and int(number[1]) > most:
            self._around.is_frozen = self.must_stop = True
            self._around.note(LogKind.FROZEN, f"a line number above {most}: {block[:40]}", at)
            return
        if (fault := fault_of(block)) is not None:
            self._around.alarm(fault, block, at)
            self.must_stop = True
            return
        self._around.note(LogKind.EXECUTED, block, at)
        self._busy_until = at + self._knobs.dnc_block_s

    def end(self, at: float) -> None:
        """Nothing is stored."""

    def abort(self, at: float) -> None:
        """Execute no more."""
        del at
        self._ahead.clear()
