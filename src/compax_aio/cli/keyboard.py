"""Single keys of a terminal, as they are pressed; the terminal is as before when that ends, however it ends."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Final

from compax_aio import InvalidCommandError

__all__ = ["expect_keyboard", "forget_typed", "keys_pressed"]

_ESCAPE_PAUSE_S: Final = 0.1
"""An Escape that nothing follows for so long is the key; arrows begin with the same character."""

_NAMES: Final = {" ": "space", "escape": "q", "c-c": "interrupt", "c-d": "q"}


def expect_keyboard() -> None:
    """
    Do nothing if keys can be read.

    Raises:
        InvalidCommandError: The input is no terminal.
    """
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise InvalidCommandError("keys can be read from a terminal only, and this is none")


@contextmanager
def keys_pressed(on_key: Callable[[str], None], on_end: Callable[[], None]) -> Iterator[None]:
    """
    Let *on_key* be called with each key that is pressed during a block.

    What was typed before is not heard: who typed it did not know what it would do.

    Args:
        on_key: Called with ``left``, ``right``, ``up``, ``down``, ``space``, ``q`` (Escape and Ctrl-D too),
            ``interrupt`` (Ctrl-C), or the small letter.
        on_end: Called when the terminal is gone.
    """
    from prompt_toolkit.input import create_input  # noqa: PLC0415 - it takes a while, and few need it

    loop, source = asyncio.get_running_loop(), create_input(sys.stdin)
    flush: asyncio.TimerHandle | None = None

    def tell(pressed: list[str]) -> None:
        for each in pressed:
            on_key(_NAMES.get(each, each.lower()))

    def take() -> None:
        nonlocal flush
        if flush is not None:
            flush.cancel()
        tell([str(getattr(each.key, "value", each.key)) for each in source.read_keys()])
        if source.closed:
            on_end()
        flush = loop.call_later(
            _ESCAPE_PAUSE_S,
            lambda: tell([str(getattr(each.key, "value", each.key)) for each in source.flush_keys()]),
        )

    forget_typed()
    try:
        with source.raw_mode(), source.attach(take):
            yield
    finally:
        if flush is not None:
            flush.cancel()
        source.close()


def forget_typed() -> None:
    """Forget what was typed at the terminal, and not read yet: who typed it did not know what it would answer."""
    with suppress(ImportError, OSError, ValueError):
        import termios  # noqa: PLC0415 - Windows has none

        termios.tcflush(sys.stdin.fileno(), termios.TCIFLUSH)
