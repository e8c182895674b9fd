"""Recording conversations: all that goes over lines which are opened in a block, written beside the event loop."""

from __future__ import annotations

import asyncio
import errno
import logging
from collections import deque
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager, suppress
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any, Final

from ..errors import InvalidCommandError
from ..link.cancellation import despite_cancellation
from ..link.taps import TAPS, Ended, Fact, LineTap, Noticed, Received, Sent
from ..text_file import name_of
from .own_thread import OwnThread
from .trace_entries import LineMade, Missing, SessionBegun, SessionEnded
from .trace_file import SMALLEST_TRACE, TraceFile

__all__ = ["DEFAULT_MAX_BYTES", "TraceRecorder", "record_trace"]

DEFAULT_MAX_BYTES: Final = 64 * 1024 * 1024
"""Of a trace: about an hour of one 9600-baud line that is never idle."""

_GATHERED_S: Final = 0.1
"""For so long entries are gathered before they are written: what a crash may cost."""
_MANY: Final = 2_000
"""So many entries are written at once."""
_MOST_WAITING: Final = 20_000
_MOST_BYTES_WAITING: Final = 4 * 1024 * 1024
_OPENING_S: Final = 10.0
_ENDING_S: Final = 5.0

_log = logging.getLogger("compax_aio.recording")


