"""The program of a simulated drive at work: record after record, until END, a stop or an error."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum, auto
from typing import Final, Protocol

from . import instructions as say
from . import program as does
from .language import Context
from .program import RECORDS, Memory, Step
from .refusals import NESTING, NO_RECORD, Refusal, RefusedError

__all__ = ["Body", "Interpreter"]

_MAX_DEPTH: Final = 16
"""Of REPEAT and of GOSUB, each; unknown, a placeholder."""


class Body(Protocol):
    """What a program acts on."""

    @property
    def moving(self) -> bool:
        """Whether a positioning runs."""

    @property
    def inputs(self) -> Mapping[int, bool]:
        """I1-I16."""

    def context(self) -> Context:
        """Return what it takes to read a record now."""

    def operand(self, operand: say.Operand, now: float) -> float:
        """Return the number that an operand stands for."""

    def execute(self, instruction: say.Instruction, reports: bool, now: float) -> None:
        """Carry out an instruction."""

    def program_event(self, text: str, now: float) -> None:
        """Note what the program does."""

    def program_failed(self, refusal: Refusal, now: float) -> None:
        """Note that a record could not be carried out."""


class _State(Enum):
    IDLE = auto()
    """Ended, or never begun."""
    RUNNING = auto()
    """The next record is due at a known time."""
    POSITIONING = auto()
    """Until its own positioning has reached its target."""
    QUEUED = auto()
    """Until somebody else's positioning has ended, to try the same record again."""
    AT_WAIT_START = auto()
    """Until START."""


@dataclass(slots=True)
class _Loop:
    begin: int
    end: int
    passes: int
    now_in: int = 1


@dataclass(slots=True)
class _Level:
    """The program, or a subroutine of it."""

    back: int = 0
    stands_after: bool = False
    """RETURN leads back to where STOP interrupted it, and START is needed to go on."""
    loops: list[_Loop] = field(default_factory=list)


