"""All that can be typed or looked up, with its meaning: rows of the fact tables, brought into one form."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from typing import Final

from ...compax.facts.certainty import Certainty
from ...compax.facts.commands import COMMANDS, CommandFact
from ...compax.facts.control_functions import CONTROL_FUNCTIONS
from ...compax.facts.device_errors import DEVICE_ERRORS, ERROR_RANGES, DeviceError, device_error
from ...compax.facts.parameters import (
    MAX_DIGITS,
    PARAMETERS,
    VARIABLE_DECIMALS,
    VARIABLES,
    ParameterFact,
    parameter_decimals,
)
from ...compax.facts.program_commands import NUMBERS, PROGRAM_COMMANDS, RECORD_NUMBERS, ProgramCommandFact
from ...compax.facts.quantities import QUANTITIES, SELECTORS
from ...compax.facts.serial_interface import INTERFACE_BITS, INTERFACE_PARAMETER
from ...compax.facts.settings import DIALECT_FACTS
from ...compax.facts.status import S16_BITS, S17_BITS, STATUS_VALUES, StatusBit, StatusFact
from ...compax.settings import DriveSettings

__all__ = ["Entry", "Kind", "drive_entries", "error_entry", "parameter_entry", "record_entry", "variable_entry"]


class Kind:
    """What an entry is, for people."""

    STATUS: Final = "status value"
    PARAMETER: Final = "parameter"
    VARIABLE: Final = "variable"
    RECORD: Final = "record of the program"
    COMMAND: Final = "command"
    PROGRAM: Final = "program command"
    ERROR: Final = "error code"
    WORD: Final = "word of this shell"


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One thing that can be typed, or looked up."""

    word: str
    """As it is typed: ``S16``, ``POSA``, ``move``."""
    aliases: tuple[str, ...] = ()
    """Short forms."""
    kind: str
    meaning: str
    unit: str | None = None
    range: str | None = None
    """What numbers it takes, or how its value is written."""
    more: tuple[str, ...] = ()
    """Further lines of its help: bits, forms, cause and remedy, examples."""
    source: str = ""
    certainty: Certainty | None = None
    """None where nothing is to be doubted: the words of the shell."""
    is_typed: bool = True
    """Whether a line may begin with it; an error code can only be looked up."""

    @property
    def in_short(self) -> str:
        """The meaning with its unit, and a word of doubt where there is doubt, for one line."""
        unit = f" [{self.unit}]" if self.unit else ""
        return f"{self.meaning}{unit}{_doubt(self.certainty)}"


def _doubt(certainty: Certainty | None) -> str:
    return "" if certainty is None or certainty is Certainty.DOCUMENTED else f" ({certainty.name.lower()})"


_PLACE: Final = re.compile(r"\{(\w+)\}")


def drive_entries(settings: DriveSettings) -> tuple[Entry, ...]:
    """Return an entry for all that the tables know, in the unit and words of one drive."""
    commands = tuple(_command(row) for row in COMMANDS)
    named = {each.word for each in commands}
    return (
        *(_status(row, settings.unit) for row in STATUS_VALUES),
        *commands,
        *(each for each in (*_functions(), *_words_of_dialect(settings)) if each.word not in named),
        *(parameter_entry(row.number, settings.unit) for row in PARAMETERS),
        *(variable_entry(number) for number in VARIABLES),
        *_program_commands(),
        *(error_entry(row.code) for row in DEVICE_ERRORS),
    )


# Status values, parameters, variables, records ------------------------------------------------------------------------


def _status(row: StatusFact, unit: str) -> Entry:
    return Entry(
        word=f"S{row.number}",
        kind=Kind.STATUS,
        meaning=row.meaning,
        unit=_spelt(row.unit, unit),
        range=row.form.value,
        more=tuple(_more_of_status(row.number, unit)),
        source=row.source,
        certainty=row.certainty,
    )


def _more_of_status(number: int, unit: str) -> Iterator[str]:
    bits: dict[int, tuple[StatusBit, ...]] = {16: S16_BITS, 17: S17_BITS}
    for bit in bits.get(number, ()):
        yield f"bit {bit.bit}  {bit.name}: {bit.meaning_when_set} ({bit.source})"
    if number in SELECTORS:
        yield f"P{SELECTORS[number]} chooses what it shows:"
        for row in QUANTITIES:
            if row.certainty is not Certainty.UNKNOWN:
                in_unit = f" [{_spelt(row.unit, unit)}]" if row.unit else ""
                yield f"{row.number}  {row.meaning}{in_unit}"


def parameter_entry(number: int, unit: str) -> Entry:
    """Return the entry of P<number>, 1 to 250, also where no page at hand says what it is."""
    row = _PARAMETERS.get(number) or ParameterFact(
        number=number, meaning="no page at hand says what it is", unit=None, source="", certainty=Certainty.UNKNOWN
    )
    more = [f"weight {bit.weight}: {bit.meaning_when_set}" for bit in INTERFACE_BITS] * (number == INTERFACE_PARAMETER)
    more += [f"chooses what S{status} shows; `help S{status}`" for status, by in SELECTORS.items() if by == number]
    return Entry(
        word=f"P{number}",
        kind=Kind.PARAMETER,
        meaning=row.meaning,
        unit=_spelt(row.unit, unit),
        range=_stored(parameter_decimals(number)),
        more=tuple(more),
        source=row.source,
        certainty=row.certainty,
    )


