"""The axes behind the monitor's screen: each on its own, its line opened again and again, its orders told truly."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from tests.promises.cable import Cable

import compax_aio
from compax_aio import DriveSettings
from compax_aio.cli.monitoring.axis import MonitoredAxis
from compax_aio.cli.monitoring.cell import Cell
from compax_aio.cli.monitoring.levels import Level
from compax_aio.cli.monitoring.state import Phase
from compax_aio.cli.monitoring.wanted import WantedAxis, wanted_axes
from compax_aio.cli.monitoring.words import say
from compax_aio.errors import InvalidCommandError
from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive
from compax_aio.simulator.server import drive_named

_SETTINGS = DriveSettings(unit="mm")


def cell_of(urls: Mapping[str, str], settings: DriveSettings = _SETTINGS) -> Cell:
    return Cell([WantedAxis(name, url, settings) for name, url in urls.items()], interval_s=0.2, jog_percent=50.0)


@asynccontextmanager
async def watching(urls: Mapping[str, str], settings: DriveSettings = _SETTINGS) -> AsyncIterator[Cell]:
    """Watch, until the block is left."""
    cell = cell_of(urls, settings)
    cell.start()
    try:
        yield cell
    finally:
        await cell.close()
        assert asyncio.all_tasks() == {asyncio.current_task()}, "it leaves nothing behind"


async def until(condition: Callable[[], object], within_s: float = 100.0) -> None:
    async with asyncio.timeout(within_s):
        while not condition():  # noqa: ASYNC110 - whatever it is
            await asyncio.sleep(0.02)


def state_of(axis: MonitoredAxis) -> str:
    return say(axis.state, asyncio.get_running_loop().time()).state


def told(cell: Cell) -> str:
    return "\n".join(f"{entry.axis}: {entry.text}" for entry in cell.diary.since(0))


def lines_that_move(name: str) -> list[str]:
    starts = ("PA", "PR", "PH", "SD", "ST", "QUIT")
    return [text for text in drive_named(name).log.texts(LogKind.LINE) if text.startswith(starts)]


async def test_watching_sends_nothing_that_moves_or_changes_a_drive() -> None:
    async with watching({"x": "sim://compax?name=x&travel_min=-10&travel_max=300"}) as cell:
        await asyncio.sleep(5)
        state = cell.axes[0].state
        assert state.travel == (-10.0, 300.0)
        assert state.unit == "mm"
        assert state.readings_per_s(asyncio.get_running_loop().time()) == pytest.approx(5, abs=0.5)
        assert set(state.values) == {"position", "status", "target", "following_error", "speed", "torque"}
    lines = drive_named("x").log.texts(LogKind.LINE)
    assert all(line[0] in "SP" and line[1:].isdigit() for line in lines)


async def test_an_axis_that_is_not_there_is_tried_again_while_the_others_are_watched() -> None:
    cable = Cable()
    async with watching({"x": cable.url, "y": "sim://compax?name=y"}) as cell:
        x, y = cell.axes
        await until(lambda: x.state.attempts == 3)
        assert y.state.phase is Phase.OPEN
        assert told(cell).count("x: not reachable") == 1, "the same reason is told once"
        await cable.plug(SimulatedDrive(name="x"))
        x.try_again()
        await until(lambda: x.state.phase is Phase.OPEN, 0.5)
        await cable.pull()


async def test_a_line_that_cannot_be_opened_is_tried_less_and_less_but_for_ever() -> None:
    async with watching({"x": "loop://nobody"}) as cell:
        x = cell.axes[0]
        await asyncio.sleep(100)
        assert 10 <= x.state.attempts <= 14
        assert "nobody listens" in x.state.trouble
        x.orders.jog(1)
        x.orders.acknowledge()
        x.orders.stop()
        assert told(cell).count("nothing was sent, there is no line") == 2
        assert x.state.stop is not None
        assert "STOP was not sent" in x.state.stop.text


async def test_a_lost_line_shows_for_how_long_and_comes_back_by_itself() -> None:
    cable, far = Cable(), SimulatedDrive(Knobs(homed=True), name="x")
    await cable.plug(far)
    async with watching({"x": cable.url, "y": "sim://compax?name=y&homed=1"}) as cell:
        x, y = cell.axes
        await until(lambda: state_of(x) == state_of(y) == "STANDING")
        await cable.pull()
        await asyncio.sleep(12)
        x.look()
        assert state_of(x) == "LINE LOST 12 s"
        assert x.state.attempts >= 3
        x.try_again()
        assert "tried again by itself" in told(cell)
        assert not x.state.is_current("position", asyncio.get_running_loop().time())
        assert state_of(y) == "STANDING"
        assert y.state.readings_per_s(asyncio.get_running_loop().time()) == pytest.approx(5, abs=0.5)
        far.power_cycle()
        await cable.plug(far)
        await until(lambda: state_of(x) == "NOT HOMED")
        assert "the line is back after" in told(cell)
        assert "switched off and on" in told(cell)
        x.try_again()
        assert "the line is there" in told(cell)
    await cable.pull()


async def test_a_line_that_is_not_to_be_opened_again_waits_for_a_word() -> None:
    cable, far = Cable(), SimulatedDrive(name="x")
    await cable.plug(far)
    async with watching({"x": cable.url}, DriveSettings(reconnect=False)) as cell:
        x = cell.axes[0]
        await until(lambda: x.state.phase is Phase.OPEN)
        await cable.pull()
        await until(lambda: x.state.phase is Phase.ENDED)
        await cable.plug(far)
        await asyncio.sleep(60)
        assert x.state.phase is Phase.ENDED
        x.try_again()
        await until(lambda: x.state.phase is Phase.OPEN)
    await cable.pull()


async def test_a_fault_is_told_with_its_code_and_goes_when_it_is_acknowledged() -> None:
    async with watching({"x": "sim://compax?name=x&homed=1"}) as cell:
        x = cell.axes[0]
        await until(lambda: state_of(x) == "STANDING")
        x.orders.acknowledge()
        assert "no error to acknowledge" in told(cell)
        drive_named("x").raise_fault(55)
        await until(lambda: state_of(x) == "FAULT E55")
        assert "x: fault E55: emergency stop" in told(cell)
        x.orders.acknowledge()
        await until(lambda: not state_of(x).startswith("FAULT"))
        assert lines_that_move("x") == ["QUIT"]
        drive_named("x").raise_fault(60)
        await until(lambda: "E60" in say(x.state, asyncio.get_running_loop().time()).detail)


async def test_a_fault_that_was_there_before_us_is_named_too() -> None:
    drive_named("x", Knobs()).raise_fault(55)
    async with watching({"x": "sim://compax?name=x"}) as cell:
        await until(lambda: state_of(cell.axes[0]) == "FAULT E55")


async def test_a_jog_is_told_from_its_beginning_to_its_end() -> None:
    async with watching({"x": "sim://compax?name=x&homed=1&position=10"}) as cell:
        x = cell.axes[0]
        await until(lambda: state_of(x) == "STANDING")
        x.orders.jog(20)
        x.orders.jog(20)  # as a key that is held down says it
        x.orders.home()
        assert "search for machine zero: nothing was sent, jog +20 mm is not over" in told(cell)
        await until(lambda: state_of(x) == "MOVING")
        assert [axis.name for axis in cell.moved_from_here] == ["x"]
        await until(lambda: "jog +20 mm: reached 30.00 mm, confirmed by message" in told(cell))
        assert not cell.moved_from_here
        assert lines_that_move("x") == ["SD50", "PR20$"]
        x.orders.home()
        await until(lambda: "search for machine zero: reached, confirmed by status" in told(cell))


async def test_a_jog_in_the_other_direction_stops_the_one_that_runs() -> None:
    async with watching({"x": "sim://compax?name=x&homed=1"}) as cell:
        x = cell.axes[0]
        await until(lambda: state_of(x) == "STANDING")
        x.orders.jog(500)
        await until(lambda: state_of(x) == "MOVING")
        x.orders.jog(-500)
        await until(lambda: "x" in cell.stops and cell.stops["x"].level is Level.QUIET)
        assert "jog +500 mm: move_by(500) was stopped at" in told(cell)
        await asyncio.sleep(5)
        assert lines_that_move("x") == ["SD50", "PR500$", "STOP"]
        x.orders.jog(-5)
        await until(lambda: "jog -5 mm: reached" in told(cell))


async def test_what_a_drive_cannot_be_told_is_said_and_not_sent() -> None:
    async with watching({"x": "sim://compax?name=x"}) as cell:
        x = cell.axes[0]
        await until(lambda: x.state.phase is Phase.OPEN)
        x.orders.jog(1e9)
        assert "within ±4,000,000" in told(cell)
        assert lines_that_move("x") == []


async def test_a_move_that_fails_says_why() -> None:
    async with watching({"x": "sim://compax?name=x&travel_max=50"}) as cell:
        x = cell.axes[0]
        await until(lambda: x.state.travel is not None)
        x.orders.jog(100)
        await until(lambda: "jog +100 mm: " in told(cell).replace("begun here", ""))
        await until(lambda: x.state.own_motion is None)
        assert "outside the travel" in told(cell)


async def test_stopping_all_goes_to_all_lines_at_once_and_each_is_told_truly() -> None:
    urls = {name: f"sim://compax?name={name}&homed=1" for name in "xyz"}
    async with watching(urls, DriveSettings(stop_timeout_s=3)) as cell:
        x, y, z = cell.axes
        await until(lambda: all(state_of(axis) == "STANDING" for axis in cell.axes))
        x.orders.jog(500)
        y.orders.jog(500)
        await until(lambda: state_of(x) == state_of(y) == "MOVING")
        drive_named("y").silent = drive_named("y").deaf = True
        at = asyncio.get_running_loop().time()
        cell.stop_all()
        cell.stop_all()  # as a key that is held down says it
        z.orders.jog(1)
        assert "nothing was sent, a stop is under way" in told(cell)
        await until(lambda: all(stop.level is not Level.WAITING for stop in cell.stops.values()))
        assert cell.stops["x"].text == cell.stops["z"].text == "acknowledged, and the axis stands"
        assert cell.stops["y"].text.startswith("NOT ACKNOWLEDGED: use the emergency stop")
        for name in "xz":
            log = [entry for entry in drive_named(name).log if entry.text == "STOP" and entry.kind is LogKind.LINE]
            assert log[0].at - at < 0.05
        assert [axis.name for axis in cell.moved_from_here] == ["y"]
        drive_named("y").silent = drive_named("y").deaf = False
        await until(lambda: state_of(y) == "IN DOUBT")
        y.orders.jog(1)
        assert "press r" in told(cell)
        y.orders.stop()
        await until(lambda: cell.stops["y"].level is Level.QUIET)
        assert not cell.moved_from_here
        assert state_of(y) == "IN DOUBT", "a person has to look all the same"
        y.orders.reconcile()
        await until(lambda: state_of(y) == "STANDING")
        assert "y: reconciled: no command is active" in told(cell)


async def test_a_stop_that_is_acknowledged_by_an_axis_that_goes_on_is_not_called_a_standstill() -> None:
    settings = DriveSettings(standstill_timeout_s=0.5)
    async with watching({"x": "sim://compax?name=x&homed=1&stop_ramp_ms=60000"}, settings) as cell:
        x = cell.axes[0]
        await until(lambda: state_of(x) == "STANDING")
        x.orders.jog(5000)
        await asyncio.sleep(3)
        x.orders.stop()
        await until(lambda: cell.stops["x"].level is Level.ALARM)
        assert cell.stops["x"].text.startswith("ACKNOWLEDGED, BUT NOT SEEN TO STAND: use the emergency stop")
        await asyncio.sleep(60)


async def test_leaving_stops_what_was_started_here_and_leaves_alone_what_was_not() -> None:
    other = await compax_aio.connect("sim://compax?name=y&homed=1", name="other")
    other.move_to(3000, speed_percent=10, on_cancel="detach")
    await asyncio.sleep(1)
    await other.close()
    cell = cell_of({"x": "sim://compax?name=x&homed=1", "y": "sim://compax?name=y", "z": "sim://compax?name=z"})
    cell.start()
    x, y, _ = cell.axes
    await until(lambda: state_of(y) == "MOVING" and state_of(x) == "STANDING")
    assert say(y.state, asyncio.get_running_loop().time()).detail == "not started here"
    x.orders.jog(500)
    await until(lambda: state_of(x) == "MOVING")
    await cell.close()
    await cell.close()
    assert cell.farewells[0].text.startswith("jog +500 mm was under way: move_by(500) was stopped at ")
    assert cell.farewells[1].text == "it moves, but was not started here: left alone"
    assert cell.farewells[2].text == ""
    assert drive_named("x").log.texts(LogKind.MOTION_STOPPED)
    assert not drive_named("y").log.texts(LogKind.MOTION_STOPPED)
    x.orders.stop()
    assert x.state.stop is None, "nothing is said on a line that is closed"


async def test_leaving_an_axis_that_cannot_be_stopped_says_so() -> None:
    cell = cell_of({"x": "sim://compax?name=x&homed=1"}, DriveSettings(stop_timeout_s=2, in_doubt_after_s=5))
    cell.start()
    x = cell.axes[0]
    await until(lambda: state_of(x) == "STANDING")
    x.orders.jog(500)
    await until(lambda: state_of(x) == "MOVING")
    drive_named("x").silent = drive_named("x").deaf = True
    await cell.close()
    farewell = cell.farewells[0]
    assert farewell.text.startswith("NOT KNOWN TO STAND, use the emergency stop if it moves")
    assert farewell.error is not None


async def test_leaving_stops_what_is_in_doubt() -> None:
    cell = cell_of({"x": "sim://compax?name=x&homed=1"}, DriveSettings(in_doubt_after_s=2))
    cell.start()
    x = cell.axes[0]
    await until(lambda: state_of(x) == "STANDING")
    x.orders.jog(5000)
    await until(lambda: state_of(x) == "MOVING")
    drive_named("x").silent = True
    await until(lambda: x.state.doubt is not None or "in doubt" in told(cell))
    drive_named("x").silent = False
    await until(lambda: state_of(x) == "IN DOUBT")
    assert [axis.name for axis in cell.moved_from_here] == ["x"]
    await cell.close()
    assert cell.farewells[0].text == "something was in doubt: it was stopped, and stands"
    assert drive_named("x").log.texts(LogKind.MOTION_STOPPED)


@asynccontextmanager
async def lost_on_its_way() -> AsyncIterator[tuple[Cell, Cable, SimulatedDrive]]:
    """Jog an axis whose line is lost for good meanwhile: it goes on, and nobody sees it."""
    cable, far = Cable(), SimulatedDrive(Knobs(homed=True), name="x")
    await cable.plug(far)
    cell = cell_of({"x": cable.url}, DriveSettings(reconnect=False, stop_timeout_s=2))
    cell.start()
    x = cell.axes[0]
    await until(lambda: state_of(x) == "STANDING")
    x.orders.jog(5000)
    await until(lambda: state_of(x) == "MOVING")
    await cable.pull()
    await until(lambda: x.state.phase is Phase.ENDED)
    assert [axis.name for axis in cell.moved_from_here] == ["x"]
    yield cell, cable, far
    await cell.close()


async def test_an_axis_whose_line_was_lost_for_good_is_not_said_to_stand() -> None:
    async with lost_on_its_way() as (cell, _, far):
        await cell.close()
        assert cell.farewells[0].text.startswith("NOT KNOWN TO STAND, use the emergency stop if it moves")
        assert cell.farewells[0].error is not None
        assert far.moving


async def test_one_whose_line_is_not_there_again_is_not_said_to_stand() -> None:
    async with lost_on_its_way() as (cell, _, far):
        cell.axes[0].try_again()
        await until(lambda: cell.axes[0].state.phase is Phase.UNREACHABLE)
        await cell.close()
        assert cell.farewells[0].text.startswith("NOT KNOWN TO STAND")
        assert "there is no line to stop it" in cell.farewells[0].text
        assert far.moving


async def test_one_whose_line_was_opened_anew_is_in_doubt_still_and_stopped_when_it_is_left() -> None:
    async with lost_on_its_way() as (cell, cable, far):
        x = cell.axes[0]
        await cable.plug(far)
        x.try_again()
        await until(lambda: state_of(x) == "IN DOUBT")
        x.orders.jog(1)
        assert "jog +1 units: nothing was sent, for what became of jog +5000 units is not known" in told(cell)
        await cell.close()
        assert cell.farewells[0].text == "something was in doubt: it was stopped, and stands"
        assert not far.moving
        await cable.pull()


async def test_one_whose_line_was_opened_anew_moves_again_when_somebody_has_looked() -> None:
    async with lost_on_its_way() as (cell, cable, far):
        x = cell.axes[0]
        await cable.plug(far)
        x.try_again()
        await until(lambda: state_of(x) == "IN DOUBT")
        await until(lambda: not far.moving)
        x.orders.reconcile()
        await until(lambda: state_of(x) == "STANDING")
        x.orders.jog(1)
        await until(lambda: "jog +1 units: reached" in told(cell))
        await cell.close()
        assert cell.farewells[0].text == ""
        await cable.pull()


async def test_a_stop_that_waits_for_a_lost_line_is_not_said_to_be_sent() -> None:
    cable, far = Cable(), SimulatedDrive(Knobs(homed=True), name="x")
    await cable.plug(far)
    async with watching({"x": cable.url}) as cell:
        x = cell.axes[0]
        await until(lambda: state_of(x) == "STANDING")
        await cable.pull()
        await until(lambda: x.state.phase is Phase.LOST)
        x.orders.stop()
        assert x.state.stop is not None
        assert "it waits for it" in x.state.stop.text
        assert "sent" not in x.state.stop.text
        await cable.plug(far)
        await until(lambda: "stop: acknowledged, and the axis stands" in told(cell))
    await cable.pull()


async def test_closing_is_carried_through_although_it_is_cancelled() -> None:
    cell = cell_of({"x": "sim://compax?name=x&homed=1"})
    cell.start()
    await until(lambda: state_of(cell.axes[0]) == "STANDING")
    cell.axes[0].orders.jog(500)
    await until(lambda: state_of(cell.axes[0]) == "MOVING")
    closing = asyncio.ensure_future(cell.close())
    await asyncio.sleep(0)
    closing.cancel()
    with pytest.raises(asyncio.CancelledError):
        await closing
    assert "was stopped at" in cell.farewells[0].text


async def test_messages_and_comparators_are_written_down_and_a_flood_of_noise_does_not_push_them_out() -> None:
    async with watching({"x": "sim://compax?name=x&homed=1"}) as cell:
        x = cell.axes[0]
        await until(lambda: state_of(x) == "STANDING")
        x.orders.jog(1)
        await until(lambda: "position reached ($)" in told(cell))
        for _ in range(300):
            drive_named("x").inject(b"NOISE\r\n>")
            await asyncio.sleep(0.05)
        noise = [entry for entry in cell.diary.since(0) if "unexpected text" in entry.text]
        assert 1 <= len(noise) <= 5
        assert "more before it" in noise[-1].text


async def test_a_comparator_that_somebody_has_programmed_is_written_down() -> None:
    async with watching({"x": "sim://compax?name=x&homed=1"}) as cell:
        x = cell.axes[0]
        await until(lambda: x.orders.drive is not None and state_of(x) == "STANDING")
        assert x.orders.drive is not None
        await x.orders.drive.move_to(10, comparators=[(5, 9)])
        await until(lambda: "comparator 1 passed" in told(cell))


async def test_an_axis_that_does_not_say_its_travel_is_watched_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    async def refuse(self: compax_aio.Drive) -> None:
        raise compax_aio.CommandRejectedError("drive rejected 'P90'", sent="P90")

    monkeypatch.setattr(compax_aio.Drive, "read_axis", refuse)
    async with watching({"x": "sim://compax?name=x&homed=1"}) as cell:
        await until(lambda: state_of(cell.axes[0]) == "STANDING")
        assert "cannot be read: drive rejected 'P90'" in told(cell)
        assert cell.axes[0].state.travel is None


async def test_a_defect_on_one_axis_leaves_the_others_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    async with watching({"x": "sim://compax?name=x", "y": "sim://compax?name=y&homed=1"}) as cell:
        x, y = cell.axes
        await until(lambda: state_of(y) == "STANDING" and state_of(x) == "NOT HOMED")

        def fail(reading: object) -> None:
            raise RuntimeError("no such luck")

        monkeypatch.setattr(x.state, "take", fail)
        await until(lambda: x.state.phase is Phase.ENDED)
        assert "by a defect of compax: RuntimeError: no such luck" in told(cell)
        await asyncio.sleep(2)
        assert state_of(y) == "STANDING"
        x.orders.stop()
        await until(lambda: cell.stops["x"].level is Level.QUIET)


async def test_orders_that_fail_are_told() -> None:
    async with watching({"x": "sim://compax?name=x"}, DriveSettings(stop_timeout_s=1, resync_attempts=1)) as cell:
        x = cell.axes[0]
        await until(lambda: state_of(x) == "NOT HOMED")
        drive_named("x").raise_fault(55)
        await until(lambda: state_of(x) == "FAULT E55")
        drive_named("x").silent = True
        x.orders.acknowledge()
        await until(lambda: "acknowledging the error failed" in told(cell))
        drive_named("x").silent = False


def test_axes_are_named_by_the_command_line_or_by_their_lines() -> None:
    first, second = wanted_axes(["x=tcp://moxa:4001", "serial:///dev/ttyUSB0?baudrate=9600"], [])
    assert (first.name, first.url) == ("x", "tcp://moxa:4001")
    assert (second.name, second.url) == ("serial:///dev/ttyUSB0", "serial:///dev/ttyUSB0?baudrate=9600")


@pytest.mark.parametrize(
    ("lines", "settings", "why"),
    [
        ([], [], "no line was named"),
        (["x=sim://compax"] * 65, [], "more than a screen can show"),
        (["x=sim://compax", "x=tcp://moxa:1"], [], "two axes are called x"),
        (["x=tcp://moxa:1", "y=tcp://moxa:1"], [], "is named twice"),
        (["moxa"], [], "moxa"),
        (["x=sim://compax"], ["y=y.toml"], "no axis 'y'"),
        (["x=sim://compax"], ["nowhere.toml"], "cannot be read"),
    ],
)
def test_axes_that_cannot_be_meant_are_refused(lines: list[str], settings: list[str], why: str) -> None:
    with pytest.raises(InvalidCommandError, match=why):
        wanted_axes(lines, settings)


def test_settings_are_for_all_axes_or_for_one(tmp_path: Path) -> None:
    DriveSettings(unit="mm").save(tmp_path / "all.toml")
    DriveSettings(unit="degree").save(tmp_path / "y.toml")
    x, y = wanted_axes(["x=sim://compax", "y=sim://compax"], [str(tmp_path / "all.toml"), f"y={tmp_path / 'y.toml'}"])
    assert (x.settings.unit, y.settings.unit) == ("mm", "degree")
