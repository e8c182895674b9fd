"""Events of moves: that one was taken, how it ended, that the drive stands; never before it is so (P10)."""

from __future__ import annotations

import asyncio
import gc
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest
from tests.promises.bench import bench, ending, lines, now, scripted, strangers_order, until

from compax_aio import Drive, DriveFaultError, DriveSettings, smc
from compax_aio.compax.events import (
    ComparatorPassed,
    ConnectionLost,
    ConnectionRestored,
    DriveEvent,
    EventStream,
    Fault,
    Mark,
    MoveAccepted,
    MoveEnded,
    PositionMessage,
    Stopped,
    UnexpectedText,
)
from compax_aio.compax.facts.device_errors import device_error
from compax_aio.simulator.compax import SimulatedDrive
from compax_aio.smc.events import AxesReset, CommandDamaged

pytestmark = pytest.mark.usefixtures("nothing_left_behind")


@asynccontextmanager
async def followed(**knobs: Any) -> AsyncIterator[tuple[Drive, SimulatedDrive, EventStream]]:
    """Connect to a simulated drive, and follow its events."""
    async with bench(**knobs) as (drive, far):
        yield drive, far, drive.events()


async def rest(stream: EventStream) -> list[DriveEvent]:
    """Take what has been told; the drive must be closed."""
    return [event async for event in stream]


def kinds(events: list[DriveEvent]) -> list[str]:
    return [type(event).__name__ for event in events]


def end_of(events: list[DriveEvent]) -> MoveEnded:
    (ended,) = [event for event in events if isinstance(event, MoveEnded)]
    return ended


async def test_a_move_is_told_when_it_is_taken_and_when_it_has_reached_its_target() -> None:
    async with followed() as (drive, far, stream):
        begun_at = now()
        move = drive.move_to(100)
        await move.accepted
        accepted_at = now()
        result = await move
    accepted, message, ended = await rest(stream)
    assert accepted == MoveAccepted("x", accepted_at, "move_to(100)", 100.0)
    assert begun_at < accepted.at < ended.at
    assert isinstance(message, PositionMessage)
    assert ended == MoveEnded("x", result.finished_at, "move_to(100)", 100.0, "reached", True, "message", None)
    assert not far.moving


async def test_an_end_that_the_status_shows_is_told_as_such() -> None:
    async with followed() as (drive, _, stream):
        await drive.home()
    ended = end_of(await rest(stream))
    assert (ended.outcome, ended.confirmed_by, ended.target) == ("reached", "status", None)
    assert ended.as_mark() == Mark("reached", None, "home(), by status")


async def test_a_refused_move_is_never_told_as_taken() -> None:
    async with scripted({"PA5$": "E90"}) as (drive, _):
        stream = drive.events()
        error = await ending(drive.move_to(5))
    (ended,) = await rest(stream)
    assert isinstance(ended, MoveEnded)
    assert (ended.outcome, ended.error, ended.was_sent) == ("refused", error, True)
    assert ended.as_mark().word == "refused"


async def test_a_move_whose_acknowledgement_is_lost_is_told_as_taken_when_the_status_shows_it() -> None:
    async with followed() as (drive, far, stream):
        far.lose_answers = 1
        await drive.move_to(300)
    events = await rest(stream)
    accepted = next(event for event in events if isinstance(event, MoveAccepted))
    assert accepted.at >= DriveSettings().answer_timeout_s, "not before it was known"
    assert end_of(events).outcome == "reached"


async def test_a_stop_is_told_at_the_standstill_and_then_the_end_of_its_move() -> None:
    async with followed() as (drive, far, stream):
        move = drive.move_to(1000)
        await asyncio.sleep(1)
        await drive.stop()
        assert not far.moving
        error = await ending(move)
    events = await rest(stream)
    assert kinds(events) == ["MoveAccepted", "Stopped", "MoveEnded"]
    assert (end_of(events).outcome, end_of(events).error) == ("stopped", error)
    assert events[1].at > 1


async def test_a_stop_without_a_move_is_told_as_well() -> None:
    async with followed() as (drive, _, stream):
        await drive.stop()
    assert kinds(await rest(stream)) == ["Stopped"]


async def test_a_stop_that_fails_tells_no_standstill() -> None:
    settings = DriveSettings(stop_timeout_s=1, answer_timeout_s=0.2, in_doubt_after_s=1)
    async with bench(settings=settings) as (drive, far):
        stream = drive.events()
        move = drive.move_to(1000)
        await move.accepted
        far.power_off()
        await ending(drive.stop())
        await ending(move)
        far.power_on()
        await drive.reconcile()
        assert not [event for event in _told(stream) if isinstance(event, Stopped)]


def _told(stream: EventStream) -> list[DriveEvent]:
    """Take what waits in *stream* now."""
    return list(stream._waiting)