class TraceRecorder:
    """
    Writes what it is told by lines; made by :func:`record_trace`.

    Attributes:
        missing: Entries that were not written, because the disk did not take them fast enough, or at all.
        error: Why the disk did not take the last ones; None if it did.
    """

    def __init__(self, file: TraceFile) -> None:
        self.missing = 0
        self.error: OSError | None = None
        self._file = file
        self._loop = asyncio.get_running_loop()
        self._begun_at = self._loop.time()
        self._thread = OwnThread("compax_aio trace")
        self._waiting: deque[tuple[float, str, Fact]] = deque()
        self._bytes_waiting = 0
        self._missing_here = 0
        self._names: dict[str, int] = {}
        self._is_over = False
        self._timer: asyncio.TimerHandle | None = None
        self._writing: asyncio.Future[None] | None = None

    @property
    def path(self) -> Path:
        """Where the trace is; the older half of one that was full is at ``<path>.1``."""
        return self._file.path

    async def open(self) -> None:
        """Open the file; see :meth:`TraceFile.open` for errors."""
        try:
            async with asyncio.timeout(_OPENING_S):
                await self._loop.run_in_executor(self._thread, self._file.open)
        except TimeoutError:
            self._close_file()
            raise TimeoutError(
                errno.ETIMEDOUT, f"the disk has not opened it within {_OPENING_S:g} s", str(self.path)
            ) from None
        except BaseException:
            self._close_file()
            raise

    def line(self, name: str, about: Mapping[str, object]) -> LineTap:
        """Listen to a line that is made; see :data:`~compax_aio.link.taps.Tap`."""
        if asyncio.get_running_loop() is not self._loop:
            _log.warning("%s is not recorded: it is in another event loop than its recording", name)
            return lambda _: False
        if self._is_over:
            return lambda _: False
        called = self._name_of_its_own(name)
        more: dict[str, Any] = dict(about)
        self._take(called, LineMade(str(more.pop("device", "")), about=more or None))
        return partial(self._take, called)

    def _name_of_its_own(self, name: str) -> str:
        """Return *name*, or ``name (2)`` and so on, whichever no other line has had."""
        called = name = name or "unnamed"
        while called in self._names:
            self._names[name] = count = self._names[name] + 1
            called = f"{name} ({count})"
        self._names[called] = 1
        return called

    async def close(self) -> None:
        """Write what waits, within a few seconds; a disk that takes longer than that is not waited for."""
        if self._is_over:
            return
        now = self._loop.time() - self._begun_at
        if self._missing_here:
            self._waiting.append((now, "", Missing(self._missing_here)))
        self._waiting.append((now, "", SessionEnded()))
        self._is_over = True
        if self._timer is not None:
            self._timer.cancel()
        await despite_cancellation(self._finish())
        if self.missing:
            _log.error("%s: %d entries are missing in the trace", name_of(self.path), self.missing)

    async def _finish(self) -> None:
        with suppress(TimeoutError):
            async with asyncio.timeout(_ENDING_S):
                self._hand_over()
                while self._writing is not None:
                    await asyncio.wait([self._writing])
                    self._hand_over()
                await asyncio.wait([self._close_file()])  # so that whoever records to it next finds it free
                return
        self.missing += sum(not isinstance(fact, Missing) for _, _, fact in self._waiting)
        self._close_file()

    def _close_file(self) -> asyncio.Future[None]:
        """Let the thread close the file when it has done all else, and end."""
        closed = self._loop.run_in_executor(self._thread, self._file.close)
        self._thread.shutdown()
        return closed

    # Of the event loop ------------------------------------------------------------------------------------------------

    def _take(self, line: str, fact: Fact) -> bool:
        """Note *fact*; False if no more is wanted."""
        if self._is_over:
            return False
        at = self._loop.time() - self._begun_at
        size = _size(fact)
        if len(self._waiting) >= _MOST_WAITING or self._bytes_waiting + size > _MOST_BYTES_WAITING:
            self.missing += 1
            self._missing_here += 1
            return True
        if self._missing_here:
            self._waiting.append((at, "", Missing(self._missing_here)))
            self._missing_here = 0
        self._waiting.append((at, line, fact))
        self._bytes_waiting += size
        if self._writing is None and len(self._waiting) >= _MANY:
            self._hand_over()
        elif self._writing is None and self._timer is None:
            self._timer = self._loop.call_later(_GATHERED_S, self._hand_over)
        return True

    def _hand_over(self) -> None:
        """Let the thread write what waits, unless it is at it."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._writing is not None or not self._waiting:
            return
        entries, self._waiting, self._bytes_waiting = self._waiting, deque(), 0
        self._writing = self._loop.run_in_executor(self._thread, self._file.write, entries)
        self._writing.add_done_callback(partial(self._written, entries))

    def _written(self, entries: deque[tuple[float, str, Fact]], written: asyncio.Future[None]) -> None:
        self._writing = None
        if written.cancelled():
            return
        error = written.exception()
        if error is None:
            self.error = None
        else:
            self._failed(entries, error)
        if self._waiting and not self._is_over:
            is_full = len(self._waiting) >= _MANY and error is None
            self._timer = self._loop.call_later(0 if is_full else _GATHERED_S, self._hand_over)

    def _failed(self, entries: deque[tuple[float, str, Fact]], error: BaseException) -> None:
        left = list(entries)[self._file.taken :]
        lost = sum(fact.entries if isinstance(fact, Missing) else 1 for _, _, fact in left)
        self.missing += sum(not isinstance(fact, Missing) for _, _, fact in left)
        if self.error is None:
            _log.error("%s: the trace cannot be written: %s; it is tried on", name_of(self.path), error)
        self.error = error if isinstance(error, OSError) else OSError(str(error))
        if left and (self._waiting or not self._is_over):  # at the end, only if something is tried after it
            self._waiting.appendleft((left[0][0], "", Missing(lost)))


def _size(fact: Fact) -> int:
    """Return about how many bytes of memory it takes."""
    if isinstance(fact, Sent | Received):
        return len(fact.data) + 100
    if isinstance(fact, Ended):
        return len(fact.text or "") + 300
    return len(str(fact.details)) + 200 if isinstance(fact, Noticed) else 300


def _session() -> SessionBegun:
    from importlib.metadata import version  # noqa: PLC0415 - it takes longer to import than all of this

    begun = datetime.now().astimezone().isoformat(timespec="microseconds")
    return SessionBegun(begun, f"compax-aio {version('compax-aio')}")


@asynccontextmanager
async def record_trace(path: str | Path, *, max_bytes: int = DEFAULT_MAX_BYTES) -> AsyncIterator[TraceRecorder]:
    """
    Record all that goes over the lines which are opened in this block: by this task, and by those that it starts.

    Lines that were opened before are not recorded; open them in the block. A file that is there is appended to, if it
    is a trace. What the disk does not take in time is left out, and how much that is stands in the trace: no line ever
    waits for a disk.

    Args:
        path: Of the trace; when half of *max_bytes* is written, that becomes ``<path>.1``, and a new file begins.
        max_bytes: Of both files together, at least 65,536.

    Raises:
        InvalidCommandError: *path*, or ``<path>.1``, is there, and no trace, or can be no name; or *max_bytes* is too
            little.
        OSError: The file cannot be opened, or not within ten seconds, is no plain file, or somebody else records to it.
    """
    if isinstance(max_bytes, bool) or not isinstance(max_bytes, int) or max_bytes < SMALLEST_TRACE:
        raise InvalidCommandError(f"max_bytes is a whole number from {SMALLEST_TRACE} on, not {max_bytes!r}")
    recorder = TraceRecorder(TraceFile(Path(path), max_bytes, await asyncio.to_thread(_session)))
    await recorder.open()
    tap = recorder.line
    TAPS.set((*TAPS.get(), tap))
    try:
        yield recorder
    finally:
        # No token: blocks may be left in another order, or another context, than they were entered in.
        TAPS.set(tuple(each for each in TAPS.get() if each is not tap))
        await recorder.close()
