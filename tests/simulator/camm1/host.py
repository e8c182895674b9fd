"""Somebody at the other end of a simulated cutter's line, and a clock in the other hand."""

from __future__ import annotations

from typing import Any

from compax_aio.simulator.camm1 import Knobs, LogKind, SimulatedCutter, Vector

__all__ = ["ESC", "Host"]

ESC = b"\x1b."


class Host:
    """A cutter with *knobs*, and the time, which begins at 0 and goes on with every call."""

    def __init__(self, **knobs: Any) -> None:
        self.cutter = SimulatedCutter(Knobs(**knobs))
        self.now = 0.0

    @classmethod
    def frozen(cls, **knobs: Any) -> Host:
        """Return one of which the interpreter is paused, so that what is sent stays in the buffer."""
        host = cls(**knobs)
        host.cutter.press_pause(0.0)
        return host

    def wait(self, seconds: float) -> bytes:
        """Let time pass; return what comes out meanwhile."""
        self.now += seconds
        return self.cutter.take_output(self.now)

    def send(self, data: bytes, then_wait_s: float = 0.0) -> bytes:
        """Send bytes; return what comes out in the time given."""
        self.cutter.receive(data, self.now)
        return self.wait(then_wait_s)

    def control(self, text: str, then_wait_s: float = 0.0) -> bytes:
        """Send a device control instruction; return what comes out."""
        return self.send(ESC + text.encode(), then_wait_s)

    def ask(self, text: str, then_wait_s: float = 0.0) -> int:
        """Send a device control instruction that is answered by a number and CR."""
        answer = self.control(text, then_wait_s)
        assert answer.endswith(b"\r"), answer
        return int(answer)

    def until_idle(self) -> bytes:
        """Let time pass until nothing is left to do; return what came out."""
        out = b""
        while not self.cutter.is_idle:
            out += self.wait(0.1)
            assert self.now < 100_000
        return out

    def cut(self, data: bytes) -> list[Vector]:
        """Send a job and wait for its end; return the vectors that are cut."""
        self.send(data)
        self.until_idle()
        return self.cutter.cuttings.cut

    def is_dtr_high(self) -> bool:
        """Whether DTR says that there is room."""
        return self.cutter.is_dtr_high

    def is_idle(self) -> bool:
        """Whether nothing is left to do."""
        return self.cutter.is_idle

    def is_blinking(self) -> bool:
        """Whether the light says that there was an error in the data."""
        return self.cutter.is_blinking

    def texts(self, *kinds: LogKind) -> list[str]:
        """List what the log says of some kinds."""
        self.cutter.advance(self.now)
        return self.cutter.log.texts(*kinds)
