"""``POSR 0 SPEED v``: the positioning that runs goes on at another speed, and ends where it was told to."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.simulator.compax.terminal import PROMPT, Terminal

from compax_aio.simulator.compax import LogKind
from compax_aio.simulator.compax.axis import Axis, Comparator, ComparatorPassed, Move, Outcome
from compax_aio.simulator.compax.motion import SpeedStep, plan

ROUNDING = 1e-9
"""In units: what floating-point numbers of a way of some hundred units lose, many times over."""


@pytest.fixture
def terminal() -> Terminal:
    """A drive with 200 mm/s at 100 %, ramps of 250 ms."""
    return Terminal()


def speed_percent(terminal: Terminal) -> float:
    return float(terminal.ask("S4").split()[1])


def reached_at(terminal: Terminal) -> float:
    return [entry.at for entry in terminal.drive.log if entry.kind is LogKind.MOTION_REACHED][-1]


@pytest.mark.parametrize("line", ["POSR 0 SPEED 30", "PR0 SD30", "PR 0.00 SD 30"])
def test_the_move_under_way_goes_on_at_another_speed(terminal: Terminal, line: str) -> None:
    terminal.say("PA 1000$")
    terminal.wait(1)
    assert terminal.say(line) == PROMPT
    terminal.wait(0.3)
    assert speed_percent(terminal) == 30
    assert terminal.drive.log.texts(LogKind.SPEED_CHANGED) == ["30"]
    assert terminal.wait(30) == b"$\r\n>"
    assert terminal.ask("S1") == "S001: 1000.00"


def test_the_change_takes_the_ramps_of_the_move(terminal: Terminal) -> None:
    """Half of nominal speed takes half of ACCEL up, and half of ACCEL- down (IBS p. 48)."""
    for line in ("AL 1000", "AL- 400", "SD 50", "PA 1000"):
        terminal.say(line)
    terminal.wait(2)
    terminal.say("PR 0 SD 100", then_wait_s=0.002)
    terminal.wait(0.25)
    assert speed_percent(terminal) == pytest.approx(75, abs=0.5)
    terminal.wait(0.5)
    assert speed_percent(terminal) == 100
    terminal.say("PR 0 SD 50", then_wait_s=0.002)
    terminal.wait(0.1)
    assert speed_percent(terminal) == pytest.approx(75, abs=0.5)


def test_the_next_move_has_its_own_speed_again(terminal: Terminal) -> None:
    terminal.say("SD 80")
    terminal.say("PA 500", 1)
    terminal.say("PR 0 SD 10", 1)
    assert speed_percent(terminal) == 10
    terminal.wait(100)
    terminal.say("PA 0", 1)
    assert speed_percent(terminal) == -80


def test_speed_steps_ahead_stay_and_those_behind_are_overruled(terminal: Terminal) -> None:
    for line in ("PR 50 SD 40", "PR 600 SD 20", "PA 1000"):
        terminal.say(line)
    terminal.wait(2)
    assert speed_percent(terminal) == 40
    terminal.say("PR 0 SD 100", 1)
    assert speed_percent(terminal) == 100
    terminal.wait(2.5)
    assert terminal.drive.position > 600
    assert speed_percent(terminal) == 20


def test_comparators_ahead_speak_once_when_they_are_passed(terminal: Terminal) -> None:
    for line in ("PR 100 OT O1=1", "PR 400 OT O2=1"):
        terminal.say(line)
    assert terminal.say("PA 500$", 1) == PROMPT + b"1\r\n>"
    assert terminal.say("PR 0 SD 10", 5) == PROMPT
    assert terminal.wait(60) == b"2\r\n>$\r\n>"
    assert terminal.drive.log.texts(LogKind.OUTPUT) == ["O1=1", "O2=1"]


def test_a_change_that_comes_while_it_brakes_for_its_target_changes_nothing() -> None:
    ends = []
    for line in ("S4", "PR 0 SD 100", "PR 0 SD 600", "PR 0 SD 1"):
        terminal = Terminal()
        for each in ("AL- 4000", "SD 100", "PA 500"):
            terminal.say(each)
        terminal.wait(3)
        assert speed_percent(terminal) < 90
        terminal.say(line)
        terminal.wait(60)
        ends.append(reached_at(terminal))
    assert ends == pytest.approx([ends[0]] * 4, abs=0.05)
    assert ends[:3] == pytest.approx([ends[0]] * 3, abs=1e-6)


def test_without_a_positioning_there_is_nothing_to_change(terminal: Terminal) -> None:
    assert terminal.ask("PR 0 SD 50") == "E85"
    terminal.say("PA 10", 5)
    assert terminal.ask("PR 0 SD 50") == "E85"
    assert terminal.drive.prepared_points == 0
    assert terminal.drive.log.texts(LogKind.SPEED_CHANGED) == []


@pytest.mark.parametrize("line", ["PR 0 SD 1.5", "PR 0 SD 0", "PR 0 SD 601", "PR 0 SD 50 AL 100", "PR 0 OT O1=1"])
def test_what_no_speed_step_may_say_a_change_may_not_either(terminal: Terminal, line: str) -> None:
    """UG p. 101: no decimals; that this holds here, too, is inferred."""
    terminal.say("PA 100")
    assert terminal.ask(line) == "E91"


@pytest.mark.parametrize("line", ["PR 0 SD 50$", "PR 0 SD", "PR 0 SD x"])
def test_a_change_of_speed_takes_no_sign_but_those_of_every_command(terminal: Terminal, line: str) -> None:
    terminal.say("PA 100")
    assert terminal.ask(line) == "E90"


def test_a_change_can_wait_in_the_intermediate_memory(terminal: Terminal) -> None:
    assert terminal.ask("PR 0 SD 50,") == ""
    terminal.say("PA 500", 1)
    assert speed_percent(terminal) == 100
    assert terminal.ask("!") == ""
    terminal.wait(0.5)
    assert speed_percent(terminal) == 50


def test_start_continues_at_the_changed_speed(terminal: Terminal) -> None:
    terminal.say("PA 1000$", 1)
    terminal.say("PR 0 SD 40", 1)
    terminal.say("STOP", 1)
    assert terminal.ask("PR 0 SD 10") == "E85"
    terminal.say("START", 1)
    assert speed_percent(terminal) == 40
    assert terminal.wait(60) == b"$\r\n>"


def test_a_change_on_the_stop_ramp_is_for_what_start_continues(terminal: Terminal) -> None:
    terminal.say("PA 1000$", 1)
    terminal.say("STOP")
    stopping = speed_percent(terminal)
    assert terminal.say("PR 0 SD 60", then_wait_s=0.004) == PROMPT
    assert 0 < speed_percent(terminal) < stopping
    terminal.wait(1)
    assert not terminal.drive.moving
    terminal.say("START", 1)
    assert speed_percent(terminal) == 60
    assert terminal.wait(60) == b"$\r\n>"


@pytest.mark.parametrize("how", ["BREAK", "fault"])
def test_what_is_broken_off_does_not_change_its_speed(terminal: Terminal, how: str) -> None:
    terminal.say("PA 1000", 1)
    if how == "fault":
        terminal.drive.raise_fault(55)
    else:
        terminal.say(how)
    assert terminal.drive.moving
    assert terminal.ask("PR 0 SD 100") == "E85"


def test_homing_and_moves_of_the_program_change_their_speed_too() -> None:
    terminal = Terminal(machine_zero=500)
    terminal.say("PH", 1)
    terminal.say("PR 0 SD 5", 1)
    assert speed_percent(terminal) == 5
    terminal.wait(100)
    assert terminal.drive.homed
    terminal.drive.load_program(["POSA 500", "OUTPUT O1=1"])
    terminal.say("START", 1)
    terminal.say("PR 0 SD 7", 1)
    assert speed_percent(terminal) == 7
    terminal.wait(100)
    assert terminal.drive.outputs[1]


def test_a_record_cannot_change_the_speed_of_a_move_it_waits_for(terminal: Terminal) -> None:
    assert terminal.ask("N1 PR 0 SD 50") == "E90"


def test_many_changes_take_no_more_memory_than_a_few(terminal: Terminal) -> None:
    terminal.say("PA 100000")
    for i in range(500):
        terminal.say(f"PR 0 SD {10 + i % 90}", 0.5)
    move, profile = terminal.drive._machine.axis.move, terminal.drive._machine.axis._profile
    assert move is not None
    assert profile is not None
    assert len(move.steps) == 1
    assert len(profile.segments) < 10


# Whatever is changed when

SPEEDS = st.floats(0.5, 500)
RAMPS = st.floats(5, 5000)
CHANGES = st.lists(st.tuples(st.floats(0, 0.999), SPEEDS), max_size=5)


@st.composite
def moves(draw: st.DrawFn) -> Move:
    length = draw(st.floats(1, 2000))
    return Move(
        word="POSA",
        origin=draw(st.sampled_from([0.0, 37.5])),
        target=draw(st.sampled_from([-1, 1])) * length,
        speed=draw(SPEEDS),
        acceleration=draw(RAMPS),
        deceleration=draw(RAMPS),
        steps=tuple(
            SpeedStep(share * length, speed, own)
            for share, speed, own in draw(
                st.lists(st.tuples(st.floats(0.01, 1.2), SPEEDS, st.none() | RAMPS), max_size=4)
            )
        ),
        comparators=tuple(
            Comparator(number, share * length, 1, True)
            for number, share in enumerate(draw(st.lists(st.floats(0.01, 1.2), max_size=4)), 1)
        ),
    )


def travel(move: Move, changes: list[tuple[float, float]], lag_s: float) -> tuple[list[float], list[Comparator]]:
    """Move an axis, changing its speed after shares of the time that is left; return what it did in order."""
    axis = Axis(move.origin, lag_s)
    axis.start(move, 0.0)
    now, seen, passed = 0.0, [move.origin], []
    for share, speed in [*changes, (1.0, None)]:
        if axis._profile is not None:
            now += share * (axis._profile.end - now)
        while (at := axis.next_event_at()) is not None and (at <= now or speed is None):
            seen.append(axis.position(at))
            event = axis.step()
            if isinstance(event, ComparatorPassed):
                passed.append(event.comparator)
        seen.append(axis.position(now))
        if speed is not None and axis.move is not None:  # else it was so near that the next float is the target
            axis.change_speed(speed, now)
    assert axis.move is None
    return seen, passed


@given(moves(), CHANGES, st.sampled_from([0.0, 0.001, 0.7]))
def test_a_move_ends_exactly_at_its_target_however_its_speed_is_changed(
    move: Move, changes: list[tuple[float, float]], lag_s: float
) -> None:
    seen, passed = travel(move, changes, lag_s)
    assert seen[-1] == move.target
    way = [(there - here) * (move.target - move.origin) for here, there in pairwise(seen)]
    assert min(way) >= -ROUNDING * abs(move.target - move.origin), "it never goes back"
    due = [each for each in move.comparators if each.distance <= move.length]
    assert passed == sorted(due, key=lambda each: (each.distance, each.number))


@given(moves(), st.floats(0, 0.999), SPEEDS, st.sampled_from([0.0, 0.3]))
def test_position_and_speed_never_jump_when_the_speed_is_changed(
    move: Move, share: float, speed: float, lag_s: float
) -> None:
    axis = Axis(move.origin, lag_s)
    axis.start(move, 0.0)
    assert axis._profile is not None
    now = share * axis._profile.end
    set_to, is_at, goes = axis.setpoint(now), axis.position(now), axis.speed(now)
    axis.change_speed(speed, now)
    assert axis.setpoint(now) == pytest.approx(set_to, abs=1e-6)
    assert axis.position(now) == pytest.approx(is_at, abs=1e-6)
    assert axis.speed(now) == pytest.approx(goes, rel=1e-3, abs=0.02)
    fastest = max(move.speed, speed, *(step.speed for step in move.steps), 0)
    profile = axis._profile
    for i in range(60):
        at = profile.start + (profile.end - profile.start) * i / 60
        assert 0 <= profile.speed(at) <= fastest * (1 + 1e-6)
    for one, following in zip(profile.segments, profile.segments[1:], strict=False):
        assert one.start + one.duration == pytest.approx(following.start)
        assert one.distance_after(one.duration) == pytest.approx(following.distance, rel=1e-6, abs=1e-6)
        assert one.speed_after(one.duration) == pytest.approx(following.speed, rel=1e-3, abs=0.02)


@given(moves(), CHANGES, st.sampled_from([0.0, 0.7]))
def test_a_stop_after_changes_ends_on_the_way(move: Move, changes: list[tuple[float, float]], lag_s: float) -> None:
    axis = Axis(move.origin, lag_s)
    axis.start(move, 0.0)
    assert axis._profile is not None
    now = 0.0
    for share, speed in changes:
        now += share * (axis._profile.end - now)
        axis.change_speed(speed, now)
    distance = axis._profile.distance(now)
    before = axis.position(now)
    axis.stop(now, move.deceleration, Outcome.STOPPED)
    assert axis.position(now) == pytest.approx(before, abs=1e-6)
    axis.change_speed(5, now)
    assert distance <= axis._profile.end_distance <= move.length * (1 + 1e-12)


def test_a_speed_step_may_have_a_ramp_of_its_own() -> None:
    """IBS p. 43."""
    profile = plan(
        start=0,
        length=1000,
        speed=100,
        acceleration=1000,
        deceleration=1000,
        steps=(SpeedStep(300, 50, 20), SpeedStep(600, 150, 40)),
    )
    down, up = profile.time_at(300), profile.time_at(600)
    assert profile.acceleration(down + 0.1) == -20
    assert profile.speed(down + 1) == pytest.approx(80)
    assert profile.acceleration(up + 0.1) == 40
    assert profile.acceleration(profile.end - 0.01) == pytest.approx(-1000)


def test_a_soft_ramp_of_a_step_gives_way_to_the_braking_for_the_target() -> None:
    profile = plan(start=0, length=100, speed=100, acceleration=1e4, deceleration=100, steps=(SpeedStep(40, 10, 1),))
    assert profile.acceleration(profile.time_at(45)) == -1
    assert profile.acceleration(profile.end - 0.1) == pytest.approx(-100)
    assert profile.distance(profile.end) == 100
