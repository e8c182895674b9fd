"""Who plays the drive's side of a recorded conversation: strictly byte for byte, or leniently line by line."""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from heapq import heappop, heappush
from itertools import chain, count
from typing import Final, cast

from ..errors import ConnectionLostError
from ..link.contract import Lane
from ..link.taps import Asked, Ended, Lost, Noticed, Received, Sent, Way
from ..link.wire import readable
from ..transports.loopback import LoopbackTransport
from .replay_script import Attempt, Script
from .trace_entries import TraceEntry

__all__ = ["Answers", "LenientFarEnd", "StrictFarEnd"]

_ENDS_A_LINE: Final = (b"\r", b"\n")
_STANDS_ALONE: Final = frozenset({0x03, 0x1B})
"""^C and ESC, which a device may heed at any time."""
_LONGEST_KEY: Final = 256
_SHOWN: Final = 60

_log = logging.getLogger("compax_aio.recording.replay")


class _FarEnd(asyncio.Protocol):
    def __init__(self, speed: float) -> None:
        self._speed = speed
        self._loop = asyncio.get_running_loop()
        self._transport: LoopbackTransport | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._due: list[tuple[float, int, Callable[[], None]]] = []
        """A heap of what comes when; of what comes at one time, what was said first."""
        self._said = count()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast("LoopbackTransport", transport)

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002
        self._transport = None
        self._due.clear()
        self._set_timer()

    def _scaled(self, seconds: float) -> float:
        return max(seconds, 0.0) / self._speed if self._speed else 0.0

    def _at(self, when: float, do: Callable[[], None]) -> None:
        # One timer for all: those of an event loop come in any order when they are for the same time.
        heappush(self._due, (when, next(self._said), do))
        self._set_timer()

    def _set_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self._loop.call_at(self._due[0][0], self._do_what_is_due) if self._due else None

    def _do_what_is_due(self) -> None:
        now = max(self._loop.time(), self._due[0][0])
        due = []
        while self._due and self._due[0][0] <= now:
            due.append(heappop(self._due)[2])
        for do in due:
            do()
        self._set_timer()

    def _play(self, entry: TraceEntry) -> None:
        if self._transport is None:
            return
        if isinstance(entry.fact, Received):
            self._transport.write(entry.fact.data)
        elif isinstance(entry.fact, Lost) and entry.fact.why is None:
            self._transport.close()
        elif isinstance(entry.fact, Lost):
            self._transport.fail(ConnectionLostError(entry.fact.why or "the line was lost"))


# Strict -------------------------------------------------------------------------------------------------------------


