"""
Recording motion: what drives say of their position, speed and torque, each answer with the time at which it arrived.

A drive is asked one thing after the other, in the lane that goes last: a stop, a move, a look of the library goes
first, and waits for no more than the one exchange in flight. What nobody else needs of the line is used.
"""

from __future__ import annotations

import asyncio
import errno
import logging
from collections.abc import AsyncIterator, Callable, Coroutine, Mapping, Sequence
from contextlib import asynccontextmanager
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any, Final, TypeVar

from ..checked_numbers import check_number
from ..errors import CommandRejectedError, CompaxError, ConnectionLostError, InvalidCommandError
from ..escaping import shown
from ..link.cancellation import despite_cancellation
from ..motion.events import DriveEvent
from ..text_file import name_of
from .motion_asking import (
    QUANTITIES,
    Recordable,
    Recordables,
    RecordedAxis,
    RecordedQuantity,
    axis_of,
    check_record,
    drives_by_axis,
    is_number,
    next_beat,
)
from .motion_file import Kind, RecordFile, Row, csv_path_of, expect_free, is_parquet
from .own_thread import OwnThread

__all__ = ["MotionRecording", "record"]

_log = logging.getLogger("compax_aio.recording")

_FLUSH_S: Final = 0.5
_SHORTEST_S: Final = 0.001
"""Of one reading: a line without any limit of its own must not take the whole processor."""
_REFUSED_AGAIN_S: Final = 5.0
"""What the drive refuses is asked again so rarely: most of it will be refused for ever."""
_LOST_AGAIN_S: Final = 0.5
_RATE_OVER_S: Final = 5.0
_CLOSE_TIMEOUT_S: Final = 10.0
_ROWS_CONVERTED_A_SECOND: Final = 10_000
"""At the very least; of a longer record the making of a Parquet file may take longer."""

_Result = TypeVar("_Result")


