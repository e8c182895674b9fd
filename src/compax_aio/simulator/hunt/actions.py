"""What users do with drives: how each kind of action is drawn, and how it is done."""

from __future__ import annotations

import asyncio
import tempfile
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any, Final

from compax_aio.compax.drive import Drive
from compax_aio.compax.group import DriveGroup
from compax_aio.errors import CompaxError

from . import moving
from .scenario import Action
from .stage import Stage

__all__ = ["ACTIONS", "ActionKind"]

Arguments = dict[str, Any]


@dataclass(frozen=True, slots=True)
class ActionKind:
    """One kind of action; it is drawn from chance, its number, and where each of its axes has its positions."""

    weight: float
    draw: Callable[[Random, int, list[float]], Arguments]
    do: Callable[[Stage, Action], Awaitable[None]]
    of_group: bool = False


# Stopping and settling --------------------------------------------------------------------------------------------


def _nothing(_: Random, __: int, ___: list[float]) -> Arguments:
    return {}


async def _stop(stage: Stage, action: Action) -> None:
    await stage.ask(action, "stop", lambda drive: drive.stop())


async def _stop_group(stage: Stage, action: Action) -> None:
    drives = {axis: stage.drives[axis] for axis in action.axes}
    calls = [stage.note(action.number, axis, "stop", "all at once") for axis in drives]
    try:
        await DriveGroup(**drives).stop()
        outcome: BaseException | None = None
    except BaseException as error:
        outcome = error
        if not isinstance(error, CompaxError):
            raise
    finally:
        for call in calls:
            stage.ended(call, outcome)


async def _reconcile(stage: Stage, action: Action) -> None:
    await stage.ask(action, "quit", lambda drive: drive.quit())
    await stage.ask(action, "reconcile", lambda drive: drive.reconcile())


async def _close(stage: Stage, action: Action) -> None:
    await stage.ask(action, "close", lambda drive: drive.close())


# Reading ----------------------------------------------------------------------------------------------------------

_READS: Final[Mapping[str, Callable[[Drive], Awaitable[Any]]]] = {
    "position": lambda drive: drive.position(),
    "target": lambda drive: drive.target(),
    "speed": lambda drive: drive.speed(),
    "status": lambda drive: drive.status(),
    "error": lambda drive: drive.error(),
    "query S1": lambda drive: drive.query("S1"),
    "query S4": lambda drive: drive.query("S4"),
    "query P40": lambda drive: drive.query("P40"),
    "query V7": lambda drive: drive.query("V7"),
    "parameter 41": lambda drive: drive.parameters.read(41),
    "read_status 9": lambda drive: drive.read_status(9),
    "record 2": lambda drive: drive.program.read(2),
    "command S1": lambda drive: drive.command("S1"),
}


def _draw_reads(random: Random, _: int, __: list[float]) -> Arguments:
    return {"what": tuple(random.choices(list(_READS), k=random.choice((1, 1, 2, 3, 6, 15))))}


async def _read(stage: Stage, action: Action) -> None:
    await asyncio.gather(*(stage.ask(action, what, _READS[what]) for what in action.arguments["what"]))


def _draw_watch(random: Random, _: int, __: list[float]) -> Arguments:
    return {
        "quantities": random.choice(
            (("position",), ("position", "status"), ("speed", "S7"), ("P40", "V7", "position"))
        ),
        "interval_s": random.choice((0.005, 0.05, 0.2)),
        "readings": random.choice((1, 4, 10)),
    }


async def _watch(stage: Stage, action: Action) -> None:
    given = action.arguments
    (axis,) = action.axes
    call = stage.note(action.number, axis, "watch", given["quantities"])
    readings: list[Any] = []

    async def watch() -> list[Any]:
        async for reading in stage.drives[axis].watch(*given["quantities"], interval_s=given["interval_s"]):
            readings.append(reading)
            if len(readings) == given["readings"]:
                break
        return readings

    await stage.tell(call, watch())


async def _follow_events(stage: Stage, action: Action) -> None:
    (axis,) = action.axes
    call = stage.note(action.number, axis, "events")
    events: list[Any] = []

    async def follow() -> list[Any]:
        with suppress(TimeoutError):
            async with asyncio.timeout(action.arguments["for_s"]):
                async for event in stage.drives[axis].events():
                    events.append(event)  # noqa: PERF401  # what came before the time is over counts
        return events

    await stage.tell(call, follow())


# Saying and writing -----------------------------------------------------------------------------------------------


def _draw_command(random: Random, number: int, bases: list[float]) -> Arguments:
    if random.random() < 0.5:
        return {"text": f"PA{bases[0] + moving.away(random, number):.2f}", "moves": True}
    return {"text": random.choice(("SD 50", "AL 100", "OT O7=1", "VP", "GOTO 302", "GOTO 270")), "moves": False}


async def _command(stage: Stage, action: Action) -> None:
    (axis,) = action.axes
    text = action.arguments["text"]
    call = stage.note(action.number, axis, "command", text, text=text if action.arguments["moves"] else None)
    await stage.tell(call, stage.drives[axis].command(text))


