"""What the monitor says of an axis, without a screen and without a line: old is told from new, doubt from knowledge."""

from __future__ import annotations

from types import MappingProxyType

import pytest
from rich.text import Text

from compax_aio.cli.monitoring.diary import Diary
from compax_aio.cli.monitoring.drawing import (
    between,
    draw_bar,
    draw_compact,
    draw_facts,
    draw_lamps,
    draw_place,
    draw_title,
    draw_trends,
    position_text,
)
from compax_aio.cli.monitoring.levels import Level
from compax_aio.cli.monitoring.state import AxisState, Phase, StopReport
from compax_aio.cli.monitoring.steps import next_step
from compax_aio.cli.monitoring.trend import SPAN_S, Trend, sparkline
from compax_aio.cli.monitoring.words import LampLight, by_keys, duration, lamps, say
from compax_aio.compax.codecs import DriveStatus
from compax_aio.compax.facts.device_errors import device_error
from compax_aio.compax.watch import Reading
from compax_aio.errors import CommandRejectedError, CompaxError

STANDING, MOVING = ("11111000", "00000010"), ("11100000", "00100010")


def reading(at: float, status: tuple[str, str] | None = STANDING, **values: float) -> Reading:
    every: dict[str, object] = {"position": 12.5, "target": 20.0, "following_error": 0.1, "speed": 50.0, "torque": 7.0}
    every |= values
    if status is not None:
        every["status"] = DriveStatus.decode(*status)
    return Reading("x", at, MappingProxyType(every), MappingProxyType({}))


def refusing(at: float, quantity: str, code: int | None) -> Reading:
    error: CompaxError = CommandRejectedError("the drive refused it", sent="S5", code=code)
    return Reading("x", at, MappingProxyType({}), MappingProxyType({quantity: error}))


@pytest.fixture
def axis() -> AxisState:
    """An axis that was read at 100 s."""
    axis = AxisState("x", "tcp://moxa:4001", 0.2, unit="mm")
    axis.enter(Phase.OPEN, 90.0)
    axis.take(reading(100.0))
    return axis


def test_a_drive_that_stands_at_rest_is_said_to_stand(axis: AxisState) -> None:
    assert say(axis, 100.1).state == "STANDING"
    assert say(axis, 100.1).level is Level.QUIET


@pytest.mark.parametrize(
    ("status", "state", "detail"),
    [
        (MOVING, "MOVING", "not started here"),
        (("11111000", "00010010"), "PROGRAM RUNS", "not started here"),
        (("11111000", "00000000"), "POWER OFF", ""),
        (("11011000", "00000010"), "NOT HOMED", "h finds machine zero"),
        (("10111000", "00000010"), "STANDING", "a warning is present"),
        (("11111100", "00000010"), "STANDING", "after a stop"),
        (("11111000", "00001010"), "STANDING", "stopped by input I6"),
        (("01111000", "00000000"), "FAULT", "the drive does not say which"),
    ],
)
def test_what_the_status_bits_mean_is_said_in_words(
    axis: AxisState, status: tuple[str, str], state: str, detail: str
) -> None:
    axis.take(reading(101.0, status))
    assert say(axis, 101.0).state == state
    assert detail in say(axis, 101.0).detail


def test_a_fault_is_said_with_its_code_and_the_key_that_acknowledges_it(axis: AxisState) -> None:
    axis.take(reading(101.0, ("01111000", "00000000")))
    axis.error = device_error(55)
    said = say(axis, 101.0)
    assert (said.level, said.state) == (Level.ALARM, "FAULT E55")
    assert "emergency stop: release the emergency stop, then a to acknowledge it" in said.detail
    axis.take(reading(102.0))
    assert axis.error is None


def test_a_warning_is_said_with_its_code(axis: AxisState) -> None:
    axis.take(reading(101.0, ("10111000", "00000010")))
    axis.error = device_error(60)
    assert "E60" in say(axis, 101.0).detail


def test_a_motion_from_here_is_not_called_one_of_somebody_else(axis: AxisState) -> None:
    axis.own_motion = "jog +1 mm"
    assert (say(axis, 100.0).state, say(axis, 100.0).detail) == ("BEGINS", "jog +1 mm")
    axis.take(reading(101.0, MOVING))
    assert say(axis, 101.0).detail == "jog +1 mm"
    axis.own_motion, axis.own_ended_at = None, 101.2  # by $, and the status was read before it
    assert say(axis, 101.3).detail == ""
    axis.take(reading(101.5, MOVING))
    assert say(axis, 101.6).detail == "not started here"


