"""Answers beside their raw text: what a number means, which bits are set, what an error code stands for."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, Final

from rich.text import Text

from ...compax.codecs import (
    SerialInterface,
    decode_error,
    decode_history,
    decode_number,
    decode_status_value,
    value_text,
)
from ...compax.facts.certainty import Certainty
from ...compax.facts.device_errors import DeviceError
from ...compax.facts.serial_interface import INTERFACE_PARAMETER
from ...compax.facts.status import S16_BITS, S17_BITS, STATUS_VALUES, Form
from ...compax.settings import DriveSettings
from ...errors import UnexpectedAnswerError
from ...escaping import escaped
from .entries import parameter_entry
from .replies import Reply

__all__ = ["answered", "bits_note", "error_note"]

_QUERY: Final = re.compile(r"([SPVN])0*(\d+)")
_FORMS: Final = {row.number: row.form for row in STATUS_VALUES}
_BITS: Final = {16: S16_BITS, 17: S17_BITS}
_NO_FAULT: Final = S16_BITS[0].name


def answered(line: str, answer: str, settings: DriveSettings) -> Reply:
    """Return what the drive answered to *line*, raw, and beside it what that means as far as it is known."""
    raw = Text(escaped(answer), "bold")
    data: dict[str, Any] = {"answer": answer}
    match = _QUERY.fullmatch(line.replace(" ", "").upper())
    if match is None:
        return Reply(data=data, people=raw)
    try:
        known, note = _decoded(match[1], int(match[2]), answer, settings)
    except UnexpectedAnswerError as error:
        known, note = {}, Text(f"not understood: {error.what}", "yellow")
    return Reply(data={**data, **known}, people=Text.assemble(raw, "   " if note else "", note))


def error_note(error: DeviceError | None) -> Text:
    """Say what an error code means and what to do."""
    if error is None:
        return Text("no error", "dim")
    return Text.assemble((f"E{error.code}: {error.meaning}", "red"), f"; {error.remedy}")


def _decoded(letter: str, number: int, answer: str, settings: DriveSettings) -> tuple[Mapping[str, Any], Text]:
    if letter == "S":
        return _status(number, answer, settings)
    if letter == "P":
        return _parameter(number, answer, settings)
    if letter == "V":
        return {"value": decode_number(answer)}, Text()
    return {"record": value_text(answer)}, Text()


def _status(number: int, answer: str, settings: DriveSettings) -> tuple[Mapping[str, Any], Text]:
    form = _FORMS.get(number)
    if form is Form.PAIR:
        error = decode_error(answer)
        return {"error": error}, error_note(error)
    if form is Form.HISTORY:
        entries = decode_history(answer)
        lines = [f"\n  {each.error}; {each.ended_by or 'not acknowledged before the next'}" for each in entries]
        return {"errors": entries}, Text("no errors" if not entries else "newest first:", "dim").append("".join(lines))
    status = decode_status_value(number, answer, settings.unit)
    known: dict[str, Any] = {"value": status.value, "unit": status.unit, "meaning": status.meaning}
    if number in _BITS:
        return {**known, "bits": _named(number, str(status.value))}, bits_note(number, str(status.value))
    return known, _meant(status.meaning, status.unit, status.certainty)


def bits_note(number: int, digits: str) -> Text:
    """Name the bits that are set in the *digits* of S16 or S17; where the drive says that it has a fault, say so."""
    names = _named(number, digits)
    text = Text(", ".join(name for name, is_set in names.items() if is_set) or "no bit is set", "cyan")
    if names.get(_NO_FAULT) is False:
        text.append("; no_fault is 0: a fault, or the self-test is not over", "red")
    return text


def _named(number: int, digits: str) -> dict[str, bool]:
    return {bit.name: digits[bit.bit - 1] == "1" for bit in _BITS[number]}


def _parameter(number: int, answer: str, settings: DriveSettings) -> tuple[Mapping[str, Any], Text]:
    value = decode_number(answer)
    row = parameter_entry(number, settings.unit)
    known: dict[str, Any] = {"value": value, "unit": row.unit, "meaning": row.meaning}
    if number != INTERFACE_PARAMETER:
        return known, _meant(row.meaning, row.unit, row.certainty)
    said = SerialInterface.decode(
        value,
        xonxoff_weight=settings.xonxoff_weight,
        errors_suppressed_weight=settings.errors_suppressed_weight,
    )
    flags = {name: getattr(said, name) for name in ("xonxoff", "errors_suppressed", "binary")}
    text = Text(", ".join(name for name, is_set in flags.items() if is_set) or "nothing that is known is on", "cyan")
    if said.unknown:
        text.append(f"; weights of unknown meaning: {said.unknown}", "yellow")
    return {**known, **flags}, text


def _meant(meaning: str, unit: str | None, certainty: Certainty | None) -> Text:
    in_unit = f" in {unit}" if unit else ""
    doubt = "" if certainty in {None, Certainty.DOCUMENTED} else f" ({certainty.name.lower()})" if certainty else ""
    return Text(f"{meaning}{in_unit}{doubt}", "dim")
