"""``compax monitor`` as it is called: refused where it cannot work, and in a real terminal from start to end."""

from __future__ import annotations

import asyncio
import os
import re
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pexpect
import pytest

from compax_aio.cli.app import run
from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive
from compax_aio.simulator.server import serve_pty, serve_tcp

_PATIENCE_S = 30.0


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ([], "no line was named"),
        (["x=sim://compax", "--interval", "0"], "--interval must be above 0"),
        (["x=sim://compax", "--step", "-1"], "--step must be above 0"),
        (["x=sim://compax", "--jog-speed", "nan"], "--jog-speed"),
        (["x=sim://compax", "--settings", "nowhere.toml"], "nowhere.toml cannot be read"),
        (["x=sim://compax"], "needs a terminal"),
    ],
)
def test_what_cannot_work_is_refused_before_the_screen_opens(
    words: list[str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["monitor", *words]) == 2
    told = capsys.readouterr()
    assert says in told.err
    assert told.out == ""


def test_the_help_says_which_keys_matter_most(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["monitor", "--help"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    for word in ("space", "--allow-motion", "--settings", "--interval", "--trace", "x=sim://compax"):
        assert word in told


def test_calling_another_command_does_not_import_the_library_of_the_screen() -> None:
    code = "import compax_aio.cli.monitor, sys; sys.exit('textual' in sys.modules)"
    child = pexpect.run(f"{sys.executable} -c {code!r}", withexitstatus=True)
    assert child[1] == 0, child[0]


class Terminal:
    """A terminal in which the monitor runs, as a person uses it."""

    def __init__(self, *words: str) -> None:
        # What is sent is seen as text: the screen is drawn without colours, where a colour would part a word.
        environment = {**os.environ, "TERM": "xterm-256color", "NO_COLOR": "1", "LANG": "C.UTF-8"}
        words = ("-m", "compax_aio.cli", "monitor", *words)
        self.child = pexpect.spawn(
            sys.executable, list(words), env=environment, dimensions=(30, 100), encoding="utf-8", timeout=0.05
        )
        self.seen = ""

    async def sees(self, *texts: str) -> None:
        """Read on until all of *texts* have been drawn; the far ends go on meanwhile."""
        async with asyncio.timeout(_PATIENCE_S):
            while not all(text in self.seen for text in texts):
                self._read()
                await asyncio.sleep(0.02)

    def _read(self) -> None:
        with suppress(pexpect.TIMEOUT, pexpect.EOF):
            piece = self.child.read_nonblocking(65536, timeout=0)
            self.seen += re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", piece)

    def press(self, keys: str) -> None:
        self.seen = ""
        self.child.send(keys)

    async def ends(self) -> int:
        """Return the exit code."""
        async with asyncio.timeout(_PATIENCE_S):
            while self.child.isalive():
                self._read()
                await asyncio.sleep(0.02)
        self._read()
        self.child.close()
        return self.child.exitstatus if self.child.exitstatus is not None else -(self.child.signalstatus or 0)


async def until(condition: Callable[[], object]) -> None:
    async with asyncio.timeout(_PATIENCE_S):
        while not condition():  # noqa: ASYNC110
            await asyncio.sleep(0.02)


def moving_lines(drive: SimulatedDrive) -> list[str]:
    texts = drive.log.texts(LogKind.LINE)
    return [text for text in texts if not (text[0] in "SP" and text[1:].isdigit())]


def drive_of(name: str) -> SimulatedDrive:
    return SimulatedDrive(Knobs(homed=True), name=name)


@pytest.mark.real_time
async def test_ctrl_c_in_the_middle_of_a_jog_stops_the_axis_and_says_so() -> None:
    x, y = drive_of("x"), drive_of("y")
    async with serve_pty(x) as x_url, serve_tcp(y) as y_url:
        terminal = Terminal(f"x={x_url}", f"y={y_url}", "--allow-motion", "--step", "500", "--jog-speed", "20")
        await terminal.sees("STANDING", "y  connected")
        terminal.press("m\x1b[C")
        await until(lambda: "PR500$" in moving_lines(x))
        await terminal.sees("begun here")
        terminal.press("\x03")
        assert await terminal.ends() == 130
        assert "x: jog +500 units was under way: move_by(500) was stopped at" in terminal.seen
        assert moving_lines(x) == ["SD20", "PR500$", "STOP"]
        assert x.log.texts(LogKind.MOTION_STOPPED)
        assert moving_lines(y) == []


@pytest.mark.real_time
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
async def test_a_terminal_that_is_closed_and_a_polite_kill_stop_what_moves(number: signal.Signals) -> None:
    x = drive_of("x")
    async with serve_tcp(x) as url:
        terminal = Terminal(f"x={url}", "--allow-motion", "--step", "500")
        await terminal.sees("STANDING")
        terminal.press("m\x1b[C")
        await until(lambda: "PR500$" in moving_lines(x))
        terminal.child.kill(number)
        assert await terminal.ends() == 128 + number
        assert moving_lines(x)[-1] == "STOP"
        assert "was stopped at" in terminal.seen
        assert "Traceback" not in terminal.seen


@pytest.mark.real_time
async def test_an_unplugged_cable_and_a_silent_drive_are_seen_and_q_leaves() -> None:
    x, y = drive_of("x"), drive_of("y")
    async with serve_tcp(y) as y_url:
        async with serve_tcp(x) as x_url:
            terminal = Terminal(f"x={x_url}", f"y={y_url}", "z=tcp://127.0.0.1:1")
            await terminal.sees("x  connected", "y  connected", "NOT REACHABLE")
            y.silent = True
            await terminal.sees("NO ANSWER")
        await terminal.sees("LINE LOST")
        terminal.press("q")
        assert await terminal.ends() == 0
    assert "Nothing was in motion from here." in terminal.seen


@pytest.mark.real_time
async def test_a_stop_that_nobody_acknowledges_is_told_when_leaving_with_its_exit_code(tmp_path: Path) -> None:
    (tmp_path / "quick.toml").write_text("stop_timeout_s = 1.0\n")
    x = drive_of("x")
    async with serve_tcp(x) as url:
        words = (f"x={url}", "--allow-motion", "--step", "500", "--settings", str(tmp_path / "quick.toml"))
        terminal = Terminal(*words)
        await terminal.sees("STANDING")
        terminal.press("m\x1b[C")
        await until(lambda: "PR500$" in moving_lines(x))
        x.deaf = True
        terminal.press("\x03")
        assert await terminal.ends() in {4, 8}
    assert "x: NOT KNOWN TO STAND, use the emergency stop if it moves" in terminal.seen


@pytest.mark.real_time
async def test_a_terminal_that_takes_nothing_keeps_no_key_from_stopping() -> None:
    x = SimulatedDrive(Knobs(homed=True, nominal_speed=50), name="x")
    async with serve_tcp(x) as url:
        terminal = Terminal(f"x={url}", "--allow-motion", "--step", "3000", "--interval", "0.05")
        await terminal.sees("STANDING")
        terminal.press("m\x1b[C")
        await terminal.sees("begun here")
        asked = x.log.texts(LogKind.LINE).count("S1")
        # From here on nobody reads what is drawn.
        await until(lambda: x.log.texts(LogKind.LINE).count("S1") > asked + 200)
        assert x.moving
        terminal.press(" ")
        await until(lambda: not x.moving)
        await terminal.sees("acknowledged, and the axis stands")
        terminal.press("q")
        assert await terminal.ends() == 0
