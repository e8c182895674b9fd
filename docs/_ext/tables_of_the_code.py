"""Tables that are made from the code when the documents are built, so that they cannot lag behind it."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import re
import textwrap
import typing
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import Directive
from sphinx.application import Sphinx

from compax_aio import errors
from compax_aio.compax.facts.device_errors import DEVICE_ERRORS
from compax_aio.compax.protocol import TRANSITIONS, State
from compax_aio.compax.settings import DriveSettings
from compax_aio.simulator.compax import Knobs

__all__ = ["setup"]

Cell = str | nodes.Node
Table = tuple[Sequence[Cell], Sequence[Sequence[Cell]]]

_WIDEST = 50
_ROW = re.compile(r"Rows? [\d, and]+[:.] ?")


def _code(text: str) -> nodes.Node:
    return nodes.literal(text, text)


def _table(head: Sequence[Cell], rows: Sequence[Sequence[Cell]]) -> nodes.table:
    columns = zip(head, *rows, strict=True)
    group = nodes.tgroup(cols=len(head))
    group += [nodes.colspec(colwidth=min(_WIDEST, max(map(_length, column)))) for column in columns]
    group += nodes.thead("", _row(head))
    group += nodes.tbody("", *map(_row, rows))
    return nodes.table("", group, classes=["colwidths-auto"])


def _plain(text: str) -> str:
    return " ".join(text.replace("``", "").split())


def _length(cell: Cell) -> int:
    return len(cell if isinstance(cell, str) else cell.astext())


def _row(cells: Sequence[Cell]) -> nodes.row:
    row = nodes.row()
    for cell in cells:
        content = nodes.Text(cell) if isinstance(cell, str) else cell
        row += nodes.entry("", nodes.paragraph("", "", content))
    return row


# Errors


def _error_rows(kind: type[BaseException], depth: int = 0) -> Iterator[tuple[Cell, Cell, Cell]]:
    """List *kind* and what is derived from it; a class with two parents stands under its first."""
    first_line = _plain((kind.__doc__ or "").strip().splitlines()[0])
    others = [parent.__name__ for parent in kind.__bases__[1:]]
    yield _indented(kind.__name__, depth), first_line, ", ".join(others)
    for child in kind.__subclasses__():
        if child.__bases__[0] is kind and child.__module__ == errors.__name__:
            yield from _error_rows(child, depth + 1)


def _indented(name: str, depth: int) -> nodes.Node:
    text = "\N{NO-BREAK SPACE}" * 4 * depth
    return nodes.inline("", "", nodes.Text(text), _code(name))


def _errors() -> Table:
    return ("error", "what it tells", "is also a"), list(_error_rows(errors.CompaxError))


def _device_errors() -> Table:
    rows = [(f"E{row.code}", row.meaning, row.remedy, f"UG p. {row.page}") for row in DEVICE_ERRORS]
    return ("code", "meaning", "remedy", "source"), rows


# States


def _states() -> Table:
    return ("state", "meaning"), [(_code(state.name), state.value) for state in State]


def _transitions() -> Table:
    events = dict.fromkeys(event for _, event in TRANSITIONS)
    rows: list[Sequence[Cell]] = []
    for event in events:
        after = [TRANSITIONS.get((state, event)) for state in State]
        rows.append((event.__name__.lstrip("_"), *("" if state is None else _code(state.name) for state in after)))
    return ("event \\ in state", *(_code(state.name) for state in State)), rows


# Settings and knobs


def _settings() -> Table:
    told = inspect.getdoc(DriveSettings) or ""
    meanings = dict(_attributes(told))
    rows = [(_code(name), _shown(default), meanings[name]) for name, default in _defaults(DriveSettings)]
    return ("setting", "default", "meaning"), rows


def _attributes(docstring: str) -> Iterator[tuple[str, str]]:
    """Read the section "Attributes:" of a docstring."""
    section = textwrap.dedent(docstring.partition("Attributes:\n")[2])
    for line in section.splitlines():
        name, _, meaning = line.partition(": ")
        yield name, _plain(meaning.replace("…", ""))


def _knobs() -> Table:
    meanings = dict(_field_docstrings(Knobs))
    kinds = typing.get_type_hints(Knobs, include_extras=True)
    rows = [(_code(name), _values(kinds[name]), _shown(default), meanings[name]) for name, default in _defaults(Knobs)]
    return ("knob", "values", "default", "meaning"), rows


def _field_docstrings(kind: type) -> Iterator[tuple[str, str]]:
    """Read the string that stands under each field of a dataclass."""
    (definition,) = ast.parse(textwrap.dedent(inspect.getsource(kind))).body
    assert isinstance(definition, ast.ClassDef)
    name = ""
    for statement in definition.body:
        if isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name):
            name = statement.target.id
        elif name and isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
            meaning = _ROW.sub("", _plain(str(statement.value.value)))
            yield name, meaning[:1].upper() + meaning[1:] if re.match("a |[a-z]{2}", meaning) else meaning
            name = ""


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
    return getattr(value, "name", None) or (str(value) if isinstance(value, str | int) else f"{type(value).__name__}()")


# Sphinx


def _directive(make: Callable[[], Table]) -> type[Directive]:
    class TableDirective(Directive):
        """Puts one table in place."""

        option_spec: ClassVar[Any] = {}

        def run(self) -> list[nodes.Node]:
            return [_table(*make())]

    return TableDirective


def setup(app: Sphinx) -> dict[str, bool]:
    """Add a directive for each table."""
    tables: Iterable[tuple[str, Callable[[], Table]]] = (
        ("table-of-errors", _errors),
        ("table-of-device-errors", _device_errors),
        ("table-of-states", _states),
        ("table-of-transitions", _transitions),
        ("table-of-settings", _settings),
        ("table-of-knobs", _knobs),
    )
    for name, make in tables:
        app.add_directive(name, _directive(make))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
