"""``compax monitor`` from its words to its exit code: its screen is drawn nowhere, its keys are pressed by the test."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

import pytest
import textual
from textual.pilot import Pilot

import compax_aio.cli.monitor as command
from compax_aio.cli.monitoring.screen import Monitor
from compax_aio.simulator.compax import Knobs, LogKind
from compax_aio.simulator.server import drive_named

Hands = Callable[[Pilot[object]], Coroutine[Any, Any, None]]


@pytest.fixture
def pressed_by(monkeypatch: pytest.MonkeyPatch) -> Callable[[Hands], None]:
    """Let the screen be drawn nowhere, on the loop's clock, and its keys be pressed by a function."""
    show = Monitor.run_async
    monkeypatch.setattr(textual._time, "get_time", lambda: asyncio.get_running_loop().time())
    monkeypatch.setattr(command, "_expect_terminal", lambda: None)

    def set_hands(hands: Hands) -> None:
        async def run_async(self: Monitor) -> bool | None:
            return await show(self, headless=True, size=(100, 30), auto_pilot=hands)

        monkeypatch.setattr(Monitor, "run_async", run_async)

    return set_hands


async def until(condition: Callable[[], object]) -> None:
    async with asyncio.timeout(100):
        while not condition():  # noqa: ASYNC110
            await asyncio.sleep(0.02)


async def jog(pilot: Pilot[object]) -> None:
    await asyncio.sleep(2)
    await pilot.press("m", "right")
    await until(lambda: "PR500$" in drive_named("x").log.texts(LogKind.LINE))


async def test_who_only_looks_leaves_with_zero(
    pressed_by: Callable[[Hands], None], capsys: pytest.CaptureFixture[str]
) -> None:
    async def hands(pilot: Pilot[object]) -> None:
        await asyncio.sleep(2)
        await pilot.press("q")

    pressed_by(hands)
    assert await command.monitor("x=sim://compax") == 0
    assert "Nothing was in motion from here." in capsys.readouterr().err


async def test_what_was_stopped_is_said_when_the_screen_is_closed(
    pressed_by: Callable[[Hands], None], capsys: pytest.CaptureFixture[str]
) -> None:
    drive_named("x", Knobs(homed=True))

    async def hands(pilot: Pilot[object]) -> None:
        await jog(pilot)
        await pilot.press("ctrl+c")

    pressed_by(hands)
    assert await command.monitor("x=sim://compax?name=x", allow_motion=True, step=500) == 130
    assert "x: jog +500 units was under way: move_by(500) was stopped at" in " ".join(capsys.readouterr().err.split())
    assert "SD10" in drive_named("x").log.texts(LogKind.LINE), "a jog is slow, unless somebody wants it otherwise"


async def test_an_axis_that_is_not_known_to_stand_is_said_in_the_exit_code(
    pressed_by: Callable[[Hands], None], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "x.toml").write_text("stop_timeout_s = 1.0\n")

    async def hands(pilot: Pilot[object]) -> None:
        await jog(pilot)
        drive_named("x").silent = drive_named("x").deaf = True
        await pilot.press("ctrl+c")

    pressed_by(hands)
    words = ("x=sim://compax?name=x&homed=1",)
    code = await command.monitor(*words, allow_motion=True, step=500, settings=(f"x={tmp_path / 'x.toml'}",))
    assert code == 4
    assert "x: NOT KNOWN TO STAND, use the emergency stop" in " ".join(capsys.readouterr().err.split())


async def test_a_signal_stops_what_was_started_and_goes_on_to_whoever_calls(
    pressed_by: Callable[[Hands], None], capsys: pytest.CaptureFixture[str]
) -> None:
    async def hands(pilot: Pilot[object]) -> None:
        await jog(pilot)
        task.cancel()

    pressed_by(hands)
    task = asyncio.ensure_future(command.monitor("x=sim://compax?name=x&homed=1", allow_motion=True, step=500))
    with pytest.raises(asyncio.CancelledError):
        await task
    assert drive_named("x").log.texts(LogKind.MOTION_STOPPED)
    assert "was stopped at" in capsys.readouterr().err


async def test_a_defect_of_the_screen_is_raised_once_the_axes_are_stopped(
    pressed_by: Callable[[Hands], None], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(self: Monitor, head: object) -> None:
        raise RuntimeError("no such luck")

    async def hands(pilot: Pilot[object]) -> None:
        await jog(pilot)
        monkeypatch.setattr(Monitor, "_show_head", fail)
        await asyncio.sleep(1)

    pressed_by(hands)
    with pytest.raises(RuntimeError, match="no such luck"):
        await command.monitor("x=sim://compax?name=x&homed=1", allow_motion=True, step=500)
    assert drive_named("x").log.texts(LogKind.MOTION_STOPPED)
    told = capsys.readouterr().err
    assert "was stopped at" in told
    assert "Traceback" not in told


async def test_a_terminal_that_is_gone_does_not_keep_the_farewell_from_its_exit_code(
    pressed_by: Callable[[Hands], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    class Gone:
        def print(self, *_: object, **__: object) -> None:
            raise OSError(5, "Input/output error")

    async def hands(pilot: Pilot[object]) -> None:
        await pilot.press("q")

    pressed_by(hands)
    monkeypatch.setattr(command, "notes_console", Gone)
    assert await command.monitor("x=sim://compax") == 0
