"""Whether a file that arrives has begun and ended, told while its bytes come, in pieces of any size."""

from __future__ import annotations

from typing import Final

from .lines import SKIPPED

__all__ = ["Recogniser"]

_BLANK: Final = b""
_PERCENT: Final = b"%"
_OTHER: Final = b"x"
_NAMES: Final = (b"O", b"o")


class Recogniser:
    r"""
    Follows a file by its ``%`` lines; keeps a few numbers and one byte of it, however long it is.

    A ``%`` counts when it is alone in its line; leader and punch codes beside it are nothing. That of a line which has
    not ended yet counts as well, for the last end of line may be missing. So what has ended may turn out to go on:
    only silence makes it sure (sheet, section 11).

    Attributes:
        offset: How many bytes have come.
        lines: How many lines have ended; CR LF ends one.
        programs: How many lines have begun with ``O`` behind the first ``%``.

    >>> recogniser = Recogniser()
    >>> for piece in (b"\n%", b"\nO1\nM3", b"0\n%"):
    ...     recogniser.feed(piece)
    >>> recogniser.has_begun, recogniser.has_ended, recogniser.lines
    (True, True, 4)
    """

    __slots__ = ("_after_return", "_is_within", "_line", "_percents", "lines", "offset", "programs")

    def __init__(self) -> None:
        self.offset = 0
        self.lines = 0
        self.programs = 0
        self._percents = 0
        self._is_within = False
        self._line = _BLANK
        self._after_return = False

    @property
    def percents(self) -> int:
        """How many ``%`` lines have come."""
        return self._percents + (self._line is _PERCENT)

    @property
    def has_begun(self) -> bool:
        """Whether a ``%`` line has come."""
        return self.percents > 0

    @property
    def has_ended(self) -> bool:
        """Whether the last line that holds anything is ``%``, and not the first one."""
        if self.percents < 2 or self._line is _OTHER:
            return False
        return self._line is _PERCENT or not self._is_within

    def feed(self, piece: bytes) -> None:
        """Take the next bytes, as many as have come."""
        if not piece:
            return
        ends = piece.count(b"\r") + piece.count(b"\n") - piece.count(b"\r\n")
        self.lines += ends - (self._after_return and piece.startswith(b"\n"))
        self.offset += len(piece)
        self._after_return = piece.endswith(b"\r")
        pieces = (self._line + piece).splitlines()
        unfinished = b"" if piece.endswith((b"\r", b"\n")) else pieces.pop()
        for line in pieces:
            self._take_line(line.strip(SKIPPED))
        self._line = self._kind_of(unfinished.strip(SKIPPED))

    def _take_line(self, line: bytes) -> None:
        kind = self._kind_of(line)
        if kind is _PERCENT:
            self._percents += 1
            self._is_within = False
        elif kind is _OTHER:
            self._is_within = True

    def _kind_of(self, line: bytes) -> bytes:
        """Return what stands for a line from now on: a name is counted once, at its first byte."""
        if not line:
            return _BLANK
        if line == _PERCENT:
            return _PERCENT
        if self._percents and line.startswith(_NAMES):
            self.programs += 1
        return _OTHER
