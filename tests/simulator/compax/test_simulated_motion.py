"""A planned motion keeps its limits, and ends exactly where it was told to."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compax_aio.simulator.compax.motion import Profile, SpeedStep, plan, ramp

SPEEDS = st.floats(0.1, 2000)
RAMPS = st.floats(1, 1e6)
LENGTHS = st.floats(0.01, 1e5)
SHARES = st.floats(0, 1)


@st.composite
def profiles(draw: st.DrawFn) -> tuple[Profile, float, tuple[SpeedStep, ...], float]:
    """Draw a profile, its speed, its steps and its deceleration."""
    length, speed, deceleration = draw(LENGTHS), draw(SPEEDS), draw(RAMPS)
    steps = tuple(
        SpeedStep(share * length, step_speed)
        for share, step_speed in draw(st.lists(st.tuples(st.floats(0.01, 1.5), SPEEDS), max_size=8))
    )
    profile = plan(
        start=draw(st.floats(0, 1e4)),
        length=length,
        speed=speed,
        acceleration=draw(RAMPS),
        deceleration=deceleration,
        steps=steps,
        travelled=draw(st.one_of(st.just(0.0), SHARES)) * length,
    )
    return profile, speed, steps, deceleration


def times(profile: Profile, count: int = 60) -> list[float]:
    """List times from before the start to after the end."""
    spread = profile.end - profile.start
    return [profile.start + spread * i / count for i in range(-2, count + 3)]


@given(profiles())
def test_a_motion_ends_at_its_target(drawn: tuple[Profile, float, tuple[SpeedStep, ...], float]) -> None:
    profile, *_ = drawn
    assert math.isfinite(profile.end)
    assert profile.distance(profile.end) == profile.end_distance
    assert profile.distance(profile.start) == pytest.approx(profile.start_distance, abs=1e-9)
    assert profile.speed(profile.end) == 0


@given(profiles())
def test_a_motion_only_goes_forward(drawn: tuple[Profile, float, tuple[SpeedStep, ...], float]) -> None:
    profile, *_ = drawn
    distances = [profile.distance(at) for at in times(profile)]
    assert distances == sorted(distances)
    assert distances[0] == pytest.approx(profile.start_distance, abs=1e-9)


@given(profiles())
def test_a_motion_is_never_faster_than_it_was_told(
    drawn: tuple[Profile, float, tuple[SpeedStep, ...], float],
) -> None:
    profile, speed, steps, _ = drawn
    limit = max(speed, *(step.speed for step in steps)) if steps else speed
    assert all(0 <= profile.speed(at) <= limit * (1 + 1e-6) for at in times(profile))


@given(profiles())
def test_the_segments_of_a_motion_join(drawn: tuple[Profile, float, tuple[SpeedStep, ...], float]) -> None:
    profile, *_ = drawn
    for one, following in zip(profile.segments, profile.segments[1:], strict=False):
        assert one.start + one.duration == pytest.approx(following.start)
        assert one.distance_after(one.duration) == pytest.approx(following.distance, abs=1e-6)
        assert one.speed_after(one.duration) == pytest.approx(following.speed, rel=1e-4, abs=1e-3)


@given(profiles(), SHARES)
def test_the_time_at_a_distance_is_the_inverse_of_the_distance_at_a_time(
    drawn: tuple[Profile, float, tuple[SpeedStep, ...], float], share: float
) -> None:
    profile, *_ = drawn
    distance = profile.start_distance + share * (profile.end_distance - profile.start_distance)
    assert profile.distance(profile.time_at(distance)) == pytest.approx(distance, rel=1e-6, abs=1e-6)


@given(profiles(), SHARES, RAMPS)
def test_a_stop_ends_at_or_before_the_target_and_changes_nothing_before(
    drawn: tuple[Profile, float, tuple[SpeedStep, ...], float], share: float, deceleration: float
) -> None:
    profile, *_ = drawn
    at = profile.start + share * (profile.end - profile.start)
    stopped = profile.stopped(at, deceleration)
    assert profile.distance(at) <= stopped.end_distance <= profile.end_distance * (1 + 1e-12)
    assert stopped.end >= at
    assert stopped.distance(stopped.end) == stopped.end_distance
    for i in range(10):
        before = profile.start + (at - profile.start) * i / 10
        assert stopped.distance(before) == pytest.approx(profile.distance(before), abs=1e-9)
    distances = [stopped.distance(time) for time in times(stopped)]
    assert distances == sorted(distances)


def test_acceleration_time_is_from_standstill_to_nominal_speed() -> None:
    """IBS p. 48: the real ramp time scales with the speed."""
    acceleration = ramp(200, 250)
    profile = plan(start=0, length=100, speed=100, acceleration=acceleration, deceleration=acceleration)
    assert [segment.duration for segment in profile.segments] == pytest.approx([0.125, 0.875, 0.125])
    assert profile.end == pytest.approx(1.125)


def test_a_short_motion_is_a_triangle() -> None:
    profile = plan(start=0, length=1, speed=1000, acceleration=4, deceleration=4)
    assert [segment.duration for segment in profile.segments] == pytest.approx([0.5, 0.5])
    assert profile.speed(0.5) == pytest.approx(2)
    assert (profile.acceleration(0.2), profile.acceleration(0.7)) == pytest.approx((4, -4))
    assert profile.acceleration(2) == 0


def test_no_way_takes_no_time() -> None:
    profile = plan(start=3, length=0, speed=1, acceleration=1, deceleration=1)
    assert (profile.end, profile.distance(3), profile.segments) == (3, 0, ())


def test_acceleration_in_no_time_is_merely_very_steep() -> None:
    assert ramp(200, 0) == 200 / 0.0001


def test_speed_begins_to_change_at_the_distance_of_a_step() -> None:
    profile = plan(
        start=0,
        length=1000,
        speed=100,
        acceleration=100,
        deceleration=200,
        steps=(SpeedStep(600, 150), SpeedStep(300, 50), SpeedStep(2000, 999)),
    )
    assert profile.speed(profile.time_at(300)) == pytest.approx(100)
    assert profile.speed(profile.time_at(599)) == pytest.approx(50)
    assert profile.speed(profile.time_at(800)) == pytest.approx(150)


def test_a_step_behind_the_point_of_braking_changes_nothing() -> None:
    steps = (SpeedStep(99.9, 50),)
    plain = plan(start=0, length=100, speed=10, acceleration=10, deceleration=10)
    assert plan(start=0, length=100, speed=10, acceleration=10, deceleration=10, steps=steps) == plain


def test_a_stop_never_passes_the_target() -> None:
    """Braking for the target already, and P10 longer than ACCEL-: the target is nearer than the stop ramp."""
    profile = plan(start=0, length=100, speed=100, acceleration=1000, deceleration=1000)
    stopped = profile.stopped(profile.end - 0.05, 10)
    assert stopped.end_distance == 100
    assert stopped.end == pytest.approx(profile.end)


def test_a_stop_before_the_start_or_after_the_end_leaves_the_axis_where_it_is() -> None:
    profile = plan(start=1, length=100, speed=100, acceleration=1000, deceleration=1000)
    assert profile.stopped(1, 10).end_distance == 0
    assert profile.stopped(profile.end + 5, 10).end_distance == 100
