"""Each check of a promise can fail: what was truly seen is forged, and the check notices it."""

from __future__ import annotations

from asyncio import CancelledError
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from compax_aio.compax.settings import DriveSettings
from compax_aio.errors import AnswerTimeoutError, CommandRejectedError, DriveFaultError, MoveInDoubtError
from compax_aio.simulator.compax import Knobs, LogEntry, LogKind
from compax_aio.simulator.hunt.promises import broken
from compax_aio.simulator.hunt.scenario import Action, DrivePlan, Scenario, Trouble
from compax_aio.simulator.hunt.simulation import simulate
from compax_aio.simulator.hunt.story import story
from compax_aio.simulator.hunt.testimony import Call, Seen, SeenAxis, WireEntry, WireKind

DRIVE = DrivePlan(
    number=0, axis="x", knobs=Knobs(), settings=DriveSettings(answer_timeout_s=0.3, in_doubt_after_s=1, reconnect=False)
)
MOVE: dict[str, Any] = {"method": "move_to", "number": 12.5, "options": {}, "timeout_s": None, "patience_s": 0.02}
ACTIONS = (
    Action(number=1, at_s=0.5, kind="move", axes=("x",), arguments={**MOVE, "way": "await"}),
    Action(number=2, at_s=0.6, kind="read", axes=("x",), arguments={"what": ("position", "query S4", "status")}),
    Action(number=3, at_s=2.0, kind="move", axes=("x",), arguments={**MOVE, "number": 99.25, "way": "cancel"}),
    Action(number=4, at_s=4.0, kind="move", axes=("x",), arguments={**MOVE, "number": 44.75, "way": "stop drive"}),
    Action(number=5, at_s=6.0, kind="write", axes=("x",), arguments={"of": "P", "number": 40, "value": 7.5}),
    Action(number=6, at_s=6.5, kind="impossible", axes=("x",), arguments={"which": 5}),
    Action(number=7, at_s=6.6, kind="events", axes=("x",), arguments={"for_s": 0.5}),
)
SCENARIO = Scenario(seed=1, drives=(DRIVE,), actions=ACTIONS, troubles=())


@pytest.fixture
def seen() -> Seen:
    return simulate(SCENARIO)


def of(seen: Seen, what: str, number: int = 0) -> Call:
    return [call for call in seen.calls if call.what == what][number]


def promises(seen: Seen) -> set[str]:
    return {each.promise for each in broken(seen)}


def place(axis: SeenAxis, kind: WireKind, data: bytes) -> int:
    return next(at for at, entry in enumerate(axis.wire) if entry.kind is kind and entry.data == data)


def test_what_was_truly_seen_breaks_no_promise(seen: Seen) -> None:
    assert not broken(seen), story(seen, broken(seen))


# P1, P2, P6, P9: the wire


def written_too_early(axis: SeenAxis) -> None:
    at = place(axis, WireKind.WRITTEN, b"PA12.5$\r")
    axis.wire.insert(at + 1, WireEntry(axis.wire[at].at + 0.001, WireKind.WRITTEN, b"S2\r"))


def written_in_doubt(axis: SeenAxis) -> None:
    axis.wire.insert(1, WireEntry(0.0, WireKind.WRITTEN, b"S1\r"))


def written_behind_a_message(axis: SeenAxis) -> None:
    at = place(axis, WireKind.WRITTEN, b"S4\r")
    now = axis.wire[at].at
    axis.wire[at + 1 : at + 1] = [
        WireEntry(now, WireKind.READ, b"$\r\n>"),
        WireEntry(now, WireKind.WRITTEN, b"S2\r"),
    ]


def written_twice(axis: SeenAxis) -> None:
    last = axis.wire[-1]
    axis.wire += [last._replace(kind=WireKind.WRITTEN, data=b"PA12.5$\r")]


def triggered_by_nobody(axis: SeenAxis) -> None:
    axis.wire += [axis.wire[-1]._replace(kind=WireKind.WRITTEN, data=b"!\r")]


def moved_by_nobody(axis: SeenAxis) -> None:
    axis.far.log.append(LogEntry(9.0, LogKind.MOTION_STARTED, "POSA 66.60"))


def no_stop(axis: SeenAxis) -> None:
    axis.wire[:] = [entry for entry in axis.wire if entry.data != b"STOP\r"]


def stop_behind_a_reading(axis: SeenAxis) -> None:
    stops = [at for at, entry in enumerate(axis.wire) if entry.kind is WireKind.WRITTEN and entry.data == b"STOP\r"]
    at = axis.wire[stops[-1]]
    axis.wire[stops[-1] : stops[-1]] = [
        WireEntry(at.at, WireKind.WRITTEN, b"P41\r"),
        WireEntry(at.at, WireKind.READ, b"P041: 0\r\n>"),
    ]


def no_line(axis: SeenAxis) -> None:
    axis.wire += [axis.wire[-1]._replace(kind=WireKind.WRITTEN, data=b"PA1e5$\r")]


def two_lines(axis: SeenAxis) -> None:
    axis.wire += [axis.wire[-1]._replace(kind=WireKind.WRITTEN, data=b"S1\rPA5\r")]


