"""The errors that a motion of an axis ends with: what happened, where the axis is, what to do next."""

from __future__ import annotations

from typing import TypeVar

from ..errors import CompaxError, MoveActiveError, MoveError, MoveStoppedError, MoveTimeoutError
from ..motion.reports import MoveReports
from .moves import AxisMove
from .observer import Look, Observer

__all__ = ["AxisReports"]

_Error = TypeVar("_Error", bound=MoveError)


class AxisReports(MoveReports):
    """
    Writes the errors of one axis's moves.

    Args:
        observer: Of the axis.
    """

    def __init__(self, observer: Observer) -> None:
        super().__init__(
            observer.name,
            observer.line.link,
            noun="axis",
            while_running="await it or stop it first; the axis would hold the new one back, and the whole line with it "
            "(DCB p. 27)",
        )
        self._observer = observer

    def no_reference(self, what: str, why: str) -> MoveError:
        """Report a move to a position that counts from nobody knows where."""
        return MoveError(
            f"{what} was not sent, for its position means nothing: {why}",
            device=self._name,
            hint="home() it, or set_origin() where it is; reconcile() takes the count as it is",
        )

    def moved_by_others(self, move: AxisMove, look: Look) -> MoveActiveError:
        """Report a move that was not sent because the axis moves already."""
        return MoveActiveError(
            f"somebody else moves this axis, so {move.description} was not sent",
            device=self._name,
            received=look.as_sent,
            hint="a jog input, a program or another host may do so; wait, or stop() first",
        )

    def damaged(self, holds: tuple[str, ...]) -> MoveStoppedError:
        """Report a command that was damaged on the line, so that the axis may have begun another motion."""
        return MoveStoppedError(
            "a command to this axis was damaged on the line; it may have executed "
            f"{' or '.join(map(repr, holds))} instead (DCB p. 27), and was stopped",
            device=self._name,
            hint="no motion was sent again; read position(), and command it anew when the line is sound",
            exchanges=self._observer.line.link.recent(),
        )

    def speed_in_doubt(self, move: AxisMove, cause: CompaxError) -> MoveStoppedError:
        """Report a run whose new speed may have been taken or not."""
        error = MoveStoppedError(
            f"{move.description} was stopped, for its new speed may have been taken or not: {cause.what}",
            device=self._name,
            sent=cause.sent,
            received=cause.received,
            hint="run it again when the line is sound",
            exchanges=self._observer.line.link.recent(),
        )
        error.__cause__ = cause
        return error

    def cut_off(self, why: str) -> MoveStoppedError:
        """Report a motion that was ended without a ramp."""
        return MoveStoppedError(
            why,
            device=self._name,
            hint="a motor that was fast may have lost steps, and its position shows nothing of it: home() it",
        )

    def stopped(self, move: AxisMove, look: Look) -> MoveStoppedError:
        """Report a move that was stopped from here."""
        what = f"{move.description} was stopped at {self._observer.written(look.position)}"
        hint = self._doubtful_count() or "command a new move when you want to go on"
        return self._seen(MoveStoppedError, what, move, look, hint)

    def ended_elsewhere(self, move: AxisMove, look: Look) -> MoveStoppedError:
        """Report a move after which the axis stands, but not where it should."""
        what = f"{move.description} ended at {self._observer.written(look.position)}, and nobody here has stopped it"
        hint = self._doubtful_count() or "a limit, another host, or abort_all() may have stopped it: read limits()"
        return self._seen(MoveStoppedError, what, move, look, hint)

    def no_home(self, move: AxisMove, look: Look) -> MoveStoppedError:
        """Report a search for home after which the home input is not active."""
        what = f"{move.description} ended at {self._observer.written(look.position)}, and the home input is not active"
        hint = "which bit it is, and what its level means, are in the profile (home_query, home_bit)"
        return self._seen(MoveStoppedError, what, move, look, hint)

    def not_settled(self, move: AxisMove, look: Look, seconds: float) -> MoveTimeoutError:
        """Report an axis that stands, and goes on saying that it homes, hunts or ramps."""
        what = (
            f"{move.description}: for {seconds:g} s the axis has stood at {self._observer.written(look.position)} "
            "without settling, and was stopped"
        )
        hint = "is it an encoder that cannot reach its dead band? A longer standstill_timeout_s waits longer"
        return self._seen(MoveTimeoutError, what, move, look, hint)

    def stalled(self, move: AxisMove, look: Look, seconds: float) -> MoveTimeoutError:
        """Report an axis that says it moves, and is always at the same position."""
        what = (
            f"{move.description}: for {seconds:g} s the axis has said that it moves, and that it is at "
            f"{self._observer.written(look.position)}; it was stopped"
        )
        hint = "find out what holds it; a longer stall_timeout_s waits longer"
        return self._seen(MoveTimeoutError, what, move, look, hint)

    def _seen(self, kind: type[_Error], what: str, move: AxisMove, look: Look, hint: str) -> _Error:
        """Report what a look has shown of a move."""
        return kind(what, device=self._name, sent=move.sent, received=look.as_sent, hint=hint)

    def _doubtful_count(self) -> str | None:
        why = self._observer.lost_reference
        return None if why is None else f"its position means nothing: {why}; look at the machine, and home() it"
