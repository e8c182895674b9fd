"""``compax stop``: one drive or several, all at once, STOP before anything else."""

from __future__ import annotations

import asyncio
from contextlib import AsyncExitStack
from typing import Any, Final

from compax_aio import CompaxError, DriveSettings, InvalidCommandError
from compax_aio.compax.stop_first import StoppedDrive, stop_first

from .exit_codes import OK, exit_code_of
from .interruption import say_at_end
from .opening import DriveLine, Url
from .printing import Printing, tell_error
from .stops_under_way import let_end

__all__ = ["stop"]

_WORST_FIRST: Final = (4, 5, 6, 7, 3)
"""Of exit codes: STOP that nobody has acknowledged is worse than a line on which nothing was sent."""


async def stop(
    url: Url,
    *more: Url,
    line: DriveLine = DriveLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> int:
    """
    Stop one drive or several, all at once, and wait until each stands.

    STOP is the first that goes over each line, and is repeated until the drive acknowledges it. When one fails, the
    others are stopped all the same; the exit code is that of the worst. It is no emergency stop, and a line that
    another program holds cannot be opened.

    ```sh
    compax stop serial:///dev/ttyUSB0 serial:///dev/ttyUSB1
    ```
    """
    urls = tuple(dict.fromkeys((url, *more)))
    if line.name is not None and len(urls) > 1:
        raise InvalidCommandError("--name is for one line, and there are several")
    settings = _settings(line, printing)
    async with AsyncExitStack() as stack:
        try:
            await stack.enter_async_context(line.recorded())
        except CompaxError as error:
            printing.note(f"STOP is sent without being recorded: {error}")
        tasks = {each: asyncio.create_task(_stop_one(each, line.name, settings, printing)) for each in urls}
        try:
            await asyncio.wait(tasks.values())
        except asyncio.CancelledError:
            await _end_all(tasks, settings.standstill_timeout_s)
            raise
        outcomes = {each: task.result() for each, task in tasks.items()}
        _show(outcomes, printing)
    return _worst([exit_code_of(each) for each in outcomes.values() if isinstance(each, Exception)])


def _settings(line: DriveLine, printing: Printing) -> DriveSettings:
    """Return the settings, or the defaults where their file cannot be used: a stop does not fail by a file."""
    try:
        return line.drive_settings()
    except CompaxError as error:
        printing.note(f"STOP is sent without the settings: {error}")
        return DriveSettings()


async def _stop_one(
    url: str, name: str | None, settings: DriveSettings, printing: Printing
) -> StoppedDrive | CompaxError | OSError:
    """Stop one, and tell at once how that went."""
    try:
        stopped = await stop_first(url, name=name, settings=settings)
    except (CompaxError, OSError) as error:
        if not printing.json:
            tell_error(error, as_document=False)
        return error
    if not printing.json:
        printing.show(None, _told(stopped, settings))
    return stopped


def _told(stopped: StoppedDrive, settings: DriveSettings) -> str:
    where = "" if stopped.position is None else f" at {stopped.position:.{settings.decimals}f} {stopped.unit}"
    fault = "" if stopped.status.no_fault else "; it reports a fault, which `compax status` shows"
    return f"{stopped.drive} has acknowledged STOP and stands{where}{fault}"


def _show(outcomes: dict[str, StoppedDrive | CompaxError | OSError], printing: Printing) -> None:
    if printing.json:
        printing.show([_document(url, outcome) for url, outcome in outcomes.items()])


def _document(url: str, outcome: StoppedDrive | CompaxError | OSError) -> dict[str, Any]:
    if isinstance(outcome, StoppedDrive):
        return {
            "url": url,
            "drive": outcome.drive,
            "stopped": True,
            "position": outcome.position,
            "unit": outcome.unit,
            "no_fault": outcome.status.no_fault,
            "after_s": round(outcome.after_s, 4),
        }
    return {"url": url, "stopped": False, "error": outcome}


def _worst(codes: list[int]) -> int:
    return next((code for code in _WORST_FIRST if code in codes), codes[0] if codes else OK)


async def _end_all(tasks: dict[str, asyncio.Task[Any]], patience_s: float) -> None:
    """Let stops that are interrupted come to their end, if they do so soon, and say of which it is known."""
    unknown = await let_end(tasks, patience_s, lambda outcome: isinstance(outcome, StoppedDrive))
    if unknown:
        say_at_end(f"Interrupted. Whether these stand is not known, look at them: {', '.join(unknown)}")
    else:
        say_at_end("Interrupted. All drives have acknowledged STOP and stand.")
