"""``compax record``: what drives say of their motion, to a file, until Ctrl-C, for some seconds, or during one move."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

from cyclopts import Parameter
from rich.console import Group
from rich.live import Live
from rich.text import Text

from compax_aio import Drive, DriveGroup, InvalidCommandError, MoveResult
from compax_aio.checked_numbers import check_number
from compax_aio.compax.vocabulary import MovePlan, plan_move_to
from compax_aio.recording import MotionRecording
from compax_aio.recording import record as record_motion
from compax_aio.recording.motion_asking import QUANTITIES, check_record

from .files import Force, expect_free
from .interruption import in_motion, say_at_end
from .monitoring.wanted import WantedAxis, wanted_axes
from .moving import stop_interrupted, written
from .number_words import NUMBER
from .opening import DriveLine, closing
from .printing import Printing, notes_console

__all__ = ["record"]

_SHOWN_EVERY_S: Final = 0.2


@dataclass(frozen=True, slots=True)
class _Ending:
    """What ends the record, beside Ctrl-C."""

    seconds: float | None
    plan: MovePlan | None
    tail_s: float
    """So long it goes on after the move."""


async def record(
    *urls: Annotated[
        str,
        Parameter(help="Lines of the drives, each with a name for its axis or not: x=tcp://192.168.1.50:4001"),
    ],
    output: Annotated[Path, Parameter(name=("--output", "-o"), help="File: .csv, or .parquet (extra parquet).")],
    quantity: Annotated[
        tuple[str, ...],
        Parameter(
            name=("--quantity", "-q"),
            negative=(),
            help="position, target, following_error, speed, torque, or S1 to S250; may be given several times. The "
            "fewer they are, the more often each is read.",
        ),
    ] = QUANTITIES,
    interval: Annotated[
        float | None,
        NUMBER,
        Parameter(help="Seconds from one reading of a quantity to the next; if not given, as often as the line can."),
    ] = None,
    line_share: Annotated[
        float, NUMBER, Parameter(help="How much of the time in which nothing else goes over the line is used, 0 to 1.")
    ] = 1.0,
    seconds: Annotated[
        float | None, NUMBER, Parameter(help="End after so many seconds; if not given, at Ctrl-C.")
    ] = None,
    move: Annotated[
        float | None,
        NUMBER,
        Parameter(
            allow_leading_hyphen=True,
            help="Move the axis (one only) to this position, in its unit, and end a little after it is reached.",
        ),
    ] = None,
    speed: Annotated[
        float | None, NUMBER, Parameter(help="Of that move, in percent of nominal speed, above 0.")
    ] = None,
    tail: Annotated[float, NUMBER, Parameter(help="Seconds for which the record goes on after that move.")] = 0.5,
    settings: Annotated[
        tuple[str, ...],
        Parameter(negative=(), help="TOML file with settings for all drives, or x=FILE for one of them."),
    ] = (),
    trace: Annotated[Path | None, Parameter(help="Record all that goes over the lines to this file as well.")] = None,
    force: Force = False,
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    Record position, target, following error, speed and torque to a file, with the time at which each answer arrived.

    Ctrl-C ends the record, which is whole then, and the exit code is 0. With --move it stops the axis as well, and the
    exit code is 130. Moves, stops and faults are marked. `compax plot` draws the file, and any reader of tables takes
    it. If the process dies, all but the last half second is there.

    ```sh
    compax record serial:///dev/ttyUSB0 -o run.csv
    compax record x=tcp://moxa:4001 y=tcp://moxa:4002 -o both.csv --seconds 60 -q position -q torque
    compax record serial:///dev/ttyUSB0 -o move.csv --move 240 --speed 50
    ```
    """
    axes = wanted_axes(urls, settings)
    check_record(output, quantities=quantity, interval_s=interval, line_share=line_share)
    expect_free(output, force=force)
    ending = _ending(axes, seconds, move, speed, tail)
    if ending.plan is None:
        say_at_end("Interrupted. This command sets nothing in motion.")
    async with DriveLine(trace=trace).recorded(), _connected(axes) as drives:
        recording: MotionRecording | None = None
        result: MoveResult | None = None
        try:
            async with (
                record_motion(
                    drives,
                    output,
                    quantities=quantity,
                    interval_s=interval,
                    line_share=line_share,
                    overwrite=force,
                ) as recording,
                _shown(recording, drives, printing),
            ):
                result = await _until_end(recording, drives, ending, printing)
        finally:
            if recording is not None and recording.error is None:
                _tell(recording, drives, result, printing)


