"""The screen of the monitor, by its keys: looking only until told, space stops all, leaving stops what was begun."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager

import pytest
import textual
from tests.promises.cable import Cable
from textual import events
from textual.pilot import Pilot
from textual.widgets import RichLog

from compax_aio import DriveSettings
from compax_aio.cli.monitoring.cell import Cell
from compax_aio.cli.monitoring.dialogs import Help, Leaving, Question
from compax_aio.cli.monitoring.levels import Level
from compax_aio.cli.monitoring.screen import Monitor
from compax_aio.cli.monitoring.wanted import WantedAxis
from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive
from compax_aio.simulator.server import drive_named

_SETTINGS = DriveSettings(unit="mm", stop_timeout_s=3)


@pytest.fixture(autouse=True)
def screen_on_the_loops_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let textual's timers go by the clock of the event loop, which is a virtual one."""
    monkeypatch.setattr(textual._time, "get_time", lambda: asyncio.get_running_loop().time())


class Seat:
    """A person in front of the screen."""

    def __init__(self, monitor: Monitor, pilot: Pilot[bool]) -> None:
        self.monitor = monitor
        self.pilot = pilot

    async def press(self, *keys: str) -> None:
        await self.pilot.press(*keys)

    async def sees(self, *texts: str, within_s: float = 100.0) -> None:
        """Wait until all of *texts* are on the screen at once."""
        try:
            async with asyncio.timeout(within_s):
                while not all(text in self.picture() for text in texts):  # noqa: ASYNC110
                    await asyncio.sleep(0.1)
        except TimeoutError:
            raise AssertionError(f"never on the screen: {texts}\n{self.picture()}") from None

    def picture(self) -> str:
        """All that is on the screen, as text."""
        lines = self.monitor.screen._compositor.render_strips()
        return "\n".join(strip.text for strip in lines)

    def log(self) -> str:
        """All that was ever written in the log."""
        return "\n".join(f"{entry.axis} {entry.text}" for entry in self.monitor.cell.diary.since(0))


@asynccontextmanager
async def seated(
    urls: Mapping[str, str], *, size: tuple[int, int] = (110, 44), asks: bool = True
) -> AsyncIterator[Seat]:
    """Sit down in front of a monitor of these axes."""
    wanted = [WantedAxis(name, url, _SETTINGS) for name, url in urls.items()]
    cell = Cell(wanted, interval_s=0.2, jog_percent=50)
    monitor = Monitor(cell, asks_before_motion=asks)
    async with monitor.run_test(size=size) as pilot:
        yield Seat(monitor, pilot)
        await cell.close()
    assert asyncio.all_tasks() == {asyncio.current_task()}


def simulated(*names: str, more: str = "") -> dict[str, str]:
    return {name: f"sim://compax?name={name}&homed=1{more}" for name in names}


def moving_lines(name: str) -> list[str]:
    """What the far end was told that moves, stops or changes it."""
    texts = drive_named(name).log.texts(LogKind.LINE)
    return [text for text in texts if not (text[0] in "SP" and text[1:].isdigit())]


async def until(condition: Callable[[], object], within_s: float = 100.0) -> None:
    async with asyncio.timeout(within_s):
        while not condition():  # noqa: ASYNC110
            await asyncio.sleep(0.02)


async def test_all_axes_are_seen_with_what_they_say() -> None:
    async with seated(simulated("x", "y", more="&travel_min=-10&travel_max=300")) as seat:
        await seat.sees("▌ x", "y  ■ STANDING", "position, 60 s", "-10 ", " 300", "●homed", "○fault", "/s")
        assert "looking only" in seat.picture()


async def test_as_long_as_motion_is_off_no_key_sends_anything() -> None:
    async with seated(simulated("x")) as seat:
        await seat.sees("STANDING")
        await seat.press("right", "shift+left", "h", "a", "r", "plus")
        await asyncio.sleep(3)
        assert moving_lines("x") == []
        assert "jog: nothing was sent, motion is off (m)" in seat.log()
        assert "search for machine zero: nothing was sent" in seat.log()
        assert "not in doubt" in seat.log()


