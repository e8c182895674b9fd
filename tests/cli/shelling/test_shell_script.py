"""Lines that nobody types: answered one after the other, up to the first that fails, with its exit code."""

from __future__ import annotations

import asyncio
import io
import json
import os
import threading
from collections.abc import Callable, Coroutine, Iterator
from pathlib import Path
from typing import Any

import pytest

from compax_aio import CommandRejectedError, Drive, UnexpectedAnswerError
from compax_aio.cli.app import run
from compax_aio.simulator.clock import VirtualClockLoop
from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive
from compax_aio.simulator.server import drive_named

URL = "sim://compax?name=x"


@pytest.fixture
def loop(monkeypatch: pytest.MonkeyPatch) -> Iterator[VirtualClockLoop]:
    """Let commands run on a virtual clock."""
    loop = VirtualClockLoop()

    def run_virtually(work: Coroutine[Any, Any, Any]) -> Any:
        with asyncio.Runner(loop_factory=lambda: loop) as runner:
            return runner.run(work)

    monkeypatch.setattr(asyncio, "run", run_virtually)
    yield loop
    loop.close()  # where a command was refused before it came to that


@pytest.fixture
def far(loop: VirtualClockLoop) -> SimulatedDrive:
    """Make the drive that the command will talk to, to look at its log after."""

    async def make() -> SimulatedDrive:
        return drive_named("x", Knobs(nominal_speed=10.0))

    return loop.run_until_complete(make())


@pytest.fixture
def stdin(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[bytes], None]]:
    """Give a function that puts text into a pipe that is standard input, and closes it."""
    pipes = []

    def give(data: bytes) -> None:
        reading, writing = os.pipe()

        def write() -> None:
            with os.fdopen(writing, "wb") as pipe:
                pipe.write(data)

        threading.Thread(target=write).start()
        pipes.append(io.TextIOWrapper(os.fdopen(reading, "rb")))
        monkeypatch.setattr("sys.stdin", pipes[0])

    yield give
    for pipe in pipes:
        pipe.close()


def did(far: SimulatedDrive, kind: LogKind) -> list[str]:
    return [entry.text for entry in far.log if entry.kind is kind]