@pytest.mark.parametrize(
    ("forge", "promise"),
    [
        (written_too_early, "P1"),
        (written_in_doubt, "P1"),
        (written_behind_a_message, "P1"),
        (written_twice, "P2"),
        (triggered_by_nobody, "P2"),
        (moved_by_nobody, "P2"),
        (no_stop, "P6"),
        (stop_behind_a_reading, "P6"),
        (no_stop, "P5"),
        (no_line, "P9"),
        (two_lines, "P9"),
    ],
    ids=lambda value: value if isinstance(value, str) else value.__name__,
)
def test_a_forged_wire_is_noticed(seen: Seen, forge: Callable[[SeenAxis], None], promise: str) -> None:
    forge(seen.axes["x"])
    assert promise in promises(seen)


def test_a_motion_on_a_drive_in_doubt_is_noticed(seen: Seen) -> None:
    of(seen, "move_to").outcome = MoveInDoubtError("it is in doubt")
    assert "P2" in promises(seen)


def test_a_motion_whose_caller_was_told_that_it_was_not_sent_is_noticed(seen: Seen) -> None:
    move = of(seen, "move_to").move
    assert move is not None
    move.sent = None
    assert "P2" in promises(seen)


# P3, P4, P5, P8, P10: what callers are told


@pytest.mark.parametrize(
    ("what", "outcome", "promise"),
    [
        ("position", ValueError("a defect"), "P3"),
        ("position", 55.55, "P4"),
        ("query S4", "S004: 3.21", "P4"),
        ("query S4", "S001: 12.50", "P4"),
        ("write", 8.5, "P4"),
        ("probe", AnswerTimeoutError("no answer"), "P5"),
        ("impossible", None, "P9"),
        ("move_to", DriveFaultError("a fault"), "P10"),
        ("move_to", CommandRejectedError("rejected"), "P10"),
    ],
)
def test_a_forged_outcome_is_noticed(seen: Seen, what: str, outcome: object, promise: str) -> None:
    of(seen, what).outcome = outcome
    assert promise in promises(seen)


def test_a_caller_who_waits_for_ever_is_noticed(seen: Seen) -> None:
    of(seen, "query S4").ended_at = None
    assert "P3" in promises(seen)


def test_a_caller_who_waits_while_the_line_is_idle_is_noticed(seen: Seen) -> None:
    call = of(seen, "position")
    assert call.ended_at is not None
    call.ended_at += 1.8
    assert "P3" in promises(seen)


@pytest.mark.parametrize("field", ["complaints", "left"])
def test_what_is_left_behind_is_noticed(seen: Seen, field: str) -> None:
    getattr(seen, field).append("something")
    assert "P3" in promises(seen)


def test_an_answer_to_an_earlier_question_is_noticed(seen: Seen) -> None:
    call = of(seen, "position")
    call.asked_at = call.ended_at or 0.0
    assert "P4" in promises(seen)


def test_an_axis_that_goes_on_is_noticed(seen: Seen) -> None:
    seen.axes["x"].moving_at_end = True
    assert "P5" in promises(seen)


def test_an_axis_that_begins_to_move_when_it_was_left_is_noticed(seen: Seen) -> None:
    seen.axes["x"].motions_at_end -= 1
    assert "P5" in promises(seen)


def test_a_client_that_grows_heavy_is_noticed(seen: Seen) -> None:
    assert 10_000 < seen.axes["x"].weight < 60_000
    seen.axes["x"].weight = 500_000
    assert "P8" in promises(seen)


def test_a_move_that_was_told_to_have_arrived_and_has_not_is_noticed(seen: Seen) -> None:
    call = of(seen, "move_to")
    call.position_then = 3.0
    log = seen.axes["x"].far.log
    reached = next(entry for entry in log if entry.kind is LogKind.MOTION_REACHED)
    log.remove(reached)
    assert "P10" in promises(seen)


def test_a_stop_that_returned_while_the_axis_moves_is_noticed(seen: Seen) -> None:
    of(seen, "stop").moving_then = True
    assert "P10" in promises(seen)


def test_a_move_that_was_cancelled_without_a_stop_is_noticed(seen: Seen) -> None:
    of(seen, "move_to", 0).outcome = CancelledError()
    assert "P5" in promises(seen)


# P7: two lines


def test_a_line_that_another_delays_is_noticed() -> None:
    other = replace(DRIVE, number=10, axis="y", knobs=Knobs(position=1000.0))
    trouble = Trouble(number=20, at_s=0.55, kind="silent", axes=("y",), lasts_s=0.2)
    seen = simulate(replace(SCENARIO, seed=5, drives=(DRIVE, other), troubles=(trouble,)))
    assert not broken(seen), story(seen, broken(seen))
    wire = seen.axes["x"].wire
    at = place(seen.axes["x"], WireKind.WRITTEN, b"S4\r")
    wire[at] = wire[at]._replace(at=wire[at].at + 0.0001)
    assert "P7" in promises(seen)


def test_a_time_out_on_a_line_that_nothing_befell_is_noticed(seen: Seen) -> None:
    of(seen, "position").outcome = AnswerTimeoutError("no answer")
    assert "P7" in promises(seen)
