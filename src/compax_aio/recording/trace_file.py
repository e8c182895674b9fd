"""A trace on the disk: appended to, never larger than it may be, and whole up to any byte at which it is cut."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Final

from ..errors import InvalidCommandError
from ..escaping import shown
from ..link.taps import Closed, Fact, Lost, Opened
from ..text_file import expect_file, name_of
from .trace_entries import LONGEST_LINE, LineMade, SessionBegun, decoded, encoded

__all__ = ["SMALLEST_TRACE", "TraceFile", "older_file"]

SMALLEST_TRACE: Final = 64 * 1024
"""Bytes that a trace must be allowed to have."""

_HOW_TO_OPEN: Final = (
    os.O_RDWR
    | os.O_APPEND
    | os.O_CREAT
    | getattr(os, "O_NONBLOCK", 0)
    | getattr(os, "O_NOCTTY", 0)
    | getattr(os, "O_BINARY", 0)
)
_BEGINNING: Final = b'{"at":0.0,"what":"session"'
_LINE_END: Final = b"\n"

_fcntl: ModuleType | None = None
with suppress(ImportError):  # Windows has none, and there nobody is kept from writing to the same file
    _fcntl = import_module("fcntl")


def older_file(path: Path) -> Path:
    """Return where the older half of a trace is, when it was full."""
    return path.with_name(f"{path.name}.1")


class TraceFile:
    """
    A trace that is written; of one thread, for all that it does may take its time.

    When half of *max_bytes* is written, the file becomes ``<path>.1``, in place of an older one, and the session goes
    on in a new one, which can be read without the other. What is there already is appended to.

    Args:
        path: Of the file; a link is followed.
        max_bytes: Of both files together.
        begun: Begins the session.
    """

    def __init__(self, path: Path, max_bytes: int, begun: SessionBegun) -> None:
        self.path = path
        self._most_bytes = max_bytes // 2
        self._header = begun
        self._descriptor: int | None = None
        self._bytes = 0
        self._made: dict[str, LineMade] = {}

    def open(self) -> None:
        """
        Open the file, and begin the session.

        Raises:
            InvalidCommandError: There is something else than a trace, or *path* can be no name.
            OSError: It cannot be opened, or somebody else records to it.
        """
        try:
            self.path = Path(os.path.realpath(self.path))
            with suppress(FileNotFoundError):
                expect_file(self.path, self.path.stat())
            descriptor = os.open(self.path, _HOW_TO_OPEN, 0o666)
        except ValueError:
            raise InvalidCommandError(f"{shown(str(self.path))} can be no name of a file") from None
        try:
            expect_file(self.path, os.fstat(descriptor))  # it may have been replaced since
            self._keep_others_out(descriptor)
            self._bytes = os.fstat(descriptor).st_size
            self._expect_trace(descriptor)
            self._end_cut_line(descriptor)
        except BaseException:
            os.close(descriptor)
            raise
        self._descriptor = descriptor
        if self._bytes >= self._most_bytes:
            self._begin_new_file()
        else:
            self._put(self._beginning())

    def write(self, entries: Iterable[tuple[float, str, Fact]]) -> None:
        """
        Append *entries*, and hand them to the operating system.

        Raises:
            OSError: They could not be written, or not all of them; the next ones are tried anew.
        """
        try:
            if self._descriptor is None:  # it failed before
                self._header = replace(self._header, part=self._header.part + 1)
                self.open()
            lines: list[str] = []
            length = 0
            for at, line, fact in entries:
                self._keep_in_mind(line, fact)
                for text in encoded(at, line, fact):
                    if self._bytes + length + len(text) >= self._most_bytes and (length or self._bytes):
                        self._put(lines)
                        self._begin_new_file()
                        lines, length = [], 0
                    lines.append(text)
                    length += len(text) + 1
            self._put(lines)
        except OSError:
            self.close()
            raise

    def close(self) -> None:
        """Close the file; what was written stays."""
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is not None:
            with suppress(OSError):
                os.close(descriptor)

    def _put(self, lines: Iterable[str]) -> None:
        data = memoryview("".join(f"{line}\n" for line in lines).encode("ascii"))
        assert self._descriptor is not None
        while data:
            written = os.write(self._descriptor, data)
            self._bytes += written
            data = data[written:]

    def _begin_new_file(self) -> None:
        self.close()
        self.path.replace(older_file(self.path))
        self._header = replace(self._header, part=self._header.part + 1)
        self.open()

    def _beginning(self) -> Iterator[str]:
        yield from encoded(0.0, "", self._header)
        for line, made in self._made.items():
            yield from encoded(0.0, line, made)

    def _keep_in_mind(self, line: str, fact: Fact) -> None:
        """Know what a new file has to begin with: the lines that there are."""
        if isinstance(fact, LineMade):
            self._made[line] = fact
        elif isinstance(fact, Closed):
            self._made.pop(line, None)
        elif isinstance(fact, Opened | Lost) and line in self._made:
            self._made[line] = replace(self._made[line], is_open=isinstance(fact, Opened))

    # What is there already --------------------------------------------------------------------------------------------

    def _keep_others_out(self, descriptor: int) -> None:
        if _fcntl is not None:
            try:
                _fcntl.flock(descriptor, _fcntl.LOCK_EX | _fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise OSError(error.errno, "somebody else records to it", str(self.path)) from None

    def _expect_trace(self, descriptor: int) -> None:
        beginning = _read(descriptor, 0, LONGEST_LINE)
        first, end, _ = beginning.partition(_LINE_END)
        if (
            not end
            and len(first) < len(beginning) + 1
            and (_BEGINNING.startswith(first) or first.startswith(_BEGINNING))
        ):
            return  # empty, or cut within its first line
        try:
            entry = decoded(first.decode("latin-1"))
        except InvalidCommandError as error:
            raise self._no_trace(error.what) from error
        if not isinstance(entry.fact, SessionBegun):
            raise self._no_trace("it does not begin with a session")

    def _no_trace(self, why: str) -> InvalidCommandError:
        return InvalidCommandError(
            f"{name_of(self.path)} is there, and is no trace: {why}; nothing was written to it",
            hint="record to another file",
        )

    def _end_cut_line(self, descriptor: int) -> None:
        if self._bytes and _read(descriptor, self._bytes - 1, 1) != _LINE_END:
            self._bytes += os.write(descriptor, _LINE_END)


def _read(descriptor: int, at: int, count: int) -> bytes:
    os.lseek(descriptor, at, os.SEEK_SET)
    return os.read(descriptor, count)
