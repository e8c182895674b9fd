"""What a received line means: blanks and signs taken off, words found in the fact tables, numbers checked."""

from __future__ import annotations

import math
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

from .instructions import (
    Acceleration,
    Assign,
    Break,
    ChangeSpeed,
    Deceleration,
    ExecuteStored,
    Instruction,
    MakeValid,
    MoveBy,
    MoveHome,
    MoveTo,
    Nothing,
    NotSimulated,
    Operand,
    Outputs,
    Password,
    Power,
    PreparedOutput,
    PreparedSpeed,
    Query,
    Quit,
    RealZero,
    SetPointer,
    Single,
    Speed,
    Start,
    Statement,
    Stop,
    WriteRecord,
)
from .parameters import CONTROL_PARAMETERS, FREE_VARIABLES
from .refusals import NUMBER, SYNTAX, RefusedError

__all__ = ["MAX_COUNT", "OPERAND", "Context", "calculated", "instruction", "number", "operand", "parse"]


MAX_COUNT: Final = 8_388_607
"""Of WAIT, REPEAT and LOOP: 24 bits with sign stand before the point of a number (UG p. 167); inferred."""


@dataclass(frozen=True, slots=True)
class Context:
    """What it takes to read a command."""

    decimals: int
    """How many a position may have."""
    value: Callable[[str, int], float] | None
    """Says what ``.P40`` or ``.V5`` stands for now; None where only the form matters, as when a record is written."""
    real_zero: str = ""
    """The word that takes real zero, without blanks; empty where there is none, as in records."""


def parse(text: str, context: Context) -> Statement:
    """
    Read a line without its CR, in upper case.

    Raises:
        RefusedError: It means nothing, or has a number that is out of range.
    """
    text = text.replace(" ", "")
    bare = text.rstrip(POSITION_REACHED_SIGN + STORE_SIGN + ECHO_SIGN)
    signs = text[len(bare) :]
    what = instruction(bare, context)
    reports = POSITION_REACHED_SIGN in signs
    # "$" belongs to POSA and POSR; an execute sign or an empty line stands alone (UG p. 160).
    if reports and not isinstance(what, MoveTo | MoveBy | MoveHome):
        raise RefusedError(SYNTAX)
    if len(set(signs)) != len(signs) or (signs and isinstance(what, ExecuteStored | Nothing)):
        raise RefusedError(SYNTAX)
    return Statement(instruction=what, reports=reports, stores=STORE_SIGN in signs, echoes=ECHO_SIGN in signs)


def instruction(text: str, context: Context) -> Instruction:
    """
    Read an instruction without blanks and function signs.

    Raises:
        RefusedError: It means nothing, or has a number that is out of range.
    """
    if text in {"", EXECUTE_SIGN, context.real_zero}:
        return _alone_standing(text)
    if found := _QUERY.fullmatch(text):
        return Query(found["kind"], int(found["number"]))
    if found := _ASSIGNMENT.fullmatch(text):
        right = operand(found["right"]) if found["operator"] else None
        return Assign(found["kind"], int(found["number"]), operand(found["left"]), found["operator"] or "", right)
    if found := _RECORD.fullmatch(text):
        return WriteRecord(int(found["number"]), found["text"] or found["bare"])
    for word, long in _WORDS:
        if text.startswith(word):
            return _READERS[long](text[len(word) :], context)
    raise RefusedError(SYNTAX)


def _alone_standing(text: str) -> Instruction:
    if not text:
        return Nothing()
    return ExecuteStored() if text == EXECUTE_SIGN else RealZero()


def operand(text: str) -> Operand:
    """Read what ``OPERAND`` matches; parameters and variables may have a leading dot."""
    name = text.removeprefix(".")
    if name[0] in "PVS":
        return Operand(name[0], int(name[1:]))
    return Operand("", 0, float(text))


def calculated(operator: str, left: float, right: float) -> float:
    """
    Calculate; whole division and remainder go towards zero, a choice.

    Raises:
        RefusedError: Division by zero.
    """
    if operator in "/\\%" and right == 0:
        raise RefusedError(NUMBER)
    return _OPERATORS[operator](left, right)


