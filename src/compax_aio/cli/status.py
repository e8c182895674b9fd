"""``compax status``: how a drive stands, once or again and again."""

from __future__ import annotations

import asyncio
from typing import Annotated, Any, Final

from cyclopts import Parameter
from cyclopts.validators import Number

from .. import Drive
from ..compax.watch import Reading
from .asking import Asking
from .exit_codes import INTERRUPTED
from .interruption import moves_nothing
from .number_words import NUMBER
from .opening import DriveLine, Url
from .printing import Printing
from .standing import Standing, as_table
from .watching import follow

__all__ = ["status"]

_QUANTITIES: Final = ("status", "error", "position", "target", "following_error", "speed", "torque")


@moves_nothing
async def status(
    url: Url,
    *,
    watch: Annotated[
        bool, Parameter(name=("--watch", "-w"), negative=(), help="Read again and again, until Ctrl-C.")
    ] = False,
    interval_s: Annotated[
        float,
        NUMBER,
        Parameter(
            name=("--interval", "-i"),
            validator=Number(gte=0.02, lte=3600),
            help="Seconds from one reading to the next with `--watch`, if the line can do it.",
        ),
    ] = 0.5,
    line: DriveLine = DriveLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> int | None:
    """
    Say how a drive stands: every bit of its status, position, speed, torque, and the error that is present.

    With `--watch` the display is kept up to date until Ctrl-C; a line that is lost is tried again, and told. With
    `--json` as well, every reading is one line of JSON, and so is a line that is lost or back.

    ```sh
    compax status serial:///dev/ttyUSB0
    compax status tcp://192.168.1.50:4001 --watch --interval 0.2
    compax status sim://compax --watch --json
    ```
    """
    if not watch:
        async with line.open(url) as drive:
            standing = await _read(drive)
        printing.show(standing, as_table(standing))
        return None
    try:
        async with line.open(url) as drive:
            await follow(drive, _QUANTITIES, interval_s, _of, printing)
    except asyncio.CancelledError:
        return INTERRUPTED  # as a watch is meant to end; there is nothing to say
    return None


async def _read(drive: Drive) -> Standing:
    asking = Asking()
    values: dict[str, Any] = {name: await asking.ask(name, getattr(drive, name)()) for name in _QUANTITIES}
    return Standing(drive=drive.name, unit=drive.unit, refused=asking.refused, **values)


def _of(reading: Reading, unit: str) -> Standing:
    asking = Asking()
    for name, error in reading.errors.items():
        asking.note(name, error)
    values = {name: reading.values.get(name) for name in _QUANTITIES}
    return Standing(drive=reading.drive, unit=unit, refused=asking.refused, **values)
