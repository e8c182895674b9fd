"""The pages of coverage name tests that exist, fill their cells, and leave nothing to be done in silence."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from compax_aio.camm1.facts.instructions import CONTROL_INSTRUCTIONS
from compax_aio.camm1.facts.mnemonics import COMMON, MODE_1, MODE_2
from compax_aio.haas.facts.queries import QUERIES
from compax_aio.smc.facts import COMMANDS

ROOT = Path(__file__).parents[2]
PAGES = {"coverage.md": 200, "smc-coverage.md": 55, "camm1-coverage.md": 90, "haas-coverage.md": 80}
"""How many rows each has at least."""
HEAD = ["subject", "client", "simulator", "tests"]


def text_of(page: str) -> str:
    return (ROOT / "docs" / page).read_text()


def rows(page: str) -> Iterator[tuple[int, list[str]]]:
    """Give line number and cells of every row of the page's tables."""
    for number, line in enumerate(text_of(page).splitlines(), start=1):
        if line.startswith("|"):
            cells = [cell.strip() for cell in line.strip("|").split("|")]
            if cells != HEAD and set(line) - set("|-"):
                yield number, cells


def named_tests() -> list[str]:
    tests = (cells[3] for page in PAGES for _, cells in rows(page))
    return sorted({name for cell in tests for name in re.findall(r"`([^`]+\.py(?:::\w+)?)`", cell)})


@cache
def functions_of(file: Path) -> frozenset[str]:
    tree = ast.parse(file.read_text())
    return frozenset(each.name for each in tree.body if isinstance(each, ast.FunctionDef | ast.AsyncFunctionDef))


@pytest.mark.parametrize("page", PAGES)
def test_every_row_has_its_four_cells(page: str) -> None:
    assert not [number for number, cells in rows(page) if len(cells) != len(HEAD)]
    assert sum(1 for _ in rows(page)) > PAGES[page]


@pytest.mark.parametrize("name", named_tests())
def test_every_test_that_the_page_names_exists(name: str) -> None:
    file, _, function = name.partition("::")
    assert (ROOT / "tests" / file).is_file()
    assert not function or function in functions_of(ROOT / "tests" / file)


@pytest.mark.parametrize("page", PAGES)
def test_a_cell_of_tests_holds_nothing_but_tests(page: str) -> None:
    cell = re.compile(r"(`[a-z0-9_/]+\.py(::test_\w+)?`(, )?)*")
    assert not [(number, cells[3]) for number, cells in rows(page) if not cell.fullmatch(cells[3])]


@pytest.mark.parametrize("page", PAGES)
def test_a_row_without_a_test_says_why_nothing_is_done(page: str) -> None:
    """Or that it is told elsewhere on the page, or in the instructions for people."""
    reasons = re.compile(r"not done|above|\[\]\(")
    assert not [
        (number, cells) for number, cells in rows(page) if not cells[3] and not reasons.search(cells[1] + cells[2])
    ]


@pytest.mark.parametrize("page", PAGES)
def test_what_is_not_done_has_a_reason(page: str) -> None:
    bare = [
        (number, cell)
        for number, (_, *cells) in rows(page)
        for cell in cells
        if cell.startswith("not done") and cell != "not done" and ": " not in cell
    ]
    alone = [
        number
        for number, cells in rows(page)
        if "not done" in cells and not any("not done: " in each for each in cells)
    ]
    assert not bare
    assert not alone


@pytest.mark.parametrize("page", PAGES)
def test_nothing_is_left_to_be_filled_in(page: str) -> None:
    assert "TODO" not in text_of(page)


def test_every_known_command_of_smc_steppers_has_a_row() -> None:
    subjects = " ".join(cells[0] for _, cells in rows("smc-coverage.md"))
    named = {code[0] for code in re.findall(r"`([^`]+)`", subjects)}
    assert set(COMMANDS) <= named


def test_every_known_instruction_of_cutters_has_a_row() -> None:
    subjects = " ".join(cells[0] for _, cells in rows("camm1-coverage.md"))
    named = set(re.findall(r"`([^`]+)`", subjects))
    assert {*MODE_1, *MODE_2, *COMMON, *(f".{letter}" for letter in CONTROL_INSTRUCTIONS)} <= named


def test_every_known_question_to_a_control_has_a_row() -> None:
    subjects = " ".join(cells[0] for _, cells in rows("haas-coverage.md"))
    named = set(re.findall(r"`([^`]+)`", subjects))
    assert QUERIES.keys() <= named
