"""What is measured on: processor, kernel, Python; and how steady it was, by a fixed piece of work timed in between."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from importlib import metadata
from pathlib import Path
from statistics import median
from typing import Final, Self

from .spread import spread_of

__all__ = ["Machine", "Noise", "version"]

_CPUINFO: Final = Path("/proc/cpuinfo")
_PIECE: Final = 200_000
_QUIET_LOAD: Final = 1.25
"""Of each core: who measures and his far end share two."""


def version(package: str) -> str | None:
    """Say which version of *package* is installed; None if none is."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _processor() -> str:
    if _CPUINFO.exists():
        for line in _CPUINFO.read_text(errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _usable_cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Machine:
    """
    What somebody who repeats a measurement wants to know of where it was made.

    Attributes:
        cores: Those that this process may use.
        load: How many processes wanted to run in the last minute, on average; negative where that is not told.
        uvloop: Its version; None where it is not installed.
    """

    processor: str
    cores: int
    system: str
    python: str
    uvloop: str | None
    load: float

    @classmethod
    def here(cls) -> Self:
        """Look around."""
        return cls(
            processor=_processor(),
            cores=_usable_cores(),
            system=f"{platform.system()} {platform.release()}",
            python=f"{platform.python_implementation()} {platform.python_version()}",
            uvloop=version("uvloop"),
            load=os.getloadavg()[0] if hasattr(os, "getloadavg") else -1.0,
        )

    def told(self) -> str:
        """Say it in a line."""
        uvloop = f"uvloop {self.uvloop}" if self.uvloop else "no uvloop"
        cores = f"{self.cores} core{'' if self.cores == 1 else 's'}"
        return f"{self.processor}, {cores}, {self.system}, {self.python}, {uvloop}, load {self.load:.1f}"

    def as_dict(self) -> Mapping[str, object]:
        """Say it in JSON."""
        return asdict(self)


def _fixed_work() -> int:
    total = 0
    for number in range(_PIECE):
        total += number & 3
    return total


@dataclass(slots=True)
class Noise:
    """
    How long the same piece of work took, again and again.

    Attributes:
        cpu_s: Its own time, of the CPU.
        wall_s: Its time on the wall.
        load: How many processes wanted to run in the minute before, on average, where that is told.
        cores: How many could.
    """

    cpu_s: list[float] = field(default_factory=list)
    wall_s: list[float] = field(default_factory=list)
    load: list[float] = field(default_factory=list)
    cores: int = field(default_factory=_usable_cores)

    def sample(self) -> None:
        """Do the work once more; takes some milliseconds."""
        if hasattr(os, "getloadavg"):
            self.load.append(os.getloadavg()[0])
        wall, cpu = time.perf_counter(), time.thread_time()
        _fixed_work()
        self.cpu_s.append(time.thread_time() - cpu)
        self.wall_s.append(time.perf_counter() - wall)

    @property
    def cpu_spread(self) -> float:
        """Half of what lies between the quartiles, as a share of the median: how much a CPU second was worth."""
        return spread_of(self.cpu_s)

    @property
    def waiting_share(self) -> float:
        """The mean share of the time on the wall in which something else had the core."""
        return max(0.0, 1 - sum(self.cpu_s) / sum(self.wall_s)) if self.wall_s else 0.0

    @property
    def is_quiet(self) -> bool:
        """Whether times on the wall can be believed, not only ratios of CPU times."""
        steady = bool(self.cpu_s) and self.cpu_spread <= 0.03 and self.waiting_share <= 0.03
        return steady and self.most_load <= _QUIET_LOAD * self.cores

    @property
    def most_load(self) -> float:
        """The highest load that was seen; what is measured makes one or two of it itself."""
        return max(self.load, default=0.0)

    def told(self) -> str:
        """Say it in a line."""
        if not self.cpu_s:
            return "noise not measured"
        return (
            f"noise: the same work, {len(self.cpu_s)} times: {1000 * median(self.cpu_s):.2f} ms of CPU "
            f"± {self.cpu_spread:.1%} (slowest {max(self.cpu_s) / median(self.cpu_s):.2f} times that), "
            f"{self.waiting_share:.1%} of the time something else had the core, load up to {self.most_load:.1f}: "
            + ("quiet" if self.is_quiet else "NOISY, believe ratios and counts only")
        )

    def as_dict(self) -> Mapping[str, object]:
        """Say it in JSON."""
        return {
            "samples": len(self.cpu_s),
            "cpu_s_median": median(self.cpu_s) if self.cpu_s else None,
            "cpu_spread": self.cpu_spread,
            "waiting_share": self.waiting_share,
            "most_load": self.most_load,
            "is_quiet": self.is_quiet,
        }
