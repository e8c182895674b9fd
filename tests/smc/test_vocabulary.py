"""What an axis cannot be told is refused before a byte is sent, and the rest is worded as the manual has it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.hostile.wicked import STRANGE_NUMBERS, SignedText, SmuggledFloat, any_texts, refusal

from compax_aio.errors import InvalidCommandError
from compax_aio.smc import setting_lines, vocabulary
from compax_aio.smc.codecs import decode_number
from compax_aio.smc.facts import NOT_A_NAME, POSSIBLE_NAMES, Mode
from compax_aio.smc.own_copy import AxisSettings
from compax_aio.smc.profile import DCB_274, IM483I, MCPHERSON_789A4, PANTHER, PROFILES, Profile
from compax_aio.smc.vocabulary import (
    MotionKind,
    MotionPlan,
    check_name,
    check_raw,
    plan_home,
    plan_move_by,
    plan_move_to,
    plan_program,
    plan_run,
)

FULL = replace(
    IM483I, name="full", commands=frozenset(map(chr, range(33, 127))), settling_delays=(0, 999), output_bits=(3, 4, 5)
)
"""One that knows every command, so that numbers alone decide."""

ONE_NUMBER: dict[str, Callable[[Any, Profile], Any]] = {
    "R": plan_move_to,
    "+": plan_move_by,
    "M": plan_run,
    "F": lambda value, profile: plan_home(value, profile, direction=0),
    "F way": lambda value, profile: plan_home(100, profile, direction=value),
    "G": plan_program,
    "P": vocabulary.program_begin,
    "A": vocabulary.set_outputs,
    "I": setting_lines.initial_speed,
    "V": setting_lines.slew_speed,
    "K1": lambda value, profile: setting_lines.ramp_slopes(value, 1, profile),
    "K2": lambda value, profile: setting_lines.ramp_slopes(1, value, profile),
    "Y1": lambda value, profile: setting_lines.currents(value, 1, profile),
    "Y2": lambda value, profile: setting_lines.currents(1, value, profile),
    "D": setting_lines.resolution,
    "E": setting_lines.settling_delay,
}
every_number = pytest.mark.parametrize("word", ONE_NUMBER.values(), ids=ONE_NUMBER)


def text_of(worded: Any) -> str:
    return worded if isinstance(worded, str) else worded.text


def assert_can_be_sent(text: str) -> None:
    assert type(text) is str
    assert 1 <= len(text) <= 12
    assert all(" " <= each <= "~" for each in text)


# Motion ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("position", "text"),
    [
        (0, "R0"),
        (-0.0, "R0"),
        (-0.004, "R0"),
        (1000, "R1000"),
        (-10_000.0, "R-10000"),
        (0.1 + 0.2, "R0.3"),
        (12.345, "R12.35"),
        (1e-300, "R0"),
        (1e6, "R1000000"),
        (8_388_607.99, "R8388607.99"),
        (-8_388_607.99, "R-8388607.99"),
        (8_388_607.994, "R8388607.99"),
    ],
)
def test_a_position_is_written_as_short_as_it_goes(position: float, text: str) -> None:
    plan = plan_move_to(position, DCB_274)
    assert (plan.text, plan.kind, plan.distance) == (text, MotionKind.MOVE_TO, None)
    assert str(plan.target) == str(float(text[1:])), "and zero has no sign"
    assert plan.description == f"move to {text[1:]} steps"


def test_without_decimals_a_position_is_a_whole_step() -> None:
    assert plan_move_to(100, PANTHER).text == "R100"
    assert plan_move_to(-99.6, PANTHER).text == "R-100"
    assert plan_move_to(-0.4, PANTHER).text == "R0"
    assert plan_move_to(8_388_607.4, PANTHER).text == "R8388607"
    with pytest.raises(InvalidCommandError):
        plan_move_to(8_388_607.99, PANTHER)


@pytest.mark.parametrize(
    ("distance", "text", "described"),
    [
        (1000, "+1000", "move by +1000 steps"),
        (-500, "-500", "move by -500 steps"),
        (0.01, "+0.01", "move by +0.01 steps"),
        (-8_388_607.99, "-8388607.99", "move by -8388607.99 steps"),
    ],
)
def test_a_distance_has_its_sign_for_a_command(distance: float, text: str, described: str) -> None:
    plan = plan_move_by(distance, DCB_274)
    assert (plan.text, plan.description, plan.kind) == (text, described, MotionKind.MOVE_BY)
    assert (plan.target, plan.distance) == (None, distance)


@pytest.mark.parametrize(
    ("distance", "profile", "least"),
    [(0, DCB_274, "0.01"), (-0.004, DCB_274, "0.01"), (0.4, MCPHERSON_789A4, "1")],
)
def test_a_distance_of_nothing_is_refused(distance: float, profile: Profile, least: str) -> None:
    said = refusal(lambda: plan_move_by(distance, profile))
    assert said == (
        f"distance_steps {distance} is nothing once rounded to {profile.decimals} decimals; "
        f"the least is {least} (DCB p. 26)"
    )


@pytest.mark.parametrize("plan", [plan_move_to, plan_move_by])
def test_nobody_goes_farther_than_the_profile_allows(plan: Callable[[float, Profile], MotionPlan]) -> None:
    short = replace(DCB_274, max_position=1000)
    assert plan(-1000, short)
    for far in (1000.01, -1000.01, 1e300):
        said = refusal(lambda far=far: plan(far, short))  # type: ignore[misc]
        assert said is not None
        assert said.endswith(f"steps must be within ±1,000.00, not {far!r} (DCB p. 26)")


def test_a_run_has_its_direction_in_its_sign() -> None:
    assert [plan_run(speed, DCB_274).text for speed in (20, -20_000, 500.0)] == ["M20", "M-20000", "M500"]
    plan = plan_run(-500, DCB_274)
    assert (plan.description, plan.kind, plan.target) == ("run at -500 steps/s", MotionKind.RUN, None)


@pytest.mark.parametrize("speed", [19, -19, 0, 20_001, -20_001, 100.5])
def test_a_speed_that_the_axis_does_not_have_is_refused(speed: float) -> None:
    with pytest.raises(InvalidCommandError, match="speed_steps_s of a run"):
        plan_run(speed, DCB_274)


def test_to_run_at_no_speed_is_what_a_stop_is_for() -> None:
    assert refusal(lambda: plan_run(0, DCB_274)) == (
        "speed_steps_s of a run has a size of 20 to 20000, not 0; a stop ends a run"
    )


def test_home_is_searched_where_the_profile_says_that_plus_is() -> None:
    assert plan_home(1000, IM483I, toward_plus=True).text == "F1000 0"
    assert plan_home(1000, IM483I, toward_plus=False).text == "F1000 1"
    assert plan_home(1000, PANTHER, toward_plus=True).text == "F1000 1"
    plan = plan_home(1000, PANTHER, toward_plus=False)
    assert (plan.text, plan.description) == ("F1000 0", "find home toward minus at 1000 steps/s")
    assert plan.kind is MotionKind.HOME


def test_home_is_searched_in_a_direction_as_it_is_sent() -> None:
    plan = plan_home(1000, MCPHERSON_789A4, direction=0)
    assert (plan.text, plan.description) == ("F1000,0", "find home in direction 0 at 1000 steps/s")


def test_home_is_searched_nowhere_in_doubt() -> None:
    assert refusal(lambda: plan_home(1000, DCB_274, toward_plus=True)) == (
        "home_toward_plus of DCB-274 is not known; find it out on the machine, and put it into the profile; "
        "or give the direction, 0 or 1, as it is sent"
    )
    for where in ({}, {"toward_plus": True, "direction": 0}, {"toward_plus": 1}, {"direction": 2}, {"direction": True}):
        assert refusal(lambda where=where: plan_home(1000, IM483I, **where))  # type: ignore[misc]
    assert refusal(lambda: plan_home(19, IM483I, direction=0))
    assert refusal(lambda: plan_home(20_001, IM483I, direction=0))


def test_a_program_runs_from_its_address() -> None:
    plan = plan_program(26, DCB_274)
    assert (plan.text, plan.kind, plan.description) == ("G26", MotionKind.PROGRAM, "run the program at 26")
    small = replace(DCB_274, last_program_address=100)
    assert plan_program(100, small).text == "G100"
    assert refusal(lambda: plan_program(101, small)) == (
        "the address of a program is a whole number from 0 to 100, not 101"
    )


def test_a_plan_that_cannot_be_sent_is_none_whoever_makes_it() -> None:
    with pytest.raises(InvalidCommandError, match="13 characters"):
        MotionPlan(kind=MotionKind.MOVE_TO, description="far", text="R-8388607.999")
    plan = MotionPlan(kind=MotionKind.MOVE_TO, description="sly", text=SignedText("R1"))
    assert (type(plan.text), plan.text) == (str, "R1")


# Numbers of somebody else ---------------------------------------------------------------------------------------------


@every_number
@pytest.mark.parametrize("value", STRANGE_NUMBERS, ids=range(len(STRANGE_NUMBERS)))
def test_a_strange_number_is_refused_or_said_plainly(word: Callable[[Any, Profile], Any], value: Any) -> None:
    said = refusal(lambda: assert_can_be_sent(text_of(word(value, FULL))))
    assert said is None or said.isprintable()


@every_number
@given(value=st.floats() | st.integers())
def test_whatever_is_worded_can_be_sent(word: Callable[[Any, Profile], Any], value: float) -> None:
    try:
        text = text_of(word(value, FULL))
    except InvalidCommandError:
        return
    assert_can_be_sent(text)
    assert "e" not in text
    assert "-0" not in text.replace("-0.", "")


@given(value=st.floats(-8_388_607.99, 8_388_607.99), profile=st.sampled_from([*PROFILES.values()]))
def test_a_position_is_read_as_it_was_written(value: float, profile: Profile) -> None:
    plan = refusal(lambda: plan_move_to(value, profile)) or plan_move_to(value, profile)
    if isinstance(plan, MotionPlan):
        assert decode_number(plan.text[1:]) == plan.target == round(value, profile.decimals)
    else:
        assert abs(round(value)) > 8_388_607


@given(value=st.floats(-8_388_607, 8_388_607).filter(lambda each: round(each, 2) != 0))
def test_a_distance_is_read_as_it_was_written(value: float) -> None:
    plan = plan_move_by(value, IM483I)
    assert decode_number(plan.text) == plan.distance == round(value, 2)


def test_a_number_that_rounds_itself_is_rounded_all_the_same() -> None:
    assert plan_move_to(SmuggledFloat(3.555), PANTHER).text == "R4"


# The rest -------------------------------------------------------------------------------------------------------------


def test_questions_are_asked_as_each_member_is_asked() -> None:
    assert [vocabulary.status_query(each) for each in PROFILES.values()] == ["^"] * 4
    assert [vocabulary.position_query(each) for each in PROFILES.values()] == ["Z", "Z0", "Z0", "Z0"]
    assert [vocabulary.limits_query(each) for each in (IM483I, PANTHER, MCPHERSON_789A4)] == ["]0", "]0", "]"]
    assert [vocabulary.home_query(each) for each in (IM483I, MCPHERSON_789A4)] == ["]1", "]"]
    assert vocabulary.port_query(IM483I) == "A129"


@pytest.mark.parametrize("query", [vocabulary.limits_query, vocabulary.home_query, vocabulary.port_query])
def test_a_question_that_is_not_known_is_not_asked(query: Callable[[Profile], str]) -> None:
    said = refusal(lambda: query(DCB_274))
    assert said is not None
    assert said.endswith("_query of DCB-274 is not known; find it out on the machine, and put it into the profile")


def test_a_position_query_that_streams_is_none() -> None:
    assert refusal(lambda: vocabulary.position_query(replace(DCB_274, position_query="Z1")))


def test_the_short_commands_are_the_manuals() -> None:
    assert vocabulary.soft_stop(DCB_274) == "@"
    assert vocabulary.set_origin(DCB_274) == "O0"
    assert vocabulary.store(DCB_274) == "S"
    assert vocabulary.show_parameters(DCB_274) == "X"
    assert vocabulary.list_program(DCB_274) == "Q"
    assert [vocabulary.program_begin(21, DCB_274), vocabulary.program_end(DCB_274)] == ["P21", "P0"]


def test_a_command_that_a_member_is_not_known_to_have_is_left_to_raw() -> None:
    assert refusal(lambda: vocabulary.list_program(IM483I)) == (
        "whether IM483I has the command 'Q' (list the program) is not known; "
        "raw() sends it all the same; a profile with it in commands does so from here on"
    )
    assert refusal(lambda: vocabulary.check_command("%", IM483I)) == (
        "whether IM483I has the command '%' is not known; "
        "raw() sends it all the same; a profile with it in commands does so from here on"
    )
    assert vocabulary.list_program(replace(IM483I, commands=IM483I.commands | {"Q"})) == "Q"


def test_outputs_are_set_by_their_weights_and_inputs_are_not() -> None:
    assert [vocabulary.set_outputs(each, IM483I) for each in (0, 8, 56)] == ["A0", "A8", "A56"]
    assert vocabulary.set_outputs(24, MCPHERSON_789A4) == "A24"
    said = refusal(lambda: vocabulary.set_outputs(9, IM483I))
    assert said == "the value of the outputs is a sum of 8, 16, 32, not 9"
    assert refusal(lambda: vocabulary.set_outputs(129, IM483I)), "that reads the port"
    assert refusal(lambda: vocabulary.set_outputs(32, MCPHERSON_789A4))
    assert "output_bits of DCB-274 is not known" in str(refusal(lambda: vocabulary.set_outputs(0, DCB_274)))


# Settings -------------------------------------------------------------------------------------------------------------


def test_a_setting_says_what_it_leaves_behind() -> None:
    lines = [
        setting_lines.initial_speed(100, FULL),
        setting_lines.slew_speed(5000.0, FULL),  # type: ignore[arg-type]
        setting_lines.ramp_slopes(5, 6, FULL),
        setting_lines.currents(10, 75, FULL),
        setting_lines.resolution(3, FULL),
        setting_lines.variable_resolution(True, FULL),
        setting_lines.settling_delay(50, FULL),
        setting_lines.limit_polarity(False, FULL),
    ]
    assert [line.text for line in lines] == ["I100", "V5000", "K5 6", "Y10 75", "D3", "H1", "E50", "l0"]
    everything: dict[str, Any] = {name: value for line in lines for name, value in line.values.items()}
    assert AxisSettings(**everything) == AxisSettings(
        initial_speed_steps_s=100,
        slew_speed_steps_s=5000,
        acceleration_slope=5,
        deceleration_slope=6,
        hold_current_percent=10,
        run_current_percent=75,
        resolution=3,
        variable_resolution=True,
        settling_delay=50,
        limit_active_high=False,
    )
    assert None not in everything.values()


def test_two_arguments_stand_apart_as_the_profile_has_it() -> None:
    assert setting_lines.ramp_slopes(5, 255, MCPHERSON_789A4).text == "K5,255"


@pytest.mark.parametrize(
    "refused",
    [
        lambda: setting_lines.initial_speed(19, FULL),
        lambda: setting_lines.slew_speed(20_001, FULL),
        lambda: setting_lines.slew_speed(100.5, FULL),  # type: ignore[arg-type]
        lambda: setting_lines.slew_speed(35, MCPHERSON_789A4),
        lambda: setting_lines.ramp_slopes(256, 0, FULL),
        lambda: setting_lines.ramp_slopes(0, -1, FULL),
        lambda: setting_lines.currents(101, 0, FULL),
        lambda: setting_lines.currents(0, 101, FULL),
        lambda: setting_lines.resolution(9, FULL),
        lambda: setting_lines.settling_delay(1000, FULL),
        lambda: setting_lines.variable_resolution(1, FULL),  # type: ignore[arg-type]
        lambda: setting_lines.limit_polarity("1", FULL),  # type: ignore[arg-type]
    ],
)
def test_a_setting_out_of_range_is_refused(refused: Callable[[], object]) -> None:
    assert refusal(refused)


def test_a_setting_whose_range_nobody_knows_is_left_to_raw() -> None:
    assert refusal(lambda: setting_lines.settling_delay(1, PANTHER)) == (
        "which settling delays Panther takes is not known; "
        "raw() sends one all the same; a profile with settling_delays does so from here on"
    )


# Raw ------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("text", ["Z", "Z0", "Z 0", "z1", "R-8388607.99", "%", "A 129", "B1", "Z 00"])
def test_a_raw_command_is_sent_as_it_is(text: str) -> None:
    assert check_raw(text) == text
    assert check_raw(f"  {text} ") == text


@pytest.mark.parametrize("text", ["", "   ", "R" * 13, "R1\n", "R1\r", "\x1b", "\x03", "R1\b", "R\t1", "Ré", "\x7f"])
def test_a_raw_command_that_is_more_than_one_is_refused(text: str) -> None:
    assert refusal(lambda: check_raw(text))


@pytest.mark.parametrize("text", ["Z1", "Z 1", " Z1 ", "Z01", "Z+1", "Z2", "Z-1", "Z1.0", "Z,1", "Zx"])
def test_a_stream_of_positions_is_not_started(text: str) -> None:
    said = refusal(lambda: check_raw(text))
    assert said is not None
    assert "come without end" in said
    assert "positions()" in said


def test_what_is_no_text_is_no_command() -> None:
    assert refusal(lambda: check_raw(b"Z")) == "a command is a text, not b'Z'"  # type: ignore[arg-type]
    assert check_raw(SignedText("R1")) == "R1"
    assert type(check_raw(SignedText("R1"))) is str


@given(any_texts)
def test_whatever_raw_takes_can_be_sent(text: str) -> None:
    try:
        taken = check_raw(text)
    except InvalidCommandError:
        return
    assert_can_be_sent(taken)
    assert taken == text.strip(" ")


# Names ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", [Mode.PARTY, Mode.DAISY])
def test_letters_are_names_and_other_signs_may_be(mode: Mode) -> None:
    for name in (*POSSIBLE_NAMES, "5", "+", "~"):
        assert check_name(name, mode) == name
    for name in (*NOT_A_NAME, "", " ", "AB", "\x1b", "\x7f", "é", "\n"):
        assert refusal(lambda name=name: check_name(name, mode)), name  # type: ignore[misc]
    assert refusal(lambda: check_name("AB", mode)) == (
        "the name of an axis is one character, best a letter, not 'AB' (DCB p. 23)"
    )
    assert refusal(lambda: check_name(5, mode)) == "the name of an axis is a text, not 5"  # type: ignore[arg-type]


def test_in_single_mode_an_axis_has_no_name() -> None:
    assert check_name("", Mode.SINGLE) == ""
    assert refusal(lambda: check_name("A", Mode.SINGLE)) == ("in single mode an axis has no name, not 'A' (AMS p. 25)")
