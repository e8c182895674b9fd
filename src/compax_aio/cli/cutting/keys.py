"""The key that pauses a job, and lets it go on; Ctrl-C is what it always is."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from compax_aio import CompaxError
from compax_aio.camm1.cut import Cut

from ..keyboard import keys_pressed
from ..printing import Printing

__all__ = ["pause_key"]

_HUNG_UP = getattr(signal, "SIGHUP", signal.SIGINT)


@contextmanager
def pause_key(cut: Cut, printing: Printing, *, wanted: bool, before_interrupt: Callable[[], None]) -> Iterator[bool]:
    """
    Let ``p`` pause *cut* and resume it, during a block, where somebody is at a terminal.

    Args:
        cut: A job under way.
        printing: How it is said where that fails.
        wanted: False: no key is heard.
        before_interrupt: Called when Ctrl-C is pressed, before it does what it always does.

    Yields:
        Whether keys are heard.
    """
    if not wanted or printing.json or not _has_terminal():
        yield False
        return
    keeper = _Pauser(cut, printing, before_interrupt)
    with keys_pressed(keeper.take, lambda: signal.raise_signal(_HUNG_UP)):
        yield True


def _has_terminal() -> bool:
    """Whether keys come here: of a job in the background they do not, and to ask for them would stop it."""
    if not (sys.stdin is not None and sys.stdin.isatty() and sys.stderr.isatty()):
        return False
    try:
        return os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()
    except (AttributeError, OSError):
        return os.name == "nt"


class _Pauser:
    def __init__(self, cut: Cut, printing: Printing, before_interrupt: Callable[[], None]) -> None:
        self._cut = cut
        self._printing = printing
        self._before_interrupt = before_interrupt
        self._is_paused = False
        self._tasks: set[asyncio.Task[None]] = set()

    def take(self, key: str) -> None:
        """Heed a key."""
        if key == "interrupt":
            self._before_interrupt()
            signal.raise_signal(signal.SIGINT)
        elif key == "p" and not self._tasks:
            task = asyncio.ensure_future(self._switch())
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)

    async def _switch(self) -> None:
        self._is_paused = not self._is_paused
        try:
            await (self._cut.pause() if self._is_paused else self._cut.resume())
        except CompaxError as error:
            self._printing.note(f"that was not done: {error}")
