"""Rounds strike all candidates alike, and what is compared belongs to the same round."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest
from benchmarks.measuring import (
    LEAST,
    SHORT,
    Effort,
    Measured,
    Noise,
    Results,
    interleaved,
    interleaved_async,
    spread_of,
)


@pytest.fixture
def effort() -> Effort:
    return replace(LEAST, rounds=3, noise=Noise())


def _counting(name: str, calls: list[str]) -> Callable[[], Measured]:
    def measure() -> Measured:
        calls.append(name)
        return {"s": float(len(calls))}

    return measure


def test_candidates_take_turns_and_every_other_round_goes_backwards(effort: Effort) -> None:
    calls: list[str] = []
    interleaved(effort, {name: _counting(name, calls) for name in "ab"})
    assert calls == [*"ba", *"ab", *"ba", *"ab"]


def test_the_first_round_is_thrown_away(effort: Effort) -> None:
    calls: list[str] = []
    results = interleaved(effort, {name: _counting(name, calls) for name in "ab"})
    assert results.values == {"a": {"s": [3.0, 6.0, 7.0]}, "b": {"s": [4.0, 5.0, 8.0]}}


def test_noise_is_looked_at_between_rounds(effort: Effort) -> None:
    interleaved(effort, {"a": lambda: {"s": 1.0}})
    assert len(effort.noise.cpu_s) == len(effort.noise.wall_s) == 4


async def test_what_is_awaited_takes_turns_likewise(effort: Effort) -> None:
    calls: list[str] = []

    async def measure(name: str) -> Measured:
        return _counting(name, calls)()

    results = await interleaved_async(effort, {"a": lambda: measure("a"), "b": lambda: measure("b")})
    assert calls == [*"ba", *"ab", *"ba", *"ab"]
    assert results.median("a", "s") == 6.0


def test_a_ratio_is_of_the_same_round() -> None:
    """So a machine that is half as fast in one round changes both, and the ratio not."""
    results = Results({"ours": {"s": [2.0, 4.0, 2.2]}, "floor": {"s": [1.0, 2.0, 1.0]}})
    assert results.ratio("ours", "floor", "s") == 2.0
    assert results.ratios("ours", "floor", "s") == [2.0, 2.0, 2.2]
    assert results.spread("ours", "s") > results.ratio_spread("ours", "floor", "s")


def test_a_few_wild_values_do_not_change_the_spread() -> None:
    assert spread_of([10.0, 10.0, 9.0, 11.0, 10.0, 10.0, 10.0, 1000.0]) == pytest.approx(0.05)
    assert spread_of([1.0]) == spread_of([]) == spread_of([0.0, 0.0]) == 0.0


def test_an_effort_picks_a_size() -> None:
    assert (LEAST.pick(1, 2, 3), SHORT.pick(1, 2, 3)) == (1, 2)
