"""Builds tables for the documents out of rows, and reads what the code says about its own fields."""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, ClassVar, Final

from docutils import nodes
from docutils.parsers.rst import Directive
from sphinx.application import Sphinx

__all__ = ["Cell", "Table", "add_tables", "code", "field_docstrings", "plain"]

Cell = str | nodes.Node
Table = tuple[Sequence[Cell], Sequence[Sequence[Cell]]]

_WIDEST: Final = 50
_ROW: Final = re.compile(r"Rows? [\d, and]+[:.] ?")


def code(text: str) -> nodes.Node:
    """Return *text* as it is shown that stands in code or goes over a line."""
    return nodes.literal(text, text)


def _table(head: Sequence[Cell], rows: Sequence[Sequence[Cell]]) -> nodes.table:
    columns = zip(head, *rows, strict=True)
    group = nodes.tgroup(cols=len(head))
    group += [nodes.colspec(colwidth=min(_WIDEST, max(map(_length, column)))) for column in columns]
    group += nodes.thead("", _row(head))
    group += nodes.tbody("", *map(_row, rows))
    return nodes.table("", group, classes=["colwidths-auto"])


def plain(text: str) -> str:
    """Return *text* of a docstring without its marks and the ends of its lines."""
    return " ".join(text.replace("``", "").split())


def _length(cell: Cell) -> int:
    return len(cell if isinstance(cell, str) else cell.astext())


def _row(cells: Sequence[Cell]) -> nodes.row:
    row = nodes.row()
    for cell in cells:
        content = nodes.Text(cell) if isinstance(cell, str) else cell
        row += nodes.entry("", nodes.paragraph("", "", content))
    return row


def field_docstrings(kind: type) -> Iterator[tuple[str, str]]:
    """Read the string that stands under each field of a dataclass, or member of an enumeration."""
    (definition,) = ast.parse(textwrap.dedent(inspect.getsource(kind))).body
    assert isinstance(definition, ast.ClassDef)
    name = ""
    for statement in definition.body:
        if isinstance(statement, ast.AnnAssign | ast.Assign):
            (target,) = statement.targets if isinstance(statement, ast.Assign) else (statement.target,)
            name = target.id if isinstance(target, ast.Name) else ""
        elif name and isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
            meaning = _ROW.sub("", plain(str(statement.value.value)))
            yield name, meaning[:1].upper() + meaning[1:] if re.match("a |[a-z]{2}", meaning) else meaning
            name = ""


def _directive(make: Callable[[], Table]) -> type[Directive]:
    class TableDirective(Directive):
        """Puts one table in place."""

        option_spec: ClassVar[Any] = {}

        def run(self) -> list[nodes.Node]:
            return [_table(*make())]

    return TableDirective


def add_tables(app: Sphinx, tables: Mapping[str, Callable[[], Table]]) -> None:
    """Add a directive for each table, by its name."""
    for name, make in tables.items():
        app.add_directive(name, _directive(make))
