"""``compax smc stop``: the axes of a line, softly one by one, or all at once without a ramp."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Iterable, Mapping
from contextlib import asynccontextmanager, suppress
from typing import Annotated, Any

from cyclopts import Parameter

from compax_aio import AnswerTimeoutError, CompaxError, UnexpectedAnswerError
from compax_aio.smc import PartyLine
from compax_aio.smc.facts import POSSIBLE_NAMES

from ..exit_codes import OK, exit_code_of
from ..interruption import say_at_end
from ..printing import Printing, tell_error
from ..progress import counting
from ..stops_under_way import let_end
from .line import LineUrl, SmcLine

__all__ = ["stop"]


async def stop(
    url: LineUrl,
    *axes: Annotated[
        str, Parameter(allow_leading_hyphen=True, help="Their letters; if there are none, each that is found.")
    ],
    abort: Annotated[
        bool, Parameter(negative=(), help="ESC, without a ramp: EVERY axis of the line, also those not named, at once.")
    ] = False,
    line: SmcLine = SmcLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> int:
    """
    Stop axes softly (@), and wait until each stands; all of the line if none is named.

    Nobody on a party line can be told to stop without a name: without names, every letter is asked, and each axis is
    stopped as soon as it is found. That takes half a minute until the last letter: name them, or say --abort, which is
    heard by all at once, even in the middle of a program. It is no emergency stop.

    ```sh
    compax smc stop serial:///dev/ttyUSB0 X Y
    compax smc stop serial:///dev/ttyUSB0 --abort
    ```
    """
    named = tuple(dict.fromkeys(line.check(each) for each in axes))
    code = OK
    try:
        async with line.open(url) as party:  # asks nobody: an axis that is missing keeps no other from being stopped
            if abort:
                code = await _abort(party, named, printing)
            else:
                code = await (_stop_named(party, named, printing) if named else _stop_found(party, printing))
    except CompaxError:
        if code == OK:
            raise  # else it has been told already, and was tried in vain once more as the line was closed
    return code


async def _abort(party: PartyLine, named: tuple[str, ...], printing: Printing) -> int:
    for each in named:
        party.axis(each)
    await party.abort_all()
    known = tuple(party.axes)
    stand = (
        f"{_list(known)} stand{'s' if len(known) == 1 else ''}"
        if known
        else "whether the axes stand was not looked at, for none was named"
    )
    printing.show(
        {"aborted": True, "standing": list(known)},
        f"ESC was sent to every axis of the line; {stand}. A motor that was fast may have lost steps: home it.",
    )
    return OK


async def _stop_named(party: PartyLine, named: tuple[str, ...], printing: Printing) -> int:
    stops = {each: asyncio.ensure_future(_stop_one(party, each, printing)) for each in named}
    async with _let_end_if_interrupted(party, stops):
        await asyncio.wait(stops.values())
    return _shown({name: task.result() for name, task in stops.items()}, printing)


async def _stop_found(party: PartyLine, printing: Printing) -> int:
    """Ask one name after the other, and stop each axis that answers while the next one is asked."""
    stops: dict[str, asyncio.Task[CompaxError | None]] = {}

    def stop_it(name: str) -> None:
        if name not in stops:
            stops[name] = asyncio.ensure_future(_stop_one(party, name, printing))

    for each in tuple(party.axes):  # of a chain, or the only one
        stop_it(each)
    if not stops:
        async with _let_end_if_interrupted(party, stops, also=" Not every name had been asked."):
            await _find(party, stop_it, stops, printing)
    async with _let_end_if_interrupted(party, stops):
        outcomes = {name: await asyncio.shield(task) for name, task in stops.items()}
    if not outcomes:
        printing.show({"stopped": []}, "no axis answers, so none was stopped")
        return 4
    return _shown(outcomes, printing)


async def _find(
    party: PartyLine, stop_it: Callable[[str], None], stops: Mapping[str, asyncio.Task[Any]], printing: Printing
) -> None:
    done = 0
    with counting("asking names", printing) as on_progress:

        def on_each(name: str, is_there: bool) -> None:
            nonlocal done
            done += 1
            on_progress(done, len(POSSIBLE_NAMES))
            if is_there:
                stop_it(name)

        try:
            await party.scan(on_each=on_each)
        except CompaxError:
            await asyncio.gather(*stops.values())
            raise


@asynccontextmanager
async def _let_end_if_interrupted(
    party: PartyLine, stops: Mapping[str, asyncio.Task[CompaxError | None]], *, also: str = ""
) -> AsyncIterator[None]:
    """Let stops that have begun come to their end although the command is interrupted, and say how they ended."""
    try:
        yield
    except asyncio.CancelledError:
        unknown = await let_end(stops, party.settings.standstill_timeout_s, lambda error: error is None)
        if unknown:
            told = f"Whether these stand is not known, look at them: {_list(unknown)}."
        else:
            told = f"Acknowledged the stop, and stand: {_list(stops)}." if stops else "No axis was stopped."
        say_at_end(f"Interrupted. {told}{also}")
        raise


async def _stop_one(party: PartyLine, name: str, printing: Printing) -> CompaxError | None:
    """Stop one axis, and tell at once how that went."""
    axis = party.axis(name)
    called = f"axis {name}" if name else "the axis"
    try:
        await axis.stop()
    except CompaxError as error:
        if isinstance(error, AnswerTimeoutError | UnexpectedAnswerError):
            error.add_note("Check power, cable, baud rate and parity, and the mode.")
        if not printing.json:
            tell_error(error, as_document=False)
        return error
    where = ""
    with suppress(CompaxError):
        where = f" at {await axis.position():g} steps"
    if not printing.json:
        printing.show(None, f"{called} has acknowledged the stop, and stands{where}")
    return None


def _shown(outcomes: dict[str, CompaxError | None], printing: Printing) -> int:
    if printing.json:
        documents: list[dict[str, Any]] = [
            {"axis": name, "stopped": error is None, **({} if error is None else {"error": error})}
            for name, error in outcomes.items()
        ]
        printing.show(documents)
    return next((exit_code_of(error) for error in outcomes.values() if error is not None), OK)


def _list(names: Iterable[str]) -> str:
    return ", ".join(f"axis {each}" if each else "the axis" for each in names)