def _position(text: str, context: Context) -> float:
    return number(text, context, context.decimals, -MAX_POSITION, MAX_POSITION)


def number(text: str, context: Context, decimals: int, low: float, high: float) -> float:
    """
    Read a number of at most *decimals* from *low* to *high*; more decimals cannot be represented in the drive.

    A parameter or variable in its place (UG p. 100, CAN p. 61) is rounded.

    Raises:
        RefusedError: It is no number, or not such a one.
    """
    if found := _IN_PLACE.fullmatch(text):
        if int(found["number"]) not in (CONTROL_PARAMETERS if found["kind"] == "P" else FREE_VARIABLES):
            raise RefusedError(SYNTAX)
        if context.value is None:
            return max(low, 1.0)
        value = round(context.value(found["kind"], int(found["number"])), decimals) + 0.0
        if not low <= value <= high:
            raise RefusedError(NUMBER)
        return value
    if not _NUMBER.fullmatch(text):
        raise RefusedError(SYNTAX)
    fraction = text.partition(".")[2].rstrip("0")
    if len(fraction) > decimals or not low <= float(text) <= high:
        raise RefusedError(NUMBER)
    return float(text)


def _posa(text: str, context: Context) -> Instruction:
    return MoveTo(_position(text, context))


def _home(text: str, _: Context) -> Instruction:
    return _alone(text, MoveHome())


def _posr(text: str, context: Context) -> Instruction:
    if text == "CAM":
        return NotSimulated("POSR CAM")
    point = _POINT.fullmatch(text)
    if point is None:
        return MoveBy(_position(text, context))
    # A distance from the start in the direction of travel, always positive (UG p. 101).
    distance = _position(point["distance"], context)
    if point["percent"] is not None:
        return _step(distance, point, context)
    if distance <= 0:
        raise RefusedError(NUMBER)
    output = int(point["output"])
    if output not in OUTPUT_NUMBERS:
        raise RefusedError(NUMBER)
    return PreparedOutput(distance, output, point["value"] == "1")


def _step(distance: float, point: re.Match[str], context: Context) -> Instruction:
    """Read a speed step; at no distance it changes the speed under way, by the name of the object of IBS p. 42."""
    percent = number(point["percent"], context, 0, 1, MAX_SPEED_PERCENT)
    if distance == 0 and point["ramp"] is None:
        return ChangeSpeed(percent)
    if distance <= 0:
        raise RefusedError(NUMBER)
    return PreparedSpeed(distance, percent, None if point["ramp"] is None else _time_ms(point["ramp"], context))


def _speed(text: str, context: Context) -> Instruction:
    if text == "SYNC":
        return NotSimulated("SPEED SYNC")
    return Speed(number(text, context, SPEED_DECIMALS, 0.001, MAX_SPEED_PERCENT))


def _acceleration(text: str, context: Context) -> Instruction:
    return Acceleration(_time_ms(text, context))


def _deceleration(text: str, context: Context) -> Instruction:
    return Deceleration(_time_ms(text, context))


def _time_ms(text: str, context: Context) -> int:
    return int(number(text, context, 0, 0, MAX_ACCELERATION_TIME_MS))


def _output(text: str, _: Context) -> Instruction:
    found = _OUTPUT.fullmatch(text)
    if found is None:
        raise RefusedError(SYNTAX)
    first, values = int(found["output"]), found["values"]
    if first == 0 and values in {"0", "1", "2"}:
        return Power(int(values))
    if first not in OUTPUT_NUMBERS or first + len(values) - 1 not in OUTPUT_NUMBERS or set(values) - {"0", "1"}:
        raise RefusedError(NUMBER)
    return Outputs(first, tuple(value == "1" for value in values))


def _goto(text: str, _: Context) -> Instruction:
    if text in {"302", "270", "620"}:
        return Password(int(text))
    if text == "EXT":
        return SetPointer(None)
    return SetPointer(_record_number(text))


