"""A program is read, checked and printed as text, and what cannot stand in one is refused with its place."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.hostile.wicked import STRANGE_NUMBERS, SignedText, any_texts, refusal

from compax_aio.errors import InvalidCommandError
from compax_aio.smc.codecs import Listed, decode_listing, tidied
from compax_aio.smc.facts import COMMANDS
from compax_aio.smc.profile import DCB_274, IM483I, Profile
from compax_aio.smc.program_text import check_program, instruction, parse_program, plan_edit, program_listing

FULL = replace(
    IM483I, name="full", commands=frozenset(map(chr, range(33, 127))), settling_delays=(0, 999), output_bits=(3, 4, 5)
)
WITH_COMMAS = replace(FULL, separator=",", decimals=0)
MANUAL = ["O0", "R10000", "W0", "R-10000", "W0", "J1,3", "R500"]
PLACES = [0, 1, 6, 9, 14, 17, 21, 26]
"""DCB p. 24."""


def errors_of(text: str, profile: Profile = DCB_274, **more: Any) -> list[str]:
    said = refusal(lambda: parse_program(text, profile, **more))
    assert said is not None
    head, *errors = said.split("\n")
    assert head == ("1 error in the program:" if len(errors) == 1 else f"{len(errors)} errors in the program:")
    return errors


# One instruction ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "sent"),
    [
        ("R10000", "R10000"),
        ("R 10000.00", "R10000"),
        (" R -0.50\t", "R-0.5"),
        ("+500", "+500"),
        ("-500", "-500"),
        ("- 0.01", "-0.01"),
        ("M-500", "M-500"),
        ("M0", "M0"),
        ("F1000 1", "F1000 1"),
        ("O", "O0"),
        ("O 0.00", "O0"),
        ("J 1 3", "J1 3"),
        ("J1,3", "J1 3"),
        ("J65535 255", "J65535 255"),
        ("W 65535", "W65535"),
        ("I20", "I20"),
        ("V20000", "V20000"),
        ("K5,6", "K5 6"),
        ("Y0 100", "Y0 100"),
        ("D8", "D8"),
        ("H1", "H1"),
        ("E5", "E5"),
        ("l0", "l0"),
        ("A8", "A8"),
    ],
)
def test_an_instruction_is_sent_as_short_as_it_goes(text: str, sent: str) -> None:
    assert instruction(text, FULL) == sent
    assert instruction(sent, FULL) == sent


def test_arguments_stand_apart_as_the_profile_has_it() -> None:
    assert [instruction(text, WITH_COMMAS) for text in ("J1 3", "K5,6")] == ["J1,3", "K5,6"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "an instruction is empty"),
        ("  ", "an instruction is empty"),
        ("Z", "'Z' (position) is not known to stand in a program; known are + - A D E F H I J K M O R V W Y l"),
        ("%5", "'%' is not known to stand in a program; known are + - A D E F H I J K M O R V W Y l"),
        ("\x1b5", "'\\x1b' is not known to stand in a program; known are + - A D E F H I J K M O R V W Y l"),
        ("R", "'R' is no instruction: R has 1 number behind it"),
        ("R1 2", "'R1 2' is no instruction: R has 1 number behind it"),
        ("J1", "'J1' is no instruction: J has 2 numbers behind it"),
        ("R1e3", "'R1e3' is no instruction: R has 1 number behind it"),
        ("R1\n2", "'R1\\n2' is no instruction: R has 1 number behind it"),
        ("R\u0661", "'R\u0661' is no instruction: R has 1 number behind it"),
        ("R" + "1" * 300, f"'{'R' + '1' * 57}… has 301 characters and is no instruction"),
        (
            "R0.005",
            "'R0.005' cannot be said exactly: it would become 'R0.01'; full takes 2 decimals of a step and none of "
            "anything else",
        ),
        (
            "V500.5",
            "'V500.5' cannot be said exactly: it would become 'V500'; full takes 2 decimals of a step and none of "
            "anything else",
        ),
        (
            "+-5",
            "'+-5' cannot be said exactly: it would become '-5'; full takes 2 decimals of a step and none of "
            "anything else",
        ),
        ("R9000000", "position_steps must be within ±8,388,607.99, not 9000000.0 (DCB p. 26)"),
        ("O1", "the origin can be set to zero alone (DCB p. 24)"),
        ("M5", "speed_steps_s of a run has a size of 20 to 20000, not 5.0"),
        ("J1 256", "the count of a jump is a whole number from 0 to 255 (inferred from its 4 bytes), not 256.0"),
        ("W-1", "the number of W is a whole number from 0 to 65535 (inferred from its 3 bytes), not -1.0"),
        ("F100 2", "the direction of F is a whole number from 0 to 1, not 2.0"),
        ("H2", "the number of H is a whole number from 0 to 1, not 2.0"),
    ],
)
def test_what_is_no_instruction_is_refused_in_words(text: str, said: str) -> None:
    assert refusal(lambda: instruction(text, FULL)) == said


@pytest.mark.parametrize("letter", "GPQSX^Z]@C")
def test_what_asks_stores_or_runs_programs_stands_in_none(letter: str) -> None:
    said = refusal(lambda: instruction(f"{letter}0", FULL))
    assert said is not None
    assert said.startswith(f"{letter!r} ({COMMANDS[letter].meaning}) is not known to stand in a program")


def test_an_instruction_that_the_axis_is_not_known_to_have_is_refused() -> None:
    assert refusal(lambda: instruction("W0", IM483I)) == (
        "whether IM483I has the command 'W' (wait, in a program) is not known; "
        "raw() sends it all the same; a profile with it in commands does so from here on"
    )


def test_what_is_no_text_is_no_instruction() -> None:
    assert refusal(lambda: instruction(b"R1", FULL)) == "an instruction is a text, not b'R1'"  # type: ignore[arg-type]
    assert instruction(SignedText("R1"), FULL) == "R1"


numbers = st.decimals(-8_388_607, 8_388_607, places=2)
instructions = st.one_of(
    numbers.map(lambda each: f"R{each}"),
    st.integers(1, 8_388_607).flatmap(lambda each: st.sampled_from([f"+{each}", f"-{each}.50"])),
    st.integers(0, 65_535).map(lambda each: f"W{each}"),
    st.integers(20, 20_000).flatmap(lambda each: st.sampled_from([f"V{each}", f"I {each}", f"M-{each}", f"F{each} 1"])),
    st.tuples(st.integers(0, 255), st.integers(0, 255)).map(lambda both: f"K{both[0]} {both[1]}"),
    st.just("O"),
)


@given(instructions)
def test_what_is_sent_is_what_was_meant(text: str) -> None:
    sent = instruction(text, FULL)
    assert len(sent) <= 12
    assert sent.isascii()
    assert sent.isprintable()
    assert tidied(sent) == tidied(text)
    assert instruction(sent, FULL) == sent


@given(any_texts | st.text("RJWOKMF+-0123456789., \t", max_size=15))
def test_any_text_is_an_instruction_or_refused(text: str) -> None:
    try:
        sent = instruction(text, FULL)
    except InvalidCommandError:
        return
    assert len(sent) <= 12
    assert sent.isascii()
    assert sent.isprintable()


# Programs -------------------------------------------------------------------------------------------------------------


def test_the_program_of_the_manual_lies_where_the_manual_has_it() -> None:
    laid = check_program(MANUAL, DCB_274)
    assert [each.address for each in laid] == PLACES
    assert [each.text for each in laid] == [*MANUAL[:5], "J1 3", "R500", ""]


def test_a_program_may_begin_at_any_address() -> None:
    assert [each.address for each in check_program(["W0", "J100 3"], DCB_274, start=100)] == [100, 103, 107]
    assert check_program([], DCB_274) == (Listed(0, ""),)
    assert parse_program("7: W0", DCB_274) == (Listed(7, "W0"), Listed(10, ""))


@pytest.mark.parametrize("start", STRANGE_NUMBERS, ids=range(len(STRANGE_NUMBERS)))
def test_a_strange_start_is_none_or_a_plain_number(start: Any) -> None:
    try:
        laid = check_program(["W0"], DCB_274, start=start)
    except InvalidCommandError:
        return
    assert type(laid[0].address) is int


def test_a_program_is_read_from_text() -> None:
    text = "; back and forth\r\n 0: O0 ; here\n\n1 R 10000.00\n  W0\r9:R-10000\nW 0 ;\nJ1 3\n21 R500"
    assert parse_program(text, DCB_274) == check_program(MANUAL, DCB_274)


def test_what_is_printed_is_read_as_it_was() -> None:
    laid = check_program(MANUAL, DCB_274)
    printed = program_listing(laid)
    assert printed.startswith("    0: O0\n    1: R10000\n    6: W0\n")
    assert printed.endswith("   21: R500\n")
    assert parse_program(printed, DCB_274) == laid
    assert (*decode_listing(printed.splitlines()), Listed(26, "")) == laid


@given(st.lists(instructions, max_size=20), st.integers(0, 5000))
def test_every_program_is_read_as_it_was_printed(program: list[str], start: int) -> None:
    laid = check_program(program, FULL, start=start)
    assert [each.text for each in laid] == [*map(tidied, program), ""]
    assert parse_program(program_listing(laid), FULL, start=start) == laid


def test_behind_an_instruction_of_unknown_length_no_address_is_known() -> None:
    laid = parse_program("O0\nV500\nR1\nW0", DCB_274)
    assert [each.address for each in laid] == [0, 1, None, None, None]
    assert program_listing(laid) == "    0: O0\n    1: V500\nR1\nW0\n"
    stated = parse_program("O0\nV500\n4: R1\nW0\nJ4 1", DCB_274)
    assert [each.address for each in stated] == [0, 1, 4, 9, 12, 16]
    learnt = parse_program("V500\nR1\nJ3 9", DCB_274, lengths={"V": 3, "R": 5, "J": 4})
    assert [each.address for each in learnt] == [0, 3, 8, 12]


def test_errors_say_where_they_are() -> None:
    known = "known are + - A D E F H I J K M O R V W Y l"
    assert errors_of("R1\n  Q\n\nR5.555\nlx ; no number\n  12: S") == [
        f"line 2, column 3: 'Q' (list the program) is not known to stand in a program; {known}",
        "line 4, column 1: 'R5.555' cannot be said exactly: it would become 'R5.55'; DCB-274 takes 2 decimals of a "
        "step and none of anything else",
        "line 5, column 1: 'lx' is no instruction: l has 1 number behind it",
        f"line 6, column 7: 'S' (store parameters and name) is not known to stand in a program; {known}",
    ]
    assert errors_of("26") == ["line 1, column 3: an instruction is empty"]


def test_an_address_that_cannot_be_is_an_error_at_its_place() -> None:
    assert errors_of("O0\n 2: R1") == ["line 2, column 2: the instruction begins at 1, not at 2; leave addresses out"]
    assert errors_of("5: O0", start=4) == [
        "line 1, column 1: the instruction begins at 4, not at 5; leave addresses out"
    ]
    assert errors_of("9: O0\nV500\n10: R1\n3: W0") == [
        "line 3, column 1: address 10 comes after 10; leave addresses out",
        "line 4, column 1: the instruction begins at 15, not at 3; leave addresses out",
    ]
    assert errors_of("O0\n0: R1") == ["line 2, column 1: the instruction begins at 1, not at 0; leave addresses out"]


def test_a_jump_leads_to_an_instruction() -> None:
    assert parse_program("O0\nJ5 1\nW0", DCB_274)[1].text == "J5 1"
    assert errors_of("R1\n  J3 1 ; into the middle\nJ13 1") == [
        "line 2, column 3: no instruction begins at 3",
        "line 3, column 1: no instruction begins at 13",
    ]


def test_a_jump_whose_end_nobody_knows_is_refused() -> None:
    assert parse_program("O0\nV500\nJ1 3", DCB_274)[2] == Listed(None, "J1 3")
    assert errors_of("O0\nV500\nJ7 3\nW0") == [
        "line 3, column 1: whether an instruction begins at 7 is not known: lengths before it are not"
    ]
    assert errors_of("R1\nV500\nJ2 3") == ["line 3, column 1: no instruction begins at 2"]


def test_a_program_is_a_list_of_single_instructions() -> None:
    assert refusal(lambda: check_program("O0", DCB_274)) == (
        "a program is several instructions, as a list or tuple; parse_program() takes a text"
    )
    for each in ("R1\nR2", "R1;", "", "R1\rR2"):
        assert refusal(lambda each=each: check_program([each], DCB_274)) == f"{each!r} is not one instruction"  # type: ignore[misc]
    assert refusal(lambda: check_program([5], DCB_274)) == "a program is a text, not 5"  # type: ignore[list-item]
    assert refusal(lambda: parse_program(5, DCB_274)) == "a program is a text, not 5"  # type: ignore[arg-type]


def test_what_is_longer_than_any_program_is_not_read() -> None:
    assert refusal(lambda: parse_program("\n" * 10_000, DCB_274)) == (
        "the program has 10001 lines, more than any: 10000"
    )
    assert len(str(refusal(lambda: parse_program("Q\n" * 1000, DCB_274))).split("\n")) == 51


@given(st.text(max_size=60) | st.lists(any_texts | instructions, max_size=6).map("\n".join))
def test_any_text_is_a_program_or_refused(text: str) -> None:
    try:
        laid = parse_program(text, FULL)
    except InvalidCommandError:
        return
    known = [each.address for each in laid if each.address is not None]
    assert known == sorted(set(known))


# Edits ----------------------------------------------------------------------------------------------------------------

LISTING = check_program(MANUAL, DCB_274)


@pytest.mark.parametrize("address", STRANGE_NUMBERS, ids=range(len(STRANGE_NUMBERS)))
def test_a_strange_address_is_edited_nowhere(address: Any) -> None:
    assert refusal(lambda: plan_edit(LISTING, address, "R1", DCB_274)) or address == 0


def test_an_edit_is_worded_as_the_axis_takes_it() -> None:
    laid = check_program(["O0", "W0", "J0 3"], WITH_COMMAS)
    assert plan_edit(laid, 0, "W 5", WITH_COMMAS).instructions == ("W5", "W0", "J0,3")
    plan = plan_edit(LISTING, 21, "R 600.00", DCB_274)
    assert (plan.instructions, plan.is_in_place) == (("R600",), True)


@pytest.mark.parametrize(
    "edit",
    [
        lambda: plan_edit(LISTING, 21, "Q", DCB_274),
        lambda: plan_edit(LISTING, 21, "R9000000", DCB_274),
        lambda: plan_edit((Listed(0, "O0"), Listed(1, "Bx"), Listed(4, "")), 0, "W0", DCB_274),
    ],
)
def test_an_edit_that_cannot_be_said_is_refused(edit: Callable[[], object]) -> None:
    assert refusal(edit)
