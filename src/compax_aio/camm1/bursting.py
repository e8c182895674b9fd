"""A burst of a job written as its handshake allows, sans-IO; how long its pauses are is told by what the line sends."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from ..link.level import LineLevel
from .pacing import Doing, Pacing
from .settings import CutterSettings

__all__ = ["Burst", "BurstWriter"]

_SHORTEST_PAUSE_S: Final = 0.001


@dataclass(slots=True, eq=False)
class Burst:
    """
    Instructions of a job that are to be written next.

    Attributes:
        label: What it is called in errors and on records.
        instructions: Each whole.
        written: How many of them were.
        written_bytes: Of these.
        is_given_up: Set it to have no more of it written.
    """

    label: str
    instructions: Sequence[bytes]
    written: int = 0
    written_bytes: int = 0
    is_given_up: bool = False

    @property
    def next_bytes(self) -> int | None:
        """How long the next instruction is; None if nothing more shall be written."""
        if self.is_given_up or self.written == len(self.instructions):
            return None
        return len(self.instructions[self.written])

    def take(self) -> bytes:
        """Take the next instruction, to write it."""
        data = self.instructions[self.written]
        self.written += 1
        self.written_bytes += len(data)
        return data


class BurstWriter:
    """
    Writes one burst.

    Args:
        burst: What is written.
        pacing: When.
        level: What is known of the line.
        settings: How long things take.

    Attributes:
        pause_s: For so long nothing is written, unless something comes.
    """

    def __init__(self, burst: Burst, pacing: Pacing, level: LineLevel, settings: CutterSettings) -> None:
        self.burst = burst
        self.pacing = pacing
        self.pause_s = 0.0
        self._level = level
        self._settings = settings
        self._waited_s = 0.0
        pacing.begin()

    def go_on(self, unwritten_bytes: int, write: Callable[[bytes], None]) -> tuple[Doing, bool]:
        """
        Write what may be written.

        Args:
            unwritten_bytes: So many are about to be written already.
            write: Called with each instruction, and with the question of the handshake.

        Returns:
            What is waited for now, and whether the question was written.
        """
        burst, pacing, has_asked = self.burst, self.pacing, False
        unsent = self._level.waiting(unwritten_bytes)
        while True:
            doing = pacing.next(burst.next_bytes, unsent)
            if doing is Doing.WRITE:
                data = burst.take()
                pacing.wrote(len(data))
            elif doing is Doing.ASK:
                data = pacing.question
                pacing.asked()
                self._waited_s, has_asked = 0.0, True
            else:
                break
            write(data)
            unsent = None if unsent is None else unsent + len(data)
        self.pause_s = self._pause_s(doing, unsent or 0)
        return doing, has_asked

    def heard(self) -> None:
        """Take note that the question has arrived: its answer has its time anew."""
        self.pacing.heard()
        self._waited_s = 0.0

    def end_pause(self) -> None:
        """Take note that the pause is over, with nothing outstanding."""
        if self.pacing.is_held:
            self.pacing.look()

    def end_pause_in_question(self) -> bool:
        """Take note that the pause is over; return whether the answer has time left."""
        self._waited_s += self.pause_s
        return self._waited_s < self._allowed_s() - _SHORTEST_PAUSE_S / 2

    def _pause_s(self, doing: Doing, unsent: int) -> float:
        if doing is Doing.PAUSE:
            return self._until_low_s(unsent)
        if doing is Doing.HELD:
            return self._settings.look_s
        if doing is Doing.AWAIT:
            return max(self._allowed_s() - self._waited_s, _SHORTEST_PAUSE_S)
        return 0.0

    def _until_low_s(self, unsent: int) -> float:
        pacing, rate = self.pacing, self._level.bytes_per_s
        assert rate is not None  # else nobody knows what is unsent, and there are no such pauses
        size = self.burst.next_bytes or 0
        target = max(0, min(pacing.low_unsent_bytes, (pacing.most_unsent_bytes or 0) - size))
        return max((unsent - target) / rate, _SHORTEST_PAUSE_S)

    def _allowed_s(self) -> float:
        """How long the answer to the handshake's question may take."""
        settings, pacing = self._settings, self.pacing
        if pacing.may_hold_line:
            patience_s = settings.held_timeout_s
        else:
            patience_s = settings.enquiry_timeout_s if pacing.acknowledgement else settings.answered_after_s
        return patience_s + self._level.leaves_s()
