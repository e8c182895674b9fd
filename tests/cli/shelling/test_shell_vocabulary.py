"""What can be typed or looked up: every row of the fact tables is found, with its meaning, and completed."""

from __future__ import annotations

from typing import Any

import pytest
from prompt_toolkit.completion import CompleteEvent
from prompt_toolkit.document import Document
from prompt_toolkit.formatted_text import to_plain_text

from compax_aio import Dialect, DriveSettings
from compax_aio.cli.shelling.completion import LineCompleter
from compax_aio.cli.shelling.entries import Kind
from compax_aio.cli.shelling.explaining import explained, overview
from compax_aio.cli.shelling.vocabulary import Vocabulary, subsequence
from compax_aio.cli.shelling.words import WORDS
from compax_aio.compax.facts.commands import COMMANDS
from compax_aio.compax.facts.control_functions import CONTROL_FUNCTIONS
from compax_aio.compax.facts.device_errors import DEVICE_ERRORS, ERROR_RANGES
from compax_aio.compax.facts.parameters import PARAMETERS, VARIABLES
from compax_aio.compax.facts.program_commands import PROGRAM_COMMANDS
from compax_aio.compax.facts.quantities import QUANTITIES
from compax_aio.compax.facts.status import S16_BITS, S17_BITS, STATUS_VALUES

MM = Vocabulary(DriveSettings(unit="mm"), WORDS)


def help_on(text: str, vocabulary: Vocabulary = MM) -> str:
    reply = explained(vocabulary, text)
    assert reply.people is not None
    return reply.people.plain


def completions(typed: str) -> dict[str, str]:
    document = Document(typed, len(typed))
    found = LineCompleter(MM).get_completions(document, CompleteEvent())
    return {each.text: to_plain_text(each.display_meta) for each in found}


# Every row of the tables can be looked up


@pytest.mark.parametrize("row", STATUS_VALUES, ids=lambda row: f"S{row.number}")
def test_every_status_value_is_explained_by_its_row(row: Any) -> None:
    text = help_on(f"S{row.number}")
    assert row.meaning in text
    assert row.form.value in text
    assert row.source in text
    assert row.certainty.value in text
    assert f"unit    {'mm' if row.unit == 'axis' else row.unit}" in text or row.unit is None


@pytest.mark.parametrize("row", PARAMETERS, ids=lambda row: f"P{row.number}")
def test_every_parameter_is_explained_by_its_row(row: Any) -> None:
    text = help_on(f"p{row.number:03d}")
    assert row.meaning in text
    assert row.source in text
    assert row.certainty.value in text


@pytest.mark.parametrize("row", DEVICE_ERRORS, ids=lambda row: f"E{row.code}")
def test_every_error_is_explained_with_cause_and_remedy(row: Any) -> None:
    text = help_on(f"E{row.code}")
    assert row.meaning in text
    assert row.remedy in text
    assert (row.cause or "") in text
    assert f"UG p. {row.page}" in text


@pytest.mark.parametrize("row", COMMANDS, ids=lambda row: row.long)
def test_every_command_is_explained_by_its_long_and_its_short_form(row: Any) -> None:
    for name in (row.long, row.short.lower()):
        assert row.meaning in help_on(name)
        assert row.source in help_on(name)


@pytest.mark.parametrize("row", PROGRAM_COMMANDS, ids=lambda row: row.long)
def test_every_form_of_a_program_command_stands_in_the_help_of_its_word(row: Any) -> None:
    head = "=" if row.long.startswith("{") else row.long.partition(" ")[0]
    assert f"{row.long}" in help_on(head)
    assert row.meaning in help_on(head)


@pytest.mark.parametrize("row", [row for row in CONTROL_FUNCTIONS if row.word], ids=lambda row: row.word)
def test_every_control_function_with_a_word_is_found(row: Any) -> None:
    assert MM.find(row.word)
    assert row.certainty.value in help_on(row.word)


def test_bits_quantities_and_ranges_stand_where_one_looks_for_them() -> None:
    for number, bits in ((16, S16_BITS), (17, S17_BITS)):
        assert all(f"bit {bit.bit}  {bit.name}: {bit.meaning_when_set}" in help_on(f"S{number}") for bit in bits)
    known = [row for row in QUANTITIES if row.source]
    assert all(f"{row.number}  {row.meaning}" in help_on("S13") for row in known)
    assert "`help S15`" in help_on("P182")
    assert all(row.meaning in help_on(f"E{row.codes[0]}") for row in ERROR_RANGES)
    assert "weight 16: binary transfer" in help_on("P20")
    assert all(MM.find(f"V{number}")[0].kind == Kind.VARIABLE for number in VARIABLES)