def said(words: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    code = run(["shell", *words])
    captured = capsys.readouterr()
    return code, captured.out, " ".join(captured.err.split())


def test_lines_are_answered_with_what_they_mean(far: SimulatedDrive, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = said([URL, "-c", "S1", "-c", "# nothing", "-c", "", "-c", "S16"], capsys)
    assert code == 0
    assert out.splitlines() == [
        "S001: 0.00   actual position in units",
        "S016: 11010000   no_fault, no_warning, ready_for_start",
    ]
    assert not err


def test_programs_get_a_document_a_line(far: SimulatedDrive, capsys: pytest.CaptureFixture[str]) -> None:
    words = [URL, "--json", "--allow-motion"]
    for line in ("S16", "move 2", "status", "params 14 15", "stop", "help E55", "SD50", "error", "PR3$", "help"):
        words += ["-c", line]
    code, out, _ = said(words, capsys)
    assert code == 0
    documents = [json.loads(line) for line in out.splitlines()]
    assert [each["line"] for each in documents][:2] == ["S16", "move 2"]
    assert documents[0]["bits"]["no_fault"] is True
    assert documents[1]["reached"] == 2.0
    assert documents[2]["status"]["no_fault"] is True
    assert documents[3]["parameters"]["P14"]["value"] == 1.0
    assert documents[4]["stopped"] is True
    assert documents[5]["entries"][0]["meaning"] == "emergency stop"
    assert documents[7] == {"line": "error", "error": None}
    assert documents[8]["reached"] == 5.0


def test_standard_input_is_read_line_by_line(
    far: SimulatedDrive, stdin: Callable[[bytes], None], capsys: pytest.CaptureFixture[str]
) -> None:
    stdin(b"S1\nmove 3\nS1\nexit\nfoo\n")
    code, out, err = said([URL, "--allow-motion"], capsys)
    assert code == 0
    assert out.splitlines()[1].startswith("reached  3.00 units, by the message $")
    assert out.splitlines()[2].startswith("S001: 3.00")
    assert "$ position reached" in err


@pytest.mark.parametrize("name", ["file", os.devnull])
def test_a_file_as_standard_input_is_read_to_its_end(
    name: str,
    far: SimulatedDrive,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path = tmp_path / name
    if name == "file":
        path.write_text("S1\nS2")
    with path.open() as file:
        monkeypatch.setattr("sys.stdin", file)
        code, out, _ = said([URL], capsys)
    assert code == 0
    assert len(out.splitlines()) == (2 if name == "file" else 0)


@pytest.mark.parametrize(("data", "why"), [(b"S1\n\xff\n", "no text"), (b"S1\n" + b"x" * 200_000, "more than")])
def test_input_that_is_no_line_ends_it(
    data: bytes,
    why: str,
    far: SimulatedDrive,
    stdin: Callable[[bytes], None],
    capsys: pytest.CaptureFixture[str],
) -> None:
    stdin(data)
    code, out, err = said([URL], capsys)
    assert code == 2
    assert out.startswith("S001")
    assert why in err


@pytest.mark.parametrize(
    "line", ["move 5", "PA5", "home", "POSR 5$", "PH$", "start", "OT O0=0", "raw PH", "move by 5 at 20"]
)
def test_no_script_moves_an_axis_that_was_not_allowed_to(
    line: str, far: SimulatedDrive, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, err = said([URL, "-c", "S1", "-c", line], capsys)
    assert code == 2
    assert not out, "not even the lines before it are carried out"
    assert "--allow-motion says that the axis may move" in err
    assert f"in line 2: {line}; none of the lines was sent" in err
    assert not did(far, LogKind.MOTION_STARTED)


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("foo", "`raw foo` sends it all the same"),
        ("move", "move 100, move by -5, move 100 at 20"),
        ("move 5 at", "is no move"),
        ("move 1,5", "write a point before the decimals"),
        ("move abc", "'abc' is not a position or distance"),
        ("move 1_0", "'1_0' is not a position or distance"),
        ("move inf", "'inf' is not a position or distance"),
        ("move 5 at fast", "'fast' is not a speed in %"),
        ("move 1e9", "position"),
        ("move nan", "'nan' is not a position or distance"),
        ("move 5 at 101", "speed"),
        ("status now", "nothing is expected behind 'status'"),
        ("stop it", "nothing is expected behind 'stop'"),
        ("home 5", "nothing is expected behind 'home'"),
        ("watch position", "compax record"),
        ("S1$", "$ stands behind POSA or POSR"),
        ("$", "$ stands behind POSA or POSR"),
        ("POSA$", "$ stands behind POSA or POSR"),
        ("PA5,", "is a sign of the line"),
        ("raw", "an empty line is never sent"),
        ("PA" + "0" * 40, "entry buffer"),
        ("params 0", "there is no P0"),
        ("params 5-2", "names no parameters"),
    ],
)
def test_what_cannot_be_meant_is_refused_before_anything_is_sent(
    line: str, why: str, far: SimulatedDrive, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, err = said([URL, "--allow-motion", "-c", "S1", "-c", line], capsys)
    assert code == 2
    assert not out
    assert why in err


def test_lines_behind_exit_count_for_nothing(far: SimulatedDrive, capsys: pytest.CaptureFixture[str]) -> None:
    assert said([URL, "-c", "exit", "-c", "foo"], capsys) == (0, "", "")


def test_the_first_line_that_is_refused_by_the_drive_ends_it(
    far: SimulatedDrive, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, err = said([URL, "-c", "S1", "-c", "S200", "-c", "S2"], capsys)
    assert code == 5
    assert len(out.splitlines()) == 1
    assert "E90" in err
    assert "in line 2: S200; nothing after it was sent" in err


def test_a_motion_by_a_raw_line_that_still_runs_is_stopped_and_that_is_said(
    far: SimulatedDrive, capsys: pytest.CaptureFixture[str]
) -> None:
    code, _, err = said([URL, "--allow-motion", "-c", "PA500"], capsys)
    assert code == 0
    assert "PA500 may still be moving it: it is stopped now; `move 100` and POSA 100$ wait for the end" in err
    assert did(far, LogKind.MOTION_STOPPED)


def test_a_motion_by_a_raw_line_that_is_over_is_no_news(
    far: SimulatedDrive, capsys: pytest.CaptureFixture[str]
) -> None:
    assert said([URL, "--allow-motion", "-c", "PA0"], capsys)[::2] == (0, "")


def test_a_move_that_fails_gives_its_exit_code(
    loop: VirtualClockLoop, far: SimulatedDrive, capsys: pytest.CaptureFixture[str]
) -> None:
    loop.call_later(3, far.raise_fault, 55)
    code, _, err = said([URL, "--allow-motion", "-c", "move 500", "-c", "S1"], capsys)
    assert code == 7
    assert "E55, emergency stop" in err


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("raw ver", (0, "VERSION 3   a bare prompt was expected: whether the drive has carried it out is not known\n")),
        ("S1", (6, "")),
    ],
)
def test_what_comes_where_a_bare_prompt_was_expected_is_shown_as_that(
    line: str,
    expected: tuple[int, str],
    far: SimulatedDrive,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def command(self: Drive, text: str) -> str:
        raise UnexpectedAnswerError("that is no answer to what was sent", received="VERSION 3")

    monkeypatch.setattr(Drive, "command", command)
    assert said([URL, "-c", line], capsys)[:2] == expected


def test_where_a_stop_does_not_say_where_the_axis_stands_it_is_told_without(
    far: SimulatedDrive, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    async def position(self: Drive) -> float:
        raise CommandRejectedError("refused")

    monkeypatch.setattr(Drive, "position", position)
    code, out, _ = said([URL, "-c", "stop"], capsys)
    assert (code, out.strip()) == (0, "stopped  the drive has acknowledged STOP and stands")


@pytest.mark.parametrize("poll_s", ["-1", "nan"])
def test_a_time_that_is_none_is_refused(
    poll_s: str, loop: VirtualClockLoop, capsys: pytest.CaptureFixture[str]
) -> None:
    code, _, err = said([URL, f"--poll-s={poll_s}", "-c", "S1"], capsys)
    assert code == 2
    assert "poll-s" in err


def test_a_port_that_is_not_there_is_told(loop: VirtualClockLoop, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = said(["serial:///dev/nowhere", "-c", "S1"], capsys)
    assert code == 3
    assert "/dev/nowhere" in err
