"""The shell in a real terminal, on a real line: what is drawn, what keys do, and what it leaves behind."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import Any

import pexpect
import pytest

from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive
from compax_aio.simulator.server import serve_pty, serve_tcp

pytestmark = pytest.mark.real_time

_SOON_S = 30
CTRL_C, CTRL_D, CTRL_U, CTRL_X, TAB = "\x03", "\x04", "\x15", "\x18", "\t"
BANNER = "A stop from software is no emergency stop"


class Terminal:
    """A terminal in which the shell runs."""

    def __init__(self, process: pexpect.spawn[str]) -> None:
        self.process = process

    async def sees(self, *texts: str) -> None:
        """Wait until *texts* have come, one after the other."""
        for text in texts:
            await asyncio.to_thread(self.process.expect_exact, text)

    async def says(self, line: str, *answers: str) -> None:
        """Type a line, and wait for its answers."""
        self.press(line + "\r")
        await self.sees(*answers)

    def press(self, keys: str) -> None:
        """Press *keys*, without Enter."""
        self.process.send(keys)

    async def code(self) -> int:
        """Wait for the end; returns the exit code, or that of the signal as shells tell it."""
        await self.sees_end()
        self.process.close()
        status, number = self.process.exitstatus, self.process.signalstatus
        assert status is not None or number is not None
        return status if status is not None else 128 + (number or 0)

    async def sees_end(self) -> str:
        """Wait for the end; returns what came before."""
        await asyncio.to_thread(self.process.expect, pexpect.EOF)
        return str(self.process.before)


@asynccontextmanager
async def shell(state: Path, *words: str) -> AsyncIterator[Terminal]:
    """Run ``compax shell`` with *words* in a terminal."""
    environment = {**os.environ, "XDG_STATE_HOME": str(state), "PROMPT_TOOLKIT_NO_CPR": "1", "TERM": "xterm-256color"}
    process = pexpect.spawn(
        sys.executable,
        ["-m", "compax_aio.cli", "shell", *words],
        env=environment,
        encoding="utf-8",
        codec_errors="replace",
        dimensions=(40, 160),
        timeout=_SOON_S,
    )
    try:
        yield Terminal(process)
    finally:
        await asyncio.to_thread(process.close, force=True)


@pytest.fixture
def far() -> SimulatedDrive:
    """A drive with time for keys to be pressed while its axis moves."""
    return SimulatedDrive(Knobs(baudrate=9600, nominal_speed=20.0), name="x")


def did(far: SimulatedDrive, kind: LogKind) -> list[str]:
    return [entry.text for entry in far.log if entry.kind is kind]


async def until(condition: Callable[[], Any]) -> None:
    async with asyncio.timeout(_SOON_S):
        while not condition():  # noqa: ASYNC110 - the far end has no event for it
            await asyncio.sleep(0.02)


async def test_completion_opens_while_one_types_and_messages_come_above_it(far: SimulatedDrive, tmp_path: Path) -> None:
    async with serve_pty(far) as url, shell(tmp_path, url, "--allow-motion") as terminal:
        await terminal.sees(BANNER)
        terminal.press("torq")
        await terminal.sees("S5", "motor torque")
        terminal.press(TAB + "\r")
        await terminal.sees("S005: ")
        await terminal.says("POSA 10$", "on its way to 10.00 units")
        terminal.press("S")
        await terminal.sees("$", "position reached", "reached", "10.00 units, by the message $")
        await terminal.says("1", "S001: 10.00")  # what was typed before is still there
        terminal.press(CTRL_D)
        assert await terminal.code() == 0
    assert (tmp_path / "compax" / "shell_history").read_text() == "S5\nPOSA 10$\nS1\n"


@pytest.mark.parametrize("key", [CTRL_C, CTRL_X])
async def test_a_key_stops_a_running_axis_and_the_talk_goes_on(key: str, far: SimulatedDrive, tmp_path: Path) -> None:
    async with serve_pty(far) as url, shell(tmp_path, url, "--no-history") as terminal:
        await terminal.sees(BANNER)
        await terminal.says("move 1000", "move 1000 can move the axis; nothing was sent")
        await terminal.says("yes", "on its way")
        await until(lambda: far.moving)
        terminal.press(f"S1{key}")
        await terminal.sees("the drive has acknowledged STOP and stands at")
        assert did(far, LogKind.MOTION_STOPPED)
        await terminal.says(f"{CTRL_U}S1", "S001: ")
        terminal.press(CTRL_D)
        assert await terminal.code() == 0
    assert not (tmp_path / "compax").exists()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
async def test_who_ends_the_program_stops_the_axis(number: int, far: SimulatedDrive, tmp_path: Path) -> None:
    async with serve_tcp(far) as url, shell(tmp_path, url, "--allow-motion") as terminal:
        await terminal.sees(BANNER)
        await terminal.says("PA1000", "it may be moving now")
        await until(lambda: far.moving)
        terminal.process.kill(number)
        await until(lambda: did(far, LogKind.MOTION_STOPPED))
        assert await terminal.code() == 128 + number


async def test_a_terminal_that_is_closed_stops_the_axis(far: SimulatedDrive, tmp_path: Path) -> None:
    async with serve_tcp(far) as url, shell(tmp_path, url, "--allow-motion") as terminal:
        await terminal.sees(BANNER)
        await terminal.says("move 1000", "on its way")
        await until(lambda: far.moving)
        terminal.process.ptyproc.fileobj.close()  # type: ignore[attr-defined]
        await until(lambda: did(far, LogKind.MOTION_STOPPED))


async def test_an_interrupt_signal_does_what_the_key_does(far: SimulatedDrive, tmp_path: Path) -> None:
    async with serve_tcp(far) as url, shell(tmp_path, url, "--allow-motion") as terminal:
        await terminal.sees(BANNER)
        await terminal.says("PA1000", "it may be moving now")
        await until(lambda: far.moving)
        terminal.process.kill(signal.SIGINT)
        await terminal.sees("the drive has acknowledged STOP and stands at")
        await terminal.says("exit")
        assert await terminal.code() == 0


async def test_a_cable_that_is_pulled_is_told_and_the_talk_goes_on_when_it_is_back(
    far: SimulatedDrive, tmp_path: Path
) -> None:
    async with AsyncExitStack() as stack:
        async with serve_tcp(far) as url:
            words = (url, "--poll-s", "0.2", "--allow-motion")
            terminal = await stack.enter_async_context(shell(tmp_path, *words))
            await terminal.sees(BANNER)
            await terminal.says("S1", "S001: ")
        await terminal.sees("LINE LOST")
        await terminal.says("PA5", "not sent: PA5; the line to the drive is lost")
        async with serve_tcp(far, port=int(url.rpartition(":")[2])):
            await terminal.sees("LINE BACK")
            await terminal.says("S2", "S002: ")
            terminal.press(CTRL_D)
            assert await terminal.code() == 0
    assert not did(far, LogKind.MOTION_STARTED)


async def test_a_usb_adapter_that_is_unplugged_is_told(far: SimulatedDrive, tmp_path: Path) -> None:
    async with AsyncExitStack() as stack:
        async with serve_pty(far) as url:
            terminal = await stack.enter_async_context(shell(tmp_path, url))
            await terminal.sees(BANNER)
            await terminal.says("S1", "S001: ")
        await terminal.sees("LINE LOST", "went away")
        terminal.press(CTRL_D)
        assert await terminal.code() == 0


# No talk at all -------------------------------------------------------------------------------------------------------


def quick(tmp_path: Path) -> tuple[str, str]:
    """Give the options that let silence be known soon."""
    path = tmp_path / "quick.toml"
    path.write_text("answer_timeout_s = 0.2\n")
    return "--settings", str(path)


async def test_the_wrong_port(tmp_path: Path) -> None:
    async with shell(tmp_path, "serial:///dev/no-such-port") as terminal:
        await terminal.sees("there is no serial port /dev/no-such-port")
        assert await terminal.code() == 3


async def test_the_wrong_baud_rate(far: SimulatedDrive, tmp_path: Path) -> None:
    async with (
        serve_pty(far) as url,
        shell(tmp_path, f"{url.partition('?')[0]}?baudrate=4800", *quick(tmp_path)) as terminal,
    ):
        await terminal.sees("baud rate")
        assert await terminal.code() == 4


async def test_a_drive_that_keeps_silent(far: SimulatedDrive, tmp_path: Path) -> None:
    async with serve_pty(far) as url:
        far.power_off()
        async with shell(tmp_path, url, *quick(tmp_path)) as terminal:
            await terminal.sees("check power, cable")
            assert await terminal.code() == 4


# Nobody at the terminal -----------------------------------------------------------------------------------------------


async def test_lines_come_through_a_pipe_and_ctrl_c_stops_what_they_move(far: SimulatedDrive, tmp_path: Path) -> None:
    async with serve_tcp(far) as url:
        process = await asyncio.create_subprocess_exec(
            sys.executable,
            "-m",
            "compax_aio.cli",
            "shell",
            url,
            "--allow-motion",
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
        )
        assert process.stdin is not None
        process.stdin.write(b"S1\nmove 1000\nS1\n")
        await process.stdin.drain()
        await until(lambda: far.moving)
        process.send_signal(signal.SIGINT)
        async with asyncio.timeout(_SOON_S):
            out, err = await process.communicate()
    assert out.decode().startswith("S001: 0.00")
    assert b"Stopped" in err
    assert process.returncode == 130
    assert did(far, LogKind.MOTION_STOPPED)
