"""Stopping one axis: the soft stop until it is acknowledged, then looking until the axis stands."""

from __future__ import annotations

import asyncio
import logging
from typing import Final

from ..errors import CompaxError, ConnectionLostError, MoveTimeoutError
from ..link.contract import Lane, TurnOver
from ..motion.stopping import Stopping
from .observer import Look, Observer
from .vocabulary import soft_stop

__all__ = ["Stop"]

_log = logging.getLogger("compax_aio.smc")

_HINT: Final = (
    "the axis may be moving: use the emergency stop; abort_all() is heard at any time, and stops every axis of the "
    "line without a ramp"
)


class Stop(Stopping[Look]):
    """
    One soft stop of one axis (``@``: panther, gem-controld); it is queued ahead of everything else when this is made.

    Args:
        observer: Of the axis.
    """

    def __init__(self, observer: Observer) -> None:
        self._observer = observer
        self._was_settled = False
        settings = observer.line.settings
        self._command = soft_stop(settings.profile)
        super().__init__(
            observer.name,
            observer.line.link,
            observer.axis + self._command,
            word="the soft stop",
            stop_timeout_s=settings.stop_timeout_s,
            standstill_timeout_s=settings.standstill_timeout_s,
            answer_timeout_s=settings.answer_timeout_s,
            log=_log,
        )

    def _send(self) -> asyncio.Future[TurnOver]:
        self._was_settled = False
        return self._observer.line.start(self._observer.axis, self._command, Lane.STOP)

    async def _refusal(self, outcome: TurnOver, give_up_at: float) -> CompaxError | None:  # noqa: ARG002
        return self._observer.line.refusal(self._observer.axis, self._command, outcome)

    def _hint(self, failure: CompaxError) -> str | None:
        return "the axis may be moving: use the emergency stop" if isinstance(failure, ConnectionLostError) else _HINT

    async def _look(self) -> Look:
        return await self._observer.look()

    def _stands(self, look: Look) -> bool:
        """Whether two looks in a row find it settled: between two ramps a status may show none."""
        was_settled, self._was_settled = self._was_settled, look.status.is_settled
        return was_settled and look.status.is_settled

    def _still_moving(self, look: Look) -> MoveTimeoutError:
        return MoveTimeoutError(
            f"the soft stop was acknowledged, but {self._standstill_timeout_s:g} s later the axis has not settled, at "
            f"{self._observer.written(look.position)}",
            device=self._name,
            sent=self._text,
            received=look.as_sent,
            hint=_HINT,
        )
