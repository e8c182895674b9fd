"""
How long ``import compax_aio`` takes, over what asyncio takes itself, and what it pulls in.

Each import is made in a fresh process, in turn with a process that imports asyncio and one that imports nothing. Costs
are the CPU time of the whole process; modules are told by ``-X importtime``, which takes time itself.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from statistics import median
from tempfile import TemporaryDirectory
from typing import Final

from ..measuring import Effort, Figure, Measured, Row, at_most, interleaved, spread_of
from ..measuring.callgrind import count_whole, is_installed

__all__ = ["HEAVY", "heavy_in", "measure", "own_times"]

HEAVY: Final = (
    "compax_aio.camm1",
    "compax_aio.cli",
    "compax_aio.haas",
    "compax_aio.simulator",
    "compax_aio.smc",
    "compax_aio.testing",
    "cyclopts",
    "hypothesis",
    "matplotlib",
    "multiprocessing",
    "numpy",
    "prompt_toolkit",
    "pyarrow",
    "pydantic",
    "pytest",
    "rich",
    "serialx",
    "textual",
    "tkinter",
    "unittest",
    "xml",
)
"""What nobody who moves a drive needs: other devices, the command line, the far end, and what plots, draws or tests."""

_PROGRAMS: Final = {"nothing": "pass", "asyncio": "import asyncio", "compax_aio": "import asyncio, compax_aio"}
_LIST: Final = """
import asyncio, json, sys
before = set(sys.modules)
import compax_aio
print(json.dumps(sorted(set(sys.modules) - before)))
"""
_LINE: Final = re.compile(r"import time:\s*(\d+) \|\s*\d+ \|\s*(\S+)")
_CPU_MS: Final = "CPU ms"
_WALL_MS: Final = "wall ms"
_TOP: Final = 8


Environment = Mapping[str, str]


@contextmanager
def _compiled() -> Iterator[Environment]:
    """Give an environment in which modules are compiled once, into a folder that goes away again."""
    with TemporaryDirectory(prefix="compiled-") as folder:
        environment = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
        yield {**environment, "PYTHONPYCACHEPREFIX": folder}


def _import_in_fresh_process(program: str, environment: Environment) -> Measured:
    wall = time.perf_counter()
    process = subprocess.Popen([sys.executable, "-c", program], env=environment)
    _, status, usage = os.wait4(process.pid, 0)
    took_s = time.perf_counter() - wall
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"python -c {program!r} failed with {process.returncode}")
    return {_CPU_MS: 1000 * (usage.ru_utime + usage.ru_stime), _WALL_MS: 1000 * took_s}


def own_times(told: str) -> dict[str, float]:
    """Read what ``-X importtime`` has told: milliseconds of each module without those that it imports."""
    return {found[2]: int(found[1]) / 1000 for line in told.splitlines() if (found := _LINE.match(line))}


def heavy_in(modules: Iterable[str]) -> list[str]:
    """Pick those of :data:`HEAVY` that are among *modules*, or have one among them."""
    loaded = set(modules)
    return [heavy for heavy in HEAVY if any(each == heavy or each.startswith(f"{heavy}.") for each in loaded)]


def _package_of(module: str) -> str:
    top = module.partition(".")[0]
    return "standard library" if top in sys.stdlib_module_names else top


def _run(environment: Environment, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, *arguments], env=environment, check=True, capture_output=True, text=True)


def _imported(environment: Environment) -> list[str]:
    listed = _run(environment, "-c", _LIST)
    modules: list[str] = json.loads(listed.stdout)
    return modules


def _pulled_in(imported: Sequence[str], environment: Environment) -> tuple[Sequence[Row], Sequence[Row]]:
    """Tell what compax_aio pulls in beside asyncio, by package; and those of its modules that take longest."""
    own = own_times(_run(environment, "-X", "importtime", "-c", _PROGRAMS["compax_aio"]).stderr)
    added = {module: own[module] for module in imported if module in own}
    modules = Counter(map(_package_of, added))
    times = {each: sum(ms for module, ms in added.items() if _package_of(module) == each) for each in modules}
    packages = [
        Row(name=f"of it {package}", value=ms, unit="ms, as -X importtime tells", note=f"{modules[package]} modules")
        for package, ms in sorted(times.items(), key=lambda each: -each[1])
    ]
    longest = sorted(added.items(), key=lambda each: -each[1])[:_TOP]
    return packages, [Row(name=module, value=ms, unit="ms of its own") for module, ms in longest]


def _instructions(effort: Effort, environment: Environment) -> Figure:
    name = "instructions of import compax_aio over asyncio's own"
    if effort.name == "least" or not is_installed():
        why = "valgrind is not installed" if not is_installed() else "not with the least effort"
        return Figure(name=name, value=None, notes=[why])
    counted = {
        each: count_whole(["-c", _PROGRAMS[each]], environment).instructions for each in ("asyncio", "compax_aio")
    }
    return Figure(
        name=name,
        value=(counted["compax_aio"] - counted["asyncio"]) / 1e6,
        unit="million",
        ratio_of="asyncio's",
        rows=[
            Row(name=each, value=count / 1e6, unit="million", ratio=count / counted["asyncio"])
            for each, count in counted.items()
        ],
    )


def measure(effort: Effort) -> Sequence[Figure]:
    """Measure imports in fresh processes."""
    with _compiled() as environment:
        results = interleaved(
            effort,
            {name: partial(_import_in_fresh_process, program, environment) for name, program in _PROGRAMS.items()},
        )
        modules = _imported(environment)
        packages, longest = _pulled_in(modules, environment)
        instructions = _instructions(effort, environment)
    mine, base = (results.values[each][_CPU_MS] for each in ("compax_aio", "asyncio"))
    over = [one - other for one, other in zip(mine, base, strict=True)]
    heavy = heavy_in(modules)
    steps = [
        Row(
            name=_PROGRAMS[each],
            value=results.median(each, _CPU_MS),
            unit=_CPU_MS,
            spread=results.spread(each, _CPU_MS),
            note=f"{results.median(each, _WALL_MS):.0f} ms on the wall",
        )
        for each in _PROGRAMS
    ]
    return [
        Figure(
            name="import compax_aio over asyncio's own",
            value=median(over),
            unit="ms",
            target=at_most(60),
            spread=spread_of(over),
            rows=[*steps, *packages, *longest],
            notes=["of the CPU, in processes of their own, with compiled modules at hand"],
        ),
        instructions,
        Figure(
            name="heavy modules that import compax_aio pulls in",
            value=len(heavy),
            target=at_most(0, "none"),
            notes=[", ".join(heavy) if heavy else f"{len(modules)} modules beside asyncio's, none heavy"],
        ),
    ]
