"""Numbers of somebody else are plain numbers before they are used, and are written as short as they go."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.hostile.wicked import STRANGE_NUMBERS, NamedNumber, SmuggledFloat, SmuggledInt, refusal

from compax_aio.checked_numbers import check_number, check_time, check_whole, written


@pytest.mark.parametrize("value", STRANGE_NUMBERS, ids=range(len(STRANGE_NUMBERS)))
def test_a_strange_number_is_refused_or_becomes_a_plain_one(value: Any) -> None:
    said = refusal(lambda: check_number("it", value))
    if said is None:
        assert type(check_number("it", value)) is float
    else:
        assert said.startswith("it must be ")
        assert said.isprintable()


def test_a_number_of_another_kind_is_its_value() -> None:
    assert [check_number("it", each) for each in (SmuggledFloat(3.5), NamedNumber.THIRD)] == [3.5, 3.0]
    assert type(check_whole("it", NamedNumber.THIRD, 0, 5)) is int


def test_a_time_is_a_finite_number_of_seconds_above_0() -> None:
    assert all(refusal(lambda each=each: check_time("it", each)) is None for each in (1, 0.001, 3600.0))  # type: ignore[misc]
    for each in (0, -1, float("inf"), float("nan"), 10**400, True, "1", None):
        said = refusal(lambda each=each: check_time("it", each))  # type: ignore[misc]
        assert said is not None
        assert said.startswith("it is a time above 0 in seconds, not ")


def test_what_is_not_whole_or_out_of_range_is_refused() -> None:
    assert [check_whole("it", each, 0, 9) for each in (0, 9, 3.0)] == [0, 9, 3]
    for each in (-1, 10, 3.5, 9.0001):
        said = refusal(lambda each=each: check_whole("it", each, 0, 9, source="p. 1"))  # type: ignore[misc]
        assert said == f"it is a whole number from 0 to 9 (p. 1), not {each!r}"
    said = refusal(lambda: check_whole("it", SmuggledInt(777), 0, 9))
    assert said is not None
    assert "\r" not in said


@pytest.mark.parametrize(
    ("number", "decimals", "text"),
    [(100.0, 0, "100"), (100.0, 2, "100"), (-0.0, 2, "0"), (-0.001, 2, "0"), (-0.4, 0, "0"), (10.5, 2, "10.5"),
     (1e7, 0, "10000000"), (0.05, 2, "0.05"), (0.0, 0, "0")],
)  # fmt: skip
def test_a_number_is_written_as_short_as_it_goes(number: float, decimals: int, text: str) -> None:
    assert written(number, decimals) == text


@given(number=st.floats(-9e6, 9e6), decimals=st.integers(0, 3))
def test_what_is_written_is_the_rounded_number(number: float, decimals: int) -> None:
    assert float(written(number, decimals)) == round(number, decimals)
