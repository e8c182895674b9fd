"""The errors that any device's move can end with, or that keep one from being sent."""

from __future__ import annotations

from ..errors import (
    CompaxError,
    ConnectionLostError,
    MoveActiveError,
    MoveInDoubtError,
    MoveStoppedError,
    MoveTimeoutError,
)
from ..link.link import Link
from .moves import MoveFuture

__all__ = ["MoveReports"]


class MoveReports:
    """
    Writes the errors of the moves of one drive or axis, as far as they are those of any.

    Args:
        name: Of the drive or axis.
        link: Its line.
        noun: What people call it.
        while_running: What to do about a second move.
    """

    def __init__(
        self,
        name: str,
        link: Link,
        *,
        noun: str = "drive",
        while_running: str = "await it or stop it first",
    ) -> None:
        self._name = name
        self._link = link
        self._noun = noun
        self._while_running = while_running

    def running(self, move: MoveFuture, what: str) -> MoveActiveError:
        """Report what was not sent because *move* runs."""
        return MoveActiveError(
            f"{move.description} is running, so {what} was not sent", device=self._name, hint=self._while_running
        )

    def refused_in_doubt(self, what: str, doubt: str) -> MoveInDoubtError:
        """Report what was not sent because something before it is in doubt."""
        return MoveInDoubtError(
            f"{what} was not sent, for {doubt}", device=self._name, hint="look at the machine, then call reconcile()"
        )

    def withdrawn(self, move: MoveFuture) -> MoveStoppedError:
        """Report a move that was stopped before its motion was sent."""
        return MoveStoppedError(f"{move.description} was stopped before it was sent", device=self._name)

    def taken_back(self, text: str) -> MoveStoppedError:
        """Report a line that was to start a motion, and that a stop has kept from being sent."""
        return MoveStoppedError(f"{text!r} was stopped before it was sent", device=self._name)

    def unwatched(self, move: MoveFuture) -> ConnectionLostError:
        """Report a move that goes on although nobody watches it any more, as was asked for."""
        return ConnectionLostError(
            f"the line was closed; {move.description} goes on unwatched", device=self._name, sent=move.sent
        )

    def left_without_stop(self, why: str, remedy: str) -> MoveInDoubtError:
        """Report a line that was closed while not even a stop should be sent on it."""
        return MoveInDoubtError(f"the line was closed without a stop, for {why}", device=self._name, hint=remedy)

    def defect(self, move: MoveFuture, defect: Exception) -> MoveStoppedError:
        """Report a move whose watching ended by an exception that nobody has foreseen."""
        error = MoveStoppedError(
            f"{move.description} was not watched any more, and was stopped: {type(defect).__name__}: {defect}",
            device=self._name,
            sent=move.sent,
            hint="that is a defect of this library: please report it with its traceback",
            exchanges=self._link.recent(),
        )
        error.__cause__ = defect
        return error

    def out_of_time(self, move: MoveFuture, timeout_s: float) -> MoveTimeoutError:
        """Report a move whose budget is used up."""
        done = "was stopped" if move.is_on_wire else "was not sent"
        return MoveTimeoutError(
            f"{move.description} was not at its target within {timeout_s:g} s and {done}",
            device=self._name,
            sent=move.sent,
            hint="give it more time, or find out what holds it",
        )

    def in_doubt(self, move: MoveFuture, why: str, cause: CompaxError | None) -> MoveInDoubtError:
        """Report a move of which nobody can say what became of it."""
        error = MoveInDoubtError(
            f"what became of {move.description} is in doubt: {why}",
            device=self._name,
            sent=move.sent,
            received=cause.received if cause is not None else None,
            hint=f"look at the machine, then call reconcile(); until then this {self._noun} takes no motion from here",
            exchanges=self._link.recent(),
        )
        error.__cause__ = cause
        return error

    @property
    def hint_when_unknown(self) -> str:
        """What to do where nobody can say what became of a line that starts a motion."""
        return f"look at the machine, then call reconcile(); this {self._noun} takes no motion until then"
