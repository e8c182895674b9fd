"""What a received line means: blanks and signs taken off, words found in the fact tables, numbers checked."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

from compax_aio.compax.facts.commands import COMMANDS
from compax_aio.compax.facts.limits import (
    MAX_ACCELERATION_TIME_MS,
    MAX_POSITION,
    MAX_SPEED_PERCENT,
    OUTPUT_NUMBERS,
    SPEED_DECIMALS,
)
from compax_aio.compax.facts.line import ECHO_SIGN, EXECUTE_SIGN, POSITION_REACHED_SIGN, STORE_SIGN

from .refusals import NUMBER, SYNTAX, RefusedError

__all__ = [
    "Acceleration",
    "Break",
    "Deceleration",
    "ExecuteStored",
    "Instruction",
    "MoveBy",
    "MoveHome",
    "MoveTo",
    "Nothing",
    "Outputs",
    "Password",
    "Power",
    "PreparedOutput",
    "PreparedSpeed",
    "Query",
    "Quit",
    "Speed",
    "Start",
    "Statement",
    "Stop",
    "parse",
]


@dataclass(frozen=True, slots=True)
class MoveTo:
    """POSA x."""

    target: float


@dataclass(frozen=True, slots=True)
class MoveBy:
    """POSR d."""

    distance: float


@dataclass(frozen=True, slots=True)
class MoveHome:
    """POSA HOME."""


@dataclass(frozen=True, slots=True)
class PreparedSpeed:
    """POSR d SPEED v."""

    distance: float
    percent: float


@dataclass(frozen=True, slots=True)
class PreparedOutput:
    """POSR d OUTPUT Ox=y."""

    distance: float
    output: int
    value: bool


@dataclass(frozen=True, slots=True)
class Speed:
    """SPEED v."""

    percent: float


@dataclass(frozen=True, slots=True)
class Acceleration:
    """ACCEL v."""

    time_ms: int


@dataclass(frozen=True, slots=True)
class Deceleration:
    """ACCEL- v."""

    time_ms: int


@dataclass(frozen=True, slots=True)
class Outputs:
    """OUTPUT Ox=y..., one digit for each output from Ox on."""

    first: int
    values: tuple[bool, ...]


@dataclass(frozen=True, slots=True)
class Power:
    """OUTPUT O0=0, 1 or 2."""

    mode: int


@dataclass(frozen=True, slots=True)
class Stop:
    """STOP."""


@dataclass(frozen=True, slots=True)
class Start:
    """START."""


@dataclass(frozen=True, slots=True)
class Break:
    """BREAK."""


@dataclass(frozen=True, slots=True)
class Quit:
    """QUIT."""


@dataclass(frozen=True, slots=True)
class Password:
    """GOTO 302, 270 or 620."""

    number: int


@dataclass(frozen=True, slots=True)
class Query:
    """S or P and a number."""

    kind: str
    number: int


@dataclass(frozen=True, slots=True)
class ExecuteStored:
    """``!``."""


@dataclass(frozen=True, slots=True)
class Nothing:
    """An empty line."""


Instruction = (
    MoveTo
    | MoveBy
    | MoveHome
    | PreparedSpeed
    | PreparedOutput
    | Speed
    | Acceleration
    | Deceleration
    | Outputs
    | Power
    | Stop
    | Start
    | Break
    | Quit
    | Password
    | Query
    | ExecuteStored
    | Nothing
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Statement:
    """One line: an instruction and its function signs."""

    instruction: Instruction
    reports: bool = False
    """``$``"""
    stores: bool = False
    """``,``"""
    echoes: bool = False
    """``?``"""


def parse(text: str, *, decimals: int) -> Statement:
    """
    Read a line without its CR, in upper case; *decimals* is how many a position may have.

    Raises:
        RefusedError: It means nothing, or has a number that is out of range.
    """
    text = text.replace(" ", "")
    bare = text.rstrip(POSITION_REACHED_SIGN + STORE_SIGN + ECHO_SIGN)
    signs = text[len(bare) :]
    instruction = _instruction(bare, decimals)
    reports = POSITION_REACHED_SIGN in signs
    # "$" belongs to POSA and POSR; an execute sign or an empty line stands alone (UG p. 160).
    if reports and not isinstance(instruction, MoveTo | MoveBy | MoveHome):
        raise RefusedError(SYNTAX)
    if len(set(signs)) != len(signs) or (signs and isinstance(instruction, ExecuteStored | Nothing)):
        raise RefusedError(SYNTAX)
    return Statement(instruction=instruction, reports=reports, stores=STORE_SIGN in signs, echoes=ECHO_SIGN in signs)


def _instruction(text: str, decimals: int) -> Instruction:
    if not text:
        return Nothing()
    if text == EXECUTE_SIGN:
        return ExecuteStored()
    if found := _QUERY.fullmatch(text):
        return Query(found["kind"], int(found["number"]))
    for word, long in _WORDS:
        if text.startswith(word):
            return _READERS[long](text[len(word) :], decimals)
    raise RefusedError(SYNTAX)


def _position(text: str, decimals: int) -> float:
    return _number(text, decimals, -MAX_POSITION, MAX_POSITION)


def _number(text: str, decimals: int, low: float, high: float) -> float:
    """Read a number of at most *decimals* from *low* to *high*; more decimals cannot be represented in the drive."""
    if not _NUMBER.fullmatch(text):
        raise RefusedError(SYNTAX)
    fraction = text.partition(".")[2].rstrip("0")
    if len(fraction) > decimals or not low <= float(text) <= high:
        raise RefusedError(NUMBER)
    return float(text)


def _posa(text: str, decimals: int) -> Instruction:
    return MoveTo(_position(text, decimals))


def _home(text: str, _: int) -> Instruction:
    return _alone(text, MoveHome())


def _posr(text: str, decimals: int) -> Instruction:
    point = _POINT.fullmatch(text)
    if point is None:
        return MoveBy(_position(text, decimals))
    # A distance from the start in the direction of travel, always positive (UG p. 101).
    distance = _position(point["distance"], decimals)
    if distance <= 0:
        raise RefusedError(NUMBER)
    if point["percent"] is not None:
        return PreparedSpeed(distance, _number(point["percent"], 0, 1, MAX_SPEED_PERCENT))
    output = int(point["output"])
    if output not in OUTPUT_NUMBERS:
        raise RefusedError(NUMBER)
    return PreparedOutput(distance, output, point["value"] == "1")


def _speed(text: str, _: int) -> Instruction:
    return Speed(_number(text, SPEED_DECIMALS, 0.001, MAX_SPEED_PERCENT))


def _acceleration(text: str, _: int) -> Instruction:
    return Acceleration(int(_number(text, 0, 0, MAX_ACCELERATION_TIME_MS)))


def _deceleration(text: str, _: int) -> Instruction:
    return Deceleration(int(_number(text, 0, 0, MAX_ACCELERATION_TIME_MS)))


def _output(text: str, _: int) -> Instruction:
    found = _OUTPUT.fullmatch(text)
    if found is None:
        raise RefusedError(SYNTAX)
    first, values = int(found["output"]), found["values"]
    if first == 0 and values in {"0", "1", "2"}:
        return Power(int(values))
    if first not in OUTPUT_NUMBERS or first + len(values) - 1 not in OUTPUT_NUMBERS or set(values) - {"0", "1"}:
        raise RefusedError(NUMBER)
    return Outputs(first, tuple(value == "1" for value in values))


def _goto(text: str, _: int) -> Instruction:
    if text not in {"302", "270", "620"}:
        raise RefusedError(SYNTAX)
    return Password(int(text))


def _alone(text: str, instruction: Instruction) -> Instruction:
    if text:
        raise RefusedError(SYNTAX)
    return instruction


_READERS: Final[Mapping[str, Callable[[str, int], Instruction]]] = {
    "POSA": _posa,
    "POSA HOME": _home,
    "POSR": _posr,
    "SPEED": _speed,
    "ACCEL": _acceleration,
    "ACCEL-": _deceleration,
    "OUTPUT": _output,
    "STOP": lambda text, _: _alone(text, Stop()),
    "START": lambda text, _: _alone(text, Start()),
    "BREAK": lambda text, _: _alone(text, Break()),
    "QUIT": lambda text, _: _alone(text, Quit()),
    "GOTO": _goto,
}
"""How the rest of a line is read after the command word of that long form."""

_ALIASES: Final = {
    # POSA may be long or short before HOME as well.
    "PAHOME": "POSA HOME",
    # The RS-232 texts of the control functions are unknown (row 13): a drive may have short ones. Placeholders.
    "SP": "STOP",
    "ST": "START",
    "BR": "BREAK",
    "QT": "QUIT",
    # Password (CAN p. 32); its place in the table of commands comes with the parameters.
    "GOTO": "GOTO",
}

_WORDS: Final = sorted(
    {form.replace(" ", ""): row.long for row in COMMANDS for form in (row.long, row.short)}.items() | _ALIASES.items(),
    key=lambda item: -len(item[0]),
)
"""Every form of every command word without blanks, longer ones first."""


def _forms(long: str) -> str:
    return "|".join(form for row in COMMANDS if row.long == long for form in (row.long, row.short))


_NUMBER: Final = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)")
_QUERY: Final = re.compile(r"(?P<kind>[SP])(?P<number>[0-9]{1,5})")
_POINT: Final = re.compile(
    rf"(?P<distance>[^A-Z]+)(?:(?:{_forms('SPEED')})(?P<percent>.+)"
    rf"|(?:{_forms('OUTPUT')})O(?P<output>[0-9]{{1,2}})=(?P<value>[01]))"
)
_OUTPUT: Final = re.compile(r"O(?P<output>[0-9]{1,2})=(?P<values>[0-9]{1,8})")
