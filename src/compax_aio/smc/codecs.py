"""Answers into values: numbers, the motion status, inputs, the port, listings, shown parameters."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final

from ..errors import UnexpectedAnswerError
from .facts import STOPPED_MASK, UNSETTLED_MASK, MotionFlags
from .own_copy import SETTING_LETTERS, AxisSettings
from .profile import Profile

__all__ = [
    "AxisStatus",
    "LimitInputs",
    "Listed",
    "Port",
    "ShownParameters",
    "decode_home",
    "decode_limits",
    "decode_listing",
    "decode_number",
    "decode_parameters",
    "decode_port",
    "decode_status",
    "tidied",
]

_BLANKS: Final = " \t"
_NUMBER: Final = re.compile(r"[-+]?[0-9]{1,12}(?:\.[0-9]{0,6})?")
"""More digits than an axis has are no number of it."""
_LISTED: Final = re.compile(r"([0-9]{1,6})(?::?[ \t]+(\S.*)|:?)")
_WORD: Final = re.compile(r"[ \t,]*([^ \t,]+)")
_PAIR: Final = re.compile(
    r"(?<![^ \t])([A-Za-z])[ \t]*=[ \t]*(?![A-Za-z][ \t]*=)([^ \t=/]+(?:[ \t]*/[ \t]*[^ \t=/]+)*)"
)
_ECHO_WITH_NAME: Final = re.compile(r"X(?:[ \t]*([!-~]))?")
_LONGEST_LINE: Final = 200
_ALL_MOTION: Final = sum(MotionFlags)


# Numbers -------------------------------------------------------------------------------------------------------------


def decode_number(body: str) -> float:
    """
    Return the number that an answer is: a sign or none, digits, a fraction or none, and blanks around it (DCB p. 26).

    Args:
        body: What came between the echo of the command and the terminator.

    Raises:
        UnexpectedAnswerError: It is anything else.
    """
    text = body.strip(_BLANKS)
    if not _NUMBER.fullmatch(text):
        raise UnexpectedAnswerError("the answer is no number", received=body)
    return float(text) + 0.0  # no -0.0


def _decode_bits(body: str, what: str) -> int:
    number = decode_number(body)
    if number != int(number) or number < 0:
        raise UnexpectedAnswerError(f"{what} is a whole number of bits, not below 0", received=body)
    return int(number)


# Motion --------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisStatus:
    """The answer to ``^`` (DCB p. 26; its bits by gem-controld)."""

    raw: int
    moving: bool
    constant_speed: bool
    homing: bool
    hunting: bool
    """Correcting the position by the encoder."""
    ramping: bool
    unknown: int
    """The weights of *raw* that no source explains, added up; 0 if there are none."""

    @property
    def is_stopped(self) -> bool:
        """Whether the axis stands still: AMS's own test (DCB p. 26)."""
        return not self.raw & STOPPED_MASK

    @property
    def is_settled(self) -> bool:
        """Whether it stands still and neither homes, hunts nor ramps: inferred, for EPICS waits for a plain 0."""
        return not self.raw & (STOPPED_MASK | UNSETTLED_MASK)


def decode_status(body: str) -> AxisStatus:
    """
    Decode the answer to ``^``.

    Raises:
        UnexpectedAnswerError: It is no whole number from 0 on.
    """
    raw = _decode_bits(body, "the motion status")
    flags = MotionFlags(raw & _ALL_MOTION)
    return AxisStatus(
        raw=raw,
        moving=MotionFlags.MOVING in flags,
        constant_speed=MotionFlags.CONSTANT_SPEED in flags,
        homing=MotionFlags.HOMING in flags,
        hunting=MotionFlags.HUNTING in flags,
        ramping=MotionFlags.RAMPING in flags,
        unknown=raw & ~_ALL_MOTION,
    )


