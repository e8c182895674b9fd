"""A move at the terminal: a bar while it goes, a line when it has ended, and Ctrl-C that stops the axis and says so."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager, suppress
from typing import Annotated, Final, Protocol

from cyclopts import Parameter
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

from compax_aio import CompaxError, Drive, Move, MoveResult

from ..motion.moves import MoveFuture
from .interruption import in_motion, say_at_end
from .number_words import NUMBER
from .outlets import is_held_up
from .printing import Printing, notes_console

__all__ = [
    "MoveView",
    "MovedAxis",
    "TimeoutS",
    "View",
    "carry_out",
    "following",
    "note_where_from",
    "stop_interrupted",
    "until_ended",
    "written",
]

TimeoutS = Annotated[
    float | None,
    NUMBER,
    Parameter(
        name="--timeout",
        help="Seconds that all of it may take; then the axis is stopped. If not given: as long as the axis moves.",
    ),
]

_READING_PAUSE_S: Final = 0.05
_PATIENCE_S: Final = 0.25
"""So long a reading may take before the display tells how the line is."""

_CONFIRMATIONS: Final = {"message": "by the drive's message ($)", "status": "by the drive's status (S16, S17)"}


def written(drive: MovedAxis, position: float | None) -> str:
    """Write a position with the unit of the axis."""
    return "an unknown position" if position is None else f"{position:.{drive.settings.decimals}f} {drive.unit}"


async def note_where_from(drive: Drive, printing: Printing) -> None:
    """Warn where positions do not count from machine zero."""
    if not (await drive.status()).machine_zero_approached:
        printing.note(
            f"{drive.name}: machine zero is not approached (S16 bit 3), so positions count from wherever the axis was "
            "when it was switched on; `compax home` finds it"
        )


async def carry_out(drive: Drive, move: Move, printing: Printing) -> None:
    """
    Await *move* under a progress bar, and say how it ended.

    Where the program is interrupted meanwhile, the axis is stopped, and that is said.

    Raises:
        CompaxError: The move did not reach its target, or the axis could not be stopped.
    """

    def target(result: MoveResult) -> str:
        return "machine zero" if result.target is None else written(drive, result.target)

    result, position, standing = await until_ended(
        drive, move, printing, lambda result: f"{drive.name} had reached {target(result)}"
    )
    printing.show(
        {
            "drive": result.drive,
            "target": result.target,
            "confirmed_by": result.confirmed_by,
            "duration_s": result.duration_s,
            "last_position": result.last_position,
            "position": position,
            "unit": drive.unit,
        },
        f"{drive.name}: {target(result)} reached in {result.duration_s:.2f} s, confirmed "
        f"{_CONFIRMATIONS[result.confirmed_by]}{standing}",
    )


async def until_ended(
    axis: MovedAxis, move: MoveFuture, printing: Printing, told: Callable[[MoveResult], str]
) -> tuple[MoveResult, float | None, str]:
    """
    Await *move* under a progress bar, and look where the axis stands then.

    Where the program is interrupted meanwhile, the axis is stopped, and that is said.

    Args:
        axis: What moves.
        move: The move.
        printing: How it is said.
        told: How it had ended, for who interrupts the program after that: ``x had reached 20 mm``.

    Returns:
        Its result; the position, None where it could not be read; and that in words.

    Raises:
        CompaxError: The move did not reach its target, or the axis could not be stopped.
    """
    try:
        with in_motion(axis.name), MoveView(axis, move, printing) as view:
            async with following(axis, view):
                result = await move
    except asyncio.CancelledError:
        move.cancel()  # where it was not awaited yet
        await stop_interrupted(axis, printing, was_sent=move.is_on_wire)
        raise
    say_at_end(f"Interrupted. {told(result)} before.")
    position = None
    with suppress(CompaxError):
        position = await axis.position()
    standing = "; its position could not be read" if position is None else f"; it stands at {written(axis, position)}"
    return result, position, standing


# Ctrl-C -------------------------------------------------------------------------------------------------------------


async def stop_interrupted(
    drive: MovedAxis,
    printing: Printing,
    *,
    was_sent: bool = True,
    also: str = "",
    stop: Callable[[], Awaitable[None]] | None = None,
) -> None:
    """
    Stop the axis because the command is interrupted, and let what is true then be said at the end.

    Args:
        drive: What is stopped.
        printing: How it is said.
        was_sent: Whether a motion had been sent at all.
        also: What else is true then: ``; its program is stopped``.
        stop: How it is stopped, if not by ``drive.stop()``.

    Raises:
        CompaxError: The stop was not acknowledged, or the axis does not stand.
    """
    try:
        await (stop or drive.stop)()
    except CompaxError:
        printing.note(f"{drive.name} may be moving: look at it, and use the emergency stop if it does.")
        raise
    position = None
    with suppress(CompaxError, TimeoutError):
        async with asyncio.timeout(drive.settings.answer_timeout_s):
            position = await drive.position()
    sent = "" if was_sent else "Nothing had been sent that moves it. "
    where = "" if position is None else f" at {written(drive, position)}"
    say_at_end(f"Interrupted. {sent}{drive.name} has acknowledged STOP and stands{where}{also}.")
    if printing.json:
        printing.show({"drive": drive.name, "interrupted": True, "stopped": True, "position": position})


# Progress -----------------------------------------------------------------------------------------------------------


class MovedSettings(Protocol):
    """What is known of how an axis is talked to."""

    @property
    def decimals(self) -> int:
        """Of positions."""

    @property
    def answer_timeout_s(self) -> float:
        """How long an answer may take."""


class MovedAxis(Protocol):
    """An axis of any kind, as far as a view of its motion and a stop need it."""

    @property
    def name(self) -> str:
        """What it is called."""

    @property
    def unit(self) -> str:
        """In which its positions are counted."""

    @property
    def is_open(self) -> bool:
        """Whether its line is there."""

    @property
    def settings(self) -> MovedSettings:
        """How it is talked to."""

    async def position(self) -> float:
        """Read where it is."""

    async def stop(self) -> None:
        """Stop it, and return when it stands."""


class View(Protocol):
    """What shows how an axis is doing."""

    def note_position(self, position: float) -> None:
        """Take note of where the axis was read to be."""

    def show(self) -> None:
        """Show how it and its line stand now."""


class MoveView:
    """
    What is seen of a move: a bar at a terminal, else a line for each thing that happens to it.

    Args:
        drive: What moves.
        move: The move.
        printing: How it is said.
    """

    def __init__(self, drive: MovedAxis, move: MoveFuture, printing: Printing) -> None:
        self._drive = drive
        self._move = move
        self._printing = printing
        self._begin: float | None = None
        self._position: float | None = None
        self._state = ""
        self._bar: Progress | None = None
        self._task = TaskID(0)

    def __enter__(self) -> MoveView:
        if not self._printing.json and sys.stderr.isatty():
            self._bar = Progress(
                TextColumn("{task.description}"),
                BarColumn(bar_width=30),
                TextColumn("{task.fields[position]}"),
                TextColumn("[dim]{task.fields[state]}"),
                TimeElapsedColumn(),
                console=notes_console(),
                transient=True,
                auto_refresh=False,  # the follower does, in the event loop
            )
            self._task = self._bar.add_task(self._title, total=None, position="", state="")
            self._bar.start()
            self.show()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    @property
    def _title(self) -> str:
        target = self._move.target
        return f"{self._drive.name} → {'…' if target is None else written(self._drive, target)}"

    def note_position(self, position: float) -> None:
        """Take note of where the axis was read to be."""
        self._begin = position if self._begin is None else self._begin
        self._position = position

    def show(self) -> None:
        """Show how the move and its line stand now."""
        state = self._state_now()
        is_news = state != self._state and (self._move.accepted.done() or not self._drive.is_open)
        if is_news and self._bar is None and not self._move.done():
            self._printing.note(f"{self._drive.name}: {state}")
        self._state = state
        if self._bar is not None and not is_held_up(self._bar.console.file):
            done = self._share_done()
            self._bar.update(
                self._task,
                description=self._title,
                total=None if done is None else 1.0,
                completed=done or 0.0,
                position="" if self._position is None else written(self._drive, self._position),
                state=state,
                refresh=True,
            )

    def _state_now(self) -> str:
        move = self._move
        if not self._drive.is_open:
            return "the line is lost, and tried again; the axis may be moving"
        if not move.is_on_wire:
            return f"{move.description} waits to be sent"
        return f"{move.sent} is on its way" if move.accepted.done() else f"{move.sent} was sent, and not accepted yet"

    def _share_done(self) -> float | None:
        target = self._move.target
        if target is None or self._begin is None or self._position is None or not self._move.is_on_wire:
            return None
        way = abs(target - self._begin)
        return 1.0 if not way else min(max(1.0 - abs(target - self._position) / way, 0.0), 1.0)


@asynccontextmanager
async def following(drive: MovedAxis, view: View) -> AsyncIterator[None]:
    """Read the position again and again for *view*, during a block."""
    follower = asyncio.ensure_future(_follow(drive, view))
    try:
        yield
    finally:
        follower.cancel()


async def _follow(drive: MovedAxis, view: View) -> None:
    while True:
        with _ended(asyncio.ensure_future(drive.position())) as reading:
            while not reading.done():
                await asyncio.wait([reading], timeout=_PATIENCE_S)
                if reading.done() and reading.exception() is None:
                    view.note_position(reading.result())
                view.show()
        await asyncio.sleep(_READING_PAUSE_S)


@contextmanager
def _ended(task: asyncio.Future[float]) -> Iterator[asyncio.Future[float]]:
    try:
        yield task
    finally:
        task.cancel()
