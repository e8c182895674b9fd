"""Stopping one drive: STOP until it is acknowledged, then looking until the axis stands still."""

from __future__ import annotations

import asyncio
import logging
from typing import Final

from ..errors import CommandRejectedError, CompaxError, ConnectionLostError, MoveTimeoutError
from ..link.contract import Lane, TurnOver
from ..motion.stopping import Stopping
from .observer import Look, Observer
from .protocol import Acknowledged

__all__ = ["Stop"]

_log = logging.getLogger("compax_aio.compax")

_HINT_WHEN_LOST: Final = "the axis may be moving: use the emergency stop"
_HINT: Final = (
    "the axis may be moving: use the emergency stop; the RS-232 word for STOP is on no page that was available "
    "(DriveSettings.dialect), so try it on a bench first"
)


class Stop(Stopping[Look]):
    """
    One stop of one drive; STOP is queued ahead of everything else when this is made.

    Args:
        observer: Of the drive.
    """

    def __init__(self, observer: Observer) -> None:
        self._observer = observer
        self._line = observer.line
        settings = observer.line.settings
        super().__init__(
            observer.line.name,
            observer.line.link,
            settings.dialect.stop,
            word="STOP",
            stop_timeout_s=settings.stop_timeout_s,
            standstill_timeout_s=settings.standstill_timeout_s,
            answer_timeout_s=settings.answer_timeout_s,
            log=_log,
        )

    def _send(self) -> asyncio.Future[TurnOver]:
        return self._line.exchange(self._line.settings.dialect.stop, Lane.STOP)

    async def _refusal(self, outcome: TurnOver, give_up_at: float) -> CompaxError | None:
        if isinstance(outcome, Acknowledged):
            return None
        error = self._line.error_of(self._text, outcome)
        is_rejected = isinstance(error, CommandRejectedError)
        return None if is_rejected and await self._has_nothing_to_stop(give_up_at) else error

    async def _has_nothing_to_stop(self, give_up_at: float) -> bool:
        try:
            async with asyncio.timeout_at(max(give_up_at, self._loop.time() + self._answer_timeout_s)):
                status = await self._observer.read_status()
        except TimeoutError:
            return False
        except CompaxError:
            if self._link.is_over:
                raise
            return False
        return not status.command_active and not status.program_running

    def _hint(self, failure: CompaxError) -> str | None:
        if isinstance(failure, ConnectionLostError):
            return _HINT_WHEN_LOST
        return _HINT if self._link.held is None else None

    async def _look(self) -> Look:
        return await self._observer.look()

    def _stands(self, look: Look) -> bool:
        status = look.status
        # A fault has a ramp of its own; without current nothing can be waited for.
        return not status.command_active or status.idle_after_stop or not (status.no_fault or status.running)

    def _still_moving(self, look: Look) -> MoveTimeoutError:
        return MoveTimeoutError(
            f"STOP was acknowledged, but {self._standstill_timeout_s:g} s later the drive's command is still active, "
            f"at {self._observer.written(look.position)}",
            device=self._name,
            sent=self._text,
            received=look.as_sent,
            hint="use the emergency stop if it moves; a long stop ramp (P10) wants more standstill_timeout_s",
        )
