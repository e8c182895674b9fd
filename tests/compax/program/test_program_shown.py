"""What a drive shows of a record is never taken for more than it proves."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from tests.compax.program.programs import MANUAL, records

from compax_aio.compax.program import (
    End,
    Goto,
    MoveTo,
    PreparedOutput,
    PreparedSpeed,
    Record,
    Repeat,
    Return,
    Variable,
    parse,
    parse_record,
    record_text,
)
from compax_aio.compax.program.printing import short_text
from compax_aio.compax.program.shown import Shown, compare, may_be_cut, read_shown, superfluous_ends

STEP = PreparedSpeed(Decimal(10), Decimal(50), Decimal(250))
BEHIND_A_BLANK = PreparedSpeed(Decimal("10000.2"), Variable(39), Decimal(1))
"""Its answer is cut right before ACCEL."""


def shown(record: Record, *, short: bool = False, number: int = 1) -> str:
    """Show a record as a drive does whose answers have at most 30 characters, and whose last blank or > is lost."""
    text = short_text(record) if short else record_text(record)
    return f"N{number:03d}: {text}"[:30].rstrip(" >")[6:]


@given(records, st.booleans())
def test_every_record_is_shown_the_same_or_its_beginning(record: Record, short: bool) -> None:
    text = shown(record, short=short)
    assert compare(text, record, decimals=3) is not Shown.OTHER
    whole = short_text(record) if short else record_text(record)
    if len(whole) > 24:
        assert compare(text, record, decimals=3) is Shown.BEGINNING
    if len(whole) < 23:
        assert compare(text, record, decimals=3) is Shown.SAME


@given(records, records, st.booleans())
@example(STEP, PreparedSpeed(Decimal(10), Decimal(50), Decimal(25)), False)
@example(BEHIND_A_BLANK, replace(BEHIND_A_BLANK, ramp_ms=None), False)
def test_no_record_is_the_same_as_what_is_shown_of_another(one: Record, other: Record, short: bool) -> None:
    if parse_record(record_text(one), decimals=3) != parse_record(record_text(other), decimals=3):
        assert compare(shown(one, short=short), other, decimals=3) is not Shown.SAME


@given(records, st.booleans())
@example(PreparedSpeed(Decimal(1000), Decimal(500), Decimal(250)), False)
@example(BEHIND_A_BLANK, False)
def test_no_record_is_read_as_another(record: Record, short: bool) -> None:
    read = read_shown(shown(record, short=short), decimals=3)
    assert read is None or read == parse_record(record_text(record), decimals=3)


@given(records)
def test_every_record_that_fits_an_answer_with_room_to_spare_is_read(record: Record) -> None:
    text = record_text(record)
    if len(text) < 23:
        assert read_shown(text, decimals=3) == parse_record(text, decimals=3)


def test_a_full_answer_to_which_nothing_could_be_added_is_whole() -> None:
    comparator = PreparedOutput(Decimal("250.55"), 10, True)
    text = record_text(comparator)
    assert len(f"N001: {text}") == 30
    assert not may_be_cut(text, decimals=2)
    assert compare(text, comparator, decimals=2) is Shown.SAME
    assert read_shown(text, decimals=2) == comparator


@pytest.mark.parametrize(
    "text",
    ["POSR 1000.0 SPEED 50 ACC", "POSR 1000. SPEED 050 ACC", "PR 1000.000 SD  050 AL 2", "PR 1000.000 SD 050 AL 25"],
)
def test_a_beginning_may_be_spelt_in_any_way(text: str) -> None:
    step = PreparedSpeed(Decimal(1000), Decimal(50), Decimal(250))
    assert compare(text, step, decimals=3) is Shown.BEGINNING


@pytest.mark.parametrize(
    "text", ["POSR 10 SPEED 51 ACCEL 2", "POSR 100 SPEED 50 ACCEL ", "POSR 10 SPEED 50 OUTPUT ", ""]
)
def test_another_beginning_is_something_else(text: str) -> None:
    assert compare(text, STEP, decimals=2) is Shown.OTHER


def test_a_short_text_that_is_only_a_beginning_is_something_else() -> None:
    assert compare("POSA 12", MoveTo(Decimal(125)), decimals=2) is Shown.OTHER


@pytest.mark.parametrize("decimals", [2, 3])
def test_the_decimals_of_the_axis_count(decimals: int) -> None:
    assert (read_shown("POSA 1.125", decimals=decimals) is None) == (decimals == 2)


# ENDs that nothing needs ----------------------------------------------------------------------------------------------


def memory(text: str, *, up_to: int = 20) -> dict[int, Record | None]:
    return {number: parse(text).get(number, End()) for number in range(1, up_to + 1)}


def test_the_end_of_the_program_is_needed_and_what_is_behind_it_is_not() -> None:
    assert superfluous_ends(memory(MANUAL)) == set(range(14, 21))


def test_of_a_memory_that_was_never_written_one_end_remains() -> None:
    assert superfluous_ends(memory("")) == set(range(2, 21))


def test_the_ends_of_loops_are_needed() -> None:
    text = "N001: REPEAT 2\nN002: REPEAT 3\nN003: REPEAT 4\nN004: WAIT 1\nN005: END\nN006: WAIT 1\n"
    assert superfluous_ends(memory(text)) == set(range(10, 21))


@pytest.mark.parametrize("last", [Goto(1), Return()])
def test_behind_a_record_that_does_not_go_on_no_end_is_needed(last: Record) -> None:
    assert superfluous_ends({1: Repeat(Decimal(2)), 2: End(), 3: last, 4: End(), 5: End()}) == {4, 5}


def test_an_end_that_is_jumped_to_is_needed() -> None:
    text = "N001: IF I1=1 GOTO 15\nN002: IF V1<5 GOSUB 16\nN003: IF STOP GOTO 17\nN004: GOTO 18\n"
    assert superfluous_ends(memory(text)) == {*range(5, 15), 19, 20}


def test_behind_a_record_that_cannot_be_read_one_end_is_needed() -> None:
    assert superfluous_ends({1: None, 2: End(), 3: End()}) == {3}
