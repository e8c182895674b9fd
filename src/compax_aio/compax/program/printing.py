"""Records into text: the long form of listings, and lines that fit the drive's entry buffer."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields
from decimal import Decimal
from typing import Final

from ...errors import InvalidCommandError
from ...escaping import shown
from ..facts.line import MAX_LINE_LENGTH
from ..facts.program_commands import ARITHMETIC_SIGNS, COMPARISON_SIGNS, NUMBERS, RECORD_TEMPLATE
from .forms import FORMS_OF, Form
from .records import Gosub, Goto, Parameter, Record, Status, Variable

__all__ = ["listing", "record_text", "short_text", "shortest_line", "wire_line", "wire_lines"]

_LETTERS: Final[dict[type, str]] = {Parameter: "P", Variable: "V", Status: "S"}

_LONGEST_NUMBER: Final = 100
"""Digits before or behind the point that are still written out; no drive takes a tenth of it."""


def listing(program: Mapping[int, Record]) -> str:
    """
    Print *program* in the manual's style (UG p. 95), long forms, a line feed after each record.

    Raises:
        InvalidCommandError: A record cannot be written at all, such as an assignment of two values without a sign.
    """
    return "".join(f"{_line(RECORD_TEMPLATE, number, record_text(program[number]))}\n" for number in sorted(program))


def record_text(record: Record) -> str:
    """
    Write one record without its number, in the long form: ``POSR 10 SPEED 50``.

    Raises:
        InvalidCommandError: It cannot be written at all.
    """
    form, values = _form(record)
    return _fill(form.long, form, values)


def short_text(record: Record) -> str:
    """Write one record without its number, abbreviated as in direct mode: ``PR 10 SD 50``; errors as above."""
    form, values = _form(record)
    return _fill(form.short, form, values)


def wire_line(number: int, record: Record, *, template: str = RECORD_TEMPLATE) -> str:
    """
    Write one record as a line for the drive, without CR: long if that has at most 30 characters, else abbreviated.

    The longer combined commands can be written with the abbreviations (IBS p. 54), and blanks mean nothing (UG p. 160).

    Args:
        number: 1-250.
        record: What to write there.
        template: How the drive takes it, with ``{n}`` and ``{text}``; the default is inferred.

    Raises:
        InvalidCommandError: It has more than 30 characters even so (UG p. 160), or *template* is none.
    """
    line = shortest_line(number, record, template=template)
    if not (line.isascii() and line.isprintable()):
        raise InvalidCommandError(f"{line!r} cannot be sent: a line is printable ASCII (UG p. 160)")
    if len(line) > MAX_LINE_LENGTH:
        raise InvalidCommandError(
            f"{line!r} has {len(line)} characters; the drive's entry buffer takes {MAX_LINE_LENGTH} (UG p. 160)",
            hint="use shorter numbers, or a variable in place of one",
        )
    return line


def wire_lines(program: Mapping[int, Record], *, template: str = RECORD_TEMPLATE) -> tuple[str, ...]:
    """Write all of *program* with ``wire_line``, in the order of its numbers."""
    return tuple(wire_line(number, program[number], template=template) for number in sorted(program))


def shortest_line(number: int, record: Record, *, template: str = RECORD_TEMPLATE) -> str:
    """Write one record as ``wire_line`` does, and give its shortest form if none fits."""
    form, values = _form(record)
    lines = [_line(template, number, _fill(each, form, values)) for each in (form.long, form.short)]
    lines.append(lines[-1].replace(" ", ""))
    return next((line for line in lines if len(line) <= MAX_LINE_LENGTH), lines[-1])


def _line(template: str, number: int, text: str) -> str:
    try:
        return template.format(n=number, text=text)
    except (AttributeError, LookupError, TypeError, ValueError) as error:
        raise InvalidCommandError(
            f"record number {shown(number)} cannot be written by the template {shown(template)}: {error}",
            hint=f"a template has {{n}} and {{text}}, like {RECORD_TEMPLATE!r}",
        ) from None


def _form(record: Record) -> tuple[Form, list[object]]:
    by_count = FORMS_OF.get(type(record))
    if by_count is None:
        raise InvalidCommandError(f"{shown(record)} is no record of a program")
    values = [value for field in fields(record) if (value := getattr(record, field.name)) is not None]
    form = by_count.get(len(values))
    if form is None:
        raise InvalidCommandError(f"{shown(record)} cannot be written: a field is missing")
    return form, values


def _fill(text: str, form: Form, values: Iterable[object]) -> str:
    for place, value in zip(form.places, values, strict=True):
        text = text.replace(f"{{{place}}}", _written(value, place), 1)
    return text


def _written(value: object, place: str) -> str:
    if isinstance(value, Goto | Gosub):
        return record_text(value)
    if isinstance(value, tuple):
        return "".join(_written(each, "level") for each in value)
    if isinstance(value, Parameter | Variable | Status):
        # A dot says "in place of a number" (UG p. 100); where P, V and S stand for themselves there is none. Inferred.
        return ("." if place in NUMBERS else "") + _LETTERS[type(value)] + _whole(value.number)
    if isinstance(value, Decimal):
        return _number(value)
    if isinstance(value, int):
        return _whole(value)
    if isinstance(value, str) and value in (*COMPARISON_SIGNS, *ARITHMETIC_SIGNS):
        return value
    raise InvalidCommandError(
        f"{shown(value)} cannot be written into a record", hint="numbers are int or Decimal: Decimal('0.1'), not 0.1"
    )


def _whole(number: int) -> str:
    plain = int.__int__(number) if isinstance(number, int) else None  # which writes itself as a number
    if plain is None or abs(plain) >= 10**_LONGEST_NUMBER:
        raise InvalidCommandError(f"{shown(number)} is no whole number that could be written into a record")
    return str(plain)


def _number(number: Decimal) -> str:
    """Write *number* exactly, as short as it goes."""
    if not number.is_finite():
        raise InvalidCommandError(f"{shown(number)} is no number that a drive could be told")
    exponent = number.as_tuple().exponent
    if number.adjusted() > _LONGEST_NUMBER or (isinstance(exponent, int) and abs(exponent) > _LONGEST_NUMBER):
        raise InvalidCommandError(f"a number of more than {_LONGEST_NUMBER} digits cannot be written")
    text = f"{number:f}"
    if "." in text:
        text = text.rstrip("0").rstrip(".")
    return "0" if text in {"-0", ""} else text
