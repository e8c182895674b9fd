"""A profile says what is known of a machine, and what is not; a wrong one is refused before it words anything."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from compax_aio.camm1.facts.models import MODELS
from compax_aio.camm1.facts.reports import StatusStyle
from compax_aio.camm1.profiles import (
    CX_24,
    DXY_1300,
    GS_24,
    HP_7470A,
    HP_7475A,
    PNC_900,
    PNC_1050,
    PNC_1610,
    PROFILES,
    Profile,
    profile_named,
)
from compax_aio.errors import InvalidCommandError


def test_every_model_has_a_profile() -> None:
    assert set(PROFILES) == set(MODELS)
    assert all(profile_named(name) is profile for name, profile in PROFILES.items())


def test_a_placeholder_of_the_simulator_is_unknown_to_the_client() -> None:
    assert PNC_1610.buffer_bytes is None
    assert PNC_1610.identity is None
    assert PNC_1610.size_waits_for_empty is None
    assert CX_24.status_style is None
    assert HP_7470A.identity is None


def test_what_the_manuals_say_is_in_the_profiles() -> None:
    assert PNC_1610.colons == frozenset("OA")
    assert (PNC_1610.model_answer, PNC_1610.status_style) == ("1610", StatusStyle.WORD)
    assert "P" in PNC_1610.controls
    assert "@" not in PNC_1610.controls
    assert (PNC_900.buffer_bytes, PNC_900.identity, PNC_900.speeds_cm_s) == (1024, "900", (1, 20))
    assert PNC_900.mnemonics_are_documented
    assert PNC_900.area_mm
    assert min(PNC_900.area_mm) == 280
    assert (PNC_1050.lowest_threshold, PNC_1610.lowest_threshold) == (10, 0)
    assert (HP_7470A.buffer_bytes, HP_7470A.acknowledges_at_equal, PNC_900.acknowledges_at_equal) == (255, True, False)
    assert (GS_24.force_instruction, GS_24.forces) == ("!FS", (30, 350))
    assert "!FS" in GS_24.mnemonics
    assert "!FS" not in PNC_900.mnemonics


def test_languages_follow_from_the_mnemonics() -> None:
    assert PNC_900.has_mode_1
    assert DXY_1300.has_mode_1
    assert not HP_7475A.has_mode_1


@pytest.mark.parametrize("name", ["pnc1610", "PNC-1610", "Pnc_1610", " pnc 1610"])
def test_a_profile_is_found_however_its_name_is_spaced(name: str) -> None:
    assert profile_named(name) is PNC_1610


def test_a_name_of_nobody_is_told_with_those_that_there_are() -> None:
    with pytest.raises(InvalidCommandError, match="no profile 'pnc'; there are PNC-1610, PNC-900"):
        profile_named("pnc")


@pytest.mark.parametrize(
    "change",
    [
        {"name": ""}, {"controls": frozenset("B")}, {"controls": frozenset("BEK?")}, {"controls": "BEK"},
        {"colons": frozenset("x")}, {"buffer_bytes": 0}, {"buffer_bytes": True}, {"baud_rate": None},
        {"lowest_threshold": -1}, {"lowest_threshold": 20_000}, {"status_style": "word"}, {"model_answer": "\n"},
        {"identity": 900}, {"size_waits_for_empty": 1}, {"acknowledges_at_equal": None}, {"mnemonics": frozenset()},
        {"mnemonics": {"PU"}}, {"steps_per_mm": 0}, {"steps_per_mm": float("nan")}, {"area_mm": (0, 1)},
        {"area_mm": (1, 2, 3)}, {"speeds_cm_s": (20, 1)}, {"speeds_cm_s": (0, 1)}, {"force_instruction": "XX"},
        {"forces": (1,)}, {"tool_instruction": "!FS"}, {"tools": "01"}, {"feeds_mm": (float("inf"), 1)},
        {"remarks": None},
    ],
)  # fmt: skip
def test_what_cannot_be_meant_is_refused(change: dict[str, Any]) -> None:
    with pytest.raises(InvalidCommandError, match=f"^{next(iter(change))} of a profile is "):
        replace(PNC_1610, **change)


def test_a_profile_can_be_made_of_little() -> None:
    profile = Profile(name="Mine")
    assert (profile.speeds_cm_s, profile.buffer_bytes, profile.baud_rate) == (None, None, 9600)
