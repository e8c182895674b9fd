"""Scenarios: drawn beforehand, and any part of them can be left out without a change to the others."""

from __future__ import annotations

from pathlib import Path

import pytest

from compax_aio.simulator.hunt.actions import ACTIONS
from compax_aio.simulator.hunt.drawing import draw_scenario
from compax_aio.simulator.hunt.scenario_file import read_scenario, scenario_text
from compax_aio.simulator.hunt.shrink import ddmin
from compax_aio.simulator.hunt.troubles import TROUBLES


def test_one_seed_gives_one_scenario_and_another_seed_another() -> None:
    assert draw_scenario(7) == draw_scenario(7)
    assert draw_scenario(7) != draw_scenario(8)


def test_what_is_kept_of_a_scenario_stays_as_it_was() -> None:
    whole = draw_scenario(3)
    kept = whole.keep(whole.numbers[1:])
    assert kept.drives == whole.drives[1:]
    assert {each.number for each in kept.troubles} <= {each.number for each in whole.troubles}
    assert all(each in whole.actions or len(each.axes) for each in kept.actions)
    assert whole.keep(whole.numbers) == whole


def test_with_a_drive_goes_what_is_done_to_it_alone() -> None:
    whole = next(scenario for scenario in map(draw_scenario, range(100)) if len(scenario.drives) > 1)
    gone = whole.drives[0]
    kept = whole.keep([number for number in whole.numbers if number != gone.number])
    assert not any(gone.axis in each.axes for each in (*kept.actions, *kept.troubles))


def test_every_kind_of_action_and_of_trouble_is_drawn_in_a_few_hundred_seeds() -> None:
    scenarios = [draw_scenario(seed) for seed in range(1500)]
    assert {each.kind for scenario in scenarios for each in scenario.actions} == set(ACTIONS)
    assert {each.kind for scenario in scenarios for each in scenario.troubles} == set(TROUBLES)


def test_about_half_of_all_scenarios_open_lost_lines_again() -> None:
    reconnecting = sum(any(plan.settings.reconnect for plan in draw_scenario(seed).drives) for seed in range(1000))
    assert 450 < reconnecting < 650


@pytest.mark.parametrize("seed", range(0, 200, 7))
def test_a_scenario_is_the_same_when_it_was_written_and_read(seed: int, tmp_path: Path) -> None:
    scenario = draw_scenario(seed)
    path = tmp_path / "scenario.json"
    path.write_text(scenario_text(scenario, "a test"), "utf-8")
    assert read_scenario(path) == ("a test", scenario)


@pytest.mark.parametrize("culprits", [{5}, {0, 9}, {2, 3, 4}, {0, 4, 8, 9}])
def test_the_shrinker_keeps_no_more_than_it_takes(culprits: set[int]) -> None:
    kept = ddmin(range(10), lambda some: culprits <= set(some))
    assert set(kept) == culprits


def test_the_shrinker_leaves_nothing_that_one_could_leave_out() -> None:
    kept = ddmin(range(30), lambda some: len(set(some) & {1, 4, 9, 16, 25}) >= 3)
    assert len(kept) == 3
