"""Runs one scenario of a party line, from opening it to a minute after it was left, in virtual time."""

from __future__ import annotations

import asyncio
from typing import Final

from compax_aio.simulator.smc.line import SimulatedPartyLine
from compax_aio.smc.connecting import connect
from compax_aio.smc.party_line import PartyLine

from ..hunt.running import all_ended, carried_out, in_time, let_go_of_tasks, run, told
from ..hunt.scenario import Action, Trouble
from ..hunt.troubled_line import TroubledLine
from ..hunt.weighing import weigh
from .actions import ACTIONS
from .scenario import PartyScenario
from .stage import PartyStage
from .testimony import WHOLE_LINE, SeenLine
from .troubles import LONGEST_DELAY_S, FarLine, befall

__all__ = ["simulate_party"]

_LOG_ENTRIES: Final = 400_000
_AFTERWARDS_S: Final = 60.0
"""So long it is watched whether an axis that was left begins to move."""
_LOOKED_EVERY_S: Final = 0.1
_LONGEST_OPENING_S: Final = 20.0


def simulate_party(scenario: PartyScenario) -> SeenLine:
    """Run *scenario*; two runs of the same one are the same to the last byte."""
    seen: list[SeenLine] = []

    async def work() -> None:
        far = SimulatedPartyLine(
            scenario.line.knobs,
            axis_knobs={plan.axis: plan.knobs for plan in scenario.drives},
            log_entries=_LOG_ENTRIES,
        )
        seen.append(SeenLine(scenario, far))
        await _run(seen[0])

    run(work)
    return seen[0]


async def _run(testimony: SeenLine) -> None:
    loop = asyncio.get_running_loop()
    loop.set_exception_handler(lambda _, context: testimony.complaints.append(told(context)))
    stage = PartyStage(testimony)
    scenario = testimony.scenario
    line = TroubledLine("party", testimony.far, testimony.wire)
    opening = asyncio.ensure_future(_open(stage, line))
    troubles: list[asyncio.Task[None]] = []
    users: list[asyncio.Task[None]] = []
    starting = [
        asyncio.ensure_future(in_time(scenario.troubles, lambda each: _befall(stage, line, each), troubles)),
        asyncio.ensure_future(in_time(scenario.actions, lambda each: _act(stage, each, opening), users)),
    ]
    begins_s = max((each.at_s for each in (*scenario.actions, *scenario.troubles)), default=0.0)
    await asyncio.wait([opening], timeout=begins_s)
    await asyncio.sleep(max(0.0, begins_s - loop.time()))
    await all_ended(starting, testimony.complaints, "something does not begin")
    await all_ended([opening, *users], testimony.complaints, "a caller waits for ever")
    testimony.left_at = loop.time()
    await all_ended(troubles, testimony.complaints, "a trouble does not end")
    _heal(line, testimony.far)
    await asyncio.sleep(LONGEST_DELAY_S)  # what was late is there now
    if stage.line is not None:
        await all_ended([asyncio.ensure_future(_leave(stage, stage.line))], testimony.complaints, "no leaving")
        testimony.weight = weigh(stage.line)
    testimony.moving_when_closed = _moving(testimony.far)
    testimony.lasted_s = loop.time()
    await asyncio.sleep(_AFTERWARDS_S)
    testimony.moving_at_end = _moving(testimony.far)
    line.close()
    stage.line = None
    testimony.left += await let_go_of_tasks()


def _moving(far: SimulatedPartyLine) -> tuple[str, ...]:
    return tuple(letter for letter, axis in far.axes.items() if axis.moving)


async def _open(stage: PartyStage, line: TroubledLine) -> None:
    plan = stage.testimony.scenario.line
    mode = plan.knobs.mode
    axes = plan.knobs.axes if plan.is_told_axes and mode != "single" else ""
    call = stage.note(plan.number, WHOLE_LINE, "connect")
    party = await stage.tell(call, _connect(line.url, mode, axes, plan.settings))
    if party is not None:
        stage.line = party
        stage.follow_events()
        stage.testimony.origins = {
            letter: axis.place - axis.position for letter, axis in stage.testimony.far.axes.items()
        }


async def _connect(url: str, mode: str, axes: str, settings: object) -> PartyLine:
    return await connect(url, mode=mode, axes=axes, name="line", settings=settings)  # type: ignore[arg-type]


async def _befall(stage: PartyStage, line: TroubledLine, trouble: Trouble) -> None:
    letters = tuple(stage.testimony.far.axes)
    axis = trouble.axes[0] if trouble.axes else letters[0]
    await befall(trouble, FarLine(stage.testimony.far, line, axis))


async def _act(stage: PartyStage, action: Action, opening: asyncio.Task[None]) -> None:
    """Let a user do something, and perhaps give it up."""
    await asyncio.wait([opening])
    if stage.line is None:
        return
    await carried_out(action, ACTIONS[action.kind].do(stage, action), stage.testimony.complaints)


def _heal(line: TroubledLine, far: SimulatedPartyLine) -> None:
    """Let the line and all axes work from now on."""
    line.heal()
    line.vanishing = False
    far.heal()


async def _leave(stage: PartyStage, line: PartyLine) -> None:
    """Ask each axis once more, for that must work, and leave the block."""
    is_closed = any(call.what == "close" for call in stage.testimony.calls)
    if not line.is_open and line.settings.reconnect and not is_closed:
        until_s = stage.now() + _LONGEST_OPENING_S
        while not line.is_open and stage.now() < until_s:  # noqa: ASYNC110  # nobody tells
            await asyncio.sleep(_LOOKED_EVERY_S)
    if line.is_open:
        for letter in stage.testimony.far.axes:
            for what in ("settle", "settle", "probe"):
                await stage.tell(stage.note(-1, letter, what), stage.axis(letter).position())
    await stage.tell(stage.note(-1, WHOLE_LINE, "close"), line.close())
