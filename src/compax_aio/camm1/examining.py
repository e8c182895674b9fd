"""A job looked through before anything of it is sent, or, where it comes piece by piece, as it comes."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from ..severity import Severity
from .checking import Checker, Problem, raise_for_errors
from .feed import Feed
from .language.instruction import Instruction

__all__ = ["Examined", "examine", "examiner"]

_PIECE_BYTES: Final = 4096
_MOST_WARNINGS: Final = 20


@dataclass(frozen=True, slots=True)
class Examined:
    """What was found in a job without errors."""

    instructions: int
    """As they will be sent."""
    warnings: tuple[str, ...]


async def examine(
    make_feed: Callable[[Callable[[Instruction], None]], Feed], checker: Checker | None, go_on: Callable[[], None]
) -> Examined:
    """
    Look through a whole job.

    Args:
        make_feed: Makes what gives its instructions, each shown first to the function given.
        checker: Says what is wrong; None: nothing is looked for but instructions that get through no buffer.
        go_on: Called between two pieces; raises if the job is not wanted any more.

    Raises:
        InvalidCommandError: It has errors, or an instruction that cannot be told to the cutter.
    """
    problems: list[Problem] = []

    def look(instruction: Instruction) -> None:
        if checker is not None:
            problems.extend(checker.take(instruction))

    feed = make_feed(look)
    count = 0
    try:
        while taken := await feed.take(_PIECE_BYTES):
            count += len(taken)
            await asyncio.sleep(0)  # a long job takes its time: others have theirs
            go_on()
    finally:
        await feed.close()
    if checker is not None:
        problems += checker.finish()
    raise_for_errors(problems)
    warnings = [str(each) for each in problems if each.severity is Severity.WARNING]
    return Examined(count, tuple(warnings[:_MOST_WARNINGS]))


def examiner(checker: Checker | None) -> Callable[[Instruction], None]:
    """Return what raises InvalidCommandError for an instruction with an error, as it is about to be sent."""
    if checker is None:
        return lambda _: None
    return lambda instruction: raise_for_errors(checker.take(instruction))
