"""Parameters and variables as people write and read them: P40, 40-49, V5, P40=1.5; and tables of them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from rich.table import Table

from compax_aio import Drive, InvalidCommandError, RestoreIncompleteError
from compax_aio.compax.numbered_values import Difference, NumberedValues
from compax_aio.compax.settings import DriveSettings
from compax_aio.compax.value_file import read_file
from compax_aio.compax.value_tables import PARAMETER_TABLE, VARIABLE_TABLE, ValueTable

from .files import reading
from .number_words import number_of

__all__ = [
    "PARAMETERS",
    "VARIABLES",
    "Kind",
    "Row",
    "account_document",
    "account_table",
    "assignments_in",
    "changes_table",
    "differences_table",
    "kind_of",
    "names_in",
    "rows_table",
    "values_in_file",
]

_NAME: Final = re.compile(r"(?P<letter>[PVpv])?(?P<first>[0-9]{1,3})(?:-(?P=letter)?(?P<last>[0-9]{1,3}))?")
_ASSIGNMENT: Final = re.compile(r"(?P<name>[^=]+)=(?P<value>[^=]+)")
_BRING_ABOUT: Final = {19: "the baud rate", 20: "handshake and errors of the serial interface"}


@dataclass(frozen=True, slots=True, eq=False)
class Kind:
    """Parameters, or variables; there is one of each."""

    table: ValueTable
    is_protected: bool
    """Whether writing wants the password off, and VP afterwards."""

    def of(self, drive: Drive) -> NumberedValues:
        """Return those of *drive*."""
        return drive.parameters if self.is_protected else drive.variables

    def counted(self, count: int) -> str:
        """Write how many there are: ``1 parameter``, ``3 variables``."""
        return f"{count} {self.table.kind.removesuffix('s') if count == 1 else self.table.kind}"

    def written(self, number: int, value: float | None) -> str:
        """Write a value with the decimals that it is stored with, or with as many as it has."""
        if value is None:
            return "not given"
        text = f"{value:.{self.table.decimals[number]}f}"
        return text if float(text) == value else repr(value)

    def meaning(self, number: int) -> str:
        """Say what one means, as far as pages at hand tell; else nothing."""
        fact = self.table.facts.get(number)
        return fact.meaning if fact is not None else ""

    def unit(self, number: int, axis_unit: str) -> str | None:
        """Return the unit of one, if it is known."""
        fact = self.table.facts.get(number)
        return axis_unit if fact is not None and fact.unit == "axis" else fact.unit if fact is not None else None

    def note_on(self, numbers: Iterable[int]) -> str | None:
        """Warn of those that change the line itself; None if there are none."""
        told = [f"P{number} is {what}" for number, what in _BRING_ABOUT.items() if number in numbers]
        if not told or not self.is_protected:
            return None
        return f"{' and '.join(told)}: once it is in force, the line may be lost until its settings fit again"


PARAMETERS: Final = Kind(PARAMETER_TABLE, is_protected=True)
VARIABLES: Final = Kind(VARIABLE_TABLE, is_protected=False)
_BY_LETTER: Final = {"P": PARAMETERS, "V": VARIABLES}


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One value as it was read, with all that is known of it."""

    name: str
    value: float | None
    """None where the drive does not give it."""
    meaning: str
    unit: str | None
    source: str | None
    """Page of the manuals; None where nothing is known."""
    certainty: str | None

    @classmethod
    def of(cls, kind: Kind, number: int, value: float | None, axis_unit: str) -> Row:
        """Make one."""
        fact = kind.table.facts.get(number)
        return cls(
            name=kind.table.name(number),
            value=value,
            meaning=kind.meaning(number),
            unit=kind.unit(number, axis_unit),
            source=fact.source if fact is not None else None,
            certainty=fact.certainty.name.lower() if fact is not None else None,
        )


# Words --------------------------------------------------------------------------------------------------------------


def kind_of(*, variables: bool) -> Kind:
    """Return what ``--variables`` chooses."""
    return VARIABLES if variables else PARAMETERS


def names_in(words: Iterable[str], default: Kind) -> list[tuple[Kind, int]]:
    """
    Read names: ``40``, ``P40``, ``V5``, ``P40-49``; each once, in their order.

    Raises:
        InvalidCommandError: One is no name, or there is no such parameter or variable.
    """
    found: dict[tuple[Kind, int], None] = {}
    for word in words:
        match = _NAME.fullmatch(word.strip())
        if match is None:
            raise InvalidCommandError(
                f"{word!r} is no parameter and no variable", hint="write P40, V5, or a range like P40-49"
            )
        kind = _BY_LETTER[match["letter"].upper()] if match["letter"] else default
        first = kind.table.index(int(match["first"]))
        last = first if match["last"] is None else kind.table.index(int(match["last"]))
        if last < first:
            raise InvalidCommandError(f"{word!r} runs backwards", hint=f"write {kind.table.letter}{last}-{first}")
        found.update({(kind, number): None for number in range(first, last + 1) if number in kind.table.decimals})
    return list(found)


