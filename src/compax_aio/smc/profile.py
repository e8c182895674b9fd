"""What differs among the members of the family, as data that a user can change."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from math import isfinite
from types import MappingProxyType
from typing import Any, Final

from ..errors import InvalidCommandError
from ..escaping import shown
from .facts import MAX_COMMAND_LENGTH, MAX_POSITION

__all__ = ["DCB_274", "IM483I", "MCPHERSON_789A4", "NEEDED", "PANTHER", "PROFILES", "Profile"]


NEEDED: Final = frozenset("@^Z")
"""Soft stop, status and position: an axis without them could not be watched, nor stopped alone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """
    One member of the family; ``dataclasses.replace()`` makes another. Nothing asks for its name.

    None stands for what is not known, and stays so: what needs it is refused, or None as well.

    Attributes:
        name: For people.
        commands: The letters that this member is known to have, by the manual or by a driver that works with it.
        speeds_steps_s: Lowest and highest of I, V, M and F in steps/s (gem-controld, IM483I.h: 20 to 20000; on the
            789A-4 known of V alone, 36 to 60000). That of a DCB is on no page at hand.
        max_position: Largest size of a position or distance in steps (DCB p. 26; gem-controld).
        decimals: 2 if fractions of a step may be sent (DCB p. 26; gem-controld), else 0.
        separator: Between two arguments: a blank (DCB p. 24; panther) or a comma (789A-4).
        position_query: What asks for the position: ``Z`` is enough for a DCB (DCB p. 26), drivers send ``Z0``.
        limits_query: What asks for the limit inputs: ``]0`` (motorIms, panther) or ``]`` (789A-4).
        plus_limit_bit: Bit of that answer, counted from 0; motorIms and panther have it the other way round.
        minus_limit_bit: The same.
        home_query: What asks for the home input: ``]1`` (motorIms) or ``]`` (789A-4).
        home_bit: Bit of that answer, counted from 0; on a 789A-4 it has a meaning only after ``A8``.
        port_query: What asks for the port (``A129``: gem-controld).
        input_bits: Bits of the port, of input 1, 2 … (gem-controld); empty if not known.
        output_bits: The same of outputs; what A may set (gem-controld; on a 789A-4 A8 and A24 were seen).
        home_toward_plus: Which direction of F leads toward plus, 0 (motorIms) or 1 (panther).
        ramp_slopes: Lowest and highest of K.
        current_percents: Lowest and highest of Y.
        resolutions: Lowest and highest of D (gem-controld).
        settling_delays: Lowest and highest of E; their unit is not known either.
        last_program_address: Highest address of the program memory.
        refusals: Answers that mean that a command was not understood; which there are is not documented.
        sign_on_marks: What stands in a sign-on, by which a reset is noticed that nobody asked for.
        reset_time_s: How long it listens to nobody after ^C: 0.2 s (gem-controld) or 1 s (motorIms).
        first_look_after_home_s: Its status shows no motion sooner after F (789A-4).
    """

    name: str
    commands: frozenset[str]
    speeds_steps_s: tuple[int, int] = (20, 20_000)
    max_position: float = MAX_POSITION
    decimals: int = 0
    separator: str = " "
    position_query: str = "Z0"
    limits_query: str | None = None
    plus_limit_bit: int | None = None
    minus_limit_bit: int | None = None
    home_query: str | None = None
    home_bit: int | None = None
    port_query: str | None = None
    input_bits: tuple[int, ...] = ()
    output_bits: tuple[int, ...] = ()
    home_toward_plus: int | None = None
    ramp_slopes: tuple[int, int] = (0, 255)
    current_percents: tuple[int, int] = (0, 100)
    resolutions: tuple[int, int] = (0, 8)
    settling_delays: tuple[int, int] | None = None
    last_program_address: int | None = None
    refusals: frozenset[str] = frozenset({"?", "#"})
    sign_on_marks: tuple[str, ...] = ("AMS", "ADVANCED MICRO SYSTEMS")
    reset_time_s: float = 1.0
    first_look_after_home_s: float = 1.0

    def __post_init__(self) -> None:
        """Refuse what cannot be meant, before a command is worded by it."""
        for each in fields(self):
            value, (is_meant, wanted) = getattr(self, each.name), _EXPECTED[each.name]
            if not is_meant(value):
                raise InvalidCommandError(f"{each.name} of a profile is {wanted}, not {shown(value)}")


# What a field may be -------------------------------------------------------------------------------------------------

_HIGHEST_BIT: Final = 15

_Expected = tuple[Callable[[Any], bool], str]
"""A test, and in words what passes it."""


def _is_whole(value: object) -> bool:
    return type(value) is int and value >= 0


def _is_bit(value: object) -> bool:
    return type(value) is int and 0 <= value <= _HIGHEST_BIT


def _is_text(value: object) -> bool:
    return type(value) is str and value.isascii() and value.isprintable() and bool(value.strip())


def _is_query(value: object) -> bool:
    return type(value) is str and _is_text(value) and len(value) <= MAX_COMMAND_LENGTH


def _is_seconds(value: object) -> bool:
    return type(value) in (int, float) and isfinite(value) and value >= 0  # type: ignore[arg-type, operator]


