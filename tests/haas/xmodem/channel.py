"""Both ends of XMODEM and a line between them that damages bytes, in a time of its own."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import count

from compax_aio.haas.xmodem import XmodemReceiver, XmodemSender

__all__ = ["Channel", "Damage", "Fault"]

BYTE_S = 0.001
LATENCY_S = 0.002

Damage = Callable[[int], bytes]
"""What becomes of a byte on the line."""


@dataclass(frozen=True)
class Fault:
    """The byte at *at*, counted from the first that goes that way, becomes *becomes*: nothing, another, or several."""

    at: int
    becomes: Damage


@dataclass
class Channel:
    """Runs one transfer; ``run()`` returns when both ends are over."""

    sender: XmodemSender
    receiver: XmodemReceiver
    to_receiver: dict[int, Damage] = field(default_factory=dict)
    to_sender: dict[int, Damage] = field(default_factory=dict)
    now: float = 0.0
    steps: int = 0

    def __post_init__(self) -> None:
        self._numbers = count()
        self._coming: list[tuple[float, int, bool, int]] = []
        self._sent = {True: 0, False: 0}
        self._free_at = {True: 0.0, False: 0.0}
        self._alarm = {True: 0.0, False: 0.0}
        self.data = b""

    def run(self, most_steps: int = 400_000) -> None:
        self._write(self.sender.begin(), to_receiver=True)
        self._write(self.receiver.begin(), to_receiver=False)
        self._wind(True)
        self._wind(False)
        while not (self.sender.is_over and self.receiver.is_over):
            self.steps += 1
            assert self.steps < most_steps, "it never ends"
            self._step()
        self.data += self.receiver.take()

    def _step(self) -> None:
        ends = [(self._alarm[end], end) for end in (True, False) if not self._end(end).is_over]
        alarm_at, alarmed = min(ends)
        if self._coming and self._coming[0][0] <= alarm_at:
            self.now, _, to_receiver, byte = heapq.heappop(self._coming)
            self._arrive(bytes([byte]), to_receiver=to_receiver)
        else:
            self.now = alarm_at
            self._write(self._end(alarmed).time_ran_out(), to_receiver=not alarmed)
            self._wind(alarmed)

    def _arrive(self, data: bytes, *, to_receiver: bool) -> None:
        if to_receiver:
            self._write(self.receiver.receive(data), to_receiver=False)
            self.data += self.receiver.take()
        else:
            leaving = self._free_at[True] > self.now
            self._write(self.sender.receive(data, still_leaving=leaving), to_receiver=True)
        self._wind(to_receiver)

    def _end(self, is_receiver: bool) -> XmodemSender | XmodemReceiver:
        return self.receiver if is_receiver else self.sender

    def _wind(self, is_receiver: bool) -> None:
        leaves_at = max(self.now, self._free_at[not is_receiver])
        self._alarm[is_receiver] = leaves_at + self._end(is_receiver).patience_s

    def _write(self, data: bytes, *, to_receiver: bool) -> None:
        faults = self.to_receiver if to_receiver else self.to_sender
        at = max(self.now, self._free_at[to_receiver])
        for byte in self._spoilt(data, faults, to_receiver=to_receiver):
            at += BYTE_S
            heapq.heappush(self._coming, (at + LATENCY_S, next(self._numbers), to_receiver, byte))
        self._free_at[to_receiver] = at

    def _spoilt(self, data: bytes, faults: dict[int, Damage], *, to_receiver: bool) -> Iterator[int]:
        for byte in data:
            damage = faults.get(self._sent[to_receiver])
            self._sent[to_receiver] += 1
            yield from damage(byte) if damage is not None else bytes([byte])
