"""Files that come as they are, between percent signs: with RTS/CTS, Xon/Xoff, and DC codes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from ..facts.characters import CARRIAGE_RETURN, DC1, DC2, DC3, DC4, DELETE, LINE_FEED, NUL
from .account import Ending, LineAccount, Phase
from .framing import FileEnd, FileStart
from .notes import TransferBegan
from .strategy import Patience, Strategy

__all__ = ["ReceiveFile"]

_NO_PART_OF_IT: Final = bytes((NUL, DC1, DC2, DC3, DC4, DELETE))
"""Signs of the handshake, and blank tape."""
_BEHIND_DC4_S: Final = 0.3
"""Nothing but blank tape comes behind DC4, unless another file does."""
_MOST_OFFSETS: Final = 100
_MOST_PRINTS: Final = 8
"""So often the operator has his time anew because what looked like a beginning was printed."""
_MOST_TAIL_BYTES: Final = 4096
"""So much blank tape behind the file is waited for."""
_BLANKS: Final = b" \t\r\n"
_ONLY_PERCENT: Final = (
    "nothing but a % came: was SEND pressed before this listened, so that it is the end of a file whose beginning is "
    "lost?"
)


class ReceiveFile(Strategy):
    """
    Receives a file that the control sends by itself, as soon as the operator presses SEND.

    It begins with the first line that begins with a percent sign, and ends when a line with a percent sign alone is
    behind, and then silence. DC2 and DC4 around it are expected by nobody and heeded by all: DC4 makes the silence
    short. What is handed on is the file byte for byte, without the signs of the handshake and without blank tape.
    Where such a sign stands in the middle of the file, it may have been another character once, and is told.

    Args:
        label: See :class:`Strategy`.
        patience: See :class:`Strategy`.
        sink: Called with each piece of the file, in order.
        max_bytes: A file that is larger is not received to its end.

    Attributes:
        is_closed: Whether the last line that has come, and has anything, is a percent sign.
    """

    sends = False

    def __init__(self, label: str, patience: Patience, sink: Callable[[bytes], None], *, max_bytes: int) -> None:
        super().__init__(label, patience)
        self._sink = sink
        self._max_bytes = max_bytes
        self._start = FileStart()
        self._file_end = FileEnd()
        self._bytes = self._carriage_returns = self._line_feeds = self._dropped = 0
        self._has_dc2 = self._has_dc4 = False
        self._prints = self._tail_bytes = 0
        self._text_bytes = 0
        """Of the file, blanks and ends of blocks left out."""
        self._signs_inside = 0
        self._sign_offsets: list[int] = []
        self._damaged = 0
        self._damage_offsets: list[int] = []

    @property
    def is_closed(self) -> bool:
        """Whether the last line that has come, and has anything, is a percent sign."""
        return self._file_end.is_closed

    @property
    def pause_s(self) -> float:
        """How long nothing may come."""
        if self.phase is Phase.WAIT_START:
            return self.patience.body_s if self._has_dc2 else self.patience.start_s
        if self.phase is Phase.TAIL:
            is_short = self._has_dc4 and self.is_closed
            return min(_BEHIND_DC4_S, self.patience.tail_s) if is_short else self.patience.tail_s
        return self.patience.body_s

    def receive(self, data: bytes) -> bytes:
        """Read *data*; return what stands in front of the file."""
        text = data.translate(None, _NO_PART_OF_IT)
        if len(text) == len(data):
            return self._read(text)
        # In order, for what comes behind DC4 is another file's.
        foreign = b""
        begin = 0
        for at, byte in enumerate(data):
            if byte in _NO_PART_OF_IT:
                foreign += self._read(data[begin:at])
                begin = at + 1
                self._dropped += 1
                self._note_inside()
                self._heed(byte)
        return foreign + self._read(data[begin:])

    def _note_inside(self) -> None:
        """Take note of a sign where none should be: it may have been a character of the file, which is lost then."""
        if self.phase is Phase.BODY:
            self._signs_inside += 1
            if len(self._sign_offsets) < _MOST_OFFSETS:
                self._sign_offsets.append(self._bytes)

    def _heed(self, sign: int) -> None:
        if sign == DC2 and self.phase is Phase.WAIT_START:
            if self._prints < _MOST_PRINTS:
                self._has_dc2 = self._has_moved = True
        elif sign == DC4 and self.phase is Phase.WAIT_START:
            self._forget_dc2()
        elif sign == DC4 and self.phase is not Phase.DONE:
            self._has_dc4 = True
            self._enter(Phase.TAIL)

    def _forget_dc2(self) -> None:
        """Take note that no file has begun, but what a program prints behind POPEN: the operator has his time anew."""
        if self._has_dc2:
            self._has_dc2 = False
            self._prints += 1
            self._has_moved = True

    def _read(self, data: bytes) -> bytes:
        if not data or self.ending is not None:
            return data
        if self.phase is not Phase.WAIT_START:
            self._take(data)
            return b""
        foreign, begun = self._start.find(data)
        if foreign.strip(_BLANKS):
            self._forget_dc2()
        if begun is not None:
            self._notes.append(TransferBegan(self.label))
            self._enter(Phase.BODY)
            self._take(begun)
        return foreign

    def _take(self, data: bytes) -> None:
        if self._bytes + len(data) > self._max_bytes:
            self._end(Ending.TOO_LARGE)
            return
        self._bytes += len(data)
        self._carriage_returns += data.count(CARRIAGE_RETURN)
        self._line_feeds += data.count(LINE_FEED)
        self._file_end.read(data)
        is_more = bool(data.strip())
        if is_more:
            self._has_dc4 = False  # what looked like one was noise, or it was that of another file
            self._text_bytes += len(data.translate(None, _BLANKS))
        self._tail_bytes = 0 if is_more else self._tail_bytes + len(data)
        if self._file_end.is_closed:
            if self.phase is not Phase.TAIL or self._tail_bytes <= _MOST_TAIL_BYTES:
                self._enter(Phase.TAIL)
        elif self.phase is Phase.BODY or is_more:
            self._enter(Phase.BODY)
        self._sink(data)

    def note_damage(self) -> None:
        """Take note that the byte that is received next is damaged."""
        if self.phase in {Phase.BODY, Phase.TAIL}:
            self._damaged += 1
            if len(self._damage_offsets) < _MOST_OFFSETS:
                self._damage_offsets.append(self._bytes)

    def time_ran_out(self) -> None:
        """Take note of silence: it is over, well or not."""
        if self.phase is Phase.TAIL:
            self._end(Ending.COMPLETE)
        elif self.phase is Phase.BODY or self._has_dc2:
            self._end(Ending.WENT_SILENT)
        else:
            self._end(Ending.NOT_STARTED)

    def account(self) -> LineAccount:
        """Say how much of the file has come."""
        return LineAccount(
            label=self.label,
            sends=False,
            phase=self._ended_in if self.ending is not None else self.phase,
            ending=self.ending,
            bytes=self._bytes,
            lines=max(self._carriage_returns, self._line_feeds),
            damage_offsets=tuple(self._damage_offsets),
            damaged_bytes=self._damaged,
            has_dc2=self._has_dc2,
            has_dc4=self._has_dc4,
            is_closed=self.is_closed,
            dropped_bytes=self._dropped,
            signs_inside=self._signs_inside,
            sign_offsets=tuple(self._sign_offsets),
            detail=_ONLY_PERCENT if self.ending is not None and self._text_bytes == 1 else "",
        )
