"""What the drive cannot be told is refused before a byte is sent, and the rest is worded as the manual has it (P9)."""

from __future__ import annotations

import math
from decimal import Decimal
from fractions import Fraction
from numbers import Real
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from compax_aio.compax.facts.commands import COMMANDS
from compax_aio.compax.plain_line import check_line, is_query, starts_motion
from compax_aio.compax.settings import Dialect, DriveSettings
from compax_aio.compax.vocabulary import (
    Comparator,
    MovePlan,
    SpeedStep,
    plan_home,
    plan_move_by,
    plan_move_to,
)
from compax_aio.errors import InvalidCommandError

MILLIMETRES = DriveSettings()
INCHES = DriveSettings(decimals=3, unit="inch")

both_kinds = pytest.mark.parametrize("plan", [plan_move_to, plan_move_by])


def to(position: Any, settings: DriveSettings = MILLIMETRES, **more: Any) -> MovePlan:
    return plan_move_to(position, settings, **more)


class Measured(float):
    """A number of another library, as numpy's are: it only says that it is a real number."""


class Foreign:
    """Registered as a real number, and no float."""

    def __float__(self) -> float:
        return 12.5


Real.register(Foreign)


# Positions ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("position", "written"),
    [
        (0, "PA0"),
        (-0.0, "PA0"),
        (0.004, "PA0"),
        (-0.004, "PA0"),
        (120.5, "PA120.5"),
        (120.501, "PA120.5"),
        (100, "PA100"),
        (1000.0, "PA1000"),
        (-3.25, "PA-3.25"),
        (0.1 + 0.2, "PA0.3"),
        (0.125, "PA0.12"),
        (0.375, "PA0.38"),
        (1.005, "PA1"),
        (2.345, "PA2.35"),
        (-0.125, "PA-0.12"),
        (1e-300, "PA0"),
        (4_000_000, "PA4000000"),
        (-4_000_000.0, "PA-4000000"),
        (3_999_999.99, "PA3999999.99"),
        (4_000_000.004, "PA4000000"),
    ],
)
def test_a_position_is_written_as_short_as_it_goes(position: float, written: str) -> None:
    """Halves go to the even digit, as far as binary numbers have halves."""
    assert to(position).motion == written


def test_inches_have_three_decimals() -> None:
    assert to(1.2345, INCHES).motion == "PA1.234"
    assert to(1.2355, INCHES).motion == "PA1.236"
    assert to(1.2345, MILLIMETRES).motion == "PA1.23"
    assert plan_move_by(-0.0006, INCHES).motion == "PR-0.001"


def test_a_plan_knows_its_target_as_the_drive_will() -> None:
    plan = to(120.567)
    assert (plan.target, plan.distance, plan.motion) == (120.57, None, "PA120.57")
    assert plan.description == "move_to(120.57)"
    plan = plan_move_by(-3.25, MILLIMETRES)
    assert (plan.target, plan.distance, plan.motion) == (None, -3.25, "PR-3.25")
    assert plan.description == "move_by(-3.25)"


def test_no_target_is_minus_zero() -> None:
    for position in (-0.0, -0.001):
        target = to(position).target
        assert target == 0
        assert math.copysign(1, target) == 1


@pytest.mark.parametrize(
    "position",
    [Decimal("12.5"), Fraction(25, 2), Measured(12.5), Foreign(), 12.5],
    ids=lambda value: type(value).__name__,
)
def test_real_numbers_of_every_kind_are_taken(position: Any) -> None:
    assert to(position).motion == "PA12.5"


@both_kinds
@pytest.mark.parametrize(
    "number",
    [
        *(math.nan, math.inf, -math.inf, Decimal("NaN"), Decimal("Infinity"), 1e308),
        *(4_000_000.01, -4_000_000.01, 10**9),
        *(True, False, "120.5", b"1", None, 1j, [1.0], (1,), {}),
    ],
    ids=repr,
)
def test_what_is_no_position_is_refused(plan: Any, number: Any) -> None:
    with pytest.raises(InvalidCommandError):
        plan(number, MILLIMETRES)


def test_a_refusal_is_a_value_error_too_and_names_the_number() -> None:
    with pytest.raises(ValueError, match=r"4000000\.01") as caught:
        to(4_000_000.01)
    assert isinstance(caught.value, InvalidCommandError)
    assert caught.value.sent is None


