"""
How long ``import compax_aio`` takes, over what asyncio takes itself, and what it pulls in.

What is put off until it is used has to be paid then: so the same is measured with the names that a program needs to
connect, and of a whole program, from its start to its first position, beside one that asks through asyncio's streams.
Each is a fresh process, all in turn; costs are CPU times of the whole process. Modules are told by ``-X importtime``,
which takes time itself.
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

from ..far_ends.canned import HOST
from ..measuring import Effort, Figure, Measured, Results, Row, Target, at_most, far_end, interleaved
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

_NOTHING: Final = "pass"
_ASYNCIO: Final = "import asyncio"
_IMPORT: Final = "import asyncio, compax_aio"
_NAMES: Final = "import asyncio; from compax_aio import Drive, DriveGroup, Move, connect"
_STREAMS: Final = """
import asyncio
async def main():
    reader, writer = await asyncio.open_connection({host!r}, {port})
    writer.write(b"S1\\r")
    assert await reader.readuntil(b">")
    writer.close()
asyncio.run(main())
"""
_POSITION: Final = """
import asyncio, compax_aio
async def main():
    async with compax_aio.connect("tcp://{host}:{port}") as drive:
        assert await drive.position()
asyncio.run(main())
"""
_LISTED: Final = """
import json, sys
print(json.dumps(sorted(sys.modules)))
"""
_SHORT: Final = {
    _NOTHING: "python -c pass",
    _ASYNCIO: _ASYNCIO,
    _IMPORT: "import compax_aio",
    _NAMES: "from compax_aio import connect, Drive, DriveGroup, Move",
    _STREAMS: "a program's first position, asyncio streams",
    _POSITION: "a program's first position, compax_aio",
}
"""Programs as they are told."""

_LINE: Final = re.compile(r"import time:\s*(\d+) \|\s*\d+ \|\s*(\S+)")
_CPU_MS: Final = "CPU ms"
_WALL_MS: Final = "wall ms"
_TOP: Final = 8
_TARGET: Final = at_most(60)


Environment = Mapping[str, str]


@contextmanager
def _compiled() -> Iterator[Environment]:
    """Give an environment in which modules are compiled once, into a folder that goes away again."""
    with TemporaryDirectory(prefix="compiled-") as folder:
        environment = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
        yield {**environment, "PYTHONPYCACHEPREFIX": folder}


def _in_fresh_process(program: str, environment: Environment) -> Measured:
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


def _modules(environment: Environment, program: str) -> set[str]:
    """Say what is imported when *program* has run."""
    modules: list[str] = json.loads(_run(environment, "-c", program + _LISTED).stdout)
    return set(modules)


def _pulled_in(environment: Environment, program: str, imported: set[str]) -> tuple[Sequence[Row], Sequence[Row]]:
    """Tell what *imported* takes when *program* runs, by package, and which modules take longest."""
    own = own_times(_run(environment, "-X", "importtime", "-c", program).stderr)
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
    name = f"instructions of {_SHORT[_NAMES]} over asyncio's own"
    if effort.name == "least" or not is_installed():
        why = "valgrind is not installed" if not is_installed() else "not with the least effort"
        return Figure(name=name, value=None, notes=[why])
    counted = {each: count_whole(["-c", each], environment).instructions / 1e6 for each in (_ASYNCIO, _NAMES)}
    return Figure(
        name=name,
        value=counted[_NAMES] - counted[_ASYNCIO],
        unit="million",
        ratio_of="asyncio's",
        rows=[
            Row(name=_SHORT[each], value=count, unit="million", ratio=count / counted[_ASYNCIO])
            for each, count in counted.items()
        ],
    )


def _over(
    results: Results, program: str, base: str, *, target: Target | None = None, rows: Sequence[Row] = (), note: str = ""
) -> Figure:
    mine, others = (results.values[each][_CPU_MS] for each in (program, base))
    over = [one - other for one, other in zip(mine, others, strict=True)]
    steps = [
        Row(
            name=_SHORT[each],
            value=results.median(each, _CPU_MS),
            unit=_CPU_MS,
            spread=results.spread(each, _CPU_MS),
            note=f"{results.median(each, _WALL_MS):.0f} ms on the wall",
        )
        for each in (base, program)
    ]
    return Figure(
        name=f"{_SHORT[program]}, over {_SHORT[base]}",
        value=median(over),
        unit="ms",
        target=target,
        rows=[*steps, *rows],
        notes=[note] if note else [],
    )


def measure(effort: Effort) -> Sequence[Figure]:
    """Measure imports and first positions in fresh processes."""
    with _compiled() as environment, far_end("benchmarks.far_ends.canned", "0") as far:
        streams, position = (each.format(host=HOST, port=far.where["tcp"]) for each in (_STREAMS, _POSITION))
        programs = {_NOTHING: _NOTHING, _ASYNCIO: _ASYNCIO, _IMPORT: _IMPORT, _NAMES: _NAMES}
        programs |= {_STREAMS: streams, _POSITION: position}
        results = interleaved(
            effort, {name: partial(_in_fresh_process, program, environment) for name, program in programs.items()}
        )
        before = _modules(environment, _ASYNCIO)
        packages, longest = _pulled_in(environment, _NAMES, _modules(environment, _NAMES) - before)
        used = _modules(environment, position) - before
        instructions = _instructions(effort, environment)
    heavy = heavy_in(used)
    compiled = "of the CPU, in processes of their own, with compiled modules at hand"
    return [
        _over(results, _IMPORT, _ASYNCIO, target=_TARGET, note=compiled),
        _over(results, _NAMES, _ASYNCIO, target=_TARGET, rows=[*packages, *longest]),
        _over(results, _POSITION, _STREAMS),
        instructions,
        Figure(
            name="heavy modules when a first position was read",
            value=len(heavy),
            target=at_most(0, "none"),
            notes=[", ".join(heavy) if heavy else f"{len(used)} modules beside asyncio's, none heavy"],
        ),
    ]
