"""Output that a terminal or pipe does not take: it waits in a thread, while the event loop, and every stop, goes on."""

from __future__ import annotations

import errno
import os
import select
import stat
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from io import TextIOBase, TextIOWrapper
from pathlib import Path
from typing import Any, Final

__all__ = ["Outlet", "is_held_up", "outlets_open", "until_written"]

_MOST_WAITING: Final = 1024 * 1024
"""Bytes that nobody has taken yet; with more, writing fails, as it does where nobody reads."""

_HELD_UP: Final = 8 * 1024
"""So many bytes wait only where nobody takes them: a picture more would be of no use to anybody."""

_LAST_WORDS_S: Final = 1.0
_PAUSE_S: Final = 0.05


class _Writer:
    """One thread that writes, in order, what is handed to it for one terminal, pipe or socket."""

    def __init__(self) -> None:
        self._news = threading.Condition()  # reentrant: a signal may come in the middle, and have something to say
        self._waiting: deque[tuple[int, bytes]] = deque()
        self._failures: dict[int, OSError] = {}
        self.size = 0
        """Bytes that wait, those that are being written included."""
        threading.Thread(target=self._run, name="compax output", daemon=True).start()

    def write(self, descriptor: int, data: bytes) -> None:
        """Take *data* without waiting."""
        with self._news:
            self.check(descriptor)
            if self.size + len(data) > _MOST_WAITING:
                raise OSError(errno.ENOBUFS, "nobody takes what is written here")
            self._waiting.append((descriptor, data))
            self.size += len(data)
            self._news.notify_all()

    def check(self, descriptor: int) -> None:
        """Raise why nothing more can be written there, if something could not."""
        if (failure := self._failures.get(descriptor)) is not None:
            raise OSError(*failure.args)  # Python makes a BrokenPipeError of it where it is one

    def until_written(self, timeout_s: float | None = None) -> None:
        """Wait until nothing waits; a signal that comes meanwhile is heeded."""
        with self._news:
            self._news.wait_for(lambda: not self.size, timeout_s)

    def _run(self) -> None:
        while True:
            with self._news:
                self._news.wait_for(lambda: self._waiting)
                descriptor, data = self._waiting.popleft()
            try:
                if descriptor not in self._failures:
                    _write_all(descriptor, data)
            except OSError as error:
                self._failures[descriptor] = error
            finally:
                with self._news:
                    self.size -= len(data)
                    self._news.notify_all()


def _write_all(descriptor: int, data: bytes) -> None:
    rest = memoryview(data)
    while rest:
        try:
            rest = rest[os.write(descriptor, rest) :]
        except BlockingIOError:  # somebody has made it one that does not wait
            select.select([], [descriptor], [], _PAUSE_S)


class Outlet(TextIOBase):
    """
    A stream of text that never waits for whoever reads it.

    Args:
        stream: In whose place it stands.
        writer: That does the waiting.
    """

    def __init__(self, stream: TextIOWrapper, writer: _Writer) -> None:
        super().__init__()
        self._stream = stream
        self._writer = writer
        self._descriptor = stream.fileno()

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """Of the stream in whose place it stands."""
        return self._stream.encoding

    @property
    def errors(self) -> str | None:  # type: ignore[override]
        """What becomes of characters that the encoding does not have."""
        return self._stream.errors

    @property
    def is_held_up(self) -> bool:
        """Whether more waits than a moment brings: nobody takes it."""
        return self._writer.size > _HELD_UP

    def write(self, text: str, /) -> int:
        """
        Take *text* without waiting.

        Raises:
            OSError: Something before could not be written, or more waits than is kept.
        """
        self._writer.write(self._descriptor, text.encode(self.encoding, self.errors or "strict"))
        return len(text)

    def flush(self) -> None:
        """Raise why something could not be written, as far as that is known; waits for nothing."""
        self._writer.check(self._descriptor)

    def until_written(self, timeout_s: float | None = None) -> None:
        """Wait until all that was taken is written, or cannot be."""
        self._writer.until_written(timeout_s)

    def writable(self) -> bool:
        """Say yes."""
        return True

    def isatty(self) -> bool:
        """Whether it leads to a terminal."""
        return self._stream.isatty()

    def fileno(self) -> int:
        """Return the descriptor that it leads to."""
        return self._descriptor


def is_held_up(stream: Any) -> bool:
    """Whether *stream* leads to somebody who does not take what is written, so that a picture can be left out."""
    return isinstance(stream, Outlet) and stream.is_held_up


def until_written(stream: Any, timeout_s: float | None = None) -> None:
    """Wait until all that *stream* took is written, or cannot be, or time is over; a signal is heeded meanwhile."""
    if isinstance(stream, Outlet):
        stream.until_written(timeout_s)


@contextmanager
def outlets_open(is_in_a_hurry: Callable[[], bool]) -> Iterator[None]:
    """
    Let standard output and error never hold up this process during a block; then wait until all is written.

    Files on disk are left as they are: they take what they get.

    Args:
        is_in_a_hurry: Says at the end whether to wait only for a moment, because the process was told to end.
    """
    before = {name: getattr(sys, name) for name in ("stdout", "stderr", "__stderr__")}
    outlets = _outlets_for({name: before[name] for name in ("stdout", "stderr")})
    for name, outlet in outlets.items():
        with suppress(OSError):
            before[name].flush()
        setattr(sys, name, outlet)
        if name == "stderr" and before["__stderr__"] is before["stderr"]:
            sys.__stderr__ = outlet  # type: ignore[misc,assignment]  # where the screen of the monitor goes
    try:
        yield
    finally:
        for name, stream in before.items():
            setattr(sys, name, stream)
        with suppress(KeyboardInterrupt):  # whoever cannot wait for it
            for outlet in outlets.values():
                outlet.until_written(_LAST_WORDS_S if is_in_a_hurry() else None)


def _outlets_for(streams: dict[str, Any]) -> dict[str, Outlet]:
    """Make one for each stream that can be held up; two that lead to the same terminal stay in order."""
    writers: dict[tuple[int, ...], _Writer] = {}
    outlets = {}
    for name, stream in streams.items():
        if (key := _whose_pace(stream)) is not None:
            if key not in writers:
                writers[key] = _Writer()
            outlets[name] = Outlet(stream, writers[key])
    return outlets


def _whose_pace(stream: Any) -> tuple[int, ...] | None:
    """Return what tells apart those who set the pace of a stream; None where nobody can hold it up."""
    if not isinstance(stream, TextIOWrapper) or os.name == "nt":
        return None
    with suppress(OSError, ValueError):
        told = os.fstat(stream.fileno())
        is_nobody = os.path.samestat(told, Path(os.devnull).stat())
        if not is_nobody and (stat.S_ISCHR(told.st_mode) or stat.S_ISFIFO(told.st_mode) or stat.S_ISSOCK(told.st_mode)):
            return told.st_dev, told.st_ino, told.st_rdev
    return None