def assignments_in(words: Iterable[str], default: Kind, settings: DriveSettings) -> tuple[Kind, dict[int, float]]:
    """
    Read assignments: ``P40=1.5``; all of one kind, each once, and each such that the drive can be told it.

    Raises:
        InvalidCommandError: One is none, or the drive cannot be told it.
    """
    values: dict[int, float] = {}
    kinds: dict[Kind, None] = {}
    for word in words:
        match = _ASSIGNMENT.fullmatch(word.strip())
        if match is None:
            raise InvalidCommandError(f"{word!r} sets nothing", hint="write P40=1.5, without blanks around =")
        for kind, number in names_in([match["name"]], default):
            if number in values and kind in kinds:
                raise InvalidCommandError(f"{kind.table.name(number)} is set twice")
            kinds[kind] = None
            values[number] = _number(word, match["value"])
            kind.table.written(number, values[number], settings.dialect.write_value)
    if len(kinds) != 1:
        what = "parameters and variables cannot be set in one go" if kinds else "there is nothing to set"
        raise InvalidCommandError(what, hint="write P40=1.5 or V5=3, as many as you like of one kind")
    return next(iter(kinds)), values


def _number(word: str, text: str) -> float:
    try:
        return number_of(text.strip())
    except ValueError:
        raise InvalidCommandError(f"{word!r}: {text!r} is no number", hint="write 1.5, with a point") from None


def values_in_file(path: Path, kind: Kind, settings: DriveSettings) -> dict[int, float]:
    """
    Read a file that `compax params save` has written, and check that a drive can be told all of it.

    Raises:
        InvalidCommandError: It cannot be read, is no such file, or holds something that a drive cannot be told.
    """
    with reading(path):
        values = dict(read_file(path, kind=kind.table.kind, letter=kind.table.letter).values)
    for number, value in values.items():
        kind.table.written(number, value, settings.dialect.write_value)
    return values


# Tables -------------------------------------------------------------------------------------------------------------


def rows_table(rows: Iterable[tuple[Kind, int, Row]]) -> Table:
    """Make a table of values with what they mean."""
    table = Table(box=None, pad_edge=False)
    table.add_column("name")
    table.add_column("value", justify="right")
    table.add_column("unit")
    table.add_column("meaning")
    for kind, number, row in rows:
        table.add_row(row.name, kind.written(number, row.value), row.unit or "", row.meaning)
    return table


def changes_table(kind: Kind, changes: Mapping[int, tuple[float, float]], axis_unit: str) -> Table:
    """Make a table of what is there, and what will be."""
    table = Table(box=None, pad_edge=False)
    table.add_column("name")
    table.add_column("now", justify="right")
    table.add_column("", justify="center")
    table.add_column("new", justify="right")
    table.add_column("unit")
    table.add_column("meaning")
    for number, (old, new) in changes.items():
        unit = kind.unit(number, axis_unit) or ""
        old_text, new_text = kind.written(number, old), kind.written(number, new)
        table.add_row(kind.table.name(number), old_text, "→", new_text, unit, kind.meaning(number))
    return table


def differences_table(kind: Kind, differences: Iterable[Difference], axis_unit: str) -> Table:
    """Make a table of what a file says otherwise than the drive."""
    table = Table(box=None, pad_edge=False)
    table.add_column("name")
    table.add_column("in the file", justify="right")
    table.add_column("in the drive", justify="right")
    table.add_column("unit")
    table.add_column("meaning")
    for each in differences:
        unit = kind.unit(each.number, axis_unit) or ""
        in_file, in_drive = kind.written(each.number, each.in_file), kind.written(each.number, each.in_drive)
        table.add_row(each.name, in_file, in_drive, unit, kind.meaning(each.number))
    return table


def account_table(error: RestoreIncompleteError, name: Any) -> Table:
    """Make a table of what became of each change of a restore or download that stopped half way."""
    table = Table(box=None, pad_edge=False)
    table.add_column("name")
    table.add_column("what the drive has")
    for number, (old, new) in error.applied.items():
        table.add_row(name(number), f"the new one, read back: {new} (it was {old})")
    for number, (old, new) in error.uncertain.items():
        table.add_row(name(number), f"not known: {new} was sent (it was {old})", style="bold")
    for number in error.not_applied:
        table.add_row(name(number), "what it had before")
    return table


def account_document(error: RestoreIncompleteError, *, rolled_back: bool) -> dict[str, Any]:
    """Return the same for programs."""
    return {
        "applied": {number: {"old": old, "new": new} for number, (old, new) in error.applied.items()},
        "uncertain": {number: {"old": old, "new": new} for number, (old, new) in error.uncertain.items()},
        "not_applied": error.not_applied,
        "rolled_back": rolled_back,
    }