# Speed and ramps ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("speed", "written"),
    [
        (50, "SD50"),
        (100, "SD100"),
        (0.001, "SD0.001"),
        (33.3333, "SD33.333"),
        (99.5, "SD99.5"),
        (Decimal("12.5"), "SD12.5"),
    ],
)
def test_a_speed_has_up_to_three_decimals(speed: Any, written: str) -> None:
    assert to(1, speed_percent=speed).settings_lines == (written,)


@pytest.mark.parametrize("speed", [0, -1, 100.001, 101, 0.0004, math.nan, math.inf, True, "50"])
def test_what_is_no_speed_is_refused(speed: Any) -> None:
    with pytest.raises(InvalidCommandError, match="speed_percent"):
        to(1, speed_percent=speed)


def test_a_drive_that_may_go_faster_is_told_so_by_its_settings() -> None:
    fast = DriveSettings(speed_limit_percent=600)
    assert to(1, fast, speed_percent=600).settings_lines == ("SD600",)
    assert to(1, fast, steps=[(5, 600)]).point_lines == ("PR5 SD600",)
    with pytest.raises(InvalidCommandError):
        to(1, fast, speed_percent=600.01)


@pytest.mark.parametrize(("ramp", "written"), [(0, "0"), (250, "250"), (250.0, "250"), (65_000, "65000")])
def test_ramps_are_whole_milliseconds(ramp: Any, written: str) -> None:
    assert to(1, acceleration_ms=ramp).settings_lines == (f"AL{written}",)
    assert to(1, deceleration_ms=ramp).settings_lines == (f"AL-{written}",)


@pytest.mark.parametrize("ramp", [-1, 65_001, 0.5, math.nan, math.inf, True, "250", 1e300])
@pytest.mark.parametrize("which", ["acceleration_ms", "deceleration_ms"])
def test_what_is_no_ramp_is_refused(which: str, ramp: Any) -> None:
    with pytest.raises(InvalidCommandError, match=which):
        to(1, **{which: ramp})


def test_settings_go_in_one_order_and_only_where_they_are_given() -> None:
    assert to(1).settings_lines == ()
    plan = to(1, speed_percent=50, acceleration_ms=250, deceleration_ms=300)
    assert plan.settings_lines == ("SD50", "AL250", "AL-300")


# Points on the way ----------------------------------------------------------------------------------------------------


@both_kinds
def test_speed_steps_and_comparators_are_worded_as_in_the_manual(plan: Any) -> None:
    made = plan(
        1000,
        MILLIMETRES,
        steps=[(100, 20), SpeedStep(300.25, 80)],
        comparators=[(200, 9), (100, 10, 0), Comparator(50.5, 16)],
    )
    assert made.point_lines == (
        *("PR100 SD20", "PR300.25 SD80"),
        *("PR200 OT O9=1", "PR100 OT O10=0", "PR50.5 OT O16=1"),
    )
    assert made.comparators == 3


def test_points_may_come_from_any_iterable() -> None:
    plan = to(1, steps=iter([(1, 2)]), comparators=(point for point in [(3, 4)]))
    assert plan.point_lines == ("PR1 SD2", "PR3 OT O4=1")
    assert plan.comparators == 1


@pytest.mark.parametrize("step", [(0, 20), (-1, 20), (0.004, 20), (5, 20.5), (5, 0), (5, -20), (5, 101), (5, True)])
def test_what_is_no_speed_step_is_refused(step: Any) -> None:
    with pytest.raises(InvalidCommandError):
        to(1, steps=[step])


@pytest.mark.parametrize("step", [(5,), (5, 20, 1), 5, None, ("a", 5), (math.nan, 5), (5, math.nan), (5_000_000, 5)])
def test_what_is_no_step_at_all_is_refused(step: Any) -> None:
    with pytest.raises(InvalidCommandError):
        to(1, steps=[step])


@pytest.mark.parametrize(
    "point",
    [(5, 0), (5, 17), (5, -1), (5, 1, 2), (5, 1, -1), (0, 1), (-5, 1), (5, 1.5), (5, "1"), (5,), (5, 1, 1, 1), 5],
)
def test_what_is_no_comparator_is_refused(point: Any) -> None:
    with pytest.raises(InvalidCommandError):
        to(1, comparators=[point])


@pytest.mark.parametrize("output", range(1, 17))
def test_every_output_but_that_of_the_power_stage_takes_a_comparator(output: int) -> None:
    assert to(1, comparators=[(5, output, 0)]).point_lines == (f"PR5 OT O{output}=0",)


