"""Data collection of one control: checked questions out, typed answers in, paced so that it does no harm."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from math import inf
from typing import Any, Final

from ..errors import AnswerTimeoutError, CommandRejectedError, InvalidCommandError, UnexpectedAnswerError
from ..link.contract import Lane
from .answers import Answer, Belongs, Busy, Count, Duration, Mode, Request, Text, VariableValue, belonging, decode
from .line import ControlLine
from .pacing import Pacing

__all__ = ["Collecting", "value_of"]

_SHARED_FOR_S: Final = 60.0
"""So long after an answer to somebody else's question another one is reckoned with."""
_MOST_CONFIRMATIONS: Final = 5


class Collecting:
    """
    Asks one control.

    Over Ethernet every answer goes to each host that is connected. One that does not name what it answers may be that
    to another host's question: so there it is asked again, until two in a row are the same and nothing came between.

    Args:
        line: Of the control.
        transfer: Says which transfer there is, under way or over; questions wait for its end.

    Attributes:
        line: As above.
        pacing: When something may be asked.
    """

    def __init__(self, line: ControlLine, transfer: Callable[[], asyncio.Future[Any] | None]) -> None:
        self.line = line
        self.pacing = Pacing(line.name, line.settings, transfer)
        self._loop = asyncio.get_running_loop()
        self._under_way: set[asyncio.Task[str]] = set()
        self._overheard = 0
        self._overheard_at = -inf

    # Asking ---------------------------------------------------------------------------------------------------------

    async def ask(self, request: Request) -> Answer:
        """
        Ask, and read the answer.

        Raises:
            InvalidCommandError: This control collects no data.
            CommandRejectedError: It does not know the question.
            UnexpectedAnswerError: What came is no answer to it.
            AnswerTimeoutError, ConnectionLostError: None came, or it could not be sent.
        """
        overheard = self._overheard
        text = await self.exchange(request, Lane.READ)
        if self._is_shared and belonging(request, text) is Belongs.PERHAPS:
            text = await self._confirmed(request, text, overheard)
        return self.decode(request, text)

    def decode(self, request: Request, text: str) -> Answer:
        """Read *text* as the answer to *request*; errors are told with the control and its last exchanges."""
        try:
            return decode(request, text)
        except (CommandRejectedError, UnexpectedAnswerError) as error:
            error.device, error.exchanges = self.line.name, self.line.link.recent()
            raise

    async def exchange(self, request: Request, lane: Lane) -> str:
        """
        Send *request* in its turn, and return what the answer's frame has.

        One that was sent has its turn until it is over, although the caller is cancelled.

        Raises:
            As :meth:`ask`.
        """
        if self.line.profile.data_collection is None:
            raise InvalidCommandError(
                f"{request.text!r} cannot be asked: the profile {self.line.profile.name!r} says that this control "
                "collects no data",
                device=self.line.name,
                hint="give a profile whose data_collection is 'rs-232' or 'ethernet'",
            )
        await self.pacing.enter(request.text)
        task = self._loop.create_task(self._exchange(request.text, lane), name=f"{self.line.name}: {request.text}")
        self._under_way.add(task)
        task.add_done_callback(self._forget)
        return await asyncio.shield(task)

    async def _exchange(self, text: str, lane: Lane) -> str:
        try:
            answer = await self.line.ask(text, lane)
        except AnswerTimeoutError:
            self.pacing.note_silence()
            raise
        except UnexpectedAnswerError:
            self.pacing.note_answered()
            raise
        else:
            self.pacing.note_answered()
            return answer
        finally:
            self.pacing.leave()

    def _forget(self, task: asyncio.Task[str]) -> None:
        self._under_way.discard(task)
        if not task.cancelled():
            task.exception()  # a caller that was cancelled does not fetch it

    # What comes unasked ---------------------------------------------------------------------------------------------

    def note_printed(self) -> None:
        """Take note that a program prints."""
        self.pacing.note_printed()

    def note_overheard(self) -> None:
        """Take note that an answer came which was not asked for here."""
        self._overheard += 1
        self._overheard_at = self._loop.time()

    @property
    def _is_shared(self) -> bool:
        """Whether other hosts' answers may come over this line."""
        return self.line.profile.data_collection == "ethernet"

    async def _confirmed(self, request: Request, text: str, overheard: int) -> str:
        """Return an answer that is no other host's; *text* is the first one, *overheard* was counted before it."""
        settle_s = 2 * self.line.settings.gap_s
        await asyncio.sleep(settle_s)  # if it was another host's, our own follows
        if self._overheard == overheard and self._loop.time() - self._overheard_at > _SHARED_FOR_S:
            return text
        for _ in range(_MOST_CONFIRMATIONS):
            overheard = self._overheard
            again = await self.exchange(request, Lane.READ)
            await asyncio.sleep(settle_s)
            if again == text and self._overheard == overheard:
                return text
            text = again
        raise UnexpectedAnswerError(
            f"no two answers to {request.text!r} were the same, with nothing between: another host asks this control, "
            "too, and this answer does not say what it answers",
            device=self.line.name,
            sent=request.text,
            received=text,
            hint="ask when the other host is quiet, or through it",
            exchanges=self.line.link.recent(),
        )


def value_of(answer: Answer) -> Any:
    """
    Return what an answer says: a text, a number, a time, None for an empty variable; or the answer, if it says more.

    Raises:
        CommandRejectedError: It says that the control is busy, and no more.
    """
    if isinstance(answer, Busy):
        raise CommandRejectedError(
            "the control runs a cycle, and says no more than that it is busy",
            sent=answer.request.text,
            received=answer.text,
            hint="ask again when the cycle is over; program_status() tells when",
        )
    if isinstance(answer, Text | Mode | Count | Duration | VariableValue):
        return answer.value
    return answer
