"""Stopping a device: its stop repeated until it is acknowledged, then looking until the device stands still."""

from __future__ import annotations

import asyncio
import logging
from abc import ABC, abstractmethod
from typing import Final, Generic, TypeVar

from ..errors import AnswerTimeoutError, CompaxError, ConnectionLostError, MoveTimeoutError
from ..link.contract import TurnOver
from ..link.link import Link

__all__ = ["Stopping"]

_PAUSE_S: Final = 0.1

_Look = TypeVar("_Look")


class Stopping(ABC, Generic[_Look]):
    """
    One stop of one device; it is queued ahead of everything else when this is made.

    Args:
        name: Of the device.
        link: Its line.
        text: The stop as it is sent.
        word: How people call it.
        stop_timeout_s: For so long it is repeated.
        standstill_timeout_s: So long the device may take to stand still after it was acknowledged.
        answer_timeout_s: How long an answer may take.
        log: Where it is told that a stop has to wait.
    """

    def __init__(
        self,
        name: str,
        link: Link,
        text: str,
        *,
        word: str,
        stop_timeout_s: float,
        standstill_timeout_s: float,
        answer_timeout_s: float,
        log: logging.Logger,
    ) -> None:
        self._name = name
        self._link = link
        self._text = text
        self._word = word
        self._stop_timeout_s = stop_timeout_s
        self._standstill_timeout_s = standstill_timeout_s
        self._answer_timeout_s = answer_timeout_s
        self._log = log
        self._loop = asyncio.get_running_loop()
        self._reply = self._send()

    # What differs from device to device -----------------------------------------------------------------------------

    @abstractmethod
    def _send(self) -> asyncio.Future[TurnOver]:
        """Queue the stop."""

    @abstractmethod
    async def _refusal(self, outcome: TurnOver, give_up_at: float) -> CompaxError | None:
        """Return why *outcome* does not mean that the device stops; None if it does."""

    @abstractmethod
    def _hint(self, failure: CompaxError) -> str | None:
        """Return what a person should do, now that the stop was not acknowledged; None: what *failure* says."""

    @abstractmethod
    async def _look(self) -> _Look:
        """Look how the device stands."""

    @abstractmethod
    def _stands(self, look: _Look) -> bool:
        """Whether the device stands still, and stays so."""

    @abstractmethod
    def _still_moving(self, look: _Look) -> MoveTimeoutError:
        """Report a device that has acknowledged the stop, and does not stand still."""

    # The same for all -----------------------------------------------------------------------------------------------

    async def carry_through(self) -> _Look:
        """
        Return when the device stands still.

        A cancellation takes effect afterwards: an event loop that ends cancels every task, and this one matters most
        then.

        Raises:
            AnswerTimeoutError, CommandRejectedError, UnexpectedAnswerError, ConnectionLostError: The stop was not
                acknowledged.
            MoveTimeoutError: It was acknowledged, but the device goes on.
        """
        cancelled: asyncio.CancelledError | None = None
        while True:
            try:
                await self._until_acknowledged()
                look = await self._until_standstill()
                break
            except asyncio.CancelledError as error:
                cancelled = error
                self._reply = self._send()
        if cancelled is not None:
            raise cancelled
        return look

    async def _until_acknowledged(self) -> None:
        """Repeat the stop until the device acknowledges it: it does no harm when it comes twice."""
        give_up_at = self._loop.time() + self._stop_timeout_s
        self._warn_if_lost()
        while True:
            try:
                failure = await self._refusal(await self._answer(give_up_at), give_up_at)
            except CompaxError as error:
                if self._link.is_over:
                    raise
                failure = error
            if failure is None:
                return
            if self._loop.time() >= give_up_at:
                raise self._told(failure)
            await asyncio.sleep(_PAUSE_S)
            self._reply = self._send()

    def _warn_if_lost(self) -> None:
        if not self._link.is_open:
            self._log.warning(
                "%s: %s waits for the line, which is lost, at most %g s; use the emergency stop if that is too long",
                self._name,
                self._word,
                self._stop_timeout_s,
            )

    def _told(self, failure: CompaxError) -> CompaxError:
        failure.what = f"{self._word} was not acknowledged: {failure.what}"
        failure.hint = self._hint(failure) or failure.hint
        return failure

    async def _answer(self, give_up_at: float) -> TurnOver:
        """Await the answer to the stop; while the line is lost, no longer than until *give_up_at*."""
        await asyncio.wait([self._reply], timeout=max(give_up_at - self._loop.time(), 0.0))
        while not self._reply.done() and self._link.is_open:  # its last answer is coming, or the line is lost meanwhile
            await asyncio.wait([self._reply], timeout=_PAUSE_S)
        if not self._reply.done():
            self._reply.cancel()
            raise ConnectionLostError("the line is lost", device=self._name, exchanges=self._link.recent())
        return await self._reply

    async def _until_standstill(self) -> _Look:
        give_up_at = self._loop.time() + self._standstill_timeout_s
        while True:
            try:
                async with asyncio.timeout_at(max(give_up_at, self._loop.time() + self._answer_timeout_s)):
                    look = await self._look()
            except TimeoutError:
                raise self._nothing_heard() from None
            except CompaxError:
                # One answer lost is no reason to give up a stop that was acknowledged.
                if self._link.is_over or self._loop.time() >= give_up_at:
                    raise
                await asyncio.sleep(_PAUSE_S)
                continue
            if self._stands(look):
                return look
            if self._loop.time() >= give_up_at:
                raise self._still_moving(look)
            await asyncio.sleep(_PAUSE_S)

    def _nothing_heard(self) -> AnswerTimeoutError:
        return AnswerTimeoutError(
            f"{self._word} was acknowledged, but for {self._standstill_timeout_s:g} s the device has not said whether "
            "it stands",
            device=self._name,
            sent=self._text,
            hint="look at the machine; use the emergency stop if it moves",
            exchanges=self._link.recent(),
        )
