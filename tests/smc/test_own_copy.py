"""What this end knows of the settings of an axis it knows, and the rest it does not make up (P10)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.hostile.wicked import refusal

from compax_aio.smc.facts import COMMANDS
from compax_aio.smc.own_copy import SETTING_LETTERS, AxisSettings, SettingsCopy

NAMES = [each.name for each in fields(AxisSettings)]
SPEED, RAMP = "slew_speed_steps_s", "acceleration_slope"


@pytest.fixture
def copy() -> SettingsCopy:
    """One that knows a speed, stored, and a ramp that is not."""
    copy = SettingsCopy()
    copy.note_written(SPEED, 5000)
    copy.note_stored()
    copy.note_written(RAMP, 7)
    return copy


def test_at_first_nothing_is_known() -> None:
    copy = SettingsCopy()
    assert copy.settings == copy.stored_settings == AxisSettings()
    assert [copy.get(name) for name in NAMES] == [None] * len(NAMES)


def test_what_was_written_is_known(copy: SettingsCopy) -> None:
    assert (copy.get(SPEED), copy.get(RAMP)) == (5000, 7)
    assert copy.settings == AxisSettings(slew_speed_steps_s=5000, acceleration_slope=7)
    assert copy.stored_settings == AxisSettings(slew_speed_steps_s=5000)


def test_a_snapshot_stays_as_it_was(copy: SettingsCopy) -> None:
    before = copy.settings
    copy.note_written(SPEED, 1)
    assert before.slew_speed_steps_s == 5000


def test_what_may_have_been_taken_is_not_known(copy: SettingsCopy) -> None:
    copy.note_in_doubt(SPEED)
    copy.note_in_doubt("resolution")
    assert copy.settings == AxisSettings(acceleration_slope=7)


def test_a_reset_brings_back_what_was_stored_and_forgets_the_rest(copy: SettingsCopy) -> None:
    copy.note_written(SPEED, 100)
    copy.note_reset()
    assert copy.settings == AxisSettings(slew_speed_steps_s=5000)
    copy.note_written(SPEED, 200)
    assert copy.stored_settings.slew_speed_steps_s == 5000


def test_what_is_in_doubt_when_it_is_stored_is_in_doubt_after_a_reset(copy: SettingsCopy) -> None:
    copy.note_in_doubt(SPEED)
    copy.note_stored()
    copy.note_written(SPEED, 100)
    copy.note_reset()
    assert copy.settings == AxisSettings(acceleration_slope=7)


def test_a_store_in_doubt_leaves_known_what_it_cannot_have_changed(copy: SettingsCopy) -> None:
    copy.note_store_in_doubt()
    assert copy.stored_settings == AxisSettings(slew_speed_steps_s=5000)
    copy.note_written(SPEED, 100)
    copy.note_store_in_doubt()
    assert copy.stored_settings == AxisSettings()


def test_what_the_axis_shows_is_known_and_the_rest_stays(copy: SettingsCopy) -> None:
    copy.note_shown(AxisSettings(slew_speed_steps_s=300, variable_resolution=False))
    assert copy.settings == AxisSettings(slew_speed_steps_s=300, acceleration_slope=7, variable_resolution=False)


def test_an_axis_that_was_in_other_hands_is_a_stranger(copy: SettingsCopy) -> None:
    copy.forget()
    copy.note_reset()
    assert copy.settings == copy.stored_settings == AxisSettings()


@pytest.mark.parametrize("text", ["R5", "+1", "^", "Z0", "]0", "@", "O0", "F100 0", "P0", "A8", "Q", "X", "M0"])
def test_a_raw_command_that_sets_nothing_changes_nothing(copy: SettingsCopy, text: str) -> None:
    copy.note_raw(text)
    assert copy.settings == AxisSettings(slew_speed_steps_s=5000, acceleration_slope=7)


@pytest.mark.parametrize("text", ["V100", " V 100", "V"])
def test_a_raw_setting_makes_what_it_sets_unknown(copy: SettingsCopy, text: str) -> None:
    copy.note_raw(text)
    assert copy.settings == AxisSettings(acceleration_slope=7)
    assert copy.stored_settings == AxisSettings(slew_speed_steps_s=5000)


def test_a_raw_store_is_one_in_doubt(copy: SettingsCopy) -> None:
    copy.note_written(SPEED, 1)
    copy.note_raw("S")
    assert copy.stored_settings == AxisSettings()


@pytest.mark.parametrize("text", ["B1", "C1", "v5", "", "i5"])
def test_a_raw_command_that_nobody_knows_may_do_anything(copy: SettingsCopy, text: str) -> None:
    copy.note_raw(text)
    copy.note_reset()
    assert copy.settings == AxisSettings()


def test_a_program_of_unknown_content_may_set_anything_but_stores_nothing(copy: SettingsCopy) -> None:
    copy.note_raw("G0")
    assert copy.settings == AxisSettings()
    assert copy.stored_settings == AxisSettings(slew_speed_steps_s=5000)


def test_a_program_sets_what_stands_in_it(copy: SettingsCopy) -> None:
    copy.note_program_ran(["O0", "R100", "W0", "J1 3"])
    assert copy.get(SPEED) == 5000
    copy.note_program_ran(["V100", "R100"])
    assert copy.settings == AxisSettings(acceleration_slope=7)


def test_what_is_no_setting_is_refused(copy: SettingsCopy) -> None:
    works: list[Callable[[], object]] = [
        lambda: copy.get("speed"),
        lambda: copy.note_written("speed", 1),
        lambda: copy.note_in_doubt("speed"),
    ]
    for work in works:
        assert refusal(work) == f"there is no setting 'speed' of an axis; there are {', '.join(NAMES)}"


def test_every_setting_has_its_command() -> None:
    assert sorted(name for names in SETTING_LETTERS.values() for name in names) == sorted(NAMES)
    assert set(SETTING_LETTERS) <= set(COMMANDS)


class Axis:
    """What really happens: an axis that takes what it is told, or does not."""

    def __init__(self) -> None:
        self.now: dict[str, Any] = dict.fromkeys(NAMES, -1)
        self.stored = dict(self.now)


@given(st.lists(st.tuples(st.sampled_from(["write", "doubt", "store", "doubtful store", "reset"]),
                          st.sampled_from(NAMES[:3]), st.integers(0, 3), st.booleans()), max_size=30))  # fmt: skip
def test_what_is_known_is_true(happenings: list[tuple[str, str, int, bool]]) -> None:
    copy, axis = SettingsCopy(), Axis()
    for what, name, value, is_taken in happenings:
        if what == "write":
            copy.note_written(name, value)
            axis.now[name] = value
        elif what == "doubt":
            copy.note_in_doubt(name)
            axis.now[name] = value if is_taken else axis.now[name]
        elif what == "reset":
            copy.note_reset()
            axis.now = dict(axis.stored)
        else:
            copy.note_stored() if what == "store" else copy.note_store_in_doubt()
            axis.stored = dict(axis.now) if is_taken or what == "store" else axis.stored
        for each in NAMES:
            assert copy.get(each) in {None, axis.now[each]}
            assert getattr(copy.stored_settings, each) in {None, axis.stored[each]}
