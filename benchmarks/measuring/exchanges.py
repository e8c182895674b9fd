"""One round of exchanges, back to back: how much CPU and how much time on the wall each took."""

from __future__ import annotations

import time
from collections.abc import Awaitable, Callable
from typing import Final

from .rounds import Measured

__all__ = ["CPU_US", "WALL_US", "a_round", "a_round_async"]

CPU_US: Final = "CPU µs"
WALL_US: Final = "wall µs"

_AT_ONCE: Final = 25
"""Between two looks at the clock, which cost something, too."""

_MICRO: Final = 1e6


def _per_exchange(count: int, wall: float, cpu: float) -> Measured:
    return {
        CPU_US: _MICRO * (time.process_time() - cpu) / count,
        WALL_US: _MICRO * (time.perf_counter() - wall) / count,
    }


async def a_round_async(ask: Callable[[], Awaitable[object]], round_s: float) -> Measured:
    """Ask again and again for *round_s* seconds."""
    count, wall, cpu = 0, time.perf_counter(), time.process_time()
    until = wall + round_s
    while time.perf_counter() < until:
        for _ in range(_AT_ONCE):
            await ask()
        count += _AT_ONCE
    return _per_exchange(count, wall, cpu)


def a_round(ask: Callable[[], object], round_s: float) -> Measured:
    """Ask again and again for *round_s* seconds, with calls that block."""
    count, wall, cpu = 0, time.perf_counter(), time.process_time()
    until = wall + round_s
    while time.perf_counter() < until:
        for _ in range(_AT_ONCE):
            ask()
        count += _AT_ONCE
    return _per_exchange(count, wall, cpu)
