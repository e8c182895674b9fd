"""``compax haas watch``: what a control says, again and again, with what its programs print; nothing is asked twice."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from datetime import datetime
from typing import Annotated, Any, Final

from cyclopts import Parameter
from rich.console import Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from compax_aio.escaping import escaped
from compax_aio.haas.answers import Request
from compax_aio.haas.control import Control
from compax_aio.haas.events import ConnectionLost, ConnectionRestored, Overheard, Printed
from compax_aio.haas.watching import Reading

from ..exit_codes import OK
from ..interruption import moves_nothing, say_at_end
from ..number_words import NUMBER, WHOLE
from ..outlets import is_held_up
from ..printing import Printing, results_console
from ..warned import warnings_told_by
from .asking import Question, meaning_of, request_of, value_as_json, value_in_words
from .line import ControlLine, ControlUrl, SetUp

__all__ = ["Display", "follow_events", "watch"]

_USUAL: Final = ("Q500", "Q104", "Q201")
_MOST_NEWS: Final = 5
_LOOKS: Final = {"connection_restored": "green", "printed": "cyan", "warning": "bold red"}
_AGE_EVERY_S: Final = 1.0


@moves_nothing
async def watch(
    url: ControlUrl,
    *what: Question,
    interval: Annotated[
        float | None, NUMBER, Parameter(help="Seconds from one reading to the next; 1 if not given, and at least.")
    ] = None,
    changes: Annotated[bool, Parameter(negative=(), help="Leave out what says the same as before.")] = False,
    count: Annotated[int | None, WHOLE, Parameter(help="End after so many readings.")] = None,
    set_up: SetUp = SetUp(),  # noqa: B008 - it is frozen
    line: ControlLine = ControlLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> int:
    """
    Show what a control says, once a second or more rarely, until Ctrl-C; and the lines that its programs print (DPRNT).

    A silent control is asked ever more rarely, and a lost line is opened again; both are said. Program, mode and tool
    if nothing is named.

    ```sh
    compax haas watch serial:///dev/ttyUSB0
    compax haas watch serial:///dev/ttyUSB0 Q500 3027 1098 --interval 5 --changes
    compax haas watch serial:///dev/ttyUSB0 Q500 --count 10 --json
    ```
    """
    profile = set_up.known()
    requests = [request_of(each) for each in what or _USUAL]
    say_at_end("Watched no longer.")
    async with line.open(url, profile) as control:
        display = Display(requests, printing)
        with display:
            listening = asyncio.create_task(follow_events(control, display.tell))
            ageing = asyncio.create_task(display.grow_old())
            try:
                await _follow(control, requests, display, interval, count, only_changes=changes)
            finally:
                for each in (listening, ageing):
                    each.cancel()
                await asyncio.wait([listening, ageing])
    return OK


async def _follow(
    control: Control,
    requests: list[Request],
    display: Display,
    interval: float | None,
    count: int | None,
    *,
    only_changes: bool,
) -> None:
    wanted = [_quantity(each) for each in requests]
    seen = 0
    async with control.watch(*wanted, interval_s=interval, only_changes=only_changes) as readings:
        async for reading in readings:
            display.show(reading)
            seen += 1
            if count is not None and seen >= count:
                break


def _quantity(request: Request) -> str | int:
    return request.text if request.variable is None else request.variable


async def follow_events(control: Control, tell: Callable[[str, str], None]) -> None:
    """Tell what happens at the control meanwhile: printed lines, answers to others, a line that is lost or back."""
    async for event in control.events():
        if isinstance(event, Printed):
            tell("printed", f"{event.text}{' (damaged)' if event.is_damaged else ''}")
        elif isinstance(event, Overheard):
            tell("overheard", event.text)
        elif isinstance(event, ConnectionLost):
            tell("connection_lost", _short(event.reason))
        elif isinstance(event, ConnectionRestored):
            tell("connection_restored", f"the line is back after {event.lost_for_s:.1f} s")


def _short(reason: str) -> str:
    """Say in one line that the line was lost; what is true of drives alone is left out."""
    return f"the line was lost, and is tried again: {reason.partition('; ')[0]}"


class Display:
    """Shows readings and news: in place on a terminal, else one after the other."""

    def __init__(self, requests: list[Request], printing: Printing) -> None:
        self._requests = requests
        self._printing = printing
        self._live: Live | None = None
        self._reading: Reading | None = None
        self._news: list[Text] = []
        self._read_at = 0.0
        self._warnings = ExitStack()

    def __enter__(self) -> Display:
        console = results_console()
        if console.is_terminal and not self._printing.json:
            self._warnings.enter_context(warnings_told_by(lambda text: self.tell("warning", text)))
            self._live = Live(console=console, auto_refresh=False)
            self._live.start()
            self._draw()
        return self

    def __exit__(self, *_: object) -> None:
        live, self._live = self._live, None
        if live is not None:
            live.stop()
        self._warnings.close()

    def show(self, reading: Reading) -> None:
        """Show a reading."""
        self._reading, self._read_at = reading, asyncio.get_running_loop().time()
        if self._live is None:
            self._printing.show(_as_document(reading), self._as_line(reading))
        else:
            self._draw()

    def tell(self, event: str, text: str) -> None:
        """Tell what came in between: printed lines, a line that was lost."""
        if self._live is None:
            self._printing.show(
                {"event": event, "text": text}, f"{_clock()}  {event.replace('_', ' ')}: {escaped(text)}"
            )
            return
        if event == "connection_lost":
            return  # a warning says it as well
        self._news = [*self._news, Text(f"{_clock()}  {escaped(text)}", style=_LOOKS.get(event, ""))][-_MOST_NEWS:]
        self._draw()

    async def grow_old(self) -> None:
        """Say all the while how old the last reading is."""
        while True:
            await asyncio.sleep(_AGE_EVERY_S)
            self._draw()

    def _draw(self) -> None:
        if self._live is not None and not is_held_up(self._live.console.file):
            self._live.update(self._picture(), refresh=True)

    def _picture(self) -> RenderableType:
        ends = Text("Ctrl-C ends this", style="dim")
        if self._reading is None:
            return Group(Text("waiting for the first reading"), *self._news, ends)
        table = Table(box=None, pad_edge=False, show_header=False)
        table.add_column(style="bold", no_wrap=True)
        table.add_column(style="dim", no_wrap=True)
        table.add_column(overflow="fold")
        for request in self._requests:
            key = _quantity(request)
            error = self._reading.errors.get(key)
            words = Text(value_in_words(self._reading.values.get(key)))
            if error is not None:
                words = Text(f"not said: {error.what}", style="yellow")
            table.add_row(str(key), meaning_of(request), words)
        age_s = asyncio.get_running_loop().time() - self._read_at
        return Group(table, *self._news, Text(f"said {age_s:.0f} s ago; Ctrl-C ends this", style="dim"))

    def _as_line(self, reading: Reading) -> str:
        said = []
        for request in self._requests:
            key = _quantity(request)
            error = reading.errors.get(key)
            said.append(f"{key} {f'not said ({error.what})' if error else value_in_words(reading.values.get(key))}")
        return f"{_clock()}  {'  '.join(said)}"


def _as_document(reading: Reading) -> Mapping[str, Any]:
    return {
        "at": datetime.now().astimezone().isoformat(timespec="milliseconds"),
        "control": reading.control,
        "values": {str(key): value_as_json(value) for key, value in reading.values.items()},
        "errors": {str(key): error.what for key, error in reading.errors.items()},
    }


def _clock() -> str:
    return f"{datetime.now().astimezone():%H:%M:%S}"
