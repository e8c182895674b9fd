"""The drive behind its port: carries out instructions, moves the axis, tells what happens."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from compax_aio.compax.facts.device_errors import FAULT_CODES
from compax_aio.compax.facts.line import POSITION_REACHED_SIGN

from . import instructions as say
from .axis import Axis, ComparatorPassed, MoveEnded, Outcome
from .faults import FaultMemory
from .inputs import Inputs
from .interpreter import Interpreter
from .knobs import Knobs
from .language import Context, calculated
from .log import Log, LogKind
from .parameters import CONTROL_PARAMETERS, Parameters
from .positioning import Positioning
from .preparation import Preparation
from .program import RECORDS, Memory
from .quantities import status_number
from .refusals import (
    FAULTED,
    MOVE_ACTIVE,
    NO_RECORD,
    NOT_SIMULATED,
    PASSWORD,
    POWER_OFF,
    PROGRAM_RUNS,
    Refusal,
    RefusedError,
)
from .state import Kept

__all__ = ["Machine", "Message", "MessageKind"]


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

    def __init__(self, knobs: Knobs, log: Log, name: str) -> None:
        self.knobs = knobs
        self.name = name
        self.log = log
        self.faults = FaultMemory()
        self.parameters = Parameters(knobs)
        self.positioning: Positioning = Positioning(knobs, log, self.parameters)
        self.axis: Axis = self.positioning.axis
        self.preparation: Preparation = self.positioning.preparation
        self.memory = Memory()
        self.program: Interpreter = Interpreter(self, self.memory, knobs.record_time_s)
        self.inputs = Inputs()
        self.outputs = dict.fromkeys(range(1, 17), False)
        self.power_mode = 0
        """Set with OUTPUT O0: 0 energised, 1 off with the brake closed, 2 off with the brake open."""
        self.password = False
        self.service_password = False
        self.idle_after_stop = False
        self._operated_before_s = 0.0
        self._self_test_until = 0.0

    # What it shows

    @property
    def moving(self) -> bool:
        """Whether a positioning runs, stop ramps included."""
        return self.positioning.moving

    @property
    def homed(self) -> bool:
        """Whether machine zero has been found."""
        return self.positioning.zero.homed

    @property
    def energised(self) -> bool:
        """Whether the motor has current: not switched off, neither by OUTPUT O0 nor by a fault."""
        return self.power_mode == 0 and (self.faults.fault is None or self.moving)

    def is_ready(self, now: float) -> bool:
        """Whether there is no fault and the self-test is over."""
        return self.faults.fault is None and now >= self._self_test_until

    @property
    def unit(self) -> str:
        """What positions are counted in, by P90."""
        return self.parameters.unit

    @property
    def decimals(self) -> int:
        """Of positions and distances."""
        return self.parameters.decimals

    @property
    def xonxoff(self) -> bool:
        """P20 bit 0."""
        return bool(int(self.parameters[20]) & 1)

    @property
    def binary(self) -> bool:
        """P20 bit 4: commands as frames, in addition to lines."""
        return bool(int(self.parameters[20]) & 16)

    @property
    def errors_suppressed(self) -> bool:
        """P20 bit 1: no error in the answer."""
        return bool(int(self.parameters[20]) & 2)

    def is_ready_for_start(self, now: float) -> bool:
        """Whether START would be heeded (CAN-S p. 28)."""
        return self.is_ready(now) and not self.moving and self.program.ready_for_start

    def context(self) -> Context:
        """Return what it takes to read a command now."""
        return Context(self.decimals, self.parameters.value, self.knobs.real_zero_word.replace(" ", ""))

    def operating_time_s(self, now: float) -> float:
        """Return how long it has been working."""
        return self._operated_before_s + now

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
                self._move("POSA HOME", self.positioning.zero.machine_zero, reports, now)
            case say.ChangeSpeed(percent):
                self.positioning.change_speed(percent, now)
            case say.Stop():
                self._stop(Outcome.STOPPED, now)
            case say.Break():
                self._stop(Outcome.BROKEN, now)
            case say.Start():
                self._start(now)
            case say.WriteRecord(record, text):
                self.memory.write(record, text, self.decimals)
            case say.SetPointer() | say.Single():
                self._choose_record(instruction, now)
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
        self.program.break_off(now)
        if ended := self.axis.freeze(now):
            self._ended(ended, now)

    def power_on(self, now: float) -> None:
        """Give the power back: the position is not known any more, settings are those of P2 and P6."""
        self.log.add(now, LogKind.POWER, "on")
        self.faults.powered_on()
        self.positioning.power_returns(now)
        self.idle_after_stop = False
        self.password = self.service_password = False
        self.outputs = dict.fromkeys(self.outputs, False)
        self.power_mode = 0
        self._self_test_until = now + self.knobs.self_test_s
        self.parameters.forget_written()

    # What is kept without power

    def kept(self, now: float) -> Kept:
        """Return what is kept if the power goes off now; also where the axis is, which a real drive forgets."""
        return Kept(
            parameters=self.parameters.changed,
            variables=self.parameters.changed_variables,
            program=self.memory.written,
            error_history=self.faults.history,
            error_present=self.faults.present is not None,
            position=self.axis.position(now),
            machine_zero=self.positioning.zero.machine_zero,
            homed=self.homed,
            cycles=self.positioning.cycles,
            operating_time_s=self.operating_time_s(now),
        )

    def put_back(self, kept: Kept, now: float) -> None:
        """Have been a drive that kept this; for one that has just got its power back."""
        self.parameters.replace(kept.parameters, kept.variables)
        self.memory.replace(kept.program)
        self.program.pointer = 1
        self.faults.remember(kept.error_history, unclosed=kept.error_present)
        self.positioning.put(kept.position, kept.machine_zero, homed=kept.homed)
        self.positioning.cycles = kept.cycles
        self._operated_before_s = kept.operating_time_s - now

    # What comes by itself

    def next_event_at(self) -> float | None:
        """Return when something happens by itself next."""
        axis_at, program_at = self.axis.next_event_at(), self.program.next_event_at()
        if axis_at is None or program_at is None:
            return program_at if axis_at is None else axis_at
        return min(axis_at, program_at)

    def step(self, now: float) -> Message | None:
        """Let the next event, which must be due, happen; return what is to be said about it."""
        axis_at, program_at = self.axis.next_event_at(), self.program.next_event_at()
        if axis_at is None or (program_at is not None and program_at < axis_at):
            self.program.step(now)
            return None
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
        self.idle_after_stop = event.outcome in {Outcome.STOPPED, Outcome.BROKEN}
        says = self.positioning.ended(event, now)
        self.program.axis_stands(event.outcome is Outcome.REACHED, now)
        if self.positioning.continues:
            self._start(now)
        return Message(MessageKind.POSITION_REACHED, POSITION_REACHED_SIGN) if says else None

    # Positioning

    def _move(self, word: str, target: float, reports: bool, now: float) -> None:
        if not self.is_ready(now):
            raise RefusedError(FAULTED)
        if self.power_mode != 0 and not self.moving:
            raise RefusedError(POWER_OFF)
        self.positioning.start(word, target, reports, now)
        self.idle_after_stop = False

    def _stop(self, outcome: Outcome, now: float) -> None:
        if outcome is Outcome.STOPPED:
            self.program.stop(now)
            self.idle_after_stop |= self.program.paused and not self.moving
        else:
            (self.program.break_off if outcome is Outcome.BROKEN else self.program.error)(now)
        self.positioning.stop(outcome, now)

    def _start(self, now: float) -> None:
        if self.positioning.braking_off:
            self.positioning.continues = self.axis.outcome is Outcome.STOPPED
        elif self.positioning.stopped is None:
            # Without a stopped positioning START goes to the program memory (UG p. 162).
            self.program.start(now)
        else:
            if self.power_mode != 0:
                raise RefusedError(POWER_OFF)
            self.positioning.go_on(now)
            self.idle_after_stop = False
            if self.program.paused:
                self.program.start(now)

    # The program

    def program_event(self, text: str, now: float) -> None:
        """Note what the program does."""
        self.log.add(now, LogKind.PROGRAM, text)

    def program_failed(self, refusal: Refusal, now: float) -> None:
        """Let a record that was refused end the program, and show its code as a warning; a choice."""
        self.faults.came(refusal.code)
        self.log.add(now, LogKind.FAULT, f"E{refusal.code}")
        self.program.error(now)

    def _choose_record(self, instruction: say.SetPointer | say.Single, now: float) -> None:
        record = self.program.record_of_inputs() if instruction.record is None else instruction.record
        if record not in RECORDS:
            raise RefusedError(NO_RECORD)
        if self.program.running or self.program.paused:
            raise RefusedError(PROGRAM_RUNS)
        if isinstance(instruction, say.Single):
            self.program.start(now, only=record)
        else:
            self.program.pointer = record

    # The rest

    def _set(self, instruction: say.Instruction, now: float) -> None:
        match instruction:
            case say.PreparedSpeed() | say.PreparedOutput():
                self.preparation.prepare(instruction)
            case say.Speed(percent):
                self.preparation.speed_percent = percent
            case say.Acceleration(time_ms):
                self.preparation.acceleration_ms = time_ms
            case say.Deceleration(time_ms):
                self.preparation.deceleration_ms = time_ms
            case say.Outputs(first, values):
                for number, value in enumerate(values, first):
                    self._set_output(number, value, now)
            case say.Power(mode):
                self._set_power(mode, now)
            case say.Password(number):
                self._set_password(number)
            case say.Quit():
                self._quit(now)
            case _:
                self._configure(instruction, now)

    def _configure(self, instruction: say.Instruction, now: float) -> None:
        match instruction:
            case say.Assign():
                self._assign(instruction, now)
            case say.MakeValid("VP"):
                self.parameters.make_valid()
                self.positioning.follow_real_zero(now)
            case say.RealZero():
                self.positioning.take_real_zero(now)
            case say.NotSimulated():
                raise RefusedError(NOT_SIMULATED)
            case _:  # an empty line does nothing; nor does VC, of which only the name is known
                pass

    def operand(self, operand: say.Operand, now: float) -> float:
        """
        Return the number that an operand stands for.

        Raises:
            RefusedError: There is no such value.
        """
        if operand.kind == "S":
            return status_number(self, operand.number, now)
        return self.parameters.value(operand.kind, operand.number) if operand.kind else operand.value

    def _assign(self, assign: say.Assign, now: float) -> None:
        protected = assign.kind == "P" and assign.number not in CONTROL_PARAMETERS
        if protected and self.knobs.password == "enforced" and not (self.password or self.service_password):
            raise RefusedError(PASSWORD)
        value = self.operand(assign.left, now)
        if assign.right is not None:
            value = calculated(assign.operator, value, self.operand(assign.right, now))
        self.parameters.write(assign.kind, assign.number, value)
        self.positioning.follow_real_zero(now)

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
