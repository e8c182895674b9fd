"""``compax program run``: the drive's program started, watched, and stopped with the axis by Ctrl-C."""

from __future__ import annotations

import asyncio
import sys
from typing import Annotated

from cyclopts import Parameter
from rich.progress import Progress, SpinnerColumn, TaskID, TextColumn, TimeElapsedColumn

from compax_aio import (
    AnswerTimeoutError,
    ConnectionLostError,
    Drive,
    InvalidCommandError,
    MoveInDoubtError,
    MoveTimeoutError,
)
from compax_aio.compax.moves import check_manner
from compax_aio.compax.program_run import check_record_number

from .interruption import in_motion, say_at_end
from .moving import TimeoutS, following, stop_interrupted, written
from .number_words import WHOLE
from .opening import DriveLine, Url
from .outlets import is_held_up
from .printing import Printing, notes_console

__all__ = ["run"]

_STOPPED = "; its program is stopped, and START would continue it"


async def run(
    url: Url,
    *,
    from_: Annotated[
        int | None,
        WHOLE,
        Parameter(name="--from", help="Record to begin with, 1 to 250; if not given, where the pointer stands."),
    ] = None,
    wait: Annotated[bool, Parameter(negative=(), help="Wait until it has ended, and show the position.")] = False,
    timeout_s: TimeoutS = None,
    line: DriveLine = DriveLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    Run the program that is in the drive.

    With --wait it is watched, and Ctrl-C stops program and axis. Without, the command returns as soon as the drive has
    taken the start: then the program goes on by itself, and `compax stop` stops it. Without --from, what a stop has
    stopped before is continued.

    ```sh
    compax program run serial:///dev/ttyUSB0 --from 1 --wait
    ```
    """
    line.drive_settings()
    if from_ is not None:
        check_record_number(from_)
    check_manner(timeout_s, "stop")
    if timeout_s is not None and not wait:
        raise InvalidCommandError("--timeout is for a program that is waited for", hint="say --wait as well")
    async with line.open(url) as drive:
        try:
            with in_motion(drive.name):
                await drive.program.start(from_)
                if wait:
                    await _watch(drive, timeout_s, printing)
        except asyncio.CancelledError:
            await stop_interrupted(drive, printing, also=_STOPPED, stop=drive.program.stop)
            raise
        if not wait:
            told = f"{drive.name} runs its program, and nobody watches it. `compax stop` stops it."
            say_at_end(f"Interrupted. {told}")
            drive.program.let_go_on()
            printing.show({"drive": drive.name, "running": True}, told)
            return
        say_at_end(f"Interrupted. The program of {drive.name} had ended before.")
        position = await drive.position()
    printing.show(
        {"drive": drive.name, "running": False, "position": position, "unit": drive.unit},
        f"{drive.name}: the program has ended; the axis stands at {written(drive, position)}",
    )


async def _watch(drive: Drive, timeout_s: float | None, printing: Printing) -> None:
    with RunView(drive, printing) as view:
        async with following(drive, view):
            try:
                await drive.program.wait_finished(timeout_s)
            except MoveTimeoutError as error:
                await drive.program.stop()
                error.add_note(f"{drive.name} was stopped, and stands{_STOPPED}.")
                raise
            except (AnswerTimeoutError, ConnectionLostError) as error:
                raise MoveInDoubtError(
                    f"what became of its program is in doubt: {error.what}",
                    device=drive.name,
                    sent=error.sent,
                    hint="it may run, and move the axis; look at the machine",
                    exchanges=error.exchanges,
                ) from error


class RunView:
    """
    What is seen of a program that runs: where the axis is, at a terminal; else nothing.

    Args:
        drive: What runs it.
        printing: How it is said.
    """

    def __init__(self, drive: Drive, printing: Printing) -> None:
        self._drive = drive
        self._printing = printing
        self._position: float | None = None
        self._bar: Progress | None = None
        self._task = TaskID(0)

    def __enter__(self) -> RunView:
        if not self._printing.json and sys.stderr.isatty():
            self._bar = Progress(
                SpinnerColumn(),
                TextColumn("{task.description}"),
                TextColumn("{task.fields[position]}"),
                TimeElapsedColumn(),
                console=notes_console(),
                transient=True,
                auto_refresh=False,  # the follower does, in the event loop
            )
            self._task = self._bar.add_task("", total=None, position="")
            self._bar.start()
            self.show()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def note_position(self, position: float) -> None:
        """Take note of where the axis was read to be."""
        self._position = position

    def show(self) -> None:
        """Show how the program and its line stand now."""
        if self._bar is None or is_held_up(self._bar.console.file):
            return
        is_there = self._drive.is_open
        self._bar.update(
            self._task,
            description=f"{self._drive.name} {'runs its program' if is_there else 'may run on: the line is lost'}",
            position="" if self._position is None else written(self._drive, self._position),
            refresh=True,
        )
