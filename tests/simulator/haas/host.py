"""Somebody at the other end of a simulated control's line, and a clock in the other hand."""

from __future__ import annotations

from typing import Any

from compax_aio.simulator.haas import Knobs, LogKind, SimulatedControl

__all__ = ["ACK", "EOT", "NAK", "XOFF", "XON", "Host", "block"]

ACK, NAK, EOT, CAN = b"\x06", b"\x15", b"\x04", b"\x18"
XON, XOFF = b"\x11", b"\x13"


def block(number: int, data: bytes) -> bytes:
    """Return an XMODEM block."""
    data = data.ljust(128, b"\x1a")
    return bytes([1, number, 255 - number]) + data + bytes([sum(data) % 256])


class Host:
    """A control with *knobs*, and the time, which begins at 0 and goes on with every call."""

    def __init__(self, **knobs: Any) -> None:
        self.control = SimulatedControl(Knobs(**knobs))
        self.now = 0.0

    @classmethod
    def whose_n0_is(cls, value: int, **knobs: Any) -> Host:
        """Return one whose control has the same N0 for all data."""
        host = cls(**knobs)
        host.control = SimulatedControl(host.control.knobs, checksum=lambda _kind, _values: value)
        return host

    def wait(self, seconds: float = 0.0) -> bytes:
        """Let time pass; return what comes out meanwhile."""
        self.now += seconds
        return self.control.take_output(self.now)

    def send(self, data: bytes, then_wait_s: float = 0.0) -> bytes:
        """Send bytes; return what comes out in the time given."""
        self.control.receive(data, self.now)
        return self.wait(then_wait_s)

    def until_quiet(self, most_s: float = 10_000.0) -> bytes:
        """Let time pass until nothing more happens by itself."""
        out = b""
        end = self.now + most_s
        while (at := self.control.next_event_at()) is not None and at <= end:
            self.now = max(self.now, at)
            out += self.control.take_output(self.now)
        return out

    def receive(self, what: str = "programs") -> bytes:
        """Have RECV pressed; return what comes out at once."""
        self.control.press_recv(what, self.now)
        return self.wait()

    def fetch(self, what: str) -> bytes:
        """Have SEND pressed; return all that comes out."""
        self.control.press_send(what, self.now)
        return self.wait() + self.until_quiet()

    def load(self, data: bytes, what: str = "programs") -> str:
        """Have RECV pressed, send all at once, and return what the corner of the display says then."""
        self.receive(what)
        self.send(data)
        self.until_quiet()
        return self.control.screen

    def texts(self, *kinds: LogKind) -> list[str]:
        """List what the log says of some kinds."""
        self.control.advance(self.now)
        return self.control.log.texts(*kinds)

    def alarms(self) -> list[str]:
        """List the names of the alarms."""
        return [each.name for each in self.control.alarms]
