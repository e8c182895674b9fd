"""
The floor: a bare ``asyncio.Protocol`` that writes ``S1``, finds the prompt and sets a future.

Beside it the least that whoever wants his own answer, in time and as a number, has to do in Python.
"""

from __future__ import annotations

import asyncio
from collections import deque
from typing import Any, Final

__all__ = ["LINE", "PROMPT", "Bare", "Least"]

LINE: Final = b"S1\r"
PROMPT: Final = b">"


class Bare(asyncio.Protocol):
    """Knows no time-out, no queue, no error and no end; whoever asks twice at once gets one answer."""

    def __init__(self) -> None:
        self.transport: Any = None
        self._loop = asyncio.get_running_loop()
        self._answer: asyncio.Future[bytes] | None = None
        self._come = b""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Take the transport."""
        self.transport = transport

    def ask(self) -> asyncio.Future[bytes]:
        """Write the line, and return a future of its answer."""
        self._answer = answer = self._loop.create_future()
        self.transport.write(LINE)
        return answer

    def data_received(self, data: bytes) -> None:
        """Look for the prompt."""
        self._come += data
        if PROMPT in data and self._answer is not None:
            if not self._answer.done():  # whoever asked may have been cancelled
                self._answer.set_result(self._come)
            self._answer, self._come = None, b""


_Turn = tuple[bytes, bytes, "asyncio.Future[bytes]"]


class Least(asyncio.Protocol):
    """
    One line outstanding, others in a queue; an answer must be that of the question; a time-out; and a number.

    It knows no late answers, no messages, no errors of the drive and no end of the line, counts nothing, and keeps no
    history: what a client adds to this is what those cost.
    """

    _TIMEOUT_S: Final = 1.0

    def __init__(self) -> None:
        self.transport: Any = None
        self._loop = asyncio.get_running_loop()
        self._waiting: deque[_Turn] = deque()
        self._outstanding: _Turn | None = None
        self._come = b""
        self._until = 0.0
        self._timer: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Take the transport."""
        self.transport = transport

    def connection_lost(self, _: Exception | None) -> None:
        """Let go of the timer."""
        if self._timer is not None:
            self._timer.cancel()

    async def position(self) -> float:
        """Ask S1."""
        return float((await self.exchange(LINE, b"S001:"))[5:])

    def exchange(self, line: bytes, head: bytes) -> asyncio.Future[bytes]:
        """Write *line* in its turn; the answer must begin with *head*."""
        waiter: asyncio.Future[bytes] = self._loop.create_future()
        turn = line, head, waiter
        if self._outstanding is None:
            self._send(turn)
        else:
            self._waiting.append(turn)
        return waiter

    def _send(self, turn: _Turn) -> None:
        self._outstanding = turn
        self._until = self._loop.time() + self._TIMEOUT_S
        if self._timer is None:
            self._timer = self._loop.call_at(self._until, self._look)
        self.transport.write(turn[0])

    def _look(self) -> None:
        """Look whether the time is over; a timer for each line would cost more."""
        self._timer = None
        if self._outstanding is None:
            return
        if self._loop.time() < self._until:
            self._timer = self._loop.call_at(self._until, self._look)
        elif not self._outstanding[2].done():
            self._outstanding[2].set_exception(TimeoutError())

    def data_received(self, data: bytes) -> None:
        """Look for the prompt, and for whose answer stands before it."""
        self._come += data
        answer, prompt, rest = self._come.partition(PROMPT)
        if not prompt or self._outstanding is None:
            return
        self._come = rest
        _, head, waiter = self._outstanding
        if not answer.startswith(head):
            return
        self._outstanding = None
        if not waiter.done():
            waiter.set_result(answer)
        if self._waiting:
            self._send(self._waiting.popleft())