def variable_entry(number: int) -> Entry:
    """Return the entry of V<number>."""
    is_free = number < 50
    return Entry(
        word=f"V{number}",
        kind=Kind.VARIABLE,
        meaning="free for programs" if is_free else "belongs to the cam controller",
        range=_stored(VARIABLE_DECIMALS),
        source="UG p. 100" if is_free else "UG p. 104",
        certainty=Certainty.DOCUMENTED,
    )


def record_entry(number: int) -> Entry:
    """Return the entry of N<number>, a record of the program memory."""
    return Entry(
        word=f"N{number}",
        kind=Kind.RECORD,
        meaning=f"record {number} of {RECORD_NUMBERS[-1]}: one command of the program",
        source="UG p. 95",
        certainty=Certainty.DOCUMENTED,
    )


def _stored(decimals: int) -> str:
    digits = f"at most {MAX_DIGITS} digits before the point"
    return f"a whole number, {digits}" if decimals == 0 else f"a number, {digits}, {decimals} behind it"


def _spelt(unit: str | None, axis_unit: str) -> str | None:
    return axis_unit if unit == "axis" else unit


# Errors ---------------------------------------------------------------------------------------------------------------


def error_entry(code: int) -> Entry:
    """Return the entry of E<code>, also where no page at hand explains it."""
    error = device_error(code)
    return Entry(
        word=f"E{code}",
        kind=Kind.ERROR,
        meaning=error.meaning,
        more=tuple(_more_of_error(error)),
        source=f"UG p. {error.page}" if error.page else "",
        certainty=error.certainty,
        is_typed=False,
    )


def _more_of_error(error: DeviceError) -> Iterator[str]:
    if error.cause:
        yield f"cause: {error.cause}"
    if error.remedy:
        yield f"what to do: {error.remedy}"
    for row in ERROR_RANGES:
        if error.code in row.codes:
            codes = f"E{row.codes[0]} to E{row.codes[-1]}" if len(row.codes) > 1 else f"E{row.codes[0]}"
            yield f"{codes}: {row.meaning}; {row.effect} ({row.source})"


# Commands -------------------------------------------------------------------------------------------------------------


def _command(row: CommandFact) -> Entry:
    is_other = row.short != row.long
    return Entry(
        word=row.short,
        aliases=(row.long,) if is_other else (),
        kind=Kind.COMMAND,
        meaning=row.meaning,
        unit=_unit_of(row.long),
        range=_range_of(row.long),
        more=tuple(_forms(each for each in PROGRAM_COMMANDS if _is_form_of(each, row.long))),
        source=row.source,
        certainty=row.certainty,
    )


def _is_form_of(form: ProgramCommandFact, word: str) -> bool:
    return form.long == word or form.long.startswith(f"{word} ")


def _forms(rows: Iterable[ProgramCommandFact]) -> Iterator[str]:
    for row in rows:
        also = f", {row.short}" if row.short != row.long else ""
        yield f"{row.long}{also}: {row.meaning} ({row.source}){_doubt(row.certainty)}"


def _number_of(word: str) -> str | None:
    """Return the name of the one number that a command takes."""
    for row in PROGRAM_COMMANDS:
        places = _PLACE.findall(row.long)
        if len(places) == 1 and row.long == f"{word} {{{places[0]}}}" and places[0] in NUMBERS:
            return str(places[0])
    return None


def _range_of(word: str) -> str | None:
    name = _number_of(word)
    if name is None:
        return None
    fact = NUMBERS[name]
    decimals = "as many decimals as positions have" if fact.decimals is None else f"{fact.decimals} decimals"
    return f"{'above ' if fact.above_low else ''}{fact.low:,} to {fact.high:,}, {decimals} ({fact.source})"


def _unit_of(word: str) -> str | None:
    name = _number_of(word)
    return None if name is None else NUMBERS[name].unit or None


def _functions() -> Iterator[Entry]:
    for row in CONTROL_FUNCTIONS:
        if row.word is not None and not any(row.word in {each.long, each.short} for each in COMMANDS):
            yield Entry(
                word=row.word, kind=Kind.COMMAND, meaning=row.meaning, source=row.source, certainty=row.certainty
            )


def _words_of_dialect(settings: DriveSettings) -> Iterator[Entry]:
    """Give the words that the settings of this drive have in place of the usual ones."""
    usual = {getattr(DriveSettings().dialect, each.name) for each in fields(settings.dialect)}
    for fact in DIALECT_FACTS:
        word = getattr(settings.dialect, fact.name)
        if word and word not in usual and "{" not in word:
            yield Entry(
                word=word.upper(),
                kind=Kind.COMMAND,
                meaning=fact.meaning,
                more=("the word is that of this drive's settings",),
                source=fact.source,
                certainty=fact.certainty,
            )


def _program_commands() -> Iterator[Entry]:
    """Give an entry a first word, for those that are no commands of the line."""
    heads: dict[str, list[ProgramCommandFact]] = {}
    for row in PROGRAM_COMMANDS:
        if not any(_is_form_of(row, command.long) for command in COMMANDS):
            head = row.long.partition(" ")[0]
            heads.setdefault("=" if head.startswith("{") else head, []).append(row)
    for head, rows in heads.items():
        yield Entry(
            word=head,
            kind=Kind.PROGRAM,
            meaning="; ".join(dict.fromkeys(row.meaning for row in rows)),
            more=tuple(_forms(rows)),
            source="; ".join(dict.fromkeys(row.source for row in rows)),
            certainty=max((row.certainty for row in rows), key=lambda each: each is not Certainty.DOCUMENTED),
            is_typed=head != "=",
        )


_PARAMETERS: Final = {row.number: row for row in PARAMETERS}
