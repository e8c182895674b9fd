"""How often a move is looked at."""

from __future__ import annotations

import pytest

from compax_aio.motion.pace import Pace

FIRST_S, SLOWEST_S = 0.1, 0.5


def test_looks_become_rarer_down_to_the_slowest() -> None:
    pace = Pace(FIRST_S, SLOWEST_S, 0.0)
    pauses = [pace.pause_s]
    for second in range(1, 6):
        pace.note(float(second), float(second))
        pauses.append(pace.pause_s)
    assert pauses == pytest.approx([0.1, 0.15, 0.225, 0.3375, 0.5, 0.5])


def test_the_next_look_comes_when_the_axis_should_arrive_but_not_sooner_than_the_first_pause() -> None:
    pace = Pace(FIRST_S, SLOWEST_S, 0.0)
    for second in range(10):
        pace.note(second * 100.0, float(second))
    assert pace.pause_before_arrival_s(930.0) == pytest.approx(0.3)
    assert pace.pause_before_arrival_s(901.0) == 0.1
    assert pace.pause_before_arrival_s(5000.0) == 0.5


@pytest.mark.parametrize("target", [None, 0.0])
def test_an_axis_that_does_not_come_nearer_is_looked_at_as_ever(target: float | None) -> None:
    pace = Pace(FIRST_S, SLOWEST_S, 0.0)
    for second in range(10):
        pace.note(second * 100.0, float(second))
    assert pace.pause_before_arrival_s(target) == 0.5


def test_standing_is_counted_from_the_last_other_position() -> None:
    pace = Pace(FIRST_S, SLOWEST_S, 0.0)
    pace.note(1.0, 1.0)
    pace.note(1.0, 4.0)
    assert pace.stood_still_s(6.0) == 5.0
    pace.note(1.5, 7.0)
    assert pace.stood_still_s(7.5) == 0.5


def test_where_no_position_can_be_read_nothing_stands_still() -> None:
    pace = Pace(FIRST_S, SLOWEST_S, 0.0)
    pace.note(None, 50.0)
    assert pace.stood_still_s(50.0) == 0.0
    assert pace.pause_before_arrival_s(7.0) == pace.pause_s
