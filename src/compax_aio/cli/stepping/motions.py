"""Moves of one axis at the terminal: moved, homed, run; watched until it stands, stopped by Ctrl-C."""

from __future__ import annotations

import asyncio
from typing import Annotated, Final, Literal

from cyclopts import Parameter

from compax_aio import MoveResult
from compax_aio.smc import AxisMove
from compax_aio.smc.vocabulary import plan_home, plan_move_by, plan_move_to, plan_run

from ...motion.moves import check_manner
from ..interruption import in_motion, say_at_end
from ..moving import MoveView, TimeoutS, following, stop_interrupted, until_ended, written
from ..number_words import NUMBER, WHOLE
from ..printing import Printing
from .line import AxisName, AxisOnLine, LineUrl, SmcLine

__all__ = ["carry_out", "home", "move", "run"]

_CONFIRMED: Final = "confirmed by its status (^) in two looks, and its position"


async def move(
    url: LineUrl,
    axis: AxisName,
    position: Annotated[
        float,
        NUMBER,
        Parameter(
            allow_leading_hyphen=True,
            help="Target in steps from the origin; with --by the distance from where it stands. It may be negative.",
        ),
    ],
    *,
    by: Annotated[bool, Parameter(negative=(), help="Move by a distance.")] = False,
    timeout_s: TimeoutS = None,
    line: SmcLine = SmcLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    Move an axis to a position, or by a distance, and wait until it stands there.

    The origin is where the axis stood when it was switched on, until it was homed. Ctrl-C stops it.

    ```sh
    compax smc move serial:///dev/ttyUSB0 X 12000
    compax smc move serial:///dev/ttyUSB0 X -500 --by
    compax smc move sim://smc?mode=single - 100 --mode single
    ```
    """
    plan_it = plan_move_by if by else plan_move_to
    plan_it(position, line.settings.profile)  # refuses before a line is opened
    check_manner(timeout_s, "stop")
    async with line.open_axis(url, axis) as moved:
        start = moved.axis.move_by if by else moved.axis.move_to
        await carry_out(moved, start(position, timeout_s=timeout_s), printing)


async def home(
    url: LineUrl,
    axis: AxisName,
    *,
    speed: Annotated[int, WHOLE, Parameter(help="Steps per second; begin slowly.")],
    toward: Annotated[
        Literal["plus", "minus"] | None, Parameter(help="Where the search begins, if the profile knows which that is.")
    ] = None,
    direction: Annotated[int | None, WHOLE, Parameter(help="Else 0 or 1, as it is sent (F).")] = None,
    origin: Annotated[bool, Parameter(negative="--no-origin", help="Count from there on from 0.")] = True,
    timeout_s: TimeoutS = None,
    line: SmcLine = SmcLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    Search for the home switch, and count from there.

    Which of the directions 0 and 1 is plus, sources contradict each other about: find it out at low speed, with a hand
    on the emergency stop. Ctrl-C stops the axis.

    ```sh
    compax smc home serial:///dev/ttyUSB0 X --speed 400 --direction 1
    compax smc home serial:///dev/ttyUSB0 X --speed 400 --toward minus --profile im483i
    ```
    """
    toward_plus = None if toward is None else toward == "plus"
    plan_home(speed, line.settings.profile, toward_plus=toward_plus, direction=direction)
    check_manner(timeout_s, "stop")
    async with line.open_axis(url, axis) as moved:
        search = moved.axis.home(
            speed, toward_plus=toward_plus, direction=direction, sets_origin=origin, timeout_s=timeout_s
        )
        await carry_out(moved, search, printing)


async def run(
    url: LineUrl,
    axis: AxisName,
    speed: Annotated[
        int,
        WHOLE,
        Parameter(allow_leading_hyphen=True, help="Steps per second, constant; below zero toward minus."),
    ],
    *,
    for_s: Annotated[
        float | None, NUMBER, Parameter(name="--for", help="Seconds, then it is stopped; if not given: until Ctrl-C.")
    ] = None,
    line: SmcLine = SmcLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    Run an axis at constant speed for a time, or until Ctrl-C stops it.

    ```sh
    compax smc run serial:///dev/ttyUSB0 X 800 --for 5
    ```
    """
    plan_run(speed, line.settings.profile)
    check_manner(for_s, "stop")
    async with line.open_axis(url, axis) as moved:
        going = moved.axis.run(speed)
        try:
            with in_motion(moved.name), MoveView(moved, going, printing) as view:
                async with following(moved, view):
                    await going.accepted
                    await asyncio.wait([going], timeout=for_s)
                if going.done():
                    await going  # raises why: nobody here has stopped it
                await moved.stop()
        except asyncio.CancelledError:
            going.cancel()
            await stop_interrupted(moved, printing, was_sent=going.is_on_wire)
            raise
        say_at_end(f"Interrupted. {moved.name} had been stopped before, and stands.")
        position = await moved.position()
    printing.show(
        {"axis": moved.name, "speed_steps_s": speed, "position": position, "unit": moved.unit},
        f"{moved.name} was stopped, and stands at {written(moved, position)}",
    )


async def carry_out(moved: AxisOnLine, move: AxisMove, printing: Printing, *, what: str = "") -> None:
    """
    Await *move* under a progress bar, and say how it ended; *what* in place of "… reached".

    Where the program is interrupted meanwhile, the axis is stopped, and that is said.

    Raises:
        CompaxError: The move did not reach its target, or the axis could not be stopped.
    """

    def reached(result: MoveResult) -> str:
        return what or f"{'home' if result.target is None else written(moved, result.target)} reached"

    result, position, standing = await until_ended(
        moved, move, printing, lambda result: f"{moved.name}: {reached(result)}"
    )
    printing.show(
        {
            "axis": moved.name,
            "target": result.target,
            "confirmed_by": result.confirmed_by,
            "duration_s": result.duration_s,
            "position": position,
            "unit": moved.unit,
        },
        f"{moved.name}: {reached(result)} in {result.duration_s:.2f} s, {_CONFIRMED}{standing}",
    )
