"""The cable between a host and a simulated device: bytes on it come late, in pieces, damaged, twice or not at all."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal

from compax_aio.compax.facts.line import COMMAND_END

__all__ = ["Cable", "Direction", "Tamper", "TamperKind", "Way"]

Direction = Literal["to_drive", "to_host"]

TamperKind = Literal["lose", "garble", "flip", "double", "insert", "cut", "lose_end"]

_MOTION_BEGINS: Final = (b"P", b"!")


@dataclass(slots=True)
class Tamper:
    """Something that will be done to bytes of one direction, once."""

    direction: Direction
    kind: TamperKind
    skip: int = 0
    """So many bytes pass before."""
    count: int = 1
    """How many bytes are lost, garbled or doubled."""
    data: bytes = b""
    """What is inserted."""


class Cable:
    """
    What befalls bytes on one line, whoever is connected.

    Attributes:
        delay_s: By direction: how much later bytes arrive; those behind them wait.
        piece: The most bytes that are handed on at once; None: as they come.
        piece_gap_s: Between two pieces of what came as one.
        vanishing: Half open: bytes vanish both ways, and nobody is told.
    """

    def __init__(self) -> None:
        self.delay_s: dict[Direction, float] = {"to_drive": 0.0, "to_host": 0.0}
        self.piece: int | None = None
        self.piece_gap_s = 0.0
        self.vanishing = False
        self._tampers: list[Tamper] = []

    # Whoever wants to know has a cable of a kind of their own.

    def note(self, what: str) -> None:
        """Take note of something that befell the line."""

    def cut(self) -> None:
        """Take note that the connection ends behind what has arrived."""

    @property
    def is_usual(self) -> bool:
        """Whether nothing is done to bytes now."""
        return not (self._tampers or self.vanishing or self.piece or any(self.delay_s.values()))

    def add(self, tamper: Tamper) -> None:
        """Let something happen to the bytes that come next."""
        self._tampers.append(tamper)

    def heal(self) -> None:
        """End what is done to bytes, but for a line that is half open."""
        self._tampers.clear()
        self.delay_s = {"to_drive": 0.0, "to_host": 0.0}
        self.piece = None
        self.piece_gap_s = 0.0

    def tampered(self, direction: Direction, data: bytes) -> tuple[bytes, bool]:
        """Do to *data* what is due; also say whether the connection is cut behind it."""
        if not self._tampers:
            return data, False
        for tamper in [each for each in self._tampers if each.direction == direction]:
            if tamper.kind == "lose_end":
                if data.startswith(_MOTION_BEGINS) and data.endswith(COMMAND_END):
                    self._spend(tamper)
                    data = data.removesuffix(COMMAND_END)
            elif tamper.skip >= len(data):
                tamper.skip -= len(data)
            else:
                self._spend(tamper)
                at = tamper.skip
                if tamper.kind == "cut":
                    return data[:at], True
                data = data[:at] + _changed(tamper, data[at : at + tamper.count]) + data[at + tamper.count :]
        return data, False

    def _spend(self, tamper: Tamper) -> None:
        self._tampers.remove(tamper)
        self.note(f"{tamper.kind} {tamper.direction}")


def _flipped(byte: int) -> int:
    """Make another digit, letter or sign of one, as two wrong bits do where nobody checks parity."""
    return byte ^ 1 if chr(byte).isalnum() and chr(byte ^ 1).isalnum() else byte


def _changed(tamper: Tamper, data: bytes) -> bytes:
    if tamper.kind == "garble":
        return bytes(byte | 0x80 for byte in data)  # a parity or framing error
    if tamper.kind == "flip":
        return bytes(_flipped(byte) for byte in data)
    if tamper.kind == "double":
        return data + data
    return tamper.data + data if tamper.kind == "insert" else b""


class Way:
    """
    One connection over a cable: hands bytes on, as fast or slowly as the cable lets them.

    Args:
        cable: What befalls them.
        deliver: Called with what has arrived.
        cut: Called when the connection is cut behind what was delivered last.
    """

    def __init__(self, cable: Cable, deliver: Callable[[Direction, bytes], None], cut: Callable[[], None]) -> None:
        self._cable = cable
        self._deliver_to = deliver
        self._cut = cut
        self._loop = asyncio.get_running_loop()
        self._is_over = False
        self._waiting: dict[Direction, deque[bytes]] = {"to_drive": deque(), "to_host": deque()}
        self._open_at: dict[Direction, float] = {"to_drive": 0.0, "to_host": 0.0}

    def end(self) -> None:
        """Deliver nothing more: what is on its way is lost."""
        self._is_over = True

    def hand_on(self, direction: Direction, data: bytes) -> None:
        """Take bytes at one end, for the other one."""
        if self._is_over:
            return
        cable = self._cable
        if cable.is_usual and not self._waiting[direction]:
            self._deliver(direction, data)
            return
        if cable.vanishing:
            cable.note(f"vanished {direction}")
            return
        data, is_cut = cable.tampered(direction, data)
        piece = cable.piece or len(data) or 1
        for begin in range(0, len(data), piece):
            self._later(direction, data[begin : begin + piece], cable.piece_gap_s if begin else 0.0)
        if is_cut:
            self._later(direction, b"", 0.0)

    def _later(self, direction: Direction, data: bytes, gap_s: float) -> None:
        """Hand *data* on when its time has come; a line that is not in trouble does so at once."""
        cable, waiting, now = self._cable, self._waiting[direction], self._loop.time()
        at = now + cable.delay_s[direction] * (1 if cable.piece is None else 0.25)
        if not waiting and at <= now and cable.piece is None:
            self._deliver(direction, data)
            return
        self._open_at[direction] = max(at, self._open_at[direction] + gap_s)
        waiting.append(data)
        self._loop.call_at(self._open_at[direction], self._deliver_next, direction)

    def _deliver_next(self, direction: Direction) -> None:
        if self._waiting[direction]:
            self._deliver(direction, self._waiting[direction].popleft())

    def _deliver(self, direction: Direction, data: bytes) -> None:
        if self._is_over:
            return
        if data:
            self._deliver_to(direction, data)
        else:
            self._cable.note("cut")
            self._cut()
