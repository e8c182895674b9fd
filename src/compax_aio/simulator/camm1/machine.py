"""The far side of the buffer: reads whole instructions, carries them out in time, and keeps what was cut."""

from __future__ import annotations

from math import hypot, inf
from typing import Final, Protocol

from compax_aio.camm1.facts.line import MAX_COORDINATE
from compax_aio.camm1.facts.reports import OUTPUT_INSTRUCTIONS

from .buffer import Buffer
from .cuttings import Cuttings
from .interpreter import Interpreter, Step, Stop
from .knobs import Knobs
from .language import NOTHING, Reader, Stored
from .log import Log, LogKind
from .shapes import clipped

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
        knobs: Of the cutter.
        buffer: Where it reads.
        log: Where it notes what it does.
        watcher: Is told of free bytes and of output instructions.

    Attributes:
        cuttings: What lies on the machine.
        interpreter: The state of the tool.
        is_ready: SETUP is lit.
        is_paused: By the PAUSE key.
        is_viewed: By the VIEW key of an HP.
        is_lever_up: The sheet is not held.
        is_blinking: There was an error in the data.
        has_drawn: Something was cut since power-on.
        data_error: For ``OE``.
        factor: Everything takes so many times as long.
    """

    def __init__(self, knobs: Knobs, buffer: Buffer, log: Log, watcher: Watcher) -> None:
        self._knobs = knobs
        self._buffer = buffer
        self._log = log
        self._watcher = watcher
        self._now = 0.0
        self.cuttings = Cuttings()
        self.factor = knobs.time_factor
        self._frees_at_end = knobs.free_on == "finish"
        self._behind_motion = _STOPPING | (
            frozenset(OUTPUT_INSTRUCTIONS) if knobs.o_answers == "motion" else frozenset()
        )
        self._edge = (knobs.area_x or MAX_COORDINATE, knobs.area_y or MAX_COORDINATE)
        self._is_interrupted = False
        self.is_paused = self.is_viewed = self.is_lever_up = False
        self.switch_on()

    def switch_on(self) -> None:
        """Begin anew, with the tool at the origin."""
        knobs = self._knobs
        self._reader = Reader(knobs.language)
        names = knobs.facts.mnemonics.value or frozenset()
        known = {each for each in (knobs.facts.force_instruction.value, knobs.facts.tool_instruction.value) if each}
        self.interpreter = Interpreter(
            self._reader, names | known, knobs.speed_cm_s, knobs.travel_cm_s, knobs.speeds_cm_s, self._on_error
        )
        self.is_ready = knobs.ready
        self.is_blinking = self.has_drawn = False
        self.data_error = 0
        self._next: Stored | None = None
        self._seen = -1
        self._motion: Step | None = None
        self._begun_at = self._ends_at = self._reads_at = self._now
        self._waiting: Step | None = None
        self._left_s = 0.0
        self._vectors_before = 0
        self._text = ""
        self.cuttings.vectors.carry(0, 0)

    def switch_off(self, now: float) -> None:
        """Stop where the tool is; what was not cut yet is not cut."""
        if self._motion is not None:
            self._cut_short(self._motion, now)
        self._motion = self._waiting = None
        self.is_ready = False

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
            self._begun_at = self._ends_at - self._duration_s(self._motion) if self._motion is not None else now
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
        self._next, self._seen = None, -1

    # Instructions

    def _read(self, now: float) -> None:
        stored, self._next = self._next, None
        assert stored is not None
        self._seen = -1
        self._now = now
        counted = self._buffer.read(stored.size)
        if stored.name == NOTHING:
            self._free(counted, now)
            return
        self._text = stored.name + stored.argument[:40].decode("latin-1")
        was_still = self.stands_still
        step = self.interpreter.carry_out(stored)
        self._log.add(now, LogKind.INSTRUCTION, step.text)
        if step.stops:
            if self._frees_at_end:
                step.counted = counted
            else:
                self._free(counted, now)
            if self._motion is None:
                self._begin(step, now)
            else:
                self._waiting = step
        else:
            self._reads_at = now + self._knobs.instruction_time_s * self.factor
            self._note(step)
            self._free(counted, now)
            if step.name in _STOPPING:
                self.is_ready = False
            elif step.name == "IN":
                self.data_error = 0
            elif step.asks:
                self._watcher.asked(step.name, now)
        self.held(was_still, now)

    def _free(self, count: int, now: float) -> None:
        self._buffer.stored -= count
        if self._watcher.freed(now):
            self._is_interrupted = True

    def _begin(self, step: Step, now: float) -> None:
        self._motion = step
        self._begun_at = now
        self._ends_at = now + self._duration_s(step)
        self._reads_at = max(self._reads_at, now)
        self._vectors_before = self.cuttings.vectors.total
        self._note(step)

    def _end_motion(self) -> None:
        step, self._motion = self._motion, None
        now = self._now = self._ends_at
        assert step is not None
        if step.counted:
            self._free(step.counted, now)
        waiting, self._waiting = self._waiting, None
        if waiting is not None:
            self._begin(waiting, now)

    def drop_waiting(self) -> None:
        """Forget the instruction that was read and not begun."""
        if self._waiting is not None:
            self.interpreter.take_back(self._waiting)
            self._waiting = None

    def uncount(self) -> None:
        """Let no instruction that is carried out hold bytes of the buffer any more."""
        if self._motion is not None:
            self._motion.counted = 0

    def _on_error(self, code: int) -> None:
        self.data_error = code
        self.is_blinking = True
        self._log.add(self._now, LogKind.DATA_ERROR, f"{code} {self._text}")

    # Vectors

    def _duration_s(self, step: Step) -> float:
        return sum(self._durations_s(step)) * self.factor

    def _durations_s(self, step: Step) -> list[float]:
        x, y, _ = step.begins
        each_s = self._knobs.vector_time_s
        travel, speed = step.speeds
        durations = []
        for to_x, to_y, is_down in step.stops:
            durations.append(hypot(to_x - x, to_y - y) / (speed if is_down else travel) + each_s)
            x, y = to_x, to_y
        return durations

    def _note(self, step: Step) -> None:
        """Keep what a step leaves behind."""
        if step.mark is not None:
            self.cuttings.mark(*step.mark, step.begins[0], step.begins[1])
        if not step.stops:
            return
        low, high = self._window
        x, y, _ = step.begins
        for to_x, to_y, is_down in step.stops:
            self._vector((x, y), (to_x, to_y), is_down, step.state, low, high)
            x, y = to_x, to_y

    @property
    def _window(self) -> tuple[tuple[float, float], tuple[float, float]]:
        window = self.interpreter.window
        if window is None:
            return (0.0, 0.0), self._edge
        low = (max(0.0, window[0]), max(0.0, window[1]))
        return low, (min(self._edge[0], window[2]), min(self._edge[1], window[3]))

    def _vector(
        self,
        begin: tuple[float, float],
        end: tuple[float, float],
        is_down: bool,
        state: int,
        low: tuple[float, float],
        high: tuple[float, float],
    ) -> None:
        move = self.cuttings.vectors.move
        if not is_down:
            move(int(end[0]), int(end[1]), state)
            return
        self.has_drawn = True
        if all(low[axis] <= place[axis] <= high[axis] for place in (begin, end) for axis in (0, 1)):
            move(int(end[0]), int(end[1]), state | 1)
            return
        part = clipped(begin, end, low, high)
        if part is not None:
            first, last = ((round(x), round(y)) for x, y in part)
            if first != begin:
                move(*first, state)
            move(*last, state | 1)
            if last != end:
                move(int(end[0]), int(end[1]), state)
        else:
            move(int(end[0]), int(end[1]), state)

    def position_at(self, now: float) -> Stop:
        """Return where the tool is, and whether it is down."""
        step = self._motion
        if step is None:
            tool = self.interpreter
            return tool.x, tool.y, tool.is_down
        elapsed_s = self._duration_s(step) - self._left_s if self.stands_still else now - self._begun_at
        return self._reached(step, elapsed_s)[1]

    def _reached(self, step: Step, elapsed_s: float) -> tuple[int, Stop]:
        """Return how many vectors of a step are whole after that time, and where the tool is."""
        x, y, was_down = step.begins
        for count, ((to_x, to_y, is_down), lasts_s) in enumerate(zip(step.stops, self._durations_s(step), strict=True)):
            lasts_s *= self.factor  # noqa: PLW2901
            if elapsed_s < lasts_s:
                part = elapsed_s / lasts_s
                return count, (x + part * (to_x - x), y + part * (to_y - y), is_down)
            elapsed_s -= lasts_s
            x, y, was_down = to_x, to_y, is_down
        return len(step.stops), (x, y, was_down)

    def _cut_short(self, step: Step, now: float) -> None:
        """Take back what was not cut of the step that is carried out."""
        elapsed_s = self._duration_s(step) - self._left_s if self.stands_still else now - self._begun_at
        count, (x, y, is_down) = self._reached(step, elapsed_s)
        vectors = self.cuttings.vectors
        made = list(step.stops[:count])
        if count < len(step.stops):
            made.append((round(x), round(y), is_down))
        vectors.take_back_to(self._vectors_before)
        low, high = self._window
        x, y, _ = step.begins
        for to_x, to_y, is_down in made:
            self._vector((x, y), (to_x, to_y), is_down, step.state, low, high)
            x, y = to_x, to_y
