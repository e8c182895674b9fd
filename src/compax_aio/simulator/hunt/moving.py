"""How users move drives: how moves are drawn, begun, awaited, given up and stopped."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from random import Random
from typing import Any, Final

from compax_aio.compax.group import DriveGroup
from compax_aio.compax.moves import Move, fetch_error
from compax_aio.errors import CompaxError, MoveError

from .scenario import Action
from .stage import Stage

__all__ = [
    "away",
    "draw_group",
    "draw_home",
    "draw_move",
    "draw_prepare",
    "home",
    "move",
    "move_group",
    "prepare",
]

Arguments = dict[str, Any]

_CHANCE_OF_A_SHORT_WAY: Final = 0.25
"""Such a move is over before its line is in step again."""
_CHANCE_OF_MORE_DECIMALS: Final = 0.1
_TO_BE_ROUNDED: Final = 0.0037
_WAITS_S: Final = (0.0, 0.0, 0.00107, 0.00411, 0.0207, 0.107, 0.407, 1.007)


def away(random: Random, number: int) -> float:
    """Return a distance that no other item has, sometimes with more decimals than the drive."""
    more = _TO_BE_ROUNDED if random.random() < _CHANCE_OF_MORE_DECIMALS else 0.0
    if random.random() < _CHANCE_OF_A_SHORT_WAY:
        return random.choice((-2, -1, 1, 2)) + number / 100 + more
    return random.choice((-1, 1, 4)) * round(random.uniform(5, 60)) + number / 100 + more


def _draw_way(random: Random) -> Arguments:
    return {
        "way": random.choice(("await", "await", "await", "watch", "cancel", "stop", "stop drive", "time out", "speed")),
        "patience_s": random.choice(_WAITS_S),
        "timeout_s": random.choice((None, None, None, None, 0.3013, 0.0517)),
    }


def _draw_options(random: Random) -> Arguments:
    options: Arguments = {"on_cancel": random.choice(("stop", "stop", "stop", "detach"))}
    if random.random() < 0.4:
        options["speed_percent"] = random.choice((25, 50, 100))
    if random.random() < 0.15:
        options["acceleration_ms"] = random.choice((0, 80, 300))
    if random.random() < 0.12:
        options["comparators"] = ((2, 3), (1, 4, 0))
    if random.random() < 0.08:
        options["steps"] = ((3, 40),)
    return options


def draw_move(random: Random, number: int, bases: list[float]) -> Arguments:
    """Draw a move, absolute or relative."""
    relative = random.random() < 0.3
    distance = away(random, number)
    return {
        "method": "move_by" if relative else "move_to",
        "number": distance if relative else bases[0] + distance,
        "options": _draw_options(random),
        **_draw_way(random),
    }


async def move(stage: Stage, action: Action) -> None:
    """Move, and do with the move what was drawn."""
    given = action.arguments
    (axis,) = action.axes
    move = stage.begin(
        action,
        axis,
        given["method"],
        lambda drive: getattr(drive, given["method"])(
            given["number"], timeout_s=given["timeout_s"], **given["options"]
        ),
    )
    if move is not None:
        await _see_through(stage, action, move, [move])


def draw_home(random: Random, _: int, __: list[float]) -> Arguments:
    """Draw a search for machine zero."""
    return _draw_way(random)


async def home(stage: Stage, action: Action) -> None:
    """Find machine zero."""
    (axis,) = action.axes
    move = stage.begin(action, axis, "home", lambda drive: drive.home(timeout_s=action.arguments["timeout_s"]))
    if move is not None:
        await _see_through(stage, action, move, [move])


def draw_prepare(random: Random, number: int, bases: list[float]) -> Arguments:
    """Draw a move that is held ready, and when it is triggered, if at all."""
    return {**draw_move(random, number, bases), "trigger_s": random.choice((None, *_WAITS_S))}


async def prepare(stage: Stage, action: Action) -> None:
    """Let a drive hold a move ready, and trigger it."""
    given = action.arguments
    (axis,) = action.axes
    move = stage.begin(
        action,
        axis,
        f"prepare_{given['method']}",
        lambda drive: getattr(drive, f"prepare_{given['method']}")(
            given["number"], timeout_s=given["timeout_s"], **given["options"]
        ),
    )
    if move is None:
        return
    futures: list[asyncio.Future[Any]] = [move, move.ready]  # type: ignore[attr-defined]
    await asyncio.wait(futures, return_when=asyncio.FIRST_COMPLETED)
    if given["trigger_s"] is None:
        move.cancel()
        return
    await asyncio.sleep(given["trigger_s"])
    with suppress(MoveError):
        move.trigger()  # type: ignore[attr-defined]
    await _see_through(stage, action, move, [move])


def draw_group(random: Random, number: int, bases: list[float]) -> Arguments:
    """Draw a move of several drives."""
    return {
        "home": random.random() < 0.15,
        "targets": tuple(base + away(random, number) for base in bases),
        "speed_percent": random.choice((None, 50, 100)),
        **_draw_way(random),
    }


async def move_group(stage: Stage, action: Action) -> None:
    """Move several drives."""
    given = action.arguments
    drives = {axis: stage.drives[axis] for axis in action.axes}
    calls = {axis: stage.note(action.number, axis, "group move", given) for axis in drives}
    try:
        group = DriveGroup(**drives)
        if given["home"]:
            move = group.home(timeout_s=given["timeout_s"])
        else:
            targets: Any = dict(zip(drives, given["targets"], strict=False))
            move = group.move_to(speed_percent=given["speed_percent"], timeout_s=given["timeout_s"], **targets)
    except CompaxError as error:
        for call in calls.values():
            stage.ended(call, error)
        return
    move.add_done_callback(fetch_error)
    for axis, each in move.moves.items():
        stage.follow(calls[axis], each)
    await _see_through(stage, action, move, list(move.moves.values()))


async def _see_through(stage: Stage, action: Action, move: asyncio.Future[Any], moves: list[Move]) -> None:
    """Await it, perhaps not for long, or stop it on the way."""
    given = action.arguments
    match given["way"]:
        case "watch":
            async for _ in moves[0].positions():
                pass
        case "cancel":
            await asyncio.wait([move], timeout=given["patience_s"])
            move.cancel()
        case "time out":
            with suppress(TimeoutError, CompaxError):
                await asyncio.wait_for(move, given["patience_s"] or 0.3017)
        case "stop" | "stop drive":
            await asyncio.wait([move], timeout=given["patience_s"])
            axis = action.axes[0]
            what = "stop" if given["way"] == "stop drive" else "stop move"
            call = stage.note(action.number, axis, what, None if what == "stop" else moves[0])
            await stage.tell(call, stage.drives[axis].stop() if what == "stop" else moves[0].stop())
        case "speed":
            await asyncio.wait([move], timeout=given["patience_s"])
            call = stage.note(action.number, action.axes[0], "change_speed")
            await stage.tell(call, moves[0].change_speed(60))
    with suppress(CompaxError):
        await move
