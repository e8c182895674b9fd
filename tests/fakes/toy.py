"""A line protocol of no device at all: ``ok`` answers, ``?`` and ``!`` bring it in step."""

from __future__ import annotations

from dataclasses import dataclass

from compax_aio.link.contract import Event, Hold, InStep, Stranger, TurnOver

__all__ = ["Said", "ToyProtocol", "as_toy"]


@dataclass(frozen=True, slots=True)
class Said(TurnOver):
    """The far end's answer."""

    text: str


def as_toy(line: str) -> bytes:
    """Answer as the far end of a :class:`ToyProtocol` does."""
    return b"!\n" if line == "?" else f"ok {line}\n".encode()


class ToyProtocol:
    """Answers are told from late ones by nothing but the marker between them."""

    def __init__(self) -> None:
        self.in_doubt = True
        self.is_busy = False
        self.held: Hold | None = None
        self.patience_s: float | None = None
        self._out = b""
        self._received = b""
        self._events: list[Event] = []

    def line_opened(self) -> None:
        self.in_doubt, self.is_busy = True, False

    def line_lost(self) -> None:
        self.in_doubt, self.is_busy = True, False

    def preempt(self, text: str) -> None:
        self.in_doubt, self.is_busy = True, False
        self._out += text.encode() + b"\n"

    def send(self, text: str) -> None:
        assert not self.in_doubt
        assert not self.is_busy
        self._write(text)

    def send_marker(self) -> None:
        assert self.in_doubt
        assert not self.is_busy
        self._write("?")

    def send_ahead(self, text: str) -> None:
        self._write(text)

    def time_ran_out(self) -> None:
        assert self.is_busy
        self.in_doubt, self.is_busy = True, False

    def resume(self) -> None:
        self.held = None

    def stranger(self, *, time_is_over: bool) -> Stranger | None:
        return None

    def bytes_to_send(self) -> bytes:
        out, self._out = self._out, b""
        return out

    def receive(self, data: bytes) -> None:
        *lines, self._received = (self._received + data).split(b"\n")
        for line in lines:
            if not self.in_doubt:
                self.is_busy = False
                self._events.append(Said(line.decode()))
            elif line == b"!":
                self.in_doubt = self.is_busy = False
                self._events.append(InStep())

    def events(self) -> list[Event]:
        events, self._events = self._events, []
        return events

    def _write(self, text: str) -> None:
        self.is_busy = True
        self._out += text.encode() + b"\n"
