"""Virtual time for tests: which event loops run on it, what time it is, and how a test without a loop gets one."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any, TypeVar
from unittest import mock

from compax_aio.simulator.clock import VirtualClockLoop

__all__ = ["VirtualTime"]

_T = TypeVar("_T")


class VirtualTime:
    """
    The clock of a test: it starts at 0, stands still while anything happens, and jumps on when nothing does.

    A coroutine test runs on it by itself. In a test that is no coroutine, everything that makes its own event loop
    does, ``asyncio.run`` and ``asyncio.Runner`` without a ``loop_factory``; one loop after the other, time goes on.

    Args:
        find_loop: Finds the loop of a test that is given one, as soon as it is there.
    """

    def __init__(self, find_loop: Callable[[], VirtualClockLoop | None] = lambda: None) -> None:
        self._loop: VirtualClockLoop | None = None
        self._find_loop = find_loop

    def __repr__(self) -> str:
        return f"<VirtualTime {self.now:.3f} s>"

    @property
    def now(self) -> float:
        """
        The time in seconds since the test's loop was made, the same as ``asyncio.get_running_loop().time()``.

        Raises:
            RuntimeError: The event loop that runs is not on virtual time.
        """
        try:
            loop = asyncio.get_running_loop()
        except RuntimeError:  # none runs: the last one has kept the time
            self._loop = self._find_loop() or self._loop
            return 0.0 if self._loop is None else self._loop.time()
        self.check(loop)
        return loop.time()

    def run(self, main: Coroutine[Any, Any, _T]) -> _T:
        """Run a coroutine in virtual time, in a test that is none itself; otherwise like ``asyncio.run``."""
        with asyncio.Runner(loop_factory=self.new_loop) as runner:
            return runner.run(main)

    def new_loop(self) -> VirtualClockLoop:
        """Make an event loop on which time goes on where the last one of this test left it."""
        loop = VirtualClockLoop()
        loop.jump(0.0 if self._loop is None else self._loop.time())
        self._loop = loop
        return loop

    @contextmanager
    def everywhere(self) -> Iterator[None]:
        """Let every event loop that asyncio makes by itself be a virtual one, until the block is left."""
        places = (asyncio.events, asyncio)
        with ExitStack() as patches:
            for place in places:
                patches.enter_context(mock.patch.object(place, "new_event_loop", self.new_loop))
            yield

    def check(self, loop: asyncio.AbstractEventLoop) -> None:
        """
        Take note that *loop* runs now.

        Raises:
            RuntimeError: It is not on virtual time.
        """
        if not isinstance(loop, VirtualClockLoop):
            raise RuntimeError(  # noqa: TRY004  # nobody has passed it
                f"this test asks for virtual_time, but runs on a {type(loop).__name__}, which somebody has made with a "
                "factory of his own; leave the choice to the fixture, or let it be a VirtualClockLoop"
            )
        self._loop = loop
