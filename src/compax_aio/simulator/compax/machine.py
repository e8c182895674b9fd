"""The drive behind its port: carries out instructions, moves the axis, tells what happens."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from typing import Final

from compax_aio.compax.facts.device_errors import FAULT_CODES
from compax_aio.compax.facts.limits import MAX_PREPARED_POINTS
from compax_aio.compax.facts.line import POSITION_REACHED_SIGN

from . import language as say
from .axis import Axis, Comparator, ComparatorPassed, Move, MoveEnded, Outcome
from .faults import FaultMemory
from .knobs import Knobs
from .log import Log, LogKind
from .motion import SpeedStep, ramp
from .refusals import FAULTED, MOVE_ACTIVE, POINTS_FULL, POWER_OFF, TRAVEL, RefusedError

__all__ = ["Machine", "Message", "MessageKind"]

_ENDINGS: Final = {
    Outcome.REACHED: LogKind.MOTION_REACHED,
    Outcome.STOPPED: LogKind.MOTION_STOPPED,
    Outcome.BROKEN: LogKind.MOTION_STOPPED,
    Outcome.FAULT: LogKind.MOTION_FAULT,
}


class MessageKind(Enum):
    """What the drive says unasked."""

    POSITION_REACHED = "$"
    COMPARATOR = "n"


@dataclass(frozen=True, slots=True)
class Message:
    """Something to be said unasked."""

    kind: MessageKind
    text: str


class Machine:
    """Everything of one drive but its port; time only goes forward."""

    def __init__(self, knobs: Knobs, log: Log) -> None:
        self.knobs = knobs
        self.log = log
        self.axis = Axis(knobs.position, knobs.following_error_factor)
        self.faults = FaultMemory()
        self.homed = knobs.homed
        self.target = knobs.position
        self.outputs = dict.fromkeys(range(1, 17), False)
        self.power_mode = 0
        """Set with OUTPUT O0: 0 energised, 1 off with the brake closed, 2 off with the brake open."""
        self.password = False
        self.service_password = False
        self.position_reached = False
        self.idle_after_stop = False
        self.cycles = 0
        self._zero = 0.0 if knobs.homed else knobs.position + knobs.machine_zero
        self._self_test_until = 0.0
        self._stopped: Move | None = None
        self._continues = False
        self._points: list[say.PreparedSpeed | say.PreparedOutput] = []
        self.speed_percent = knobs.speed_percent
        self.acceleration_ms = knobs.acceleration_ms
        self.deceleration_ms: int | None = None

    # What it shows

    @property
    def moving(self) -> bool:
        """Whether a positioning runs, stop ramps included."""
        return self.axis.move is not None

    @property
    def energised(self) -> bool:
        """Whether the motor has current: not switched off, neither by OUTPUT O0 nor by a fault."""
        return self.power_mode == 0 and (self.faults.fault is None or self.moving)

    def is_ready(self, now: float) -> bool:
        """Whether there is no fault and the self-test is over."""
        return self.faults.fault is None and now >= self._self_test_until

    @property
    def prepared_points(self) -> int:
        """How many speed steps and comparators wait for the next positioning."""
        return len(self._points)

    # What is done to it

    def execute(self, instruction: say.Instruction, reports: bool, now: float) -> None:
        """
        Carry out a command.

        Raises:
            RefusedError: It is not possible now.
        """
        match instruction:
            case say.MoveTo(target):
                self._move("POSA", target, reports, now)
            case say.MoveBy(distance):
                self._move("POSR", self.axis.setpoint(now) + distance, reports, now)
            case say.MoveHome():
                self._move("POSA HOME", self._zero, reports, now)
            case say.Stop():
                self._stop(Outcome.STOPPED, now)
            case say.Break():
                self._stop(Outcome.BROKEN, now)
            case say.Start():
                self._start(now)
            case _:
                self._set(instruction, now)

    def raise_fault(self, code: int, now: float) -> None:
        """Let a fault (E1-E57) or a warning (above) come."""
        self.faults.came(code)
        self.log.add(now, LogKind.FAULT, f"E{code:02d}")
        if code in FAULT_CODES:
            self._stop(Outcome.FAULT, now)

    def power_off(self, now: float) -> None:
        """Take the power away: the axis stands, and what is not kept is forgotten."""
        self.log.add(now, LogKind.POWER, "off")
        if ended := self.axis.freeze(now):
            self._ended(ended, now)

    def power_on(self, now: float) -> None:
        """Give the power back: the position is not known any more, settings are those of P2 and P6."""
        self.log.add(now, LogKind.POWER, "on")
        self.faults.powered_on()
        self._zero -= self.axis.position(now)
        self.axis.put(0.0)
        self.target = 0.0
        self.homed = self.position_reached = self.idle_after_stop = False
        self.password = self.service_password = False
        self.outputs = dict.fromkeys(self.outputs, False)
        self.power_mode = 0
        self._self_test_until = now + self.knobs.self_test_s
        self._default_settings()

    # What comes by itself

    def next_event_at(self) -> float | None:
        """Return when something happens by itself next."""
        return self.axis.next_event_at()

    def step(self, now: float) -> Message | None:
        """Let the next event, which must be due, happen; return what is to be said about it."""
        event = self.axis.step()
        if isinstance(event, MoveEnded):
            return self._ended(event, now)
        return self._passed(event, now)

    def _passed(self, event: ComparatorPassed, now: float) -> Message | None:
        comparator = event.comparator
        self._set_output(comparator.output, comparator.value, now)
        move = self.axis.move
        assert move is not None
        if self.knobs.comparator_messages == "with_sign" and not move.signed:
            return None
        return Message(MessageKind.COMPARATOR, str(comparator.number))

    def _ended(self, event: MoveEnded, now: float) -> Message | None:
        move, reached = event.move, event.outcome is Outcome.REACHED
        if reached:
            self.position_reached = True
            if move.homing:
                self._home_found()
        self.idle_after_stop = event.outcome in {Outcome.STOPPED, Outcome.BROKEN}
        self.log.add(now, _ENDINGS[event.outcome], self._written(self.axis.position(now)))
        says = move.reports and (reached or self.knobs.position_reached_on_stop)
        if event.outcome is Outcome.STOPPED:
            self._stopped = replace(move, reports=move.reports and not says)
        if self._continues:
            self._start(now)
        return Message(MessageKind.POSITION_REACHED, POSITION_REACHED_SIGN) if says else None

    def _home_found(self) -> None:
        self._zero = self.target = 0.0
        self.axis.put(0.0)
        self.homed = True

    # Positioning

    def _move(self, word: str, target: float, reports: bool, now: float) -> None:
        if not self.is_ready(now):
            raise RefusedError(FAULTED)
        if self.moving:
            raise RefusedError(MOVE_ACTIVE)
        if self.power_mode != 0:
            raise RefusedError(POWER_OFF)
        homing = word == "POSA HOME"
        if not homing and not self.knobs.travel_min <= target <= self.knobs.travel_max:
            raise RefusedError(TRAVEL)
        # Preparatory commands are cancelled by finding machine zero (UG p. 101).
        steps, comparators = ((), ()) if homing else self._taken_points()
        self._points.clear()
        nominal = self.knobs.nominal_speed
        braking_ms = self.acceleration_ms if self.deceleration_ms is None else self.deceleration_ms
        move = Move(
            word=word,
            origin=self.axis.setpoint(now),
            target=target,
            speed=nominal * self.speed_percent / 100,
            acceleration=ramp(nominal, self.acceleration_ms),
            deceleration=ramp(nominal, braking_ms),
            steps=steps,
            comparators=comparators,
            signed=reports,
            reports=reports and (self.knobs.position_reached_on_home or not homing),
            homing=homing,
        )
        self.target = target
        self.cycles += 1
        if homing:
            self.homed = False
        self._run(move, LogKind.MOTION_STARTED, now)

    def _run(self, move: Move, kind: LogKind, now: float) -> None:
        self._stopped = None
        self._continues = False
        self.position_reached = self.idle_after_stop = False
        self.log.add(now, kind, f"{move.word} {self._written(move.target)}")
        self.axis.start(move, now)

    def _prepare(self, point: say.PreparedSpeed | say.PreparedOutput) -> None:
        if len(self._points) >= MAX_PREPARED_POINTS:
            raise RefusedError(POINTS_FULL)
        self._points.append(point)

    def _taken_points(self) -> tuple[tuple[SpeedStep, ...], tuple[Comparator, ...]]:
        """Turn the prepared points into steps and comparators, the latter numbered in programming order."""
        steps: list[SpeedStep] = []
        comparators: list[Comparator] = []
        for place, point in enumerate(self._points, 1):
            if isinstance(point, say.PreparedSpeed):
                steps.append(SpeedStep(point.distance, self.knobs.nominal_speed * point.percent / 100))
            else:
                number = place if self.knobs.comparator_numbering == "points" else len(comparators) + 1
                comparators.append(Comparator(number, point.distance, point.output, point.value))
        return tuple(steps), tuple(comparators)

    def _stop(self, outcome: Outcome, now: float) -> None:
        # BREAK and faults also end what STOP has stopped; a fault is not made milder by a later STOP.
        self._continues = False
        if outcome is not Outcome.STOPPED:
            self._stopped = None
        if self.axis.outcome is Outcome.FAULT or (self.axis.outcome is Outcome.BROKEN and outcome is Outcome.STOPPED):
            return
        self.axis.stop(now, ramp(self.knobs.nominal_speed, self.knobs.stop_ramp_ms), outcome)

    def _start(self, now: float) -> None:
        # Without a stopped positioning START goes to the program memory, where N001 holds END (UG p. 162).
        if self.moving:
            self._continues = self.axis.outcome is Outcome.STOPPED
        elif self._stopped is not None:
            if self.power_mode != 0:
                raise RefusedError(POWER_OFF)
            self._run(self._stopped, LogKind.MOTION_CONTINUED, now)

    # The rest

    def _set(self, instruction: say.Instruction, now: float) -> None:
        match instruction:
            case say.PreparedSpeed() | say.PreparedOutput():
                self._prepare(instruction)
            case say.Speed(percent):
                self.speed_percent = percent
            case say.Acceleration(time_ms):
                self.acceleration_ms = time_ms
            case say.Deceleration(time_ms):
                self.deceleration_ms = time_ms
            case say.Outputs(first, values):
                for number, value in enumerate(values, first):
                    self._set_output(number, value, now)
            case say.Power(mode):
                self._set_power(mode, now)
            case say.Password(number):
                self._set_password(number)
            case say.Quit():
                self._quit(now)
            case _:  # an empty line does nothing
                pass

    def _default_settings(self) -> None:
        self.speed_percent = self.knobs.speed_percent
        self.acceleration_ms = self.knobs.acceleration_ms
        self.deceleration_ms = None
        self._points.clear()
        self._stopped = None
        self._continues = False

    def _quit(self, now: float) -> None:
        if self.faults.present is not None:
            self.faults.acknowledged()
            self.log.add(now, LogKind.QUIT)

    def _set_output(self, number: int, value: bool, now: float) -> None:
        self.outputs[number] = value
        self.log.add(now, LogKind.OUTPUT, f"O{number}={value:d}")

    def _set_power(self, mode: int, now: float) -> None:
        if self.moving:
            raise RefusedError(MOVE_ACTIVE)
        self.power_mode = mode
        self.log.add(now, LogKind.OUTPUT, f"O0={mode}")

    def _set_password(self, number: int) -> None:
        if number == 270:
            self.password = self.service_password = False
        elif number == 302:
            self.password = True
        else:
            self.service_password = True

    def _written(self, position: float) -> str:
        return f"{round(position, self.knobs.decimals) + 0.0:.{self.knobs.decimals}f}"
