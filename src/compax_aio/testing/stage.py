"""What one test has of simulated drives: their lines, the faults that wait for their time, and the end of it all."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import Final

from compax_aio.errors import TransportError
from compax_aio.simulator.clock import VirtualClockLoop
from compax_aio.transports.registry import ProtocolFactory, opened_by
from compax_aio.transports.url import TransportURL

from .lines import SCHEME
from .simulated import SimulatedGroup

__all__ = ["Due", "Stage"]

_FORM: Final = f"{SCHEME}://x"


@dataclass(frozen=True, slots=True)
class Due:
    """When something is to happen."""

    seconds: float = 0.0
    absolute: bool = False
    """Counted from the test's beginning, not from now."""

    def __post_init__(self) -> None:
        if not 0 <= self.seconds < float("inf"):
            raise ValueError(f"a time is 0 s or later, not {self.seconds}")


@dataclass(slots=True, eq=False)
class _Timer:
    """What is to be called at a time of an event loop; if that loop ends before, in the next one."""

    loop: asyncio.AbstractEventLoop
    when: float
    call: Callable[[], None]
    handle: asyncio.TimerHandle = field(init=False)


class Stage:
    """
    All simulated drives of one test.

    Attributes:
        group: The drives.
        happened: What befell them, and when, oldest first.
        failures: What went wrong when something was to befall them.
    """

    def __init__(self) -> None:
        self.group = SimulatedGroup()
        self.happened: list[tuple[float, str]] = []
        self.failures: list[Exception] = []
        self._waiting: dict[object, str] = {}
        self._early: list[tuple[Due, str, Callable[[], None], object]] = []
        self._timers: list[_Timer] = []
        self._origins: dict[asyncio.AbstractEventLoop, float] = {}

    @classmethod
    @contextmanager
    def set(cls) -> Iterator[Stage]:
        """Open ``test://`` lines until the block is left; then all faults are undone, and all lines taken away."""
        stage = cls()
        try:
            with opened_by(stage.open, SCHEME):
                yield stage
        finally:
            stage.undo()
            for axis in stage.group.values():
                axis.line.close()
        if stage.failures:
            raise stage.failures[0]

    async def open(self, url: TransportURL, protocol_factory: ProtocolFactory) -> asyncio.Transport:
        """
        Open ``test://x``.

        Raises:
            TransportError: The test has no drive of that name, somebody else has it, or a fault lets nobody connect.
        """
        url.expect(_FORM, host=True)
        if url.host not in self.group:
            raise TransportError(
                f"this test has no simulated drive {url.host!r}",
                hint=f"there are {', '.join(self.group) or 'none'}; simulated_group.add({url.host!r}) adds one",
            )
        self._go_on_here()
        return await self.group[url.host].line.open(protocol_factory)

    # Faults -------------------------------------------------------------------------------------------------------

    @property
    def waiting(self) -> list[str]:
        """What was to befall a drive, and has not happened yet."""
        return list(self._waiting.values())

    def schedule(self, due: Due, what: str, action: Callable[[], None]) -> None:
        """
        Let something happen when it is due.

        Outside an event loop nothing can happen: then it is due from the moment when the application opens its first
        line.

        Args:
            due: When.
            what: What it is, for reports.
            action: Does it, in the event loop.
        """
        token = object()
        self._waiting[token] = what
        try:
            loop = asyncio.get_running_loop()
        except RuntimeError:
            self._early.append((due, what, action, token))
        else:
            self._schedule_in(loop, due, what, action, token)

    def later(self, seconds: float | None, action: Callable[[], None]) -> None:
        """Let *action* end a fault after so many seconds; None: it is left to the end of the test."""
        if seconds is not None:
            loop = asyncio.get_running_loop()
            self._call_at(loop, loop.time() + seconds, action)

    def undo(self) -> None:
        """Forget faults that wait, and end those that last: every drive answers, and every line can be opened."""
        for timer in self._timers:
            timer.handle.cancel()
        self._timers.clear()
        self._early.clear()
        self._waiting.clear()
        for axis in self.group.values():
            far_end = axis.far_end
            far_end.silent = far_end.deaf = False
            far_end.lose_answers = far_end.lose_position_reached = 0
            far_end.extra_answer_delay_s = far_end.delay_position_reached_s = 0.0
            axis.line.heal()
            axis.power_up()

    def clock(self, loop: asyncio.AbstractEventLoop) -> float:
        """Return the test's time in *loop*: that of a virtual clock, else counted from when the loop was first seen."""
        return loop.time() - self._origins.setdefault(loop, 0.0 if isinstance(loop, VirtualClockLoop) else loop.time())

    def _call_at(self, loop: asyncio.AbstractEventLoop, when: float, call: Callable[[], None]) -> None:
        timer = _Timer(loop, when, call)
        timer.handle = loop.call_at(when, self._due, timer)
        self._timers.append(timer)

    def _due(self, timer: _Timer) -> None:
        self._timers.remove(timer)
        timer.call()

    def _go_on_here(self) -> None:
        """Let happen here what was to happen before any loop ran, or in one that has ended since: time goes on."""
        loop = asyncio.get_running_loop()
        self.clock(loop)
        for timer in [timer for timer in self._timers if timer.loop.is_closed()]:
            self._timers.remove(timer)
            self._call_at(loop, timer.when, timer.call)
        early, self._early = self._early, []
        for due, what, action, token in early:
            self._schedule_in(loop, due, what, action, token)

    def _schedule_in(
        self, loop: asyncio.AbstractEventLoop, due: Due, what: str, action: Callable[[], None], token: object
    ) -> None:
        delay_s = due.seconds - (self.clock(loop) if due.absolute else 0.0)
        if delay_s <= 0:
            self._happen(what, action, token)
        else:
            self._call_at(loop, loop.time() + delay_s, partial(self._happen, what, action, token))

    def _happen(self, what: str, action: Callable[[], None], token: object) -> None:
        self._waiting.pop(token, None)
        self.happened.append((self.clock(asyncio.get_running_loop()), what))
        try:
            action()
        except Exception as failure:  # in a callback of the loop; told at the end of the test
            self.failures.append(failure)

    def sections(self) -> list[tuple[str, str]]:
        """Return what is told of a test that failed: title and text."""
        told = [(f"simulated drive {name}", axis.story()) for name, axis in self.group.items()]
        if self.happened:
            told.append(("faults", "\n".join(f"{at:9.3f} s  {what}" for at, what in self.happened)))
        return told
