"""What the drive says, as values; and the tables by which it is read."""

from __future__ import annotations

import re
from dataclasses import fields
from typing import Any
from unittest.mock import patch

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from compax_aio.compax.codecs import (
    DriveStatus,
    HistoryEntry,
    SerialInterface,
    decode_error,
    decode_history,
    decode_interface,
    decode_monitor_value,
    decode_number,
    decode_status_value,
    value_text,
)
from compax_aio.compax.facts.certainty import Certainty
from compax_aio.compax.facts.device_errors import DEVICE_ERRORS, FAULT_CODES, device_error
from compax_aio.compax.facts.status import MARKERS, S16_BITS, S17_BITS, STATUS_VALUES, Form
from compax_aio.errors import UnexpectedAnswerError

# Numbers --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("answer", "number"),
    [
        ("S001: 12.50", 12.5),
        ("S001: +12.50", 12.5),
        ("S001: -12.50", -12.5),
        ("S001:12.5", 12.5),
        ("S001:     12.50   ", 12.5),
        ("S001: 0000012.500", 12.5),
        ("S001: 12.50 mm", 12.5),
        ("S001: 12.50mm", 12.5),
        ("S001: -.5", -0.5),
        ("S001: 12.", 12.0),
        ("S001: 7", 7.0),
        ("S001=12.5", 12.5),
        ("S001 12.5", 12.5),
        ("S1 -12.5", -12.5),
        ("P040= -1055.88", -1055.88),
    ],
)
def test_a_number_is_read_whatever_stands_around_it(answer: str, number: float) -> None:
    assert decode_number(answer) == number


@pytest.mark.parametrize("answer", ["S001:", "S001: ", "S001", "S1", "S001: ****", "S001: -", "S001: .", "P040="])
def test_an_answer_without_a_number_is_no_number(answer: str) -> None:
    """The number in its head is not the value (P10)."""
    with pytest.raises(UnexpectedAnswerError) as caught:
        decode_number(answer)
    assert caught.value.received == answer


@settings(max_examples=100, deadline=None)
@given(
    number=st.decimals(-4_000_000, 4_000_000, places=2),
    separator=st.sampled_from([": ", ":", "=", " ", ":   "]),
    plus=st.booleans(),
    unit=st.sampled_from(["", " mm", "%", " inch", " °"]),
)
def test_every_number_is_read_as_it_was_sent(number: Any, separator: str, plus: bool, unit: str) -> None:
    sign = "+" if plus and number >= 0 else ""
    assert decode_number(f"S001{separator}{sign}{number}{unit}") == float(number)


def number_or_none(answer: str) -> float | None:
    try:
        return decode_number(answer)
    except UnexpectedAnswerError:
        return None


@settings(max_examples=400, deadline=None)
@given(
    st.lists(
        st.sampled_from(["S001", "S", "1", "23", ":", "=", " ", "\t", "+", "-", ".", ",", "e5", "mm", "_", "\xb2"])
    )
)
@example(["S001", ":", " ", "-", "1", ".", "23"])
@example(["S001", ":", " ", "1", "."])
@example(["S001", ":", " ", "-", ".", "23"])
@example(["S001", ":", " ", "1", "e5"])
def test_a_number_as_it_nearly_always_is_is_read_as_any_other(pieces: list[str]) -> None:
    answer = "".join(pieces)
    at_once = number_or_none(answer)
    with patch("compax_aio.compax.codecs._PLAIN_NUMBER", re.compile(r"(?!)")):
        assert number_or_none(answer) == at_once


@pytest.mark.parametrize(
    ("answer", "text"),
    [("S001: 5", "5"), ("S001:5 ", "5"), ("S001=5", "5"), ("S001 5", "5"), ("S1", ""), ("N005: POSA 250", "POSA 250")],
)
def test_the_text_of_an_answer_is_what_stands_behind_its_number(answer: str, text: str) -> None:
    assert value_text(answer) == text


def test_a_record_keeps_the_signs_of_its_own() -> None:
    assert value_text("N010: OUTPUT O8=1") == "OUTPUT O8=1"


# Status bits ----------------------------------------------------------------------------------------------------------


