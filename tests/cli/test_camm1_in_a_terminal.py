"""`compax camm1` in a real terminal, against a simulated cutter on a real pseudo-terminal or TCP port."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import pytest
from tests.fakes.terminal import LIMIT_S, Terminal

from compax_aio.simulator.camm1 import Knobs, LogKind, SimulatedCutter
from compax_aio.simulator.server import serve_pty, serve_tcp

pytestmark = pytest.mark.real_time


@pytest.fixture
async def open_terminal() -> AsyncIterator[Callable[..., Terminal]]:
    terminals: list[Terminal] = []

    def open_one(*words: str) -> Terminal:
        terminals.append(Terminal("camm1", *words))
        return terminals[-1]

    yield open_one
    for each in terminals:
        each.child.close(force=True)


@pytest.fixture
def job(tmp_path: Path) -> str:
    """A job that takes minutes."""
    path = tmp_path / "long.plt"
    path.write_text("IN;VS1;PU0,0;" + "".join(f"PD{x % 900},{x % 70};" for x in range(0, 370_000, 37)) + "PU0,0;")
    return str(path)


@pytest.fixture
def short_job(tmp_path: Path) -> str:
    path = tmp_path / "short.plt"
    path.write_text("IN;VS20;PU0,0;PD40,0,40,40,0,40,0,0;PU0,0;")
    return str(path)


@pytest.fixture
async def cutter() -> SimulatedCutter:
    return SimulatedCutter(Knobs(baudrate=9600))


@pytest.fixture
async def url(cutter: SimulatedCutter) -> AsyncIterator[str]:
    async with serve_pty(cutter) as url:
        yield url


async def until(condition: Callable[[], Any]) -> None:
    async with asyncio.timeout(LIMIT_S):
        while not condition():  # noqa: ASYNC110 - the cutter sets no event
            await asyncio.sleep(0.01)


Open = Callable[..., Terminal]


async def test_a_job_is_shown_asked_about_and_cut(
    open_terminal: Open, url: str, cutter: SimulatedCutter, short_job: str
) -> None:
    terminal = open_terminal("cut", url, short_job)
    await terminal.sees("1.00 by 1.00 mm")
    await terminal.sees("[y/N]")
    assert not cutter.cuttings.cut
    terminal.types("y\r")
    code, told = await terminal.ends()
    assert code == 0
    assert "short.plt: cut in" in told
    assert len(cutter.cuttings.cut) == 4


async def test_a_no_sends_nothing(open_terminal: Open, url: str, cutter: SimulatedCutter, short_job: str) -> None:
    terminal = open_terminal("cut", url, short_job)
    await terminal.sees("[y/N]")
    terminal.types("n\r")
    code, told = await terminal.ends()
    assert code == 1
    assert "Nothing was sent." in told
    assert not cutter.log.texts(LogKind.CONTROL)


async def test_a_bar_shows_how_far_it_is_and_ctrl_c_aborts(
    open_terminal: Open, url: str, cutter: SimulatedCutter, job: str
) -> None:
    terminal = open_terminal("cut", url, job, "--yes", "--name", "table")
    await terminal.sees("p pauses")
    await terminal.sees("% full")
    await until(lambda: len(cutter.cuttings.cut) > 3)
    terminal.types("\x03")
    await terminal.sees("Stopping table")
    code, told = await terminal.ends()
    assert code == 130
    assert "Interrupted. long.plt: the job was aborted" in told
    assert "What is known: sent are" in told
    assert not cutter.stored_bytes
    await until(lambda: not cutter.position()[2])


async def test_p_pauses_and_goes_on(open_terminal: Open, url: str, cutter: SimulatedCutter, job: str) -> None:
    terminal = open_terminal("cut", url, job, "--yes")
    await terminal.sees("p pauses")
    await until(lambda: len(cutter.cuttings.cut) > 3)
    terminal.types("p")
    await terminal.sees("paused from here")
    terminal.types("p")
    await terminal.sees("cutting")
    terminal.types("\x03")
    assert (await terminal.ends())[0] == 130


async def test_a_pause_at_the_panel_is_shown(open_terminal: Open, url: str, cutter: SimulatedCutter, job: str) -> None:
    terminal = open_terminal("cut", url, job, "--yes")
    await until(lambda: len(cutter.cuttings.cut) > 3)
    cutter.press_pause()
    await terminal.sees("paused at the panel")
    cutter.press_pause()
    await terminal.sees("cutting")
    terminal.types("\x03")
    assert (await terminal.ends())[0] == 130


async def test_a_terminal_that_is_closed_aborts_the_job(
    open_terminal: Open, url: str, cutter: SimulatedCutter, job: str
) -> None:
    terminal = open_terminal("cut", url, job, "--yes")
    await until(lambda: len(cutter.cuttings.cut) > 3)
    terminal.is_shut()
    await until(lambda: any(text.startswith("K ") for text in cutter.log.texts(LogKind.CLEARED)))
    await asyncio.to_thread(terminal.child.wait)
    assert not cutter.stored_bytes


async def test_a_question_can_be_interrupted(open_terminal: Open, url: str, short_job: str) -> None:
    terminal = open_terminal("cut", url, short_job)
    await terminal.sees("[y/N]")
    terminal.types("\x03")
    code, told = await terminal.ends()
    assert code == 130
    assert "Interrupted." in told


async def test_an_unplugged_cable_leaves_a_doubt_that_is_told(
    open_terminal: Open, cutter: SimulatedCutter, job: str
) -> None:
    async with serve_tcp(cutter) as url:
        terminal = open_terminal("cut", url, job, "--yes", "--baud-rate", "9600")
        await until(lambda: len(cutter.cuttings.cut) > 3)
    code, told = await terminal.ends()
    assert code == 8
    assert "what was cut is not known: the line was lost" in told
    assert "look at the sheet before you cut anew" in told


async def test_a_wrong_port_is_told(open_terminal: Open, short_job: str) -> None:
    code, told = await open_terminal("cut", "serial:///dev/ttyNoSuchPort", short_job, "--yes").ends()
    assert code == 3
    assert "TransportError" in told
    assert "ttyNoSuchPort" in told


async def test_a_wrong_baud_rate_is_told(open_terminal: Open, url: str) -> None:
    wrong = url.partition("?")[0] + "?baudrate=4800"
    code, told = await open_terminal("info", wrong, "--answer-timeout", "0.3").ends()
    assert code in {4, 6}
    assert "baud rate" in told


async def test_a_silent_cutter_is_told(open_terminal: Open, url: str, cutter: SimulatedCutter, short_job: str) -> None:
    cutter.power_off()
    code, told = await open_terminal("cut", url, short_job, "--yes", "--answer-timeout", "0.3").ends()
    assert code == 4
    assert "check power, cable" in told


async def test_a_line_that_somebody_else_holds_is_told(open_terminal: Open, url: str, job: str) -> None:
    first = open_terminal("cut", url, job, "--yes")
    await first.sees("% full")
    code, told = await open_terminal("stop", url).ends()
    assert code == 3
    assert "in use" in told
    first.types("\x03")
    assert (await first.ends())[0] == 130
