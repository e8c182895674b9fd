"""The axis goes where it is told, along a trapezoid, and its status is true at every moment."""

from __future__ import annotations

import math
from typing import Any

import pytest
from tests.simulator.smc.host import Host

from compax_aio.simulator.smc import LogKind
from compax_aio.simulator.smc.motion import Course, Ramps, constant, index, standing
from compax_aio.smc.facts import MotionFlags

RAMPS = Ramps(base=100, up=1000, down=2000)


# Planning


def test_an_index_ramps_up_cruises_and_ramps_down() -> None:
    course = index(1.0, 50.0, 0.0, target=1050.0, speed=500, ramps=RAMPS)
    up, cruise, down = course.legs
    assert (up.speed, up.end_speed) == (100, 500)
    assert up.end - up.start == pytest.approx(0.4)
    assert (cruise.speed, cruise.end_speed) == (500, 500)
    assert (down.speed, down.end_speed) == (500, 100)
    assert down.end - down.start == pytest.approx(0.2)
    assert up.end_position == 50 + (500**2 - 100**2) / 2000
    assert course.end_position == 1050
    assert course.position_at(0) == 50
    assert course.position_at(math.inf) == 1050
    assert course.speed_at(1.2) == pytest.approx(300)


def test_an_index_too_short_for_its_speed_has_a_lower_peak() -> None:
    course = index(0.0, 0.0, 0.0, target=-50.0, speed=500, ramps=RAMPS)
    assert [leg.ramping for leg in course.legs] == [True, True]
    assert -500 < course.legs[0].end_speed < -100
    assert course.end_position == -50


@pytest.mark.parametrize("target", [0.01, 1, 3, 50, 1e6, -0.01, -7.25, 8_388_607.99])
@pytest.mark.parametrize("speed", [20, 100, 101, 20_000])
def test_an_index_ends_exactly_at_its_target_and_never_goes_back(target: float, speed: float) -> None:
    course = index(0.0, 0.0, 0.0, target=target, speed=speed, ramps=RAMPS)
    assert course.end_position == target
    places = [abs(course.position_at(course.end * part / 200)) for part in range(201)]
    assert places == sorted(places)
    speeds = [abs(course.speed_at(course.end * part / 200)) for part in range(200)]
    assert max(speeds) <= speed * (1 + 1e-9)


def test_no_slope_means_no_ramp() -> None:
    steep = Ramps(base=100, up=math.inf, down=math.inf)
    course = index(0.0, 0.0, 0.0, target=1000.0, speed=500, ramps=steep)
    assert [leg.ramping for leg in course.legs] == [False]
    assert course.end == pytest.approx(2)
    assert constant(0.0, 0.0, 500.0, 0.0, steep).end == 0


def test_an_index_of_no_length_is_over_at_once() -> None:
    assert index(3.0, 7.0, 0.0, target=7.0, speed=500, ramps=RAMPS) == standing(3.0, 7.0)


def test_an_index_of_a_moving_axis_begins_with_a_stop() -> None:
    course = index(0.0, 0.0, 500.0, target=-10.0, speed=500, ramps=RAMPS)
    assert course.legs[0].end_speed == 100
    assert course.legs[1].speed == -100
    assert course.end_position == -10


def test_another_speed_in_the_same_direction_is_one_ramp() -> None:
    course = constant(0.0, 0.0, 500.0, 300.0, RAMPS)
    assert [(leg.speed, leg.end_speed) for leg in course.legs] == [(500, 300), (300, 300)]
    assert course.steady_at == pytest.approx(0.1)
    assert math.isinf(course.end)


def test_another_direction_leads_by_way_of_a_stop() -> None:
    course = constant(0.0, 0.0, 500.0, -300.0, RAMPS)
    assert [(leg.speed, leg.end_speed) for leg in course.legs] == [(500, 100), (-100, -300), (-300, -300)]


def test_a_speed_below_the_initial_one_is_there_at_once() -> None:
    assert [(leg.speed, leg.end_speed) for leg in constant(0.0, 0.0, 0.0, 50.0, RAMPS).legs] == [(50, 50)]
    assert [(leg.speed, leg.end_speed) for leg in constant(0.0, 0.0, 60.0, 50.0, RAMPS).legs] == [(50, 50)]
    assert [(leg.speed, leg.end_speed) for leg in constant(0.0, 0.0, 200.0, 50.0, RAMPS).legs] == [(200, 100), (50, 50)]
    assert constant(0.0, 0.0, 50.0, 0.0, RAMPS).end == 0


