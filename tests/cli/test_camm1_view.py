"""What is seen of a cut at a terminal, and what its keys do."""

from __future__ import annotations

import asyncio
import io
import os
import re
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from compax_aio import ConnectionLostError
from compax_aio.camm1.cut import CutProgress, CutState
from compax_aio.cli.cutting import keys
from compax_aio.cli.cutting.keys import pause_key
from compax_aio.cli.cutting.view import CutView
from compax_aio.cli.printing import Printing


class _Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


Opener = Callable[[], _Terminal]


@pytest.fixture
def open_terminal(monkeypatch: pytest.MonkeyPatch) -> Opener:
    """Let what is written on the error stream from now on go to a terminal; before the test pytest would undo that."""

    def open_one() -> _Terminal:
        stream = _Terminal()
        monkeypatch.setattr(sys, "stderr", stream)
        monkeypatch.setenv("TERM", "xterm")
        monkeypatch.setenv("COLUMNS", "120")
        monkeypatch.setenv("NO_COLOR", "1")
        return stream

    return open_one


def progress(state: CutState = "cutting", sent: int = 300, total: int | None = 1000, **more: Any) -> CutProgress:
    told: dict[str, Any] = {
        "instructions_sent": 30,
        "instructions_total": 100,
        "position_steps": (400.0, 800.0),
        "free_bytes": 256,
        "elapsed_s": 5.0,
    }
    return CutProgress(state=state, bytes_sent=sent, bytes_total=total, **{**told, **more})


# The view -----------------------------------------------------------------------------------------------------------


async def test_figures_are_shown(open_terminal: Opener) -> None:
    terminal = open_terminal()
    with CutView("job.plt", 0.025, Printing()) as view:
        view.has_keys = True
        view.show(progress(free_bytes=1024))
        await asyncio.sleep(1)
        view.show(progress("buffer full", sent=500))
    shown = terminal.getvalue()
    for each in (
        "job.plt",
        " 30 %",
        " 50 %",
        "cutting, the buffer is full",
        "p pauses",
        "500 of 1,000 bytes, 30 of 100 instructions, to (10.00, 20.00) mm, buffer 75 % full",
    ):
        assert each in shown


async def test_what_nobody_knows_is_not_shown(open_terminal: Opener) -> None:
    terminal = open_terminal()
    with CutView("job.plt", 0.025, Printing()) as view:
        view.show(progress(total=None, instructions_total=None, free_bytes=None))
    shown = terminal.getvalue()
    assert "300 bytes, 30 instructions, to (10.00, 20.00) mm" in shown
    for each in ("%", " of ", "full", "p pauses"):
        assert each not in shown


async def test_time_goes_on_where_nothing_else_happens(open_terminal: Opener) -> None:
    terminal = open_terminal()
    with CutView("job.plt", 0.025, Printing()) as view:
        async with view.ticking():
            view.show(progress("operator pause"))
            await asyncio.sleep(30)
    shown = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", terminal.getvalue())
    assert "paused at the panel 5.0 s" in shown
    assert "paused at the panel 34.5 s" in shown


async def test_pictures_are_few_unless_there_is_news(open_terminal: Opener) -> None:
    terminal = open_terminal()
    with CutView("job.plt", 0.025, Printing()) as view:
        view.show(progress(sent=300))
        view.show(progress(sent=400))
        view.show(progress("finishing", sent=500))
    shown = terminal.getvalue()
    assert "400 of 1,000 bytes" not in shown
    assert "500 of 1,000 bytes" in shown


async def test_after_it_was_cleared_nothing_is_shown(open_terminal: Opener) -> None:
    terminal = open_terminal()
    with CutView("job.plt", 0.025, Printing()) as view:
        view.show(progress())
        view.clear()
        before = terminal.getvalue()
        async with view.ticking():
            await asyncio.sleep(3)
        assert terminal.getvalue() == before