def _ending(
    axes: tuple[WantedAxis, ...], seconds: float | None, position: float | None, speed: float | None, tail_s: float
) -> _Ending:
    if seconds is not None and not check_number("--seconds", seconds) > 0:
        raise InvalidCommandError(f"--seconds must be above 0, not {seconds:g}")
    if not check_number("--tail", tail_s) >= 0:
        raise InvalidCommandError(f"--tail must not be below 0, but {tail_s:g} is")
    if position is None:
        if speed is not None:
            raise InvalidCommandError("--speed is that of the move, and there is no --move")
        return _Ending(seconds, None, 0.0)
    if len(axes) > 1:
        raise InvalidCommandError(
            "--move is for one axis, and there are several", hint="move them by a program, as DriveGroup does"
        )
    if seconds is not None:
        raise InvalidCommandError("--move ends by itself, so --seconds cannot be kept", hint="take one of both")
    return _Ending(None, plan_move_to(position, axes[0].settings, speed_percent=speed), tail_s)


@asynccontextmanager
async def _connected(axes: tuple[WantedAxis, ...]) -> AsyncIterator[dict[str, Drive]]:
    """Connect to all drives at once."""
    urls, settings = {axis.name: axis.url for axis in axes}, {axis.name: axis.settings for axis in axes}
    async with DriveGroup.connect(urls, settings=settings) as group, closing(group.close):
        yield group.drives


async def _until_end(
    recording: MotionRecording, drives: dict[str, Drive], ending: _Ending, printing: Printing
) -> MoveResult | None:
    if ending.plan is not None:
        (drive,) = drives.values()
        result = await _move(drive, ending.plan, printing)
        await _wait(recording, ending.tail_s)
        return result
    try:
        await _wait(recording, ending.seconds)
    except asyncio.CancelledError:
        # To end it so is what was asked for; nothing was set in motion.
        task = asyncio.current_task()
        assert task is not None
        task.uncancel()
    return None


async def _wait(recording: MotionRecording, seconds: float | None) -> None:
    """Wait for so long, or until there is nothing more to record."""
    try:
        async with asyncio.timeout(seconds):
            await recording.until_over()
    except TimeoutError:
        pass


async def _move(drive: Drive, plan: MovePlan, printing: Printing) -> MoveResult:
    going = drive.start(plan)
    try:
        with in_motion(drive.name):
            return await going
    except asyncio.CancelledError:
        going.cancel()  # where it was not awaited yet
        await stop_interrupted(drive, printing, was_sent=going.is_on_wire)
        raise


# What is seen ---------------------------------------------------------------------------------------------------------


@asynccontextmanager
async def _shown(recording: MotionRecording, drives: dict[str, Drive], printing: Printing) -> AsyncIterator[None]:
    """Show rate and values while the record goes on, at a terminal."""
    if printing.json or not sys.stderr.isatty():
        printing.note(f"recording {', '.join(drives)} to {recording.path}; Ctrl-C ends it")
        yield
        return
    async with AsyncExitStack() as stack:
        live = stack.enter_context(Live(console=notes_console(), auto_refresh=False, transient=True))
        showing = asyncio.ensure_future(_show(recording, drives, live))
        stack.callback(showing.cancel)
        yield


async def _show(recording: MotionRecording, drives: dict[str, Drive], live: Live) -> None:
    while True:
        live.update(Group(*(_line(recording, axis, drive) for axis, drive in drives.items()), _foot(recording)))
        live.refresh()
        await asyncio.sleep(_SHOWN_EVERY_S)


def _line(recording: MotionRecording, axis: str, drive: Drive) -> Text:
    decimals = drive.settings.decimals
    values = "   ".join(
        f"{name.replace('_', ' ')} {value:.{decimals}f}" for name, value in recording.newest(axis).items()
    )
    state = f"{recording.rate(axis):5.1f}/s" if drive.is_open else "the line is lost, and tried again"
    return Text.assemble((f"{axis}  ", "bold"), (f"{state}   ", "" if drive.is_open else "red"), values)


def _foot(recording: MotionRecording) -> Text:
    missing = f", {recording.missing} not answered" if recording.missing else ""
    said = f"{recording.time_s:.1f} s, {recording.samples} values{missing}, to {recording.path}; Ctrl-C ends it"
    return Text(said, style="dim")


def _tell(recording: MotionRecording, drives: dict[str, Drive], result: MoveResult | None, printing: Printing) -> None:
    duration_s = recording.ended_after_s
    rates = {axis: recording.samples_of(axis) / duration_s if duration_s else 0.0 for axis in drives}
    document: dict[str, Any] = {
        "file": str(recording.path),
        "started": recording.started.isoformat(),
        "duration_s": round(duration_s, 6),
        "samples": recording.samples,
        "missing": recording.missing,
        "rows_lost": recording.rows_lost,
        "samples_per_s": {axis: round(rate, 2) for axis, rate in rates.items()},
        "move": result,
    }
    each = ", ".join(f"{axis} {rate:.1f}" for axis, rate in rates.items())
    told = f"{recording.path}: {recording.samples} values in {duration_s:.1f} s; values a second: {each}"
    if result is not None:
        (drive,) = drives.values()
        told = f"{drive.name}: {written(drive, result.target)} reached in {result.duration_s:.2f} s\n{told}"
    if recording.missing:
        told += f"; {recording.missing} were asked for and not said"
    if recording.rows_lost:
        told += f"; {recording.rows_lost} rows were lost, for the disk was too slow"
    printing.show(document, told)
