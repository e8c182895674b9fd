"""A question to the person at the terminal, who may also interrupt it; the line is served meanwhile."""

from __future__ import annotations

import asyncio
import os
import sys
from typing import Final

from compax_aio import InvalidCommandError

from .keyboard import forget_typed
from .printing import notes_console

__all__ = ["answer_to", "confirm", "expect_somebody"]

_LONGEST: Final = 1024


def expect_somebody(*, yes: bool) -> None:
    """
    Do nothing if *yes* was said in advance, or if somebody can be asked.

    Raises:
        InvalidCommandError: Nobody can be asked.
    """
    if not yes and not sys.stdin.isatty():
        raise InvalidCommandError("this asks before it writes, and nobody is at a terminal", hint="say --yes")


async def confirm(question: str) -> bool:
    """Ask a question that is answered by y or n; everything else, and the end of the input, is a no."""
    return (await answer_to(f"{question} [y/N]")).lower() in {"y", "yes"}


async def answer_to(question: str) -> str:
    """Ask a question, and return the line that is typed, without blanks around it; the end of the input is empty."""
    loop, descriptor = asyncio.get_running_loop(), sys.stdin.fileno()
    answer: asyncio.Future[bytes] = loop.create_future()

    def take() -> None:
        loop.remove_reader(descriptor)
        if not answer.done():
            answer.set_result(os.read(descriptor, _LONGEST))

    forget_typed()  # nobody has answered what was not asked yet
    notes_console().print(f"{question} ", end="", markup=False)
    loop.add_reader(descriptor, take)
    try:
        said = await answer
    finally:
        loop.remove_reader(descriptor)
    return said.decode("utf-8", "replace").strip()