class StrictFarEnd(_FarEnd):
    """
    Plays one attempt as it went; whoever says something else than was said then loses the line.

    Args:
        script: Of the whole conversation, for errors.
        attempt: What is played.
        speed: How many times as fast; 0: each step at once.
        on_deviation: Called with what was wrong.
    """

    def __init__(self, script: Script, attempt: Attempt, speed: float, on_deviation: Callable[[str], None]) -> None:
        super().__init__(speed)
        self._script = script
        self._steps = [step for step in attempt.steps if not isinstance(step.fact, Noticed)]
        self._on_deviation = on_deviation
        self._sent = self._next_sent(0)
        """Index of what is to be sent next …"""
        self._offset = 0
        """… and how much of it was."""
        self._played = 0
        """All before that index are done, but for what is to be sent."""
        self._before = (attempt.opened_at or 0.0, self._loop.time())
        """When the step before was, then and now."""
        self._times: dict[int, float] = {}
        self._is_waiting = False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin to play."""
        super().connection_made(transport)
        self._go_on()

    def data_received(self, data: bytes) -> None:
        """Compare what was written with what was sent then."""
        while data and self._transport is not None:
            if self._sent >= len(self._steps):
                self._deviate(self._steps[-1] if self._steps else None, b"", data)
                return
            step = self._steps[self._sent]
            wanted = cast("Sent", step.fact).data[self._offset :]
            if not wanted.startswith(data[: len(wanted)]):
                self._deviate(step, wanted, data)
                return
            self._offset += min(len(wanted), len(data))
            data = data[len(wanted) :]
            if self._offset == len(cast("Sent", step.fact).data):
                self._times[self._sent] = self._loop.time()
                self._sent, self._offset = self._next_sent(self._sent + 1), 0
        self._go_on()

    def _next_sent(self, begin: int) -> int:
        steps = self._steps
        return next((at for at in range(begin, len(steps)) if isinstance(steps[at].fact, Sent)), len(steps))

    def _go_on(self) -> None:
        """Play what comes next, unless something must be sent before."""
        while self._transport is not None and not self._is_waiting and self._played < len(self._steps):
            step = self._steps[self._played]
            if isinstance(step.fact, Sent):
                if self._played >= self._sent:
                    return
                self._before = step.at, self._times.pop(self._played)
                self._played += 1
                continue
            then, now = self._before
            due = now + self._scaled(step.at - then)
            if due > self._loop.time():
                self._is_waiting = True
                self._at(due, self._wake)
                return
            self._before = step.at, due if self._speed else self._loop.time()
            self._played += 1
            self._play(step)

    def _wake(self) -> None:
        self._is_waiting = False
        self._go_on()

    def _deviate(self, step: TraceEntry | None, wanted: bytes, got: bytes) -> None:
        where = self._script.place(step) if step is not None else str(self._script.path)
        then = repr(readable(wanted[:_SHOWN])) if wanted else "nothing more"
        what = f"the replay deviates from {where}: {then} was sent then, and now {readable(got[:_SHOWN])!r}"
        _log.error("%s", what)
        self._on_deviation(what)
        assert self._transport is not None
        self._transport.fail(ConnectionLostError(what))


# Lenient ------------------------------------------------------------------------------------------------------------


@dataclass(slots=True, eq=False)
class _Spoken:
    """One line, or one piece of a line that went out in pieces, and what came of it."""

    at: float
    answers: list[TraceEntry] = field(default_factory=list)
    later: list[TraceEntry] = field(default_factory=list)
    """What came unasked, until the next line that told something."""
    is_pure: bool = True
    """Nothing unasked came before the answer was over, so that it is as true when it comes again."""


class Answers:
    """
    What was answered to what, in a whole conversation.

    A line is what is written up to CR or LF; of one that goes out in pieces each piece is known by what the line has
    become by it. What came unasked belongs to the last line before it that told something, and asked nothing.
    """

    def __init__(self, script: Script) -> None:
        self.on_opening: dict[Attempt, _Spoken] = {}
        """What came before anything was told."""
        self._spoken: dict[bytes, deque[_Spoken]] = {}
        self._last: dict[bytes, _Spoken] = {}
        self._asking = _asking(script)
        for attempt in script.attempts:
            self._learn(attempt)

    def of(self, key: bytes) -> tuple[_Spoken | None, bool]:
        """Return what comes of a line, and whether that is for the first time."""
        waiting = self._spoken.get(key)
        if waiting:
            spoken = waiting.popleft()
            if spoken.is_pure:
                self._last[key] = spoken
            return spoken, True
        is_whole = key.endswith(_ENDS_A_LINE) or key[:1] >= b"\x80"
        return (self._last.get(key), False) if self._asks(key) or not is_whole else (None, False)

    def _asks(self, key: bytes) -> bool:
        return key.rstrip(b"\r\n").decode("latin-1") in self._asking

    def _learn(self, attempt: Attempt) -> None:
        teller = self.on_opening[attempt] = _Spoken(attempt.opened_at or 0.0)
        current: _Spoken | None = None
        reader = _LineReader()
        for step in attempt.steps:
            match step.fact:
                case Sent(data=data):
                    for key in reader.keys(data):
                        current = _Spoken(step.at)
                        self._spoken.setdefault(key, deque()).append(current)
                        if reader.is_whole and not self._asks(key):
                            teller = current
                case Noticed(ends_turn=True):
                    current = None
                case Noticed() if current is not None:
                    current.is_pure = False
                case Received() if current is not None:
                    current.answers.append(step)
                case Received() | Lost():
                    teller.later.append(step)


class _LineReader:
    """Finds out what a line has become by each piece of it."""

    def __init__(self) -> None:
        self.is_whole = False
        self._line = b""

    def keys(self, data: bytes) -> list[bytes]:
        """Take a piece; return the lines that it ends, and what it leaves of another."""
        if data[:1] >= b"\x80":  # a frame, which has no end sign and may hold any byte
            self.is_whole, self._line = True, b""
            return [data]
        keys = []
        begin = 0
        for at, byte in enumerate(data):
            if byte in _STANDS_ALONE:
                keys.append(bytes((byte,)))
                begin, self._line, self.is_whole = at + 1, b"", True
            elif bytes((byte,)) in _ENDS_A_LINE:
                keys.append((self._line + data[begin : at + 1])[-_LONGEST_KEY:])
                begin, self._line, self.is_whole = at + 1, b"", True
        if begin < len(data):
            self._line = (self._line + data[begin:])[-_LONGEST_KEY:]
            self.is_whole = False
            keys.append(self._line)
        return keys


def _asking(script: Script) -> set[str]:
    """Find the lines that ask something, by what was answered to them."""
    texts: dict[int, str] = {}
    asking = set()
    for entry in script.conversation.entries:
        match entry.fact:
            case Asked(number=number, text=text, lane=lane):
                texts[number] = text
                if lane in {Lane.READ, Lane.GREETING}:
                    asking.add(text)
            case Ended(number=number, how="Answered", text=str(answer)) if answer and number in texts:
                asking.add(texts.pop(number))
            case Ended(number=number):
                texts.pop(number, None)
            case Sent(data=data, way=Way.MARKER):
                asking.add(data.rstrip(b"\r\n").decode("latin-1"))
    return asking


class LenientFarEnd(_FarEnd):
    """
    Answers each line by what came the next time that it was said in the trace; what was never said it ignores.

    Args:
        answers: What is left of them; shared by all attempts.
        attempt: What came on it before anything was told comes again.
        speed: How many times as fast; 0: at once.
    """

    def __init__(self, answers: Answers, attempt: Attempt | None, speed: float) -> None:
        super().__init__(speed)
        self._answers = answers
        self._attempt = attempt
        self._reader = _LineReader()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Say what came of itself when the line was opened."""
        super().connection_made(transport)
        if self._attempt is not None:
            self._say(self._answers.on_opening[self._attempt], is_first=True)

    def data_received(self, data: bytes) -> None:
        """Answer what was written."""
        for key in self._reader.keys(data):
            spoken, is_first = self._answers.of(key)
            if spoken is not None:
                self._say(spoken, is_first=is_first)

    def _say(self, spoken: _Spoken, *, is_first: bool) -> None:
        now = self._loop.time()
        for step in chain(spoken.answers, spoken.later if is_first else ()):
            self._at(now + self._scaled(step.at - spoken.at), partial(self._play, step))
