"""Machine data collection of a simulated control: requests in, answers out, and what too many of them do to it."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Callable, Mapping
from math import inf, isnan, nan
from typing import Final

from compax_aio.haas.facts.characters import CARRIAGE_RETURN, ETB, LINE_FEED, PROMPT, STX
from compax_aio.haas.facts.port_settings import DATA_COLLECTION, DATA_ECHO
from compax_aio.haas.facts.queries import BUSY, QUERIES, UNKNOWN_REQUEST, WRITE_DONE

from .log import LogKind
from .running import Running
from .surroundings import Surroundings
from .transmitter import Transmitter
from .trouble import Trouble

__all__ = ["Collection"]

_SAME_TIME_S: Final = 1e-9
"""Times are sums, and no more exact than that."""
_LONGEST_REQUEST: Final = 64
_MOST_UNANSWERED: Final = 4096
"""Bytes of answers that wait; while there are more, requests are not heard."""
_MOST_GAPS: Final = 100_000
_HIGHEST_VARIABLE: Final = 20_000
_SYSTEM_VARIABLES: Final = range(1000, 10_000)
_READ: Final = "Q600"
_WRITE: Final = re.compile(r"(\d{1,6}) +([-+]?(?:\d{1,12}(?:\.\d{0,12})?|\.\d{1,12}))")


class Collection:
    """
    Answers requests while the control is at nothing else.

    Args:
        around: Of the control.
        running: What its cycles and counters say.
        transmitter: Where answers go.
        trouble: What becomes of them.

    Attributes:
        gaps_s: For how long the line was quiet in front of each request since the answer before, oldest first.
        requests: How many have come.
    """

    def __init__(self, around: Surroundings, running: Running, transmitter: Transmitter, trouble: Trouble) -> None:
        self._around = around
        self._knobs = around.knobs
        self._running = running
        self._transmitter = transmitter
        self._trouble = trouble
        self.gaps_s: deque[float] = deque(maxlen=_MOST_GAPS)
        self.requests = 0
        self.begin_anew()
        self._answers: Mapping[str, Callable[[], str]] = {
            "Q100": lambda: self._knobs.serial_number,
            "Q101": lambda: self._knobs.software,
            "Q102": lambda: self._knobs.model,
            "Q104": self._mode,
            "Q200": lambda: str(running.tool_changes),
            "Q201": lambda: str(running.tool),
            "Q300": lambda: _duration(running.power_on_s(around.now)),
            "Q301": lambda: _duration(running.motion_s(around.now)),
            "Q303": lambda: _duration(running.last_cycle_s),
            "Q304": lambda: _duration(running.previous_cycle_s),
            "Q402": lambda: str(running.m30_counts[0]),
            "Q403": lambda: str(running.m30_counts[1]),
            "Q500": self._status,
        }

    def begin_anew(self) -> None:
        """Forget what was asked."""
        self._line = bytearray()
        self._began_at = 0.0
        self._answered_at = -inf
        self._close_ones = 0
        self._printed_inside: deque[bytes] = deque()
        self.connected()

    def connected(self) -> None:
        """Take note of a new connection."""
        self._line.clear()
        self._is_first_lost = self._knobs.first_request_lost

    @property
    def is_on(self) -> bool:
        """Whether requests are answered (Setting 143)."""
        return self._around.memory.is_on(DATA_COLLECTION, otherwise=self._knobs.collection != "off")

    # Requests

    def feed(self, data: bytes, at: float, step_s: float) -> None:
        """Take bytes, of which the first came *at*."""
        for place, byte in enumerate(data):
            if byte in {CARRIAGE_RETURN, LINE_FEED}:
                line = self._line.decode("latin-1")
                self._line.clear()
                if line.strip():
                    self._ask(line, at + place * step_s)
                continue
            if not self._line:
                self._began_at = at + place * step_s
            if len(self._line) < _LONGEST_REQUEST:
                self._line.append(byte)

    def _ask(self, line: str, now: float) -> None:
        around = self._around
        around.reach(now)
        self.requests += 1
        gap_s = self._began_at - max(self._answered_at, self._transmitter.ends_at if self._is_answering(now) else -inf)
        self.gaps_s.append(gap_s)
        quiet = "" if gap_s == inf else f" after {gap_s:.3g} s"
        around.note(LogKind.REQUEST, f"{line}{quiet}", now)
        self._look_whether_it_freezes(gap_s)
        if around.is_frozen or self._transmitter.pending_bytes > _MOST_UNANSWERED:
            return
        if self._is_first_lost:
            self._is_first_lost = False
            return
        if around.memory.is_on(DATA_ECHO, self._knobs.echoes):
            self._transmitter.send(line.encode("latin-1") + b"\r\n", now)
        if foreign := self._trouble.foreign():
            self._send(foreign, now)
        self._answer(self._answer_to(line.strip()), now)

    def _is_answering(self, now: float) -> bool:
        return self._transmitter.ends_at > now

    def _look_whether_it_freezes(self, gap_s: float) -> None:
        knobs = self._knobs
        self._close_ones = self._close_ones + 1 if gap_s < knobs.freeze_gap_s - _SAME_TIME_S else 0
        if knobs.freeze_after and self._close_ones >= knobs.freeze_after and not self._around.is_frozen:
            self._around.is_frozen = True
            self._around.note(LogKind.FROZEN, f"{self._close_ones} requests, none after {knobs.freeze_gap_s:g} s")

    # Answers

    def _answer_to(self, line: str) -> str:
        command = line.removeprefix("?")
        name, _, rest = command.partition(" ")
        if self._running.is_cycling and (self._knobs.busy_answers == "all" or command == "Q500"):
            return BUSY
        if command in self._answers:
            return f"{self._head(command)}, {self._answers[command]()}"
        if name == _READ:
            return self._read(rest.strip())
        if command.startswith("E"):
            return self._write(command[1:].strip())
        return UNKNOWN_REQUEST

    @property
    def _is_classic(self) -> bool:
        return self._knobs.collection != "ethernet"

    def _head(self, command: str) -> str:
        row = QUERIES[command]
        return row.classic if self._is_classic else row.ethernet

    def _mode(self) -> str:
        mode = self._running.mode
        return f"({mode})" if self._is_classic else mode

    def _status(self) -> str:
        running = self._running
        word = "ALARM ON" if self._around.alarms else "FEED HOLD" if running.is_held else "IDLE"
        return f"{running.program}, {word}, PARTS, {running.parts}"

    def _value(self, number: int) -> float | None:
        """Return the value of a variable; NaN: it is empty; None: there is none."""
        if number in self._around.memory.macros:
            return self._around.memory.macros[number]
        if (value := self._running.variable(number, self._around.now)) is not None:
            return value
        if number in _SYSTEM_VARIABLES:
            return 0.0
        return nan if 0 <= number <= _HIGHEST_VARIABLE else None

    def _read(self, text: str) -> str:
        value = self._value(int(text)) if text.isdigit() and text.isascii() else None
        if value is None:
            return UNKNOWN_REQUEST
        if not self._is_classic:
            return f"{self._head(_READ)}, {'NaN' if isnan(value) else round(value, 6)}"
        shown = "NaN" if isnan(value) else f"{value:.4f}"
        return f"{self._head(_READ)}, {text.lstrip('0') or '0'},{shown:>{self._knobs.value_width}}"

    def _write(self, text: str) -> str:
        memory, found = self._around.memory, _WRITE.fullmatch(text)
        if found is None:
            return UNKNOWN_REQUEST
        number, value = int(found[1]), float(found[2])
        if number not in memory.macros and not memory.can_write(number):
            return UNKNOWN_REQUEST
        was = memory.macros.get(number, nan)
        memory.macros[number] = value
        self._around.note(LogKind.WRITTEN, f"#{number} = {value:g} (was {'empty' if isnan(was) else f'{was:g}'})")
        return WRITE_DONE

    def _answer(self, text: str, now: float) -> None:
        if text == WRITE_DONE and self._knobs.write_answer == "none":
            return
        self._around.note(LogKind.ANSWER, text, now)
        texts, late_s = self._trouble.reply(text)
        for each in texts:
            self._send(each, now + self._knobs.answer_time_s + late_s)
        self._answered_at = max(self._transmitter.ends_at, now)

    def _send(self, text: str, not_before: float) -> None:
        self._transmitter.send(self._framed(text), not_before)

    def _framed(self, text: str) -> bytes:
        data = text.encode("latin-1")
        if text == WRITE_DONE and self._knobs.write_answer == "bare":
            return data
        if not self._is_classic:
            return bytes([PROMPT]) + data + b"\r\n"
        if self._printed_inside:
            middle = len(data) // 2
            data = data[:middle] + self._printed_inside.popleft() + data[middle:]
        return bytes([STX]) + data + bytes([ETB, CARRIAGE_RETURN, LINE_FEED, PROMPT])

    def overheard(self, text: str, now: float) -> None:
        """Send an answer to another host."""
        self._send(text, now)

    def printed(self, text: str, now: float) -> None:
        """Print a line of a program: between answers, or inside the next one."""
        data = text.replace("*", " ").encode("latin-1", "replace") + b"\r"
        self._around.note(LogKind.PRINTED, data[:-1].decode("latin-1"), now)
        if self._knobs.dprnt_inside and self._is_classic:
            self._printed_inside.append(data)
        else:
            self._transmitter.send(data, now)


def _duration(seconds: float) -> str:
    minutes, second = divmod(int(seconds), 60)
    hours, minute = divmod(minutes, 60)
    return f"{hours:05d}:{minute:02d}:{second:02d}"
