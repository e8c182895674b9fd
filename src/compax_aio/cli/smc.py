"""``compax smc``: AMS SMC steppers found, looked at, moved, stopped, programmed and named."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

from cyclopts import App, Parameter

from ..smc import Mode
from ..smc.vocabulary import check_name
from .printing import Printing
from .stepping.line import LineUrl, SmcLine
from .stepping.looking import scan, status
from .stepping.motions import home, move, run
from .stepping.programs import app as program
from .stepping.stopping import stop

__all__ = ["app"]

app = App(
    name="smc",
    help="""\
Move AMS SMC stepper axes on a party line, a daisy chain, or alone.

Begin with `compax smc scan URL`, which moves nothing. Positions are steps. A stop from software is no emergency stop:
have one in hardware, within reach.
""",
)
app.command(scan)
app.command(status)
app.command(move)
app.command(home)
app.command(run)
app.command(stop)
app.command(program)


@app.command
async def name(
    url: LineUrl,
    letter: Annotated[str, Parameter(name="NAME", help="One letter, A to Z or a to z.")],
    *,
    line: SmcLine = SmcLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    Give the one axis that is connected its name, by which it is known on a party line, and store it.

    The axis must be in single mode, alone on the line, and stand: it is reset twice, so it counts from elsewhere
    afterwards. Nothing is stored unless it shows just that name (DCB p. 23).

    ```sh
    compax smc name serial:///dev/ttyUSB0 X
    ```
    """
    check_name(letter, Mode.PARTY)
    async with replace(line, mode="single").open(url) as alone:
        await alone.name_axis(letter)
    printing.show(
        {"name": letter, "stored": True}, f"the axis is called {letter} now, and keeps that name; it was reset twice"
    )
