"""Somebody with a terminal on the line of a simulated drive, and a clock in the other hand."""

from __future__ import annotations

from typing import Any

from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive

__all__ = ["PROMPT", "Terminal"]

PROMPT = b"\r\n>"

MOTION = (
    LogKind.MOTION_STARTED,
    LogKind.MOTION_CONTINUED,
    LogKind.MOTION_REACHED,
    LogKind.MOTION_STOPPED,
    LogKind.MOTION_FAULT,
)


class Terminal:
    """A drive with *knobs*, and the time, which begins at 0 and goes on with every call."""

    def __init__(self, **knobs: Any) -> None:
        self.drive = SimulatedDrive(Knobs(**knobs))
        self.now = 0.0

    def send(self, data: bytes, then_wait_s: float = 0.01) -> bytes:
        """Send bytes as they are; return what comes out in the time given."""
        self.drive.receive(data, self.now)
        return self.wait(then_wait_s)

    def say(self, line: str, then_wait_s: float = 0.01) -> bytes:
        """Send a line; return what comes out in the time given."""
        return self.send(line.encode() + b"\r", then_wait_s)

    def ask(self, line: str) -> str:
        """Send a line that is answered in time; return the answer without its prompt."""
        answer = self.say(line)
        assert answer.endswith(PROMPT), answer
        return answer.removesuffix(PROMPT).decode("latin-1")

    def wait(self, seconds: float) -> bytes:
        """Let time pass; return what comes out meanwhile."""
        self.now += seconds
        return self.drive.take_output(self.now)

    def motions(self) -> list[str]:
        """List what the axis did."""
        return [f"{entry.kind.value} {entry.text}" for entry in self.drive.log if entry.kind in MOTION]
