"""The tables agree with each other and with the sheet's worked examples."""

from __future__ import annotations

from dataclasses import fields

import pytest

from compax_aio.camm1.control_parser import ControlFound, ControlParser
from compax_aio.camm1.facts.handshakes import (
    OUTPUT_RULES,
    PRESETS,
    RESET_EXPANSION,
    OutputKind,
    XonRule,
    xon_when_stored,
)
from compax_aio.camm1.facts.instructions import CONTROL_INSTRUCTIONS, Kind
from compax_aio.camm1.facts.line import (
    BITS_PER_CHARACTER_7E1,
    BITS_PER_CHARACTER_8E1,
    BITS_PER_CHARACTER_8N1,
    MAX_COORDINATE,
    STEPS_PER_S_AT_1_CM_S,
    bits_per_character,
    character_time_s,
)
from compax_aio.camm1.facts.mnemonics import (
    CAMM_GL_III,
    COMMON,
    HP_7470A_SET,
    HP_7475A_SET,
    MODE_1,
    MODE_2,
    Shape,
    mnemonic_of,
)
from compax_aio.camm1.facts.models import MODELS, Fact
from compax_aio.camm1.facts.reports import (
    HP_GL_ERRORS,
    HP_GL_POWER_ON_STATUS,
    IO_ERRORS,
    OUTPUT_INSTRUCTIONS,
    STATUS_CODES,
    STATUS_WORD_BITS,
    StatusStyle,
)
from compax_aio.camm1.instructions import CONTROLS, encode
from compax_aio.certainty import Certainty


@pytest.mark.parametrize("letter", CONTROL_INSTRUCTIONS)
def test_every_control_instruction_has_a_class_with_the_defaults_of_the_table(letter: str) -> None:
    rows = CONTROL_INSTRUCTIONS[letter].parameters
    assert CONTROLS[letter]().parameters == tuple(row.default for row in rows)
    names = [each.name for each in fields(CONTROLS[letter]) if each.name != "signs"]
    assert names == [row.name for row in rows if not row.name.startswith("sign_")]


def test_every_default_is_in_its_range() -> None:
    for row in CONTROL_INSTRUCTIONS.values():
        assert row.source
        assert all(each.lowest <= each.default <= each.highest and each.source for each in row.parameters)
        assert all(each.highest <= 255 for each in row.parameters if each.kind is Kind.CHARACTER)


@pytest.mark.parametrize("text", [*RESET_EXPANSION, *(each for row in PRESETS.values() for each in row.stands_for)])
def test_what_presets_and_reset_stand_for_can_be_said(text: str) -> None:
    found = ControlParser().feed(b"\x1b." + text.encode())
    assert len(found) == 1
    assert isinstance(found[0], ControlFound)
    assert encode(found[0].control) in (
        b"\x1b." + text.encode(),
        b"\x1b." + text.replace(";13:", ":").encode(),
        *_SHORTER,
    )


_SHORTER = (b"\x1b.I;;17:", b"\x1b.M50;;10:", b"\x1b.I;5;6:", b"\x1b.M;17;10:", b"\x1b.@:", b"\x1b.@;0:")
"""Block size 80, terminator 13 and an odd P2 of ``.@`` are defaults."""


@pytest.mark.parametrize(
    ("rule", "size", "threshold", "level"),
    [
        (XonRule.HALF, 1024, 80, 512),
        (XonRule.HALF, 1024, 600, 423),
        (XonRule.HALF, 60, 80, 0),
        (XonRule.FREE_ABOVE_512, 1024, 80, 511),
        (XonRule.STORED_128, 255, 80, 128),
        (XonRule.STORED_128, 255, 200, 54),
        (XonRule.STORED_512, 1024, 512, 512),
        (XonRule.STORED_512, 1024, 600, 423),
    ],
)
def test_when_xon_is_sent(rule: XonRule, size: int, threshold: int, level: int) -> None:
    assert xon_when_stored(rule, size, threshold) == level


def test_times_on_the_wire() -> None:
    assert character_time_s(9600) == pytest.approx(1.04e-3, rel=0.01)
    assert character_time_s(4800) == pytest.approx(2.08e-3, rel=0.01)
    assert bits_per_character() == BITS_PER_CHARACTER_8N1
    assert bits_per_character(8, True) == BITS_PER_CHARACTER_8E1
    assert bits_per_character(7, True) == BITS_PER_CHARACTER_7E1
    assert (MAX_COORDINATE, STEPS_PER_S_AT_1_CM_S) == (67_108_863, 400)


