"""Instructions of a stored program as text: one checked, a file of them read, a listing printed."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Final, TypeAlias

from ..checked_numbers import check_whole
from ..errors import InvalidCommandError
from ..escaping import shown
from . import setting_lines as settings
from .codecs import Listed, tidied
from .facts import COMMANDS, INSTRUCTION_BYTES
from .profile import Profile
from .program_layout import EditPlan, check_jumps, nv_length, plan_exchange
from .vocabulary import check_command, plan_home, plan_move_by, plan_move_to, plan_run, set_origin, set_outputs

__all__ = ["COMMENT", "check_program", "instruction", "parse_program", "plan_edit", "program_listing"]

COMMENT: Final = ";"
"""Begins what nobody but people reads, in a file."""

_LONGEST_LINE: Final = 200
_MOST_LINES: Final = 10_000
_MOST_ERRORS: Final = 50
_BLANKS: Final = " \t"
_LINE_END: Final = re.compile(r"\r\n|\r|\n")
_ADDRESS: Final = re.compile(r"([0-9]{1,6})(?:[ \t]*:[ \t]*|[ \t]+|$)")
_NUMBER: Final = re.compile(r"-?[0-9]{1,12}(?:\.[0-9]{1,6})?")
_HIGHEST_WORD: Final = 0xFFFF
_HIGHEST_BYTE: Final = 0xFF
"""W takes 3 bytes and J 4 (DCB p. 24): one of them the command, so that these are what is left, by inference."""


# One instruction -----------------------------------------------------------------------------------------------------

_Wording: TypeAlias = Callable[[Profile, Sequence[float]], str]


def _run(profile: Profile, arguments: Sequence[float]) -> str:
    return plan_run(arguments[0], profile).text if arguments[0] else check_command("M0", profile)


def _home(profile: Profile, arguments: Sequence[float]) -> str:
    direction = check_whole("the direction of F", arguments[1], 0, 1)
    return plan_home(arguments[0], profile, direction=direction).text


def _origin(profile: Profile, arguments: Sequence[float]) -> str:
    if any(arguments):
        raise InvalidCommandError("the origin can be set to zero alone (DCB p. 24)")
    return set_origin(profile)


def _jump(profile: Profile, arguments: Sequence[float]) -> str:
    address = check_whole("the address of a jump", arguments[0], 0, _HIGHEST_WORD)
    times = check_whole("the count of a jump", arguments[1], 0, _HIGHEST_BYTE, source="inferred from its 4 bytes")
    return check_command(f"J{address}{profile.separator}{times}", profile)


def _wait(profile: Profile, arguments: Sequence[float]) -> str:
    number = check_whole("the number of W", arguments[0], 0, _HIGHEST_WORD, source="inferred from its 3 bytes")
    return check_command(f"W{number}", profile)


def _flag(letter: str, value: float) -> bool:
    return bool(check_whole(f"the number of {letter}", value, 0, 1))


_WORDINGS: Final[Mapping[str, tuple[int, _Wording]]] = {
    "R": (1, lambda profile, numbers: plan_move_to(numbers[0], profile).text),
    "+": (1, lambda profile, numbers: plan_move_by(numbers[0], profile).text),
    "-": (1, lambda profile, numbers: plan_move_by(-numbers[0], profile).text),
    "M": (1, _run),
    "F": (2, _home),
    "O": (1, _origin),
    "J": (2, _jump),
    "W": (1, _wait),
    "I": (1, lambda profile, numbers: settings.initial_speed(int(numbers[0]), profile).text),
    "V": (1, lambda profile, numbers: settings.slew_speed(int(numbers[0]), profile).text),
    "K": (2, lambda profile, numbers: settings.ramp_slopes(int(numbers[0]), int(numbers[1]), profile).text),
    "Y": (2, lambda profile, numbers: settings.currents(int(numbers[0]), int(numbers[1]), profile).text),
    "D": (1, lambda profile, numbers: settings.resolution(int(numbers[0]), profile).text),
    "H": (1, lambda profile, numbers: settings.variable_resolution(_flag("H", numbers[0]), profile).text),
    "E": (1, lambda profile, numbers: settings.settling_delay(int(numbers[0]), profile).text),
    "l": (1, lambda profile, numbers: settings.limit_polarity(_flag("l", numbers[0]), profile).text),
    "A": (1, lambda profile, numbers: set_outputs(int(numbers[0]), profile)),
}
"""
How many arguments an instruction has, and how it is worded from them.

