"""A profile says what differs among the members of the family, and knows what it does not know."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import pytest

from compax_aio.errors import InvalidCommandError
from compax_aio.smc.facts import COMMANDS, MAX_POSITION
from compax_aio.smc.profile import DCB_274, IM483I, MCPHERSON_789A4, PANTHER, PROFILES, Profile

every_profile = pytest.mark.parametrize("profile", PROFILES.values(), ids=PROFILES)


def test_profiles_are_found_by_names_that_fit_into_a_url() -> None:
    assert list(PROFILES.values()) == [DCB_274, IM483I, PANTHER, MCPHERSON_789A4]
    assert all(name == name.lower() and name.isascii() and name.replace("-", "").isalnum() for name in PROFILES)


@every_profile
def test_a_profile_knows_only_commands_of_which_something_is_known(profile: Profile) -> None:
    assert profile.commands <= set(COMMANDS)
    assert {"^", "Z", "R", "@"} <= profile.commands


@every_profile
def test_what_a_profile_asks_with_is_a_command_that_it_has(profile: Profile) -> None:
    queries = (profile.position_query, profile.limits_query, profile.home_query, profile.port_query)
    assert {query[0] for query in queries if query} <= profile.commands
    assert ("]" in profile.commands) == (profile.limits_query is not None)
    assert ("A" in profile.commands) == bool(profile.output_bits)


def test_what_is_not_known_of_a_dcb_is_none() -> None:
    unknown = {each.name for each in fields(Profile) if getattr(DCB_274, each.name) is None}
    assert unknown == {
        *("limits_query", "plus_limit_bit", "minus_limit_bit", "home_query", "home_bit", "home_toward_plus"),
        *("port_query", "settling_delays", "last_program_address"),
    }


def test_the_relatives_differ_as_their_drivers_do() -> None:
    assert (IM483I.plus_limit_bit, IM483I.minus_limit_bit, IM483I.home_toward_plus) == (0, 1, 0)
    assert (PANTHER.plus_limit_bit, PANTHER.minus_limit_bit, PANTHER.home_toward_plus) == (1, 0, 1)
    assert (MCPHERSON_789A4.plus_limit_bit, MCPHERSON_789A4.minus_limit_bit, MCPHERSON_789A4.home_bit) == (6, 7, 5)
    assert [each.speeds_steps_s for each in PROFILES.values()] == [(20, 20_000)] * 3 + [(36, 60_000)]
    assert [each.decimals for each in PROFILES.values()] == [2, 2, 0, 0]
    assert [each.position_query for each in PROFILES.values()] == ["Z", "Z0", "Z0", "Z0"]
    assert [each.separator for each in PROFILES.values()] == [" ", " ", " ", ","]


def test_a_user_makes_a_profile_of_their_own() -> None:
    mine = replace(DCB_274, name="mine", commands=DCB_274.commands | {"]"}, limits_query="]0", plus_limit_bit=3)
    assert (mine.name, mine.plus_limit_bit, mine.decimals) == ("mine", 3, 2)


class OfText(str):
    pass


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"name": ""}, "name of a profile is a printable text, not ''"),
        ({"name": "a\nb"}, "name of a profile is a printable text, not 'a\\nb'"),
        ({"commands": {"R"}}, "commands of a profile is a frozenset of single characters, @ Z ^ among them, not {'R'}"),
        ({"commands": frozenset({"@", "^", "Z", "R1"})}, "single characters"),
        ({"commands": frozenset("^ZR")}, "@ Z ^ among them"),
        ({"speeds_steps_s": (0, 5)}, "(20, 20000), both above 0, not (0, 5)"),
        ({"speeds_steps_s": (50, 5)}, "a lowest and a highest whole number"),
        ({"speeds_steps_s": [20, 50]}, "a lowest and a highest whole number"),
        ({"speeds_steps_s": (True, 50)}, "a lowest and a highest whole number"),
        ({"max_position": MAX_POSITION + 1}, "a number above 0 and at most 8,388,607.99"),
        ({"max_position": float("nan")}, "a number above 0"),
        ({"max_position": 0}, "a number above 0"),
        ({"decimals": 1}, "decimals of a profile is 0 or 2, not 1"),
        ({"decimals": True}, "0 or 2, not True"),
        ({"separator": ";"}, "separator of a profile is ' ' or ',', not ';'"),
        ({"position_query": None}, "a command of 1 to 12 printable characters, not None"),
        ({"position_query": OfText("Z")}, "a command of 1 to 12 printable characters"),
        ({"limits_query": "]" * 13}, "1 to 12 printable characters, or None where it is not known"),
        ({"home_query": "]\n"}, "1 to 12 printable characters"),
        ({"plus_limit_bit": -1}, "a bit from 0 to 15, or None where it is not known, not -1"),
        ({"home_bit": 16}, "a bit from 0 to 15"),
        ({"minus_limit_bit": False}, "a bit from 0 to 15"),
        ({"input_bits": (0, 0)}, "bits from 0 to 15, each once"),
        ({"output_bits": [3]}, "bits from 0 to 15, each once, as a tuple"),
        ({"home_toward_plus": 2}, "0 or 1, or None"),
        ({"home_toward_plus": True}, "0 or 1, or None"),
        ({"settling_delays": (5, 1)}, "or None where it is not known"),
        ({"last_program_address": -1}, "a whole number, not below 0, or None"),
        ({"refusals": ("?",)}, "a frozenset of texts"),
        ({"refusals": frozenset({" "})}, "a frozenset of texts"),
        ({"sign_on_marks": "AMS"}, "a tuple of texts"),
        ({"reset_time_s": float("inf")}, "a finite number of seconds, not below 0, not inf"),
        ({"first_look_after_home_s": -1}, "a finite number of seconds"),
        ({"reset_time_s": True}, "a finite number of seconds"),
    ],
)
def test_what_cannot_be_meant_is_refused_when_the_profile_is_made(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(InvalidCommandError) as caught:
        replace(DCB_274, **changes)
    assert said in str(caught.value)
