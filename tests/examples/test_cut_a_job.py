"""The example that cuts a job does what it says, on a simulated cutter, and ends as it promises."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Coroutine
from pathlib import Path
from typing import Any

import pytest
from tests.camm1.bench import expected_vectors, vectors
from tests.examples.test_examples import load

from compax_aio.simulator.camm1 import Knobs, SimulatedCutter
from compax_aio.simulator.clock import VirtualClockLoop
from compax_aio.simulator.server import cutter_named

URL = "sim://camm1?name=example"


@pytest.fixture
def far(monkeypatch: pytest.MonkeyPatch) -> SimulatedCutter:
    """Make the cutter in advance, and let main() run on a virtual clock."""
    loop = VirtualClockLoop()

    def run(work: Coroutine[Any, Any, None]) -> None:
        with asyncio.Runner(loop_factory=lambda: loop) as runner:
            runner.run(work)

    monkeypatch.setattr(asyncio, "run", run)

    async def make() -> SimulatedCutter:
        return cutter_named("example", Knobs(baudrate=9600))

    return loop.run_until_complete(make())


@pytest.mark.parametrize("handshake", ["auto", "software", "xonxoff", "enq1", "enq2", "hardwire"])
def test_it_cuts_a_star_and_tells_how_far_it_is(
    handshake: str, far: SimulatedCutter, capsys: pytest.CaptureFixture[str]
) -> None:
    example = load("cut_a_job")
    assert example.main([URL, "--handshake", handshake]) == 0
    told = capsys.readouterr().out.splitlines()
    assert told[0] == "PNC-1610, 1024 bytes of buffer"
    assert told[-1].startswith("cut in ")
    assert told[-1].endswith("as OA has shown")
    assert any(line.startswith("finishing") for line in told)
    assert any("79 of 79 bytes" in line for line in told)
    assert vectors(far) == expected_vectors(example.STAR)


def test_it_cuts_a_file(far: SimulatedCutter, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    job = tmp_path / "square.plt"
    job.write_text("PU0,0;PD400,0,400,400,0,400,0,0;")
    assert load("cut_a_job").main([URL, "--job", str(job)]) == 0
    assert len(vectors(far)) == 5
    assert "warning: line 1, column 7: warning: the tool is left down" in capsys.readouterr().out


def test_it_tells_what_is_wrong_with_a_file(
    far: SimulatedCutter, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    job = tmp_path / "broken.plt"
    job.write_text("PU0,0;\nPD400;")
    assert load("cut_a_job").main([URL, "--job", str(job)]) == 1
    assert "line 2, column 1: error" in capsys.readouterr().err
    assert not vectors(far)


def test_it_tells_that_a_file_is_not_there(
    far: SimulatedCutter, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert load("cut_a_job").main([URL, "--job", str(tmp_path / "none.plt")]) == 1
    assert "FileNotFoundError" in capsys.readouterr().err
    assert not vectors(far)


def test_ctrl_c_aborts_the_job(far: SimulatedCutter, capsys: pytest.CaptureFixture[str]) -> None:
    example = load("cut_a_job")
    cut_job = example.cut_job

    async def interrupted(*arguments: Any) -> None:
        asyncio.get_running_loop().call_later(1.0, signal.raise_signal, signal.SIGINT)
        await cut_job(*arguments)

    vars(example)["cut_job"] = interrupted
    assert example.main([URL]) == 130
    assert "interrupted; the job was aborted" in capsys.readouterr().err
    assert far.stored_bytes == 0
    assert not far.position()[2]
    assert len(vectors(far)) < len(expected_vectors(example.STAR))