async def test_motion_is_switched_on_by_a_yes_and_by_nothing_else() -> None:
    async with seated(simulated("x")) as seat:
        await seat.sees("STANDING")
        for answer in ("n", "escape", "q"):
            await seat.press("m")
            await seat.sees("emergency stop within")
            await seat.press("enter", answer, "right")
            assert not seat.monitor.is_motion_on
        assert moving_lines("x") == []
        await seat.press("m", "y", "right")
        await until(lambda: moving_lines("x") == ["SD50", "PR1$"])
        await seat.sees("MOTION ON: ← → jog 1 mm", "jog +1 mm: reached 1.00 mm")
        await seat.press("m", "right")
        assert "motion is off" in seat.log()


async def test_steps_grow_and_shrink_and_shift_takes_ten() -> None:
    async with seated(simulated("x"), asks=False) as seat:
        await seat.sees("STANDING")
        await seat.press("m", "plus", "plus", "minus", "shift+left")
        await until(lambda: moving_lines("x") == ["SD50", "PR-20$"])
        await seat.sees("jog -20 mm: reached -20.00 mm")


async def test_keys_that_wait_for_a_busy_computer_move_nothing() -> None:
    async with seated(simulated("x"), asks=False) as seat:
        await seat.sees("STANDING")
        await seat.press("m")
        late = [events.Key(key, None) for key in ("right", "right", "shift+left", "h", "y")]
        stop = events.Key("space", " ")
        await asyncio.sleep(1)
        for key in (*late, stop):
            seat.monitor.post_message(key)
        await seat.sees("right: not heeded, it came too late")
        await until(lambda: "STOP" in moving_lines("x"))
        assert moving_lines("x") == ["STOP"]
        await seat.press("m", "right")
        await until(lambda: "PR1$" in moving_lines("x"))


async def test_machine_zero_is_looked_for_only_after_a_question() -> None:
    async with seated(simulated("x"), asks=False) as seat:
        await seat.sees("STANDING")
        await seat.press("m", "h")
        await seat.sees("Let x find machine zero?")
        await seat.press("n")
        assert moving_lines("x") == []
        await seat.press("h", "y")
        await until(lambda: moving_lines("x") == ["PH"])
        await seat.sees("search for machine zero: reached")


async def test_space_stops_all_axes_while_one_moves() -> None:
    async with seated(simulated("x", "y"), asks=False) as seat:
        await seat.sees("y  ■ STANDING")
        seat.monitor.step = 500.0
        await seat.press("m", "right")
        await seat.sees("x  ◆ MOVING")
        await seat.press("space")
        await seat.sees("STOP x  ■ acknowledged, and the axis stands", "STOP y  ■ acknowledged, and the axis stands")
        assert not seat.monitor.is_motion_on, "a key that is still held down shall move nothing"
        assert "STOP" in moving_lines("x")
        assert moving_lines("y") == ["STOP"]
        assert drive_named("x").log.texts(LogKind.MOTION_STOPPED)
        await asyncio.sleep(40)
        await seat.press("k")
        assert "acknowledged, and the axis stands" not in seat.picture().split("STOP ALL")[0]


@pytest.mark.parametrize("keys", [("m",), ("question_mark",), ("q",)], ids=["question", "help", "leaving?"])
async def test_space_stops_all_in_every_dialog_and_closes_it(keys: tuple[str, ...]) -> None:
    async with seated(simulated("x", "y")) as seat:
        await seat.sees("y  ■ STANDING")
        seat.monitor.cell.axes[0].orders.jog(500)
        await seat.sees("x  ◆ MOVING")
        await seat.press(*keys)
        await until(lambda: isinstance(seat.monitor.screen, Question | Help))
        await seat.press("space")
        await seat.sees("STOP x  ■ acknowledged", "STOP y  ■ acknowledged")
        assert len(seat.monitor.screen_stack) == 1


async def test_a_yes_that_comes_after_a_stop_moves_nothing() -> None:
    async with seated(simulated("x"), asks=False) as seat:
        await seat.sees("STANDING")
        await seat.press("m", "h", "space", "y")
        await seat.sees("STOP x  ■ acknowledged")
        assert moving_lines("x") == ["STOP"]