async def test_a_cancelled_move_is_told_at_once_and_its_standstill_when_it_is_there() -> None:
    async with followed() as (drive, far, stream):
        move = drive.move_to(1000)
        await asyncio.sleep(1)
        move.cancel()
        await until(lambda: len(_told(stream)) > 1)
        assert far.moving, "it brakes, which takes its time"
        await drive.stop()
    events = await rest(stream)
    assert kinds(events)[:3] == ["MoveAccepted", "MoveEnded", "Stopped"]
    assert (end_of(events).outcome, end_of(events).error) == ("cancelled", None)
    assert end_of(events).as_mark() == Mark("cancelled", 1000.0, "move_to(1000)")


async def test_a_prepared_move_that_was_withdrawn_does_not_say_that_nothing_was_sent() -> None:
    async with followed() as (drive, far, stream):
        move = drive.prepare_move_to(1000)
        await move.ready
        assert any("1000," in line for line in lines(far))
        await drive.stop()
        await ending(move)
        assert not far.moving
    ended = end_of(await rest(stream))
    assert (ended.outcome, ended.was_sent) == ("stopped", False)
    assert ended.as_mark().text.endswith("(what starts the motion had not been sent)")


async def test_a_fault_is_told_and_then_the_end_of_the_move() -> None:
    async with followed() as (drive, far, stream):
        move = drive.move_to(1000)
        await asyncio.sleep(1)
        far.raise_fault(55)
        await ending(move)
    events = await rest(stream)
    assert kinds(events)[:3] == ["MoveAccepted", "Fault", "MoveEnded"]
    assert events[1].as_mark().value == 55
    assert events[1].as_mark().text.startswith("E55: ")
    assert end_of(events).outcome == "fault"


async def test_a_move_out_of_time_says_so() -> None:
    async with followed() as (drive, _, stream):
        await ending(drive.move_to(1000, timeout_s=0.5))
    assert end_of(await rest(stream)).outcome == "out of time"


async def test_an_error_that_nobody_fetches_is_complained_about_although_it_was_told() -> None:
    complaints: list[dict[str, Any]] = []
    asyncio.get_running_loop().set_exception_handler(lambda _, context: complaints.append(context))
    async with followed() as (drive, far, stream):
        move = drive.move_to(1000)
        await asyncio.sleep(1)
        far.raise_fault(55)
        await until(move.done)
        await asyncio.sleep(0.1)
        assert end_of(_told(stream)).outcome == "fault"
        assert not complaints
        stream._waiting.clear()  # it holds the error, and by its traceback the move
        del move
        gc.collect()
        assert [type(context["exception"]) for context in complaints] == [DriveFaultError]
    asyncio.get_running_loop().set_exception_handler(None)


async def test_a_motion_of_somebody_else_is_no_move_of_ours() -> None:
    async with followed() as (_, far, stream):
        strangers_order(far, "PA50$")
        await until(lambda: far.position == 50)
        await asyncio.sleep(0.1)
    assert "MoveEnded" not in kinds(await rest(stream))
    assert "PA50$" in lines(far)


async def test_axes_of_a_stepper_line_tell_their_motions_too() -> None:
    async with smc.connect("sim://smc?axes=AB&name=told", axes="AB", name="bus") as line:
        stream = line.events()
        await line.axis("B").move_to(400)
        move = line.axis("A").move_to(100_000)
        await asyncio.sleep(0.5)
        await line.axis("A").stop()
        await ending(move)
    events = await rest(stream)
    assert [(event.drive, event.as_mark().word) for event in events] == [
        ("bus axis B", "accepted"),
        ("bus axis B", "reached"),
        ("bus axis A", "accepted"),
        ("bus axis A", "standstill"),
        ("bus axis A", "stopped"),
    ]


@pytest.mark.parametrize(
    ("event", "mark"),
    [
        (DriveEvent("x", 1.0), Mark("DriveEvent")),
        (PositionMessage("x", 1.0), Mark("$", None, "the drive says: position reached")),
        (ComparatorPassed("x", 1.0, 3), Mark("comparator", 3)),
        (Fault("x", 1.0, None), Mark("fault", None, "the drive did not say which")),
        (Fault("x", 1.0, device_error(5)), Mark("fault", 5, f"E5: {device_error(5).meaning}")),
        (ConnectionLost("x", 1.0, "hung up"), Mark("connection lost", None, "hung up")),
        (ConnectionRestored("x", 1.0, 2.5, 3, ("a", "b")), Mark("connection restored", 2.5, "a and b")),
        (UnexpectedText("x", 1.0, "hello"), Mark("unexpected text", None, "hello")),
        (MoveAccepted("x", 1.0, "home()", None), Mark("accepted", None, "home()")),
        (AxesReset("bus", 1.0, "AB", "^C was sent"), Mark("reset", None, "AB: ^C was sent")),
        (AxesReset("bus", 1.0, "", "^C was sent"), Mark("reset", None, "^C was sent")),
        (CommandDamaged("bus", 1.0, "A", ("R1", "R10")), Mark("command damaged", None, "A: R1, R10")),
        (CommandDamaged("bus", 1.0, "", ("R1",)), Mark("command damaged", None, "R1")),
    ],
    ids=lambda value: value.word if isinstance(value, Mark) else "",
)
def test_every_event_can_be_said_in_a_few_words(event: DriveEvent, mark: Mark) -> None:
    assert event.as_mark() == mark
