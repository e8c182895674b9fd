"""
Drives at rest behind lines of 9600 baud, up to a thousand in one process: every byte takes its time on the wire.

Run as ``python -m benchmarks.far_ends.paced LINES``; who measures asks it by :func:`benchmarks.measuring.far_end`. What
comes in one piece has come when its last byte could have come at 9600 baud; then the drive thinks, and its answer is
released as a whole when its last byte would have come, for no client can make anything of the bytes before.
``--by-byte`` releases each byte at its own time: as many times the work, and the same end.

There is no event loop here: a thousand lines are one ``epoll`` and one heap of what is due. It sleeps by ``select()``,
for asyncio's loops round to the millisecond, as long as a byte; and not up to the end, for a sleeper in a virtual
machine wakes a tenth of a millisecond late: with a thousand lines it is awake all the time, and tells how much of it
was work.
What comes on TCP bears the kernel's time of its arrival, so that being late to read it makes no exchange longer.
"""

from __future__ import annotations

import argparse
import contextlib
import gc
import heapq
import json
import os
import select
import socket
import struct
import sys
import time
import tty
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from random import Random
from typing import Final

__all__ = ["ANSWER_TIME_S", "BYTE_TIME_S", "EXCHANGE_S", "MODULE", "POSITION", "QUESTION", "PacedLines", "main"]

MODULE: Final = "benchmarks.far_ends.paced"
"""To be told to :func:`benchmarks.measuring.far_end`."""
BYTE_TIME_S: Final = 10 / 9600
"""A start bit, eight of data and a stop bit."""
ANSWER_TIME_S: Final = 0.0035
"""What a drive thinks; with it a reading takes the 24.3 ms of the figure to be reached, about 41 a second."""
QUESTION: Final = b"S1\r"
POSITION: Final = b"S001: -1234.50\r\n>"
EXCHANGE_S: Final = (len(QUESTION) + len(POSITION)) * BYTE_TIME_S + ANSWER_TIME_S
"""What reading a position takes the wire and the drive alone."""

_HOST: Final = "127.0.0.1"
_PROMPT: Final = b"\r\n>"
_MESSAGE: Final = b"$\r\n>"
_KNOWN: Final[Mapping[bytes, bytes]] = {
    b"S1": POSITION,
    b"S16": b"S016: 11111000\r\n>",
    b"S17": b"S017: 00000010\r\n>",
    b"S30": b"S030: 0 0\r\n>",
    b"P20": b"P020: 0\r\n>",
}
_MOVING: Final[Mapping[bytes, bytes]] = {b"S16": b"S016: 11100000\r\n>", b"S17": b"S017: 00100010\r\n>"}
"""What differs while the axis moves."""
_SAID: Final[Mapping[bytes, bytes]] = {b"S": b"0.00", b"P": b"0", b"V": b"0", b"N": b"END"}
"""What any other status, parameter, variable or record is."""
_MOVE_S: Final = (0.02, 0.08)
"""From the acknowledgement of a move to its ``$``; it differs, so that ``$`` comes at any time of other exchanges."""
_EARLY_S: Final = 0.0003
"""So much before something is due it sleeps no more."""
_SO_TIMESTAMPNS: Final = 35
"""Of Linux; Python's socket module does not name it. The message that bears the time has the same number."""
_TIMESPEC: Final = struct.Struct("@ll")
_ROOM_FOR_TIME: Final = socket.CMSG_SPACE(_TIMESPEC.size)
_MOST_LATE_US: Final = 20_000
_STEP_US: Final = 5
_SLACK: Final = Path("/proc/self/timerslack_ns")


def _answer(line: bytes) -> bytes:
    """Say what a drive at rest does."""
    if (known := _KNOWN.get(line)) is not None:
        return known
    kind, number = line[:1], line[1:]
    if kind not in _SAID or not number.isdigit():
        return _PROMPT
    return b"%s%03d: %s%s" % (kind, int(number), _SAID[kind], _PROMPT)


