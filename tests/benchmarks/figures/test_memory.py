"""What a process has grown by is divided by the drives that were added, and told by where it was asked for."""

from __future__ import annotations

import pytest
from benchmarks.figures.memory import _file_told, _growth, _growth_when_busy, _where

KIB = 1024

HELD = {
    "100": {"resident": 1000 * KIB, "lines": {"compax_aio/a.py:1": 100 * KIB, "asyncio/b.py:2": 50 * KIB}},
    "1000": {
        "resident": 10_000 * KIB,
        "lines": {"compax_aio/a.py:1": 1000 * KIB, "compax_aio/a.py:9": 1800 * KIB, "asyncio/b.py:2": 950 * KIB},
    },
    "busy": {"resident": 10_600 * KIB, "of": 200},
}


def test_growth_is_of_one_drive() -> None:
    assert _growth(HELD, (100, 1000), "resident") == pytest.approx(10.0)
    assert _growth_when_busy(HELD, 1000) == pytest.approx(3.0)


def test_it_is_told_where_it_goes() -> None:
    rows = {row.name: row.value for row in _where(HELD, (100, 1000))}
    assert rows == pytest.approx(
        {
            "of it by file: compax_aio/a.py": 3.0,
            "of it by file: asyncio/b.py": 1.0,
            "of it by line: compax_aio/a.py:9": 2.0,
            "of it by line: compax_aio/a.py:1": 1.0,
            "of it by line: asyncio/b.py:2": 1.0,
        }
    )


@pytest.mark.parametrize(
    ("filename", "told"),
    [
        ("/somewhere/src/compax_aio/link/turns.py", "compax_aio/link/turns.py"),
        ("/usr/lib/python3.11/asyncio/tasks.py", "asyncio/tasks.py"),
        ("/usr/lib/python3.11/weakref.py", "weakref.py"),
        ("<frozen importlib._bootstrap>", "<frozen importlib._bootstrap>"),
    ],
)
def test_a_file_is_named_from_its_package_on(filename: str, told: str) -> None:
    assert _file_told(filename) == told
