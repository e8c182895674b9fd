"""The program memory: 250 records, one instruction each, and what their text means (UG p. 95)."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

from compax_aio.compax.facts.commands import COMMANDS
from compax_aio.compax.facts.limits import MAX_POSITION, POSITION_DECIMALS_INCH
from compax_aio.compax.facts.line import MAX_LINE_LENGTH

from . import instructions as say
from .language import MAX_COUNT, OPERAND, Context, instruction, number, operand
from .refusals import NO_RECORD, NUMBER, SYNTAX, RefusedError

__all__ = ["INPUT_NUMBERS", "RECORDS", "Memory", "SpeedThenWait", "Step", "check_record", "read_record"]

RECORDS: Final = range(1, 251)
"""N001-N250 (UG p. 95)."""

INPUT_NUMBERS: Final = range(1, 17)
"""I1-I16 (UG p. 140)."""

_EMPTY: Final = "END"
"""What a record holds that was never written; unknown, a choice: a program that runs into it ends."""


@dataclass(frozen=True, slots=True)
class SpeedThenWait:
    """SPEED v WAIT t."""

    speed: say.Speed
    time_ms: float


@dataclass(frozen=True, slots=True)
class Wait:
    """WAIT t."""

    time_ms: float


@dataclass(frozen=True, slots=True)
class WaitStart:
    """WAIT START."""


@dataclass(frozen=True, slots=True)
class Jump:
    """GOTO or GOSUB; no record means EXT, which the inputs choose."""

    calls: bool
    record: int | None


@dataclass(frozen=True, slots=True)
class Return:
    """RETURN."""


@dataclass(frozen=True, slots=True)
class Repeat:
    """REPEAT n."""

    passes: int


@dataclass(frozen=True, slots=True)
class End:
    """END, of a REPEAT or of the program."""


@dataclass(frozen=True, slots=True)
class IfInputs:
    """IF Ix=y..., one digit for each input from Ix on."""

    first: int
    values: tuple[bool, ...]
    jump: Jump


@dataclass(frozen=True, slots=True)
class IfCompared:
    """IF a op b."""

    left: say.Operand
    sign: str
    right: say.Operand
    jump: Jump


@dataclass(frozen=True, slots=True)
class IfError:
    """IF ERROR, from when it is executed on."""

    jump: Jump


@dataclass(frozen=True, slots=True)
class IfStop:
    """IF STOP, from when it is executed on."""

    jump: Jump


Step = (
    say.MoveTo
    | say.MoveBy
    | say.MoveHome
    | say.PreparedSpeed
    | say.PreparedOutput
    | say.Speed
    | say.Acceleration
    | say.Deceleration
    | say.Outputs
    | say.Power
    | say.Assign
    | say.Password
    | say.NotSimulated
    | SpeedThenWait
    | Wait
    | WaitStart
    | Jump
    | Return
    | Repeat
    | End
    | IfInputs
    | IfCompared
    | IfError
    | IfStop
)


class Memory:
    """The records, as text in long form."""

    def __init__(self) -> None:
        self._records: dict[int, str] = {}

    @property
    def written(self) -> Mapping[int, str]:
        """The records that hold something else than END."""
        return dict(self._records)

    def __getitem__(self, record: int) -> str:
        """Return the text of a record."""
        return self._records.get(record, _EMPTY)

    def replace(self, records: Mapping[int, str]) -> None:
        """Forget what was written, and hold *records* instead, which :func:`check_record` has found good."""
        self._records = {record: text for record, text in records.items() if text != _EMPTY}

    def shown(self, record: int) -> str:
        """
        Write the answer to ``N5``; no longer than the output buffer (UG p. 160).

        Raises:
            RefusedError: There is no such record.
        """
        if record not in RECORDS:
            raise RefusedError(NO_RECORD)
        return f"N{record:03d}: {self[record]}"[:MAX_LINE_LENGTH]

    def write(self, record: int, text: str, decimals: int) -> None:
        """
        Write a record, in upper case, if it can be understood.

        Raises:
            RefusedError: There is no such record, or no such instruction, or it is too long.
        """
        if record not in RECORDS:
            raise RefusedError(NO_RECORD)
        text = text.strip()
        bare = text.replace(" ", "")
        if len(text) > MAX_LINE_LENGTH:
            raise RefusedError(SYNTAX)
        read_record(bare, Context(decimals, None))
        self._records.pop(record, None)
        if (long := _in_long_form(bare)) != _EMPTY:
            self._records[record] = long

    def end_of_loop(self, repeat: int) -> int:
        """
        Find the END that belongs to the REPEAT of a record, in the order of the listing.

        Raises:
            RefusedError: There is none.
        """
        depth = 0
        for record in range(repeat, RECORDS.stop):
            text = self[record]
            depth += text.startswith("REPEAT") - (text == "END")
            if depth == 0:
                return record
        raise RefusedError(NO_RECORD)


def check_record(record: int, text: str) -> str:
    """
    Read a record that some drive, of whatever unit, has had in its memory; return it as a listing has it.

    Raises:
        RefusedError: There is no such record, or no such instruction.
    """
    if record not in RECORDS:
        raise RefusedError(NO_RECORD)
    bare = text.replace(" ", "")
    read_record(bare, Context(POSITION_DECIMALS_INCH, None))
    return _in_long_form(bare)


def read_record(text: str, context: Context) -> Step:
    """
    Read the text of a record, in upper case; blanks mean nothing.

    Raises:
        RefusedError: It is no instruction for a program.
    """
    text = text.replace(" ", "")
    if found := _SPEED_THEN_WAIT.fullmatch(text):
        speed = instruction(found["speed"], context)
        assert isinstance(speed, say.Speed)
        return SpeedThenWait(speed, _time_ms(found["time"], context))
    for word, reader in _READERS.items():
        if text.startswith(word):
            return reader(text[len(word) :], context)
    step = instruction(text, context)
    if not isinstance(step, Step):
        raise RefusedError(SYNTAX)
    return step


def _wait(text: str, context: Context) -> Step:
    if text == "START":
        return WaitStart()
    if text[:4] in {"POSA", "POSR"}:
        number(text[4:], context, context.decimals, -MAX_POSITION, MAX_POSITION)
        return say.NotSimulated(f"WAIT {text[:4]}")  # cut to length, XX50 only (IBS p. 39, 40)
    return Wait(_time_ms(text, context))


def _time_ms(text: str, context: Context) -> float:
    return number(text, context, 0, 0, MAX_COUNT)


def _goto(text: str, context: Context) -> Step:
    step = instruction(f"GOTO{text}", context)
    return step if isinstance(step, say.Password) else _jump(False, text)


def _repeat(text: str, context: Context) -> Step:
    return Repeat(int(number(text, context, 0, 1, MAX_COUNT)))


def _jump(calls: bool, text: str) -> Jump:
    if text == "EXT":
        return Jump(calls, None)
    if not re.fullmatch("[0-9]{1,3}", text):
        raise RefusedError(SYNTAX)
    if int(text) not in RECORDS:
        raise RefusedError(NO_RECORD)
    return Jump(calls, int(text))


def _only(text: str, step: Step) -> Step:
    if text:
        raise RefusedError(SYNTAX)
    return step


def _if(text: str, _: Context) -> Step:
    found = _CONDITION.fullmatch(text)
    if found is None:
        raise RefusedError(SYNTAX)
    jump = _jump(found["how"] == "GOSUB", found["where"])
    if found["event"]:
        return IfError(jump) if found["event"] == "ERROR" else IfStop(jump)
    if found["sign"]:
        return IfCompared(operand(found["left"]), found["sign"], operand(found["right"]), jump)
    first, values = int(found["input"]), found["values"]
    if first not in INPUT_NUMBERS or first + len(values) - 1 not in INPUT_NUMBERS:
        raise RefusedError(NUMBER)
    return IfInputs(first, tuple(value == "1" for value in values), jump)


_SPEED_THEN_WAIT: Final = re.compile(r"(?P<speed>(?:SPEED|SD)(?:[0-9.+]+|\.[PV][0-9]+))WAIT(?P<time>.+)")
"""CAN p. 59, 61."""

_CONDITION: Final = re.compile(
    rf"(?:(?P<event>ERROR|STOP)|I(?P<input>[0-9]{{1,2}})=(?P<values>[01]{{1,8}})"
    rf"|(?P<left>{OPERAND})(?P<sign><=|>=|<>|=|<|>)(?P<right>{OPERAND}))(?P<how>GOTO|GOSUB)(?P<where>[0-9A-Z]+)"
)

_READERS: Final[Mapping[str, Callable[[str, Context], Step]]] = {
    "IF": _if,
    "WAIT": _wait,
    "REPEAT": _repeat,
    "RETURN": lambda text, _: _only(text, Return()),
    "GOSUB": lambda text, _: _jump(True, text),
    "GOTO": _goto,
    "END": lambda text, _: _only(text, End()),
}
"""How the rest of a record is read after the words that only programs know (CAN p. 59, 61; IBS p. 56)."""

_LONG: Final = {form.replace(" ", ""): row.long for row in COMMANDS for form in (row.long, row.short)}
_SPACED: Final = re.compile("SPEED|OUTPUT|ACCEL|(?<!^)(?:SD|OT|AL)|GOTO|GOSUB|(?<!^)WAIT|^POS[AR]")
_SPOKEN: Final = re.compile(
    "|".join(
        sorted(
            (*_LONG, "PAHOME", "WAIT", "REPEAT", "RETURN", "GOSUB", "GOTO", "IF", "END", "LOOP"), key=len, reverse=True
        )
    )
)


def _in_long_form(bare: str) -> str:
    """Write an instruction without blanks as in a listing: ``PR200OTO9=1`` is ``POSR 200 OUTPUT O9=1``."""
    found = _SPOKEN.match(bare)
    if found is None:
        return bare
    word = "POSA HOME" if found[0] == "PAHOME" else _LONG.get(found[0], found[0])
    rest = _SPACED.sub(lambda inner: f" {_LONG.get(inner[0], inner[0])} ", bare[found.end() :])
    return f"{word} {rest.strip()}".strip()
