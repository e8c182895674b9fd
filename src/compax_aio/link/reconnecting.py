"""Getting a lost line back: tried ever more rarely, each line at moments of its own, without end unless told."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from random import Random
from typing import Final, Protocol

from ..errors import CompaxError, ConnectionLostError
from .seldom import Seldom

__all__ = ["Backoff", "LostLine", "ReconnectSettings", "Reconnecting", "Restored"]

_GROWTH: Final = 2.0
_LEAST_SHARE: Final = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Backoff:
    """
    How long to wait before each attempt.

    Attributes:
        first_s: Before the first one at most; each time twice as long …
        slowest_s: … up to this.
        attempts: How many there are; None: as many as it takes.
    """

    first_s: float
    slowest_s: float
    attempts: int | None

    def pauses_s(self, random: Random) -> Iterator[float]:
        """Yield the pause before each attempt: a random one from half of what it is at most, up to that."""
        at_most_s = min(self.first_s, self.slowest_s)
        while True:
            yield at_most_s * random.uniform(_LEAST_SHARE, 1.0)
            at_most_s = min(at_most_s * _GROWTH, self.slowest_s)


@dataclass(frozen=True, slots=True)
class Restored:
    """A lost line is back."""

    after_s: float
    """Seconds from the loss."""
    attempts: int
    """How many it took."""


class LostLine(Protocol):
    """What getting a line back needs of it."""

    async def reopen(self) -> None:
        """Open it once and see who is there; raises CompaxError, with nothing left open, if that fails."""

    def admit(self) -> None:
        """Let what waits go over it."""

    def lose_patience(self) -> None:
        """Let nobody wait for it any more; it is tried on."""

    def give_up(self, error: CompaxError) -> None:
        """Take note that it is not tried any more; *error* is that of the last attempt."""


class ReconnectSettings(Protocol):
    """What a user says of it."""

    @property
    def reconnect(self) -> bool:
        """Whether a line is opened again at all."""

    @property
    def reconnect_first_s(self) -> float:
        """See :class:`Backoff`."""

    @property
    def reconnect_slowest_s(self) -> float:
        """See :class:`Backoff`."""

    @property
    def reconnect_attempts(self) -> int | None:
        """See :class:`Backoff`."""

    @property
    def in_doubt_after_s(self) -> float:
        """How long a lost line is waited for."""


class Reconnecting:
    """
    Opens one line again whenever it is lost.

    Args:
        name: Of the line, for logs; its jitter is drawn from it, so that lines lost together are not all tried in the
            same moment.
        backoff: When it is tried.
        patience_s: How long what asks something waits for a lost line.
        on_down: Called when the line is lost.
        on_restored: Called when it is back, before what waits is sent.
    """

    def __init__(
        self,
        name: str,
        backoff: Backoff,
        patience_s: float,
        on_down: Callable[[ConnectionLostError], None],
        on_restored: Callable[[Restored], None],
    ) -> None:
        self.patience_s = patience_s
        """For so long a line that is lost is waited for."""
        self.is_patient = True
        """Whether it still is."""
        self._name = name
        self._backoff = backoff
        self._on_down = on_down
        self._on_restored = on_restored
        self._log = Seldom(logging.getLogger("compax_aio.link"), name)
        self._loop = asyncio.get_running_loop()
        self._random: Random | None = None
        self._pauses_s: Iterator[float] = iter(())
        """Made when they are needed: a state of random numbers takes more memory than all the rest of a line."""
        self._restored_at = self._loop.time()
        self._is_over = False
        self._task: asyncio.Task[None] | None = None
        self._timer: asyncio.TimerHandle | None = None

    @classmethod
    def by(
        cls,
        settings: ReconnectSettings,
        name: str,
        on_down: Callable[[ConnectionLostError], None],
        on_restored: Callable[[Restored], None],
    ) -> Reconnecting | None:
        """Make one as *settings* say; None if the line is not to be opened again."""
        if not settings.reconnect:
            return None
        backoff = Backoff(
            first_s=settings.reconnect_first_s,
            slowest_s=settings.reconnect_slowest_s,
            attempts=settings.reconnect_attempts,
        )
        return cls(name, backoff, settings.in_doubt_after_s, on_down, on_restored)

    def begin(self, line: LostLine, error: ConnectionLostError, *, at_once: bool) -> None:
        """Try to get *line* back, which was lost with *error*, until it is there or given up; *at_once* or soon."""
        # One that is lost again and again is tried as rarely as one that cannot be opened.
        if self._random is None or self._loop.time() - self._restored_at >= self._backoff.slowest_s:
            self._random = self._random or Random(repr(self._name))
            self._pauses_s = self._backoff.pauses_s(self._random)

        def lose_patience() -> None:
            self.is_patient = False
            line.lose_patience()

        self._timer = self._loop.call_later(self.patience_s, lose_patience)
        self._task = self._loop.create_task(self._try(line, error, at_once=at_once), name=f"{self._name}: reconnect")

    async def end(self) -> None:
        """Try no more."""
        self._is_over = True
        self._relax()
        task, self._task = self._task, None
        if task is not None and not task.done():
            task.cancel()
            await asyncio.wait([task])

    async def _try(self, line: LostLine, loss: ConnectionLostError, *, at_once: bool) -> None:
        lost_at = self._loop.time()
        self._on_down(loss)
        error: CompaxError = loss
        attempts = 0
        while not self._is_over and (self._backoff.attempts is None or attempts < self._backoff.attempts):
            pause_s = next(self._pauses_s)
            await asyncio.sleep(0 if at_once and not attempts else pause_s)
            attempts += 1
            failure = await self._attempt(line)
            if failure is None:
                self._restored_at = self._loop.time()
                self._relax()
                after_s = self._restored_at - lost_at
                self._log.tell(logging.INFO, "the line is back after %.3g s, at attempt %d", after_s, attempts)
                self._on_restored(Restored(after_s, attempts))
                line.admit()
                return
            error = failure
            self._log.tell(logging.WARNING, "the line is still lost: %s", error.what)
        self._relax()
        if not self._is_over:
            line.give_up(error)

    async def _attempt(self, line: LostLine) -> CompaxError | None:
        """Open the line once; return why it could not be, whatever a transport of somebody else raises."""
        try:
            await line.reopen()
        except CompaxError as failure:
            return failure
        except (Exception, asyncio.CancelledError) as defect:
            task = asyncio.current_task()
            if isinstance(defect, asyncio.CancelledError) and (task is None or task.cancelling()):
                raise
            odd = ConnectionLostError(f"{type(defect).__name__}: {defect}", device=self._name)
            odd.__cause__ = defect
            return odd
        return None

    def _relax(self) -> None:
        self.is_patient = True
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
