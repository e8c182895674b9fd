"""How many lines are read at full speed is found, whatever the number; what one loop did is told beside the floor."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from benchmarks.far_ends.paced import EXCHANGE_S
from benchmarks.figures import many_lines
from benchmarks.figures.many_lines import AT_SPEED, Found, full_speed_lines
from benchmarks.measuring import Results
from benchmarks.polling import Ask, Polled


async def _nothing() -> None:
    """Stands for a line."""


@pytest.mark.parametrize(("fast", "found"), [(0, 0), (24, 0), (25, 25), (430, 425), (999, 975), (1000, 1000)])
async def test_the_most_lines_at_full_speed_are_found(monkeypatch: pytest.MonkeyPatch, fast: int, found: int) -> None:
    async def polled(asks: Sequence[Ask], for_s: float, *, seed: int) -> Polled:
        return Polled(shares=[AT_SPEED if len(asks) <= fast else 0.9])

    monkeypatch.setattr(many_lines, "poll", polled)
    assert await full_speed_lines([_nothing] * 1000, 1.0) == found


async def test_what_was_in_the_way_once_does_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    shares = iter([0.5, 1.0])

    async def polled(asks: Sequence[Ask], for_s: float, *, seed: int) -> Polled:
        return Polled(shares=[next(shares)])

    monkeypatch.setattr(many_lines, "poll", polled)
    assert await full_speed_lines([_nothing] * 100, 1.0) == 100


def test_of_many_lines_the_most_are_compared_with_the_floor() -> None:
    results = Results()
    for who, share, cpu_us in (("floor", 99.0, 8.0), ("drives", 97.0, 20.0)):
        for count in (1, 10):
            told = {
                "% of the wires": share - count,
                "% of the fastest": 90.0,
                "CPU µs": cpu_us,
                "% of a core": 50.0,
                "% of its time": 40.0,
                "far end late p99": 0.1,
                **dict.fromkeys(many_lines._PERCENTILES, 24.5),
            }
            results.add(f"{who} {count}", told)
    found = Found("uvloop", (1, 10), results, full_speed={"floor": 10, "drives": 7})
    speed, capacity, fairness = (
        make(found) for make in (many_lines._speed, many_lines._capacity, many_lines._fairness)
    )
    assert speed.value == 87.0
    assert speed.is_reached is False
    ratios = {(row.name, row.unit): row.ratio for row in speed.rows}
    assert ratios["10 lines: drives", "CPU µs"] == pytest.approx(2.5)
    assert capacity.value == 7
    enough = {row.name: row.value for row in capacity.rows}
    assert enough["drives: enough CPU time for"] == pytest.approx(1e6 * EXCHANGE_S / 20.0)
    assert fairness.value == 90.0
    assert fairness.target is None
