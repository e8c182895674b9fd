"""The far side of the buffer: reads whole instructions, and carries them out in time."""

from __future__ import annotations

from math import inf
from typing import Final, Protocol

from compax_aio.camm1.facts.reports import OUTPUT_INSTRUCTIONS

from .blade import Blade
from .buffer import Buffer
from .interpreter import Interpreter
from .language import NOTHING, Reader, Stored
from .log import LogKind
from .surroundings import Surroundings
from .tool import Step, Stop, Tool

__all__ = ["Machine", "Watcher"]

_STOPPING: Final = frozenset({"!NR", "NR"})


class Watcher(Protocol):
    """Who wants to know what the machine does."""

    def freed(self, now: float) -> bool:
        """Take note that bytes of the buffer have become free; whether the host begins to send because of it."""

    def asked(self, name: str, now: float) -> None:
        """Answer an output instruction."""


class Machine:
    """
    Reads one instruction ahead while a vector is made; what moves nothing is carried out when it is read.

    Args:
        around: Of the cutter.
        buffer: Where it reads.
        watcher: Is told of free bytes and of output instructions.

    Attributes:
        blade: Makes the vectors.
        tool: The state that instructions change.
        is_ready: SETUP is lit.
        is_paused: By the PAUSE key.
        is_viewed: By the VIEW key of an HP.
        is_lever_up: The sheet is not held.
        is_blinking: There was an error in the data.
        data_error: For ``OE``.
    """

    def __init__(self, around: Surroundings, buffer: Buffer, watcher: Watcher) -> None:
        knobs = around.knobs
        self._around = around
        self._knobs = knobs
        self._buffer = buffer
        self._watcher = watcher
        self._is_interrupted = False
        asking = frozenset(OUTPUT_INSTRUCTIONS) if knobs.o_answers == "motion" else frozenset()
        self._behind_motion = _STOPPING | asking
        self.blade = Blade(knobs)
        self.is_viewed = self.is_lever_up = False
        self._now = 0.0
        self.switch_on()

    def switch_on(self) -> None:
        """Begin anew, with the tool at the origin."""
        knobs, facts = self._knobs, self._knobs.facts
        self.tool = Tool(knobs, self._on_error)
        self._reader = Reader(knobs.language)
        own = (facts.force_instruction.value, facts.tool_instruction.value)
        names = (facts.mnemonics.value or frozenset()).union(each for each in own if each)
        if knobs.language == "mode2":
            names = frozenset(each for each in names if len(each) > 1)
        self._interpreter = Interpreter(self.tool, self._reader, names)
        self.is_ready = knobs.ready
        self.is_paused = self.is_blinking = self.blade.has_drawn = False
        self.data_error = 0
        self._motion: Step | None = None
        self._waiting: Step | None = None
        self._begun_at = self._ends_at = self._reads_at = self._now
        self._left_s = 0.0
        self._text = ""
        self._next: Stored | None = None
        self._seen = -1
        self.blade.cuttings.vectors.carry(0, 0)

    def switch_off(self, now: float) -> None:
        """Stop where the tool is; what was not cut yet is not cut."""
        if self._motion is not None:
            self.blade.cut_short(self._motion, self._elapsed_s(self._motion, now))
        self._motion = self._waiting = None
        self.is_ready = False
        self._now = now

    @property
    def stands_still(self) -> bool:
        """Whether somebody or something holds it."""
        return (
            self.is_paused
            or not self.is_ready
            or self.is_viewed
            or self.is_lever_up
            or (self.is_blinking and self._knobs.stops_on_error)
        )

    @property
    def is_idle(self) -> bool:
        """Whether nothing is left to do, unless more comes."""
        return self._motion is None and self._waiting is None and not self._buffer.data

    def partial(self) -> int:
        """Count the last bytes that are stored and belong to an instruction that has not come whole."""
        data = bytearray(self._buffer.data)
        while (stored := self._reader.read(data)) is not None:
            del data[: stored.size]
        return len(data)

    # Time

    def held(self, was_still: bool, now: float) -> None:
        """Take note that it may stand still now, or go on."""
        self._now = max(self._now, now)
        if self.stands_still == was_still:
            return
        if was_still:
            self._reads_at = max(self._reads_at, now)
            self._ends_at = now + self._left_s
            if self._motion is not None:
                self._begun_at = self._ends_at - self.blade.duration_s(self._motion)
        elif self._motion is not None:
            self._left_s = max(0.0, self._ends_at - now)

    def next_at(self) -> float:
        """Return when it does something next; infinite if it does nothing unless something comes."""
        if self.stands_still:
            return inf
        ends_at = self._ends_at if self._motion is not None else inf
        return ends_at if self._waiting is not None else min(ends_at, self._reads_next_at())

    def run(self, until: float) -> float:
        """Let everything happen that is due until then; returns at which time it stopped because the host goes on."""
        while not self.stands_still:
            ends_at = self._ends_at if self._motion is not None else inf
            reads_at = inf if self._waiting is not None else self._reads_next_at()
            if min(ends_at, reads_at) > until:
                break
            if ends_at <= reads_at:
                self._end_motion()
            else:
                self._read(reads_at)
            if self._is_interrupted:
                self._is_interrupted = False
                return self._now
        self._now = max(self._now, until)
        return until

    def position_at(self, now: float) -> Stop:
        """Return where the tool is, and whether it is down."""
        step = self._motion
        if step is None:
            return self.tool.x, self.tool.y, self.tool.is_down
        return self.blade.reached(step, self._elapsed_s(step, now))[1]

    def _elapsed_s(self, step: Step, now: float) -> float:
        return self.blade.duration_s(step) - self._left_s if self.stands_still else now - self._begun_at

    # Reading

    def _reads_next_at(self) -> float:
        """Return when the next instruction is read; infinite if none has come whole."""
        buffer = self._buffer
        stored = self._next
        if stored is None or stored.name == NOTHING:
            come = len(buffer.data)
            if come == self._seen and stored is None:
                return inf
            self._seen = come
            stored = self._next = self._reader.read(buffer.data) if come else None
            if stored is None:
                return inf
        reads_at = max(self._reads_at, buffer.arrived_at(stored.needs))
        if self._motion is not None and stored.name in self._behind_motion:
            return max(reads_at, self._ends_at)
        return reads_at

    def forget_next(self) -> None:
        """Look anew at what is stored: it was changed."""
        self._next = None
        self._seen = -1

    def _read(self, now: float) -> None:
        stored = self._next
        assert stored is not None
        self.forget_next()
        self._now = now
        counted = self._buffer.read(stored.size)
        if stored.name == NOTHING:
            self._free(counted, now)
            return
        self._text = stored.name + stored.argument[:40].decode("latin-1")
        was_still = self.stands_still
        step = self._interpreter.carry_out(stored)
        self._around.note(LogKind.INSTRUCTION, step.text, now)
        if step.stops:
            self._take_up(step, counted, now)
        else:
            self._reads_at = now + self._knobs.instruction_time_s * self.blade.factor
            self._carry_out(step)
            self._free(counted, now)
        self.held(was_still, now)

    def _carry_out(self, step: Step) -> None:
        """Do what moves nothing."""
        self.blade.leave(step, self.tool.window)
        if step.name in _STOPPING:
            self.is_ready = False
        elif step.name == "IN":
            self.data_error = 0
        elif step.asks:
            self._watcher.asked(step.name, self._now)

    def _free(self, count: int, now: float) -> None:
        self._buffer.stored -= count
        if self._watcher.freed(now):
            self._is_interrupted = True

    # Motion

    def _take_up(self, step: Step, counted: int, now: float) -> None:
        """Begin a motion, or let it wait for the end of the one before."""
        if self._motion is None:
            self._begin(step, now)
        else:
            self._waiting = step
        if self._knobs.free_on == "finish":
            step.counted = counted
        else:
            self._free(counted, now)

    def _begin(self, step: Step, now: float) -> None:
        self._motion = step
        self._begun_at = now
        self._ends_at = now + self.blade.duration_s(step)
        self._reads_at = max(self._reads_at, now)
        self.blade.leave(step, self.tool.window)

    def _end_motion(self) -> None:
        step, self._motion = self._motion, None
        now = self._now = self._ends_at
        waiting, self._waiting = self._waiting, None
        if waiting is not None:
            self._begin(waiting, now)
        if step is not None and step.counted:
            self._free(step.counted, now)

    def drop_waiting(self) -> None:
        """Forget the instruction that was read and not begun; what is carried out holds no bytes any more."""
        if self._waiting is not None:
            self.tool.take_back(self._waiting)
            self._waiting = None
        if self._motion is not None:
            self._motion.counted = 0

    def _on_error(self, code: int) -> None:
        self.data_error = code
        self.is_blinking = True
        self._around.note(LogKind.DATA_ERROR, f"{code} {self._text}", self._now)
