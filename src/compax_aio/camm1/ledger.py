"""What was sent of a job, and what the cutter is known to have taken of it."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

from .cut import CutAccount
from .language.instruction import Instruction, Language
from .language.tracking import Tracker

__all__ = ["CutLedger"]


class CutLedger:
    """
    Keeps count of one job.

    Attributes:
        total_bytes: Of the job; None if nobody knows.
        total_instructions: The same, as they stand in the job.
        wire_bytes: That were sent, with what parted lists add.
        instructions_sent: As they were sent.
        last: The last of them; None: there is none.
    """

    def __init__(self) -> None:
        self.total_bytes: int | None = None
        self.total_instructions: int | None = None
        self.wire_bytes = 0
        self.instructions_sent = 0
        self.last: Instruction | None = None
        self._tracker = Tracker()
        self._job_bytes = 0
        self._taken: int | None = None
        self._ends: deque[int] = deque()
        """Where those end, on the wire, that are not known to be taken."""

    def note_sent(self, instructions: Iterable[Instruction]) -> None:
        """Take note of what was written."""
        for each in instructions:
            self.wire_bytes += len(each.data)
            self.instructions_sent += 1
            self._ends.append(self.wire_bytes)
            self._tracker.follow(each)
            self.last = each
        if self.last is not None:
            end = self.last.offset + len(self.last.data)
            self._job_bytes = max(self._job_bytes, end if self.total_bytes is None else min(end, self.total_bytes))

    def note_all_sent(self) -> None:
        """Take note that nothing of the job is left: blanks at its end are sent by leaving them out."""
        if self.total_bytes is not None:
            self._job_bytes = self.total_bytes

    def note_taken(self, wire_bytes: int | None) -> None:
        """Take note up to where the cutter has taken instructions out of its buffer."""
        if wire_bytes is None:
            return
        while self._ends and self._ends[0] <= wire_bytes:
            self._ends.popleft()
        self._taken = self.instructions_sent - len(self._ends)

    def note_all_taken(self) -> None:
        """Take note that its buffer is empty, and nothing was dropped."""
        self._ends.clear()
        self._taken = self.instructions_sent

    @property
    def job_bytes(self) -> int:
        """Up to where all of the job was sent."""
        return self._job_bytes

    @property
    def position_steps(self) -> tuple[float, float]:
        """Where the tool goes by what was sent last."""
        return self._tracker.position_steps

    @property
    def ends_in_mode_1(self) -> bool:
        """Whether what was sent last is of mode 1, where instructions of mode 2 are called with ``^``."""
        return self.last is not None and self.last.language is Language.ONE

    def account(self) -> CutAccount:
        """Say what is known."""
        last = self.last
        return CutAccount(
            bytes_sent=self._job_bytes,
            bytes_total=self.total_bytes,
            instructions_sent=self.instructions_sent,
            instructions_taken=self._taken,
            offset=None if last is None else last.place,
            line=None if last is None else last.line,
            column=None if last is None else last.column,
            position_steps=self.position_steps,
        )
