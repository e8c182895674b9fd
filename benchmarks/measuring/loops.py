"""The event loops that are measured: asyncio's own, and uvloop where it is installed."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Final

from .machine import version

__all__ = ["LOOPS", "fastest_loop"]


def _uvloop() -> asyncio.AbstractEventLoop:
    loop = import_module("uvloop").new_event_loop()
    assert isinstance(loop, asyncio.AbstractEventLoop)
    return loop


LOOPS: Final[Mapping[str, Callable[[], asyncio.AbstractEventLoop]]] = {
    "asyncio": asyncio.new_event_loop,
    **({"uvloop": _uvloop} if version("uvloop") else {}),
}
"""By name, for ``asyncio.Runner(loop_factory=…)``."""


def fastest_loop() -> Callable[[], asyncio.AbstractEventLoop]:
    """Return uvloop where it is installed: what a far end runs on."""
    return LOOPS.get("uvloop", LOOPS["asyncio"])