def test_a_course_can_be_cut_on_a_ramp_on_a_cruise_or_before_it_begins() -> None:
    course = index(0.0, 0.0, 0.0, target=1000.0, speed=500, ramps=RAMPS)
    for bound in (60.0, 500.0, 990.0):
        cut = course.within(-math.inf, bound)
        assert cut.end_position == bound
        assert course.position_at(cut.end) == pytest.approx(bound)
    assert course.within(-math.inf, 1000.0) is course
    assert course.within(0.0, math.inf) is course
    assert course.within(-math.inf, -5.0).legs == ()
    assert course.within(-math.inf, 120.0).end_position == 120  # where a leg ends
    back = index(0.0, 20.0, 0.0, target=-1000.0, speed=500, ramps=RAMPS).within(-30.0, 10.0)
    assert back.end_position == -30


def test_a_course_that_stands_is_nowhere_else() -> None:
    course = Course(1.0, 5.0, ())
    assert (course.end, course.end_position, course.steady_at, course.speed_at(2)) == (1, 5, 1, 0)


# Commands


def test_plus_and_minus_are_relative_and_r_is_absolute() -> None:
    host = Host()
    for text, position in (("+100", 100), ("+50", 150), ("-200", -50), ("R30", 30), ("R-30", -30), ("R -7", -7)):
        host.command("A", text, 5)
        assert host.axis.position == position
    assert host.motions()[:4] == ["+100 at 0", "target at 100", "+50 at 100", "target at 150"]


def test_position_is_between_where_it_was_and_where_it_goes() -> None:
    host = Host()
    host.command("A", "R1000", 0.01)
    positions = []
    while host.axis.moving:
        positions.append(host.axis.position)
        host.wait(0.01)
    assert positions == sorted(positions)
    assert len(set(positions)) > 20
    assert 0 <= positions[0] < positions[-1] <= 1000


def status(host: Host) -> MotionFlags:
    flags = MotionFlags(int(host.number("A", "^")))
    assert flags == host.axis.flags
    return flags


def slow(**knobs: Any) -> Host:
    """An axis that ramps for 4 s and more."""
    return Host(slope_unit=5000.0, **knobs)


def test_status_of_an_index() -> None:
    host = slow()
    assert status(host) == 0
    host.command("A", "R30000")
    assert status(host) == 33
    host.wait(6)
    assert status(host) == MotionFlags.MOVING
    host.command("A", "@")
    assert status(host) == 33
    host.wait(10)
    assert status(host) == 0
    assert host.motions()[-1].startswith("stop at ")


def test_status_at_constant_speed() -> None:
    host = slow()
    host.command("A", "M1000")
    assert status(host) == 35
    host.wait(6)
    assert status(host) == 3
    assert host.axis.speed == 1000
    host.command("A", "M-1000", 30)
    assert host.axis.speed == -1000
    host.command("A", "M0", 10)
    assert status(host) == 0
    assert host.axis.position == round(host.axis.position)
    assert host.motions()[-1].startswith("target")


def test_m0_moves_nothing_that_stands() -> None:
    host = Host()
    host.command("A", "M0")
    assert host.motions() == []


def test_an_index_during_constant_speed_stops_first() -> None:
    host = Host()
    host.command("A", "M2000", 2)
    host.command("A", "R100", 10)
    assert host.axis.position == 100
    assert [each.split()[0] for each in host.motions()] == ["M2000", "R100", "target"]


def test_status_while_homing_on_a_ramp_is_43() -> None:
    host = slow(home=20_000, home_width=100)
    host.command("A", "F2000 0")
    assert status(host) == 43
    host.wait(4)
    assert status(host) == 11
    host.wait(30)
    assert status(host) == 0
    assert host.axis.position == 19_950
    assert host.number("A", "]1") == 1
    assert host.number("A", "]") == 0
    assert host.motions() == ["F2000 0 at 0", "target at 19950"]


@pytest.mark.parametrize(
    ("home_plus", "home", "text", "position"),
    [(0, 500, "F1000,0", 495), (0, -500, "F1000,1", -495), (1, 500, "F1000,1", 495), (1, -500, "F1000,0", -495)],
)
def test_home_lies_in_the_direction_that_the_knob_says(home_plus: int, home: float, text: str, position: float) -> None:
    host = Host(home_plus=home_plus, home=home)
    host.command("A", text, 5)
    assert host.axis.position == position
    assert host.number("A", "]1") == 1


def test_home_that_is_there_already_is_found_at_once() -> None:
    host = Host(home=3)
    host.command("A", "F1000")
    assert host.motions() == ["F1000 at 0", "target at 0"]


