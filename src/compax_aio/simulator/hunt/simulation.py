"""Runs one scenario from opening the lines to leaving the block, in virtual time, and gives what was seen."""

from __future__ import annotations

import asyncio
from typing import Final

import compax_aio
from compax_aio.simulator.compax.drive import SimulatedDrive
from compax_aio.simulator.compax.log import MAX_ENTRIES
from compax_aio.simulator.line import DeviceLine

from .actions import ACTIONS
from .running import all_ended, carried_out, in_time, let_go_of_tasks, run, told
from .scenario import Action, DrivePlan, Scenario, Trouble
from .stage import Stage
from .testimony import Seen, SeenAxis, longest_opening_s
from .troubled_line import TroubledLine
from .troubles import Far, befall
from .weighing import weigh

__all__ = ["PROGRAM_TARGET", "simulate"]

PROGRAM_TARGET: Final = 333.0
"""Where the program in every drive goes, from where its axis has its positions."""
_LOOKED_EVERY_S: Final = 0.1
_AFTERWARDS_S: Final = 60.0
"""So long it is watched whether an axis that was left begins to move."""


def simulate(scenario: Scenario, *, log_entries: int = MAX_ENTRIES) -> Seen:
    """
    Run *scenario*; two runs of the same one are the same to the last byte.

    Args:
        scenario: What is done, and what befalls.
        log_entries: How much each simulated drive remembers of what it has done.
    """
    testimony = Seen(scenario)
    run(lambda: _run(testimony, log_entries))
    return testimony


async def _run(testimony: Seen, log_entries: int) -> None:
    loop = asyncio.get_running_loop()
    loop.set_exception_handler(lambda _, context: testimony.complaints.append(told(context)))
    stage = Stage(testimony)
    scenario = testimony.scenario
    for plan in scenario.drives:
        _build(stage, plan, log_entries)
    opening = {plan.axis: asyncio.ensure_future(_open(stage, plan)) for plan in scenario.drives}
    troubles: list[asyncio.Task[None]] = []
    users: list[asyncio.Task[None]] = []
    starting = [
        asyncio.ensure_future(in_time(scenario.troubles, lambda each: _befall(stage, each), troubles)),
        asyncio.ensure_future(in_time(scenario.actions, lambda each: _act(stage, each, opening), users)),
    ]
    begins_s = max((each.at_s for each in (*scenario.actions, *scenario.troubles)), default=0.0)
    await asyncio.wait(opening.values(), timeout=begins_s)
    await asyncio.sleep(max(0.0, begins_s - loop.time()))
    await all_ended(starting, testimony.complaints, "something does not begin")
    await all_ended([*opening.values(), *users], testimony.complaints, "a caller waits for ever")
    testimony.left_at = loop.time()
    await all_ended(troubles, testimony.complaints, "a trouble does not end")
    for axis in testimony.axes.values():
        _heal(stage, axis)
    await all_ended(
        [asyncio.ensure_future(_leave(stage, axis)) for axis in stage.drives], testimony.complaints, "no leaving"
    )
    for axis in testimony.axes.values():
        axis.moving_at_end, axis.motions_at_end = axis.far.moving, len(axis.motions)
    testimony.lasted_s = loop.time()
    await asyncio.sleep(_AFTERWARDS_S)
    for line in stage.lines.values():
        line.close()
    for name in stage.drives:
        _weigh(stage, name)
    stage.drives.clear()
    testimony.left += await let_go_of_tasks()


def _build(stage: Stage, plan: DrivePlan, log_entries: int) -> None:
    """Put a drive, and the line to it, where the client will find them."""
    far = SimulatedDrive(plan.knobs, name=plan.axis, log_entries=log_entries)
    base = plan.knobs.position
    far.load_program(["WAIT 100", f"POSA {base + PROGRAM_TARGET:.2f}", "END"])
    axis = SeenAxis(plan, far)
    stage.testimony.axes[plan.axis] = axis
    stage.lines[plan.axis] = TroubledLine(plan.axis, far, axis.wire, axis.strangers)
    if plan.left_over:
        DeviceLine.of(far).receive(plan.left_over)


async def _open(stage: Stage, plan: DrivePlan) -> None:
    call = stage.note(plan.number, plan.axis, "connect")
    work = _connect(stage.lines[plan.axis].url, plan)
    if (drive := await stage.tell(call, work)) is not None:
        stage.drives[plan.axis] = drive
        stage.follow_events(plan.axis, drive)


async def _connect(url: str, plan: DrivePlan) -> compax_aio.Drive:
    return await compax_aio.connect(url, name=plan.axis, settings=plan.settings)


async def _befall(stage: Stage, trouble: Trouble) -> None:
    for axis in trouble.axes or tuple(stage.lines)[:1]:
        await befall(trouble, Far(stage.axis(axis).far, stage.lines[axis]))
        if trouble.kind == "flood":
            _weigh(stage, axis)


async def _act(stage: Stage, action: Action, opening: dict[str, asyncio.Task[None]]) -> None:
    """Let a user do something, and perhaps give it up."""
    await asyncio.wait([opening[axis] for axis in action.axes])
    if not all(axis in stage.drives for axis in action.axes):
        return
    await carried_out(action, ACTIONS[action.kind].do(stage, action), stage.testimony.complaints)


def _weigh(stage: Stage, axis: str) -> None:
    if axis in stage.drives:
        stage.axis(axis).weight = max(stage.axis(axis).weight, weigh(stage.drives[axis]))


def _heal(stage: Stage, axis: SeenAxis) -> None:
    """Let every line, and every drive, work from now on."""
    stage.lines[axis.plan.axis].heal()
    axis.far.lose_answers = 0
    axis.far.lose_position_reached = 0


async def _leave(stage: Stage, axis: str) -> None:
    """Ask once more, for that must work, and leave the block."""
    drive = stage.drives[axis]
    if not drive.is_open and drive.settings.reconnect and not stage.is_closed(axis):
        until_s = stage.now() + longest_opening_s(drive.settings)
        while not drive.is_open and stage.now() < until_s:  # noqa: ASYNC110  # nobody tells
            await asyncio.sleep(_LOOKED_EVERY_S)
    if drive.is_open:
        for what in ("settle", "settle", "probe"):
            await stage.tell(stage.note(-1, axis, what), drive.position())
    await stage.tell(stage.note(-1, axis, "close"), drive.close())
