"""Lines as the bytes on the wire show them, by rules of its own: it shares no code with the client."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

from compax_aio.smc.settings import SmcSettings

from ..hunt.testimony import WireEntry, WireKind

__all__ = ["Spoken", "SpokenLine"]

_LF: Final = 0x0A
_CR: Final = 0x0D
_ESC: Final = 0x1B
_RESET: Final = 0x03
_BACKSPACE: Final = 0x08
_SPACE: Final = 0x20
_PREEMPTS: Final = frozenset({_ESC, _RESET})
_SLACK_S: Final = 1e-6
_BACKSPACE_S: Final = 0.03
_ESCAPE_S: Final = 0.005
_MOST_OF_A_RESULT: Final = 64


@dataclass(slots=True)
class SpokenLine:
    """What was typed between two things that end or clear a line."""

    index: int
    """Of its first character among all that happened on the line."""
    at: float
    """When that was written."""
    text: str = ""
    """With the name, as far as it was typed."""
    is_whole: bool = False
    """Its terminator was written, after all echoes."""
    ended_at: float = float("inf")
    """When its terminator, or what cleared it, was written."""

    @property
    def name(self) -> str:
        """The character in front."""
        return self.text[:1]


@dataclass(slots=True)
class Spoken:
    """
    What the client has said on one line, and where it spoke out of turn.

    Args:
        wire: All that happened.
        settings: How long the client must wait.
        mode: How the axes take commands.
    """

    wire: list[WireEntry]
    settings: SmcSettings
    mode: str
    slack_s: float = _SLACK_S
    """By so much the times of the wire may be wrong."""
    lines: list[SpokenLine] = field(default_factory=list)
    wrong_at: list[tuple[int, str]] = field(default_factory=list)
    """What was out of turn, each with its place among all that happened."""
    preempts: list[int] = field(default_factory=list)
    """Indexes of ESC and ^C."""
    _last: int | None = None
    _last_at: float = 0.0
    _is_clearing: bool = False
    """The last byte clears, and is not one of a line."""
    _heard: bytearray = field(default_factory=bytearray)
    _line: SpokenLine | None = None
    _ended_text: str = ""
    _has_heard: bool = False
    _is_ambiguous: bool = False

    def __post_init__(self) -> None:
        for index, entry in enumerate(self.wire):
            if entry.text.startswith("flood"):
                return  # what the client reads of it, it reads when it has time
            if entry.kind in {WireKind.OPENED, WireKind.LOST, WireKind.CLOSED}:
                self._last = self._line = None
            elif entry.kind is WireKind.READ:
                if entry.at <= self._last_at + self._patience_s() + self.slack_s:  # else nobody waited for it any more
                    self._heard += entry.data
                self._has_heard = True
            elif entry.kind is WireKind.WRITTEN:
                self._written(index, entry)

    @property
    def wrongs(self) -> list[str]:
        """What was out of turn."""
        return [how for _, how in self.wrong_at]

    def between(self, first: int, end: int) -> Iterator[SpokenLine]:
        """List the lines that were begun there."""
        return (line for line in self.lines if first <= line.index < end)

    @property
    def _end(self) -> int:
        return _CR if self.mode == "single" else _LF

    def _written(self, index: int, entry: WireEntry) -> None:
        if len(entry.data) != 1:
            self.wrong_at.append((index, f"{entry}: more than one character at a time"))
        for byte in entry.data:
            self._take(index, entry.at, byte)
        self._heard.clear()
        self._has_heard = False

    def _take(self, index: int, at: float, byte: int) -> None:
        was_echoed = self._was_echoed()
        # An echo that comes as its time runs out may be too late, or not.
        came_late = abs(at - self._last_at - self._patience_s()) < self.slack_s
        # A name that a ring has dealt comes back as another one, and so does one that was damaged.
        is_dealt = self.mode == "daisy" and not was_echoed and self._has_heard and byte == _LF
        clears = self._clears(byte, was_echoed=was_echoed)
        if byte not in _PREEMPTS and (why := self._too_early(at, was_echoed=was_echoed, clears=clears)):
            self.wrong_at.append((index, f"at {at:.4f} s {chr(byte)!r} although {why}"))
        if byte in _PREEMPTS:
            self.preempts.append(index)
        if clears or byte in _PREEMPTS or byte == self._end:
            self._end_line(at, is_whole=not clears and byte == self._end)
        else:
            if self._line is None:
                self._line = SpokenLine(index, at)
                if self._last != _RESET:  # a name that is given is no line
                    self.lines.append(self._line)
            self._line.text += chr(byte)
        self._last, self._last_at, self._is_clearing = byte, at, clears
        self._is_ambiguous = is_dealt or came_late

    def _end_line(self, at: float, *, is_whole: bool) -> None:
        self._ended_text = self._line.text if self._line is not None else ""
        if self._line is not None:
            self._line.is_whole, self._line.ended_at = is_whole, at
            self._line = None

    def _was_echoed(self) -> bool:
        """Whether what was written last has come back."""
        if self._last is None:
            return True
        if self._last == self._end and not self._is_clearing:
            return _LF in self._heard or (self._end == _CR and b"#" in self._heard)
        heard = self._heard.lstrip(b"\n") if self._last != _LF else self._heard
        return heard[:1] == bytes((self._last,))

    def _clears(self, byte: int, *, was_echoed: bool) -> bool:
        """Whether *byte* is to empty buffers, and no part of a line."""
        if byte == _LF and self._end == _LF:
            # More than the echo of the last character came: whether all of it was taken, or too much, ends the same.
            return self._line is None or not was_echoed or len(self._heard.strip(b"\n")) > 1
        if self._end == _CR:
            return byte == _BACKSPACE or (byte == _SPACE and (self._line is None or not was_echoed))
        return False

    def _too_early(self, at: float, *, was_echoed: bool, clears: bool) -> str | None:
        if self._last is None:
            return None
        waited_s = at - self._last_at + self.slack_s
        if self._is_ambiguous:
            return None
        last = chr(self._last)
        if self._is_clearing or self._last in _PREEMPTS:
            need_s = {_BACKSPACE: _BACKSPACE_S, _ESC: _ESCAPE_S, _RESET: self.settings.profile.reset_time_s}.get(
                self._last, self.settings.quiet_s
            )
            return f"{last!r} was {waited_s:.4f} s ago, not {need_s:g}" if waited_s < need_s else None
        if was_echoed:
            return None
        if self._last == self._end:
            need_s, is_over = self._answer_s(), len(self._heard) > _MOST_OF_A_RESULT
        elif not clears:
            return f"{last!r} has not come back"
        else:
            need_s, is_over = self.settings.echo_timeout_s, self._has_heard  # another character has
        return f"{last!r} has had no answer for {waited_s:.4f} s" if waited_s < need_s and not is_over else None

    def _patience_s(self) -> float:
        """Return how long what was written last is waited for."""
        return self._answer_s() if self._last == self._end else self.settings.echo_timeout_s

    def _answer_s(self) -> float:
        """Return how long an answer to the last line is waited for; what gets a line in step has as long as an echo."""
        gets_in_step = self.mode == "single" or self._ended_text.endswith("@") or len(self._ended_text) <= 1
        return self.settings.echo_timeout_s if gets_in_step else self.settings.answer_timeout_s