def test_home_on_the_other_side_is_never_found() -> None:
    host = Host(home=-500, limit_max=900)
    host.command("A", "F1000", 100)
    assert host.axis.position == 900
    assert host.motions() == ["F1000 at 0", "limit at 900"]
    host.command("A", "F1000 1", 100)
    assert host.axis.position == -495


def test_homing_a_moving_axis_stops_it_first() -> None:
    host = Host(home=-500)
    host.command("A", "M2000", 2)
    host.command("A", "F1000 1", 10)
    assert host.axis.position == -495


def until_it_stands(host: Host) -> None:
    while host.axis.moving:
        host.wait(0.01)


def test_hunting_after_a_move() -> None:
    host = Host(hunt_time_s=1.0)
    host.command("A", "R100", 0.01)
    until_it_stands(host)
    assert status(host) == 16
    host.wait(1)
    assert int(host.number("A", "^")) == 0
    host.command("A", "R0", 0.01)
    until_it_stands(host)
    host.send(b"\x1b")
    assert int(host.number("A", "^")) == 0


def test_there_is_no_hunting_after_a_motion_that_was_stopped_or_was_no_move() -> None:
    host = Host(hunt_time_s=5.0, home=200)
    host.command("A", "R5000", 0.5)
    host.command("A", "@", 1)
    assert status(host) == 0
    host.command("A", "M500", 1)
    host.command("A", "M0", 1)
    assert status(host) == 0
    host.command("A", "R0", 3)
    assert status(host) == 16
    host.command("A", "F500", 3)
    assert status(host) == 0


# Limits


@pytest.mark.parametrize(("bits", "plus", "minus"), [("ims", 1, 2), ("panther", 2, 1), ("789a", 64, 128)])
def test_a_limit_stops_and_lets_go_back(bits: str, plus: int, minus: int) -> None:
    host = Host(limit_min=-100, limit_max=100, limit_bits=bits)
    host.command("A", "R200", 5)
    assert (host.axis.position, host.number("A", "]")) == (100, plus)
    host.command("A", "+50", 5)
    assert host.axis.position == 100
    host.command("A", "R0", 5)
    assert (host.axis.position, host.number("A", "]0")) == (0, 0)
    host.command("A", "M-1000", 5)
    assert (host.axis.position, host.number("A", "]")) == (-100, minus)
    assert host.motions() == [
        "R200 at 0",
        "limit at 100",
        "+50 at 100",
        "limit at 100",
        "R0 at 100",
        "target at 0",
        "M-1000 at 0",
        "limit at -100",
    ]


def test_a_789a_says_moving_in_its_limits_and_home_after_a8_alone() -> None:
    host = Host(limit_bits="789a")
    assert host.number("A", "]") == 0
    host.command("A", "A8")
    assert host.number("A", "]") == 32
    host.command("A", "M1000", 0.1)
    assert host.number("A", "]") == 2
    assert host.number("A", "]1") == 2


def test_limit_switches_of_the_wrong_polarity_let_nothing_move() -> None:
    host = Host(limit_level=1, limit_max=100)
    assert host.number("A", "]") == 3
    host.command("A", "R10", 5)
    assert host.motions() == ["R10 at 0", "limit at 0"]
    host.command("A", "l1")
    host.command("A", "R1000", 5)
    assert host.axis.position == 100
    host.command("A", "l0")
    assert host.number("A", "]") == 2


def test_limits_and_home_stay_where_they_are_when_the_origin_does_not() -> None:
    host = Host(limit_max=100, home=-50)
    host.command("A", "R60", 5)
    host.command("A", "O")
    assert host.number("A", "Z") == 0
    host.command("A", "R100", 5)
    assert (host.axis.position, host.axis.place) == (40, 100)
    host.command("A", "F1000 1", 5)
    assert (host.axis.position, host.axis.place) == (-105, -45)


# One action after the other


def test_a_second_action_waits_and_its_terminator_with_it() -> None:
    host = Host()
    host.command("A", "V1000")
    host.command("A", "R5000", 0.01)
    host.type(b"\n", 0.01)
    assert host.echoed(b"AR100") == b"AR100"
    assert host.send(b"\n", 4) == b""
    assert host.texts(LogKind.QUEUED) == ["R100"]
    assert host.texts(LogKind.COMMAND) == ["V1000", "R5000"]
    assert host.wait(1.5) == b"\n"
    host.wait(10)
    assert host.motions() == ["R5000 at 0", "target at 5000", "R100 at 5000", "target at 100"]


