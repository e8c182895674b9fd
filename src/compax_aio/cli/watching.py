"""A display of one drive that is kept up to date, and goes on through lost lines; or one line of text or JSON each."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from rich.console import Group, RenderableType
from rich.live import Live
from rich.text import Text

from .. import Drive
from ..compax.events import ConnectionLost, ConnectionRestored
from ..compax.watch import Reading
from .printing import Printing, results_console
from .standing import Standing, as_line, as_table

__all__ = ["LineNews", "follow"]

_LATE_S: Final = 2.0
"""So much later than it was due, a reading is shown as one of the past."""
_LOOK_S: Final = 0.5


@dataclass(frozen=True, kw_only=True)
class LineNews:
    """A line that was lost, or is back."""

    drive: str
    event: str
    """``connection_lost`` or ``connection_restored``."""
    text: str


class _Display:
    """Shows readings and news of the line: in place on a terminal, else one after the other."""

    def __init__(self, printing: Printing) -> None:
        self._printing = printing
        console = results_console()
        is_live = console.is_terminal and not printing.json
        self.live = Live(console=console, auto_refresh=False) if is_live else None
        self._shown: RenderableType = Text("waiting for the first reading")
        self._news = Text("")
        self._age = Text("")
        self._read_at: float | None = None

    def show(self, standing: Standing) -> None:
        """Show a reading."""
        self._read_at = asyncio.get_running_loop().time()
        if self.live is None:
            self._printing.show(standing, as_line(standing))
        else:
            self._shown = as_table(standing)
            self._draw()

    def tell(self, news: LineNews) -> None:
        """Tell that a line was lost, or is back."""
        is_lost = news.event == "connection_lost"
        if self.live is None:
            self._printing.show(news, news.text)
        else:
            self._news = Text(news.text, style="bold red" if is_lost else "green")
            self._draw()

    async def tell_age(self, interval_s: float) -> None:
        """Say all the while how old the last reading is, where no other comes: a silent drive may be moving."""
        loop, told = asyncio.get_running_loop(), False
        while True:
            await asyncio.sleep(_LOOK_S)
            late_s = 0.0 if self._read_at is None else loop.time() - self._read_at - interval_s
            if (is_late := late_s > _LATE_S) or told:
                self._age = Text(
                    f"No answer for {late_s + interval_s:.0f} s: what is above is OLD." * is_late, "bold red"
                )
                self._draw()
            told = is_late

    def _draw(self) -> None:
        if self.live is not None:
            foot = Text("Ctrl-C ends this; the drive is only asked.", style="dim")
            self.live.update(Group(self._shown, Text(""), self._news, self._age, foot), refresh=True)


async def follow(
    drive: Drive,
    quantities: tuple[str, ...],
    interval_s: float,
    of: Callable[[Reading, str], Standing],
    printing: Printing,
) -> None:
    """Show *drive* again and again, until the task is cancelled or the line is given up."""
    display = _Display(printing)
    if display.live is None:
        await _follow(drive, quantities, interval_s, of, display)
        return
    with display.live:
        await _follow(drive, quantities, interval_s, of, display)


async def _follow(
    drive: Drive,
    quantities: tuple[str, ...],
    interval_s: float,
    of: Callable[[Reading, str], Standing],
    display: _Display,
) -> None:
    async with asyncio.TaskGroup() as tasks:
        beside = [tasks.create_task(_listen(drive, display)), tasks.create_task(display.tell_age(interval_s))]
        try:
            async for reading in drive.watch(*quantities, interval_s=interval_s):
                display.show(of(reading, drive.unit))
        finally:
            for task in beside:
                task.cancel()


async def _listen(drive: Drive, display: _Display) -> None:
    async for event in drive.events():
        if isinstance(event, ConnectionLost):
            text = f"The line was lost, and is tried again all the while: {event.reason}"
            display.tell(LineNews(drive=event.drive, event="connection_lost", text=text))
        elif isinstance(event, ConnectionRestored):
            signs = f" The drive seems to have been switched off: {' and '.join(event.signs_of_restart)}."
            text = f"The line is back after {event.lost_for_s:.1f} s.{signs if event.signs_of_restart else ''}"
            display.tell(LineNews(drive=event.drive, event="connection_restored", text=text))