# Finding


@pytest.mark.parametrize(
    ("typed", "word"),
    [
        ("POSA 100", "PA"),
        ("pa100", "PA"),
        ("PA-3.5", "PA"),
        ("posa home", "PH"),
        ("S016", "S16"),
        ("P14=5", "P14"),
        ("P3", "P3"),
        ("V5 = 2", "V5"),
        ("n12", "N12"),
        ("N001: END", "N1"),
        ("S200", "S200"),
        ("E7", "E7"),
        ("OT O9=1", "OT"),
        ("GOTO 5", "GOTO"),
        ("=", "="),
        ("torque", None),
        ("S251", None),
        ("P251", None),
        ("V45", None),
        ("N251", None),
        ("PARMS 20", None),
        ("100", None),
    ],
)
def test_what_is_typed_names_its_entry_or_nothing(typed: str, word: str | None) -> None:
    found = MM.find(typed)
    assert (found[0].word if found else None) == word


def test_what_nobody_knows_is_said_to_be_unknown() -> None:
    assert "no page at hand says what it is" in help_on("P3")
    assert "UNKNOWN" in help_on("P3").upper()
    assert "a fault that is not in our table" in help_on("E7")
    assert "no page at hand has it" in help_on("S200")


def test_a_word_of_the_shell_and_a_command_of_one_name_are_both_explained() -> None:
    text = help_on("quit")
    assert "to leave, type exit" in text
    assert "CAN-S p. 28" in text
    assert len(explained(MM, "quit").data["entries"]) == 2


def test_help_finds_by_meaning_and_says_how_many_more_there_are() -> None:
    assert "S5" in help_on("motor torque")
    assert "more" in help_on("position")
    assert "Nothing in the tables" in help_on("banana")
    assert explained(MM, "banana").data == {"entries": []}


def test_the_overview_names_every_word() -> None:
    people = overview().people
    assert people is not None
    assert all(entry.word in people.plain for entry in WORDS)


def test_a_drive_with_words_of_its_own_has_them_in_its_vocabulary() -> None:
    own = Vocabulary(DriveSettings(dialect=Dialect(stop="HALT", real_zero="RZ")), WORDS)
    assert "that of this drive's settings" in help_on("HALT", own)
    assert "takes the actual position as real zero" in help_on("rz", own)
    assert not MM.find("HALT")


def test_ranges_and_units_of_commands_come_from_the_tables() -> None:
    assert "above 0 to 600, 3 decimals (IBS p. 42)" in help_on("SPEED")
    assert "unit    ms" in help_on("ACCEL-")
    assert "0 to 65,000" in help_on("AL")


# Completing


@pytest.mark.parametrize(
    ("typed", "completed", "meaning"),
    [
        ("S1", "S16", "status bits 1"),
        ("pos", "POSA", "move to an absolute position"),
        ("pa", "PA", "move to an absolute position"),
        ("posa h", "POSA HOME", "find machine zero"),
        ("following", "S3", "following error [mm]"),
        ("spd", "SPEED", "speed in %"),
        ("p1", "P14", "positioning window [mm]"),
        ("hel", "help", "explain a word"),
        ("help E5", "E55", "emergency stop"),
        ("help emerg", "E55", "emergency stop"),
        ("watch s5", "S5", "motor torque [%] (inferred)"),
        ("watch pos", "position", "actual position, S1"),
        ("watch position o", "off", "watch no longer"),
        ("params 1", "14", "positioning window [mm]"),
        ("raw POS", "POSA", "move to an absolute position"),
        ("", "move", "move to a position"),
    ],
)
def test_what_is_begun_is_completed_with_its_meaning_beside(typed: str, completed: str, meaning: str) -> None:
    assert meaning in completions(typed)[completed]


@pytest.mark.parametrize("typed", ["PA 100", "move 1", "zzz", "stop ", "move to position"])
def test_where_nothing_fits_nothing_is_offered(typed: str) -> None:
    assert not completions(typed)


def test_errors_cannot_be_typed_and_are_offered_behind_help_alone() -> None:
    assert "E55" not in completions("E")
    assert "E55" in completions("help E")
    assert "E55" not in completions("raw E")


def test_the_nearest_comes_first() -> None:
    assert next(iter(completions("S1"))) == "S1"
    assert next(iter(completions("stop"))) == "stop"


def test_letters_of_a_word_are_found_in_their_order_alone() -> None:
    assert subsequence("SPD", "SPEED")
    assert not subsequence("PD", "SPEED")
    assert not subsequence("SDP", "SPEED")