def test_values_of_a_lost_line_are_never_current_and_the_line_tells_how_long_and_how_often(axis: AxisState) -> None:
    assert axis.is_current("position", 100.1)
    axis.enter(Phase.LOST, 100.2, "the far end hung up")
    axis.attempts = 3
    assert not axis.is_current("position", 100.2)
    said = say(axis, 112.2)
    assert (said.level, said.state) == (Level.ALARM, "LINE LOST 12 s")
    assert "tried 3 times; it may move; the far end hung up" in said.detail
    assert axis.age_s("position", 112.0) == 12.0
    assert "12 s old" in draw_place(axis, 112.0).plain
    assert "12 s old" in draw_facts(axis, 112.0).plain
    assert "12 s old" in draw_compact(axis, 112.0, 80).plain
    axis.enter(Phase.OPEN, 113.0)
    assert say(axis, 113.1).state == "CONNECTED"
    assert not axis.is_current("position", 113.1), "it is the old value all the same"


def test_a_drive_that_says_nothing_is_not_said_to_stand(axis: AxisState) -> None:
    said = say(axis, 110.0)
    assert (said.level, said.state) == (Level.ALARM, "NO ANSWER")
    assert "for 10 s; it may move" in said.detail


def test_a_drive_that_has_never_said_how_it_stands_is_waited_for_and_then_told() -> None:
    axis = AxisState("x", "tcp://moxa:4001", 0.2)
    axis.enter(Phase.OPEN, 5.0)
    assert say(axis, 5.1).level is Level.WAITING
    assert say(axis, 9.0).state == "NO ANSWER"
    axis.take(refusing(9.0, "status", 90))
    assert say(axis, 9.1).state == "NO STATUS"


def test_a_line_that_could_not_be_opened_says_why_and_when_it_is_tried_again() -> None:
    axis = AxisState("x", "tcp://moxa:4001", 0.2)
    assert (say(axis, 0.0).state, say(axis, 0.0).detail) == ("CONNECTING", "")
    axis.attempts = 1
    axis.enter(Phase.UNREACHABLE, 1.0, "nobody listens")
    assert "tried 1 time, again in 0 s" in say(axis, 1.0).detail
    axis.next_attempt_at = 4.0
    assert say(axis, 1.0).detail == "tried 1 time, again in 3 s (c: now): nobody listens"
    axis.enter(Phase.OPENING, 4.0, axis.trouble)
    assert say(axis, 4.0).detail == "tried 1 time in vain: nobody listens"
    axis.enter(Phase.ENDED, 5.0, "lost")
    assert "c connects anew" in say(axis, 5.0).detail


def test_doubt_goes_before_what_the_status_says(axis: AxisState) -> None:
    axis.doubt = "a stop failed"
    assert say(axis, 100.0).state == "IN DOUBT"
    assert "no command is active; look at the machine, then r: a stop failed" in say(axis, 100.0).detail
    axis.take(reading(101.0, MOVING))
    assert "its command is active" in say(axis, 101.0).detail
    axis.stop = StopReport(101.0, Level.WAITING, "STOP sent")
    assert say(axis, 101.0).state == "STOPPING"


def test_a_value_that_was_refused_is_said_to_be(axis: AxisState) -> None:
    axis.take(refusing(101.0, "torque", 90))
    assert "torque          refused (E90)" in draw_facts(axis, 101.0).plain
    axis.take(refusing(101.0, "speed", None))
    assert "speed           refused" in draw_facts(axis, 101.0).plain
    axis.take(reading(102.0))
    assert "refused" not in draw_facts(axis, 102.0).plain


def test_lamps_are_lit_dark_warning_or_unknown() -> None:
    lights = {lamp.label: lamp.light for lamp in lamps(DriveStatus.decode("01111100", "00000010"))}
    assert lights["fault"] is LampLight.WARNING
    assert lights["warning"] is LampLight.DARK
    assert lights["power"] is lights["homed"] is LampLight.LIT
    assert lights["stopped"] is LampLight.WARNING
    assert {lamp.light for lamp in lamps(None)} == {LampLight.UNKNOWN}


def test_lamps_of_an_old_status_have_no_colour_of_their_own(axis: AxisState) -> None:
    def colours(now: float) -> set[str]:
        return {str(span.style) for span in draw_lamps(axis, now, 100, with_pace=False).spans}

    assert len(colours(100.0)) > 2
    assert len(colours(200.0)) == 1


def test_the_title_gives_up_the_line_before_the_reason_for_an_alarm(axis: AxisState) -> None:
    title = draw_title(axis, 100.0, 80, is_selected=True).plain
    assert title.startswith("▌ x  ■ STANDING")
    assert title.rstrip().endswith("tcp://moxa:4001")
    axis.enter(Phase.LOST, 100.0, "the far end hung up, which is a long story " * 3)
    title = draw_title(axis, 110.0, 80, is_selected=False).plain
    assert "tcp" not in title
    assert len(title) == 80


def test_what_does_not_fit_is_cut_to_the_width() -> None:
    assert between(Text("left side"), Text("right"), 9).plain == "left side"
    for width in (20, 40, 80, 120):
        assert len(between(Text("left" * 40), Text("right"), width).plain) == width


