"""Words while devices are served: a prompt at a terminal, or lines that somebody else writes to the standard input."""

from __future__ import annotations

import asyncio
import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Final

from .hands import Hands, known_words

__all__ = ["listen", "pasted_above_prompt"]

_PROMPT: Final = "sim> "
_PIECE_BYTES: Final = 4096
_LONGEST_LINE: Final = 65_536


def _is_conversation() -> bool:
    """Whether a person sits at both ends, and can type here."""
    return sys.stdin is not None and sys.stdin.isatty() and sys.stdout.isatty() and not _is_in_background()


def _is_in_background() -> bool:
    """Whether the shell has put us behind something else: who reads from the terminal then is stopped by the system."""
    try:
        return os.getpgrp() != os.tcgetpgrp(sys.stdin.fileno())
    except (AttributeError, OSError, ValueError):  # no such terminal, or no such system
        return False


@contextmanager
def pasted_above_prompt(*, wanted: bool) -> Iterator[bool]:
    """Let what is printed in this block appear above the prompt, if there is one; gives whether there is."""
    if not wanted or not _is_conversation():
        yield False
        return
    from prompt_toolkit.patch_stdout import patch_stdout  # noqa: PLC0415 - few need it

    with patch_stdout(raw=True):
        yield True


async def listen(hands: Hands, say: Callable[[str], None], *, is_conversation: bool) -> None:
    """Carry out what is typed or written until service shall end; returns at once if nobody can say anything."""
    if is_conversation:
        await _converse(hands, say)
    else:
        await _read_lines(hands, say)


async def _converse(hands: Hands, say: Callable[[str], None]) -> None:
    from prompt_toolkit import PromptSession  # noqa: PLC0415 - few need it
    from prompt_toolkit.completion import WordCompleter  # noqa: PLC0415

    session: PromptSession[str] = PromptSession(_PROMPT, completer=WordCompleter(list(known_words())))
    while not hands.wants_end:
        try:
            line = await session.prompt_async(handle_sigint=False)
        except (EOFError, KeyboardInterrupt):
            hands.wants_end = True
        else:
            _tell(hands.do(line), say)


async def _read_lines(hands: Hands, say: Callable[[str], None]) -> None:
    """Carry out lines from a pipe or file; returns at its end, or waits for ever where there is no such thing."""
    try:
        # One of our own: the thread may read on when this one is closed, and its number is another file's.
        stdin = os.dup(sys.stdin.fileno())
    except (AttributeError, OSError, ValueError):
        return
    if os.isatty(stdin) and _is_in_background():
        os.close(stdin)
        return
    lines: asyncio.Queue[str | None] = asyncio.Queue()
    loop = asyncio.get_running_loop()

    def read() -> None:
        # Past Python's own buffer: a thread that waits in it would keep the interpreter from ending.
        with suppress(OSError, RuntimeError):  # of a loop that is closed
            rest = b""
            while piece := os.read(stdin, _PIECE_BYTES):
                *whole, rest = (rest + piece).split(b"\n")
                rest = rest[-_LONGEST_LINE:]
                for each in whole:
                    loop.call_soon_threadsafe(lines.put_nowait, each.decode("utf-8", "replace"))
            loop.call_soon_threadsafe(lines.put_nowait, rest.decode("utf-8", "replace"))
            loop.call_soon_threadsafe(lines.put_nowait, None)
        os.close(stdin)

    threading.Thread(target=read, daemon=True, name="reads the standard input").start()
    while not hands.wants_end:
        line = await lines.get()
        if line is None:
            return
        _tell(hands.do(line), say)


def _tell(answer: str, say: Callable[[str], None]) -> None:
    if answer:
        say(answer)
