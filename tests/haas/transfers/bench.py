"""A transfer on the bench: a line whose clock is turned by hand, and what went over it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from compax_aio.haas.transfers.account import Ending
from compax_aio.haas.transfers.strategy import Patience, Strategy
from compax_aio.link.contract import Event
from compax_aio.link.level import LineLevel

DC1, DC2, DC3, DC4 = b"\x11", b"\x12", b"\x13", b"\x14"
PATIENCE = Patience(start_s=120, body_s=30, tail_s=2, reader_off_s=5, drip_held_s=300)
RATE = 960.0
"""Bytes a second, at 9600 baud."""


class Bench:
    """
    Runs a transfer as the protocol does, with a line that sends at RATE, or nothing while :attr:`is_blocked`.

    Attributes:
        now_s: On its clock.
        written: What was written, and when.
        notes: What was told.
    """

    def __init__(self, strategy: Strategy, *, rate: float | None = RATE, reader_is_on: bool = False) -> None:
        self.strategy = strategy
        self.now_s = 0.0
        self.written: list[tuple[float, bytes]] = []
        self.most_unsent = 0
        self.notes: list[Event] = []
        self.foreign = b""
        self.is_blocked = False
        self._rate = rate
        self._unsent = 0.0
        self._deadline_s = 0.0
        strategy.begin(LineLevel(rate, lambda: -int(-self._unsent // 1)), self._write, reader_is_on=reader_is_on)
        self._deadline_s = strategy.pause_s
        self._take()

    def _write(self, data: bytes) -> None:
        self.written.append((self.now_s, data))
        if self._rate is not None:
            self._unsent += len(data)
        self.most_unsent = max(self.most_unsent, int(self._unsent))

    def _take(self) -> None:
        self.notes += self.strategy.take_notes()
        if self.strategy.take_moved():
            self._deadline_s = self.now_s + self.strategy.pause_s

    def _pass(self, seconds: float) -> None:
        self.now_s += seconds
        if self._rate is not None and not self.is_blocked:
            self._unsent = max(0.0, self._unsent - seconds * self._rate - 1e-9)

    @property
    def sent(self) -> bytes:
        """All that was written."""
        return b"".join(data for _, data in self.written)

    def come(self, *pieces: bytes) -> None:
        """Let *pieces* come."""
        for piece in pieces:
            self.foreign += self.strategy.receive(piece)
            self._take()

    def wait(self, seconds: float) -> None:
        """Let time pass, in which nothing comes."""
        end_s = self.now_s + seconds
        while self.strategy.ending is None and self._deadline_s <= end_s:
            self._pass(self._deadline_s - self.now_s)
            self.strategy.time_ran_out()
            self._deadline_s = self.now_s + self.strategy.pause_s
            self._take()
        self._pass(end_s - self.now_s)

    def wait_for_end(self, within_s: float = 4000) -> Ending:
        """Let time pass until it is over."""
        begun_s = self.now_s
        while self.strategy.ending is None:
            assert self.now_s - begun_s < within_s, f"it has not ended, in {self.strategy.phase}"
            self.wait(max(0.0, self._deadline_s - self.now_s))
        return self.strategy.ending


def in_pieces(data: bytes, cuts: Sequence[int]) -> list[bytes]:
    """Cut *data* at *cuts*."""
    places = sorted({0, len(data), *(cut % (len(data) + 1) for cut in cuts)})
    return [data[begin:end] for begin, end in pairwise(places)]
