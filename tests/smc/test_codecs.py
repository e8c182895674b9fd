"""What an axis says, as values; and what is no such answer is none."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compax_aio.errors import UnexpectedAnswerError
from compax_aio.smc.codecs import (
    LimitInputs,
    Listed,
    Port,
    decode_home,
    decode_limits,
    decode_listing,
    decode_number,
    decode_parameters,
    decode_port,
    decode_status,
    tidied,
)
from compax_aio.smc.own_copy import AxisSettings
from compax_aio.smc.profile import DCB_274, IM483I, MCPHERSON_789A4, PANTHER

# Numbers --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("body", "number"),
    [
        ("1000", 1000),
        ("  1000.00", 1000),
        ("\t-500.25 ", -500.25),
        ("+7", 7),
        ("7.", 7),
        ("-8388607.99", -8_388_607.99),
        ("0", 0),
        ("-0.00", 0),
        ("007", 7),
    ],
)
def test_a_number_is_read_whatever_blanks_stand_around_it(body: str, number: float) -> None:
    value = decode_number(body)
    assert (value, type(value)) == (number, float)
    assert str(value)[:2] != "-0" or number, "no zero has a sign"


@pytest.mark.parametrize(
    "body",
    ["", " ", "-", "+-5", "1 000", "- 5", "1,5", "1e3", ".5", "0x10", "nan", "inf", "5 #", "?", "AMS", "1_0", "\u0663",
     "5\n", "5\r", "1" * 13, "1.0000000"],
)  # fmt: skip
def test_what_is_no_number_is_shown_as_it_came(body: str) -> None:
    with pytest.raises(UnexpectedAnswerError) as caught:
        decode_number(body)
    assert str(caught.value) == f"the answer is no number; received {body!r}"


@given(
    value=st.decimals(-8_388_607, 8_388_607, places=2),
    width=st.integers(0, 20),
    behind=st.sampled_from(["", " ", "\t"]),
)
def test_padding_changes_no_number(value: Any, width: int, behind: str) -> None:
    assert decode_number(str(value).rjust(width) + behind) == float(value)


@given(st.text(max_size=20))
def test_any_other_text_is_refused_and_nothing_else_happens(body: str) -> None:
    with suppress(UnexpectedAnswerError):
        assert isinstance(decode_number(body), float)


# Motion ---------------------------------------------------------------------------------------------------------------


def test_a_homing_move_on_a_ramp_has_all_its_flags() -> None:
    """As somebody saw it on a machine (789A-4)."""
    status = decode_status(" 43")
    assert (status.moving, status.constant_speed, status.homing, status.ramping) == (True, True, True, True)
    assert (status.hunting, status.unknown, status.raw) == (False, 0, 43)
    assert not status.is_stopped
    assert not status.is_settled


@pytest.mark.parametrize(
    ("body", "stopped", "settled"),
    [("0", True, True), ("0.00", True, True), ("1", False, False), ("2", False, False), ("3", False, False),
     ("4", True, True), ("8", True, False), ("16", True, False), ("32", True, False), ("64", True, True),
     ("33", False, False), ("18", False, False)],
)  # fmt: skip
def test_an_axis_may_stand_and_not_be_settled(body: str, stopped: bool, settled: bool) -> None:
    status = decode_status(body)
    assert (status.is_stopped, status.is_settled) == (stopped, settled)


@given(st.integers(0, 255))
def test_no_bit_of_the_status_is_lost(value: int) -> None:
    status = decode_status(f"{value:10d}")
    known = sum(
        weight
        for weight, flag in (
            (1, status.moving),
            (2, status.constant_speed),
            (8, status.homing),
            (16, status.hunting),
            (32, status.ramping),
        )
        if flag
    )
    assert known | status.unknown == status.raw == value
    assert status.unknown == value & (4 | 64 | 128)


@pytest.mark.parametrize("body", ["-1", "1.5", "", "x"])
def test_a_status_is_a_whole_number_of_bits(body: str) -> None:
    with pytest.raises(UnexpectedAnswerError) as caught:
        decode_status(body)
    assert caught.value.received == body


# Inputs ---------------------------------------------------------------------------------------------------------------


def test_the_same_answer_is_read_as_the_profile_has_it() -> None:
    assert decode_limits("1", IM483I) == LimitInputs(raw=1, plus=True, minus=False, home=None)
    assert decode_limits("1", PANTHER) == LimitInputs(raw=1, plus=False, minus=True, home=None)
    assert decode_limits("1", DCB_274) == LimitInputs(raw=1, plus=None, minus=None, home=None)
    assert decode_limits("34", MCPHERSON_789A4) == LimitInputs(raw=34, plus=False, minus=False, home=True)
    assert decode_limits("66", MCPHERSON_789A4) == LimitInputs(raw=66, plus=True, minus=False, home=False)
    assert decode_limits("128", MCPHERSON_789A4) == LimitInputs(raw=128, plus=False, minus=True, home=False)


def test_a_home_input_whose_question_is_not_known_is_not_in_the_limits() -> None:
    blind = replace(DCB_274, home_bit=0)
    assert decode_limits("1", blind).home is None


def test_the_home_input_is_read_as_the_profile_has_it() -> None:
    assert [decode_home(body, IM483I) for body in ("0", "1", "2", "3")] == [False, True, False, True]
    assert decode_home("32", MCPHERSON_789A4) is True
    assert decode_home("2", MCPHERSON_789A4) is False
    assert decode_home("1", DCB_274) is None


def test_the_port_has_its_inputs_and_outputs() -> None:
    assert decode_port("10", IM483I) == Port(raw=10, inputs=(False, True, False), outputs=(True, False, False))
    assert decode_port("53", IM483I) == Port(raw=53, inputs=(True, False, True), outputs=(False, True, True))
    assert decode_port("63", DCB_274) == Port(raw=63, inputs=(), outputs=())


@pytest.mark.parametrize(
    ("decode", "what"),
    [(decode_limits, "limit inputs"), (decode_home, "home input"), (decode_port, "the port")],
)
def test_inputs_are_whole_numbers_of_bits(decode: Any, what: str) -> None:
    with pytest.raises(UnexpectedAnswerError, match=f"{what} is a whole number of bits, not below 0; received '-1'"):
        decode("-1", IM483I)


# Listings -------------------------------------------------------------------------------------------------------------

MANUAL = (
    Listed(0, "O0"),
    Listed(1, "R10000"),
    Listed(6, "W0"),
    Listed(9, "R-10000"),
    Listed(14, "W0"),
    Listed(17, "J1 3"),
    Listed(21, "R500"),
    Listed(26, ""),
)
"""DCB p. 24."""


def test_the_listing_of_the_manual_is_its_program() -> None:
    lines = [
        "  0  O",
        "  1  R 10000.00",
        "  6  W 0",
        "",
        " 9:\tR -10000.00",
        "014  W  0 ",
        "17 J 1 3",
        "21 R 500.00",
        "26",
    ]
    assert decode_listing(lines) == MANUAL


def test_an_empty_program_has_an_empty_listing() -> None:
    assert decode_listing([]) == decode_listing(["", "  "]) == ()


@pytest.mark.parametrize("line", ["R 10000.00", "#", "-1 R 5", "1R5", "5000000 R 1", "1 " + "R" * 300, "\u0661 R 5"])
def test_what_is_no_line_of_a_listing_is_shown_as_it_came(line: str) -> None:
    with pytest.raises(UnexpectedAnswerError) as caught:
        decode_listing(["0 O0", line])
    assert caught.value.what == "a line of the listing is no address with an instruction"
    assert caught.value.received == line


def test_addresses_that_do_not_grow_are_no_listing() -> None:
    """A digit lost on the line would make another program of it."""
    with pytest.raises(UnexpectedAnswerError) as caught:
        decode_listing(["14 W 0", "1 J 1 3"])
    assert str(caught.value) == "address 1 of the listing comes after 14; received '1 J 1 3'"
    with pytest.raises(UnexpectedAnswerError):
        decode_listing(["14 W 0", "14 J 1 3"])


@pytest.mark.parametrize(
    ("text", "tidy"),
    [
        ("R 10000.00", "R10000"),
        ("R  -0.50", "R-0.5"),
        ("R +5.", "R5"),
        ("R -0.00", "R0"),
        ("R-0007", "R-7"),
        ("W 0", "W0"),
        ("J 1,3", "J1 3"),
        ("J1   3 ", "J1 3"),
        ("O", "O0"),
        ("O 0.00", "O0"),
        ("+ 500", "+500"),
        ("-500.10", "-500.1"),
        ("", ""),
        ("B", "B"),
        ("B x 1.0", "Bx 1"),
    ],
)
def test_padding_means_nothing(text: str, tidy: str) -> None:
    assert tidied(text) == tidied(tidy) == tidy


@given(st.text(max_size=30))
def test_what_is_tidy_stays_so(text: str) -> None:
    assert tidied(tidied(text)) == tidied(text)


# Parameters -----------------------------------------------------------------------------------------------------------

SHOWN = [
    "X        A",
    "Y= 5/75 E= 100 K= 10/ 20 H=vr",
    "I= 400 (2, 1, 5) V= 5000",
    "d= 1 v= 2 /3",
]
"""As a Panther shows them (panther), of a board that shows its name as well (DCB p. 23)."""


def test_what_a_panther_shows_is_read() -> None:
    shown = decode_parameters(SHOWN)
    assert shown.name == "A"
    assert shown.lines == tuple(SHOWN)
    assert shown.values == {
        "Y": "5/75",
        "E": "100",
        "K": "10/20",
        "H": "vr",
        "I": "400",
        "V": "5000",
        "d": "1",
        "v": "2/3",
    }
    assert shown.settings == AxisSettings(
        initial_speed_steps_s=400,
        slew_speed_steps_s=5000,
        acceleration_slope=10,
        deceleration_slope=20,
        hold_current_percent=5,
        run_current_percent=75,
        variable_resolution=True,
        settling_delay=100,
    )


@pytest.mark.parametrize(
    ("first", "name"),
    [
        ("X A", "A"),
        ("XA", "A"),
        (" X   b ", "b"),
        ("X", None),
        ("X X", "X"),
        ("X A B", None),
        ("", None),
        ("Y= 5/75", None),
    ],
)
def test_the_name_stands_at_the_end_of_the_echoed_line(first: str, name: str | None) -> None:
    assert decode_parameters([first, *SHOWN[1:]]).name == name


def test_what_is_not_shown_is_not_known() -> None:
    assert decode_parameters([]).settings == AxisSettings()
    shown = decode_parameters(["X", "Y= 5 K= 1/2/3 H=xr I= V= 5000 E= a D= 3 l= 1"])
    assert shown.settings == AxisSettings(slew_speed_steps_s=5000)
    assert "I" not in shown.values, "what follows it is another letter"


def test_a_letter_that_says_two_things_says_nothing() -> None:
    assert decode_parameters(["X", "V= 5000", "V= 500 I= 4", "I= 4"]).settings == AxisSettings(initial_speed_steps_s=4)


@given(st.lists(st.text(max_size=300), max_size=5))
def test_whatever_is_shown_is_kept(lines: list[str]) -> None:
    shown = decode_parameters(lines)
    assert shown.lines == tuple(lines)
    assert isinstance(shown.settings, AxisSettings)
