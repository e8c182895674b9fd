"""The key that pauses a job, and lets it go on; Ctrl-C is what it always is."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from compax_aio import CompaxError, camm1

from ..keyboard import keys_pressed
from ..printing import Printing

__all__ = ["pause_key"]

_HUNG_UP = getattr(signal, "SIGHUP", signal.SIGINT)


@contextmanager
def pause_key(cut: camm1.Cut, printing: Printing, *, wanted: bool) -> Iterator[bool]:
    """Let ``p`` pause *cut* and resume it, during a block, where somebody is at a terminal; gives whether it does."""
    if not wanted or printing.json or not _has_terminal():
        yield False
        return
    keeper = _Pauser(cut, printing)
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
    def __init__(self, cut: camm1.Cut, printing: Printing) -> None:
        self._cut = cut
        self._printing = printing
        self._is_paused = False
        self._tasks: set[asyncio.Task[None]] = set()

    def take(self, key: str) -> None:
        """Heed a key."""
        if key == "interrupt":
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
