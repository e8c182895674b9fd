"""``compax monitor``: all axes on one screen, watched, and by keys stopped, jogged and homed."""

from __future__ import annotations

import asyncio
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from ..checked_numbers import check_number
from ..errors import InvalidCommandError
from .exit_codes import INTERRUPTED, OK, exit_code_of
from .number_words import NUMBER
from .opening import DriveLine
from .printing import notes_console

if TYPE_CHECKING:
    from .monitoring.orders import Farewell

__all__ = ["monitor"]


async def monitor(
    *lines: Annotated[str, Parameter(name="URL")],
    settings: Annotated[tuple[str, ...], Parameter(env_var="COMPAX_SETTINGS", negative=(), show_default=False)] = (),
    interval: Annotated[float, NUMBER] = 0.2,
    allow_motion: Annotated[bool, Parameter(negative=(), show_default=False)] = False,
    step: Annotated[float, NUMBER] = 1.0,
    jog_speed: Annotated[float, NUMBER] = 10.0,
    trace: Path | None = None,
) -> int:
    """
    Watch axes on a screen, and stop, jog and home them by keys.

    The screen opens although a drive cannot be reached, says why, and tries again. It looks only, until you press `m`;
    it never starts a motion by itself. `space` stops all axes, whatever is on the screen. Leaving it (`q`, Ctrl-C)
    stops what was started from it, and leaves alone what was not. `?` shows all keys.

    ```sh
    compax monitor tcp://192.168.1.50:4001
    compax monitor x=serial:///dev/ttyUSB0 y=serial:///dev/ttyUSB1 --settings x=x.toml --settings y=y.toml
    compax monitor x=sim://compax y=sim://compax
    ```

    Args:
        lines: Line of a drive, or NAME=URL, such as `x=tcp://192.168.1.50:4001`; one for each axis.
        settings: TOML file with the settings of all drives, as `compax probe` writes it, or NAME=FILE for one; may be
            given again.
        interval: Seconds from one reading to the next, if the line can do it.
        allow_motion: Let `m` switch motion on without asking. It is off at the start all the same.
        step: Of a jog, in the unit of the axis; + and - change it.
        jog_speed: Speed of a jog, in % of nominal speed. The drive keeps it as its speed (SPEED, UG p. 162).
        trace: Record all that goes over the lines to this file, for `compax replay` and `compax trace check`.
    """
    _check(interval, step, jog_speed)
    from .monitoring.cell import Cell  # noqa: PLC0415 - the library of the screen takes long to import
    from .monitoring.screen import Monitor  # noqa: PLC0415
    from .monitoring.wanted import wanted_axes  # noqa: PLC0415

    wanted = wanted_axes(lines, settings)
    _expect_terminal()
    cell = Cell(wanted, interval_s=interval, jog_percent=jog_speed)
    screen = Monitor(cell, step=step, asks_before_motion=not allow_motion)
    async with DriveLine(trace=trace).recorded():
        try:
            interrupted = await screen.run_async()
        finally:
            await cell.close()
            _say_goodbye(cell.farewells)
    if screen.defect is not None:
        raise screen.defect
    error = next((each.error for each in cell.farewells if each.error is not None), None)
    if error is not None:
        return exit_code_of(error)
    _expect_no_signal()
    return INTERRUPTED if interrupted else OK


def _check(interval: float, step: float, jog_speed: float) -> None:
    for what, value in (("--interval", interval), ("--step", step), ("--jog-speed", jog_speed)):
        if not check_number(what, value) > 0:
            raise InvalidCommandError(f"{what} must be above 0, not {value:g}")


def _expect_terminal() -> None:
    streams = (sys.stdin, sys.stdout, sys.stderr)
    if not all(stream is not None and stream.isatty() for stream in streams) or os.environ.get("TERM") == "dumb":
        raise InvalidCommandError(
            "the monitor needs a terminal for its screen and its keys, and this is none",
            hint="for programs and logs use `compax status URL --watch --json`",
        )


def _expect_no_signal() -> None:
    """Go on with a cancellation, which is how signals end a command: the library of the screen keeps it to itself."""
    task = asyncio.current_task()
    if task is not None and task.cancelling():
        raise asyncio.CancelledError


def _say_goodbye(farewells: tuple[Farewell, ...]) -> None:
    """Say in the terminal, once the screen is closed, what was stopped and what was left alone."""
    told = [each for each in farewells if each.text]
    console = notes_console()
    try:
        for each in told:
            console.print(f"{each.axis}: {each.text}", markup=False, style="bold red" if each.error else None)
        if not told:
            console.print("Nothing was in motion from here.", markup=False)
    except OSError:  # the terminal is gone
        return
