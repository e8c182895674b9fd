"""What can befall any line and the event loop, whatever is at its far end; and how such things are drawn."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from random import Random
from typing import Any, Protocol

from compax_aio.simulator.cable import Tamper
from compax_aio.simulator.clock import VirtualClockLoop

from .scenario import Trouble
from .troubled_line import TroubledLine

__all__ = [
    "Arguments",
    "cut",
    "half_open",
    "hold",
    "nothing",
    "one_of",
    "other_host",
    "slow_line",
    "stall",
    "tamper",
]

Arguments = dict[str, Any]


class _Far(Protocol):
    @property
    def line(self) -> TroubledLine:
        """What it is done to."""


async def tamper(far: _Far, trouble: Trouble) -> None:
    """Do something to bytes on their way."""
    far.line.add(Tamper(**trouble.arguments))


async def slow_line(far: _Far, trouble: Trouble) -> None:
    """Let bytes of one direction come late for a while."""
    direction = trouble.arguments["direction"]
    far.line.delay_s[direction] = trouble.arguments["delay_s"]
    await asyncio.sleep(trouble.lasts_s)
    far.line.delay_s[direction] = 0.0


async def hold(far: _Far, trouble: Trouble) -> None:
    """Let nothing through for a while, and keep it."""
    far.line.hold(held=True)
    await asyncio.sleep(trouble.lasts_s)
    far.line.hold(held=False)


async def cut(far: _Far, trouble: Trouble) -> None:
    """End the connection, and let nobody connect for a while; what was on its way may come through all the same."""
    far.line.refused = True
    far.line.keeps = trouble.arguments.get("keeps", False)
    far.line.cut()
    await asyncio.sleep(trouble.lasts_s)
    far.line.refused = far.line.keeps = False


async def half_open(far: _Far, trouble: Trouble) -> None:
    """Let everything vanish for a while on a connection that seems to be there."""
    far.line.vanishing = True
    await asyncio.sleep(trouble.lasts_s)
    far.line.vanishing = False
    if trouble.arguments.get("is_cut"):
        far.line.cut()


async def other_host(far: _Far, trouble: Trouble) -> None:
    """Let somebody else say something on the same line."""
    far.line.from_elsewhere(trouble.arguments["data"])


async def stall(far: _Far, trouble: Trouble) -> None:
    """Let the event loop be blocked."""
    del far
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualClockLoop)
    loop.jump(trouble.arguments["stall_s"])


def nothing(_: Random) -> Arguments:
    """Draw no arguments."""
    return {}


def one_of(**choices: tuple[Any, ...]) -> Callable[[Random], Arguments]:
    """Draw each argument from its choices."""
    return lambda random: {name: random.choice(values) for name, values in choices.items()}
