"""Somebody at the other end of a simulated line, who waits for echoes or does not, and a clock in the other hand."""

from __future__ import annotations

from typing import Any

from compax_aio.simulator.smc import Knobs, LogKind, SimulatedAxis, SimulatedPartyLine

__all__ = ["Host"]


class Host:
    """A line with *knobs*, and the time, which begins at 0 and goes on with every call."""

    def __init__(self, **knobs: Any) -> None:
        self.line = SimulatedPartyLine(Knobs(**knobs))
        self.now = 0.0

    @property
    def axis(self) -> SimulatedAxis:
        """The first axis."""
        return next(iter(self.line.axes.values()))

    def wait(self, seconds: float) -> bytes:
        """Let time pass; return what comes out meanwhile."""
        self.now += seconds
        return self.line.take_output(self.now)

    def send(self, data: bytes, then_wait_s: float = 0.5) -> bytes:
        """Send bytes all at once; return what comes out in the time given."""
        self.line.receive(data, self.now)
        return self.wait(then_wait_s)

    def type(self, data: bytes, each_s: float = 0.1) -> bytes:
        """Send bytes one by one, each after the time given; return what comes out."""
        return b"".join(self.send(bytes([byte]), each_s) for byte in data)

    def echoed(self, data: bytes, timeout_s: float = 1.0) -> bytes:
        """Send bytes one by one, each as soon as the one before has been echoed; return what comes out."""
        answer = b""
        for byte in data:
            until = self.now + timeout_s
            self.line.receive(bytes([byte]), self.now)
            while not (echo := self.line.take_output(self.now)) and self.now < until:
                at = self.line.next_event_at()
                self.now = until if at is None else min(at, until)
            answer += echo
        return answer

    def command(self, name: str, text: str, then_wait_s: float = 0.1) -> str:
        """Give an axis a command as it wants it, behind an LF of its own; return the data of the answer."""
        self.line.take_output(self.now)
        whole = (name + text).encode("latin-1")
        self.type(b"\n", 0.01)
        assert (echo := self.echoed(whole)) == whole, echo
        answer = self.send(b"\n", then_wait_s)
        assert answer.endswith(b"\n"), answer
        return answer[:-1].decode("latin-1")

    def number(self, name: str, text: str) -> float:
        """Give an axis a command that is answered by a number."""
        return float(self.command(name, text))

    def typed(self, text: str, then_wait_s: float = 0.1) -> str:
        """Give the axis of a line in single mode a command; return the data of the answer."""
        assert self.echoed(text.encode()) == text.encode()
        answer = self.send(b"\r", then_wait_s)
        assert answer.endswith(b"\r\n"), answer
        return answer[:-2].decode("latin-1")

    def texts(self, *kinds: LogKind, axis: str | None = None) -> list[str]:
        """List what the log says of some kinds."""
        self.line.advance(self.now)
        return self.line.log.texts(*kinds, axis=axis)

    def motions(self, axis: str | None = None) -> list[str]:
        """List how motions began and ended, and where."""
        self.line.advance(self.now)
        return [
            f"{entry.text} at {entry.position:g}"
            for entry in self.line.log
            if entry.kind in {LogKind.MOTION_STARTED, LogKind.MOTION_ENDED} and axis in {None, entry.axis}
        ]
