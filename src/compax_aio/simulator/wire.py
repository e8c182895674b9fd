"""What a host has written and has not arrived yet: bytes in time, which a modem line can stop."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from math import ceil, inf
from typing import Final

__all__ = ["Wire"]

_PART_OF_A_BYTE: Final = 1e-6
"""Times are sums, and not exact: what is missing less than that has arrived."""

_JOINED_BYTES: Final = 16_384
"""What has waited is sent in one piece if it is not more."""


@dataclass(slots=True)
class _Piece:
    data: bytes
    place: int
    """Of the byte that arrives next."""
    end: int
    """Of what is sent without a pause: data is not copied when the rest of it has to wait."""
    begins_at: float = 0.0
    """When the first byte of *data* began, or would have begun."""
    next_stop: dict[bytes, int] = field(default_factory=dict)

    def __len__(self) -> int:
        return self.end - self.place


class Wire:
    """
    One direction of a serial line; bytes go back to back, or all at once where they take no time.

    Args:
        byte_time_s: Of each byte; 0: none.
        overshoot_bytes: So many bytes still leave the host when it is stopped, besides the one that is under way.

    Attributes:
        is_stopped: The host is stopped, and what it has written waits with it.
        taken: How many bytes have arrived.
    """

    def __init__(self, byte_time_s: float, overshoot_bytes: int = 0) -> None:
        self.byte_time_s = byte_time_s
        self.is_stopped = False
        self._overshoot_bytes = overshoot_bytes
        self._pieces: deque[_Piece] = deque()
        self._waiting: deque[_Piece] = deque()
        self._free_at = 0.0
        self._bytes = 0
        self.taken = 0
        self._found: dict[bytes, tuple[int, int]] = {}

    def __len__(self) -> int:
        """Count the bytes that the host has written and have not arrived."""
        return self._bytes

    def write(self, data: bytes, now: float) -> None:
        """Take bytes of the host."""
        if not data:
            return
        self._bytes += len(data)
        piece = _Piece(data, 0, len(data))
        if self.is_stopped:
            self._waiting.append(piece)
        else:
            self._send(piece, now)

    def cut(self, now: float) -> int:
        """Lose what has not begun; returns how many bytes that were."""
        was_stopped = self.is_stopped
        self.stop(now)
        lost = sum(map(len, self._waiting))
        self._waiting.clear()
        self._bytes -= lost
        self._found.clear()
        self.is_stopped = was_stopped
        return lost

    def stop(self, now: float) -> None:
        """Let the host send no more: what has not begun waits, but for the overshoot."""
        self.is_stopped = True
        spare = self._overshoot_bytes
        pieces, self._pieces, self._free_at = self._pieces, deque(), now
        for piece in pieces:
            end, begun = piece.end, self._begun(piece, now)
            piece.end = min(end, begun + spare)
            spare -= piece.end - begun
            if piece.end < end:
                self._waiting.append(_Piece(piece.data, piece.end, end))
            if piece:
                self._pieces.append(piece)
                self._free_at = piece.begins_at + piece.end * self.byte_time_s

    def _begun(self, piece: _Piece, now: float) -> int:
        """Count the bytes of *piece* that have begun, or have arrived."""
        if not self.byte_time_s:
            return piece.place
        count = ceil((now - piece.begins_at) / self.byte_time_s - _PART_OF_A_BYTE)
        return max(piece.place, min(piece.end, count))

    def go_on(self, now: float) -> None:
        """Let the host send again."""
        self.is_stopped = False
        waiting, self._waiting = self._waiting, deque()
        if len(waiting) > 1 and sum(map(len, waiting)) <= _JOINED_BYTES:
            data = b"".join(each.data[each.place : each.end] for each in waiting)
            waiting = deque([_Piece(data, 0, len(data))])
        for each in waiting:
            self._send(each, now)

    # What arrives

    @property
    def next_at(self) -> float:
        """When the next byte arrives; infinite if none is under way."""
        if not self._pieces:
            return inf
        piece = self._pieces[0]
        return piece.begins_at + (piece.place + 1) * self.byte_time_s

    @property
    def ends_at(self) -> float:
        """When all has arrived that is under way."""
        return self._free_at

    def arrived(self, until: float) -> int:
        """Count the bytes of the first piece that have arrived until then."""
        if not self._pieces:
            return 0
        piece = self._pieces[0]
        if not self.byte_time_s:
            return len(piece) if piece.begins_at <= until else 0
        come = int((until - piece.begins_at) / self.byte_time_s + _PART_OF_A_BYTE) - piece.place
        return max(0, min(len(piece), come))

    def before(self, stops: bytes) -> int:
        """Count the bytes of the first piece in front of the first of *stops*, which are single characters."""
        return _before(self._pieces[0], stops)

    def take(self, count: int) -> bytes:
        """Take bytes of the first piece."""
        piece = self._pieces[0]
        begin = piece.place
        piece.place = end = begin + count
        self._bytes -= count
        self.taken += count
        if end == piece.end:
            self._pieces.popleft()
        return piece.data[begin:end]

    def at(self, count: int) -> float:
        """Return when byte number *count* from now, from 0 on, arrives; infinite if it is not under way."""
        for piece in self._pieces:
            left = len(piece)
            if count < left:
                return piece.begins_at + (piece.place + count + 1) * self.byte_time_s
            count -= left
        return inf

    def first(self, sign: bytes) -> int | None:
        """Return how many bytes the host has written in front of the first *sign*; None: there is none."""
        found, looked = self._found.get(sign, (-1, 0))
        taken = self.taken
        if found >= taken:
            return found - taken
        if looked == taken + self._bytes:
            return None
        found = -1
        begin = taken
        for piece in (*self._pieces, *self._waiting):
            end = begin + len(piece)
            if end > looked:
                place = piece.data.find(sign, piece.place + max(0, looked - begin), piece.end)
                if place >= 0:
                    found = begin + place - piece.place
                    break
            begin = end
        self._found[sign] = (found, found + 1 if found >= 0 else begin)
        return found - taken if found >= 0 else None

    def _send(self, piece: _Piece, now: float) -> None:
        begins_at = max(now, self._free_at)
        piece.begins_at = begins_at - piece.place * self.byte_time_s
        self._free_at = begins_at + len(piece) * self.byte_time_s
        self._pieces.append(piece)


def _before(piece: _Piece, stops: bytes) -> int:
    place = piece.place
    stop = piece.next_stop.get(stops, -1)
    if stop < place:
        found = [at for each in stops if (at := piece.data.find(each, place)) >= 0]
        stop = piece.next_stop[stops] = min(found, default=len(piece.data))
    return min(stop, piece.end) - place
