"""What an exchange takes is what twice as many take more."""

from __future__ import annotations

import pytest
from benchmarks.figures.counts import per_exchange
from benchmarks.measuring.callgrind import Counted


def test_what_is_once_a_run_is_in_no_count() -> None:
    runs = [Counted(1000 + 50 * count, 7 + 2 * count) for count in (10, 20, 10, 20)]
    assert per_exchange(runs, 10) == {"instructions": (50.0, 0.0), "allocations": (2.0, 0.0)}


def test_how_much_a_second_count_differs_is_told() -> None:
    runs = [Counted(each, None) for each in (0, 1000, 0, 1010)]
    found = per_exchange(runs, 10)
    assert list(found) == ["instructions"]
    assert found["instructions"] == pytest.approx((100.0, 0.01))
