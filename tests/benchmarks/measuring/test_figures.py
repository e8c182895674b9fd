"""A figure knows whether it is reached, and says its target as people do."""

from __future__ import annotations

import json

import pytest
from benchmarks.measuring import Effort, Figure, Machine, Noise, Row, Target, above, at_least, at_most
from benchmarks.measuring.reporting import as_json, as_table, write_json


@pytest.mark.parametrize(
    ("target", "reached", "missed", "told"),
    [
        (at_most(1.5), 1.5, 1.51, "≤ 1.5 ms"),
        (at_least(1000), 1000.0, 999.0, "≥ 1,000 ms"),
        (above(1), 1.01, 1.0, "> 1 ms"),
        (at_most(0, "none"), 0.0, 1.0, "none"),
    ],
)
def test_a_target_is_reached_or_missed(target: Target, reached: float, missed: float, told: str) -> None:
    assert target.told("ms") == told
    assert Figure(name="x", value=reached, target=target).is_reached is True
    assert Figure(name="x", value=missed, target=target).is_reached is False


def test_what_was_not_measured_is_neither_reached_nor_missed() -> None:
    assert Figure(name="x", value=None, target=at_most(1)).is_reached is None
    assert Figure(name="x", value=1.0).is_reached is None


@pytest.fixture
def effort() -> Effort:
    noise = Noise(cpu_s=[0.001, 0.001, 0.001, 0.001], wall_s=[0.001, 0.001, 0.001, 0.001])
    return Effort(name="short", rounds=4, round_s=0.1, noise=noise)


@pytest.fixture
def machine() -> Machine:
    return Machine(processor="Abacus", cores=1, system="Wood 1.0", python="CPython 3.11", uvloop=None, load=0.5)


def test_the_table_says_targets_ratios_and_notes(effort: Effort, machine: Machine) -> None:
    figure = Figure(
        name="cost of a thing",
        value=1.4,
        unit="times the floor",
        target=at_most(1.5),
        spread=0.02,
        ratio_of="the floor",
        rows=[
            Row(name="floor", value=20.0, unit="µs", ratio=1.0, spread=0.01),
            Row(name="peer", value=None, unit="µs", note="not installed"),
        ],
        notes=["the far end waits"],
    )
    missed = Figure(name="another", value=12_345.6, unit="s", target=at_most(1))
    unknown = Figure(name="a third", value=None, target=at_most(1))
    lines = as_table([figure, missed, unknown], machine, effort).splitlines()
    words = [" ".join(line.split()) for line in lines]
    assert "cost of a thing ≤ 1.5 times the floor 1.40 times the floor yes ± 2.0%" in words
    assert "floor 20.00 µs 1.00 times the floor ± 1.0%" in words
    assert "peer (not installed) not measured" in words
    assert "another ≤ 1 s 12,346 s NO" in words
    assert "a third ≤ 1 not measured ?" in words
    assert "cost of a thing: the far end waits" in lines
    assert any("Abacus, 1 core, Wood 1.0, CPython 3.11, no uvloop, load 0.5" in line for line in lines)
    assert any(line.startswith("noise:") and line.endswith("quiet") for line in lines)


def test_the_json_says_the_same(effort: Effort, machine: Machine, tmp_path_factory: pytest.TempPathFactory) -> None:
    file = tmp_path_factory.mktemp("json") / "figures.json"
    figure = Figure(name="cost", value=2.0, unit="ms", target=at_most(1))
    write_json(file, as_json({"exchange_cost": [figure]}, machine, effort))
    told = json.loads(file.read_text())
    assert told["figures"]["exchange_cost"][0] == {
        "name": "cost",
        "value": 2.0,
        "unit": "ms",
        "target": {"limit": 1, "kind": "at most", "says": ""},
        "target_told": "≤ 1 ms",
        "is_reached": False,
        "spread": None,
        "ratio_of": "",
        "rows": [],
        "notes": [],
    }
    assert told["noise"]["is_quiet"] is True
    assert told["machine"]["processor"] == "Abacus"
    assert told["effort"] == {"name": "short", "rounds": 4, "round_s": 0.1}
