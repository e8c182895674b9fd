"""All tests on every CPython from 3.11 up that this machine has; `make matrix` runs it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
OLDEST = (3, 11)

_ASK = (
    "import sys, sysconfig; print(sys.implementation.name, *sys.version_info[:3], "
    "sysconfig.get_config_var('Py_GIL_DISABLED') or 0)"
)

Version = tuple[int, int, int]


def candidates() -> Iterator[Path]:
    """Name everything that may be a Python: ``python3.N`` on the PATH, and the versions of pyenv."""
    for minor in range(OLDEST[1], 30):
        if found := shutil.which(f"python3.{minor}"):
            yield Path(found)
    pyenv = Path(os.environ.get("PYENV_ROOT") or Path.home() / ".pyenv")
    yield from sorted(pyenv.glob("versions/*/bin/python3"))
    yield Path(sys.executable)


def version_of(python: Path) -> Version | None:
    """Return the version of a CPython that starts and is new enough; a shim of pyenv need not lead anywhere."""
    try:
        told = subprocess.run(
            [python, "-c", _ASK], capture_output=True, text=True, timeout=30, check=True, stdin=subprocess.DEVNULL
        ).stdout.split()
    except (OSError, subprocess.SubprocessError):
        return None
    if len(told) != 5 or told[0] != "cpython" or told[4] != "0":
        return None
    major, minor, micro = map(int, told[1:4])
    return (major, minor, micro) if (major, minor) >= OLDEST else None


def interpreters() -> Mapping[str, tuple[Version, Path]]:
    """Find one Python for each minor version: the newest."""
    found: dict[str, tuple[Version, Path]] = {}
    for python in candidates():
        version = version_of(python)
        if version is None:
            continue
        minor = f"{version[0]}.{version[1]}"
        if minor not in found or version > found[minor][0]:
            found[minor] = version, python
    return dict(sorted(found.items(), key=lambda item: item[1][0]))


def test_with(python: Path, environment: Path) -> str:
    """Run the tests in an environment of their own; return ``passed``, or what failed."""
    own = environment / "bin" / "python"
    pip: list[str | Path] = [own, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    steps: tuple[tuple[str, list[str | Path]], ...] = (
        ("venv", [python, "-m", "venv", "--clear", environment]),
        ("pip", [*pip, "--upgrade", "pip>=25.1"]),
        ("install", [*pip, "-e", ".[cli]"]),
        ("install", [*pip, "--group", "test"]),
        ("tests", [own, "-m", "pytest", "-q", "-x"]),
    )
    for step, command in steps:
        if subprocess.run(command, cwd=ROOT, stdin=subprocess.DEVNULL, check=False).returncode:
            return f"{step} failed"
    return "passed"


def say(text: str) -> None:
    """Print *text* now, in order with what the programs called print."""
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def main() -> int:
    """Test with each Python, print a table, and return the exit status."""
    found = interpreters()
    if not found:
        say(f"no CPython {OLDEST[0]}.{OLDEST[1]} or newer was found")
        return 1
    results: dict[str, str] = {}
    for minor, (version, python) in found.items():
        name = ".".join(map(str, version))
        say(f"== CPython {name} ({len(results) + 1} of {len(found)})")
        results[name] = test_with(python, ROOT / f".venv-{minor}")
    say("\nCPython   result\n--------  ------")
    for name, result in results.items():
        say(f"{name:<8}  {result}")
    return any(result != "passed" for result in results.values())


if __name__ == "__main__":
    sys.exit(main())
