"""Data collection of one control: checked questions out, typed answers in, paced so that it does no harm."""

from __future__ import annotations

import asyncio
from collections import deque
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
_SETTLES_S: Final = 0.5
"""So long an answer may take that is still on its way, as long as none was timed (a gateway reckons with that)."""
_TIMED: Final = 8


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
        self.pacing = Pacing(line.name, line.settings, transfer, lambda: line.may_wait_for_rest)
        self._loop = asyncio.get_running_loop()
        self._under_way: set[asyncio.Task[str]] = set()
        self._overheard = 0
        self._overheard_at = -inf
        self._took_s: deque[float] = deque(maxlen=_TIMED)
        """How long the last answers took."""
        self._heard_on = self._repeated_on = 0
        """How often the line had been opened when the last answer came, and when a question was asked again."""

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
        try:
            return await asyncio.shield(await self.begin(request, lane))
        except AnswerTimeoutError as error:
            if error.sent is None or lane is not Lane.READ or not self._may_be_lost:
                raise
        self._repeated_on = self.line.link.times_opened
        return await asyncio.shield(await self.begin(request, lane))

    @property
    def _may_be_lost(self) -> bool:
        """Whether a control may not have taken the first question of a connection, as newer ones do."""
        opened = self.line.link.times_opened
        return self._is_shared and opened not in {self._heard_on, self._repeated_on}

    async def begin(self, request: Request, lane: Lane) -> asyncio.Task[str]:
        """
        Wait for the turn of *request*, and send it then: from there on it is carried through.

        Raises:
            InvalidCommandError: This control collects no data.
            AnswerTimeoutError: It cannot be sent for longer than it may wait.
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
        task.add_done_callback(self._is_over)
        return task

    async def _exchange(self, text: str, lane: Lane) -> str:
        began_at = self._loop.time()
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
            self._heard_on = self.line.link.times_opened
            self._took_s.append(self._loop.time() - began_at)
            return answer

    def _is_over(self, task: asyncio.Task[str]) -> None:
        self.pacing.leave()  # here, for a task that is cancelled before it begins comes to no line of its own
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

    @property
    def _settle_s(self) -> float:
        """How long our own answer may still take when one has come that may be another host's."""
        settings = self.line.settings
        longest = 2 * max(self._took_s) if len(self._took_s) > 1 else _SETTLES_S
        return max(min(longest, settings.answer_timeout_s), 2 * settings.gap_s)

    async def _confirmed(self, request: Request, text: str, overheard: int) -> str:
        """Return an answer that is no other host's; *text* is the first one, *overheard* was counted before it."""
        settle_s = self._settle_s
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
