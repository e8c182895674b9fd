"""The demonstration does what it says: three axes, three kinds of line, every motion confirmed."""

from __future__ import annotations

import asyncio
import io

import pytest
from rich.console import Console, Group

import compax_aio
from compax_aio.cli import demo


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
