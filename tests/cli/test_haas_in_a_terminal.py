"""`compax haas` in a real terminal, against a simulated control on a real pseudo-terminal or TCP port."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import pytest
from tests.fakes.terminal import LIMIT_S, Terminal

from compax_aio.simulator.haas import Knobs, LogKind, SimulatedControl
from compax_aio.simulator.server import serve_pty, serve_tcp

pytestmark = pytest.mark.real_time

Open = Callable[..., Terminal]


@pytest.fixture
async def open_terminal() -> AsyncIterator[Open]:
    terminals: list[Terminal] = []

    def open_one(*words: str) -> Terminal:
        terminals.append(Terminal("haas", *words))
        return terminals[-1]

    yield open_one
    for each in terminals:
        each.child.close(force=True)


@pytest.fixture
def program(tmp_path: Path) -> Path:
    path = tmp_path / "short.nc"
    path.write_text("%\nO00077 (NEW)\nG0 X1.\nM30\n%\n")
    return path


@pytest.fixture
def long_program(tmp_path: Path) -> Path:
    """A program that takes minutes."""
    path = tmp_path / "long.nc"
    path.write_text("%\nO00077\n" + "G1 X1.5 Y2.5\n" * 20_000 + "M30\n%\n")
    return path


@pytest.fixture
async def control() -> SimulatedControl:
    return SimulatedControl(Knobs(baudrate=9600, program_blocks=20_000))


@pytest.fixture
async def url(control: SimulatedControl) -> AsyncIterator[str]:
    async with serve_pty(control) as url:
        yield url


async def until(condition: Callable[[], Any]) -> None:
    async with asyncio.timeout(LIMIT_S):
        while not condition():  # noqa: ASYNC110 - the control sets no event
            await asyncio.sleep(0.01)


async def test_enter_says_that_recv_is_pressed(
    open_terminal: Open, url: str, control: SimulatedControl, program: Path
) -> None:
    terminal = open_terminal("send", url, str(program))
    await terminal.sees("press RECV; then press Enter here")
    assert control.received_bytes == 0
    terminal.types("x")
    control.press_recv()
    terminal.types("\r")
    code, told = await terminal.ends()
    assert code == 0
    assert "proved: left the line" in told
    assert control.memory.programs["O00077"].startswith("O00077")
    assert control.screen == "RS232 DONE"


async def test_ctrl_c_where_somebody_is_asked_sends_nothing(
    open_terminal: Open, url: str, control: SimulatedControl, program: Path
) -> None:
    terminal = open_terminal("send", url, str(program))
    await terminal.sees("press Enter here")
    terminal.types("\x03")
    code, told = await terminal.ends()
    assert code == 130
    assert "nothing of the file was sent" in told
    assert control.received_bytes == 0


async def test_ctrl_c_in_the_middle_sends_no_more(
    open_terminal: Open, url: str, control: SimulatedControl, long_program: Path
) -> None:
    terminal = open_terminal("send", url, str(long_program))
    await terminal.sees("press Enter here")
    control.press_recv()
    terminal.types("\r")
    await terminal.sees("bytes/s")
    terminal.types("\x03")
    code, told = await terminal.ends()
    assert code == 130
    assert "Interrupted. " in told
    assert "bytes have left" in told
    assert "press RESET there" in told
    count = control.received_bytes
    await asyncio.sleep(0.2)
    assert 0 < control.received_bytes == count < 20_000


async def test_a_terminal_that_is_shut_ends_a_transfer(
    open_terminal: Open, url: str, control: SimulatedControl, tmp_path: Path
) -> None:
    terminal = open_terminal("receive", url, "program", "-o", str(tmp_path / "ten.nc"))
    await terminal.sees("press SEND")
    control.press_send("O00010")
    await terminal.sees("bytes/s")
    terminal.is_shut()
    await until(lambda: not terminal.child.isalive())
    assert (tmp_path / "ten.nc.incomplete").stat().st_size > 0
    assert not (tmp_path / "ten.nc").exists()


async def test_parameters_are_sent_when_the_word_is_typed(open_terminal: Open, tmp_path: Path) -> None:
    path = tmp_path / "parameters.txt"
    path.write_text("%\nN0 V1\nN1 V5\n%\n")
    control = SimulatedControl(Knobs(profile="dc codes", baudrate=9600))
    words = (str(path), "--profile", "classic-dc-codes", "--i-know-parameters-take-effect")
    async with serve_tcp(control) as url:
        for typed, code in (("yes\r", 1), ("PARAMETERS\r", 0)):
            terminal = open_terminal("send", url, *words)
            await terminal.sees("type PARAMETERS:")
            terminal.types(typed)
            if not code:
                await terminal.sees("press RECV")
                await until(lambda: control.log.texts(LogKind.CONNECTED))
                control.press_recv("parameters")
            assert (await terminal.ends())[0] == code
            assert (control.memory.parameters[1] == "5") is (code == 0)


async def test_a_drip_feed_is_asked_about(open_terminal: Open, program: Path) -> None:
    control = SimulatedControl(Knobs(profile="dc codes", baudrate=9600))
    async with serve_tcp(control) as url:
        for typed, code in (("\r", 1), ("y\r", 0)):
            terminal = open_terminal("send", url, str(program), "--dnc", "--profile", "classic-dc-codes")
            await terminal.sees("Is it set up, and clear? [y/N]")
            terminal.types(typed)
            if not code:
                await terminal.sees("press MDI/DNC twice")
                await until(lambda: control.log.texts(LogKind.CONNECTED))
                control.press_dnc()
            assert (await terminal.ends())[0] == code


async def test_a_control_is_watched_until_ctrl_c(open_terminal: Open, url: str, control: SimulatedControl) -> None:
    terminal = open_terminal("watch", url, "Q500", "3027")
    await terminal.sees("O00010, IDLE, 42 parts")
    control.cycle_start()
    await terminal.sees("busy: a cycle runs")
    control.dprnt("PART*1")
    await terminal.sees("PART 1")
    terminal.types("\x03")
    code, told = await terminal.ends()
    assert code == 130
    assert "Watched no longer." in told