def test_errors_know_what_they_ruin() -> None:
    assert [code for code, row in IO_ERRORS.items() if row.ruins_job] == [15, 16, 17, 18]
    assert [code for code, row in IO_ERRORS.items() if row.refuses_control] == [10, 11, 12, 13, 14]
    assert set(HP_GL_ERRORS) == {0, 1, 2, 3, 5, 6, 8}
    assert all(row.code == code for table in (IO_ERRORS, HP_GL_ERRORS) for code, row in table.items())
    assert all(row.remedy for row in (*IO_ERRORS.values(), *HP_GL_ERRORS.values()) if row.code)


def test_status_numbers_of_the_sheet() -> None:
    assert HP_GL_POWER_ON_STATUS == 24
    assert STATUS_CODES[StatusStyle.HP] - STATUS_CODES[StatusStyle.CODES] == {32, 40}
    assert all(number & ~STATUS_WORD_BITS == 0 for number in (264, 266, 296, 298))


def test_every_output_has_a_rule() -> None:
    assert set(OUTPUT_RULES) == set(OutputKind)
    assert OUTPUT_RULES[OutputKind.REPLY].initiator
    assert not OUTPUT_RULES[OutputKind.ACK_MODE_1].initiator
    assert not OUTPUT_RULES[OutputKind.ACK_MODE_2].terminator


# The languages --------------------------------------------------------------------------------------------------------


def test_every_name_of_a_set_is_known() -> None:
    for names in (CAMM_GL_III, HP_7470A_SET, HP_7475A_SET):
        assert not [name for name in names if mnemonic_of(name) is None]
    assert mnemonic_of("ZZ") is None


def test_letters_of_mode_1_are_those_of_the_manual() -> None:
    assert set(MODE_1) == set("HDMIRLBXPSQNCEAGKT")
    assert all(len(name) == 2 for name in MODE_2)
    assert all(name[0] == "!" for name in COMMON)
    assert set(OUTPUT_INSTRUCTIONS) <= set(MODE_2)


@pytest.mark.parametrize(
    ("name", "right", "wrong"),
    [
        ("PD", [0, 2, 400], [1, 3]),
        ("D", [2, 4], [0, 1, 3]),
        ("C", [5, 6], [4, 7]),
        ("IN", [0, 1], [2]),
        ("IP", [0, 2, 4], [1, 3, 5]),
        ("UC", [0, 1, 7], []),
    ],
)
def test_how_many_numbers_an_instruction_takes(name: str, right: list[int], wrong: list[int]) -> None:
    row = mnemonic_of(name)
    assert row
    assert all(map(row.takes, right))
    assert not any(map(row.takes, wrong))


def test_how_many_numbers_are_told_in_words() -> None:
    said = {name: row.wanted for name in ("PD", "D", "C", "IP", "CI", "SS", "UC") if (row := mnemonic_of(name))}
    assert said == {
        "PD": "pairs of numbers", "D": "pairs of numbers, 2 or more", "C": "5 or 6", "IP": "0, 2 or 4", "CI": "1 or 2",
        "SS": "0", "UC": "numbers",
    }  # fmt: skip


def test_whatever_is_no_list_of_numbers_has_a_shape() -> None:
    assert {name: row.shape for name, row in {**MODE_1, **MODE_2}.items() if row.shape is not Shape.NUMBERS} == {
        "P": Shape.LINE, "LB": Shape.LABEL, "WD": Shape.LABEL, "BL": Shape.LABEL, "DT": Shape.SIGN, "SM": Shape.SIGN,
        "PE": Shape.PACKED, "CO": Shape.QUOTED,
    }  # fmt: skip


# The models -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", MODELS)
def test_every_cell_says_where_it_comes_from(name: str) -> None:
    model = MODELS[name]
    for each in fields(model):
        fact = getattr(model, each.name)
        if isinstance(fact, Fact):
            has_source = fact.certainty not in (Certainty.PLACEHOLDER, Certainty.UNKNOWN)
            assert has_source == bool(fact.source), each.name
            assert fact.known is None or has_source
            assert fact.certainty is not Certainty.UNKNOWN or fact.value is None


@pytest.mark.parametrize("name", MODELS)
def test_a_simulated_machine_of_each_model_has_what_it_needs(name: str) -> None:
    model = MODELS[name]
    needed = (model.buffer_bytes, model.controls, model.colons, model.status_style, model.power_on, model.xon_rule,
              model.ack_rule, model.mnemonics, model.size_waits_for_empty, model.baud_rates)  # fmt: skip
    assert all(fact.value is not None for fact in needed)
    assert model.controls.value
    assert model.controls.value <= set(CONTROL_INSTRUCTIONS)


def test_what_nobody_knows_of_a_pnc_1610_is_no_fact() -> None:
    model = MODELS["PNC-1610"]
    assert (model.buffer_bytes.value, model.buffer_bytes.known) == (1024, None)
    assert (model.identity.value, model.identity.known) == ("1610", None)
    assert model.speeds_cm_s.certainty is Certainty.UNKNOWN
    assert model.model_answer.known == "1610"
