"""Whole instructions, handed out by as many bytes as there is room for."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

from .instruction import Instruction

__all__ = ["Supply"]


class Supply:
    """Instructions that wait to be sent; whoever sends takes as many as fit, and never a part of one."""

    def __init__(self, instructions: Iterable[Instruction] = ()) -> None:
        self._waiting: deque[Instruction] = deque()
        self._bytes = 0
        self.add(instructions)

    def add(self, instructions: Iterable[Instruction]) -> None:
        """Put more behind those that wait."""
        for each in instructions:
            self._waiting.append(each)
            self._bytes += len(each.data)

    @property
    def waiting_bytes(self) -> int:
        """How many bytes wait in all."""
        return self._bytes

    @property
    def next_bytes(self) -> int | None:
        """How many bytes the next instruction takes; None if none waits."""
        return len(self._waiting[0].data) if self._waiting else None

    def __len__(self) -> int:
        """How many instructions wait."""
        return len(self._waiting)

    def take(self, room_bytes: int) -> list[Instruction]:
        """Take as many whole instructions as *room_bytes* hold; none if the next one is too long."""
        taken = []
        while self._waiting and len(self._waiting[0].data) <= room_bytes:
            each = self._waiting.popleft()
            room_bytes -= len(each.data)
            self._bytes -= len(each.data)
            taken.append(each)
        return taken

    def drop(self) -> int:
        """Forget all that waits; return how many instructions that was."""
        count = len(self._waiting)
        self._waiting.clear()
        self._bytes = 0
        return count
