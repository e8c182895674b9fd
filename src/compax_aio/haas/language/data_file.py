"""Files of numbered data, ``N… V…``: read, shown and edited as far as their rules allow; else every byte is kept."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

from ...errors import InvalidCommandError
from ...escaping import shown
from ..facts.alarms import ALARMS, Alarm
from ..facts.data_files import CHECKSUM_NUMBER, DATA_FILES, LAST_NUMBER, DataFileRules, DataKind, Presence
from ..facts.eob import EobPattern
from .lines import LINE_ENDS, SKIPPED, Lines, as_bytes

__all__ = ["DataFile", "DataLine", "Fault", "fault_of", "kind_of_data", "lines_of_data", "parse_data_file"]

_IN_FRONT: Final = b"[" + re.escape(SKIPPED) + b"]*"
_VALUE: Final = rb"((?:[+-][ \t]*)?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+))"
_LINE: Final = re.compile(_IN_FRONT + rb"N[ \t]*([0-9]{1,9})[ \t]*V[ \t]*" + _VALUE + _IN_FRONT)
_WHOLE_VALUE: Final = re.compile(r"(?:[+-][ \t]*)?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)")
_BLANKS: Final = b" \t"
_MOST_DATA: Final = 1_000_000
"""Macro variables, of which there are most, are some ten thousand."""

_PARTS: Final = (
    (re.compile(_IN_FRONT + rb"N"), "invalid-n-code", "a line of data begins with N"),
    (re.compile(rb"[ \t]*[0-9]{1,9}(?![0-9])"), "invalid-n-code", "behind N stands a number of at most 9 digits"),
    (re.compile(rb"[ \t]*V"), "invalid-n-code", "behind the number stands V"),
    (re.compile(rb"[ \t]*" + _VALUE), "invalid-v-code", "behind V stands a value: a sign, digits, a decimal point"),
    (re.compile(_IN_FRONT + rb"\Z"), "invalid-v-code", "behind the value stands nothing"),
)


class DataLine(NamedTuple):
    """One line of data; a tuple, for there may be thousands."""

    line: int
    """In the file, from 1."""
    offset: int
    """Of its first byte in the file, from 0."""
    raw: bytes
    """With its end."""
    number: int
    """Behind N: of what the value is."""
    value: str
    """Behind V, as text without blanks; nothing is known of how it must be written."""

    @property
    def is_data(self) -> bool:
        """Whether it is neither the checksum nor N9999."""
        return self.number not in (CHECKSUM_NUMBER, LAST_NUMBER)


@dataclass(frozen=True, slots=True)
class Fault:
    """Why a line is no line of data."""

    column: int
    """From 1."""
    what: str
    alarm: Alarm


@dataclass(frozen=True, slots=True, kw_only=True)
class DataFile:
    """
    Parameters, settings, offsets or macro variables as a control sends them; ``bytes(file)`` are those it was made of.

    Attributes:
        kind: What they are.
        data: All of its bytes.
        lines: Those of data, N0 and N9999 among them, in their order.
        lead_in: What stands in front of the first ``%``. No data.
        tail: What stands behind the line of the last ``%``. No data.
        payload: From the first ``%`` to the end of the line of the last one: what a control is sent back.
        has_start: Whether the data begin with ``%``.
        has_end: Whether they end with ``%``: else something may be missing.
        eob: The pattern all lines end with; None if they are mixed, or there is none.
    """

    kind: DataKind
    data: bytes
    lines: tuple[DataLine, ...]
    lead_in: bytes
    tail: bytes
    payload: bytes
    has_start: bool
    has_end: bool
    eob: EobPattern | None

    def __bytes__(self) -> bytes:
        """Give the bytes it was made of."""
        return self.data

    def __len__(self) -> int:
        """How many bytes it has."""
        return len(self.data)

    def __iter__(self) -> Iterator[DataLine]:
        """Give its lines of data."""
        return iter(self.lines)

    @property
    def rules(self) -> DataFileRules:
        """What holds for its kind."""
        return DATA_FILES[self.kind]

    @property
    def checksum(self) -> str | None:
        """The value of N0, which the control has computed; None if there is no such line."""
        return self._value_of(CHECKSUM_NUMBER)

    @property
    def last_value(self) -> str | None:
        """The value of N9999; None if there is no such line."""
        return self._value_of(LAST_NUMBER)

    @property
    def had_n0(self) -> bool:
        """Whether there is a line N0."""
        return self.checksum is not None

    @property
    def had_n9999(self) -> bool:
        """Whether there is a line N9999."""
        return self.last_value is not None

    @property
    def values(self) -> Mapping[int, str]:
        """By number, the value; without N0 and N9999. Of a number that comes twice, the last one."""
        return {each.number: each.value for each in self.lines if each.is_data}

    def with_values(self, values: Mapping[int, str | float]) -> DataFile:
        """
        Return a file with other values, and all else as it is (Haas 11596-8000; sheet, section 5).

        A value that is written as before changes nothing. Once one changes, N0 is left out, for it no longer fits:
        settings and offsets may go without. N9999 of macro variables stays as it is.

        Args:
            values: By number, as text or as a number; written as given.

        Raises:
            InvalidCommandError: Parameters, which cannot go without the control's N0; a number that the file has not,
                or has twice; N0 or N9999; what is no value.
        """
        if not self.rules.may_be_edited:
            raise InvalidCommandError(
                f"a file of {self.kind} is sent back byte for byte, or not at all: without the checksum N0 that the "
                "control has computed it is not whole, and how it is computed is not known",
                hint="change them at the control",
            )
        new = {number: _written(number, value) for number, value in values.items()}
        self._refuse_unknown(new)
        changed = {each.offset: new[each.number] for each in self.lines if each.number in new and _is_other(each, new)}
        return self._edited(changed) if changed else self

    def without_checksum(self) -> DataFile:
        """
        Return the file without its N0, all else as it is.

        Raises:
            InvalidCommandError: They are parameters, where N0 is mandatory (Haas 11596-8000).
        """
        if self.rules.checksum is Presence.MANDATORY:
            raise InvalidCommandError(
                f"N0 is mandatory with {self.kind}", hint="send the file back as it came, byte for byte"
            )
        return self._edited({}) if self.had_n0 else self

    def _value_of(self, number: int) -> str | None:
        return next((each.value for each in self.lines if each.number == number), None)

    def _refuse_unknown(self, new: Mapping[int, str]) -> None:
        counts = Counter(each.number for each in self.lines)
        for number in new:
            if number in (CHECKSUM_NUMBER, LAST_NUMBER):
                raise InvalidCommandError(
                    f"N{number} is no {self.rules.singular}", hint="what it must be, the control alone knows"
                )
            if counts[number] != 1:
                has = f"has N{number} {counts[number]} times" if counts[number] else f"has no N{number}"
                raise InvalidCommandError(
                    f"the file of {self.kind} {has}", hint="receive it from the control again, and edit that one"
                )

    def _edited(self, changed: Mapping[int, str]) -> DataFile:
        """Put values into lines, by their offset, and leave N0 out."""
        pieces, done = [], 0
        for each in self.lines:
            end = each.offset + len(each.raw)
            if each.number == CHECKSUM_NUMBER:
                pieces.append(self.data[done : each.offset])
                done = end
            elif each.offset in changed:
                match = _LINE.match(each.raw.rstrip(LINE_ENDS))
                begin, behind = match.span(2)  # type: ignore[union-attr]  # it has been read by it
                pieces += [self.data[done : each.offset + begin], changed[each.offset].encode("ascii")]
                done = each.offset + behind
        return parse_data_file(b"".join([*pieces, self.data[done:]]), self.kind, eob=self.eob)


def _is_other(line: DataLine, new: Mapping[int, str]) -> bool:
    return "".join(new[line.number].split()) != line.value


def _written(number: int, value: object) -> str:
    text = value if isinstance(value, str) else f"{value}"
    if isinstance(value, bool) or not _WHOLE_VALUE.fullmatch(text):
        raise InvalidCommandError(
            f"N{number}: {shown(value)} is no value",
            hint="a value is a sign, digits and a decimal point: '100', '-1.5'",
        )
    return text


def kind_of_data(kind: DataKind | str) -> DataKind:
    """
    Return the kind of that name.

    Raises:
        InvalidCommandError: There is none.
    """
    try:
        return DataKind(kind)
    except ValueError:
        raise InvalidCommandError(
            f"{shown(kind)} is no kind of data", hint=f"there are {', '.join(DataKind)}"
        ) from None


def lines_of_data(lines: Lines) -> Iterator[DataLine | int]:
    """
    Give the lines between the ``%`` lines: as data, or as the index of one that is none; blank ones are left out.

    Raises:
        InvalidCommandError: There are more of them than any control has data.
    """
    count = 0
    for at in range(lines.first, lines.behind):
        raw = lines.raw[at]
        match = _LINE.fullmatch(raw.rstrip(LINE_ENDS))
        count += match is not None or not lines.is_blank(at)
        if count > _MOST_DATA:
            raise InvalidCommandError(
                f"it has more than {_MOST_DATA} lines of data", hint="this is no file of a control, or it is damaged"
            )
        if match is not None:
            value = match[2].translate(None, _BLANKS).decode("ascii")
            yield DataLine(at + 1, lines.offsets[at], raw, int(match[1]), value)
        elif not lines.is_blank(at):
            yield at


def fault_of(raw: bytes) -> Fault:
    """Return why a line is no line of data, and from which column on."""
    line = raw.rstrip(LINE_ENDS)
    at = 0
    for pattern, name, wanted in _PARTS:  # noqa: B007  (the part that does not fit is told)
        match = pattern.match(line, at)
        if match is None:
            break
        at = match.end()
    rest = line[at:].lstrip(SKIPPED)
    found = shown(rest[:20].decode("latin-1")) if rest else "nothing"
    return Fault(len(line) - len(rest) + 1, f"{wanted}, not {found}", ALARMS[name])


def parse_data_file(text: str | bytes, kind: DataKind | str, *, eob: EobPattern | str | None = None) -> DataFile:
    r"""
    Take a file of numbered data apart; whether it has what its kind must have is not asked.

    Args:
        text: Bytes, or text; of a file, read it as bytes.
        kind: ``"parameters"``, ``"settings"``, ``"offsets"`` or ``"macros"``.
        eob: How its lines end, if that is known (Setting 25).

    Raises:
        InvalidCommandError: A line is no line of data; the first one is told, with line and column. Or there is no
            such kind.

    >>> file = parse_data_file(b"%\nN0 V12345\nN1 V100\n%\n", "settings")
    >>> file.checksum, dict(file.values), bytes(file.with_values({1: 200}))
    ('12345', {1: '100'}, b'%\nN1 V200\n%\n')
    """
    kind = kind_of_data(kind)
    lines = Lines(as_bytes(text), eob)
    read: list[DataLine] = []
    for each in lines_of_data(lines):
        if isinstance(each, int):
            fault = fault_of(lines.raw[each])
            raise InvalidCommandError(
                f"line {each + 1}, column {fault.column}: {fault.what}",
                hint=f"this is no file of {kind}, or it is damaged; the control would raise {fault.alarm}",
            )
        read.append(each)
    return DataFile(
        kind=kind,
        data=lines.data,
        lines=tuple(read),
        lead_in=lines.lead_in,
        tail=lines.tail,
        payload=lines.payload,
        has_start=lines.start is not None,
        has_end=lines.end is not None,
        eob=lines.eob,
    )
