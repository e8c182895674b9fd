"""Tables that are made from the code when the documents are built, so that they cannot lag behind it."""

from __future__ import annotations

import dataclasses
import inspect
import re
import textwrap
import typing
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from table_making import Cell, Table, add_tables, code, field_docstrings, plain

from compax_aio import errors
from compax_aio.cli.exit_codes import EXIT_CODES
from compax_aio.compax.facts.certainty import Certainty
from compax_aio.compax.facts.control_functions import CONTROL_FUNCTIONS
from compax_aio.compax.facts.device_errors import DEVICE_ERRORS, ERROR_RANGES
from compax_aio.compax.facts.parameters import PARAMETERS
from compax_aio.compax.facts.quantities import QUANTITIES
from compax_aio.compax.facts.serial_interface import INTERFACE_BITS
from compax_aio.compax.facts.settings import DIALECT_FACTS, SETTING_FACTS
from compax_aio.compax.facts.status import S16_BITS, S17_BITS, STATUS_VALUES
from compax_aio.compax.settings import Dialect, DriveSettings
from compax_aio.haas.facts.alarms import ALARMS as CONTROL_ALARMS
from compax_aio.haas.facts.queries import QUERIES
from compax_aio.simulator.camm1 import Knobs as CutterKnobs
from compax_aio.simulator.compax import Knobs
from compax_aio.simulator.haas import Knobs as ControlKnobs
from compax_aio.simulator.smc import Knobs as SmcKnobs
from compax_aio.smc.facts import COMMANDS, Reply
from compax_aio.smc.profile import PROFILES, Profile
from compax_aio.smc.settings import SmcSettings

__all__ = ["setup"]

# Errors


def _error_rows(kind: type[BaseException], depth: int = 0) -> Iterator[tuple[Cell, Cell, Cell]]:
    """List *kind* and what is derived from it; a class with two parents stands under its first."""
    first_line = plain((kind.__doc__ or "").strip().splitlines()[0])
    others = [parent.__name__ for parent in kind.__bases__[1:]]
    yield _indented(kind.__name__, depth), first_line, ", ".join(others)
    for child in kind.__subclasses__():
        if child.__bases__[0] is kind and child.__module__ == errors.__name__:
            yield from _error_rows(child, depth + 1)


def _indented(name: str, depth: int) -> nodes.Node:
    text = "\N{NO-BREAK SPACE}" * 4 * depth
    return nodes.inline("", "", nodes.Text(text), code(name))


def _errors() -> Table:
    return ("error", "what it tells", "is also a"), list(_error_rows(errors.CompaxError))


def _device_errors() -> Table:
    rows = [
        (f"E{row.code}", row.meaning, row.cause or "not on a page at hand", row.remedy, f"UG p. {row.page}")
        for row in DEVICE_ERRORS
    ]
    return ("code", "meaning", "cause", "remedy", "source"), rows


def _error_ranges() -> Table:
    rows = [
        (_range(row.codes), row.meaning, row.effect, row.remedy, _founded(row.certainty), row.source)
        for row in ERROR_RANGES
    ]
    return ("codes", "what they are", "effect", "remedy", "founded", "source"), rows


def _range(codes: range) -> str:
    return f"E{codes[0]} to E{codes[-1]}" if len(codes) > 1 else f"{codes[0]}"


def _exit_codes() -> Table:
    rows = [
        (str(row.code), row.meaning, ", ".join(_kind(kind) for kind in row.kinds))
        for row in sorted(EXIT_CODES, key=lambda row: row.code)
    ]
    return ("code", "what it says", "ended by"), rows


def _kind(kind: type[BaseException]) -> str:
    return "any other" if kind is Exception else kind.__name__


# Facts


def _founded(certainty: Certainty | None) -> str:
    return certainty.name.lower() if certainty else "chosen here"


def _status_values() -> Table:
    rows = [
        (f"S{row.number}", row.meaning, row.unit or "", row.form.value, _founded(row.certainty), row.source)
        for row in STATUS_VALUES
    ]
    return ("status", "meaning", "unit", "form", "founded", "source"), rows


def _status_bits() -> Table:
    rows = [
        (f"{status} bit {row.bit}", code(row.name), row.meaning_when_set, _founded(row.certainty), row.source)
        for status, bits in (("S16", S16_BITS), ("S17", S17_BITS))
        for row in bits
    ]
    return ("bit", "name", "meaning when 1", "founded", "source"), rows


def _quantities() -> Table:
    rows = [(str(row.number), row.meaning, row.unit or "", _founded(row.certainty), row.source) for row in QUANTITIES]
    return ("number", "quantity", "unit", "founded", "source"), rows


def _interface_bits() -> Table:
    rows = [
        (
            str(row.weight),
            code(row.name) if row.name else "",
            row.meaning_when_set,
            _founded(row.certainty),
            row.source,
        )
        for row in INTERFACE_BITS
    ]
    return ("weight", "name", "meaning when set", "founded", "source"), rows


def _parameters() -> Table:
    rows = [(f"P{row.number}", row.meaning, row.unit or "", _founded(row.certainty), row.source) for row in PARAMETERS]
    return ("parameter", "meaning", "unit", "founded", "source"), rows


def _control_functions() -> Table:
    rows = [
        (
            str(row.number),
            row.meaning,
            code(row.word) if row.word else "",
            _founded(row.certainty),
            row.source,
            code(row.member) if row.member else "",
        )
        for row in CONTROL_FUNCTIONS
    ]
    return ("no.", "function", "word on RS-232", "word founded", "source", "sent by"), rows


# SMC


