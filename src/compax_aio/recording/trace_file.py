"""A trace on the disk: appended to, never larger than it may be, and whole up to any byte at which it is cut."""

from __future__ import annotations

import errno
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
from ..text_file import expect_file, name_of, open_file
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
    on in a new one, which can be read without the other. So it does when somebody takes the file away, or empties it.
    What is there already is appended to.

    Args:
        path: Of the file; a link is followed.
        max_bytes: Of both files together.
        begun: Begins the session.
    """

    def __init__(self, path: Path, max_bytes: int, begun: SessionBegun) -> None:
        self.path = path
        self.taken = 0
        """How many entries of the last :meth:`write` stand in the file, also if it failed."""
        self._most_bytes = max_bytes // 2
        self._header = begun
        self._descriptor: int | None = None
        self._bytes = 0
        self._made: dict[str, LineMade] = {}

    def open(self) -> None:
        """
        Open the file, and begin the session.

        Raises:
            InvalidCommandError: There is something else than a trace, there or at ``<path>.1``, or *path* can be no
                name.
            OSError: It cannot be opened, or somebody else records to it.
        """
        try:
            self.path = Path(os.path.realpath(self.path))
            with suppress(FileNotFoundError):
                expect_file(self.path, self.path.stat())
        except ValueError:
            raise InvalidCommandError(f"{shown(str(self.path))} can be no name of a file") from None
        self._expect_older_trace()
        descriptor = os.open(self.path, _HOW_TO_OPEN, 0o666)
        try:
            expect_file(self.path, os.fstat(descriptor))  # it may have been replaced since
            self._keep_others_out(descriptor)
            self._bytes = os.fstat(descriptor).st_size
            _expect_trace(self.path, _read(descriptor, 0, LONGEST_LINE))
            self._end_cut_line(descriptor)
        except BaseException:
            os.close(descriptor)
            raise
        self._descriptor = descriptor
        is_full = self._bytes >= self._most_bytes
        self._put(self._beginning())  # there, too: or the session would seem to have lost its beginning
        if is_full:
            self._begin_new_file()

    def write(self, entries: Iterable[tuple[float, str, Fact]]) -> None:
        """
        Append *entries*, and hand them to the operating system.

        Raises:
            OSError: They could not be written, or not all of them, see :attr:`taken`; the next ones are tried anew.
            InvalidCommandError: What is there now is no trace.
        """
        self.taken = 0
        try:
            if self._descriptor is None or not self._is_as_left(self._descriptor):
                self._go_on_anew()
            batch: list[tuple[str, bool]] = []
            length = 0
            for at, line, fact in entries:
                self._keep_in_mind(line, fact)
                for text in encoded(at, line, fact):
                    if self._bytes + length + len(text) >= self._most_bytes:
                        self._put_entries(batch)
                        self._begin_new_file()
                        batch, length = [], 0
                    batch.append((text, False))
                    length += len(text) + 1
                batch[-1] = text, True
            self._put_entries(batch)
        except OSError:
            self.close()
            raise

    def close(self) -> None:
        """Close the file; what was written stays."""
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is not None:
            with suppress(OSError):
                if _fcntl is not None:  # a process that was forked from this one has it open, and would hold it
                    _fcntl.flock(descriptor, _fcntl.LOCK_UN)
                os.close(descriptor)

    def __del__(self) -> None:
        self.close()

    def _put_entries(self, batch: list[tuple[str, bool]]) -> None:
        """Append lines, each with whether an entry is whole by it."""
        before = self._bytes
        try:
            self._put(text for text, _ in batch)
        except OSError:
            left = self._bytes - before
            for text, is_whole in batch:
                left -= len(text) + 1
                self.taken += is_whole and left >= 0
            raise
        self.taken += sum(is_whole for _, is_whole in batch)

    def _put(self, lines: Iterable[str]) -> None:
        data = "".join(f"{line}\n" for line in lines).encode("ascii")
        assert self._descriptor is not None
        begin, written = self._bytes, 0
        try:
            while written < len(data):
                written += os.write(self._descriptor, memoryview(data)[written:])
        except OSError:  # half a line would stay, and another one of the next attempt behind it
            written = data.rfind(_LINE_END, 0, written) + 1
            with suppress(OSError):
                os.ftruncate(self._descriptor, begin + written)
            raise
        finally:
            self._bytes = begin + written

    def _is_as_left(self, descriptor: int) -> bool:
        """Whether what was written is still at *path*: nobody has removed, replaced, moved or emptied the file."""
        mine = os.fstat(descriptor)
        try:
            there = self.path.stat()
        except FileNotFoundError:
            return False
        return os.path.samestat(mine, there) and mine.st_size >= self._bytes

    def _begin_new_file(self) -> None:
        self.close()
        with suppress(FileNotFoundError):  # somebody has taken it away
            self.path.replace(older_file(self.path))
        self._go_on_anew()

    def _go_on_anew(self) -> None:
        self.close()
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
                if os.path.samestat(os.fstat(descriptor), self.path.stat()):
                    return
            except BlockingIOError:
                pass
            # Or it was moved away in this moment, by whoever has just filled it.
            raise OSError(errno.EAGAIN, "somebody else records to it", str(self.path))

    def _expect_older_trace(self) -> None:
        """Raise if what the older half would replace is something else."""
        older = older_file(self.path)
        with suppress(FileNotFoundError), open_file(older) as file:
            _expect_trace(older, file.read(LONGEST_LINE))

    def _end_cut_line(self, descriptor: int) -> None:
        if self._bytes and _read(descriptor, self._bytes - 1, 1) != _LINE_END:
            self._bytes += os.write(descriptor, _LINE_END)


def _expect_trace(path: Path, beginning: bytes) -> None:
    """Raise InvalidCommandError unless *beginning*, that of the file at *path*, is of a trace, or there is none."""
    first, end, _ = beginning.partition(_LINE_END)
    is_cut = not end and len(first) < LONGEST_LINE
    if is_cut and (_BEGINNING.startswith(first) or first.startswith(_BEGINNING)):
        return  # empty, or cut within its first line
    try:
        entry = decoded(first.decode("latin-1"))
    except InvalidCommandError as error:
        raise _no_trace(path, error.what) from error
    if not isinstance(entry.fact, SessionBegun):
        raise _no_trace(path, "it does not begin with a session")


def _no_trace(path: Path, why: str) -> InvalidCommandError:
    return InvalidCommandError(
        f"{name_of(path)} is there, and is no trace: {why}; nothing was written to it", hint="record to another file"
    )


def _read(descriptor: int, at: int, count: int) -> bytes:
    os.lseek(descriptor, at, os.SEEK_SET)
    return os.read(descriptor, count)