class Interpreter:
    """
    Executes records, one every *record_time_s*.

    Programs, as the manuals describe them, wait at POSA, POSR and POSA HOME until the target is reached. Where they are
    silent: a positioning from the line that is under way is waited for; END, BREAK and errors set the pointer to N001;
    IF ERROR and IF STOP hold from when they are executed until they have been used once; a jump out of a REPEAT loop
    ends it.
    """

    def __init__(self, body: Body, memory: Memory, record_time_s: float) -> None:
        self._body = body
        self._memory = memory
        self._record_time_s = record_time_s
        self.pointer = 1
        """The record that START begins with, and that comes next while the program runs."""
        self._forget()

    def _forget(self) -> None:
        self._state = _State.IDLE
        self._wake_at: float | None = None
        self._paused = False
        self._remaining_s: float | None = None
        self._pointer_after_single: int | None = None
        self._executed = False
        self._levels = [_Level()]
        self._on_error: does.Jump | None = None
        self._on_stop: does.Jump | None = None

    # What it shows

    @property
    def running(self) -> bool:
        """Whether records are executed or waited at; not after STOP."""
        return self._state is not _State.IDLE and not self._paused

    @property
    def paused(self) -> bool:
        """Whether START continues the program after STOP."""
        return self._paused

    @property
    def ready_for_start(self) -> bool:
        """Whether START would do something."""
        return not self.running or self._state is _State.AT_WAIT_START

    @property
    def loop_counter(self) -> int:
        """S11: in which pass the innermost REPEAT loop is; 0 outside of loops."""
        loops = self._levels[-1].loops
        return loops[-1].now_in if loops else 0

    # What is done to it

    def start(self, now: float, *, only: int | None = None) -> None:
        """Begin at the pointer, or continue; with *only*, execute that one record."""
        if self._paused:
            self._resume(now)
        elif self._state is _State.AT_WAIT_START:
            self._next(now)
        elif self._state is _State.IDLE:
            if only is not None:
                self._pointer_after_single, self.pointer = self.pointer, only
            self._body.program_event(f"started N{self.pointer:03d}", now)
            self._next(now)

    def stop(self, now: float) -> None:
        """Stand still until START, or go where IF STOP says."""
        if not self.running or self._state is _State.AT_WAIT_START:
            return
        if (jump := self._on_stop) is not None:
            self._on_stop = None
            self._interrupt(jump, now)
            return
        self._paused = True
        self._remaining_s = None if self._wake_at is None else self._wake_at - now
        self._wake_at = None
        self._body.program_event(f"stopped N{self.pointer:03d}", now)

    def break_off(self, now: float) -> None:
        """End; START begins at N001."""
        if self._state is not _State.IDLE:
            self._end("broken off", now)

    def error(self, now: float) -> None:
        """End, or go where IF ERROR says."""
        if (jump := self._on_error) is not None and self.running:
            self._on_error = None
            self._interrupt(jump, now)
        else:
            self.break_off(now)

    def axis_stands(self, reached: bool, now: float) -> None:
        """Take note that a positioning has ended."""
        if self._state is _State.QUEUED or (self._state is _State.POSITIONING and reached):
            self._state = _State.RUNNING
            if self._paused:
                self._remaining_s = self._record_time_s
            else:
                self._next(now)

    # Time

    def next_event_at(self) -> float | None:
        """Return when the next record is due."""
        return self._wake_at

    def step(self, now: float) -> None:
        """Execute the record at the pointer, which must be due."""
        self._wake_at = None
        if self.pointer not in RECORDS or (self._executed and self._pointer_after_single is not None):
            self._end("ended", now)
            return
        here = self.pointer
        try:
            self._execute(does.read_record(self._memory[here], self._body.context()), now)
        except RefusedError as refused:
            self._body.program_event(f"N{here:03d} refused: {refused}", now)
            self._body.program_failed(refused.refusal, now)

    # One record

    def _execute(self, step: Step, now: float) -> None:
        here = self.pointer
        self._executed = True
        match step:
            case say.MoveTo() | say.MoveBy() | say.MoveHome():
                self._position(step, now)
                return
            case does.WaitStart():
                self.pointer = here + 1
                self._state = _State.AT_WAIT_START
                return
            case does.End():
                if not self._close_loop(here):
                    self._end("ended", now)
                    return
            case does.Wait(time_ms):
                self.pointer = here + 1
                self._next(now, time_ms / 1000)
                return
            case does.SpeedThenWait(speed, time_ms):
                self._body.execute(speed, False, now)
                self.pointer = here + 1
                self._next(now, time_ms / 1000)
                return
            case _:
                self.pointer = here + 1
                self._go_on(step, here, now)
        if self._state is not _State.IDLE and not self._paused:
            self._next(now)

    def _go_on(self, step: Step, here: int, now: float) -> None:
        match step:
            case does.Jump():
                self._jump(step, here + 1)
            case does.Return():
                self._return(now)
            case does.Repeat(passes):
                self._open_loop(here, passes)
            case does.IfInputs(first, values, jump):
                if all(self._body.inputs[number] == value for number, value in enumerate(values, first)):
                    self._jump(jump, here + 1)
            case does.IfCompared(left, sign, right, jump):
                if _COMPARISONS[sign](self._body.operand(left, now), self._body.operand(right, now)):
                    self._jump(jump, here + 1)
            case does.IfError(jump):
                self._on_error = jump
            case does.IfStop(jump):
                self._on_stop = jump
            case _:
                assert isinstance(step, say.Instruction)
                self._body.execute(step, False, now)

    def _position(self, step: say.MoveTo | say.MoveBy | say.MoveHome, now: float) -> None:
        if self._body.moving:
            self._state = _State.QUEUED
            self._executed = False
            return
        self._body.execute(step, False, now)
        self.pointer += 1
        self._state = _State.POSITIONING

    def _jump(self, jump: does.Jump, back: int) -> None:
        record = self.record_of_inputs() if jump.record is None else jump.record
        if jump.calls:
            if len(self._levels) > _MAX_DEPTH:
                raise RefusedError(NESTING)
            self._levels.append(_Level(back))
        else:
            loops = self._levels[-1].loops
            while loops and not loops[-1].begin < record <= loops[-1].end:
                loops.pop()
        self.pointer = record

    def record_of_inputs(self) -> int:
        """
        Return the record that I9-I16 give as a binary number, I9 counting 1; which inputs do is a placeholder.

        Raises:
            RefusedError: There is none of that number.
        """
        record = sum(self._body.inputs[9 + bit] << bit for bit in range(8))
        if record not in RECORDS:
            raise RefusedError(NO_RECORD)
        return record

    def _return(self, now: float) -> None:
        if len(self._levels) == 1:
            raise RefusedError(NESTING)
        level = self._levels.pop()
        self.pointer = level.back
        if level.stands_after:
            self._state = _State.POSITIONING
            self._paused = True
            self._body.program_event(f"stopped N{self.pointer:03d}", now)

    def _open_loop(self, here: int, passes: int) -> None:
        loops = self._levels[-1].loops
        if len(loops) >= _MAX_DEPTH:
            raise RefusedError(NESTING)
        loops.append(_Loop(here, self._memory.end_of_loop(here), passes))

    def _close_loop(self, here: int) -> bool:
        """Begin the next pass or go on behind the loop, if it is a loop that ends here."""
        loops = self._levels[-1].loops
        if not loops or loops[-1].end != here:
            return False
        loop = loops[-1]
        self.pointer = loop.begin + 1
        loop.now_in += 1
        if loop.now_in > loop.passes:
            loops.pop()
            self.pointer = here + 1
        return True

    # Interruptions

    def _interrupt(self, jump: does.Jump, now: float) -> None:
        """Go to the records that IF STOP or IF ERROR name; a stopped positioning is not continued by itself."""
        by_stop = self._state is _State.POSITIONING
        try:
            self._jump(jump, self.pointer)
        except RefusedError:
            self.break_off(now)
            return
        if jump.calls:
            self._levels[-1].stands_after = by_stop
        self._next(now)

    def _resume(self, now: float) -> None:
        self._paused = False
        self._body.program_event(f"continued N{self.pointer:03d}", now)
        if self._state in {_State.POSITIONING, _State.QUEUED}:
            if not self._body.moving:
                self._next(now)
        else:
            self._next(now, self._remaining_s)

    def _next(self, now: float, delay_s: float | None = None) -> None:
        self._state = _State.RUNNING
        self._wake_at = now + max(self._record_time_s, delay_s or 0.0)

    def _end(self, how: str, now: float) -> None:
        self._body.program_event(f"{how} N{min(self.pointer, RECORDS[-1]):03d}", now)
        self.pointer = self._pointer_after_single or 1
        self._forget()


_COMPARISONS: Final[Mapping[str, Callable[[float, float], bool]]] = {
    "=": operator.eq,
    "<": operator.lt,
    ">": operator.gt,
    "<=": operator.le,
    ">=": operator.ge,
    "<>": operator.ne,
}
"""IBS p. 56."""