_IMPOSSIBLE: Final[tuple[Callable[[Drive], Any], ...]] = (
    lambda drive: drive.move_to(float("nan")),
    lambda drive: drive.move_to(5e6),
    lambda drive: drive.move_to(10, speed_percent=0),
    lambda drive: drive.move_to(10, comparators=[(-1, 3)]),
    lambda drive: drive.move_by(1e30),
    lambda drive: drive.command("S1\rPA5"),
    lambda drive: drive.command("PA5$"),
    lambda drive: drive.command("X" * 31),
    lambda drive: drive.command("PÄ5"),
    lambda drive: drive.query("POSA 5"),
    lambda drive: drive.query(""),
    lambda drive: drive.parameters.write(40, float("inf")),
    lambda drive: drive.parameters.read(0),
    lambda drive: drive.read_status(251),
)


def _draw_impossible(random: Random, _: int, __: list[float]) -> Arguments:
    return {"which": random.randrange(len(_IMPOSSIBLE))}


async def _say_what_cannot_be_said(stage: Stage, action: Action) -> None:
    (axis,) = action.axes
    call = stage.note(action.number, axis, "impossible", action.arguments["which"])

    async def say() -> Any:
        work = _IMPOSSIBLE[action.arguments["which"]](stage.drives[axis])
        return await work

    await stage.tell(call, say())


def _draw_write(random: Random, number: int, bases: list[float]) -> Arguments:
    return {"number": random.randint(40, 42), "value": bases[0] + number + 0.5, "of": random.choice(("P", "P", "V"))}


async def _write(stage: Stage, action: Action) -> None:
    of, number, value = action.arguments["of"], action.arguments["number"], action.arguments["value"]
    if of == "P":
        await stage.ask(action, "write", lambda drive: drive.parameters.write(number, value), (f"P{number}", value))
    else:
        await stage.ask(
            action, "write", lambda drive: drive.variables.write(number - 35, value), (f"V{number - 35}", value)
        )


def _draw_configure(_: Random, number: int, __: list[float]) -> Arguments:
    return {"value": float(number + 1)}


async def _configure(stage: Stage, action: Action) -> None:
    async def configure(drive: Drive) -> None:
        async with drive.parameters.unlocked():
            await drive.parameters.write(38, action.arguments["value"])
            await drive.parameters.make_valid()

    await stage.ask(action, "configure", configure)


async def _save_and_restore(stage: Stage, action: Action) -> None:
    with tempfile.TemporaryDirectory(prefix="hunt") as folder:
        path = Path(folder) / "values.toml"

        async def save_and_restore(drive: Drive) -> None:
            await drive.variables.save(path)
            await drive.variables.write(7, action.arguments["value"])
            await drive.variables.restore(path)

        await stage.ask(action, "restore", save_and_restore)


# Programs ---------------------------------------------------------------------------------------------------------


def _draw_program(random: Random, _: int, __: list[float]) -> Arguments:
    return {"record": random.choice((1, 1, None)), "way": random.choice(("wait", "wait", "stop", "break", "leave"))}


async def _run_program(stage: Stage, action: Action) -> None:
    await stage.ask(action, "program.start", lambda drive: drive.program.start(action.arguments["record"]))
    match action.arguments["way"]:
        case "wait":
            await stage.ask(action, "program.wait", lambda drive: drive.program.wait_finished(5))
        case "stop":
            await stage.ask(action, "program.stop", lambda drive: drive.program.stop())
        case "break":
            await stage.ask(action, "program.break_off", lambda drive: drive.program.break_off())


def _draw_power(random: Random, _: int, __: list[float]) -> Arguments:
    return {"on_after_s": random.choice((0.0, 0.1))}


async def _switch_power(stage: Stage, action: Action) -> None:
    await stage.ask(action, "power", lambda drive: drive.power("off"))
    await asyncio.sleep(action.arguments["on_after_s"])
    await stage.ask(action, "power", lambda drive: drive.power("on"))


def _draw_events(random: Random, _: int, __: list[float]) -> Arguments:
    return {"for_s": random.choice((0.5, 5.0))}


ACTIONS: Final[Mapping[str, ActionKind]] = {
    "move": ActionKind(6, moving.draw_move, moving.move),
    "home": ActionKind(1, moving.draw_home, moving.home),
    "prepare": ActionKind(2.5, moving.draw_prepare, moving.prepare),
    "group move": ActionKind(3, moving.draw_group, moving.move_group, of_group=True),
    "stop": ActionKind(2, _nothing, _stop),
    "group stop": ActionKind(0.7, _nothing, _stop_group, of_group=True),
    "reconcile": ActionKind(1, _nothing, _reconcile),
    "close": ActionKind(0.4, _nothing, _close),
    "read": ActionKind(4, _draw_reads, _read),
    "watch": ActionKind(1, _draw_watch, _watch),
    "events": ActionKind(0.5, _draw_events, _follow_events),
    "command": ActionKind(2, _draw_command, _command),
    "impossible": ActionKind(0.5, _draw_impossible, _say_what_cannot_be_said),
    "write": ActionKind(1.2, _draw_write, _write),
    "configure": ActionKind(0.3, _draw_configure, _configure),
    "restore": ActionKind(0.05, _draw_configure, _save_and_restore),
    "program": ActionKind(1, _draw_program, _run_program),
    "power": ActionKind(0.3, _draw_power, _switch_power),
}
"""By name."""
