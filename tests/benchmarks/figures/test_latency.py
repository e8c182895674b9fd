"""What happened here is matched with what the far end tells, or it is said that it cannot be."""

from __future__ import annotations

import asyncio

import pytest
from benchmarks.figures.latency import _all_the_while, _names, after_exchange, pair


def test_events_of_each_line_are_matched_in_their_order() -> None:
    here = [(0, 1.5), (1, 1.6), (0, 3.5)]
    there = [[1, 1.1], [0, 1.2], [0, 3.3]]
    assert pair(here, there) == [(1.5, [1.2]), (1.6, [1.1]), (3.5, [3.3])]


def test_what_the_far_end_tells_besides_the_time_goes_with_it() -> None:
    assert pair([(7, 1.0)], [[7, 1.5, 0.9]]) == [(1.0, [1.5, 0.9])]


@pytest.mark.parametrize(
    ("there", "said"), [([], "line 0 has seen more"), ([[0, 1.0], [0, 2.0]], r"far ends of lines \[0\] have seen more")]
)
def test_unequal_numbers_are_no_measurement(there: list[list[float]], said: str) -> None:
    with pytest.raises(RuntimeError, match=said):
        pair([(0, 1.5)], there)


@pytest.mark.parametrize(
    ("answered_at", "took"),
    [
        ((9.0, 9.9), 1.5),  # nothing was in flight
        ((9.9, 11.0), 0.5),  # one exchange was
        ((10.5, 11.4), 1.0),  # it waited for another one
    ],
)
def test_a_stop_may_wait_for_one_exchange_and_no_more(answered_at: tuple[float, float], took: float) -> None:
    assert after_exchange(10.0, 11.5, *answered_at) == pytest.approx(took)


def test_a_thousand_reads_are_a_thousand_exchanges() -> None:
    names = _names()
    assert len(set(names)) == 1000
    assert {len(name) for name in names} == {4}


async def test_what_should_go_on_for_ever_and_does_not_is_told() -> None:
    async def breaks() -> None:
        raise OSError("the line is gone")

    with pytest.raises(OSError, match="the line is gone"):
        async with _all_the_while(breaks(), asyncio.sleep(3600)):
            await asyncio.sleep(1)


async def test_what_goes_on_all_the_while_ends_with_it() -> None:
    ticks = 0

    async def tick() -> None:
        nonlocal ticks
        while True:
            await asyncio.sleep(1)
            ticks += 1

    async with _all_the_while(tick()):
        await asyncio.sleep(3.5)
    await asyncio.sleep(10)
    assert ticks == 3
