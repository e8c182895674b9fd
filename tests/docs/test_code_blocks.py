"""
Every Python block of README and documents runs, and what stands under it as its output is what it prints.

The blocks of a page are one program: they share names and an event loop on a virtual clock, and may await. A fence
marked ``output`` right after a block holds all that the block prints, from the beginning of a line to its end; ``...``
stands for anything on one line. A fence marked ``console`` is a session: its ``$ compax`` lines are carried out one
after the other, and print what stands under them, a line ``...`` standing for any number of lines; its ``$ printf``
lines make files, by the shell. In ``sh`` fences,
commands of ``compax`` are ones that it understands.
"""

from __future__ import annotations

import ast
import asyncio
import inspect
import itertools
import re
import shlex
import subprocess
import textwrap
from collections.abc import Callable, Coroutine, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from cyclopts import CycloptsError

from compax_aio.cli.app import app
from compax_aio.cli.app import run as run_command
from compax_aio.simulator.clock import VirtualClockLoop

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("**/*.md"))]
LANGUAGES = {"python", "output", "text", "toml", "sh", "console", "ini", "{eval-rst}", "{toctree}"}

_FENCE = re.compile(r"^(?P<indent> *)```(?P<language>\S*)[^\n]*\n(?P<text>.*?)^ *```\s*$", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Block:
    line: int
    source: str
    output: str | None


def fences_of(page: Path) -> Iterator[tuple[str, str, int, str]]:
    """Give language, text, line number, and what stood between this fence and the one before."""
    text, end = page.read_text(), 0
    for fence in _FENCE.finditer(text):
        line = text.count("\n", 0, fence.start("text")) + 1
        yield fence["language"], textwrap.dedent(fence["text"]), line, text[end : fence.start()]
        end = fence.end()


def blocks_of(page: Path) -> list[Block]:
    blocks: list[Block] = []
    before = ""
    for language, text, line, between in fences_of(page):
        if language == "python":
            blocks.append(Block(line, text, None))
        elif language == "output":
            assert before == "python", f"{page.name}:{line}: an output without its block"
            assert not between.strip(), f"{page.name}:{line}: an output away from its block"
            blocks[-1] = Block(blocks[-1].line, blocks[-1].source, text)
        before = language
    return blocks


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


def run_block(block: Block, page: Path, names: dict[str, Any], run: Callable[[Coroutine[Any, Any, Any]], Any]) -> None:
    # Blank lines in front make the line numbers of a traceback those of the page.
    tree = ast.parse("\n" * (block.line - 1) + block.source, str(page))
    code = compile(tree, str(page), "exec", flags=ast.PyCF_ALLOW_TOP_LEVEL_AWAIT, dont_inherit=True)
    if "asyncio.run(" in block.source:
        exec(code, names)
        return

    async def inside_the_loop() -> None:
        result = eval(code, names)
        if inspect.isawaitable(result):
            await result

    run(inside_the_loop())


def matches(pattern: str, printed: str) -> bool:
    regex = "".join(r"[^\n]*" if part == "..." else re.escape(part) for part in re.split(r"(\.\.\.)", pattern))
    return re.fullmatch(regex, printed) is not None


@pytest.mark.parametrize("page", [page for page in PAGES if blocks_of(page)], ids=name_of)
def test_the_code_of_a_page_runs_and_prints_what_the_page_says(
    page: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"__name__": "__main__"}
    with asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
        monkeypatch.setattr(asyncio, "run", runner.run)
        for block in blocks_of(page):
            run_block(block, page, names, runner.run)
            printed = capsys.readouterr().out
            if block.output is not None and not matches(block.output, printed):
                assert printed == block.output, f"{name_of(page)}:{block.line}: it prints something else"


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_block_says_what_it_is(page: Path) -> None:
    unknown = [(line, language) for language, _, line, _ in fences_of(page) if not _is_known(language)]
    assert not unknown


def _is_known(language: str) -> bool:
    return language in LANGUAGES or language.startswith("{table-of-") or language.endswith("state-diagram}")


# Sessions at the terminal


def commands_in(text: str, prompt: str) -> Iterator[list[str]]:
    """Give the words of each command of ``compax``, as far as the next sign that means something to a shell."""
    for line in text.replace("\\\n", " ").splitlines():
        if not line.startswith(f"{prompt}compax "):
            continue
        lexer = shlex.shlex(line.removeprefix(prompt), posix=True, punctuation_chars="|<>&;()")
        lexer.whitespace_split = True
        lexer.commenters = "#"
        words = list(itertools.takewhile(lambda word: not set(word) <= set("|<>&;()"), lexer))
        yield words[1:]


def understood(words: list[str]) -> str:
    """Say what ``compax`` does not understand of *words*; nothing if it does."""
    try:
        app.parse_args(words, exit_on_error=False, print_error=False, help_on_error=False)
    except CycloptsError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_command_of_a_page_is_one_that_compax_understands(page: Path, tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.chdir(tmp_path)
    wrong = [
        f"{name_of(page)}:{line}: compax {shlex.join(words)}: {problem}"
        for language, text, line, _ in fences_of(page)
        if language in {"sh", "console"}
        for words in commands_in(text, "$ " if language == "console" else "")
        if not {"--help", "--version"} & set(words) and (problem := understood(words))
    ]
    assert not wrong, "\n".join(wrong)


def sessions_of(page: Path) -> Iterator[tuple[int, str, str]]:
    """Give line number, command and what it prints, of every command in a session."""
    for language, text, line, _ in fences_of(page):
        if language == "console":
            for number, part in enumerate(re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]):
                command, _, printed = part.partition("\n")
                while command.endswith("\\"):
                    rest, _, printed = printed.partition("\n")
                    command = command[:-1] + rest
                yield line + number, command, printed


@pytest.mark.parametrize("page", [page for page in PAGES if any(sessions_of(page))], ids=name_of)
def test_a_session_of_a_page_prints_what_the_page_says(
    page: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    with asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
        monkeypatch.setattr(asyncio, "run", runner.run)
        for line, command, expected in sessions_of(page):
            if command.startswith("printf "):
                subprocess.run(command, shell=True, check=True)
            for words in commands_in(f"$ {command}", "$ "):
                run_command(words)
                told = capfd.readouterr()
                printed = "\n".join(each.rstrip() for each in (told.err + told.out).splitlines())
                if not matches_session(expected, printed):
                    assert printed == expected, f"{name_of(page)}:{line}: it prints something else"


def matches_session(expected: str, printed: str) -> bool:
    pattern = "".join(
        r"(?:[^\n]*\n)*?"
        if line.strip() == "..."
        else "[^\n]*".join(map(re.escape, line.rstrip().split("..."))) + r"\n"
        for line in expected.strip("\n").splitlines()
    )
    return re.fullmatch(pattern, printed.strip("\n") + "\n") is not None


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_relative_links_lead_somewhere(page: Path) -> None:
    links = re.findall(r"\]\((?!https?:|#|mailto:)([^)#\s]+)", page.read_text())
    missing = [link for link in links if not (page.parent / link).exists()]
    assert not missing