# Inputs and outputs --------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class LimitInputs:
    """What the limit inputs say, as the profile reads it; None where it does not know the bit."""

    raw: int
    plus: bool | None
    minus: bool | None
    home: bool | None
    """None also where home is asked for with a command of its own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Port:
    """The port of inputs and outputs, number 1 first (gem-controld); empty where the profile knows of none."""

    raw: int
    inputs: tuple[bool, ...]
    outputs: tuple[bool, ...]


def decode_limits(body: str, profile: Profile) -> LimitInputs:
    """
    Decode the answer to ``limits_query`` of *profile*; which bit is which differs (motorIms, panther, 789A-4).

    Raises:
        UnexpectedAnswerError: It is no whole number from 0 on.
    """
    raw = _decode_bits(body, "the answer of the limit inputs")
    is_asked_together = profile.home_query is not None and profile.home_query == profile.limits_query
    return LimitInputs(
        raw=raw,
        plus=_bit(raw, profile.plus_limit_bit),
        minus=_bit(raw, profile.minus_limit_bit),
        home=_bit(raw, profile.home_bit) if is_asked_together else None,
    )


def decode_home(body: str, profile: Profile) -> bool | None:
    """
    Decode the answer to ``home_query`` of *profile*; None where it does not know the bit.

    Raises:
        UnexpectedAnswerError: It is no whole number from 0 on.
    """
    return _bit(_decode_bits(body, "the answer of the home input"), profile.home_bit)


def decode_port(body: str, profile: Profile) -> Port:
    """
    Decode the answer to ``port_query`` of *profile* (gem-controld).

    Raises:
        UnexpectedAnswerError: It is no whole number from 0 on.
    """
    raw = _decode_bits(body, "the port")
    return Port(
        raw=raw,
        inputs=tuple(bool(raw >> bit & 1) for bit in profile.input_bits),
        outputs=tuple(bool(raw >> bit & 1) for bit in profile.output_bits),
    )


def _bit(raw: int, bit: int | None) -> bool | None:
    return None if bit is None else bool(raw >> bit & 1)


# Listings ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Listed:
    """One instruction of a program and where it begins; with no text, the place behind the last one."""

    address: int | None
    """None where it is not known: an instruction before it takes nobody knows how much."""
    text: str
    """Free of padding: ``R10000`` where the listing has ``R 10000.00``."""


def decode_listing(lines: Iterable[str]) -> tuple[Listed, ...]:
    """
    Decode the answer to ``Q``: a line is an address, an instruction, its arguments, and padding (DCB p. 24).

    Raises:
        UnexpectedAnswerError: A line is none such, or addresses do not grow.
    """
    listed: list[Listed] = []
    last = -1
    for line in lines:
        text = line.strip(_BLANKS)
        if not text:
            continue
        found = _LISTED.fullmatch(text) if len(text) <= _LONGEST_LINE else None
        if found is None:
            raise UnexpectedAnswerError("a line of the listing is no address with an instruction", received=line)
        address = int(found[1])
        if address <= last:
            raise UnexpectedAnswerError(f"address {address} of the listing comes after {last}", received=line)
        last = address
        listed.append(Listed(address, tidied(found[2] or "")))
    return tuple(listed)


def tidied(instruction: str) -> str:
    """
    Write an instruction without what means nothing: padding, and zeros behind the point.

    The letter stands first, its arguments follow with a blank between them: ``J1 3``. Never raises: what is no
    instruction stays as it is but for its blanks.
    """
    text = instruction.strip(_BLANKS)
    if text == "O":
        return "O0"  # the same, however it is written (DCB p. 24)
    return text[:1] + " ".join(map(_tidied_number, _WORD.findall(text[1:])))


def _tidied_number(word: str) -> str:
    if not _NUMBER.fullmatch(word):
        return word
    whole, _, fraction = word.partition(".")
    sign = "-" if whole.startswith("-") else ""
    digits, fraction = whole.lstrip("+-").lstrip("0") or "0", fraction.rstrip("0")
    if digits == "0" and not fraction:
        return "0"
    return f"{sign}{digits}.{fraction}" if fraction else f"{sign}{digits}"


# Parameters ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class ShownParameters:
    """What ``X`` shows in single mode (panther)."""

    lines: tuple[str, ...]
    """As they came."""
    name: str | None
    """Of the axis, at the end of the echoed line (DCB p. 23); None if there is none."""
    values: Mapping[str, str] = field(hash=False)
    """By letter, without blanks: ``{"Y": "5/75", "H": "fr"}``; a letter that says two things is left out."""

    @property
    def settings(self) -> AxisSettings:
        """Those that can be read as a Panther shows them; the others are None."""
        known: dict[str, int] = {}
        for letter, names in SETTING_LETTERS.items():
            numbers = self.values.get(letter, "").split("/")
            if len(numbers) == len(names) and all(map(_WHOLE.fullmatch, numbers)):
                known.update(zip(names, map(int, numbers), strict=True))
        for name in _SHOWN_OTHERWISE:
            known.pop(name, None)
        return AxisSettings(**known, variable_resolution=_RESOLUTIONS.get(self.values.get("H", "")))  # type: ignore[arg-type]


_WHOLE: Final = re.compile(r"[0-9]{1,9}")
_SHOWN_OTHERWISE: Final = ("variable_resolution", "resolution", "limit_active_high")
"""The first as a word, the others in a form that is not known."""
_RESOLUTIONS: Final[Mapping[str, bool]] = {"fr": False, "vr": True}


def decode_parameters(lines: Iterable[str]) -> ShownParameters:
    """
    Decode the answer to ``X``: its lines with the echoed one first, ``X`` and the name of the axis.

    Never raises: what is not understood stands in ``lines``.
    """
    kept = tuple(lines)
    echo = _ECHO_WITH_NAME.fullmatch(kept[0].strip(_BLANKS)) if kept else None
    values: dict[str, str] = {}
    contradicted: set[str] = set()
    for line in kept:
        for letter, value in _PAIR.findall(line[:_LONGEST_LINE]):
            compact = re.sub(r"[ \t]", "", value)
            if values.setdefault(letter, compact) != compact:
                contradicted.add(letter)
    return ShownParameters(
        lines=kept,
        name=echo[1] if echo else None,
        values=MappingProxyType({letter: value for letter, value in values.items() if letter not in contradicted}),
    )