async def test_a_stop_that_is_not_acknowledged_is_said_to_be_none() -> None:
    async with seated(simulated("x", "y")) as seat:
        await seat.sees("y  ■ STANDING")
        drive_named("x").silent = drive_named("x").deaf = True
        await seat.press("space")
        await seat.sees("STOP x  … waiting for the drive", "STOP y  ■ acknowledged")
        await seat.sees("STOP x  ▲ NOT ACKNOWLEDGED: use the emergency stop")
        await asyncio.sleep(60)
        await seat.sees("STOP x  ▲ NOT ACKNOWLEDGED: use the emergency stop")
        drive_named("x").silent = drive_named("x").deaf = False


async def test_s_stops_the_axis_that_is_chosen_and_no_other() -> None:
    async with seated(simulated("x", "y", "z")) as seat:
        await seat.sees("z  ■ STANDING")
        await seat.press("k", "j", "down", "down", "up", "s")
        await seat.sees("STOP y  ■ acknowledged")
        assert [moving_lines(name) for name in "xyz"] == [[], ["STOP"], []]
        await seat.pilot.click(seat.monitor._panels[2])
        await seat.sees("▌ z")


async def test_a_fault_on_one_axis_is_seen_named_and_acknowledged() -> None:
    async with seated(simulated("x", "y")) as seat:
        await seat.sees("y  ■ STANDING")
        drive_named("x").raise_fault(55)
        await seat.sees("x  ▲ FAULT E55", "emergency stop: release the emergency stop", "▲fault", "y  ■ STANDING")
        await seat.press("a")
        await seat.sees("QUIT was taken")
        await until(lambda: "FAULT" not in seat.picture())
        assert moving_lines("x") == ["QUIT"]


async def test_a_lost_line_is_told_with_old_values_and_comes_back() -> None:
    cable, far = Cable(), SimulatedDrive(Knobs(homed=True, position=12.5), name="x")
    await cable.plug(far)
    async with seated({"x": cable.url, **simulated("y")}) as seat:
        await seat.sees("x  ■ STANDING", "y  ■ STANDING")
        await cable.pull()
        await seat.sees("x  ▲ LINE LOST 12 s", "it may move", "12 s old", "y  ■ STANDING")
        assert "tried" in seat.picture()
        await cable.plug(far)
        await seat.sees("x  ■ STANDING", "the line is back after")
        assert " old" not in seat.picture()
    await cable.pull()


async def test_the_screen_opens_although_an_axis_is_not_there_and_c_tries_it_again() -> None:
    cable = Cable()
    async with seated({"x": cable.url, **simulated("y")}) as seat:
        await seat.sees("x  ▲ NOT REACHABLE", "(c: now)", "nobody listens", "y  ■ STANDING", "--")
        await asyncio.sleep(30)
        await cable.plug(SimulatedDrive(Knobs(homed=True), name="x"))
        await seat.press("c")
        await seat.sees("x  ■ STANDING", within_s=1)
    await cable.pull()


async def test_a_drive_in_doubt_is_reconciled_after_a_question() -> None:
    async with seated(simulated("x")) as seat:
        await seat.sees("x  ■ STANDING")
        drive_named("x").silent = drive_named("x").deaf = True
        await seat.press("s")
        await seat.sees("NOT ACKNOWLEDGED")
        drive_named("x").silent = drive_named("x").deaf = False
        await seat.sees("x  ▲ IN DOUBT", "look at the machine, then r")
        await seat.press("r")
        await seat.sees("Have you looked at the machine, and does it stand?")
        await seat.press("n")
        assert seat.monitor.cell.axes[0].state.doubt is not None
        await seat.press("r", "y")
        await seat.sees("x  ■ STANDING", "it takes motion again")


async def test_q_asks_if_something_moves_that_was_started_here_and_stops_it() -> None:
    async with seated(simulated("x", "y")) as seat:
        await seat.sees("x  ■ STANDING")
        seat.monitor.cell.axes[0].orders.jog(500)
        await seat.sees("x  ◆ MOVING")
        await seat.press("q")
        await seat.sees("x may be moving, started here. Leaving stops it first.")
        await seat.press("n")
        await asyncio.sleep(0.5)
        assert not drive_named("x").log.texts(LogKind.MOTION_STOPPED)
        await seat.press("q", "y")
        await until(lambda: seat.monitor.cell.farewells)
    assert "was stopped at" in seat.monitor.cell.farewells[0].text
    assert seat.monitor.cell.farewells[1].text == ""
    assert drive_named("x").log.texts(LogKind.MOTION_STOPPED)
    assert moving_lines("y") == []
    assert seat.monitor.return_value is False


