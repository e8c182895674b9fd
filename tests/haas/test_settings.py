"""Settings have finite defaults that harm no machine; what means nothing, or polls too fast, is refused."""

from __future__ import annotations

from dataclasses import fields, replace
from math import inf, nan
from typing import Any

import pytest

from compax_aio.errors import InvalidCommandError
from compax_aio.haas.settings import ControlSettings

DEFAULT = ControlSettings()


def test_every_wait_is_finite_by_default() -> None:
    times = [getattr(DEFAULT, each.name) for each in fields(DEFAULT) if each.name.endswith("_s")]
    assert len(times) >= 14
    assert all(0 < each <= 3600 for each in times)


@pytest.mark.parametrize("value", [0, -1.0, inf, nan, "1", True, None])
def test_a_time_is_a_number_above_0(value: Any) -> None:
    for name in (each.name for each in fields(DEFAULT) if each.name.endswith("_s")):
        with pytest.raises(InvalidCommandError, match=f"{name} is a time above 0"):
            replace(DEFAULT, **{name: value})


def test_counts_and_sizes_are_whole() -> None:
    for name in ("max_bytes", "most_blocks_repeated", "most_unsent_bytes", "resync_attempts", "back_off_after"):
        for value in (0, 1.5):
            with pytest.raises(InvalidCommandError, match=name):
                replace(DEFAULT, **{name: value})  # type: ignore[arg-type]
    with pytest.raises(InvalidCommandError, match="baud_rate"):
        replace(DEFAULT, baud_rate=0)
    assert replace(DEFAULT, reconnect_attempts=3, baud_rate=9600).reconnect_attempts == 3


def test_a_control_is_not_polled_without_pause() -> None:
    with pytest.raises(InvalidCommandError, match="cycle_s is 1 s at least"):
        replace(DEFAULT, cycle_s=0.5)
    with pytest.raises(InvalidCommandError, match="gap_s is 0"):
        replace(DEFAULT, gap_s=0.001)


def test_nothing_may_be_written_unless_it_is_allowed() -> None:
    assert not DEFAULT.may_write(500)
    some = replace(DEFAULT, writable=(range(500, 600), range(10_200, 10_300)))
    assert [some.may_write(each) for each in (499, 500, 599, 600, 10_299)] == [False, True, True, False, True]


@pytest.mark.parametrize(
    "value", [range(500, 600), (500,), (range(5),), (range(500, 500),), (range(1, 9, 2),), (range(1, 200_000),)]
)
def test_what_may_be_written_is_told_as_ranges(value: Any) -> None:
    if isinstance(value, range):
        assert replace(DEFAULT, writable=(value,))
        return
    with pytest.raises(InvalidCommandError, match="writable has ranges"):
        replace(DEFAULT, writable=value)


@pytest.mark.parametrize("value", [0, inf, "9", True])
def test_the_largest_value_is_a_number(value: Any) -> None:
    with pytest.raises(InvalidCommandError, match="largest_value"):
        replace(DEFAULT, largest_value=value)
