"""The errors that a move ends with: what happened, where the axis is, what to do next."""

from __future__ import annotations

from ..errors import (
    CompaxError,
    ConnectionLostError,
    DriveFaultError,
    MoveActiveError,
    MoveError,
    MoveInDoubtError,
    MoveStoppedError,
    MoveTimeoutError,
)
from .facts.device_errors import DeviceError
from .moves import Move, PreparedMove
from .observer import Look, Observer
from .vocabulary import MovePlan

__all__ = ["Reports"]


class Reports:
    """Writes the errors of one drive's moves."""

    def __init__(self, name: str, observer: Observer) -> None:
        self._name = name
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

    def running(self, move: Move, what: str) -> MoveActiveError:
        """Report what was not sent because *move* runs."""
        return MoveActiveError(
            f"{move.plan.description} is running, so {what} was not sent",
            device=self._name,
            hint="await it or stop it first; the drive would answer E92 (UG p. 162, 209)",
        )

    def refused_in_doubt(self, what: str, doubt: str) -> MoveInDoubtError:
        """Report what was not sent because something before it is in doubt."""
        return MoveInDoubtError(
            f"{what} was not sent, for {doubt}", device=self._name, hint="look at the machine, then call reconcile()"
        )

    def not_ready(self, move: PreparedMove) -> MoveError:
        """Report a move that cannot be triggered."""
        is_too_late = move.readiness.done()
        why = "it has been triggered or has ended" if is_too_late else "the drive does not hold it ready yet"
        return MoveError(
            f"{move.plan.description} was not triggered: {why}", device=self._name, hint="await move.ready before"
        )

    def withdrawn(self, move: Move) -> MoveStoppedError:
        """Report a move that was stopped before its motion was sent."""
        return MoveStoppedError(f"{move.plan.description} was stopped before it was sent", device=self._name)

    def taken_back(self, text: str) -> MoveStoppedError:
        """Report a line that was to start a motion, and that a stop has kept from being sent."""
        return MoveStoppedError(f"{text!r} was stopped before it was sent", device=self._name)

    def unwatched(self, move: Move) -> ConnectionLostError:
        """Report a move that goes on although nobody watches it any more, as was asked for."""
        return ConnectionLostError(
            f"the line was closed; {move.plan.description} goes on unwatched", device=self._name, sent=move.sent
        )

    def stopped(self, move: Move, look: Look) -> MoveStoppedError:
        """Report a move that was stopped from here."""
        return MoveStoppedError(
            f"{move.plan.description} was stopped at {self._observer.written(look.position)}",
            device=self._name,
            sent=move.sent,
            received=look.as_sent,
            hint="command a new move when you want to go on",
        )

    def moved_by_others(self, move: Move, look: Look) -> MoveActiveError:
        """Report a move that was not sent because the axis moves already."""
        return MoveActiveError(
            f"somebody else moves this drive, so {move.plan.description} was not sent",
            device=self._name,
            received=look.as_sent,
            hint="wait or stop() first; the drive would answer E92 (UG p. 162, 209)",
        )

    def stopped_by_others(self, move: Move, look: Look) -> MoveStoppedError:
        """Report a move that somebody else has stopped."""
        by = "by input I6" if look.status.stopped_by_input else "by somebody else"
        return MoveStoppedError(
            f"{move.plan.description} was stopped {by} at {self._observer.written(look.position)}",
            device=self._name,
            sent=move.sent,
            received=look.as_sent,
            hint="find out who stopped it before you command it again",
        )

    def not_arrived(self, move: Move, look: Look) -> MoveTimeoutError:
        """Report a move after which the drive stands still, elsewhere, and gives no reason."""
        return MoveTimeoutError(
            f"{move.plan.description} ended at {self._observer.written(look.position)}, not at its target",
            device=self._name,
            sent=move.sent,
            received=look.as_sent,
            hint="the drive acknowledged it and stands still; does P20 make it keep quiet about errors?",
        )

    def stalled(self, move: Move, look: Look, seconds: float) -> MoveTimeoutError:
        """Report a move whose axis stands still although its command is active."""
        return MoveTimeoutError(
            f"{move.plan.description} stood still at {self._observer.written(look.position)} for {seconds:g} s "
            "with its command active, and was stopped",
            device=self._name,
            sent=move.sent,
            received=look.as_sent,
            hint="find out what holds the axis; a longer stall_timeout_s waits longer",
        )

    def out_of_time(self, move: Move, timeout_s: float) -> MoveTimeoutError:
        """Report a move whose budget is used up."""
        done = "was stopped" if move.is_on_wire else "was not sent"
        return MoveTimeoutError(
            f"{move.plan.description} was not at its target within {timeout_s:g} s and {done}",
            device=self._name,
            sent=move.sent,
            hint="give it more time, or find out what holds it",
        )

    def fault(self, move: Move, look: Look, error: DeviceError | None) -> DriveFaultError:
        """Report a move that a fault has ended."""
        which = f"E{error.code}, {error.meaning}" if error else "the drive does not say which"
        what = f"a fault {'ended' if move.is_on_wire else 'forbids'} {move.plan.description}"
        return DriveFaultError(
            f"{what} at {self._observer.written(look.position)}: {which}",
            device=self._name,
            sent=move.sent,
            received=look.as_sent,
            hint=error.remedy if error else "read error_history(), mend the cause, then quit()",
            code=error.code if error else None,
            exchanges=self._observer.line.link.recent(),
        )

    def in_doubt(self, move: Move, why: str, cause: CompaxError | None) -> MoveInDoubtError:
        """Report a move of which nobody can say what became of it."""
        error = MoveInDoubtError(
            f"what became of {move.plan.description} is in doubt: {why}",
            device=self._name,
            sent=move.sent,
            received=cause.received if cause is not None else None,
            hint="look at the machine, then call reconcile(); until then this drive takes no motion from here",
            exchanges=self._observer.line.link.recent(),
        )
        error.__cause__ = cause
        return error
