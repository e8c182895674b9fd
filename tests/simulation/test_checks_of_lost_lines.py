"""Each check of a line that is lost and opened again can fail: what was truly seen is forged, and it is noticed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from compax_aio.compax.events import ConnectionLost, ConnectionRestored
from compax_aio.compax.settings import DriveSettings
from compax_aio.errors import ConnectionLostError
from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive
from compax_aio.simulator.hunt.promises import broken
from compax_aio.simulator.hunt.scenario import Action, DrivePlan, Scenario, Trouble
from compax_aio.simulator.hunt.simulation import simulate
from compax_aio.simulator.hunt.story import story
from compax_aio.simulator.hunt.testimony import Call, Seen, SeenAxis, WireKind

DRIVE = DrivePlan(
    number=0,
    axis="x",
    knobs=Knobs(),
    settings=DriveSettings(
        answer_timeout_s=0.3,
        in_doubt_after_s=2,
        reconnect_first_s=0.2,
        reconnect_slowest_s=0.2,
        reconnect_attempts=None,
    ),
)
MOVE: dict[str, Any] = {"method": "move_to", "timeout_s": None, "patience_s": 0.02, "way": "await"}
ACTIONS = (
    Action(
        number=1,
        at_s=0.5,
        kind="move",
        axes=("x",),
        arguments={**MOVE, "number": 12.5, "options": {"speed_percent": 50}},
    ),
    Action(number=2, at_s=2.1, kind="read", axes=("x",), arguments={"what": ("query S4",)}),
    Action(number=3, at_s=4.0, kind="move", axes=("x",), arguments={**MOVE, "number": 99.25, "options": {}}),
)
TROUBLES = (Trouble(number=9, at_s=2.0, kind="cut", axes=("x",), arguments={"keeps": False}, lasts_s=0.5),)
SCENARIO = Scenario(seed=1, drives=(DRIVE,), actions=ACTIONS, troubles=TROUBLES)


@pytest.fixture
def seen() -> Seen:
    return simulate(SCENARIO)


def of(axis: SeenAxis, what: str, number: int = 0) -> Call:
    return [call for call in axis.calls if call.what == what][number]


def test_what_was_truly_seen_breaks_no_promise(seen: Seen) -> None:
    axis = seen.axes["x"]
    assert not broken(seen), story(seen, broken(seen))
    assert [type(event) for event in axis.events if isinstance(event, ConnectionLost | ConnectionRestored)] == [
        ConnectionLost,
        ConnectionRestored,
    ]
    assert of(axis, "query S4").outcome == "S004: 0.00"


def restored_without_a_loss(axis: SeenAxis) -> None:
    axis.events[:] = [event for event in axis.events if not isinstance(event, ConnectionLost)]


def lost_and_not_restored(axis: SeenAxis) -> None:
    axis.events[:] = [event for event in axis.events if not isinstance(event, ConnectionRestored)]
    of(axis, "close").asked_at += 100


def told_another_time(axis: SeenAxis) -> None:
    axis.events[:] = [
        replace(event, lost_for_s=9.0) if isinstance(event, ConnectionRestored) else event for event in axis.events
    ]


def given_up_early(axis: SeenAxis) -> None:
    call = of(axis, "query S4")
    call.ended_at, call.outcome = call.asked_at + 0.1, ConnectionLostError("the line is lost")


def waited_too_long(axis: SeenAxis) -> None:
    lost = next(event for event in axis.events if isinstance(event, ConnectionLost))
    axis.events[:] = [
        replace(event, at=event.at + 5, lost_for_s=event.at + 5 - lost.at)
        if isinstance(event, ConnectionRestored)
        else event
        for event in axis.events
    ]
    opened = [at for at, entry in enumerate(axis.wire) if entry.kind is WireKind.OPENED][-1]
    axis.wire.insert(opened, axis.wire[opened]._replace(kind=WireKind.BEFELL, at=4.5, text="refused"))
    of(axis, "query S4").ended_at = 6.0


def tried_in_a_hurry(axis: SeenAxis) -> None:
    at = next(at for at, entry in enumerate(axis.wire) if entry.text == "refused")
    axis.wire.insert(at, axis.wire[at]._replace(at=axis.wire[at].at - 0.001))


def settings_not_said_again(axis: SeenAxis) -> None:
    said = [at for at, entry in enumerate(axis.wire) if entry.data == b"SD50\r" and entry.kind is WireKind.WRITTEN]
    axis.wire[said[-1]] = axis.wire[said[-1]]._replace(data=b"S1\r")


def not_greeted(axis: SeenAxis) -> None:
    asked = [at for at, entry in enumerate(axis.wire) if entry.data == b"S39\r" and entry.kind is WireKind.WRITTEN]
    axis.wire[asked[-1]] = axis.wire[asked[-1]]._replace(data=b"S1\r")


def a_stranger_moved(axis: SeenAxis) -> None:
    stranger = SimulatedDrive(name="stranger")
    stranger.log.add(3.0, LogKind.MOTION_STARTED, "POSA 99.25")
    axis.strangers.append(stranger)


def a_stranger_was_told(axis: SeenAxis) -> None:
    stranger = SimulatedDrive(name="stranger")
    stranger.log.add(3.0, LogKind.LINE, "P40=1005")
    axis.strangers.append(stranger)


def a_restart_nobody_minded(axis: SeenAxis) -> None:
    axis.events[:] = [
        replace(event, signs_of_restart=("a sign",)) if isinstance(event, ConnectionRestored) else event
        for event in axis.events
    ]
    move = of(axis, "move_to").move
    assert move is not None
    of(axis, "move_to").ended_at = 4.0


@pytest.mark.parametrize(
    ("forge", "promise"),
    [
        (restored_without_a_loss, "P3"),
        (lost_and_not_restored, "P5"),
        (told_another_time, "P3"),
        (given_up_early, "P3"),
        (waited_too_long, "P3"),
        (tried_in_a_hurry, "P3"),
        (settings_not_said_again, "P10"),
        (not_greeted, "P10"),
        (a_stranger_moved, "P10"),
        (a_stranger_was_told, "P10"),
        (a_restart_nobody_minded, "P10"),
    ],
    ids=lambda value: value if isinstance(value, str) else value.__name__,
)
def test_what_is_forged_is_noticed(seen: Seen, forge: Callable[[SeenAxis], None], promise: str) -> None:
    forge(seen.axes["x"])
    assert promise in {each.promise for each in broken(seen)}


def test_attempts_beyond_their_number_are_noticed(seen: Seen) -> None:
    axis = seen.axes["x"]
    axis.plan = replace(axis.plan, settings=replace(axis.plan.settings, reconnect_attempts=1))
    assert "P3" in {each.promise for each in broken(seen)}
