"""What leaves a simulated control, and when: data that the host can stop, and signs that go ahead of them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import Final

__all__ = ["Transmitter"]

_MOST_UNTAKEN: Final = 64 * 1024 * 1024
"""As much as a control can send at once."""
_LUMP_BYTES: Final = 64
"""Whoever serves the control looks for output so often, at least."""
_PART_OF_A_BYTE: Final = 1e-6


@dataclass(slots=True)
class _Piece:
    data: bytes
    place: int
    not_before: float


@dataclass(frozen=True, slots=True)
class _Committed:
    """Bytes that nothing can hold any more."""

    data: bytes
    ends_at: float


class Transmitter:
    """
    The way to the host; bytes go back to back.

    Args:
        byte_time_s: Of each byte; 0: none.
        latency_bytes: So many bytes still leave when the host stops it, besides the one under way.
        form: Makes of data what travels.

    Attributes:
        is_held: The host has stopped it.
        pending_bytes: Data that has not left.
    """

    def __init__(self, byte_time_s: float, latency_bytes: int, form: Callable[[bytes], bytes]) -> None:
        self._byte_time_s = byte_time_s
        self._latency_bytes = latency_bytes
        self._form = form
        self._pending: deque[_Piece] = deque()
        self._committed: deque[_Committed] = deque()
        self._free_at = 0.0
        self._tail_at: float | None = None
        self._out = bytearray()
        self.is_held = False
        self.pending_bytes = 0

    # What is sent

    def send(self, data: bytes, not_before: float) -> None:
        """Send data behind what is being sent."""
        if data:
            if self._tail_at is not None:
                self._tail_at = max(self._tail_at, not_before) + len(data) * self._byte_time_s
            self._pending.append(_Piece(data, 0, not_before))
            self.pending_bytes += len(data)

    def sign(self, data: bytes, now: float) -> None:
        """Send a sign ahead of all data, though the host has stopped it."""
        self._run(now)
        self._commit_begun(now, 0)
        begins_at = max(now, self._committed[-1].ends_at if self._committed else now)
        self._tail_at = None
        self._free_at = begins_at + len(data) * self._byte_time_s
        self._committed.append(_Committed(data, self._free_at))

    def hold(self, now: float) -> None:
        """Stop, as the host wishes."""
        self._run(now)
        if not self.is_held:
            self._tail_at = None
            self._commit_begun(now, self._latency_bytes)
            self.is_held = True

    def release(self, now: float) -> None:
        """Go on."""
        self._run(now)
        if self.is_held:
            self.is_held = False
            self._tail_at = None
            self._free_at = max(self._free_at, now)

    def abort(self, now: float) -> int:
        """Drop what has not begun; returns how many bytes that were."""
        self._run(now)
        self._commit_begun(now, 0)
        dropped, self.pending_bytes = self.pending_bytes, 0
        self._pending.clear()
        self._tail_at = None
        return dropped

    def cut(self) -> None:
        """Lose everything that is not out, with the byte under way."""
        self._pending.clear()
        self._committed.clear()
        self.pending_bytes = 0
        self._tail_at = None
        self._free_at = 0.0
        self.is_held = False

    # What has come out

    @property
    def ends_at(self) -> float:
        """When all is out; infinite while the host has stopped it."""
        if self._pending and self.is_held:
            return inf
        if self._tail_at is None:
            at = self._free_at
            for piece in self._pending:
                at = max(at, piece.not_before) + (len(piece.data) - piece.place) * self._byte_time_s
            self._tail_at = at
        return self._tail_at

    def take(self, until: float) -> bytes:
        """Return what has come out."""
        self._run(until)
        out = bytes(self._out)
        self._out.clear()
        return out

    def next_at(self) -> float:
        """Return when something comes out next."""
        if self._out:
            return 0.0
        if self._committed:
            return self._committed[0].ends_at
        if not self._pending or self.is_held:
            return inf
        piece = self._pending[0]
        count = min(_LUMP_BYTES, len(piece.data) - piece.place)
        return max(self._free_at, piece.not_before) + count * self._byte_time_s

    def _run(self, until: float) -> None:
        while self._committed and self._committed[0].ends_at <= until:
            self._leave(self._committed.popleft().data)
        while self._pending and not self.is_held and not self._committed:
            piece = self._pending[0]
            begins_at = max(self._free_at, piece.not_before)
            count = self._done(begins_at, until, len(piece.data) - piece.place)
            if not count:
                break
            self._leave(piece.data[piece.place : piece.place + count])
            piece.place += count
            self.pending_bytes -= count
            self._free_at = begins_at + count * self._byte_time_s
            if piece.place < len(piece.data):
                break
            self._pending.popleft()

    def _done(self, begins_at: float, until: float, most: int) -> int:
        """Count the bytes that are whole by then."""
        if begins_at > until:
            return 0
        if not self._byte_time_s:
            return most
        return min(most, int((until - begins_at) / self._byte_time_s + _PART_OF_A_BYTE))

    def _commit_begun(self, now: float, more: int) -> None:
        """Let the byte that is under way leave in any case, and so many more."""
        if not self._byte_time_s or self.is_held:
            return
        for piece in self._pending:
            begins_at = max(self._free_at, piece.not_before)
            if begins_at >= now:
                return
            count = min(1 + more, len(piece.data) - piece.place)
            self._free_at = begins_at + count * self._byte_time_s
            data = piece.data[piece.place : piece.place + count]
            self._committed.append(_Committed(data, self._free_at))
            piece.place += count
            self.pending_bytes -= count
            break
        if self._pending and self._pending[0].place == len(self._pending[0].data):
            self._pending.popleft()

    def _leave(self, data: bytes) -> None:
        self._out += self._form(data)
        del self._out[:-_MOST_UNTAKEN]