def test_the_first_digit_is_bit_one() -> None:
    status = DriveStatus.decode("S016: 10000000", "S017: 00100000")
    assert status.no_fault
    assert status.command_active
    assert (status.s16, status.s17) == ("10000000", "00100000")
    assert sum(getattr(status, bit.name) for bit in (*S16_BITS, *S17_BITS)) == 2


@pytest.mark.parametrize("place", range(8))
def test_every_bit_has_its_own_name(place: int) -> None:
    digits = "0" * place + "1" + "0" * (7 - place)
    for bits, status in (
        (S16_BITS, DriveStatus.decode(f"S016: {digits}", "S017: 00000000")),
        (S17_BITS, DriveStatus.decode("S016: 00000000", f"S017: {digits}")),
    ):
        names = [bit.name for bit in (*S16_BITS, *S17_BITS) if getattr(status, bit.name)]
        assert names == [next(bit.name for bit in bits if bit.bit == place + 1)]


@pytest.mark.parametrize("answer", ["S016: 1000 0001", "S016:10000001", "S016: 1 0 0 0 0 0 0 1", "S16=1000 0001"])
def test_a_blank_in_the_middle_means_nothing(answer: str) -> None:
    status = DriveStatus.decode(answer, "S017: 1000 0000")
    assert status.s16 == "10000001"
    assert status.output_0_is_2
    assert status.password_active


@pytest.mark.parametrize(
    "answer", ["S016: 1000000", "S016: 100000000", "S016: 10000002", "S016:", "S016: 0x80", "S016: 128", "S016", ""]
)
def test_a_status_without_eight_binary_digits_is_none(answer: str) -> None:
    for pair in ((answer, "S017: 00000000"), ("S016: 00000000", answer)):
        with pytest.raises(UnexpectedAnswerError) as caught:
            DriveStatus.decode(*pair)
        assert caught.value.received == answer


# Status values --------------------------------------------------------------------------------------------------------


def test_a_position_has_the_axis_own_unit() -> None:
    value = decode_status_value(1, "S001:   -12.50", "mm")
    assert (value.number, value.raw, value.value, value.unit) == (1, "-12.50", -12.5, "mm")
    assert value.meaning == "actual position"


def test_other_values_have_theirs() -> None:
    assert decode_status_value(4, "S004: 55.5", "mm").unit == "%"
    assert decode_status_value(9, "S009: 1234", "mm").unit is None


def test_bits_history_and_pairs_are_decoded_by_their_form() -> None:
    assert decode_status_value(16, "S016: 1000 0001", "mm").value == "10000001"
    assert decode_status_value(18, "S018: 99 55 10 99 53 98 10 99", "mm").value == (99, 55, 10, 99, 53, 98, 10, 99)
    assert decode_status_value(30, "S030: 0 55", "mm").value == (0, 55)
    assert decode_status_value(30, "S030: 55", "mm").value == (55,)


@pytest.mark.parametrize("number", [19, 22, 27, 40, 99, 250])
def test_a_status_that_no_page_explains_is_given_as_it_came(number: int) -> None:
    value = decode_status_value(number, f"S{number:03d}: 12 abc", "mm")
    assert (value.value, value.raw, value.unit, value.meaning) == ("12 abc", "12 abc", None, "unknown")
    assert value.certainty is Certainty.UNKNOWN


@pytest.mark.parametrize("number", [19, 23, 26, 31, 39, 40])
@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("12", 12), ("-12", -12), ("+7", 7), ("0012", 12), ("12.5", 12.5), ("-.5", -0.5), ("5.", 5.0),
        ("1 2", "1 2"), ("0x1F", "0x1F"), ("12 V", "12 V"), ("V2.07", "V2.07"), ("1e3", "1e3"), ("", ""), (".", "."),
        ("-", "-"), ("1234567890123456", "1234567890123456"),
    ],
)  # fmt: skip
def test_a_value_of_unknown_form_is_a_number_only_where_it_is_nothing_else(
    number: int, text: str, value: float | str
) -> None:
    """Diagnosis and identification (IBS p. 12): their text on RS-232 is on no page at hand."""
    read = decode_status_value(number, f"S{number:03d}: {text}", "mm")
    assert (read.value, type(read.value), read.raw) == (value, type(value), text)


