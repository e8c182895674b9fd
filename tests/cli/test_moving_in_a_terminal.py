"""The commands that move and configure, in a real terminal, against a simulated drive on a real pseudo-terminal."""

from __future__ import annotations

import asyncio
import signal
import termios
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import pytest
from tests.fakes.terminal import LIMIT_S, Terminal

from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive
from compax_aio.simulator.server import serve_pty, serve_tcp

pytestmark = pytest.mark.real_time


@pytest.fixture
async def open_terminal() -> AsyncIterator[Callable[..., Terminal]]:
    terminals: list[Terminal] = []

    def open_one(*words: str) -> Terminal:
        terminals.append(Terminal(*words))
        return terminals[-1]

    yield open_one
    for each in terminals:
        each.child.close(force=True)


@pytest.fixture
def impatient(tmp_path: Path) -> str:
    """Settings for who has no time to wait for a drive that does not answer."""
    path = tmp_path / "impatient.toml"
    path.write_text("answer_timeout_s = 0.2\nin_doubt_after_s = 2\nstop_timeout_s = 1\n")
    return str(path)


@pytest.fixture
async def drive() -> SimulatedDrive:
    return SimulatedDrive(Knobs(homed=True, nominal_speed=50, baudrate=9600))


@pytest.fixture
async def url(drive: SimulatedDrive) -> AsyncIterator[str]:
    async with serve_pty(drive) as url:
        yield url


async def until(condition: Callable[[], Any]) -> None:
    async with asyncio.timeout(LIMIT_S):
        while not condition():  # noqa: ASYNC110 - the drive sets no event
            await asyncio.sleep(0.01)


async def test_a_bar_is_drawn_and_the_result_told(open_terminal: Callable[..., Terminal], url: str) -> None:
    terminal = open_terminal("move", url, "20", "--name", "x")
    await terminal.sees("x → 20.00 units")
    await terminal.sees("PA20$ is on its way")
    code, told = await terminal.ends()
    assert code == 0
    assert "x: 20.00 units reached in 0." in told
    assert "it stands at 20.00 units" in told


async def test_ctrl_c_stops_the_axis_and_says_where_it_stands(
    open_terminal: Callable[..., Terminal], url: str, drive: SimulatedDrive
) -> None:
    terminal = open_terminal("move", url, "2000", "--name", "x")
    await until(lambda: drive.moving)
    terminal.types("\x03")
    await terminal.sees("Stopping x")
    code, told = await terminal.ends()
    assert code == 130
    assert f"x has acknowledged STOP and stands at {drive.position:.2f} units." in told
    assert not drive.moving


async def test_a_terminal_that_is_closed_stops_the_axis(
    open_terminal: Callable[..., Terminal], url: str, drive: SimulatedDrive
) -> None:
    terminal = open_terminal("move", url, "2000")
    await until(lambda: drive.moving)
    terminal.is_shut()
    await until(lambda: not drive.moving)
    assert drive.log.texts(LogKind.MOTION_STOPPED)
    await asyncio.to_thread(terminal.child.wait)


async def test_a_terminal_that_is_held_by_ctrl_s_holds_up_no_stop(
    open_terminal: Callable[..., Terminal], url: str, drive: SimulatedDrive
) -> None:
    terminal = open_terminal("move", url, "2000", "--timeout", "4")
    await until(lambda: drive.moving)
    terminal.types("\x13")  # from here on it takes nothing
    await until(lambda: not drive.moving)
    assert drive.position < 2000 / 3
    terminal.types("\x11")
    code, told = await terminal.ends()
    assert code == 7
    assert "was not at its target within 4 s and was stopped" in told


async def test_a_terminal_that_is_held_by_ctrl_s_does_not_keep_a_signal_from_stopping(
    open_terminal: Callable[..., Terminal], url: str, drive: SimulatedDrive
) -> None:
    terminal = open_terminal("move", url, "2000")
    await until(lambda: drive.moving)
    terminal.types("\x13")
    where = drive.position
    await until(lambda: drive.position > where + 25)  # what was on its way is stuck by now
    terminal.child.kill(signal.SIGTERM)
    await asyncio.to_thread(terminal.child.wait)
    assert terminal.child.exitstatus == 143
    assert not drive.moving
    assert drive.position < 2000 / 3


async def test_ctrl_z_leaves_no_axis_alone(
    open_terminal: Callable[..., Terminal], url: str, drive: SimulatedDrive
) -> None:
    terminal = open_terminal("move", url, "2000", "--timeout", "5")
    await until(lambda: drive.moving)
    terminal.types("\x1a")
    await terminal.sees("Not put to sleep")
    await until(lambda: not drive.moving)
    code, _ = await terminal.ends()
    assert code == 7


async def test_a_yes_that_was_typed_ahead_is_none(
    open_terminal: Callable[..., Terminal], url: str, drive: SimulatedDrive
) -> None:
    terminal = open_terminal("params", "set", url, "P40=1.5")
    terminal.types("y\n")
    await terminal.sees("[y/N] ")
    terminal.types("n\n")
    code, told = await terminal.ends()
    assert code == 0
    assert "Nothing was written." in told
    assert not [line for line in drive.log.texts(LogKind.LINE) if "=" in line]


