"""The demonstration does what it says: three axes, three kinds of line, every motion confirmed."""

from __future__ import annotations

import asyncio
import io
import json
import signal
from collections.abc import Coroutine
from typing import Any

import pytest
from rich.console import Console, Group

import compax_aio
from compax_aio.cli import app, demo
from compax_aio.simulator.clock import VirtualClockLoop


def printed(thing: object) -> str:
    console = Console(file=io.StringIO(), width=100)
    console.print(thing)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


@pytest.fixture
def bytes_take_no_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """A byte that takes a millisecond on a real pty costs two milliseconds of real silence in virtual time."""
    monkeypatch.setattr(demo, "_BAUDRATE", 0)


@pytest.mark.usefixtures("bytes_take_no_time")
async def test_every_motion_of_the_demonstration_is_confirmed() -> None:
    console = Console(file=io.StringIO(), width=100)
    frames: list[str] = []

    def on_frame(screen: Group) -> None:
        frames.append(printed(screen))

    table = printed(await demo.run(console, on_frame))
    assert table.count("status") == 9  # whether a move that is prepared takes "$" is not documented
    for target in ("240.00 mm", "155.50 mm", "-60.00 mm", "80.00 mm", "10.25 mm"):
        assert table.count(target) == 2, f"{target} is both target and reached"
    assert any("on its way" in frame for frame in frames)
    assert "serial:///" in console.file.getvalue()  # type: ignore[attr-defined]
    assert "tcp://127.0.0.1:" in console.file.getvalue()  # type: ignore[attr-defined]


@pytest.mark.usefixtures("bytes_take_no_time")
async def test_the_demonstration_leaves_nothing_behind_when_it_is_cancelled() -> None:
    task = asyncio.ensure_future(demo.run(Console(file=io.StringIO())))
    await asyncio.sleep(2)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    assert asyncio.all_tasks() == {asyncio.current_task()}


@pytest.fixture
def time_is_virtual(monkeypatch: pytest.MonkeyPatch) -> None:
    def run(coroutine: Coroutine[Any, Any, Any]) -> Any:
        with asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
            return runner.run(coroutine)

    monkeypatch.setattr(asyncio, "run", run)


@pytest.mark.usefixtures("bytes_take_no_time", "time_is_virtual")
def test_the_command_prints_what_each_drive_confirmed(capsys: pytest.CaptureFixture[str]) -> None:
    assert app.run(["demo"]) == 0
    _, title, table = capsys.readouterr().out.partition("What the drives confirmed")
    assert title
    assert table.count("status") == 9


@pytest.mark.usefixtures("bytes_take_no_time", "time_is_virtual")
def test_the_command_prints_one_document_for_programs(capsys: pytest.CaptureFixture[str]) -> None:
    assert app.run(["demo", "--json"]) == 0
    (line,) = capsys.readouterr().out.splitlines()
    confirmed = json.loads(line)
    assert [(each["axis"], each["motion"], each["target"]) for each in confirmed[:4]] == [
        ("x", "home", None),
        ("y", "home", None),
        ("z", "home", None),
        ("x", "move", 240.0),
    ]
    assert all(each["reached"] == (each["target"] or 0.0) for each in confirmed)


@pytest.mark.usefixtures("bytes_take_no_time")
def test_a_command_that_is_interrupted_says_that_every_drive_was_stopped(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def run_and_interrupt(coroutine: Coroutine[Any, Any, Any]) -> Any:
        async def interrupted() -> Any:
            asyncio.get_running_loop().call_later(2, signal.raise_signal, signal.SIGINT)
            return await coroutine

        with asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
            return runner.run(interrupted())

    monkeypatch.setattr(asyncio, "run", run_and_interrupt)
    assert app.run(["demo"]) == 130
    assert "STOP went to every drive that moved" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("error", "code", "says"),
    [
        (KeyboardInterrupt(), 130, "STOP"),
        (compax_aio.TransportError("the port is in use", hint="end the other program"), 1, "in use; end the other"),
    ],
)
def test_trouble_is_told_without_a_traceback(
    error: BaseException, code: int, says: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    async def run(console: Console) -> None:
        raise error

    monkeypatch.setattr(demo, "run", run)
    assert demo.main() == code
    out = capsys.readouterr().out
    assert says in " ".join(out.split())
    assert "Traceback" not in out


def test_a_demonstration_that_ends_well_prints_its_table(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    async def run(console: Console) -> str:
        return "the table"

    monkeypatch.setattr(demo, "run", run)
    assert demo.main() == 0
    assert "the table" in capsys.readouterr().out
