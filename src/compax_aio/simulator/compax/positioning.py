"""Positionings: begun, changed on the way, stopped, continued and ended; and where positions are counted from."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from .axis import Axis, Move, MoveEnded, Outcome
from .knobs import Knobs
from .log import Log, LogKind
from .motion import ramp
from .parameters import Parameters
from .preparation import Preparation
from .refusals import MOVE_ACTIVE, NOT_MOVING, TRAVEL, RefusedError
from .zero import Zero

__all__ = ["Positioning"]

_ENDINGS: Final = {
    Outcome.REACHED: LogKind.MOTION_REACHED,
    Outcome.STOPPED: LogKind.MOTION_STOPPED,
    Outcome.BROKEN: LogKind.MOTION_STOPPED,
    Outcome.FAULT: LogKind.MOTION_FAULT,
}


class Positioning:
    """The axis with all that belongs to its positionings; time only goes forward."""

    def __init__(self, knobs: Knobs, log: Log, parameters: Parameters) -> None:
        self._knobs = knobs
        self._log = log
        self._parameters = parameters
        self.axis = Axis(knobs.position, knobs.following_error_factor)
        self.zero = Zero(self.axis, knobs)
        self.preparation = Preparation(knobs, parameters)
        self.target: float = knobs.position
        self.reached = False
        """S16 bit 5."""
        self.cycles: int = 0
        self.stopped: Move | None = None
        """What START continues."""
        self.continues = False
        """START has come on the stop ramp."""

    @property
    def moving(self) -> bool:
        """Whether a positioning runs, stop ramps included."""
        return self.axis.move is not None

    @property
    def braking_off(self) -> bool:
        """Whether the axis brakes before its target."""
        return self.moving and self.axis.outcome is not Outcome.REACHED

    def start(self, word: str, target: float, reports: bool, now: float) -> None:
        """
        Begin a positioning.

        Raises:
            RefusedError: One runs, or the target lies outside of the travel range.
        """
        if self.moving:
            raise RefusedError(MOVE_ACTIVE)
        homing = word == "POSA HOME"
        if not homing and not self._parameters[12] <= target <= self._parameters[11]:
            raise RefusedError(TRAVEL)
        move = self.preparation.move(word, self.axis.setpoint(now), target, reports)
        self.target = target
        self.cycles += 1
        self.zero.homed &= not homing
        self._run(move, LogKind.MOTION_STARTED, now)

    def go_on(self, now: float) -> None:
        """Continue what STOP has stopped."""
        assert self.stopped is not None
        self._run(self.stopped, LogKind.MOTION_CONTINUED, now)

    def change_speed(self, percent: float, now: float) -> None:
        """
        Let the positioning that runs go on at another speed; the name is known, the rest inferred (IBS p. 42).

        Raises:
            RefusedError: None runs that is going to end at its target, at once or after START.
        """
        if not self.moving or self.axis.outcome not in {Outcome.REACHED, Outcome.STOPPED}:
            raise RefusedError(NOT_MOVING)
        self.axis.change_speed(self._knobs.nominal_speed * percent / 100, now)
        self._log.add(now, LogKind.SPEED_CHANGED, f"{percent:g}")

    def stop(self, outcome: Outcome, now: float) -> None:
        """Brake with P10; BREAK and faults also end what STOP has stopped, and no later STOP makes them milder."""
        self.continues = False
        if outcome is not Outcome.STOPPED:
            self.stopped = None
        if self.axis.outcome is Outcome.FAULT or (self.axis.outcome is Outcome.BROKEN and outcome is Outcome.STOPPED):
            return
        self.axis.stop(now, ramp(self._knobs.nominal_speed, self._parameters[10]), outcome)

    def ended(self, event: MoveEnded, now: float) -> bool:
        """Take note that the axis stands; return whether ``$`` is to be sent."""
        move, self.reached = event.move, event.outcome is Outcome.REACHED
        if self.reached and move.homing:
            self.zero.found()
            self.target = self.axis.position(now)
        self._log.add(now, _ENDINGS[event.outcome], self._written(self.axis.position(now)))
        says = move.reports and (self.reached or self._knobs.position_reached_on_stop)
        if event.outcome is Outcome.STOPPED:
            self.stopped = replace(move, reports=move.reports and not says)
        self.follow_real_zero(now)
        return says

    def power_returns(self, now: float) -> None:
        """Begin again: the position is not known any more, settings are those of P2 and P6."""
        self.zero.lost(now)
        self.target = self.axis.position(now)
        self.reached = self.continues = False
        self.stopped = None
        self.preparation.forget()

    def put(self, position: float, machine_zero: float, *, homed: bool) -> None:
        """Take over where the axis and its machine zero are; P1 says where real zero is."""
        self.zero.placed(position, machine_zero, self._parameters[1], homed=homed)
        self.target = position

    def take_real_zero(self, now: float) -> None:
        """
        Let P1 be such that the axis stands at 0; what was prepared for another place is cancelled, a choice.

        Raises:
            RefusedError: The axis moves, or P1 does not take that value.
        """
        if self.moving:
            raise RefusedError(MOVE_ACTIVE)
        self._parameters.put(1, self._parameters[1] + self.axis.position(now))
        self.preparation.cancel_points()
        self.follow_real_zero(now)

    def follow_real_zero(self, now: float) -> None:
        """Count positions from where the valid P1 puts real zero, but not before the axis stands; that is a choice."""
        if self.moving:
            return
        shift = self.zero.shift_to(self._parameters[1], now)
        self.target -= shift
        if (move := self.stopped) is not None:
            self.stopped = replace(move, origin=move.origin - shift, target=move.target - shift)

    def _run(self, move: Move, kind: LogKind, now: float) -> None:
        self.stopped = None
        self.continues = self.reached = False
        self._log.add(now, kind, f"{move.word} {self._written(move.target)}")
        self.axis.start(move, now)

    def _written(self, position: float) -> str:
        decimals = self._parameters.decimals
        return f"{round(position, decimals) + 0.0:.{decimals}f}"
