"""Running a simulation in virtual time: begin things at their moments, wait for all of them, miss nothing."""

from __future__ import annotations

import asyncio
import gc
import logging
from collections.abc import Awaitable, Callable, Coroutine, Iterable, Iterator
from contextlib import contextmanager
from typing import Any, Final, Protocol, TypeVar

from compax_aio.errors import CompaxError
from compax_aio.simulator.clock import VirtualClockLoop

from .scenario import Action

__all__ = ["LONGEST_S", "all_ended", "carried_out", "in_time", "let_go_of_tasks", "run", "told"]

LONGEST_S: Final = 3600.0
"""Of virtual time: what has not ended then never will."""
_COLLECTED_AFTER: Final = 20_000
"""Objects more than before."""


class _AtSomeTime(Protocol):
    @property
    def at_s(self) -> float:
        """From the beginning."""


_Timed = TypeVar("_Timed", bound=_AtSomeTime)


def run(work: Callable[[], Coroutine[Any, Any, None]]) -> None:
    """Run *work* in virtual time, on an event loop of its own."""
    loop = VirtualClockLoop()
    try:
        with _unlogged(), _rarely_collecting():
            loop.run_until_complete(work())
        loop.run_until_complete(loop.shutdown_default_executor())
    finally:
        # Without a runner, which waits for every task: one that cannot be cancelled is what we look for.
        loop.close()


@contextmanager
def _unlogged() -> Iterator[None]:
    """Let nothing be written of troubles that are wanted."""
    log = logging.getLogger("compax_aio")
    usual = log.level
    log.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        log.setLevel(usual)


@contextmanager
def _rarely_collecting() -> Iterator[None]:
    """Look through what is kept less often: notes are many, and none of them is garbage."""
    usual = gc.get_threshold()
    gc.set_threshold(_COLLECTED_AFTER, 20, 1000)
    try:
        yield
    finally:
        gc.set_threshold(*usual)


async def in_time(
    items: Iterable[_Timed], begin: Callable[[_Timed], Awaitable[None]], tasks: list[asyncio.Task[None]]
) -> None:
    """Begin each of *items* at its time; a day of them shall not wait side by side."""
    loop = asyncio.get_running_loop()
    for item in sorted(items, key=lambda each: each.at_s):
        if item.at_s > loop.time():
            now_is_the_time: asyncio.Future[None] = loop.create_future()
            loop.call_at(item.at_s, now_is_the_time.set_result, None)
            await now_is_the_time
        tasks.append(asyncio.ensure_future(begin(item)))


async def carried_out(action: Action, work: Awaitable[None], complaints: list[str]) -> None:
    """Let a user do something, and perhaps give it up; what goes wrong with that is complained of."""
    task = asyncio.ensure_future(work)
    if action.gives_up is not None:
        after_s, steps = action.gives_up
        await asyncio.wait([task], timeout=after_s)
        for _ in range(steps):
            await asyncio.sleep(0)
        task.cancel()
    await asyncio.wait([task])
    if not task.cancelled() and (error := task.exception()) is not None:
        complaints.append(f"item {action.number}: {error!r}")


async def all_ended(tasks: list[asyncio.Task[None]], complaints: list[str], complaint: str) -> None:
    """Wait until all *tasks* have ended; those that do not are complained of, and cancelled."""
    if not tasks:
        return
    _, waiting = await asyncio.wait(tasks, timeout=LONGEST_S)
    if waiting:
        complaints.append(f"{complaint}: {len(waiting)}")
        for task in waiting:
            task.cancel()
        await asyncio.wait(waiting, timeout=LONGEST_S)


async def let_go_of_tasks() -> list[str]:
    """Cancel all other tasks of the event loop, and say which there were."""
    gc.collect(0)
    left = asyncio.all_tasks() - {asyncio.current_task()}
    names = [repr(task) for task in left]
    for task in left:
        task.cancel()
    if left:
        await asyncio.wait(left, timeout=LONGEST_S)
    return names


def told(context: dict[str, Any]) -> str:
    """Word what asyncio's exception handler is given."""
    error = context.get("exception")
    return f"{context.get('message')}: {error!r}" + (f" {error}" if isinstance(error, CompaxError) else "")