O, R, W and J stand in the program of the manual (DCB p. 24); that the others may stand in one is inferred.
"""


def instruction(text: str, profile: Profile) -> str:
    """
    Return one instruction of a program as it is sent, such as ``R10000`` or ``J1 3``.

    Raises:
        InvalidCommandError: It cannot stand in a program, or has arguments that cannot be said exactly.
    """
    if not isinstance(text, str):
        raise InvalidCommandError(f"an instruction is a text, not {shown(text)}")
    text = str.__str__(text)
    if len(text) > _LONGEST_LINE:
        raise InvalidCommandError(f"{shown(text)} has {len(text)} characters and is no instruction")
    wanted = tidied(text)
    count, wording = _wording(wanted[:1])
    words = wanted[1:].split(" ") if wanted[1:] else []
    if len(words) != count or not all(map(_NUMBER.fullmatch, words)):
        numbers = "1 number" if count == 1 else f"{count} numbers"
        raise InvalidCommandError(f"{shown(text)} is no instruction: {wanted[0]} has {numbers} behind it")
    sent = wording(profile, tuple(map(float, words)))
    if tidied(sent) != wanted:
        raise InvalidCommandError(
            f"{shown(text)} cannot be said exactly: it would become {sent!r}",
            hint=f"{profile.name} takes {profile.decimals} decimals of a step and none of anything else",
        )
    return sent


def _wording(letter: str) -> tuple[int, _Wording]:
    if letter in _WORDINGS:
        return _WORDINGS[letter]
    if not letter:
        raise InvalidCommandError("an instruction is empty")
    row = COMMANDS.get(letter)
    named = f"{letter!r} ({row.meaning})" if row else shown(letter)
    raise InvalidCommandError(
        f"{named} is not known to stand in a program", hint=f"known are {' '.join(sorted(_WORDINGS))}"
    )


# Whole programs ------------------------------------------------------------------------------------------------------


def check_program(
    instructions: Iterable[str],
    profile: Profile,
    *,
    start: int | None = None,
    lengths: Mapping[str, int] = INSTRUCTION_BYTES,
) -> tuple[Listed, ...]:
    """
    Return *instructions* with their addresses, the place behind the last one at the end.

    From the first one on whose length is not known, addresses are None.

    Args:
        instructions: As text.
        profile: Of the axis.
        start: Where the first one begins; 0 if nothing says otherwise.
        lengths: In bytes, by letter; ``learn_lengths()`` takes them from a listing.

    Raises:
        InvalidCommandError: One cannot be told to the axis, or a jump leads to no instruction, or nobody can say.
    """
    return parse_program("\n".join(_lines(instructions)), profile, start=start, lengths=lengths)


def parse_program(
    text: str, profile: Profile, *, start: int | None = None, lengths: Mapping[str, int] = INSTRUCTION_BYTES
) -> tuple[Listed, ...]:
    """
    Read a program: an instruction a line, such as ``R10000`` or ``1: R10000``; what follows ``;`` is a comment.

    An address says where its instruction must begin: the first one where the program begins, and one behind an
    instruction of unknown length how long that is. Arguments and result are otherwise those of ``check_program()``.

    Raises:
        InvalidCommandError: It cannot be read, or cannot be told to the axis; all errors with line and column.
    """
    if start is not None:
        start = check_whole("the start of a program", start, 0, _HIGHEST_WORD)
    reader = _Reader(profile, start, lengths)
    lines = _LINE_END.split(_text(text))
    if len(lines) > _MOST_LINES:
        raise InvalidCommandError(f"the program has {len(lines)} lines, more than any: {_MOST_LINES}")
    for number, line in enumerate(lines, start=1):
        reader.read(number, line.partition(COMMENT)[0].rstrip(_BLANKS))
    return reader.finish()


def plan_edit(
    listing: Iterable[Listed],
    address: int,
    new_text: str,
    profile: Profile,
    *,
    lengths: Mapping[str, int] | None = None,
) -> EditPlan:
    """
    Plan how the instruction at *address* becomes *new_text*, as ``plan_exchange()`` does, each line as it is sent.

    Raises:
        InvalidCommandError: An instruction cannot be told to the axis, none begins there, a length is not known, the
            listing has a gap, or a jump leads to no instruction.
    """
    number = check_whole("the address of an instruction", address, 0, _HIGHEST_WORD)
    plan = plan_exchange(listing, number, tidied(instruction(new_text, profile)), lengths)
    return replace(plan, instructions=tuple(instruction(each, profile) for each in plan.instructions))


def program_listing(listing: Iterable[Listed]) -> str:
    """Print a program as ``parse_program()`` reads it, each instruction with its address where that is known."""
    return "".join(
        f"{'' if each.address is None else f'{each.address:5d}: '}{each.text}\n" for each in listing if each.text
    )


def _text(text: object) -> str:
    if not isinstance(text, str):
        raise InvalidCommandError(f"a program is a text, not {shown(text)}")
    return str.__str__(text)


def _lines(instructions: Iterable[str]) -> Iterable[str]:
    if isinstance(instructions, str):
        raise InvalidCommandError("a program is several instructions, as a list or tuple; parse_program() takes a text")
    for each in instructions:
        text = _text(each)
        if _LINE_END.search(text) or COMMENT in text or not text.strip(_BLANKS):
            raise InvalidCommandError(f"{shown(text)} is not one instruction")
        yield text


class _Reader:
    """Reads line after line, and keeps what is wrong until the end."""

    def __init__(self, profile: Profile, start: int | None, lengths: Mapping[str, int]) -> None:
        self._profile = profile
        self._lengths = lengths
        self._next: int | None = start or 0
        self._is_free = start is None
        """The first address may be any."""
        self._listing: list[Listed] = []
        self._places: list[str] = []
        self._errors: list[str] = []

    def read(self, number: int, line: str) -> None:
        text = line.lstrip(_BLANKS)
        if not text:
            return
        column = len(line) - len(text) + 1
        stated = _ADDRESS.match(text)
        if stated:
            self._state(int(stated[1]), f"line {number}, column {column}")
            column += stated.end()
            text = text[stated.end() :]
        self._is_free = False
        place = f"line {number}, column {column}"
        try:
            sent = instruction(text, self._profile)
        except InvalidCommandError as error:
            self._refuse(place, error.what, error.hint)
            self._next = None
            return
        self._listing.append(Listed(self._next, tidied(sent)))
        self._places.append(place)
        length = nv_length(sent, self._lengths)
        self._next = None if self._next is None or length is None else self._next + length

    def _state(self, address: int, place: str) -> None:
        if self._is_free:
            pass
        elif self._next is not None and address != self._next:
            self._refuse(place, f"the instruction begins at {self._next}, not at {address}", "leave addresses out")
        elif self._next is None and address <= (last := self._last_address()):
            self._refuse(place, f"address {address} comes after {last}", "leave addresses out")
        self._next = address

    def _last_address(self) -> int:
        return max((each.address for each in self._listing if each.address is not None), default=-1)

    def _refuse(self, place: str, what: str, hint: str | None) -> None:
        self._errors.append(f"{place}: {what}" + (f"; {hint}" if hint else ""))

    def finish(self) -> tuple[Listed, ...]:
        if not self._errors:
            for index, what in check_jumps(self._listing):
                self._refuse(self._places[index], what, None)
        if self._errors:
            count = "1 error" if len(self._errors) == 1 else f"{len(self._errors)} errors"
            shown_errors = self._errors[:_MOST_ERRORS]
            raise InvalidCommandError("\n".join((f"{count} in the program:", *shown_errors)))
        return (*self._listing, Listed(self._next, ""))