class _Connection:
    """One who has connected to a line."""

    __slots__ = (
        "descriptor",
        "entry",
        "heard_until",
        "line",
        "move_ends_at",
        "said_at",
        "said_before",
        "said_until",
        "sock",
    )

    def __init__(self, line: int, descriptor: int, sock: socket.socket | None = None) -> None:
        self.line = line
        self.descriptor = descriptor
        """Negative when it is gone."""
        self.sock = sock
        """None on a pseudo-terminal."""
        self.entry = b""
        self.heard_until = self.said_until = 0.0
        """When the last byte has come, and will have gone."""
        self.said_before = self.said_at = 0.0
        """When the last but one and the last of what was said were released."""
        self.move_ends_at: float | None = None
        """None while the axis stands; a stop ends a move without ``$``."""


def _read(connection: _Connection) -> tuple[bytes, float]:
    """Read what has come, and when it came: by the kernel on TCP, else now."""
    if connection.sock is None:
        return os.read(connection.descriptor, 4096), time.monotonic()
    data, told, _, _ = connection.sock.recvmsg(4096, _ROOM_FOR_TIME)
    now = time.monotonic()
    for _, kind, raw in told:
        if kind == _SO_TIMESTAMPNS:
            seconds, nanoseconds = _TIMESPEC.unpack(raw)
            return data, now - max(0.0, time.time() - seconds - nanoseconds * 1e-9)
    return data, now


