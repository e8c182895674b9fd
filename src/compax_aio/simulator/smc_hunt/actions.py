"""What users do with a party line and its axes: how each kind of action is drawn, and how it is done."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from random import Random
from typing import Any, Final

from compax_aio.errors import CompaxError, MoveError
from compax_aio.smc.axis import SmcAxis
from compax_aio.smc.moves import AxisMove

from ..hunt.scenario import Action
from .stage import PartyStage
from .testimony import AxisCall

__all__ = ["ACTIONS", "ActionKind"]

Arguments = dict[str, Any]

_ALL: Final = frozenset({"party", "daisy", "single"})
_WAITS_S: Final = (0.0, 0.0, 0.00107, 0.00411, 0.0207, 0.107, 0.407, 1.007)


@dataclass(frozen=True, slots=True)
class ActionKind:
    """One kind of action; it is drawn from chance, its number, and where its axis has its positions."""

    weight: float
    draw: Callable[[Random, int, float], Arguments]
    do: Callable[[PartyStage, Action], Awaitable[None]]
    of_line: bool = False
    modes: frozenset[str] = _ALL


def _nothing(_: Random, __: int, ___: float) -> Arguments:
    return {}


# Moving -----------------------------------------------------------------------------------------------------------


def _away(random: Random, number: int) -> int:
    """Return a distance that no other item has: what an axis does shows who has wanted it."""
    size = random.choice((1, 300, 1000, 3000)) + number
    return random.choice((-1, 1)) * size


def _draw_manner(random: Random) -> Arguments:
    return {
        "way": random.choice(("await",) * 4 + ("watch", "cancel", "stop", "stop axis", "time out")),
        "patience_s": random.choice(_WAITS_S),
        "timeout_s": random.choice((None, None, None, None, 0.5013, 0.0517)),
        "on_cancel": random.choice(("stop", "stop", "stop", "detach")),
        "again_s": random.choice((None, 0.0, 0.07, 0.5)),
    }


def _draw_move_to(random: Random, number: int, base: float) -> Arguments:
    target = 0.0 if not base and random.random() < 0.1 else base + _away(random, number)
    return {"number": target, **_draw_manner(random)}


def _draw_move_by(random: Random, number: int, _: float) -> Arguments:
    return {"number": float(_away(random, number)), **_draw_manner(random)}


def _draw_run(random: Random, number: int, _: float) -> Arguments:
    manner = _draw_manner(random)
    if manner["way"] in {"await", "watch"} and manner["timeout_s"] is None:
        manner["way"] = random.choice(("stop", "stop axis", "cancel", "time out", "speed", "speed"))
    return {"number": random.choice((-1, 1)) * (random.choice((100, 900, 2500)) + number), **manner}


def _draw_home(random: Random, number: int, _: float) -> Arguments:
    return {"number": 1000 + number, "sets_origin": random.random() < 0.7, **_draw_manner(random)}


def _move(method: str) -> Callable[[PartyStage, Action], Awaitable[None]]:
    async def move(stage: PartyStage, action: Action) -> None:
        call, begun = stage.begin(action, method, lambda axis: _begin(axis, method, action.arguments))
        if begun is not None:
            await _see_through(stage, action, call, begun)
        await _move_again(stage, action, method, call)

    return move


def _begin(axis: SmcAxis, method: str, given: Mapping[str, Any]) -> AxisMove:
    manner = {"timeout_s": given["timeout_s"], "on_cancel": given["on_cancel"]}
    if method == "home":
        return axis.home(given["number"], direction=1, sets_origin=given["sets_origin"], **manner)
    if method == "run program":
        return axis.program.run(0, **manner)
    begin: Callable[..., AxisMove] = getattr(axis, method)
    return begin(given["number"], **manner)


_FURTHER: Final = 50
"""Steps: more than there are items, so that a second motion is like no other."""


async def _move_again(stage: PartyStage, action: Action, method: str, first: AxisCall) -> None:
    """Ask for another motion after one that failed, as people do: what was told of the first binds the second."""
    again_s = action.arguments.get("again_s")
    if again_s is None or method not in {"move_to", "move_by"} or not isinstance(first.outcome, CompaxError):
        return
    await asyncio.sleep(again_s)
    other = {**action.arguments, "number": action.arguments["number"] + _FURTHER}
    _, begun = stage.begin(action, method, lambda axis: _begin(axis, method, other))
    if begun is not None:
        with suppress(CompaxError):
            await begun


async def _see_through(stage: PartyStage, action: Action, call: AxisCall, move: AxisMove) -> None:
    """Await it, perhaps not for long, or stop it on the way."""
    given = action.arguments
    (axis,) = action.axes
    match given["way"]:
        case "watch":
            async for _ in move.positions():
                pass
        case "cancel":
            await asyncio.wait([move], timeout=given["patience_s"])
            if move.cancel():
                call.cancelled_at = stage.now()
                # Whoever cancels it may wait for the stop that this has begun.
                await stage.tell(stage.note(action.number, axis, "stop move"), move.stop())
        case "time out":
            with suppress(TimeoutError, CompaxError):
                await asyncio.wait_for(move, given["patience_s"] or 0.3017)
        case "stop" | "stop axis":
            await asyncio.wait([move], timeout=given["patience_s"])
            what = "stop" if given["way"] == "stop axis" else "stop move"
            stopping = stage.axis(axis).stop if what == "stop" else move.stop
            await stage.tell(stage.note(action.number, axis, what), stopping())
        case "speed":
            with suppress(CompaxError, TimeoutError):
                await asyncio.wait_for(asyncio.shield(move.accepted), 3.0)
            other = -given["number"] + 3 if abs(given["number"]) % 2 else given["number"] + 500
            change = stage.note(action.number, axis, "change_speed", f"M{other}")
            await stage.tell(change, move.change_speed(other))
            await asyncio.wait([move], timeout=given["patience_s"])
            await stage.tell(stage.note(action.number, axis, "stop"), stage.axis(axis).stop())
    with suppress(CompaxError):
        await move


# Stopping and settling --------------------------------------------------------------------------------------------


async def _stop(stage: PartyStage, action: Action) -> None:
    await stage.ask(action, "stop", lambda axis: axis.stop())


async def _stop_all(stage: PartyStage, action: Action) -> None:
    await stage.ask_line(action, "stop all", lambda line: line.stop())


async def _abort_all(stage: PartyStage, action: Action) -> None:
    await stage.ask_line(action, "abort_all", lambda line: line.abort_all())


async def _reset(stage: PartyStage, action: Action) -> None:
    await stage.ask_line(action, "reset", lambda line: line.reset())


async def _reconcile(stage: PartyStage, action: Action) -> None:
    await stage.ask(action, "reconcile", lambda axis: axis.reconcile())


async def _set_origin(stage: PartyStage, action: Action) -> None:
    await stage.ask(action, "set_origin", lambda axis: axis.set_origin())


async def _close(stage: PartyStage, action: Action) -> None:
    await stage.ask_line(action, "close", lambda line: line.close())


# Reading ----------------------------------------------------------------------------------------------------------

_READS: Final[Mapping[str, Callable[[SmcAxis], Awaitable[Any]]]] = {
    "position": lambda axis: axis.position(),
    "status": lambda axis: axis.status(),
    "raw Z": lambda axis: axis.raw("Z"),
    "raw ^": lambda axis: axis.raw("^"),
    "raw Z0": lambda axis: axis.raw("Z 0"),
    "limits": lambda axis: axis.limits(),
    "port": lambda axis: axis.port(),
}


def _draw_reads(random: Random, _: int, __: float) -> Arguments:
    kinds = ("position", "position", "position", *_READS)
    return {"what": tuple(random.choices(kinds, k=random.choice((1, 1, 2, 3, 8))))}


async def _read(stage: PartyStage, action: Action) -> None:
    await asyncio.gather(*(stage.ask(action, what, _READS[what]) for what in action.arguments["what"]))


async def _scan(stage: PartyStage, action: Action) -> None:
    await stage.ask_line(action, "scan", lambda line: line.scan("".join(stage.testimony.far.axes) + "Q"))


# Writing ----------------------------------------------------------------------------------------------------------


def _draw_settings(random: Random, number: int, _: float) -> Arguments:
    speed = random.choice((500, 2000)) + number
    choices: tuple[Arguments, ...] = (
        {"slew_speed_steps_s": speed},
        {"initial_speed_steps_s": 100 + number, "slew_speed_steps_s": speed},
        {"acceleration_slope": 5 + number, "deceleration_slope": 6 + number},
        {"hold_current_percent": 3, "run_current_percent": number % 100},
        {"resolution": number % 9},
    )
    return {"settings": random.choice(choices), "stores": random.random() < 0.3}


async def _write_settings(stage: PartyStage, action: Action) -> None:
    given = action.arguments
    await stage.ask(action, "write settings", lambda axis: axis.settings.write(**given["settings"]), given["settings"])
    if given["stores"]:
        await stage.ask(action, "store", lambda axis: axis.settings.store())


def _draw_raw(random: Random, number: int, base: float) -> Arguments:
    texts = (
        f"R{base + _away(random, number):.0f}",
        f"+{30 + number}",
        f"-{600 + number}",
        f"M{700 + number}",
        "M0",
        f"V{900 + number}",
        "@",
        "O",
        "A8",
        "U1",
        "B",
    )
    return {"text": random.choice(texts)}


async def _raw(stage: PartyStage, action: Action) -> None:
    text = action.arguments["text"]
    await stage.ask(action, "raw", lambda axis: axis.raw(text), text)


_PROGRAM: Final = ("W2", "+{0}", "W0", "-{0}")


def _draw_program(_: Random, number: int, __: float) -> Arguments:
    return {"program": "\n".join(_PROGRAM).format(200 + number)}


async def _write_program(stage: PartyStage, action: Action) -> None:
    program = action.arguments["program"]
    await stage.ask(action, "write program", lambda axis: axis.program.write(program), program)


async def _list_program(stage: PartyStage, action: Action) -> None:
    await stage.ask(action, "list program", lambda axis: axis.program.list())


def _draw_edit(_: Random, number: int, __: float) -> Arguments:
    return {"instruction": f"W{3 + number}"}


async def _edit_program(stage: PartyStage, action: Action) -> None:
    new = action.arguments["instruction"]
    await stage.ask(action, "edit program", lambda axis: axis.program.edit(0, new), new)


def _draw_run_program(random: Random, _: int, __: float) -> Arguments:
    manner = _draw_manner(random)
    return {**manner, "timeout_s": manner["timeout_s"] or 4.0}


# What cannot be said ----------------------------------------------------------------------------------------------

_IMPOSSIBLE: Final[Mapping[str, Callable[[SmcAxis], Any]]] = {
    "move_to(nan)": lambda axis: axis.move_to(float("nan")),
    "move_to(1e7)": lambda axis: axis.move_to(1e7),
    "move_by(inf)": lambda axis: axis.move_by(float("inf")),
    "move_by(0)": lambda axis: axis.move_by(0.0001),
    "run(1)": lambda axis: axis.run(1),
    "run(25000)": lambda axis: axis.run(25_000),
    "home(1)": lambda axis: axis.home(1, direction=0),
    "home(no direction)": lambda axis: axis.home(1000),
    "raw LF": lambda axis: axis.raw("Z\nAR5"),
    "raw ESC": lambda axis: axis.raw("\x1b"),
    "raw long": lambda axis: axis.raw("R1234567890.1234"),
    "raw nothing": lambda axis: axis.raw(""),
    "raw stream": lambda axis: axis.raw("Z1"),
    "raw entry": lambda axis: axis.raw("P0"),
    "slopes": lambda axis: axis.settings.write(acceleration_slope=256, deceleration_slope=1),
    "speed": lambda axis: axis.settings.write(slew_speed_steps_s=19),
    "program": lambda axis: axis.program.write("R1 2 3\nXX"),
}


def _draw_impossible(random: Random, _: int, __: float) -> Arguments:
    return {"what": random.choice(list(_IMPOSSIBLE))}


async def _impossible(stage: PartyStage, action: Action) -> None:
    """Ask what cannot be said; nothing may be written until the error has come."""
    what = action.arguments["what"]

    async def ask(axis: SmcAxis) -> Any:
        answer = _IMPOSSIBLE[what](axis)
        with suppress(MoveError):
            return await answer

    await stage.ask(action, "impossible", ask, what)


async def _name_axis(stage: PartyStage, action: Action) -> None:
    await stage.ask_line(action, "name_axis", lambda line: line.name_axis("N"))


ACTIONS: Final[Mapping[str, ActionKind]] = {
    "move to": ActionKind(9, _draw_move_to, _move("move_to")),
    "move by": ActionKind(4, _draw_move_by, _move("move_by")),
    "run": ActionKind(2.5, _draw_run, _move("run")),
    "home": ActionKind(2, _draw_home, _move("home")),
    "read": ActionKind(4, _draw_reads, _read),
    "stop": ActionKind(1.5, _nothing, _stop),
    "stop all": ActionKind(1, _nothing, _stop_all, of_line=True),
    "abort all": ActionKind(1.2, _nothing, _abort_all, of_line=True),
    "reset": ActionKind(0.8, _nothing, _reset, of_line=True),
    "reconcile": ActionKind(1.5, _nothing, _reconcile),
    "set origin": ActionKind(0.8, _nothing, _set_origin),
    "settings": ActionKind(1.5, _draw_settings, _write_settings),
    "raw": ActionKind(2, _draw_raw, _raw),
    "write program": ActionKind(0.7, _draw_program, _write_program),
    "list program": ActionKind(0.4, _nothing, _list_program),
    "edit program": ActionKind(0.4, _draw_edit, _edit_program),
    "run program": ActionKind(0.7, _draw_run_program, _move("run program")),
    "impossible": ActionKind(1, _draw_impossible, _impossible),
    "scan": ActionKind(0.3, _nothing, _scan, of_line=True, modes=frozenset({"party", "daisy"})),
    "name axis": ActionKind(0.7, _nothing, _name_axis, of_line=True, modes=frozenset({"single"})),
    "close": ActionKind(0.4, _nothing, _close, of_line=True),
}
"""By name."""
