"""What is seen of a transfer, and of a control that is watched, at a terminal."""

from __future__ import annotations

import asyncio
import io
import logging
import re
import signal
import sys
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta
from typing import Any

import pytest

from compax_aio import AnswerTimeoutError, InvalidCommandError
from compax_aio.cli.exchanging import operator
from compax_aio.cli.exchanging.asking import meaning_of, request_of, value_as_json, value_in_words
from compax_aio.cli.exchanging.view import TransferView, written_time
from compax_aio.cli.exchanging.watching import Display, follow_events
from compax_aio.cli.printing import Printing
from compax_aio.haas.answers import Request, decode
from compax_aio.haas.events import ConnectionLost, ConnectionRestored, DriveEvent, Overheard, Printed, ReaderOn
from compax_aio.haas.profiles import CLASSIC, CLASSIC_XMODEM, Profile
from compax_aio.haas.transfer import TransferPhase, TransferProgress
from compax_aio.haas.watching import Reading


class _Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


Opener = Callable[[str], _Terminal]


@pytest.fixture
def open_terminal(monkeypatch: pytest.MonkeyPatch) -> Opener:
    """Let what is written on a stream from now on go to a terminal; before the test pytest would undo that."""

    def open_one(stream: str = "stderr") -> _Terminal:
        terminal = _Terminal()
        monkeypatch.setattr(sys, stream, terminal)
        monkeypatch.setenv("TERM", "xterm")
        monkeypatch.setenv("COLUMNS", "120")
        monkeypatch.setenv("NO_COLOR", "1")
        return terminal

    return open_one


def progress(phase: TransferPhase = "under way", count: int = 300, **more: Any) -> TransferProgress:
    told: dict[str, Any] = {
        "total_bytes": 1000,
        "blocks": 0,
        "lines": 30,
        "held_s": 0.0,
        "operator": None,
        "elapsed_s": 65.0,
    }
    return TransferProgress(phase=phase, bytes=count, **{**told, **more})


def seen(terminal: _Terminal) -> str:
    return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", terminal.getvalue())


# A transfer ---------------------------------------------------------------------------------------------------------


async def test_figures_are_shown(open_terminal: Opener) -> None:
    terminal = open_terminal("stderr")
    with TransferView("job.nc", Printing()) as view:
        view.show(progress(count=300))
        await asyncio.sleep(1)
        view.show(progress("held", count=500, held_s=2.0, blocks=4))
    for each in (
        "job.nc",
        " 30 %",
        " 50 %",
        "the control holds the line",
        "500 of 1,000 bytes, 30 lines, 4 blocks, 200 bytes/s, held for 2.0 s in all",
    ):
        assert each in seen(terminal)
    assert view.took_s == 1.0


async def test_what_nobody_knows_is_not_shown(open_terminal: Opener) -> None:
    terminal = open_terminal("stderr")
    with TransferView("job.nc", Printing()) as view:
        view.show(progress(total_bytes=None))
    shown = seen(terminal)
    assert "300 bytes, 30 lines" in shown
    for each in ("%", " of ", "bytes/s", "held"):
        assert each not in shown


async def test_it_is_shown_what_somebody_has_to_do_and_for_how_long_it_is_waited(open_terminal: Opener) -> None:
    terminal = open_terminal("stderr")
    with TransferView("job.nc", Printing()) as view:
        view.ask("; then press Enter here")
        async with view.ticking():
            view.show(progress("waiting for operator", 0, operator="press RECV", elapsed_s=2.0))
            await asyncio.sleep(70)
    shown = seen(terminal)
    assert "job.nc: press RECV; then press Enter here" in shown
    assert "waiting, 2.0 s; Ctrl-C gives up" in shown
    assert "waiting, 1:1" in shown


async def test_the_rate_is_that_of_the_last_seconds(open_terminal: Opener) -> None:
    terminal = open_terminal("stderr")
    with TransferView("job.nc", Printing()) as view:
        async with view.ticking():
            for count in range(10, 1000, 10):
                view.show(progress(count=count))
                await asyncio.sleep(0.1)
            assert "100 bytes/s" in seen(terminal)
            await asyncio.sleep(20)
    assert seen(terminal).rindex(" 0 bytes/s") > seen(terminal).rindex("100 bytes/s")


async def test_before_anything_goes_there_is_no_rate(open_terminal: Opener) -> None:
    terminal = open_terminal("stderr")
    with TransferView("job.nc", Printing()) as view:
        view.show(progress("starting", 0))
        await asyncio.sleep(5)
        view.show(progress("under way", 0))
    assert "bytes/s" not in seen(terminal)


