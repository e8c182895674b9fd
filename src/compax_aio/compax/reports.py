"""The errors that a move of a drive ends with: what happened, where the axis is, what to do next."""

from __future__ import annotations

from ..errors import (
    DriveFaultError,
    MoveActiveError,
    MoveError,
    MoveStoppedError,
    MoveTimeoutError,
)
from ..motion.reports import MoveReports
from .facts.device_errors import DeviceError
from .moves import Move, PreparedMove
from .observer import Look, Observer
from .vocabulary import MovePlan

__all__ = ["Reports"]


class Reports(MoveReports):
    """Writes the errors of one drive's moves."""

    def __init__(self, name: str, observer: Observer) -> None:
        super().__init__(
            name,
            observer.line.link,
            while_running="await it or stop it first; the drive would answer E92 (UG p. 162, 209)",
        )
        self._observer = observer

    def speed_unknown(self, plan: MovePlan) -> MoveError:
        """Report a move that names no speed, where nobody knows the one in force."""
        return MoveError(
            f"{plan.description} was not sent: a binary motion was cut, and may have changed the speed in force",
            device=self._name,
            hint="give the move its speed_percent",
        )

    def points_left(self, plan: MovePlan, points: int) -> MoveError:
        """Report a move on which speed steps or comparators of an earlier one would act."""
        return MoveError(
            f"{plan.description} was not sent: the drive still holds {points} speed steps or comparators of a move "
            "that was not started, and they would act on this one",
            device=self._name,
            hint="home() cancels them (UG p. 101)",
        )

    def not_ready(self, move: PreparedMove) -> MoveError:
        """Report a move that cannot be triggered."""
        is_too_late = move.readiness.done()
        why = "it has been triggered or has ended" if is_too_late else "the drive does not hold it ready yet"
        return MoveError(
            f"{move.description} was not triggered: {why}", device=self._name, hint="await move.ready before"
        )

    def stopped(self, move: Move, look: Look) -> MoveStoppedError:
        """Report a move that was stopped from here."""
        return MoveStoppedError(
            f"{move.description} was stopped at {self._observer.written(look.position)}",
            device=self._name,
            sent=move.sent,
            received=look.as_sent,
            hint="command a new move when you want to go on",
        )

    def moved_by_others(self, move: Move, look: Look) -> MoveActiveError:
        """Report a move that was not sent because the axis moves already."""
        return MoveActiveError(
            f"somebody else moves this drive, so {move.description} was not sent",
            device=self._name,
            received=look.as_sent,
            hint="wait or stop() first; the drive would answer E92 (UG p. 162, 209)",
        )

    def stopped_by_others(self, move: Move, look: Look) -> MoveStoppedError:
        """Report a move that somebody else has stopped."""
        by = "by input I6" if look.status.stopped_by_input else "by somebody else"
        return MoveStoppedError(
            f"{move.description} was stopped {by} at {self._observer.written(look.position)}",
            device=self._name,
            sent=move.sent,
            received=look.as_sent,
            hint="find out who stopped it before you command it again",
        )

    def not_arrived(self, move: Move, look: Look) -> MoveTimeoutError:
        """Report a move after which the drive stands still, elsewhere, and gives no reason."""
        return MoveTimeoutError(
            f"{move.description} ended at {self._observer.written(look.position)}, not at its target",
            device=self._name,
            sent=move.sent,
            received=look.as_sent,
            hint="the drive acknowledged it and stands still; does P20 make it keep quiet about errors?",
        )

    def stalled(self, move: Move, look: Look, seconds: float) -> MoveTimeoutError:
        """Report a move whose axis stands still although its command is active."""
        return MoveTimeoutError(
            f"{move.description} stood still at {self._observer.written(look.position)} for {seconds:g} s "
            "with its command active, and was stopped",
            device=self._name,
            sent=move.sent,
            received=look.as_sent,
            hint="find out what holds the axis; a longer stall_timeout_s waits longer",
        )

    def fault(self, move: Move, look: Look, error: DeviceError | None) -> DriveFaultError:
        """Report a move that a fault has ended."""
        which = f"E{error.code}, {error.meaning}" if error else "the drive does not say which"
        what = f"a fault {'ended' if move.is_on_wire else 'forbids'} {move.description}"
        return DriveFaultError(
            f"{what} at {self._observer.written(look.position)}: {which}",
            device=self._name,
            sent=move.sent,
            received=look.as_sent,
            hint=error.remedy if error else "read error_history(), mend the cause, then quit()",
            code=error.code if error else None,
            exchanges=self._link.recent(),
        )