async def test_without_a_terminal_each_thing_that_happens_is_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    with CutView("job.plt", 0.025, Printing()) as view:
        states: tuple[CutState, ...] = ("starting", "cutting", "buffer full", "cutting", "operator pause", "cutting")
        for state in (*states, "finishing", "over"):
            view.show(progress(state))
    assert [line.removeprefix("job.plt: ") for line in capsys.readouterr().err.splitlines()] == [
        "cutting",
        "paused at the panel",
        "cutting",
        "all is sent; waiting until it is cut",
    ]


async def test_programs_are_spared_all_of_it(open_terminal: Opener) -> None:
    terminal = open_terminal()
    with CutView("job.plt", 0.025, Printing(json=True)) as view:
        view.show(progress())
    assert terminal.getvalue() == ""


# The key ------------------------------------------------------------------------------------------------------------


class _Cut:
    def __init__(self, *, fails: bool = False) -> None:
        self.done: list[str] = []
        self._fails = fails

    async def pause(self) -> None:
        await asyncio.sleep(1)
        if self._fails:
            raise ConnectionLostError("the line was lost")
        self.done.append("pause")

    async def resume(self) -> None:
        self.done.append("resume")


@pytest.fixture
def pressed(monkeypatch: pytest.MonkeyPatch) -> list[Callable[..., None]]:
    """What is to be called with a key, and what where the terminal is gone."""
    heard: list[Callable[..., None]] = []

    @contextmanager
    def listening(on_key: Callable[[str], None], on_end: Callable[[], None]) -> Iterator[None]:
        heard[:] = [on_key, on_end]
        yield

    monkeypatch.setattr(keys, "keys_pressed", listening)
    monkeypatch.setattr(keys, "_has_terminal", lambda: True)
    return heard


def nothing() -> None:
    pass


async def test_p_pauses_and_goes_on(pressed: list[Callable[..., None]]) -> None:
    cut: Any = _Cut()
    with pause_key(cut, Printing(), wanted=True, before_interrupt=nothing) as is_heard:
        assert is_heard
        for key in ("p", "p", "x"):  # the second comes before it is paused
            pressed[0](key)
        await asyncio.sleep(2)
        pressed[0]("p")
        await asyncio.sleep(2)
    assert cut.done == ["pause", "resume"]


async def test_a_pause_that_fails_is_told(
    pressed: list[Callable[..., None]], capsys: pytest.CaptureFixture[str]
) -> None:
    cut: Any = _Cut(fails=True)
    with pause_key(cut, Printing(), wanted=True, before_interrupt=nothing):
        pressed[0]("p")
        await asyncio.sleep(2)
    assert "that was not done: the line was lost" in capsys.readouterr().err


async def test_ctrl_c_and_a_lost_terminal_are_signals(
    pressed: list[Callable[..., None]], monkeypatch: pytest.MonkeyPatch
) -> None:
    cut: Any = _Cut()
    raised: list[Any] = []
    monkeypatch.setattr(signal, "raise_signal", raised.append)
    with pause_key(cut, Printing(), wanted=True, before_interrupt=lambda: raised.append("first")):
        pressed[0]("interrupt")
        pressed[1]()
    assert raised == ["first", signal.SIGINT, signal.SIGHUP]


@pytest.mark.usefixtures("pressed")
async def test_keys_are_not_heard_where_that_makes_no_sense() -> None:
    cut: Any = _Cut()
    for printing, wanted in ((Printing(json=True), True), (Printing(), False)):
        with pause_key(cut, printing, wanted=wanted, before_interrupt=nothing) as is_heard:
            assert not is_heard


def test_a_program_in_the_background_asks_for_no_keys(monkeypatch: pytest.MonkeyPatch, open_terminal: Opener) -> None:
    open_terminal()
    assert not keys._has_terminal()  # the tests have none

    class Input(_Terminal):
        def fileno(self) -> int:
            return 0

    monkeypatch.setattr(sys, "stdin", Input())
    monkeypatch.setattr(os, "tcgetpgrp", lambda _: os.getpgrp())
    assert keys._has_terminal()
    monkeypatch.setattr(os, "tcgetpgrp", lambda _: os.getpgrp() + 1)
    assert not keys._has_terminal()

    def no_terminal(_: int) -> int:
        raise OSError

    monkeypatch.setattr(os, "tcgetpgrp", no_terminal)
    assert not keys._has_terminal()
