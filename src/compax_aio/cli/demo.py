"""Three simulated drives on three kinds of line, homed and moved at once, with live positions and a closing table."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import AbstractAsyncContextManager, AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from typing import Any, Final, Literal

from rich import box
from rich.console import Console, Group
from rich.live import Live
from rich.progress import BarColumn, Progress, TaskID, TextColumn
from rich.table import Table
from rich.text import Text

import compax_aio
from compax_aio.compax.settings import DriveSettings
from compax_aio.simulator.compax import Knobs, SimulatedDrive
from compax_aio.simulator.server import serve_loopback, serve_pty, serve_tcp

from .interruption import say_at_end
from .printing import Printing

__all__ = ["demo", "main", "run"]

_UNIT = "mm"
_TARGETS = ((240.0, 155.5, -60.0), (80.0, 10.25, 0.0))
_SPEED_PERCENT = 60
_BAUDRATE: Literal[0, 9600] = 9600

_INTERRUPTED: Final = "Interrupted: STOP went to every drive that moved, and each acknowledged it."

Watcher = Callable[[Group], None]


@dataclass(frozen=True)
class _Round:
    """One motion of all axes, as confirmed, and where the axes were read to stand after it."""

    motion: str
    results: dict[str, compax_aio.MoveResult]
    positions: dict[str, float]


async def demo(*, printing: Printing = Printing()) -> None:  # noqa: B008 - it is frozen
    """
    Home and move three simulated drives at once, on three kinds of line, and watch them.

    One is on a pseudo-terminal, one on TCP, one in memory, with the timing of 9600 baud. No machine is needed, and none
    is moved. Ctrl-C stops the axes. With `--json` what each drive confirmed is printed at the end.

    ```sh
    compax demo
    ```
    """
    console = Console(quiet=printing.json, highlight=False)
    try:
        rounds = await _carry_out(console, None)
    except asyncio.CancelledError:
        say_at_end(_INTERRUPTED)  # as leaving the group has not failed
        raise
    printing.show([_document(each, axis) for each in rounds for axis in each.results], _table(rounds))


def main() -> int:
    """Run the demonstration; returns the exit code."""
    console = Console()
    try:
        console.print(asyncio.run(run(console)))
    except KeyboardInterrupt:
        console.print(_INTERRUPTED)
        return 130
    except compax_aio.CompaxError as error:
        console.print(Text(f"{type(error).__name__}: {error}", style="red"))
        return 1
    return 0


async def run(console: Console, on_frame: Watcher | None = None) -> Table:
    """Home and move all three, and return the closing table; *on_frame* sees the live display as it changes."""
    return _table(await _carry_out(console, on_frame))


async def _carry_out(console: Console, on_frame: Watcher | None) -> list[_Round]:
    async with _simulated_drives() as urls, _connected(urls) as group:
        console.print("Three simulated COMPAX drives, each on a line of its own:")
        for axis, url in urls.items():
            console.print(f"  [bold]{axis}[/]  {url}", highlight=False)
        results = await _watched(console, "finding machine zero", group.home(), on_frame)
        rounds = [_Round("home", results, await group.positions())]
        for x, y, z in _TARGETS:
            move = group.move_to(x=x, y=y, z=z, speed_percent=_SPEED_PERCENT)
            results = await _watched(console, f"moving to x {x:g}, y {y:g}, z {z:g}", move, on_frame)
            rounds.append(_Round("move", results, await group.positions()))
        return rounds


@asynccontextmanager
async def _simulated_drives() -> AsyncIterator[dict[str, str]]:
    """Serve one drive behind a pty, one on TCP and one in memory; yields the URL of each."""
    x = SimulatedDrive(Knobs(baudrate=_BAUDRATE, machine_zero=-35.0, nominal_speed=150.0), name="x")
    y = SimulatedDrive(Knobs(baudrate=_BAUDRATE, machine_zero=20.0, nominal_speed=90.0), name="y")
    z = SimulatedDrive(Knobs(baudrate=_BAUDRATE, machine_zero=12.5, nominal_speed=45.0), name="z")
    async with AsyncExitStack() as stack:
        yield {
            "x": await stack.enter_async_context(serve_pty(x)),
            "y": await stack.enter_async_context(serve_tcp(y)),
            "z": await stack.enter_async_context(serve_loopback(z, "z")),
        }


def _connected(urls: Mapping[str, str]) -> AbstractAsyncContextManager[compax_aio.DriveGroup]:
    return compax_aio.DriveGroup.connect(urls, settings=DriveSettings(unit=_UNIT))


async def _watched(
    console: Console, title: str, move: compax_aio.GroupMove, on_frame: Watcher | None
) -> dict[str, compax_aio.MoveResult]:
    """Await *move* under a live display of every axis's position."""
    bars = Progress(
        TextColumn("  [bold]{task.description}"),
        BarColumn(bar_width=40),
        TextColumn("{task.fields[position]:>9.2f} " + _UNIT),
        TextColumn("{task.fields[state]}"),
        console=console,
        auto_refresh=False,
    )
    screen = Group(Text(f"\n{title}"), bars)
    with Live(screen, console=console, refresh_per_second=20):
        async with asyncio.TaskGroup() as watchers:
            for axis, each in move.moves.items():
                bar = bars.add_task(axis, total=1.0, position=0.0, state="")
                watchers.create_task(_follow(bars, bar, each, lambda: on_frame(screen) if on_frame else None))
            return await move


async def _follow(bars: Progress, bar: TaskID, move: compax_aio.Move, on_frame: Callable[[], None]) -> None:
    """Draw one axis as it travels from where it is to its target."""
    begin: float | None = None
    async for position in move.positions():
        begin = position if begin is None else begin
        target = 0.0 if move.target is None else move.target  # machine zero is 0, unless P1 shifts it
        way = abs(target - begin)
        done = 1.0 if way == 0 else min(abs(position - begin) / way, 1.0)
        bars.update(bar, completed=done, position=position, state="on its way" if not move.done() else "")
        on_frame()
    if move.done() and not move.cancelled() and move.exception() is None:
        bars.update(bar, completed=1.0, state=f"[green]reached, by {move.result().confirmed_by}")


def _document(each: _Round, axis: str) -> dict[str, Any]:
    result = each.results[axis]
    return {
        "axis": axis,
        "motion": each.motion,
        "target": result.target,
        "reached": each.positions[axis],
        "unit": _UNIT,
        "confirmed_by": result.confirmed_by,
        "duration_s": result.duration_s,
    }


def _table(rounds: Sequence[_Round]) -> Table:
    table = Table(title="\nWhat the drives confirmed", title_justify="left", box=box.SIMPLE_HEAD)
    for heading in ("axis", "motion", "target", "reached", "confirmed by", "time"):
        table.add_column(heading, justify="right" if heading in ("target", "reached", "time") else "left")
    for axis in rounds[0].results:
        for each in rounds:
            result = each.results[axis]
            table.add_row(
                axis if each is rounds[0] else "",
                each.motion,
                "machine zero" if result.target is None else f"{result.target:.2f} {_UNIT}",
                f"{each.positions[axis]:.2f} {_UNIT}",
                result.confirmed_by,
                f"{result.duration_s:.2f} s",
                end_section=each is rounds[-1],
            )
    return table


if __name__ == "__main__":
    sys.exit(main())
