"""The page of coverage names tests that exist, fills its cells, and leaves nothing to be done in silence."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "coverage.md"
HEAD = ["subject", "client", "simulator", "tests"]


def rows() -> Iterator[tuple[int, list[str]]]:
    """Give line number and cells of every row of the page's tables."""
    for number, line in enumerate(PAGE.read_text().splitlines(), start=1):
        if line.startswith("|"):
            cells = [cell.strip() for cell in line.strip("|").split("|")]
            if cells != HEAD and set(line) - set("|-"):
                yield number, cells


def named_tests() -> list[str]:
    return sorted({name for _, cells in rows() for name in re.findall(r"`([^`]+\.py(?:::\w+)?)`", cells[3])})


@cache
def functions_of(file: Path) -> frozenset[str]:
    tree = ast.parse(file.read_text())
    return frozenset(each.name for each in tree.body if isinstance(each, ast.FunctionDef | ast.AsyncFunctionDef))


def test_every_row_has_its_four_cells() -> None:
    assert not [number for number, cells in rows() if len(cells) != len(HEAD)]
    assert sum(1 for _ in rows()) > 200


@pytest.mark.parametrize("name", named_tests())
def test_every_test_that_the_page_names_exists(name: str) -> None:
    file, _, function = name.partition("::")
    assert (ROOT / "tests" / file).is_file()
    assert not function or function in functions_of(ROOT / "tests" / file)


def test_a_cell_of_tests_holds_nothing_but_tests() -> None:
    cell = re.compile(r"(`[a-z_/]+\.py(::test_\w+)?`(, )?)*")
    assert not [(number, cells[3]) for number, cells in rows() if not cell.fullmatch(cells[3])]


def test_a_row_without_a_test_says_why_nothing_is_done() -> None:
    """Or that it is told elsewhere on the page, or in the instructions for people."""
    reasons = re.compile(r"not done|above|\[\]\(")
    assert not [(number, cells) for number, cells in rows() if not cells[3] and not reasons.search(cells[1] + cells[2])]


def test_what_is_not_done_has_a_reason() -> None:
    bare = [
        (number, cell)
        for number, (_, *cells) in rows()
        for cell in cells
        if cell.startswith("not done") and cell != "not done" and ": " not in cell
    ]
    alone = [
        number for number, cells in rows() if "not done" in cells and not any("not done: " in each for each in cells)
    ]
    assert not bare
    assert not alone


def test_nothing_is_left_to_be_filled_in() -> None:
    assert "TODO" not in PAGE.read_text()
