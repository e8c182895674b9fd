"""Stopping one drive: STOP until it is acknowledged, then looking until the axis stands still."""

from __future__ import annotations

import asyncio
import logging
from typing import Final

from ..errors import AnswerTimeoutError, CommandRejectedError, CompaxError, ConnectionLostError, MoveTimeoutError
from ..link.contract import Lane, TurnOver
from .observer import Look, Observer
from .protocol import Acknowledged

__all__ = ["Stop"]

_PAUSE_S: Final = 0.1

_log = logging.getLogger("compax_aio.compax")

_HINT_WHEN_LOST: Final = "the axis may be moving: use the emergency stop"
_HINT: Final = (
    "the axis may be moving: use the emergency stop; the RS-232 word for STOP is on no page that was available "
    "(DriveSettings.dialect), so try it on a bench first"
)


class Stop:
    """
    One stop of one drive; STOP is queued ahead of everything else when this is made.

    Args:
        observer: Of the drive.
    """

    def __init__(self, observer: Observer) -> None:
        self._observer = observer
        self._settings = observer.line.settings
        self._loop = asyncio.get_running_loop()
        self._reply = self._send()

    async def carry_through(self) -> Look:
        """
        Return when the drive stands still.

        A cancellation takes effect afterwards: an event loop that ends cancels every task, and this one matters most
        then.

        Raises:
            AnswerTimeoutError, CommandRejectedError, ConnectionLostError: STOP was not acknowledged.
            MoveTimeoutError: It was acknowledged, but the drive's command is still active.
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

    def _send(self) -> asyncio.Future[TurnOver]:
        return self._observer.line.exchange(self._settings.dialect.stop, Lane.STOP)

    async def _until_acknowledged(self) -> None:
        """Repeat STOP until the drive acknowledges it: it does no harm when it comes twice."""
        give_up_at = self._loop.time() + self._settings.stop_timeout_s
        self._warn_if_lost()
        while True:
            try:
                outcome = await self._answer(give_up_at)
            except CompaxError as error:
                if self._observer.line.link.is_over:
                    raise
                failure: CompaxError = error
            else:
                if isinstance(outcome, Acknowledged):
                    return
                failure = self._observer.line.error_of(self._settings.dialect.stop, outcome)
                if isinstance(failure, CommandRejectedError) and await self._has_nothing_to_stop(give_up_at):
                    return
            if self._loop.time() >= give_up_at:
                raise self._told(failure)
            await asyncio.sleep(_PAUSE_S)
            self._reply = self._send()

    def _warn_if_lost(self) -> None:
        if not self._observer.line.link.is_open:
            _log.warning(
                "%s: STOP waits for the line, which is lost, at most %g s; use the emergency stop if that is too long",
                self._observer.line.name,
                self._settings.stop_timeout_s,
            )

    def _told(self, failure: CompaxError) -> CompaxError:
        failure.what = f"STOP was not acknowledged: {failure.what}"
        if isinstance(failure, ConnectionLostError):
            failure.hint = _HINT_WHEN_LOST
        elif self._observer.line.link.held is None:
            failure.hint = _HINT
        return failure

    async def _answer(self, give_up_at: float) -> TurnOver:
        """Await the answer to STOP; while the line is lost, no longer than until *give_up_at*."""
        link = self._observer.line.link
        await asyncio.wait([self._reply], timeout=max(give_up_at - self._loop.time(), 0.0))
        while not self._reply.done() and link.is_open:  # its last answer is on the way, or the line is lost meanwhile
            await asyncio.wait([self._reply], timeout=_PAUSE_S)
        if not self._reply.done():
            self._reply.cancel()
            raise ConnectionLostError(
                "the line is lost",
                device=self._observer.line.name,
                exchanges=link.recent(),
            )
        return await self._reply

    async def _has_nothing_to_stop(self, give_up_at: float) -> bool:
        try:
            async with asyncio.timeout_at(max(give_up_at, self._loop.time() + self._settings.answer_timeout_s)):
                status = await self._observer.read_status()
        except TimeoutError:
            return False
        except CompaxError:
            if self._observer.line.link.is_over:
                raise
            return False
        return not status.command_active and not status.program_running

    async def _until_standstill(self) -> Look:
        give_up_at = self._loop.time() + self._settings.standstill_timeout_s
        while True:
            try:
                async with asyncio.timeout_at(max(give_up_at, self._loop.time() + self._settings.answer_timeout_s)):
                    look = await self._observer.look()
            except TimeoutError:
                raise self._nothing_heard() from None
            except CompaxError:
                # One answer lost is no reason to give up a stop that was acknowledged.
                if self._observer.line.link.is_over or self._loop.time() >= give_up_at:
                    raise
                await asyncio.sleep(_PAUSE_S)
                continue
            status = look.status
            # A fault has a ramp of its own; without current nothing can be waited for.
            if not status.command_active or status.idle_after_stop or not (status.no_fault or status.running):
                return look
            if self._loop.time() >= give_up_at:
                raise MoveTimeoutError(
                    f"STOP was acknowledged, but {self._settings.standstill_timeout_s:g} s later the drive's command "
                    f"is still active, at {self._observer.written(look.position)}",
                    device=self._observer.line.name,
                    sent=self._settings.dialect.stop,
                    received=look.as_sent,
                    hint="use the emergency stop if it moves; a long stop ramp (P10) wants more standstill_timeout_s",
                )
            await asyncio.sleep(_PAUSE_S)

    def _nothing_heard(self) -> AnswerTimeoutError:
        return AnswerTimeoutError(
            f"STOP was acknowledged, but for {self._settings.standstill_timeout_s:g} s the drive has not said whether "
            "it stands",
            device=self._observer.line.name,
            sent=self._settings.dialect.stop,
            hint="look at the machine; use the emergency stop if it moves",
            exchanges=self._observer.line.link.recent(),
        )