def _loop(text: str, context: Context) -> Instruction:
    number(text, context, 0, 1, MAX_COUNT)
    return NotSimulated("LOOP")


def _record_number(text: str) -> int:
    if not re.fullmatch("[0-9]{1,3}", text):
        raise RefusedError(SYNTAX)
    return int(text)


def _alone(text: str, what: Instruction) -> Instruction:
    if text:
        raise RefusedError(SYNTAX)
    return what


_READERS: Final[Mapping[str, Callable[[str, Context], Instruction]]] = {
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
    "LOOP": _loop,
    "SINGLE": lambda text, _: Single(_record_number(text)),
    "VP": lambda text, _: _alone(text, MakeValid("VP")),
    "VC": lambda text, _: _alone(text, MakeValid("VC")),
}
"""How the rest of a line is read after the command word of that long form."""

_ALIASES: Final = {
    # POSA may be long or short before HOME as well.
    "PAHOME": "POSA HOME",
    # The RS-232 texts of the control functions are unknown: a drive may have short ones. Placeholders.
    "SP": "STOP",
    "ST": "START",
    "BR": "BREAK",
    "QT": "QUIT",
    # One record: the fieldbus can (CAN p. 69), how RS-232 says it is unknown. A placeholder.
    "SINGLE": "SINGLE",
    # Password (CAN p. 32); by analogy with the PLC interface (UG p. 158) also the pointer. VP, VC (UG p. 158).
    "GOTO": "GOTO",
    "VP": "VP",
    "VC": "VC",
    # A positioning command (UG p. 162) whose meaning stands on no page at hand.
    "LOOP": "LOOP",
}

_WORDS: Final = sorted(
    {form.replace(" ", ""): row.long for row in COMMANDS for form in (row.long, row.short)}.items() | _ALIASES.items(),
    key=lambda item: -len(item[0]),
)
"""Every form of every command word without blanks, longer ones first."""


def _forms(long: str) -> str:
    return "|".join(form for row in COMMANDS if row.long == long for form in (row.long, row.short))


_NUMBER: Final = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)")
_IN_PLACE: Final = re.compile(r"\.(?:(?P<kind>[PV])(?P<number>[0-9]{1,3}))")
OPERAND: Final = r"(?:[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)|\.?[PVS][0-9]{1,3})"
"""An operand of an assignment or comparison, as a regular expression."""
_ASSIGNMENT: Final = re.compile(
    rf"(?P<kind>[PV])(?P<number>[0-9]{{1,3}})=(?P<left>{OPERAND})(?:(?P<operator>[-+*/\\%])(?P<right>{OPERAND}))?"
)
_OPERATORS: Final[Mapping[str, Callable[[float, float], float]]] = {
    "+": lambda left, right: left + right,
    "-": lambda left, right: left - right,
    "*": lambda left, right: left * right,
    "/": lambda left, right: left / right,
    "\\": lambda left, right: float(math.trunc(left / right)),
    "%": math.fmod,
}
"""UG does not say them on the pages at hand; IBS p. 56 does."""
_RECORD: Final = re.compile(r"N(?P<number>[0-9]{1,3})(?::(?P<text>.+)|(?P<bare>[^0-9:].*))")
_QUERY: Final = re.compile(r"(?P<kind>[SPVN])(?P<number>[0-9]{1,5})")
_POINT: Final = re.compile(
    rf"(?P<distance>[^A-Z]+|\.[PV][0-9]+)(?:(?:{_forms('SPEED')})(?P<percent>[^A-Z]+|\.[PV][0-9]+)"
    rf"(?:(?:{_forms('ACCEL')})(?P<ramp>.+))?"
    rf"|(?:{_forms('OUTPUT')})O(?P<output>[0-9]{{1,2}})=(?P<value>[01]))"
)
_OUTPUT: Final = re.compile(r"O(?P<output>[0-9]{1,2})=(?P<values>[0-9]{1,8})")
