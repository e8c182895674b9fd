"""Giving axes their names: a single one, step by step, and those of a daisy chain (DCB p. 23-24)."""

from __future__ import annotations

from itertools import islice

from ..errors import CompaxError, UnexpectedAnswerError
from ..link.contract import Lane
from .codecs import decode_parameters
from .facts import NOT_A_NAME, RESET
from .line import SmcLine
from .vocabulary import show_parameters, store

__all__ = ["name_single_axis", "names_between", "names_of_chain"]


async def name_single_axis(line: SmcLine, name: str) -> None:
    """
    Reset the axis, let it take *name*, look, store it, reset it again, and look again.

    After a reset the first character that is no blank becomes the name, whatever it is; so the name goes out once, and
    is never repeated. Unless the axis shows just that name nothing is stored, and another reset forgets it.

    Raises:
        UnexpectedAnswerError: The axis shows another name; it was reset, and has the name it had.
        CompaxError: The line failed; the error says whether the name may have been stored.
    """
    line.link.preempt(chr(RESET) + name)
    try:
        await _expect_name(line, name)
    except CompaxError as error:
        error.hint = "nothing was stored; try again when the line is sound"
        line.link.preempt(chr(RESET))
        raise
    try:
        await line.tell("", store(line.settings.profile))
        line.link.preempt(chr(RESET))
        await _expect_name(line, name)
    except CompaxError as error:
        error.hint = f"{name!r} may be stored or not: connect again, and name the axis anew"
        raise


async def _expect_name(line: SmcLine, name: str) -> None:
    """Raise UnexpectedAnswerError unless the axis shows *name*, at the end of the line that asks for its parameters."""
    question = show_parameters(line.settings.profile)
    answer = await line.ask("", question, Lane.CONTROL)
    shown = decode_parameters((question + answer).splitlines()).name
    if shown != name:
        raise UnexpectedAnswerError(
            f"the axis shows the name {shown!r}, not {name!r}",
            device=line.name,
            sent=question,
            received=answer,
            exchanges=line.link.recent(),
        )


def names_of_chain(first: str, count: int) -> str:
    """Return the names that *count* controllers take: each the next character that can be one (DCB p. 23-24)."""
    return "".join(islice(names_between(first, "\x7f"), count))


def names_between(first: str, returned: str) -> str:
    """Return the names that were taken when *first* was offered to a chain and *returned* came back."""
    return "".join(name for name in map(chr, range(ord(first), ord(returned))) if name not in NOT_A_NAME)