def _is_span(value: object) -> bool:
    return type(value) is tuple and len(value) == 2 and all(map(_is_whole, value)) and value[0] <= value[1]


def _are_bits(value: object) -> bool:
    return type(value) is tuple and all(map(_is_bit, value)) and len(set(value)) == len(value)


def _are_letters(value: object) -> bool:
    return type(value) is frozenset and all(_is_text(each) and len(each) == 1 for each in value) and value >= NEEDED


def _or_unknown(is_meant: Callable[[Any], bool], wanted: str) -> _Expected:
    return (lambda value: value is None or is_meant(value), f"{wanted}, or None where it is not known")


_SPAN: Final = (_is_span, "a lowest and a highest whole number, (20, 20000)")
_SECONDS: Final = (_is_seconds, "a finite number of seconds, not below 0")
_BIT: Final = _or_unknown(_is_bit, f"a bit from 0 to {_HIGHEST_BIT}")
_BITS: Final = (_are_bits, f"bits from 0 to {_HIGHEST_BIT}, each once, as a tuple")
_QUERY: Final = (_is_query, f"a command of 1 to {MAX_COMMAND_LENGTH} printable characters")

_EXPECTED: Final[Mapping[str, _Expected]] = {
    "name": (_is_text, "a printable text"),
    "commands": (_are_letters, f"a frozenset of single characters, {' '.join(sorted(NEEDED))} among them"),
    "speeds_steps_s": (lambda value: _is_span(value) and value[0] > 0, f"{_SPAN[1]}, both above 0"),
    "max_position": (
        lambda value: _is_seconds(value) and 0 < value <= MAX_POSITION,
        f"a number above 0 and at most {MAX_POSITION:,.2f}",
    ),
    "decimals": (lambda value: _is_whole(value) and value in (0, 2), "0 or 2"),
    "separator": (lambda value: type(value) is str and value in (" ", ","), "' ' or ','"),
    "position_query": _QUERY,
    "limits_query": _or_unknown(*_QUERY),
    "plus_limit_bit": _BIT,
    "minus_limit_bit": _BIT,
    "home_query": _or_unknown(*_QUERY),
    "home_bit": _BIT,
    "port_query": _or_unknown(*_QUERY),
    "input_bits": _BITS,
    "output_bits": _BITS,
    "home_toward_plus": _or_unknown(lambda value: _is_whole(value) and value in (0, 1), "0 or 1"),
    "ramp_slopes": _SPAN,
    "current_percents": _SPAN,
    "resolutions": _SPAN,
    "settling_delays": _or_unknown(*_SPAN),
    "last_program_address": _or_unknown(_is_whole, "a whole number, not below 0"),
    "refusals": (lambda value: type(value) is frozenset and all(map(_is_text, value)), "a frozenset of texts"),
    "sign_on_marks": (lambda value: type(value) is tuple and all(map(_is_text, value)), "a tuple of texts"),
    "reset_time_s": _SECONDS,
    "first_look_after_home_s": _SECONDS,
}


# Ready-made ----------------------------------------------------------------------------------------------------------

_EVERY: Final = frozenset("RF@^ZOVKPGXS")
"""Seen on all of them: the manual and each of the drivers."""

DCB_274: Final = Profile(
    name="DCB-274",
    commands=_EVERY | frozenset("+-MDQJW"),  # M and D: DCB p. 27; Q, J and W: DCB p. 24
    decimals=2,
    position_query="Z",
)
"""
The board whose manual is cited here, and the default.

The pages of its manual that list the commands were not at hand: it certainly has more than are known of it.
"""

IM483I: Final = Profile(
    name="IM483I",
    commands=_EVERY | frozenset("+-M]IDHYlA"),
    decimals=2,
    limits_query="]0",
    plus_limit_bit=0,
    minus_limit_bit=1,
    home_query="]1",
    home_bit=0,
    port_query="A129",
    input_bits=(0, 1, 2),
    output_bits=(3, 4, 5),
    home_toward_plus=0,
)
"""IMS IM483I (motorIms, gem-controld, IM483I.h)."""

PANTHER: Final = Profile(
    name="Panther",
    commands=_EVERY | frozenset("M]IDHYEl"),
    limits_query="]0",
    plus_limit_bit=1,
    minus_limit_bit=0,
    home_toward_plus=1,
)
"""IMS Panther HI and HE (panther); of the HE nothing but what it shares with the HI."""

MCPHERSON_789A4: Final = Profile(
    name="789A-4",
    commands=_EVERY | frozenset("+-M]AC"),
    speeds_steps_s=(36, 60_000),
    separator=",",
    limits_query="]",
    plus_limit_bit=6,
    minus_limit_bit=7,
    home_query="]",
    home_bit=5,
    output_bits=(3, 4),
    sign_on_marks=("v2.55",),
)
"""McPherson 789A-4 scan controller (789A-4): that its upper limit is the plus one is inferred."""

PROFILES: Final[Mapping[str, Profile]] = MappingProxyType(
    {"dcb-274": DCB_274, "im483i": IM483I, "panther": PANTHER, "789a-4": MCPHERSON_789A4}
)
"""By the name that a URL or a command line gives, in small letters."""
