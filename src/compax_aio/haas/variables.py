"""
Writing a variable of a control: off unless its number is allowed, once at most, read back, and on record.

How a classic control answers a write is not known, and an answer can be lost. So what the variable reads afterwards
decides; where it cannot be read, the write is told as in doubt. Each attempt has two lines in the log
``compax_aio.haas.writes``: that it is about to be made, and what became of it.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from contextlib import suppress
from typing import Final

from ..checked_numbers import check_number, check_whole, written
from ..errors import (
    AnswerTimeoutError,
    CommandRejectedError,
    CompaxError,
    ConnectionLostError,
    InvalidCommandError,
    UnexpectedAnswerError,
)
from ..escaping import shown
from ..link.contract import Lane
from ..motion.events import DriveEvent
from .answers import HIGHEST_VARIABLE, Request, VariableValue
from .collecting import Collecting, value_of
from .events import VariableWritten
from .facts.variables import VARIABLES, protection_of

__all__ = ["VariableWriter"]

_log = logging.getLogger("compax_aio.haas.writes")

_DECIMALS: Final = {"rs-232": 4, "ethernet": 6}
"""As many as the control shows when a variable is read; what has more could not be compared."""


class VariableWriter:
    """
    Writes variables of one control.

    Args:
        collecting: Asks the control.
        publish: Is told what was written.
    """

    def __init__(self, collecting: Collecting, publish: Callable[[DriveEvent], None]) -> None:
        self._collecting = collecting
        self._line = collecting.line
        self._publish = publish
        self._loop = asyncio.get_running_loop()
        self._turn = asyncio.Lock()
        self._tasks: set[asyncio.Task[float]] = set()

    async def write(self, number: int, value: float) -> float:
        """Write a variable, and return what it reads afterwards; see :meth:`Control.write_variable`."""
        number = self._checked_number(number)
        text = self._checked_value(number, value)
        await self._turn.acquire()
        try:
            before = await self._read(number)
            answer = await self._send(Request.writing(number, text), before)
        except BaseException:
            self._turn.release()
            raise
        # From here on it is carried through although the caller is cancelled: what became of it goes on record.
        task = self._loop.create_task(
            self._follow(Request.writing(number, text), before, answer), name=f"{self._line.name}: write #{number}"
        )
        self._tasks.add(task)
        task.add_done_callback(self._is_over)
        try:
            return await asyncio.shield(task)
        finally:
            if not task.done():  # cancelled
                with suppress(CompaxError):
                    await asyncio.shield(task)

    def _is_over(self, task: asyncio.Task[float]) -> None:
        self._turn.release()  # here, so that the next write waits for it however often the caller is cancelled
        self._tasks.discard(task)
        if not task.cancelled():
            task.exception()  # a caller that was cancelled does not fetch it

    # Refusing -------------------------------------------------------------------------------------------------------

    def _checked_number(self, number: object) -> int:
        number = check_whole("the number of a variable", number, 1, HIGHEST_VARIABLE)
        if (protected := protection_of(number)) is not None:
            raise self._refused(number, f"it is protected ({protected.what}), whatever settings allow", None)
        row = VARIABLES.get(number)
        if row is not None and row.read_only:
            raise self._refused(number, f"it can only be read ({row.name})", None)
        if not self._line.settings.may_write(number):
            allowed = ", ".join(f"{each.start} to {each.stop - 1}" for each in self._line.settings.writable)
            hint = f"allowed are {allowed}" if allowed else "none is, by default"
            raise self._refused(
                number, "it is not among those that may be written", f"{hint}; see writable of ControlSettings"
            )
        return number

    def _checked_value(self, number: int, value: object) -> str:
        wanted = check_number(f"the value of variable #{number}", value)
        largest = self._line.settings.largest_value
        if abs(wanted) > largest:
            raise self._refused(
                number, f"{shown(value)} is beyond ±{largest:g}", "see largest_value of ControlSettings"
            )
        text = written(wanted, self._decimals)
        if float(text) != wanted:
            raise self._refused(
                number,
                f"{shown(value)} has more than the {self._decimals} decimals that the control shows, so that it could "
                "not be compared",
                f"round it: {text}",
            )
        return text if "." in text else f"{text}."  # without a point, controls may take it for the last decimals

    def _refused(self, number: int, why: str, hint: str | None) -> InvalidCommandError:
        return InvalidCommandError(f"variable #{number} is not written: {why}", device=self._line.name, hint=hint)

    @property
    def _decimals(self) -> int:
        return _DECIMALS[self._line.profile.data_collection or "rs-232"]

    # Writing --------------------------------------------------------------------------------------------------------

    async def _read(self, number: int) -> float | None:
        answer = await self._collecting.ask(Request.of_variable(number))
        value = value_of(answer)
        assert isinstance(answer, VariableValue)
        return None if value is None else float(value)

    async def _send(self, request: Request, before: float | None) -> asyncio.Task[str]:
        """Send it in its turn; whoever gives up until then has written nothing."""
        number, text = request.variable, request.value
        self._record(logging.INFO, "#%d = %s is written; it was %s", number, text, _shown(before))
        try:
            return await self._collecting.begin(request, Lane.CONTROL)
        except asyncio.CancelledError:
            self._record(logging.WARNING, "#%d = %s was not sent: the caller has given up", number, text)
            raise
        except CompaxError as error:
            self._record(logging.WARNING, "#%d = %s was not sent: %s", number, text, error)
            raise

    async def _follow(self, request: Request, before: float | None, answer: asyncio.Task[str]) -> float:
        """Await the answer, if there is one, and find out what became of it."""
        assert request.variable is not None  # it writes one
        assert request.value is not None
        failure: CompaxError | None = None
        try:
            self._collecting.decode(request, await asyncio.shield(answer))
        except CompaxError as error:
            if error.sent is None:
                self._record(logging.WARNING, "#%d = %s was not sent: %s", request.variable, request.value, error)
                raise
            failure = error
        return await self._judge(request, request.variable, float(request.value), before, failure)

    async def _judge(
        self, request: Request, number: int, wanted: float, before: float | None, failure: CompaxError | None
    ) -> float:
        """Say by what the variable reads what became of the write, whatever was answered to it."""
        try:
            found = await self._read(number)
        except CompaxError as error:
            self._record(logging.ERROR, "#%d = %s is in doubt: it cannot be read back: %s", number, wanted, error)
            raise self._in_doubt(request, number, wanted, failure, error) from error
        is_refused = isinstance(failure, CommandRejectedError) and self._is(before, wanted)
        if found is not None and self._is(found, wanted) and not is_refused:
            how = "" if failure is None else f" (the control's answer was none: {failure.what})"
            self._record(logging.INFO, "#%d = %s reads back so%s", number, _shown(found), how)
            self._publish(VariableWritten(self._line.name, self._loop.time(), number, before, found))
            return found
        self._record(logging.WARNING, "#%d = %s was not taken: it reads %s", number, wanted, _shown(found))
        raise self._not_taken(request, number, wanted, found, failure)

    def _is(self, value: float | None, wanted: float) -> bool:
        return value is not None and written(value, self._decimals) == written(wanted, self._decimals)

    def _in_doubt(
        self, request: Request, number: int, wanted: float, failure: CompaxError | None, error: CompaxError
    ) -> CompaxError:
        kind = ConnectionLostError if isinstance(error, ConnectionLostError) else AnswerTimeoutError
        why = f"the control did not answer ({failure.what})" if failure is not None else "the control has answered"
        return kind(
            f"whether variable #{number} is {wanted:g} is in doubt: it was sent once, {why}, and it cannot be read "
            f"back: {error.what}",
            device=self._line.name,
            sent=request.text,
            hint="read it before anything relies on it; it is not sent again by itself",
            exchanges=self._line.link.recent(),
        )

    def _not_taken(
        self, request: Request, number: int, wanted: float, found: float | None, failure: CompaxError | None
    ) -> CompaxError:
        reads = f"{_shown(found)}, as before" if self._is(found, wanted) else f"{_shown(found)}, not {wanted:g}"
        what = f"variable #{number} was not written: it reads {reads}"
        if isinstance(failure, CommandRejectedError):
            hint = "the control does not know this request, or does not let this variable be written"
            return CommandRejectedError(
                what, device=self._line.name, sent=request.text, received=failure.received, hint=hint
            )
        hint = "does a program write it, too, or is it one that the control keeps to itself?"
        if failure is not None:
            what += f"; {failure.what}"
        return UnexpectedAnswerError(
            what, device=self._line.name, sent=request.text, hint=hint, exchanges=self._line.link.recent()
        )

    def _record(self, level: int, text: str, *values: object) -> None:
        _log.log(level, f"%s: {text}", self._line.name, *values)


def _shown(value: float | None) -> str:
    return "empty" if value is None else f"{value:g}"