async def test_a_second_look_is_not_counted(open_terminal: Opener) -> None:
    open_terminal("stderr")
    with TransferView("job.nc", Printing()) as view:
        view.show(progress(count=100))
        await asyncio.sleep(2)
        view.show(progress(count=1000))
        await asyncio.sleep(5)
        view.show(progress("verifying", count=0))
        await asyncio.sleep(5)
        view.show(progress("verifying", count=900))
    assert view.took_s == 2.0


async def test_pictures_are_few_unless_there_is_news(open_terminal: Opener) -> None:
    terminal = open_terminal("stderr")
    with TransferView("job.nc", Printing()) as view:
        view.show(progress(count=300))
        view.show(progress(count=400))
        view.show(progress("ending", count=500))
    assert "400 of 1,000 bytes" not in seen(terminal)
    assert "500 of 1,000 bytes" in seen(terminal)


async def test_warnings_are_told_above_the_picture_and_elsewhere_afterwards(open_terminal: Opener) -> None:
    terminal = open_terminal("stderr")
    logger = logging.getLogger("compax_aio")
    before = list(logger.handlers)
    with TransferView("job.nc", Printing()) as view:
        view.show(progress())
        logger.warning("the disk is %s", "full")
        assert logger.handlers != before
        view.clear()
        view.clear()
    assert "warning: the disk is full" in seen(terminal)
    assert logger.handlers == before


async def test_without_a_terminal_each_thing_that_happens_is_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    with TransferView("job.nc", Printing()) as view:
        view.show(progress("starting"))
        view.show(progress("waiting for operator", operator="press RECV"))
        view.show(progress("waiting for operator", operator="press RECV"))
        for phase in ("under way", "held", "under way", "ending", "verifying", "over"):
            view.show(progress(phase))
    assert [line.removeprefix("job.nc: ") for line in capsys.readouterr().err.splitlines()] == [
        "press RECV",
        "on its way",
        "all of it is over; waiting for the end",
        "once more, to be compared",
    ]


async def test_programs_are_told_what_somebody_has_to_do_and_nothing_else(
    open_terminal: Opener, capsys: pytest.CaptureFixture[str]
) -> None:
    terminal = open_terminal("stderr")
    with TransferView("job.nc", Printing(json=True)) as view:
        view.show(progress("waiting for operator", operator="press RECV"))
        view.show(progress())
    assert terminal.getvalue() == ""
    assert capsys.readouterr().out == '{"transfer": "job.nc", "operator": "press RECV"}\n'


@pytest.mark.parametrize(("seconds", "text"), [(0.0, "0.0 s"), (59.94, "59.9 s"), (187.0, "3:07 min")])
def test_times_are_written_for_people(seconds: float, text: str) -> None:
    assert written_time(seconds) == text


# What is watched ----------------------------------------------------------------------------------------------------


def reading(values: dict[str | int, Any], errors: dict[str | int, Any] | None = None) -> Reading:
    return Reading("mill", 0.0, values, errors or {})


async def test_readings_are_shown_in_place_with_their_age_and_the_last_news(open_terminal: Opener) -> None:
    terminal = open_terminal("stdout")
    with Display([request_of("Q104"), request_of("3027")], Printing()) as display:
        assert "waiting for the first reading" in seen(terminal)
        ageing = asyncio.create_task(display.grow_old())
        display.show(reading({"Q104": "MEM"}, {3027: AnswerTimeoutError("no answer")}))
        await asyncio.sleep(7.5)
        for number in range(7):
            display.tell("printed", f"PART {number}")
        logging.getLogger("compax_aio").warning("the line was lost")
        display.tell("connection_lost", "the line was lost, and is tried again")
        ageing.cancel()
    shown = seen(terminal)
    assert re.search(r"Q104 +mode +MEM", shown)
    assert re.search(r"3027 +spindle speed in rpm +not said: no answer", shown)
    assert "said 7 s ago; Ctrl-C ends this" in shown
    last = shown[shown.rindex("Q104") :]
    assert "PART 2" not in last
    assert "PART 6" in last
    assert last.count("the line was lost") == 1


class _Happening:
    """A control of which nothing is asked but what happens."""

    async def events(self) -> AsyncIterator[DriveEvent]:
        yield Printed("mill", 0.0, "PART 1", is_damaged=True)
        yield Overheard("mill", 0.0, "S/N, 7")
        yield ConnectionLost("mill", 0.0, "the port went away; was it unplugged? a drive may move")
        yield ConnectionRestored("mill", 0.0, 5.5, 2, ())
        yield ReaderOn("mill", 0.0)