def _smc_commands() -> Table:
    def flags(row: Any) -> str:
        told = ["action"] if row.is_action else []
        return ", ".join([*told, *(["moves"] if row.moves else [])])

    rows = [
        (
            code(row.letter),
            row.meaning,
            "" if row.reply is Reply.NOTHING else row.reply.value,
            flags(row),
            ", ".join(profile.name for profile in PROFILES.values() if row.letter in profile.commands),
            row.source,
        )
        for row in COMMANDS.values()
    ]
    return ("command", "meaning", "answer", "is", "known of", "source"), rows


def _profiles() -> Table:
    rows = [
        (code(field.name), *(_fact(getattr(profile, field.name)) for profile in PROFILES.values()))
        for field in dataclasses.fields(Profile)
    ]
    return ("", *PROFILES), rows


def _fact(value: object) -> str:
    """Write what a profile says, for people."""
    if value is None or value == ():
        return "not known"
    if isinstance(value, frozenset):
        return " ".join(sorted(value))
    if isinstance(value, tuple):
        return ", ".join(map(_fact, value))
    return "blank" if value == " " else f"{value:,.10g}" if isinstance(value, float) else str(value)


def _smc_settings() -> Table:
    meanings = dict(field_docstrings(SmcSettings))
    rows = [(code(name), _smc_shown(default), meanings[name]) for name, default in _defaults(SmcSettings)]
    return ("setting", "default", "meaning"), rows


def _smc_shown(value: Any) -> str:
    return value.name if isinstance(value, Profile) else _shown(value)


# Settings and knobs


def _settings() -> Table:
    told = inspect.getdoc(DriveSettings) or ""
    meanings = dict(_attributes(told))
    facts = {row.name: row for row in SETTING_FACTS}
    rows = [
        (code(name), _shown(default), _founded(facts[name].certainty), facts[name].source, meanings[name])
        for name, default in _defaults(DriveSettings)
    ]
    return ("setting", "default", "founded", "source", "meaning"), rows


def _dialect() -> Table:
    facts = {row.name: row for row in DIALECT_FACTS}
    rows = [
        (
            code(name),
            "not set" if default is None else code(default),
            _founded(facts[name].certainty),
            facts[name].source,
            facts[name].meaning,
        )
        for name, default in _defaults(Dialect)
    ]
    return ("word", "default", "founded", "source", "what it does"), rows


def _attributes(docstring: str) -> Iterator[tuple[str, str]]:
    """Read the section "Attributes:" of a docstring."""
    section = textwrap.dedent(docstring.partition("Attributes:\n")[2])
    for entry in re.split(r"\n(?=\S)", section.rstrip()):
        name, _, meaning = entry.partition(": ")
        yield name, plain(meaning.replace("…", ""))


def _knobs(kind: type) -> Table:
    meanings = dict(field_docstrings(kind))
    kinds = typing.get_type_hints(kind, include_extras=True)
    rows = [
        (code(name), _values(kinds[name]), _shown(default), meanings.get(name, "")) for name, default in _defaults(kind)
    ]
    return ("knob", "values", "default", "meaning"), rows


def _values(kind: Any) -> str:
    """Write the values that a knob takes, for people."""
    if kind is bool:
        return "0, 1"
    if typing.get_origin(kind) is typing.Annotated:
        return str(typing.get_args(kind)[1])
    return ", ".join(map(str, typing.get_args(kind)))


def _defaults(kind: Any) -> Iterator[tuple[str, Any]]:
    for field in dataclasses.fields(kind):
        default = field.default
        if default is dataclasses.MISSING and field.default_factory is not dataclasses.MISSING:
            default = field.default_factory()
        yield field.name, default


def _shown(value: Any) -> str:
    if isinstance(value, bool):
        return str(int(value))
    if isinstance(value, float):
        return f"{value:,.10g}"
    if value is None or value == {}:
        return "not set"
    return getattr(value, "name", None) or (str(value) if isinstance(value, str | int) else f"{type(value).__name__}()")


def _control_alarms() -> Table:
    head = ("number", "text", "meaning", "what to do", "existence")
    rows = []
    for each in CONTROL_ALARMS.values():
        heard = "" if each.heard_as is None else f" (often told as {each.heard_as})"
        number = f"not known{heard}" if each.number is None else str(each.number)
        rows.append((number, code(each.text), each.meaning, each.remedy, each.certainty.value))
    return head, rows


def _questions() -> Table:
    head = ("question", "meaning", "classic answer", "answer over Ethernet")
    return head, [
        (
            code(f"{each.command} n" if each.takes_variable else each.command),
            each.meaning,
            code(each.classic_example),
            code(each.ethernet_example),
        )
        for each in QUERIES.values()
    ]


# Sphinx


def setup(app: Sphinx) -> dict[str, bool]:
    """Add a directive for each table."""
    tables: dict[str, Callable[[], Table]] = {
        "table-of-errors": _errors,
        "table-of-exit-codes": _exit_codes,
        "table-of-device-errors": _device_errors,
        "table-of-error-ranges": _error_ranges,
        "table-of-status-values": _status_values,
        "table-of-status-bits": _status_bits,
        "table-of-quantities": _quantities,
        "table-of-interface-bits": _interface_bits,
        "table-of-parameters": _parameters,
        "table-of-control-functions": _control_functions,
        "table-of-dialect": _dialect,
        "table-of-settings": _settings,
        "table-of-knobs": partial(_knobs, Knobs),
        "table-of-smc-commands": _smc_commands,
        "table-of-smc-settings": _smc_settings,
        "table-of-smc-knobs": partial(_knobs, SmcKnobs),
        "table-of-camm1-knobs": partial(_knobs, CutterKnobs),
        "table-of-haas-knobs": partial(_knobs, ControlKnobs),
        "table-of-haas-alarms": _control_alarms,
        "table-of-haas-questions": _questions,
        "table-of-profiles": _profiles,
    }
    add_tables(app, tables)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