# Chosen quantities ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("chosen", "meaning", "unit", "certainty"),
    [
        ("P233: 29", "effective load of the motor", "%", Certainty.DOCUMENTED),
        ("P233: 27", "position of the external encoder", "mm", Certainty.DOCUMENTED),
        ("P233: 17", "HEDA transmission errors", None, Certainty.DOCUMENTED),
        ("P233: 1", "not on a page at hand", None, Certainty.UNKNOWN),
        ("P233: 99", "not on a page at hand", None, Certainty.UNKNOWN),
        ("P233: 0", "not on a page at hand", None, Certainty.UNKNOWN),
    ],
)
def test_a_monitor_value_is_what_its_parameter_chooses(
    chosen: str, meaning: str, unit: str | None, certainty: Certainty
) -> None:
    """UG p. 211."""
    value = decode_monitor_value(13, chosen, "S013: 12.50", "mm")
    assert (value.number, value.chosen, value.raw, value.value) == (13, int(chosen.split()[1]), "12.50", 12.5)
    assert value.meaning.startswith(meaning)
    assert (value.unit, value.certainty) == (unit, certainty)


@pytest.mark.parametrize(
    ("chosen", "answer"),
    [("P233: 1.5", "S013: 1"), ("P233: ", "S013: 1"), ("P233: 29", "S013: ?"), ("P233: " + "9" * 400, "S013: 1")],
)
def test_a_monitor_value_is_not_guessed(chosen: str, answer: str) -> None:
    with pytest.raises(UnexpectedAnswerError):
        decode_monitor_value(13, chosen, answer, "mm")


# The serial interface -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("answer", "is_set", "unknown"),
    [
        ("P020: 0", "", 0),
        ("P020: 1", "xonxoff", 0),
        ("P020: 2", "errors_suppressed", 0),
        ("P020: 3", "xonxoff errors_suppressed", 0),
        ("P020: 16", "binary", 0),
        ("P020: 19", "xonxoff errors_suppressed binary", 0),
        ("P020: 12", "", 12),
        ("P020: 255.000", "xonxoff errors_suppressed binary", 236),
    ],
)
def test_p20_says_how_the_serial_interface_behaves(answer: str, is_set: str, unknown: int) -> None:
    """UG p. 166 for 3 and 19."""
    interface = decode_interface(answer)
    assert [name for name in ("xonxoff", "errors_suppressed", "binary") if getattr(interface, name)] == is_set.split()
    assert (interface.raw, interface.unknown) == (int(float(answer.split()[1])), unknown)


@pytest.mark.parametrize("answer", ["P020: 1.5", "P020: -1", "P020:", "P020: E92", "P020: " + "9" * 400])
def test_a_p20_that_is_no_whole_number_is_not_read(answer: str) -> None:
    with pytest.raises(UnexpectedAnswerError) as caught:
        decode_interface(answer)
    assert caught.value.received == answer


@given(p20=st.integers(0, 2**16))
def test_no_bit_of_p20_gets_lost(p20: int) -> None:
    interface = SerialInterface.decode(p20)
    assert interface.raw == p20
    assert interface.unknown + interface.xonxoff + 2 * interface.errors_suppressed + 16 * interface.binary == p20


def test_a_number_that_is_none_is_unexpected() -> None:
    with pytest.raises(UnexpectedAnswerError):
        decode_status_value(1, "S001: ???", "mm")


# Errors ---------------------------------------------------------------------------------------------------------------


def test_the_error_history_of_the_manual_is_read_as_the_manual_reads_it() -> None:
    """UG p. 209: newest first; a mark stands before the error that it ended."""
    assert decode_history("S018: 99 55 10 99 53 98 10 99") == (
        HistoryEntry(error=device_error(55), ended_by="acknowledged"),
        HistoryEntry(error=device_error(10), ended_by=None),
        HistoryEntry(error=device_error(53), ended_by="acknowledged"),
        HistoryEntry(error=device_error(10), ended_by="power-on"),
    )


def test_empty_places_of_the_history_are_no_errors() -> None:
    assert decode_history("S018: 00 00 00 00 00 00 00 00") == ()
    assert [entry.error.code for entry in decode_history("S018: 55 00 00 00 00 00 00 00")] == [55]


