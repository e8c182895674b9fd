"""``compax move``: to a position, or by a distance."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from typing import Annotated

from cyclopts import Parameter

from compax_aio import CompaxError, ConnectionLostError, Drive, Move
from compax_aio.compax.moves import check_manner
from compax_aio.compax.vocabulary import MovePlan, plan_move_by, plan_move_to

from .interruption import say_at_end
from .moving import TimeoutS, carry_out, note_where_from, stop_interrupted
from .number_words import NUMBER, WHOLE
from .opening import DriveLine, Url
from .printing import Printing

__all__ = ["move"]


async def move(
    url: Url,
    position: Annotated[
        float,
        NUMBER,
        Parameter(
            allow_leading_hyphen=True,
            help="Target in the unit of the axis; with --by the distance from where it is now. It may be negative.",
        ),
    ],
    *,
    by: Annotated[bool, Parameter(negative=(), help="Move by a distance.")] = False,
    speed: Annotated[
        float | None,
        NUMBER,
        Parameter(help="In percent of nominal speed, above 0; if not given, the one that the drive was told last."),
    ] = None,
    acceleration_ms: Annotated[
        int | None, WHOLE, Parameter(help="From standstill to nominal speed, 0 to 65000; if not given, the last one.")
    ] = None,
    deceleration_ms: Annotated[int | None, WHOLE, Parameter(help="The same for braking.")] = None,
    timeout_s: TimeoutS = None,
    detach: Annotated[
        bool,
        Parameter(
            negative=(),
            help="Do not wait: return when the drive has accepted it. Then nobody watches it; `compax stop` stops it.",
        ),
    ] = False,
    line: DriveLine = DriveLine(),  # noqa: B008 - it is frozen
    printing: Printing = Printing(),  # noqa: B008 - it is frozen
) -> None:
    """
    Move to a position, or by a distance, and wait until it is reached.

    Ctrl-C stops the axis, and says where it stands. What the drive cannot be told is refused before anything is sent.

    ```sh
    compax move serial:///dev/ttyUSB0 120.5 --speed 20
    compax move serial:///dev/ttyUSB0 -12.5
    compax move tcp://192.168.1.50:4001 -3 --by
    ```
    """
    settings = line.drive_settings()
    plan_it = plan_move_by if by else plan_move_to
    plan = plan_it(
        position,
        settings,
        speed_percent=speed,
        acceleration_ms=acceleration_ms,
        deceleration_ms=deceleration_ms,
    )
    check_manner(timeout_s, "stop")
    async with line.open(url) as drive:
        if not by:
            await note_where_from(drive, printing)
        if detach:
            await _leave_alone(drive, plan, printing)
        else:
            await carry_out(drive, drive.start(plan, timeout_s=timeout_s), printing)


async def _leave_alone(drive: Drive, plan: MovePlan, printing: Printing) -> None:
    """Return when the drive has accepted the move, and let it go on."""
    going = drive.start(plan, on_cancel="detach")
    try:
        await going.accepted
    except asyncio.CancelledError:
        going.cancel()
        await stop_interrupted(drive, printing, was_sent=going.is_on_wire)
        raise
    told = f"{drive.name} has accepted {going.sent}; it goes on, and nobody watches it. `compax stop` stops it."
    say_at_end(f"Interrupted. {told}")
    printing.show({"drive": drive.name, "sent": going.sent, "target": going.target, "detached": True}, told)
    with suppress(CompaxError):
        await _let_go(drive, going)


async def _let_go(drive: Drive, going: Move) -> None:
    """Close the line under a move that goes on; it ends for us with the line."""
    await drive.close()
    with suppress(ConnectionLostError):
        await going
