"""``compax smc stop``: the axes of a line, softly one by one, or all at once without a ramp."""

from __future__ import annotations

import asyncio
from typing import Annotated, Any

from cyclopts import Parameter

from compax_aio import CompaxError
from compax_aio.smc import PartyLine
from compax_aio.smc.facts import POSSIBLE_NAMES

from ..exit_codes import OK, exit_code_of
from ..printing import Printing, tell_error
from ..progress import counting
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
    async with line.open(url) as party:  # asks nobody: an axis that is missing keeps no other from being stopped
        if abort:
            return await _abort(party, named, printing)
        return await (_stop_named(party, named, printing) if named else _stop_found(party, printing))


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
    stops = [_stop_one(party, each, printing) for each in named]
    return _shown(dict(zip(named, await asyncio.gather(*stops), strict=True)), printing)


async def _stop_found(party: PartyLine, printing: Printing) -> int:
    """Ask one name after the other, and stop each axis that answers while the next one is asked."""
    stops: dict[str, asyncio.Task[CompaxError | None]] = {}

    def stop_it(name: str) -> None:
        if name not in stops:
            stops[name] = asyncio.ensure_future(_stop_one(party, name, printing))

    for each in tuple(party.axes):  # of a chain, or the only one
        stop_it(each)
    if not stops:
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
            finally:
                await asyncio.gather(*stops.values())
    outcomes = {name: await task for name, task in stops.items()}
    if not outcomes:
        printing.show({"stopped": []}, "no axis answers, so none was stopped")
        return 4
    return _shown(outcomes, printing)


async def _stop_one(party: PartyLine, name: str, printing: Printing) -> CompaxError | None:
    """Stop one axis, and tell at once how that went."""
    axis = party.axis(name)
    called = f"axis {name}" if name else "the axis"
    try:
        await axis.stop()
        position = await axis.position()
    except CompaxError as error:
        if not printing.json:
            tell_error(error, as_document=False)
        return error
    if not printing.json:
        printing.show(None, f"{called} has acknowledged the stop, and stands at {position:g} steps")
    return None


def _shown(outcomes: dict[str, CompaxError | None], printing: Printing) -> int:
    if printing.json:
        documents: list[dict[str, Any]] = [
            {"axis": name, "stopped": error is None, **({} if error is None else {"error": error})}
            for name, error in outcomes.items()
        ]
        printing.show(documents)
    return next((exit_code_of(error) for error in outcomes.values() if error is not None), OK)


def _list(names: tuple[str, ...]) -> str:
    return ", ".join(f"axis {each}" if each else "the axis" for each in names)
