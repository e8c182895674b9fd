"""Ctrl-C, SIGTERM and a closed terminal: a command is cancelled by them, which stops its axes, and says what it did."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from types import FrameType
from typing import Any, Final, TypeVar

from .exit_codes import Interrupted
from .outlets import until_written
from .printing import notes_console

__all__ = ["Interruption", "in_motion", "moves_nothing", "say_at_end"]

_Command = TypeVar("_Command", bound=Callable[..., Any])

_SIGNALS: Final = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name)
)
"""Of a person at the terminal, of who ends a service, and of a terminal that is closed; the last is that of Windows."""

_PATIENCE: Final = 2
"""So many signals are taken while axes are being stopped; the next one ends the process, whatever moves."""

_LAST_WORDS_S: Final = 0.5
_MOVES_NOTHING: Final = "moves_nothing"

_current: ContextVar[Interruption | None] = ContextVar("interruption", default=None)


def moves_nothing(command: _Command) -> _Command:
    """Mark a command that sends nothing that can move an axis, so that it can say so when it is interrupted."""
    setattr(command, _MOVES_NOTHING, True)
    return command


@contextmanager
def in_motion(*names: str) -> Iterator[None]:
    """
    Tell that the axes called *names* are in motion in this block, so that an interruption can name them.

    To be put around what awaits their moves, inside the block that holds their lines: that one stops them as it is
    left, and raises if one does not stand then.
    """
    interruption = _current.get()
    if interruption is None:
        yield
        return
    interruption.moving += names
    try:
        yield
    except (asyncio.CancelledError, KeyboardInterrupt):
        raise  # they are stopped, and named
    except BaseException:
        interruption.forget(names)
        raise
    else:
        interruption.forget(names)


def say_at_end(text: str) -> None:
    """Say *text*, which is known to be true, in place of what is said of any command that was interrupted."""
    interruption = _current.get()
    if interruption is not None:
        interruption.ending = text


class Interruption:
    """
    Heeds the signals that end a command, while it is used as a context manager.

    The first cancels the command's task, so that every block is left as it should be: moves are stopped, lines are
    closed. The second says that this is under way, for a stop that is lost is worse than a program that takes a second
    to end. The third ends the process at once.

    Args:
        command: That is carried out.

    Attributes:
        signal: The first that came; None: none yet.
        moving: The axes that :func:`in_motion` has named, and that have not come to their end by themselves.
        ending: What :func:`say_at_end` was told; None: nothing.
    """

    def __init__(self, command: Callable[..., Any]) -> None:
        self.signal: signal.Signals | None = None
        self.moving: list[str] = []
        self.ending: str | None = None
        self.moves_nothing = getattr(command, _MOVES_NOTHING, False)
        self._count = 0
        self._task: asyncio.Task[Any] | None = None
        self._before: dict[signal.Signals, Any] = {}

    def __enter__(self) -> Interruption:
        self._token = _current.set(self)
        if threading.current_thread() is threading.main_thread():
            for number in _SIGNALS:
                before = signal.getsignal(number)
                # What is ignored already shall be, as nohup and shells want it for what runs in the background.
                if before not in {signal.SIG_IGN, None}:
                    self._before[number] = before
                    signal.signal(number, self._take)
            if not self.moves_nothing and (stop := getattr(signal, "SIGTSTP", None)) is not None:
                self._before[stop] = signal.signal(stop, self._stay_awake)
        return self

    def __exit__(self, *_: object) -> None:
        for number, before in self._before.items():
            signal.signal(number, before)
        self._before.clear()
        _current.reset(self._token)

    def watch(self) -> None:
        """Let signals cancel the running task from now on; one that has come before does so at once."""
        self._task = asyncio.current_task()
        if self.signal is not None and self._task is not None:
            self._task.cancel()

    def forget(self, names: tuple[str, ...]) -> None:
        """Take note that axes are not in motion any more."""
        for name in names:
            self.moving.remove(name)

    @property
    def text(self) -> str:
        """What to say when the command has ended by it: that all blocks were left without an error."""
        if self.ending is not None:
            return self.ending
        if self.moves_nothing:
            return "Interrupted. This command sets nothing in motion."
        if self.moving:
            each = "each stands" if len(self.moving) > 1 else "it stands"
            return f"Interrupted. Stopped: {', '.join(self.moving)}; {each}."
        return "Interrupted. Nothing goes on that this command had set in motion."

    @property
    def note(self) -> str | None:
        """What to add to an error that came instead; None where there is nothing."""
        if self.signal is None or self.moves_nothing:
            return None
        return f"It came while {self.signal.name} was ending this command: look whether the machine stands."

    def _take(self, number: int, _: FrameType | None) -> None:
        self._count += 1
        if self.signal is None:
            self.signal = signal.Signals(number)
        task = self._task
        if task is None or task.done():
            raise Interrupted(self.signal)
        if self._count > _PATIENCE:
            self._give_up(number)
        # Not from here, which is between any two steps of whatever runs.
        with suppress(RuntimeError):  # the loop has just been closed
            task.get_loop().call_soon_threadsafe(self._cancel if self._count == 1 else self._tell_patience)

    def _stay_awake(self, _number: int, _: FrameType | None) -> None:
        """Let Ctrl-Z be: an axis would go on, and nobody would watch it, nor heed its time-out."""
        self._say("Not put to sleep: what may move an axis has to watch it. Ctrl-C stops what it has set in motion.")

    def _cancel(self) -> None:
        assert self._task is not None
        if self.moving:
            self._say(f"Stopping {', '.join(self.moving)} …")
        self._task.cancel()

    def _tell_patience(self) -> None:
        if not self.moves_nothing:
            self._say(
                "Still at it: a stop is under way, or a line is being closed. Once more gives up at once, and then an "
                "axis may go on moving."
            )

    def _give_up(self, number: int) -> None:
        if not self.moves_nothing:
            self._say("Given up: whether what moved was stopped is not known. Look at the machine.")
        with suppress(OSError, RuntimeError):
            if sys.stdout is not None and sys.stdout.isatty():
                print(end="\x1b[?25h", flush=True)  # noqa: T201 - a live display has hidden the cursor
            until_written(sys.stderr, _LAST_WORDS_S)
        signal.signal(number, signal.SIG_DFL)
        os.kill(os.getpid(), number)

    @staticmethod
    def _say(text: str) -> None:
        with suppress(OSError, RuntimeError):  # of a terminal that is gone, or in the middle of another print
            notes_console().print(text, markup=False)
