"""The job with blocking reads really runs, and goes wrong as the page says; the new one does not."""

from __future__ import annotations

import asyncio
import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest

import compax_aio
from compax_aio.testing import SimulatedGroup

ROOT = Path(__file__).parents[2]


@pytest.fixture(name="example")
def load() -> ModuleType:
    spec = importlib.util.spec_from_file_location("example_from_pyserial", ROOT / "examples" / "from_pyserial.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.real_time
async def test_blocking_reads_do_not_tell_what_has_happened(
    example: ModuleType, simulated_group: SimulatedGroup
) -> None:
    """Four drives at once, for each takes its five seconds."""
    simulated_group.add("near", "far", "faulty", nominal_speed=100.0, machine_zero=-20.0)
    simulated_group.add("narrow", nominal_speed=100.0, machine_zero=-20.0, travel_max=50.0)
    simulated_group["faulty"].far_end.raise_fault(20)

    async def job(name: str, target: float) -> str:
        async with simulated_group[name].serve_pty() as url:
            told: str = await asyncio.to_thread(example.job_with_pyserial, url.removeprefix("serial://"), target)
            return told

    near, far, faulty, narrow = await asyncio.gather(
        job("near", 100.0), job("far", 1000.0), job("faulty", 100.0), job("narrow", 100.0)
    )
    assert near == "S1 answers 'S001: 100.00'"
    assert 100 < float(far.split(":")[1].strip(" '")) < 300, "it does not say that the axis is on its way"
    assert simulated_group["far"].moving, "nobody stops it"
    assert faulty.startswith("S1 answers 'S001: ")
    assert narrow == "S1 answers 'S001: 0.00'"
    assert simulated_group["narrow"].refused == [("POSA 100.0", "E93")]


@pytest.mark.parametrize(("name", "error"), [("far", None), ("narrow", compax_aio.CommandRejectedError)])
async def test_the_new_way_arrives_or_says_why_not(
    example: ModuleType, simulated_group: SimulatedGroup, name: str, error: type[Exception] | None
) -> None:
    axis = simulated_group.add(name, machine_zero=-20.0, travel_max=50.0 if name == "narrow" else 5000.0)
    if error is not None:
        with pytest.raises(error, match="E93"):
            await example.job_with_compax_aio(axis.url, 1000.0)
    else:
        assert (await example.job_with_compax_aio(axis.url, 1000.0)).startswith("at 1000.00 units, ")
    axis.assert_standing()


@pytest.mark.real_time
def test_both_are_compared(example: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    assert example.main(["--target", "20"]) == 0
    told = capsys.readouterr().out.splitlines()
    assert told[0].endswith("S1 answers 'S001: 20.00'")
    assert told[2].startswith("compax_aio says after ")
    assert told[1] == told[3] == "  really: at 20.00, and the axis stands"


def test_on_a_line_of_ones_own_only_the_new_way_runs(example: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    assert example.main(["sim://compax?nominal_speed=10000", "--target", "5"]) == 0
    assert capsys.readouterr().out.startswith("at 5.00 units, ")


def test_the_page_shows_the_code_that_runs() -> None:
    """Line by line, but for comments and annotations."""
    page = (ROOT / "docs" / "migrating-from-pyserial.md").read_text()
    code = (ROOT / "examples" / "from_pyserial.py").read_text()
    shown = re.search(r"def job_with_pyserial.*?^```$", page, re.MULTILINE | re.DOTALL)
    assert shown is not None
    body = [line.split("#")[0].strip() for line in shown[0].splitlines()[1:-1]]
    lacking = [line for line in body if line and line.split("(command")[0].split("return ask")[0] not in code]
    assert not lacking
