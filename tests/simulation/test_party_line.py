"""P1 to P10 on a line with SMC axes: whole applications in trouble; ``HUNT_SEEDS=20000`` tries more of them."""

from __future__ import annotations

import os
from dataclasses import replace

import pytest

from compax_aio.simulator.hunt.hunting import Hunt
from compax_aio.simulator.hunt.testimony import WireEntry, WireKind
from compax_aio.simulator.smc_hunt.actions import ACTIONS
from compax_aio.simulator.smc_hunt.drawing import draw_party
from compax_aio.simulator.smc_hunt.evidence import EXCUSES
from compax_aio.simulator.smc_hunt.promises import broken_on_line
from compax_aio.simulator.smc_hunt.quarry import SMC
from compax_aio.simulator.smc_hunt.simulation import simulate_party
from compax_aio.simulator.smc_hunt.spoken import Spoken
from compax_aio.simulator.smc_hunt.story import party_story
from compax_aio.simulator.smc_hunt.troubles import TROUBLES
from compax_aio.smc.settings import SmcSettings

SEEDS = int(os.environ.get("HUNT_SEEDS", "1000"))
PIECES = 20
SETTINGS = SmcSettings(echo_timeout_s=0.1, answer_timeout_s=1.0, quiet_s=0.05)


@pytest.mark.parametrize("piece", range(PIECES))
def test_whatever_users_do_and_whatever_befalls_a_line_and_its_axes_no_promise_is_broken(piece: int) -> None:
    hunt = Hunt(SMC)
    hunt.go(range(piece, SEEDS, PIECES))
    assert not hunt.finds, (
        "tell its story: python -m compax_aio.simulator.hunt --device smc --seed "
        f"{hunt.finds[0].seed} (seeds {[find.seed for find in hunt.finds]}): {hunt.finds[0].broken[0]}"
    )


@pytest.mark.parametrize("seed", [4, 33, 150])
def test_the_same_seed_is_the_same_to_the_last_byte(seed: int) -> None:
    first, second = (simulate_party(draw_party(seed)) for _ in range(2))
    assert first.wire == second.wire
    assert list(first.far.log) == list(second.far.log)


def test_every_kind_of_action_and_of_trouble_is_drawn_in_a_few_hundred_seeds() -> None:
    scenarios = [draw_party(seed) for seed in range(1500)]
    assert {each.kind for scenario in scenarios for each in scenario.actions} == set(ACTIONS)
    assert {each.kind for scenario in scenarios for each in scenario.troubles} == set(TROUBLES)
    assert {scenario.line.knobs.mode for scenario in scenarios} == {"party", "daisy", "single"}


def test_what_is_kept_of_a_scenario_stays_as_it_was() -> None:
    whole = next(scenario for scenario in map(draw_party, range(100)) if len(scenario.line.knobs.axes) > 2)
    gone = whole.drives[0]
    kept = whole.keep([number for number in whole.numbers if number != gone.number])
    assert kept.line.knobs.axes == whole.line.knobs.axes[1:] or whole.line.knobs.mode == "daisy"
    assert whole.keep(whole.numbers) == whole
    assert kept.line.settings == whole.line.settings


def test_excuses_are_few() -> None:
    seeds = range(150)
    excused = sum(_excused(seed) for seed in seeds)
    assert excused < len(seeds) / 5


def _excused(seed: int) -> int:
    testimony = simulate_party(draw_party(seed))
    broken_on_line(testimony)
    assert set(testimony.excused) <= set(EXCUSES)
    return sum(testimony.excused.values())


def test_a_broken_promise_is_told_with_the_bytes_and_how_to_see_it_again() -> None:
    testimony = simulate_party(draw_party(7))
    text = party_story(testimony, broken_on_line(testimony))
    assert "seed 7" in text
    assert "→" in text
    assert "no promise is broken" in text


# What is spoken -------------------------------------------------------------------------------------------------------


def spoken(*entries: tuple[float, str, bytes]) -> Spoken:
    """Return what was said by ``(at, arrow, bytes)``."""
    kinds = {"→": WireKind.WRITTEN, "←": WireKind.READ, "opened": WireKind.OPENED}
    return Spoken([WireEntry(at, kinds[kind], data) for at, kind, data in entries], SETTINGS, "party")


IN_STEP = ((0.0, "opened", b""), (0.0, "→", b"\n"), (0.05, "→", b"A"), (0.06, "←", b"A"), (0.06, "→", b"\n"))


def test_a_line_whose_echoes_came_is_whole_and_in_turn() -> None:
    said = spoken(*IN_STEP, (0.07, "←", b"\n"), (0.07, "→", b"A"), (0.08, "←", b"A"), (0.08, "→", b"Z"))
    assert [(line.text, line.is_whole) for line in said.lines] == [("A", True), ("AZ", False)]
    assert said.wrongs == []


def test_a_character_before_the_echo_of_the_last_one_is_out_of_turn() -> None:
    assert "'A' has not come back" in spoken((0.0, "opened", b""), (0.0, "→", b"A"), (0.01, "→", b"Z")).wrongs[0]


def test_a_character_before_the_answer_to_a_line_is_out_of_turn() -> None:
    said = spoken(*IN_STEP, (0.07, "←", b"\n"), (0.07, "→", b"A"), (0.08, "←", b"A"), (0.08, "→", b"Z"),
                  (0.09, "←", b"Z"), (0.09, "→", b"\n"), (0.2, "→", b"A"))  # fmt: skip
    assert "has had no answer" in said.wrongs[0]


def test_a_character_too_soon_after_what_clears_is_out_of_turn() -> None:
    said = spoken((0.0, "opened", b""), (0.0, "→", b"\n"), (0.02, "→", b"A"))
    assert len(said.wrongs) == 1


def test_two_characters_at_a_time_are_out_of_turn_but_escape_never_is() -> None:
    assert "more than one character" in spoken(*IN_STEP, (0.07, "←", b"\n"), (0.07, "→", b"AZ")).wrongs[0]
    assert spoken(*IN_STEP, (0.061, "→", b"\x1b")).wrongs == []


# What breaks a promise ------------------------------------------------------------------------------------------------


def test_a_told_position_that_the_axis_never_said_breaks_a_promise() -> None:
    testimony = simulate_party(replace(draw_party(0), troubles=()))
    probe = next(call for call in testimony.calls if call.what == "probe")
    probe.outcome += 1
    assert any(found.promise == "P4" for found in broken_on_line(testimony))


def test_a_call_that_never_ended_breaks_a_promise() -> None:
    testimony = simulate_party(draw_party(0))
    testimony.calls[-1].ended_at = None
    assert [found.promise for found in broken_on_line(testimony)] == ["P3"]
