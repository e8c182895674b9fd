"""Looking at axes on a line, which moves nothing: who is there, how each stands, once or again and again."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Annotated, Any

from cyclopts import Parameter
from cyclopts.validators import Number
from rich.live import Live
from rich.table import Table
from rich.text import Text

from compax_aio import CompaxError, InvalidCommandError
from compax_aio.smc import AxisStatus, PartyLine
from compax_aio.smc.facts import POSSIBLE_NAMES

from ..exit_codes import INTERRUPTED
from ..interruption import moves_nothing
from ..number_words import NUMBER
from ..printing import Printing, results_console
from ..progress import counting
from .line import THE_ONLY, LineUrl, SmcLine

__all__ = ["found_on", "scan", "status"]


@dataclass(frozen=True, kw_only=True)
class AxisStanding:
    """How one axis stands; what is None was not said, and *error* says why."""

    axis: str
    position: float | None = None
    status: AxisStatus | None = None
    lost_reference: str | None = None
    """Why nobody knows what positions are counted from, if anything speaks for that."""
    error: str | None = None


@moves_nothing
async def scan(
    url: LineUrl,
    *,
    names: Annotated[
        str, Parameter(help="Letters to ask, as in ABCxyz; if not given all of them, A to Z and a to z: half a minute.")
    ] = "",
    line: SmcLine = SmcLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> int | None:
    """
    Find out which axes are on a line, and how each stands. It moves nothing.

    An LF goes first, so that every axis looks for its name. Exits with 4 if nobody answers.

    ```sh
    compax smc scan serial:///dev/ttyUSB0
    compax smc scan serial:///dev/ttyUSB0 --names XYZ
    ```
    """
    asked = _letters(names, line)
    async with line.open(url) as party:
        found = await found_on(party, asked, printing)
        standings = [await _look(party, each) for each in found]
    printing.show(standings, _table(standings) if standings else "no axis answers")
    if not standings:
        printing.note(
            "Check power, cable and adapter, the baud rate, and the mode: the input is read at a reset (DCB p. 20)."
        )
        return 4
    return None


def _letters(names: str, line: SmcLine) -> str:
    if line.mode == "single":
        raise InvalidCommandError("in single mode there is one axis, and it has no name", hint="`status URL -` asks it")
    for each in names:
        line.check(each)
    return names or POSSIBLE_NAMES


async def found_on(party: PartyLine, names: Iterable[str], printing: Printing) -> tuple[str, ...]:
    """Return the axes that are on the line: a chain has told them, on a party line each name is asked."""
    if party.axes:
        return tuple(party.axes)
    asked = tuple(names)
    done = 0
    with counting("asking names", printing) as on_progress:

        def on_each(_name: str, _is_there: bool) -> None:
            nonlocal done
            done += 1
            on_progress(done, len(asked))

        return await party.scan(asked, on_each=on_each)


@moves_nothing
async def status(
    url: LineUrl,
    *axes: Annotated[
        str, Parameter(allow_leading_hyphen=True, help="Their letters; if there are none, all are looked for first.")
    ],
    watch: Annotated[
        bool, Parameter(name=("--watch", "-w"), negative=(), help="Look again and again, until Ctrl-C.")
    ] = False,
    interval_s: Annotated[
        float,
        NUMBER,
        Parameter(name=("--interval", "-i"), validator=Number(gte=0.02, lte=3600), help="Seconds between looks."),
    ] = 0.5,
    line: SmcLine = SmcLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> int | None:
    """
    Say how axes stand: position, and every bit of the motion status that is known. It moves nothing.

    ```sh
    compax smc status serial:///dev/ttyUSB0 X Y
    compax smc status serial:///dev/ttyUSB0 X --watch --json
    compax smc status sim://smc?mode=single - --mode single
    ```
    """
    named = tuple(dict.fromkeys(line.check(each) for each in axes))
    try:
        async with line.open(url, named) as party:
            asked = named or await found_on(party, POSSIBLE_NAMES if line.mode == "party" else (), printing)
            if watch:
                await _watch(party, asked, interval_s, printing)
            standings = [await _look(party, each) for each in asked]
    except asyncio.CancelledError:
        if watch:
            return INTERRUPTED  # as a watch is meant to end; there is nothing to say
        raise
    printing.show(standings, _table(standings) if standings else "no axis answers")
    return None if standings else 4


async def _watch(party: PartyLine, axes: Sequence[str], interval_s: float, printing: Printing) -> None:
    """Show *axes* again and again, through lost lines, until the task is cancelled."""
    console = results_console()
    if printing.json or not console.is_terminal:
        while True:
            for each in axes:
                standing = await _look_patiently(party, each)
                printing.show(standing, _as_line(standing))
            await asyncio.sleep(interval_s)
    with Live(console=console, auto_refresh=False) as live:
        while True:
            live.update(_table([await _look_patiently(party, each) for each in axes]), refresh=True)
            await asyncio.sleep(interval_s)


async def _look(party: PartyLine, name: str) -> AxisStanding:
    axis = party.axis(name)
    status, position = await axis.status(), await axis.position()
    return AxisStanding(axis=name or THE_ONLY, position=position, status=status, lost_reference=axis.lost_reference)


async def _look_patiently(party: PartyLine, name: str) -> AxisStanding:
    """Look at an axis, and say what is wrong if that fails: a line that was lost is tried again all the while."""
    try:
        return await _look(party, name)
    except CompaxError as error:
        return AxisStanding(axis=name or THE_ONLY, error=error.what)


def _told(status: AxisStatus) -> str:
    flags: dict[str, Any] = asdict(status)
    words = [key.replace("_", " ") for key, value in flags.items() if value is True]
    if status.unknown:
        words.append(f"bits of unknown meaning: {status.unknown}")
    return ", ".join(words) or "stands"


def _as_line(standing: AxisStanding) -> str:
    if standing.status is None:
        return f"{standing.axis}  {standing.error}"
    return f"{standing.axis}  {standing.position:g} steps, {_told(standing.status)}"


def _table(standings: Sequence[AxisStanding]) -> Table:
    table = Table(box=None, pad_edge=False)
    table.add_column("axis")
    table.add_column("position", justify="right")
    table.add_column("status")
    for each in standings:
        if each.status is None or each.position is None:
            table.add_row(Text(each.axis, style="bold"), "", Text(each.error or "", style="red"))
            continue
        told = Text(_told(each.status))
        if each.lost_reference is not None:
            told.append(f"; what it counts from is not known: {each.lost_reference}", style="yellow")
        table.add_row(Text(each.axis, style="bold"), f"{each.position:g} steps", told)
    return table
