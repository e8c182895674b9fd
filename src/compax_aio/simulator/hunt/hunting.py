"""Goes through seeds, in one process or several, and tells what was found."""

from __future__ import annotations

import multiprocessing
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from multiprocessing.pool import Pool
from typing import Final

from .quarry import COMPAX, Quarry

__all__ = ["Find", "Hunt", "try_seed"]

_LONGEST_S: Final = 60
"""Of real time, for one seed."""
_AT_ONCE: Final = 20
"""Seeds that a process takes at a time."""


@dataclass(frozen=True, slots=True)
class Find:
    """A seed that breaks promises."""

    seed: int
    broken: tuple[tuple[str, str], ...]
    """Promise, and how it was broken."""

    @property
    def promises(self) -> tuple[str, ...]:
        """Each promise once."""
        return tuple(dict.fromkeys(promise for promise, _ in self.broken))


@dataclass(slots=True)
class Hunt:
    """
    A hunt, as far as it has got.

    Attributes:
        quarry: What is hunted.
        tried: How many seeds.
        finds: Those that break promises.
        is_over: Whether all seeds were tried.
    """

    quarry: Quarry = COMPAX
    tried: int = 0
    finds: list[Find] = field(default_factory=list)
    is_over: bool = False
    began_at: float = field(default_factory=time.monotonic)

    @property
    def seeds_a_second(self) -> float:
        """How many seeds a second of real time were tried."""
        return self.tried / max(time.monotonic() - self.began_at, 1e-9)

    def go(
        self,
        seeds: Iterable[int],
        *,
        jobs: int = 1,
        until: float | None = None,
        on_progress: Callable[[Hunt], None] = lambda _: None,
    ) -> None:
        """
        Try *seeds*.

        Args:
            seeds: May be endless, with *until*.
            jobs: How many processes.
            until: When to leave off, on the monotonic clock.
            on_progress: Called from time to time, and with every find.
        """
        with _tries(seeds, jobs, partial(try_seed, quarry=self.quarry)) as tries:
            for tried, find in tries:
                self.tried += tried
                if find is not None:
                    self.finds.append(find)
                on_progress(self)
                if until is not None and time.monotonic() >= until:
                    return
        self.is_over = True


@contextmanager
def _tries(
    seeds: Iterable[int], jobs: int, attempt: Callable[[int], Find | None]
) -> Iterator[Iterator[tuple[int, Find | None]]]:
    if jobs == 1:
        yield ((1, attempt(seed)) for seed in seeds)
        return
    # A process that is forked has this one's imports; they are the most of what a short hunt would wait for.
    pool: Pool = multiprocessing.get_context("fork").Pool(jobs, _ignore_ctrl_c)
    try:
        yield ((1, find) for find in pool.imap_unordered(attempt, seeds, _AT_ONCE))
    finally:
        pool.terminate()
        pool.join()


def _ignore_ctrl_c() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def try_seed(seed: int, quarry: Quarry = COMPAX) -> Find | None:
    """Run the scenario of *seed*; None if it breaks no promise."""
    try:
        with _not_for_ever():
            found = quarry.broken(quarry.simulate(quarry.draw(seed)))
    except Exception as error:
        error.add_note(f"in the simulation of seed {seed}")
        raise
    except _ForEverError:
        return Find(seed, (("P3", f"the event loop was blocked for {_LONGEST_S} s of real time"),))
    return Find(seed, tuple((each.promise, each.how) for each in found)) if found else None


class _ForEverError(BaseException):
    """A seed has no end; no error that somebody handles, for it is raised wherever the program is."""


@contextmanager
def _not_for_ever() -> Iterator[None]:
    """Give up what keeps the processor for very long; where there are no alarms, or others use them, it may."""
    if not hasattr(signal, "SIGALRM") or threading.current_thread() is not threading.main_thread():
        yield
        return

    def give_up(_: int, __: object) -> None:
        raise _ForEverError

    before = signal.signal(signal.SIGALRM, give_up)
    signal.alarm(_LONGEST_S)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
