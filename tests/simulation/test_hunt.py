"""P1 to P10: whole applications in trouble, each from one seed; ``HUNT_SEEDS=20000`` tries more of them."""

from __future__ import annotations

import os

import pytest

from compax_aio.simulator.hunt.drawing import draw_scenario
from compax_aio.simulator.hunt.hunting import Hunt
from compax_aio.simulator.hunt.promises import broken
from compax_aio.simulator.hunt.simulation import simulate
from compax_aio.simulator.hunt.story import story

SEEDS = int(os.environ.get("HUNT_SEEDS", "2000"))
PIECES = 20

REGRESSIONS: tuple[tuple[int, tuple[int, ...] | None, str], ...] = (
    (38, None, "the line is cut while a block that is left waits for its STOP"),
    (284, None, "a stop comes while another one waits between two looks"),
    (725, None, "a stop joins one that a deaf drive has not acknowledged"),
    (962, None, "a group is stopped, and one of its lines is cut meanwhile"),
    (1461, None, "a stop comes while the last marker is out"),
    (2261, None, "a flood without a prompt, and a stop in it"),
    (3054, None, "a flood without a prompt swallows the first answer after it"),
    (7775, None, "somebody begins to watch what is being asked already"),
)
"""Seeds, parts that are kept (None: all), and what they are about: each has once found something, here or there."""


@pytest.mark.parametrize("piece", range(PIECES))
def test_whatever_users_do_and_whatever_befalls_lines_and_drives_no_promise_is_broken(piece: int) -> None:
    hunt = Hunt()
    hunt.go(range(piece, SEEDS, PIECES))
    assert not hunt.finds, (
        "tell its story: python -m compax_aio.simulator.hunt --seed "
        f"{hunt.finds[0].seed} (seeds {[find.seed for find in hunt.finds]}): {hunt.finds[0].broken[0]}"
    )


@pytest.mark.parametrize(("seed", "keep", "about"), REGRESSIONS, ids=[about for *_, about in REGRESSIONS])
def test_what_was_found_once_stays_mended(seed: int, keep: tuple[int, ...] | None, about: str) -> None:
    scenario = draw_scenario(seed)
    testimony = simulate(scenario if keep is None else scenario.keep(keep))
    found = broken(testimony)
    assert not found, story(testimony, found)


@pytest.mark.parametrize("seed", [4, 33, 150])
def test_the_same_seed_is_the_same_to_the_last_byte(seed: int) -> None:
    first, second = (simulate(draw_scenario(seed)) for _ in range(2))
    assert {name: axis.wire for name, axis in first.axes.items()} == {
        name: axis.wire for name, axis in second.axes.items()
    }
