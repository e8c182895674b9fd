"""Speed, force, tool, feed and ways are worded for the machine at hand, or refused before anything is sent."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.camm1.little_plotter import segments

from compax_aio.camm1.checking import check
from compax_aio.camm1.profiles import CX_24, DXY_1300, GS_24, HP_7475A, PNC_900, PNC_1610, Profile
from compax_aio.camm1.vocabulary import (
    JobSettings,
    cut,
    feed,
    force,
    initialise,
    lift,
    park,
    speed,
    tool,
    travel,
)
from compax_aio.errors import InvalidCommandError


@pytest.mark.parametrize(
    ("worded", "expected"),
    [
        (initialise(), b"IN;"),
        (lift(), b";PU;"),
        (speed(5, PNC_900), b"VS5;"),
        (speed(2.5, GS_24), b"VS2.5;"),
        (force(80, GS_24), b"!FS80;"),
        (force(8, replace(DXY_1300, force_instruction="FS", forces=(1, 16))), b"FS8;"),
        (tool(1, PNC_900), b"!ST1;"),
        (tool(6, HP_7475A), b"SP6;"),
        (feed(-1600, PNC_900), b"!PG-1600;"),
        (travel(10, 20.0126, PNC_900), b"PU;PA400,801;"),
        (park(PNC_900), b"PU;PA0,0;"),
        (travel(2.488, 0, HP_7475A), b"PU;PA100,0;"),
    ],
)
def test_words(worded: bytes, expected: bytes) -> None:
    assert worded == expected


@pytest.mark.parametrize(
    ("word", "value", "profile", "match"),
    [
        (speed, 21, PNC_900, "speed_cm_s of PNC-900 is from 1 to 20, not 21"),
        (speed, 0, PNC_900, "speed_cm_s"),
        (speed, float("nan"), PNC_900, "speed_cm_s must be finite"),
        (speed, "5", PNC_900, "speed_cm_s must be a number"),
        (speed, 5, PNC_1610, "speeds_cm_s of PNC-1610 are not known.*replace"),
        (force, 80, PNC_900, "PNC-900 is not known to have an instruction for the force; set it at the machine"),
        (force, 400, GS_24, "from 30 to 350, not 400"),
        (tool, 2, PNC_900, "tool is a whole number from 0 to 1"),
        (tool, 0.5, PNC_900, "tool is a whole number"),
        (tool, 1, replace(CX_24, tool_instruction=None), "not known to have an instruction for the tool"),
        (feed, 1601, PNC_900, "feed_mm is a whole number from -1600 to 1600"),
        (feed, 0.5, PNC_900, "feed_mm is a whole number"),
        (feed, 100, HP_7475A, "feeds_mm of HP 7475A are not known, or it has none"),
    ],
)
def test_what_a_machine_cannot_be_told_is_refused(word, value, profile: Profile, match: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InvalidCommandError, match=match):
        word(value, profile)


@pytest.mark.parametrize(("x_mm", "y_mm"), [(-1, 0), (0, -0.5), (1e9, 0), (float("inf"), 0), (None, 0)])
def test_a_way_out_of_range_is_refused(x_mm: float, y_mm: float) -> None:
    with pytest.raises(InvalidCommandError, match=r"[xy]_mm"):
        travel(x_mm, y_mm, PNC_900)


@given(st.lists(st.tuples(st.integers(0, 200), st.integers(0, 200)), min_size=2, max_size=100))
def test_a_line_goes_through_its_points_and_can_be_cut(points: list[tuple[int, int]]) -> None:
    worded = cut(points, PNC_900)
    ways = segments(worded)
    assert [(x, y) for _, _, x, y, _ in ways] == [(x * 40, y * 40) for x, y in points]
    assert [is_down for *_, is_down in ways] == [False, *[True] * (len(points) - 1)]
    assert check(worded, PNC_900) == ()
    assert max(map(len, worded.split(b";"))) <= 240


@pytest.mark.parametrize("points", [[], [(1, 1)]])
def test_one_point_is_no_line(points: list[tuple[float, float]]) -> None:
    with pytest.raises(InvalidCommandError, match="two points at least"):
        cut(points, PNC_900)


def test_settings_of_a_job_are_worded_together() -> None:
    assert JobSettings(speed_cm_s=5, force_gf=80, tool=1).worded(GS_24) == b"!ST1;VS5;!FS80;"
    assert JobSettings().worded(PNC_1610) == b""


def test_one_bad_setting_refuses_all() -> None:
    with pytest.raises(InvalidCommandError, match="from 1 to 50"):
        JobSettings(speed_cm_s=60, tool=1).worded(GS_24)