class MotionRecording:
    """
    A record that goes on; made by :func:`record`.

    Attributes:
        path: Of the file.
        started: The wall clock at time 0 of the record.
        samples: Values that were read until now.
        missing: Values that were asked for and not said.
        error: Why the record does not go on, if that is so; leaving the block raises it.
    """

    def __init__(
        self,
        devices: Mapping[str, Recordable],
        path: Path,
        *,
        quantities: Sequence[str],
        interval_s: float | None,
        status_interval_s: float | None,
        line_share: float,
        overwrite: bool,
    ) -> None:
        self.path = path
        self.started = datetime.now().astimezone()
        self.samples = 0
        self.missing = 0
        self.error: Exception | None = None
        self._ended_after_s: float | None = None
        self._loop = asyncio.get_running_loop()
        self._zero_at = self._loop.time()
        self._pause_share = 1 / line_share - 1
        self._overwrite = overwrite
        self._file = RecordFile(csv_path_of(path), overwrite=overwrite)
        self._over = asyncio.Event()
        self._tasks: list[asyncio.Task[None]] = []
        self._axes = {
            name: axis_of(
                name,
                device,
                quantities,
                interval_s=interval_s or 0.0,
                status_interval_s=status_interval_s,
                now=self._zero_at,
            )
            for name, device in devices.items()
        }
        self._thread = OwnThread(f"record {path.name}")  # last: whoever has it ends it

    # For who records ------------------------------------------------------------------------------------------------

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes that are recorded."""
        return tuple(self._axes)

    @property
    def time_s(self) -> float:
        """The time of the record now."""
        return self._loop.time() - self._zero_at

    @property
    def ended_after_s(self) -> float:
        """The time of the record at its end, or now while it goes on."""
        return self.time_s if self._ended_after_s is None else self._ended_after_s

    @property
    def rows_lost(self) -> int:
        """Rows that could not be written, for the disk was too slow."""
        return self._file.lost

    def samples_of(self, axis: str) -> int:
        """Return how many values of *axis* were read until now."""
        return self._axes[axis].samples

    def newest(self, axis: str) -> Mapping[str, float]:
        """Return the newest value of each quantity of *axis*; what did not come the last time is not there."""
        return self._axes[axis].newest

    def rate(self, axis: str) -> float:
        """Return how many answers a second came of *axis* in the last seconds."""
        now, answered_at = self._loop.time(), self._axes[axis].answered_at
        times = [at for at in answered_at if at > now - _RATE_OVER_S]
        since = max(now - _RATE_OVER_S, self._zero_at, times[0] if len(times) == answered_at.maxlen else 0.0)
        return len(times) / (now - since) if now > since else 0.0

    def mark(self, word: str, *, axis: str = "", value: float | None = None, text: str = "") -> None:
        """
        Note that something happened now.

        Args:
            word: What, in a word or two: it is what plots show.
            axis: To which axis; empty: to none of them alone.
            value: Its number, if it has one.
            text: More about it.

        Raises:
            InvalidCommandError: There is no such axis, *value* is no finite number, or the record has ended.
        """
        if self._ended_after_s is not None:
            raise InvalidCommandError(f"the record {name_of(self.path)} has ended, and takes no mark {shown(word)}")
        if axis and axis not in self._axes:
            raise InvalidCommandError(f"{axis!r} is not recorded here; recorded: {', '.join(self._axes)}")
        if value is not None:
            value = check_number("value", value)
        for each in self._axes.values():
            self._take_waiting_events(each)  # what happened before stands before it
        self._put(self._loop.time(), axis, Kind.MARK, word, value=value, text=text)

    async def until_over(self) -> None:
        """Wait until there is nothing more to record: every drive is closed, or the file cannot be written."""
        await self._over.wait()

    # Recording ------------------------------------------------------------------------------------------------------

    def _put(self, at: float, axis: str, kind: Kind, name: str, *, value: float | None = None, text: str = "") -> None:
        self._file.put(Row(max(at - self._zero_at, 0.0), axis, kind, name, value, text))

    async def _begin(self) -> None:
        if not self._overwrite:
            await self._in_thread(expect_free, self.path)  # which may not be the one that is written
        for axis in self._axes.values():
            self._put(self._zero_at, axis.name, Kind.AXIS, "unit", text=axis.drive.unit)
            for quantity in axis.quantities:
                self._put(self._zero_at, axis.name, Kind.QUANTITY, quantity.name, text=quantity.unit)
        await self._in_thread(self._file.open, self.started)
        for axis in self._axes.values():
            self._start(self._sample(axis), f"{axis.name}: record")
            self._start(self._follow(axis), f"{axis.name}: record events")
        self._start(self._flush(), f"{self.path.name}: record")

    def _start(self, work: Coroutine[Any, Any, None], name: str) -> None:
        task = self._loop.create_task(work, name=name)
        task.add_done_callback(self._task_ended)
        self._tasks.append(task)

    def _in_thread(self, work: Callable[..., _Result], *arguments: Any) -> asyncio.Future[_Result]:
        return self._loop.run_in_executor(self._thread, work, *arguments)

    def _task_ended(self, task: asyncio.Task[None]) -> None:
        if not task.cancelled() and isinstance(error := task.exception(), Exception):
            self._fail(error)

    async def _sample(self, axis: RecordedAxis) -> None:
        asked = [*axis.quantities, *([axis.status] if axis.status is not None else [])]
        while not axis.is_over:
            quantity = min(asked, key=lambda each: each.due_at)
            if (wait_s := quantity.due_at - self._loop.time()) > 0:
                await asyncio.sleep(wait_s)
            begun_at = self._loop.time()
            pause_s = await self._read(axis, quantity)
            took_s = self._loop.time() - begun_at
            pause_s = max(pause_s, took_s * self._pause_share, _SHORTEST_S - took_s)
            if pause_s > 0:
                await asyncio.sleep(pause_s)

    async def _read(self, axis: RecordedAxis, quantity: RecordedQuantity) -> float:
        """Ask one thing, and note what came of it; returns how long to leave the line alone."""
        try:
            said = await quantity.read()
        except CompaxError as error:
            is_refused = isinstance(error, CommandRejectedError)
            self._note_missing(axis, quantity, f"{type(error).__name__}: {error.what}", is_refused=is_refused)
            return _LOST_AGAIN_S if isinstance(error, ConnectionLostError) else 0.0
        value = getattr(said, "value", said)
        if quantity is axis.status:
            quantity.due_at = next_beat(self._loop.time(), quantity.interval_s)
        elif is_number(value):
            self._note_unit(axis, quantity, getattr(said, "unit", quantity.unit) or "")
            self._note_sample(axis, quantity, float(value))
        else:
            self._note_missing(axis, quantity, f"it is no number: {shown(value)}", is_refused=True)
        return 0.0

    def _note_unit(self, axis: RecordedAxis, quantity: RecordedQuantity, unit: str) -> None:
        """Note the unit of a status value, which is said with it."""
        if unit != quantity.unit:
            quantity.unit = unit
            self._put(self._loop.time(), axis.name, Kind.QUANTITY, quantity.name, text=unit)

    def _note_sample(self, axis: RecordedAxis, quantity: RecordedQuantity, value: float) -> None:
        at = self._loop.time()
        quantity.is_refused = False
        self._put(at, axis.name, Kind.SAMPLE, quantity.name, value=value)
        self.samples += 1
        axis.samples += 1
        axis.newest[quantity.name] = value
        axis.answered_at.append(at)
        quantity.due_at = next_beat(at, quantity.interval_s)

    def _note_missing(self, axis: RecordedAxis, quantity: RecordedQuantity, why: str, *, is_refused: bool) -> None:
        if axis.is_over:
            return
        at = self._loop.time()
        quantity.due_at = next_beat(at, quantity.interval_s)
        if is_refused:
            quantity.due_at = max(quantity.due_at, at + _REFUSED_AGAIN_S)
            if not quantity.is_refused:
                _log.warning("%s: %s cannot be recorded: %s", axis.name, quantity.name, why)
        quantity.is_refused = is_refused
        if quantity is not axis.status:
            self.missing += 1
            axis.newest.pop(quantity.name, None)
            self._put(at, axis.name, Kind.MISSING, quantity.name, text=why)

    async def _follow(self, axis: RecordedAxis) -> None:
        async for event in axis.events:
            self._note_event(axis, event)
        axis.is_over = True
        self._put(self._loop.time(), axis.name, Kind.MARK, "closed", text="the drive was closed")
        if all(each.is_over for each in self._axes.values()):
            self._over.set()

    def _note_event(self, axis: RecordedAxis, event: DriveEvent) -> None:
        mark = event.as_mark()
        self._put(event.at, axis.name, Kind.MARK, mark.word, value=mark.value, text=mark.text)

    async def _flush(self) -> None:
        while True:
            await asyncio.sleep(_FLUSH_S)
            await self._in_thread(self._file.write_waiting)

    def _fail(self, error: Exception) -> None:
        if self.error is None:
            self.error = error
            _log.error("the record %s does not go on: %s", name_of(self.path), error)
        for axis in self._axes.values():
            axis.is_over = True
        self._over.set()

    # Ending ---------------------------------------------------------------------------------------------------------

    async def _end(self, why: str) -> None:
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        for axis in self._axes.values():
            self._take_waiting_events(axis)
        self._ended_after_s = self.time_s
        ended = Row(self._ended_after_s, "", Kind.RECORD, "ended", self.samples, why)
        try:
            late = f"The disk has not taken the end of it within {_CLOSE_TIMEOUT_S:g} s"
            is_whole = await self._in_time(_CLOSE_TIMEOUT_S, late, self._file.close, ended)
            if is_whole and is_parquet(self.path):
                timeout_s = _CLOSE_TIMEOUT_S + self._file.rows / _ROWS_CONVERTED_A_SECOND
                late = f"It was not made within {timeout_s:.0f} s; all of it is in {name_of(csv_path_of(self.path))}"
                await self._in_time(timeout_s, late, _make_parquet, self.path)
        except Exception as error:  # whatever was the reason for ending is the one to be raised
            self._fail(error)
        finally:
            self._thread.shutdown(wait=False)

    async def _in_time(self, timeout_s: float, late: str, work: Callable[..., _Result], *arguments: Any) -> _Result:
        try:
            async with asyncio.timeout(timeout_s):
                return await self._in_thread(work, *arguments)
        except TimeoutError:
            raise OSError(errno.ETIMEDOUT, late, str(self.path)) from None

    def _take_waiting_events(self, axis: RecordedAxis) -> None:
        """Note what was told until now, and not yet taken."""
        for event in axis.events.take_waiting():
            self._note_event(axis, event)


def _make_parquet(path: Path) -> None:
    from .motion_parquet import convert  # noqa: PLC0415 - the library is an extra

    source = csv_path_of(path)
    convert(source, path)
    source.unlink()


@asynccontextmanager
async def record(
    devices: Recordables,
    path: str | Path,
    *,
    quantities: Sequence[str] = QUANTITIES,
    interval_s: float | None = None,
    status_interval_s: float | None = 1.0,
    line_share: float = 1.0,
    overwrite: bool = False,
) -> AsyncIterator[MotionRecording]:
    """
    Record what drives say of their motion, and what happens to them, while the block runs.

    ``async with record(drive, "run.csv"): await drive.move_to(100)``. Each drive is asked one quantity after the
    other, and each answer is written with the time at which it arrived; what is not said is empty. The file is complete
    up to the last half second if the process dies. Moves, stops and all that the library asks itself go first on the
    line; reads of others and those of the record take turns.

    Args:
        devices: A drive, a group, drives by the names of their axes, or several drives. They must stay open.
        path: Of the file, ``.csv`` or ``.parquet`` (extra ``parquet``). A Parquet file is made at the end, of the CSV
            file that is written beside it until then.
        quantities: ``position``, ``target``, ``following_error``, ``speed``, ``torque``, or ``S1`` to ``S250`` for
            what is a number. The fewer they are, the more often each is read.
        interval_s: Seconds from one reading of a quantity to the next, above 0; None: as often as the line can do it.
        status_interval_s: How often the status is read as well, so that faults are noticed when nothing moves; None:
            not at all.
        line_share: How much of the time in which nobody else uses the line is used, above 0, at most 1.
        overwrite: Replace a file that is there.

    Raises:
        InvalidCommandError: Something of that means nothing, or Parquet is not installed; nothing was sent.
        FileExistsError: The file is there already, and *overwrite* is not set.
        OSError: The file cannot be written; when leaving the block, too.
    """
    path = Path(path)
    check = partial(
        check_record,
        path,
        quantities=quantities,
        interval_s=interval_s,
        status_interval_s=status_interval_s,
        line_share=line_share,
    )
    await asyncio.to_thread(check)  # which imports a library
    recording = MotionRecording(
        drives_by_axis(devices),
        path,
        quantities=quantities,
        interval_s=interval_s,
        status_interval_s=status_interval_s,
        line_share=line_share,
        overwrite=overwrite,
    )
    why = "as asked"
    try:
        await recording._begin()  # noqa: SLF001 - who records is not shown how
        yield recording
    except BaseException as error:
        why = type(error).__name__
        raise
    finally:
        await despite_cancellation(recording._end(why))  # noqa: SLF001
    if recording.error is not None:
        raise recording.error