async def test_a_wrong_port_is_told(open_terminal: Callable[..., Terminal]) -> None:
    code, told = await open_terminal("home", "serial:///dev/ttyNoSuchPort").ends()
    assert code == 3
    assert "TransportError" in told
    assert "ttyNoSuchPort" in told


@pytest.mark.parametrize("command", ["home", "stop"])
async def test_a_wrong_baud_rate_is_told(
    open_terminal: Callable[..., Terminal], url: str, impatient: str, command: str
) -> None:
    wrong = url.partition("?")[0] + "?baudrate=4800"
    code, told = await open_terminal(command, wrong, "--settings", impatient).ends()
    assert code == 4
    assert "baud rate" in told
    assert "Traceback" not in told


async def test_a_silent_drive_is_told(
    open_terminal: Callable[..., Terminal], url: str, drive: SimulatedDrive, impatient: str
) -> None:
    drive.silent = True
    code, told = await open_terminal("move", url, "10", "--settings", impatient).ends()
    assert code == 4
    assert "check power, cable" in told
    code, told = await open_terminal("stop", url, "--settings", impatient).ends()
    assert code == 4
    assert "STOP was sent, and not acknowledged" in told
    assert "emergency stop" in told


async def test_an_unplugged_cable_is_told_as_doubt(open_terminal: Callable[..., Terminal], impatient: str) -> None:
    drive = SimulatedDrive(Knobs(homed=True, nominal_speed=5))
    async with serve_tcp(drive) as url:
        terminal = open_terminal("move", url, "2000", "--name", "x", "--settings", impatient)
        await terminal.sees("is on its way")
    await terminal.sees("the line is lost, and tried again; the axis may be moving")
    code, told = await terminal.ends()
    assert code == 8
    assert "MoveInDoubtError: x: what became of move_to(2000) is in doubt" in told
    assert "look at the machine" in told


async def test_jogging_moves_stops_and_gives_the_terminal_back(
    open_terminal: Callable[..., Terminal], url: str, drive: SimulatedDrive
) -> None:
    terminal = open_terminal("jog", url, "--step", "5", "--speed", "50", "--name", "x")
    await terminal.sees("machine zero")
    before = termios.tcgetattr(terminal.child.child_fd)[3]
    assert not before & termios.ICANON
    terminal.types("\x1b[C")
    await until(lambda: drive.position == 5.0)
    await terminal.sees("+5: reached")
    terminal.types("\x1b[A\x1b[D\x1b[D\x1b[D")
    await until(lambda: drive.moving)
    terminal.types(" ")
    await terminal.sees("stopped; it stands")
    assert not drive.moving
    terminal.types("\x1b")
    await terminal.sees("Nothing that was started here moves x")
    assert termios.tcgetattr(terminal.child.child_fd)[3] & termios.ICANON
    code, _ = await terminal.ends()
    assert code == 0
    assert len(drive.log.texts(LogKind.MOTION_STARTED)) == 2


async def test_ctrl_c_while_jogging_stops_the_axis(
    open_terminal: Callable[..., Terminal], url: str, drive: SimulatedDrive
) -> None:
    terminal = open_terminal("jog", url, "--step", "100", "--name", "x")
    await terminal.sees("machine zero")
    terminal.types("\x1b[C")
    await until(lambda: drive.moving)
    terminal.types("\x03")
    code, told = await terminal.ends()
    assert code == 130
    assert f"x has acknowledged STOP and stands at {drive.position:.2f} units." in told
    assert not drive.moving


async def test_parameters_are_asked_for_shown_and_written(
    open_terminal: Callable[..., Terminal], url: str, drive: SimulatedDrive
) -> None:
    terminal = open_terminal("params", "set", url, "P40=1.5", "--name", "x")
    await terminal.sees("Write 1 parameter of x? [y/N]")
    assert "P40=1.500" not in drive.log.texts(LogKind.LINE)
    terminal.types("y\r")
    code, told = await terminal.ends()
    assert code == 0
    assert "x: 1 parameter written and read back" in told


async def test_ctrl_c_while_a_program_runs_stops_it(
    open_terminal: Callable[..., Terminal], url: str, drive: SimulatedDrive
) -> None:
    drive.load_program(["POSA 2000", "POSA 0", "END"])
    terminal = open_terminal("program", "run", url, "--from", "1", "--wait", "--name", "x")
    await terminal.sees("x runs its program")
    terminal.types("\x03")
    code, told = await terminal.ends()
    assert code == 130
    assert "its program is stopped" in told
    assert not drive.moving


async def test_all_parameters_are_read_under_a_bar(open_terminal: Callable[..., Terminal]) -> None:
    terminal = open_terminal("params", "get", "sim://compax?answer_time_s=0.01")
    await terminal.sees("reading")
    await terminal.sees("/250")
    code, told = await terminal.ends()
    assert code == 0
    assert "P250" in told