async def test_what_happens_meanwhile_is_told() -> None:
    told: list[tuple[str, str]] = []
    await follow_events(_Happening(), lambda event, text: told.append((event, text)))  # type: ignore[arg-type]
    assert told == [
        ("printed", "PART 1 (damaged)"),
        ("overheard", "S/N, 7"),
        ("connection_lost", "the line was lost, and is tried again: the port went away"),
        ("connection_restored", "the line is back after 5.5 s"),
    ]


# What is asked ------------------------------------------------------------------------------------------------------


def test_answers_are_values_for_programs_and_words_for_people() -> None:
    busy = decode(Request.of("Q104"), "STATUS, BUSY")
    other = decode(Request.of("Q999"), "SOMETHING, 1, 2")
    assert (value_as_json(busy), value_in_words(busy)) == ({"busy": True}, "busy: a cycle runs")
    assert (value_as_json(other), value_in_words(other)) == (["SOMETHING", "1", "2"], "SOMETHING, 1, 2")
    assert value_in_words(timedelta(hours=6282, minutes=17, seconds=13)) == "6282:17:13 h"
    assert meaning_of(request_of("Q999")) == "not known here"


# Who presses Enter --------------------------------------------------------------------------------------------------


@pytest.fixture
def keys(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Callable[[str], None], Callable[[], None]]]:
    """Sit at a terminal; gives what takes a key, and what is called when the terminal is gone."""
    heard: list[tuple[Callable[[str], None], Callable[[], None]]] = []

    @contextmanager
    def keys_pressed(on_key: Callable[[str], None], on_end: Callable[[], None]) -> Iterator[None]:
        heard.append((on_key, on_end))
        yield
        heard.clear()

    monkeypatch.setattr(operator, "keys_pressed", keys_pressed)
    monkeypatch.setattr(sys, "stdin", _Terminal())
    return heard


Keys = list[tuple[Callable[[str], None], Callable[[], None]]]


async def test_enter_alone_says_that_recv_is_pressed(open_terminal: Opener, keys: Keys) -> None:
    terminal = open_terminal("stderr")
    somebody = operator.Operator(CLASSIC, Printing(), sends=True)
    with TransferView("job.nc", Printing()) as view:
        view.show(progress("waiting for operator", 0, operator="press RECV"))
        asked = somebody.ask(view)
        assert asked is not None
        waiting = asyncio.ensure_future(asked)
        await asyncio.sleep(0)
        assert "press RECV; then press Enter here" in seen(terminal)
        ((on_key, _),) = keys
        on_key("x")
        await asyncio.sleep(1)
        assert not waiting.done()
        on_key("c-m")
        on_key("c-m")
        await waiting
        assert keys == []
        assert somebody.ask(view) is None  # what is read back begins by itself


async def test_ctrl_c_and_a_terminal_that_is_gone_are_what_they_always_are(
    open_terminal: Opener, keys: Keys, monkeypatch: pytest.MonkeyPatch
) -> None:
    open_terminal("stderr")
    raised: list[int] = []
    monkeypatch.setattr(signal, "raise_signal", raised.append)
    somebody = operator.Operator(CLASSIC, Printing(), sends=True)
    with TransferView("job.nc", Printing()) as view:
        asked = somebody.ask(view)
        assert asked is not None
        waiting = asyncio.ensure_future(asked)
        await asyncio.sleep(0)
        ((on_key, on_end),) = keys
        on_key("interrupt")
        on_end()
        waiting.cancel()
    assert raised == [signal.SIGINT, signal.SIGHUP]


@pytest.mark.parametrize(
    ("profile", "options"), [(CLASSIC_XMODEM, {}), (CLASSIC, {"is_ready": True}), (CLASSIC, {"sends": False})]
)
async def test_nobody_is_asked_where_that_is_known(
    profile: Profile, options: dict[str, Any], keys: Keys, open_terminal: Opener
) -> None:
    open_terminal("stderr")
    somebody = operator.Operator(profile, Printing(), **{"sends": True, **options})
    with TransferView("job.nc", Printing()) as view:
        assert somebody.ask(view) is None


def test_programs_cannot_be_asked(keys: Keys, open_terminal: Opener) -> None:
    open_terminal("stderr")
    with pytest.raises(InvalidCommandError, match="--ready"):
        operator.Operator(CLASSIC, Printing(json=True), sends=True)
