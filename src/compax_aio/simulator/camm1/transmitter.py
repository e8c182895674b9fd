"""What leaves a simulated cutter, and when: triggers, delays, initiator, terminators, one output at a time."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from math import inf
from typing import Final

from compax_aio.camm1.facts.handshakes import OUTPUT_RULES, OutputKind, OutputRule
from compax_aio.camm1.facts.line import CARRIAGE_RETURN

__all__ = ["Format", "Transmitter"]

_MOST_UNTAKEN: Final = 65_536
_SEVEN_BITS: Final = 0x7F


@dataclass(frozen=True, slots=True)
class Format:
    """What ``.M`` and ``.N`` have set of replies; a character 0 is none."""

    turnaround_s: float = 0.0
    trigger: int = 0
    echo_terminator: int = 0
    terminator: bytes = bytes([CARRIAGE_RETURN])
    initiator: bytes = b""
    intercharacter_s: float = 0.0


@dataclass(slots=True)
class _Run:
    """Bytes that come out one after the other."""

    data: bytes
    first_at: float
    step_s: float
    has_gaps: bool


class Transmitter:
    """
    The way to the host.

    Args:
        byte_time_s: Of each byte.
        data_bits: 7: the eighth is even parity.

    Attributes:
        format: Of replies.
        discards_from: From then on the host's bytes are its echo, up to the echo terminator; infinite: none is awaited.
    """

    def __init__(self, byte_time_s: float, data_bits: int = 8) -> None:
        self._byte_time_s = byte_time_s
        self._has_parity = data_bits == 7
        self.format = Format()
        self.discards_from = inf
        self._waiting: deque[tuple[bytes, OutputRule, float]] = deque()
        self._runs: deque[_Run] = deque()
        self._ends_at = 0.0
        self._out = bytearray()

    @property
    def awaits_trigger(self) -> bool:
        """Whether an output waits for the trigger character."""
        return bool(self._waiting)

    def is_busy(self, now: float) -> bool:
        """Whether an output is unfinished."""
        return bool(self._waiting) or self._ends_at > now

    def send(self, text: bytes, kind: OutputKind, now: float, *, late_s: float = 0.0, turns: bool = False) -> None:
        """Send an output behind what is being sent; *turns*: after the turnaround delay in any case."""
        rule = OUTPUT_RULES[kind]
        if rule.trigger and self.format.trigger:
            self._waiting.append((text, rule, late_s))
        else:
            self._begin(text, rule, now, late_s, turns=turns)

    def triggered(self, now: float) -> None:
        """Take the trigger character."""
        text, rule, late_s = self._waiting.popleft()
        self._begin(text, rule, now, late_s, turns=False)

    def inject(self, data: bytes) -> None:
        """Put bytes out of nothing on the line."""
        self._leave(data)

    def abort(self, now: float) -> None:
        """Drop what has not left: outputs, waits and delays."""
        self._run(now)
        self._runs.clear()
        self._waiting.clear()
        self.discards_from = inf
        self._ends_at = min(self._ends_at, now)

    def take(self, until: float) -> bytes:
        """Return what has come out."""
        self._run(until)
        out = bytes(self._out)
        self._out.clear()
        return out

    def _run(self, until: float) -> None:
        while self._runs:
            run = self._runs[0]
            size = len(run.data)
            last_at = run.first_at + (size - 1) * run.step_s
            count = size if last_at <= until else 0
            if not count and run.first_at <= until:
                count = int((until - run.first_at) / run.step_s + 1e-6) + 1
            if not count:
                break
            self._leave(run.data[:count])
            if count < size:
                run.data = run.data[count:]
                run.first_at += count * run.step_s
                break
            self._runs.popleft()

    def forget(self) -> None:
        """Lose what has come out and was not taken."""
        self._out.clear()

    def next_at(self) -> float:
        """Return when something comes out next: bytes without a pause between them together."""
        if self._out:
            return 0.0
        if not self._runs:
            return inf
        run = self._runs[0]
        return run.first_at if run.has_gaps else run.first_at + (len(run.data) - 1) * run.step_s

    def _begin(self, text: bytes, rule: OutputRule, now: float, late_s: float, *, turns: bool) -> None:
        form = self.format
        begins_at = max(now, self._ends_at) + late_s
        if rule.turnaround or turns:
            begins_at += form.turnaround_s
        data = form.initiator * rule.initiator + text + form.terminator * rule.terminator
        if rule.echo_terminator and form.echo_terminator:
            self.discards_from = begins_at
        if not data:
            return
        gap_s = form.intercharacter_s if rule.intercharacter else 0.0
        step_s = gap_s + self._byte_time_s
        self._runs.append(_Run(data, begins_at + step_s, step_s, has_gaps=gap_s > 0))
        self._ends_at = begins_at + len(data) * step_s

    def _leave(self, data: bytes) -> None:
        if self._has_parity:
            data = bytes(byte & _SEVEN_BITS | (byte & _SEVEN_BITS).bit_count() % 2 << 7 for byte in data)
        self._out += data
        del self._out[:-_MOST_UNTAKEN]
