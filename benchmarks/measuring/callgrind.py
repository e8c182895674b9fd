"""Instructions and allocations of a fixed run, counted by valgrind's callgrind: the same on a busy machine."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

__all__ = ["Counted", "count_runs", "count_whole", "is_installed", "read_part"]

_MARK: Final = "getppid"
_OUT: Final = "counted"
_TIME_LIMIT_S: Final = 600.0
_ALLOCATORS: Final = frozenset(
    {"_PyObject_Malloc", "_PyObject_Calloc", "_PyMem_RawMalloc", "_PyMem_RawCalloc", "_PyMem_MiRawMalloc"}
)
"""CPython's own, through which all objects and buffers go that are not taken from a free list."""

_CALLED: Final = re.compile(r"cfn=\((\d+)\)(?: (.*))?")
_NAMED: Final = re.compile(r"fn=\((\d+)\)(?: (.*))?")
_CALLS: Final = re.compile(r"calls=(\d+)")
_TOTAL: Final = re.compile(r"(?:totals|summary): (\d+)")


@dataclass(frozen=True, slots=True)
class Counted:
    """
    What one part of a run took.

    Attributes:
        instructions: Of this process, without the kernel.
        allocations: None if this Python tells no names of its functions.
    """

    instructions: int
    allocations: int | None


def is_installed() -> bool:
    """Whether there is anything to count with."""
    return shutil.which("valgrind") is not None


def read_part(text: str) -> Counted:
    """Read one file that callgrind has written."""
    names: dict[str, str] = {}
    instructions = allocations = 0
    called = ""
    for line in text.splitlines():
        if found := _CALLED.match(line) or _NAMED.match(line):
            names.setdefault(found[1], found[2] or "")
            called = names[found[1]].partition("'")[0]
        elif found := _CALLS.match(line):
            allocations += int(found[1]) if called in _ALLOCATORS else 0
        elif found := _TOTAL.match(line):
            instructions = int(found[1])
    return Counted(instructions, allocations if _ALLOCATORS.intersection(names.values()) else None)


def _parts(folder: Path) -> Iterator[Counted]:
    """Read what lies between the marks: the second part and those that follow it, but for the one after the last."""
    numbered = {int(path.suffix[1:]): path for path in folder.glob(f"{_OUT}.*") if path.suffix[1:].isdigit()}
    for number in sorted(numbered)[1:]:
        yield read_part(numbered[number].read_text(errors="replace"))


def _valgrind(
    folder: Path, options: Sequence[str], arguments: Sequence[str], environment: Mapping[str, str] = os.environ
) -> None:
    out = f"--callgrind-out-file={folder / _OUT}"
    command = ["valgrind", "--tool=callgrind", out, *options, sys.executable, *arguments]
    # Where hashes differ from run to run, so do the ways through dictionaries.
    environment = {**environment, "PYTHONHASHSEED": "0"}
    try:
        subprocess.run(command, env=environment, check=True, capture_output=True, timeout=_TIME_LIMIT_S)
    except (subprocess.CalledProcessError, subprocess.TimeoutExpired) as error:
        said = (error.stderr or b"").decode(errors="replace")[-2000:]
        raise RuntimeError(f"counting python {' '.join(arguments)} failed: {error}\n{said}") from error


def count_runs(module: str, arguments: Sequence[str]) -> list[Counted]:
    """
    Run ``python -m module arguments…`` and return what lay between each two marks of it.

    Raises:
        RuntimeError: The run failed, or has not come to an end within ten minutes.
    """
    with TemporaryDirectory(prefix="counted-") as name:
        _valgrind(Path(name), [f"--dump-before={_MARK}"], ["-m", module, *arguments])
        return list(_parts(Path(name)))


def count_whole(arguments: Sequence[str], environment: Mapping[str, str] = os.environ) -> Counted:
    """Run ``python arguments…`` and return what all of it took; raises as :func:`count_runs` does."""
    with TemporaryDirectory(prefix="counted-") as name:
        _valgrind(Path(name), [], arguments, environment)
        return read_part((Path(name) / _OUT).read_text(errors="replace"))