def test_what_waits_hears_nothing_but_esc_and_reset() -> None:
    host = Host(axes="AB")
    host.command("A", "R5000", 0.01)
    host.type(b"\nAR100\n", 0.01)
    assert host.type(b"\nA^\nA^\n", 0.01) == b""
    assert host.command("B", "^") == "         0"
    host.send(b"\x1b")
    assert host.command("A", "^") == "         0"
    assert host.wait(60) == b""
    assert [each.split()[0] for each in host.motions()] == ["R5000", "abort"]


def test_commands_that_are_no_actions_work_meanwhile() -> None:
    host = Host()
    host.command("A", "R5000")
    assert host.number("A", "Z") > 0
    host.command("A", "V1000")
    assert host.axis.parameters.slew_speed == 1000
    assert host.axis.moving
    assert host.texts(LogKind.QUEUED) == []


def test_resolution_is_an_action() -> None:
    host = Host()
    host.command("A", "R1000")
    host.type(b"\nAD2\n", 0.01)
    assert host.texts(LogKind.QUEUED) == ["D2"]
    assert host.axis.parameters.resolution == 4
    host.wait(10)
    assert host.axis.parameters.resolution == 2


def test_a_constant_speed_is_over_as_an_action_when_it_is_reached() -> None:
    host = slow()
    host.command("A", "M1000", 0.5)
    host.type(b"\nAM2000\n", 0.01)
    assert host.texts(LogKind.QUEUED) == ["M2000"]
    assert host.wait(3) == b"\n"
    host.wait(10)
    assert host.axis.speed == 2000
    host.command("A", "M3000")
    assert host.texts(LogKind.QUEUED) == ["M2000"]


def test_a_second_action_is_refused_if_the_knob_says_so() -> None:
    host = Host(second_action="reject", unknown="?")
    host.command("A", "R5000")
    assert host.command("A", "R100") == "?"
    assert host.texts(LogKind.REFUSED) == ["R100"]
    host.wait(10)
    assert host.axis.position == 5000


def test_what_waits_behind_a_soft_stop_begins_when_the_axis_stands() -> None:
    host = slow()
    host.command("A", "R50000", 5)
    host.command("A", "@", 0.01)
    host.type(b"\nAR0\n", 0.01)
    assert host.texts(LogKind.QUEUED) == ["R0"]
    host.wait(100)
    assert host.axis.position == 0
    assert [each.split()[0] for each in host.motions()] == ["R50000", "stop", "R0", "target"]


def test_waiting_for_the_end_of_motion_and_for_a_time() -> None:
    host = Host()
    host.command("A", "R5000")
    host.type(b"\nAW0\n", 0.01)
    assert host.texts(LogKind.QUEUED) == ["W0"]
    assert host.wait(10) == b"\n"
    host.type(b"\n", 0.01)
    assert host.echoed(b"AW50") == b"AW50"
    assert host.send(b"\n", 0.49) == b""
    assert host.wait(0.02) == b"\n"
    assert host.command("A", "W0") == ""
    assert host.command("A", "J0 5") == ""


def test_esc_stands_at_once_on_all_axes() -> None:
    host = Host(axes="AB")
    host.command("A", "M2000")
    host.command("B", "R-5000")
    host.wait(0.3333)
    host.send(b"\x1b", 0.01)
    assert not any(axis.moving for axis in host.line.axes.values())
    for axis in host.line.axes.values():
        assert axis.position == round(axis.position) != 0
    assert [each.split()[0] for each in host.motions()] == ["M2000", "R-5000", "abort", "abort"]
    assert host.texts(LogKind.ABORT) == ["", ""]


def test_a_soft_stop_of_an_axis_that_stands_does_nothing() -> None:
    host = Host()
    assert host.command("A", "@ 0") == ""
    assert host.motions() == []


def test_the_origin_can_be_set_on_the_way() -> None:
    host = Host()
    host.command("A", "R1000", 0.2)
    before = host.axis.place
    host.command("A", "O", 5)
    assert host.axis.place == 1000
    assert host.axis.position < 1000 - before
    assert host.axis.position == round(host.axis.position)


def test_a_jog_moves_unasked_and_an_action_waits_for_it() -> None:
    host = Host()
    host.axis.jog(1000, host.now)
    assert host.axis.moving
    host.axis.jog(77, host.now)
    host.type(b"\nAR0\n", 0.01)
    assert host.texts(LogKind.QUEUED) == ["R0"]
    host.wait(10)
    assert host.motions() == ["jog at 0", "target at 1000", "R0 at 1000", "target at 0"]
