"""P1 to P10: whole applications in trouble, each from one seed; ``HUNT_SEEDS=20000`` tries more of them."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from compax_aio.simulator.hunt.drawing import draw_scenario
from compax_aio.simulator.hunt.hunting import Hunt
from compax_aio.simulator.hunt.promises import broken
from compax_aio.simulator.hunt.scenario_file import read_scenario
from compax_aio.simulator.hunt.simulation import simulate
from compax_aio.simulator.hunt.story import story

SEEDS = int(os.environ.get("HUNT_SEEDS", "2000"))
PIECES = 20

REGRESSIONS = sorted((Path(__file__).parent / "regressions").glob("*.json"))
"""Scenarios that have each once found something, here or there; told apart by what they are about."""


@pytest.mark.parametrize("piece", range(PIECES))
def test_whatever_users_do_and_whatever_befalls_lines_and_drives_no_promise_is_broken(piece: int) -> None:
    hunt = Hunt()
    hunt.go(range(piece, SEEDS, PIECES))
    assert not hunt.finds, (
        "tell its story: python -m compax_aio.simulator.hunt --seed "
        f"{hunt.finds[0].seed} (seeds {[find.seed for find in hunt.finds]}): {hunt.finds[0].broken[0]}"
    )


@pytest.mark.parametrize("path", REGRESSIONS, ids=[path.stem.replace("_", " ") for path in REGRESSIONS])
def test_what_was_found_once_stays_mended(path: Path) -> None:
    _, scenario = read_scenario(path)
    testimony = simulate(scenario)
    found = broken(testimony)
    assert not found, story(testimony, found)


@pytest.mark.parametrize("seed", [4, 33, 150])
def test_the_same_seed_is_the_same_to_the_last_byte(seed: int) -> None:
    first, second = (simulate(draw_scenario(seed)) for _ in range(2))
    assert {name: axis.wire for name, axis in first.axes.items()} == {
        name: axis.wire for name, axis in second.axes.items()
    }