@pytest.mark.parametrize(
    ("answer", "code"),
    [
        ("S030: 55", 55),
        ("S030: 0 55", 55),
        ("S030: 55 0", 55),
        ("S030: 055 000", 55),
        ("S030: 0", None),
        ("S030: 0 0", None),
    ],
)
def test_the_error_is_one_number_or_two(answer: str, code: int | None) -> None:
    error = decode_error(answer)
    assert (error.code if error else None) == code


def test_an_error_that_no_page_explains_says_so() -> None:
    error = device_error(17)
    assert (error.code, error.page) == (17, None)
    assert "not in our table" in str(error)
    assert "fault" in error.meaning
    assert "fault" not in device_error(90).meaning


def test_a_known_error_says_where_it_stands() -> None:
    assert str(device_error(92)) == "E92: a move is already active; await it or stop it first (p. 209)"


# Tables ---------------------------------------------------------------------------------------------------------------


def test_no_error_code_stands_twice() -> None:
    codes = [row.code for row in DEVICE_ERRORS]
    assert len(set(codes)) == len(codes)
    assert 57 in FAULT_CODES
    assert 0 not in FAULT_CODES
    assert 92 not in FAULT_CODES


def test_every_status_stands_once_those_of_unknown_meaning_too() -> None:
    assert [fact.number for fact in STATUS_VALUES] == list(range(1, 40))
    unknown = [fact.number for fact in STATUS_VALUES if fact.certainty is Certainty.UNKNOWN]
    assert unknown == [19, 20, 21, 22, 27, 28, 29]
    assert all((fact.meaning == "unknown") == (fact.certainty is Certainty.UNKNOWN) for fact in STATUS_VALUES)
    assert all(bool(fact.source) == (fact.certainty is not Certainty.UNKNOWN) for fact in STATUS_VALUES)


def test_every_bit_stands_once_and_has_a_field() -> None:
    assert [bit.bit for bit in S16_BITS] == [bit.bit for bit in S17_BITS] == list(range(1, 9))
    names = [bit.name for bit in (*S16_BITS, *S17_BITS)]
    assert sorted([*names, "s16", "s17"]) == sorted(field.name for field in fields(DriveStatus))


def test_markers_are_status_values_whose_answers_differ() -> None:
    documented = {fact.number: fact.form for fact in STATUS_VALUES}
    assert len(set(MARKERS)) == len(MARKERS) == 14
    assert all(documented[number] in {Form.NUMBER, Form.BITS, Form.PAIR} for number in MARKERS)


def test_a_sign_may_stand_apart_from_its_number() -> None:
    assert decode_number("S001: -  12.5") == -12.5


def test_digits_behind_a_letter_are_no_number() -> None:
    with pytest.raises(UnexpectedAnswerError):
        decode_number("S001: E92")


def test_an_equals_sign_further_on_belongs_to_the_value() -> None:
    assert value_text("N005 OUTPUT O7=1") == "OUTPUT O7=1"


@pytest.mark.parametrize(("number", "answer"), [(16, "S016: 12"), (18, "S018: abc"), (30, "S030: ")])
def test_a_status_value_without_its_form_is_refused(number: int, answer: str) -> None:
    with pytest.raises(UnexpectedAnswerError):
        decode_status_value(number, answer, "mm")


def test_an_unreadable_error_is_not_taken_for_no_error() -> None:
    with pytest.raises(UnexpectedAnswerError):
        decode_error("S030: ???")
    with pytest.raises(UnexpectedAnswerError):
        decode_history("S018: ???")


@pytest.mark.parametrize("text", ["1,5", "1 234.56", "1.5E3", "1.5e-3", "12.3.4", "5-", "5 -", "3'000", "1 2"])
def test_a_number_that_would_be_misread_is_refused(text: str) -> None:
    with pytest.raises(UnexpectedAnswerError, match="no number"):
        decode_number(f"S001: {text}")


@pytest.mark.parametrize(
    "text", ["12.5", " 12.5 ", "+12.5", "12.5mm", "12.5 mm/s2", "12.5 %", "12.5 E", "= 12.5 mm (actual)"]
)
def test_a_unit_or_a_remark_behind_a_number_does_no_harm(text: str) -> None:
    assert decode_number(f"S001: {text}") == 12.5