@pytest.mark.parametrize("steps", range(10))
def test_a_move_takes_eight_points_of_both_kinds_together(steps: int) -> None:
    points: dict[str, Any] = {"steps": [(5, 20)] * steps, "comparators": [(5, 1)] * (8 - steps)}
    if steps <= 8:
        assert len(to(1, **points).point_lines) == 8
    points["comparators"] = [(5, 1)] * (9 - steps)
    if steps <= 9:
        with pytest.raises(InvalidCommandError, match="at most 8"):
            to(1, **points)


# The search for machine zero ------------------------------------------------------------------------------------------


def test_the_search_for_machine_zero_asks_for_no_message() -> None:
    plan = plan_home(MILLIMETRES)
    assert (plan.motion, plan.may_ask_for_message, plan.finds_machine_zero) == ("PH", False, True)
    assert plan.target is None
    assert plan_home(DriveSettings(dialect=Dialect(home="POSA HOME"))).motion == "POSA HOME"


@pytest.mark.parametrize("home", ["", "PH\r", "PH$", "P" * 31])
def test_a_dialect_that_is_no_line_is_refused(home: str) -> None:
    with pytest.raises(InvalidCommandError):
        plan_home(DriveSettings(dialect=Dialect(home=home)))


# Any line -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sign", list("$,!?>"))
@pytest.mark.parametrize("form", ["PA100{}", "{}", "{}S1", "S{}1", "PA 100 {}"])
def test_every_function_sign_is_refused(sign: str, form: str) -> None:
    with pytest.raises(InvalidCommandError, match="sign of the line"):
        check_line(form.format(sign))


@pytest.mark.parametrize("code", [*range(0x20), 0x7F, 0x80, 0x85, 0xA0, 0xB2, 0xFF, 0x131, 0x2028, 0x1D7D9])
@pytest.mark.parametrize("form", ["PA100{}", "{}S1", "S{}1"])
def test_every_character_that_is_not_printable_ascii_is_refused(code: int, form: str) -> None:
    with pytest.raises(InvalidCommandError):
        check_line(form.format(chr(code)))


def test_a_line_has_one_to_thirty_characters() -> None:
    assert check_line("P" * 30) == "P" * 30
    assert check_line("P" * 29, room_for_sign=True) == "P" * 29
    assert check_line("  S1  ") == "S1"
    assert check_line(" " * 40 + "S1") == "S1"
    for text in ("", " ", "P" * 31):
        with pytest.raises(InvalidCommandError, match="1 to 30"):
            check_line(text)
    with pytest.raises(InvalidCommandError, match="1 to 29"):
        check_line("P" * 30, room_for_sign=True)


@settings(max_examples=200, deadline=None)
@given(st.text(max_size=40))
def test_what_is_let_through_is_one_line_of_the_drive(text: str) -> None:
    try:
        line = check_line(text)
    except InvalidCommandError:
        return
    assert 1 <= len(line) <= 30
    assert line.isascii()
    assert line.isprintable()
    assert not set(line) & set("$?!,>")


numbers = st.one_of(
    st.floats(-4e6, 4e6), st.integers(-4_000_000, 4_000_000), st.floats(), st.decimals(allow_nan=False, places=4)
)
distances = st.floats(0, 4e6)


@settings(max_examples=200, deadline=None)
@given(
    plan=st.sampled_from([plan_move_to, plan_move_by]),
    settings_=st.sampled_from([MILLIMETRES, INCHES, DriveSettings(speed_limit_percent=600)]),
    position=numbers,
    speed=st.none() | st.floats(0, 600),
    ramp=st.none() | st.integers(0, 65_000),
    steps=st.lists(st.tuples(distances, st.integers(1, 600)), max_size=4),
    comparators=st.lists(st.tuples(distances, st.integers(1, 16), st.integers(0, 1)), max_size=4),
)
def test_every_line_of_every_plan_fits_the_drive(  # noqa: PLR0917
    plan: Any, settings_: DriveSettings, position: Any, speed: Any, ramp: Any, steps: Any, comparators: Any
) -> None:
    try:
        made = plan(
            position,
            settings_,
            speed_percent=speed,
            acceleration_ms=ramp,
            deceleration_ms=ramp,
            steps=steps,
            comparators=comparators,
        )
    except InvalidCommandError:
        return
    for line in (*made.settings_lines, *made.point_lines, f"{made.motion}$"):
        assert len(line) <= 30
        assert line.isascii()
        assert not set(line.removesuffix("$")) & set("\r\n$?!,>")
        assert "e" not in line, "no exponent"
    said = float(made.motion[2:])
    wanted = made.target if made.target is not None else made.distance
    assert said == wanted
    assert abs(said - float(position)) <= 0.5 * 10.0**-settings_.decimals * 1.000001
    assert abs(said) <= 4_000_000


