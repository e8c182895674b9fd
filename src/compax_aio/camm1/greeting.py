"""Meeting a cutter on a line that was opened: what others have set up is forgotten, and it is asked who it is."""

from __future__ import annotations

import logging
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import Final, TypeVar

from ..errors import AnswerTimeoutError, UnexpectedAnswerError
from ..link.contract import Lane
from .line import CutterLine
from .words import reset_words

__all__ = ["Greeting"]

_log = logging.getLogger("compax_aio.camm1")

_T = TypeVar("_T")

_ATTEMPTS: Final = 3
_IDENTITY: Final = "OI"


class Greeting:
    """
    Meets one cutter, each time its line is opened.

    Args:
        line: Of the cutter.

    Attributes:
        identity: What it answered when it was asked who it is; None: it does not, or was not asked.
        capacity_bytes: Of its buffer: the most that it has said to be free; None until it was empty when asked.
        errors_found: Of the line, which were told when it was opened.
    """

    def __init__(self, line: CutterLine) -> None:
        self.identity: str | None = None
        self.capacity_bytes: int | None = None
        self.errors_found: tuple[int, ...] = ()
        self._line = line

    async def meet(self) -> None:
        """
        Forget what others have set up, and look who is there; an answer or two may get lost.

        Raises:
            UnexpectedAnswerError: Another machine answers than the profile says, or than before.
            CommandRejectedError: It does not take what sets up the line.
            AnswerTimeoutError: It does not answer.
        """
        line, lane = self._line, Lane.GREETING
        self.errors_found = await _patiently(lambda: line.errors(lane))  # of others: before one can be ours
        for code in self.errors_found:
            _log.info("%s: error %d of the line was told when it was opened", line.name, code)
        await _patiently(lambda: line.tell(reset_words(line.profile), lane, what="what sets up the line"))
        status = await _patiently(lambda: line.status(lane))
        if not line.protocol.has_signs:
            _log.warning(
                "%s puts no sign in front of its replies (ESC.M P6): late ones are told by their time alone, and "
                "nobody sees that it was switched off and on",
                line.name,
            )
        await _patiently(self._look_who_is_there)
        if status.buffer_is_empty:
            self.capacity_bytes = max(await _patiently(lambda: line.free_space(lane)), self.capacity_bytes or 0)

    async def ask_identity(self, lane: Lane) -> str | None:
        """Ask who it is: ``.A``, else ``OI;`` if its buffer is empty; None if that is not had, or not possible now."""
        line, profile = self._line, self._line.profile
        if "A" in profile.controls and profile.model_answer is not None:
            return await line.model(lane)
        status = await line.status(lane)
        may_be_asked = status.buffer_is_empty and not status.is_paused and not status.is_suspended
        if _IDENTITY not in profile.mnemonics or profile.identity is None or not may_be_asked:
            return None
        return await line.ask(f"{_IDENTITY};", lane, repeats=False)

    async def _look_who_is_there(self) -> None:
        """Compare who answers with who should be there, and with who was."""
        answer = await self.ask_identity(Lane.GREETING)
        if answer is None:
            return
        profile = self._line.profile
        answer = answer.partition(",")[0].strip()  # an HP 7550A tells its firmware, too
        expected = self.identity or profile.model_answer or profile.identity
        if expected is not None and answer != expected:
            raise UnexpectedAnswerError(
                f"the machine says it is {answer!r}, not {expected!r}",
                device=self._line.name,
                received=answer,
                hint=f"is it a {profile.name}? Choose another profile; or put what it answers into this one",
                exchanges=self._line.link.recent(),
            )
        self.identity = answer


async def _patiently(question: Callable[[], Awaitable[_T]]) -> _T:
    """Ask a few times, if need be; a line on which nobody answers at all raises at once, when it is opened."""
    for _ in range(_ATTEMPTS - 1):
        with suppress(AnswerTimeoutError, UnexpectedAnswerError):
            return await question()
    return await question()
