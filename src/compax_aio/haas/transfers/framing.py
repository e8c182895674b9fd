"""Where a file begins and ends in what comes: lines with a percent sign, in pieces of any size."""

from __future__ import annotations

import re
from typing import Final

__all__ = ["FileEnd", "FileStart"]

_ENDS: Final = b"\r\n"
_BLANKS: Final = b" \t\r\n"
_MOST_LEAD_BYTES: Final = 8
"""Of ends of blocks in front of the first percent sign, which controls send (OpenDNC: one LF)."""
_MOST_ENDS_BYTES: Final = 64
_WINDOW_BYTES: Final = 32

_PERCENT_LINE: Final = re.compile(rb"(?:\A|[\r\n])[ \t]*(%)")


class FileStart:
    """
    Finds the first line that begins with a percent sign.

    What stands in front of it is none of the file, but for the ends of blocks directly before it.
    """

    def __init__(self) -> None:
        self._ends = b""
        """Ends of blocks that came last."""
        self._is_first_end_of_text = False
        """Whether the first of them ends a line of something else."""
        self._is_in_line = False
        """Whether something else stands in the line already."""

    def find(self, data: bytes) -> tuple[bytes, bytes | None]:
        """
        Read *data*.

        Returns:
            What stands in front of the file, with the ends of blocks that belong to it too; and the file as far as it
            has come, None if it has not begun.
        """
        for match in _PERCENT_LINE.finditer(data):
            if data[match.start()] in _ENDS or not self._is_in_line:
                before = data[: match.start(1)]
                self._note(before)
                return before, self._lead() + data[match.start(1) :]
        self._note(data)
        return data, None

    def _note(self, data: bytes) -> None:
        text = data.rstrip(_BLANKS)
        ends = bytes(byte for byte in data[len(text) :] if byte in _ENDS)
        if text:
            self._ends, self._is_first_end_of_text = ends, True
        else:
            self._ends += ends
        if len(self._ends) > _MOST_ENDS_BYTES:
            self._ends, self._is_first_end_of_text = self._ends[-_MOST_ENDS_BYTES:], False
        if ends:
            self._is_in_line = False
        elif text:
            self._is_in_line = True

    def _lead(self) -> bytes:
        ends = self._ends
        if self._is_first_end_of_text:
            ends = ends[2:] if ends.startswith(b"\r\n") else ends[1:]
        return ends[-_MOST_LEAD_BYTES:]


class FileEnd:
    """Sees whether the last line that has anything is a percent sign alone, and not the one that a file begins with."""

    def __init__(self) -> None:
        self.is_closed = False
        """Whether it is; there may be blanks behind it, but nothing else has come."""
        self._first_line: bytes | None = b""
        """What has come of the line that the file begins with, ends of blocks in front of it; None: it is over."""
        self._window = b""
        """The end of what came behind it; all blanks at its end count as one."""

    def read(self, data: bytes) -> None:
        """Read the next piece of the file."""
        if self._first_line is not None:
            data = self._behind_first_line(data)
        window = self._window + data
        text = window.rstrip(_BLANKS)
        behind = window[len(text) :]
        self._window = text[-_WINDOW_BYTES:]
        if behind:
            self._window += b"\n" if behind.strip(b" \t") else b" "
        self.is_closed = text.endswith(b"%") and text[:-1].rstrip(b" \t").endswith((b"\r", b"\n"))

    def _behind_first_line(self, data: bytes) -> bytes:
        assert self._first_line is not None
        line = (self._first_line + data).lstrip(_BLANKS)
        for at, byte in enumerate(line):
            if byte in _ENDS:
                self._first_line = None
                return line[at:]
        self._first_line = line[:1]
        return b""