# What a line is -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("line", ["S1", "S001", "P40", "V5", "N005", "N250"])
def test_queries_are_known(line: str) -> None:
    assert is_query(line)


@pytest.mark.parametrize("line", ["S", "SD50", "P40=1", "N5: END", "S1000", "PA100", "STOP", ""])
def test_what_is_no_query_is_none(line: str) -> None:
    assert not is_query(line)


@pytest.mark.parametrize(
    "line",
    [
        *("PA100", "PA 100", "P A 100", "POSA 100", "POSA HOME", "PH", "PR-5", "POSR .V1", "pa100", "PA.P40"),
        *("START", "S TART", "LOOP 3", "WAIT POSA 5"),
    ],
)
def test_lines_that_set_the_axis_in_motion_are_known(line: str) -> None:
    assert starts_motion(line)


@pytest.mark.parametrize(
    "line",
    [
        *("PR100 SD20", "PR 100 SPEED 20", "PR200 OT O9=1", "POSR 200 OUTPUT O9=1"),
        *("SD50", "AL250", "STOP", "S1", "P40=1", "GOTO 302", "QUIT", "OT O0=1", "V5=3"),
    ],
)
def test_lines_that_prepare_or_ask_set_nothing_in_motion(line: str) -> None:
    assert not starts_motion(line)


def test_no_command_word_and_no_short_form_stands_twice_in_the_table() -> None:
    assert len({fact.long for fact in COMMANDS}) == len(COMMANDS)
    assert len({fact.short for fact in COMMANDS}) == len(COMMANDS)


def test_longer_words_stand_before_those_that_begin_alike() -> None:
    for words in ([fact.long for fact in COMMANDS], [fact.short for fact in COMMANDS]):
        for place, word in enumerate(words):
            assert not any(word.startswith(earlier) for earlier in words[:place]), word


# Settings -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "settings_",
    [
        *({"answer_timeout_s": 0}, {"answer_timeout_s": -1}, {"poll_first_s": math.nan}, {"stall_timeout_s": math.inf}),
        *({"decimals": 1}, {"decimals": 4}, {"speed_limit_percent": 0}, {"speed_limit_percent": 600.1}),
        *(
            {"speed_limit_percent": math.nan},
            {"resync_attempts": 0},
            {"resync_attempts": 1.5},
            {"decimals": 2.0},
            {"in_doubt_after_s": 0},
            {"stop_timeout_s": 0},
        ),
    ],
    ids=repr,
)
def test_settings_that_cannot_be_meant_are_refused(settings_: dict[str, Any]) -> None:
    with pytest.raises(InvalidCommandError, match=next(iter(settings_))):
        DriveSettings(**settings_)


@pytest.mark.parametrize("number", [10**400, -(10**400), Decimal("sNaN"), Fraction(10**400)])
def test_a_number_that_is_no_float_is_refused(number: Any) -> None:
    with pytest.raises(InvalidCommandError):
        to(number)


def test_a_distance_that_rounds_to_nothing_is_refused() -> None:
    with pytest.raises(InvalidCommandError, match="nothing once rounded"):
        plan_move_by(0.001, MILLIMETRES)
    assert plan_move_by(0, MILLIMETRES).motion == "PR0"


def test_a_prepared_point_is_told_from_a_motion() -> None:
    assert not starts_motion("PR 100 SD 20")
    assert not starts_motion("POSR 100 OUTPUT O9=1")
    assert starts_motion("PA 100 SD 5")
    assert starts_motion("po sa 5")


@pytest.mark.parametrize("text", ["ST\rOP", "STOP!", "", "ST\N{LATIN SMALL LETTER O WITH DIAERESIS}P", "S" * 31])
@pytest.mark.parametrize("word", ["stop", "quit", "home"])
def test_a_dialect_whose_words_are_no_plain_lines_is_refused(word: str, text: str) -> None:
    with pytest.raises(InvalidCommandError):
        DriveSettings(dialect=Dialect(**{word: text}))