class Lateness:
    """How much later than it was due everything was released, in steps of 5 µs."""

    def __init__(self) -> None:
        self.counts = [0] * (_MOST_LATE_US // _STEP_US + 1)

    def note(self, late_s: float) -> None:
        """Count one."""
        self.counts[min(int(late_s * (1e6 / _STEP_US)), len(self.counts) - 1)] += 1

    def take(self) -> Mapping[str, float]:
        """Return the percentiles of all since the last time, in microseconds, and how many there were."""
        counts, self.counts = self.counts, [0] * len(self.counts)
        total, told = sum(counts), {}
        for name, share in {"p50": 0.5, "p99": 0.99, "max": 1.0}.items():
            left = share * total
            step = next((step for step, count in enumerate(counts) if (left := left - count) <= 0), 0)
            told[name] = float(step * _STEP_US)
        return {"count": total, **told}


class PacedLines:
    """
    The lines and what is due on them.

    Args:
        by_byte: Release each byte at its own time.
    """

    def __init__(self, *, by_byte: bool = False) -> None:
        self._by_byte = by_byte
        self._random = Random(9600)
        self._epoll = select.epoll()
        self._readers: dict[int, Callable[[], None]] = {}
        self._connections: dict[int, _Connection] = {}
        self._at_line: dict[int, _Connection] = {}
        self._due: list[tuple[float, int, _Connection, bytes]] = []
        self._pushed = 0
        self._idle_s = 0.0
        self._lateness = Lateness()
        self._messages: list[tuple[int, float]] = []
        self._stops: list[tuple[int, float, float, float]] = []
        self._stalled: set[int] = set()
        self._lines = 0
        self._is_wanted = True

    # Where the lines are --------------------------------------------------------------------------------------------

    def listen(self) -> str:
        """Add a line on TCP, and return its URL."""
        server = socket.create_server((_HOST, 0), backlog=8)
        server.setblocking(False)
        line, self._lines = self._lines, self._lines + 1
        self.watch(server.fileno(), lambda: self._accept(line, server))
        return f"tcp://{_HOST}:{server.getsockname()[1]}"

    def _accept(self, line: int, server: socket.socket) -> None:
        client, _ = server.accept()
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        client.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
        client.setblocking(False)
        self._connected(_Connection(line, client.fileno(), client))

    def open_pty(self) -> str:
        """Add a line on a pseudo-terminal, and return its URL."""
        device_end, port_end = os.openpty()
        tty.setraw(port_end)  # which stays open, so that a client may come and go
        os.set_blocking(device_end, False)
        line, self._lines = self._lines, self._lines + 1
        self._connected(_Connection(line, device_end))
        return f"serial://{os.ttyname(port_end)}"

    def _connected(self, connection: _Connection) -> None:
        self._connections[connection.descriptor] = self._at_line[connection.line] = connection
        if connection.line not in self._stalled:
            self._epoll.register(connection.descriptor, select.EPOLLIN)

    def _disconnected(self, connection: _Connection) -> None:
        del self._connections[connection.descriptor]
        with contextlib.suppress(OSError):  # a line that is stalled is not watched
            self._epoll.unregister(connection.descriptor)
        if connection.sock is None:
            os.close(connection.descriptor)
        else:
            connection.sock.close()
        connection.descriptor = -1

    # Time -----------------------------------------------------------------------------------------------------------

    def watch(self, descriptor: int, read: Callable[[], None]) -> None:
        """Call *read* whenever something can be read."""
        self._readers[descriptor] = read
        self._epoll.register(descriptor, select.EPOLLIN)

    def end(self) -> None:
        """Go on no longer."""
        self._is_wanted = False

    def run(self) -> None:
        """Serve all lines until :meth:`end`."""
        due, clock = self._due, time.monotonic
        while self._is_wanted:
            begun_at = clock()
            wait_s = due[0][0] - begun_at - _EARLY_S if due else None
            if wait_s is None or wait_s > 0:
                select.select((self._epoll,), (), (), wait_s)
            woken_at = clock()
            self._idle_s += woken_at - begun_at
            if not self._read_all() | self._release_all():
                self._idle_s += clock() - woken_at

    def _read_all(self) -> bool:
        ready = self._epoll.poll(0)
        for descriptor, _ in ready:
            if (connection := self._connections.get(descriptor)) is not None:
                self._receive(connection)
            else:
                self._readers[descriptor]()
        return bool(ready)

    def _release_all(self) -> bool:
        due, clock = self._due, time.monotonic
        before = len(due)
        while due and due[0][0] <= (now := clock()):
            at, _, connection, data = heapq.heappop(due)
            if data:
                self._release(connection, data, at, now)
            else:
                self._end_move(connection, at)
        return len(due) < before

    def _push(self, at: float, connection: _Connection, data: bytes) -> None:
        self._pushed += 1
        heapq.heappush(self._due, (at, self._pushed, connection, data))

    # What goes over a line ------------------------------------------------------------------------------------------

    def _receive(self, connection: _Connection) -> None:
        try:
            data, came_at = _read(connection)
        except OSError:
            data, came_at = b"", 0.0
        if not data:
            self._disconnected(connection)
            return
        connection.heard_until = max(connection.heard_until, came_at) + len(data) * BYTE_TIME_S
        *lines, connection.entry = (connection.entry + data).split(b"\r")
        for line in lines:
            if line == b"STOP":
                self._stops.append((connection.line, came_at, connection.said_before, connection.said_at))
                connection.move_ends_at = None
            said = _MOVING.get(line) if connection.move_ends_at is not None else None
            self._say(connection, said or _answer(line), connection.heard_until + ANSWER_TIME_S)
            if line.startswith(b"PA") and line.endswith(b"$"):
                self._begin_move(connection)

    def _say(self, connection: _Connection, data: bytes, not_before: float) -> None:
        begins_at = max(connection.said_until, not_before)
        connection.said_until = begins_at + len(data) * BYTE_TIME_S
        if self._by_byte:
            for number in range(len(data)):
                self._push(begins_at + (number + 1) * BYTE_TIME_S, connection, data[number : number + 1])
        else:
            self._push(connection.said_until, connection, data)

    def _release(self, connection: _Connection, data: bytes, at: float, now: float) -> None:
        if connection.descriptor < 0:
            return
        self._lateness.note(now - at)
        connection.said_before, connection.said_at = connection.said_at, now
        if data is _MESSAGE:
            self._messages.append((connection.line, now))
        with contextlib.suppress(OSError):  # nobody takes it, or there is nobody any more: so does a wire lose it
            os.write(connection.descriptor, data)

    def _begin_move(self, connection: _Connection) -> None:
        """Let a move end some time after its acknowledgement; nothing to be released stands for that."""
        connection.move_ends_at = connection.said_until + self._random.uniform(*_MOVE_S)
        self._push(connection.move_ends_at, connection, b"")

    def _end_move(self, connection: _Connection, at: float) -> None:
        if connection.move_ends_at == at:
            connection.move_ends_at = None
            self._say(connection, _MESSAGE, at)

    # What who measures asks -----------------------------------------------------------------------------------------

    def usage(self, _: str) -> object:
        """
        Tell the CPU time and the time without work until now; and how late all was released since the last time.

        ``idle_s`` is time on the wall, asleep or looking in vain; lateness is in microseconds.
        """
        at_s, late_us = time.monotonic(), self._lateness.take()
        return {"at_s": at_s, "cpu_s": time.process_time(), "idle_s": self._idle_s, "late_us": late_us}

    def happened(self, _: str) -> object:
        """
        Tell what happened since the last time, by CLOCK_MONOTONIC, which all processes share.

        ``messages``: line, and when its ``$`` was about to be written, unless ``--by-byte``. ``stops``: line, when all
        of STOP had come, and when the last byte of the last but one and of the last answer before it was about to be
        written.
        """
        messages, self._messages = self._messages, []
        stops, self._stops = self._stops, []
        return {"messages": messages, "stops": stops}

    def stall(self, line: str) -> object:
        """Read nothing from a line any more and say nothing on it, whoever connects to it, until :meth:`mend`."""
        connection = self._at_line[int(line)]
        self._stalled.add(connection.line)
        self._epoll.unregister(connection.descriptor)
        self._due[:] = [each for each in self._due if each[2] is not connection]
        heapq.heapify(self._due)
        return True

    def mend(self, line: str) -> object:
        """Serve whoever connects to that line from now on."""
        self._stalled.discard(int(line))
        return True


class _Asked:
    """Answers questions as :func:`benchmarks.measuring.stay` does, between what is due."""

    def __init__(self, lines: PacedLines) -> None:
        self._lines = lines
        self._entry = b""
        self._answers: Mapping[str, Callable[[str], object]] = {
            "cpu_s": lambda _: time.process_time(),
            "usage": lines.usage,
            "happened": lines.happened,
            "stall": lines.stall,
            "mend": lines.mend,
        }

    def read(self) -> None:
        """Answer what has come; end with the standard input."""
        data = os.read(sys.stdin.fileno(), 4096)
        if not data:
            self._lines.end()
        *questions, self._entry = (self._entry + data).split(b"\n")
        for question in questions:
            word, _, rest = question.decode().strip().partition(" ")
            print(json.dumps(self._answers[word](rest)), flush=True)


def main(argv: Sequence[str] | None = None) -> int:
    """Serve until the standard input ends."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("lines", type=int, help="how many on TCP")
    parser.add_argument("--ptys", type=int, default=0, help="and how many on pseudo-terminals (0)")
    parser.add_argument("--by-byte", action="store_true", help="release each byte at its own time")
    options = parser.parse_args(argv)
    lines = PacedLines(by_byte=options.by_byte)
    where = {
        "tcp": [lines.listen() for _ in range(options.lines)],
        "pty": [lines.open_pty() for _ in range(options.ptys)],
    }
    lines.watch(sys.stdin.fileno(), _Asked(lines).read)
    with contextlib.suppress(OSError):  # 50 µs by default; nobody may set it but for himself, on Linux
        _SLACK.write_text("1")
    gc.collect()
    gc.disable()  # nothing here refers to itself, and looking for it would be late
    print(json.dumps(where), flush=True)
    lines.run()
    return 0


if __name__ == "__main__":
    sys.exit(main())