def test_the_bar_shows_the_place_within_the_travel_and_the_target(axis: AxisState) -> None:
    assert draw_bar(axis, 100.0, 40).plain == "travel not known"
    axis.travel = (0.0, 25.0)
    bar = draw_bar(axis, 100.0, 40).plain
    assert bar.startswith("0 ")
    assert bar.endswith(" 25")
    assert bar.index("◆") < bar.index("┼")
    axis.take(reading(101.0, position=-1000.0, target=9000.0))
    bar = draw_bar(axis, 101.0, 40).plain
    assert (bar[2], bar[-4]) == ("◆", "┼"), "what lies outside is at the end"
    assert draw_bar(axis, 101.0, 8).plain == ""
    axis.enter(Phase.LOST, 101.0)
    assert "◆" in draw_bar(axis, 102.0, 40).plain
    axis.travel = None
    assert draw_bar(axis, 102.0, 40).plain == ""


def test_nothing_is_invented_where_nothing_was_said() -> None:
    axis = AxisState("x", "tcp://moxa:4001", 0.2, unit="mm")
    assert position_text(axis) == "--.--"
    assert draw_facts(axis, 1.0).plain.count("--") == 4
    assert "old" not in draw_place(axis, 1.0).plain
    assert not any(block in draw_trends(axis, 1.0, 20).plain for block in "▁▂▃▄▅▆▇█")
    assert axis.age_s("position", 1.0) is None
    assert "/s" not in draw_compact(axis, 1.0, 80).plain


def test_the_pace_of_readings_is_counted_over_the_last_seconds(axis: AxisState) -> None:
    for number in range(50):
        axis.take(reading(100.2 + number * 0.2))
    assert axis.readings_per_s(110.0) == pytest.approx(5.0, abs=0.3)
    axis.answer_time_s = 0.021
    assert "5.0/s 21 ms" in draw_lamps(axis, 110.0, 100, with_pace=True).plain
    assert axis.readings_per_s(120.0) == 0


def test_a_trend_keeps_a_minute_and_leaves_gaps_as_gaps() -> None:
    trend = Trend()
    assert trend.extent(0.0) is None
    for at in (0.0, 1.0, 70.0, 71.0, 90.0):
        trend.add(at, at)
    assert trend.extent(90.0) == (70.0, 90.0)
    columns = trend.columns(90.0, 6)
    assert columns == [None, None, None, 71.0, None, 90.0]
    assert sparkline(columns) == "   ▁ █"
    assert trend.columns(90.0 + SPAN_S + 1, 6) == [None] * 6


def test_a_trend_shows_the_largest_error_of_either_sign() -> None:
    trend = Trend()
    for number, value in enumerate((0.1, -5.0, 0.2)):
        trend.add(59.0 + number * 0.1, value)
    assert trend.columns(59.9, 1) == [-5.0]


def test_a_flat_line_is_drawn_flat_and_an_empty_one_blank() -> None:
    assert sparkline([2.0, 2.0]) == "▁▁"
    assert sparkline([None, None]) == "  "


def test_memory_of_a_trend_is_bounded() -> None:
    trend = Trend()
    for _ in range(20_000):
        trend.add(1.0, 1.0)
    assert len(trend._samples) <= 6000


def test_the_diary_is_bounded_and_tells_what_is_new() -> None:
    diary = Diary()
    for number in range(1500):
        diary.add("x", f"line {number}\nof two")
    assert diary.written == 1500
    assert [entry.text for entry in diary.since(1498)] == ["line 1498 of two", "line 1499 of two"]
    assert len(diary.since(0)) == 1000
    assert diary.since(1500) == []


@pytest.mark.parametrize(
    ("step", "direction", "decimals", "following"),
    [
        (1.0, 1, 2, 2.0),
        (1.0, -1, 2, 0.5),
        (0.01, -1, 2, 0.01),
        (0.01, -1, 3, 0.005),
        (500.0, 1, 2, 500.0),
        (3.0, 1, 2, 5.0),
        (3.0, -1, 2, 2.0),
    ],
)
def test_steps_go_by_one_two_five(step: float, direction: int, decimals: int, following: float) -> None:
    assert next_step(step, direction, decimals=decimals) == pytest.approx(following)


@pytest.mark.parametrize(
    ("seconds", "text"), [(0.4, "0 s"), (12, "12 s"), (119, "119 s"), (600, "10 min"), (9000, "2 h")]
)
def test_times_are_written_for_people(seconds: float, text: str) -> None:
    assert duration(seconds) == text


def test_advice_names_keys_and_no_methods() -> None:
    assert by_keys("look at the machine, then call reconcile()") == "look at the machine, then press r"
    assert by_keys("mend it, then quit()") == "mend it, then a to acknowledge it"