async def test_q_leaves_at_once_if_nothing_moves_and_sends_nothing() -> None:
    async with seated(simulated("x")) as seat:
        await seat.sees("x  ■ STANDING")
        await seat.press("q")
        await until(lambda: seat.monitor.cell.farewells)
    assert moving_lines("x") == []


async def test_ctrl_c_stops_and_leaves_without_asking_also_from_a_dialog_and_twice() -> None:
    async with seated(simulated("x")) as seat:
        await seat.sees("x  ■ STANDING")
        seat.monitor.cell.axes[0].orders.jog(500)
        await seat.sees("x  ◆ MOVING")
        drive_named("x").extra_answer_delay_s = 0.3  # so that leaving can be seen
        await seat.press("question_mark", "ctrl+c")
        assert isinstance(seat.monitor.screen, Leaving)
        assert "Stopping x, and waiting until it stands" in seat.picture()
        await seat.press("ctrl+c", "space")
        await until(lambda: seat.monitor.cell.farewells)
    assert seat.monitor.return_value is True
    assert drive_named("x").log.texts(LogKind.MOTION_STOPPED)


async def test_everything_has_its_place_on_eighty_columns_and_twenty_four_lines() -> None:
    urls = simulated("x", "y", "z", more="&travel_min=-10&travel_max=300")
    async with seated(urls, size=(80, 24)) as seat:
        await seat.sees("x  ■ STANDING", "y  ■ STANDING", "z  ■ STANDING", "space STOP ALL", "quit", "0.00 mm")
        lines = seat.picture().splitlines()
        assert len(lines) == 24
        assert sum("○program" in line for line in lines) == 3, "the last lamp of each axis is there"
        assert sum("ms" in line for line in lines) == 3
        await seat.press("question_mark")
        assert "A stop from software is no emergency" in seat.picture()
        await seat.press("escape")
        await seat.pilot.resize_terminal(120, 50)
        await seat.sees("mm  position", "following error")
        await seat.pilot.resize_terminal(40, 12)
        await seat.sees("STOP ALL", "x  ■ STANDING")


async def test_many_axes_scroll_to_the_one_that_is_chosen() -> None:
    async with seated(simulated(*"abcdefghi"), size=(80, 24)) as seat:
        await seat.sees("a  ■ STANDING")
        assert "i  ■" not in seat.picture()
        await seat.press(*["j"] * 8)
        await seat.sees("▌ i  ■ STANDING")


async def test_the_log_is_looked_back_in_by_keys() -> None:
    async with seated(simulated("x", "y", "z"), size=(80, 24)) as seat:
        await seat.sees("z  ■ STANDING")
        for number in range(60):
            seat.monitor.cell.diary.add("", f"line {number}")
        await seat.sees("line 59")
        log = seat.monitor.query_one("#log", RichLog)
        await seat.press(*["pageup"] * 3)
        await until(lambda: "line 59" not in seat.picture())
        seat.monitor.cell.diary.add("", "news")
        await asyncio.sleep(1)
        assert "news" not in seat.picture(), "who reads is not disturbed"
        await seat.press(*["pagedown"] * 6)
        await seat.sees("news")
        seat.monitor.cell.diary.add("", "more news")
        await seat.sees("more news")
        assert log.max_lines == 1000


async def test_nobody_can_put_the_monitor_to_sleep_or_call_what_is_not_its_own() -> None:
    async with seated(simulated("x")) as seat:
        await seat.sees("STANDING")
        await seat.press("ctrl+p", "ctrl+z", "tab", "enter")
        assert len(seat.monitor.screen_stack) == 1
        assert seat.monitor.focused is None


async def test_a_defect_of_the_screen_is_kept_for_whoever_runs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(self: Monitor, head: object) -> None:
        raise RuntimeError("no such luck")

    with pytest.raises(RuntimeError, match="no such luck"):  # noqa: PT012
        async with seated(simulated("x")) as seat:
            monkeypatch.setattr(Monitor, "_show_head", fail)
            await until(lambda: seat.monitor.defect is not None)
    assert seat.monitor._exit_renderables == []
    await seat.monitor.cell.close()


async def test_it_is_told_by_signs_as_well_as_by_colours() -> None:
    assert len({level.sign for level in Level}) == len(Level)
