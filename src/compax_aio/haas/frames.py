"""
What comes over a control's port taken apart, sans-IO: answers of data collection, printed text, and what is left over.

Over RS-232 an answer is STX, text, ETB, CR LF and a prompt, ``>``; over Ethernet it is ``>``, text and CR LF. Programs
print (DPRNT) between answers, and even within one: then it cannot be told what belongs to which, and the answer counts
as broken. Nothing is found by its place, only by its signs.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from enum import Enum
from typing import Final, Literal

from .facts.characters import (
    ACK,
    CAN,
    CARRIAGE_RETURN,
    DC1,
    DC2,
    DC3,
    DC4,
    DELETE,
    EOT,
    ETB,
    LINE_FEED,
    NAK,
    NUL,
    PROMPT,
    SPACE,
    STX,
)
from .facts.queries import WRITE_DONE

__all__ = ["Broken", "Echo", "Form", "Frame", "FrameSplitter", "Line", "Outside", "Part", "PrintReader", "Prompt"]

Form = Literal["rs-232", "ethernet"]

_LONGEST_FRAME: Final = 256
"""Answers have a dozen to fifty characters."""
_LONGEST_LINE: Final = 512
_MOST_ECHOES: Final = 8
_TAIL: Final = bytes([CARRIAGE_RETURN, LINE_FEED, PROMPT])
_LINE_ENDS: Final = bytes([CARRIAGE_RETURN, LINE_FEED])
_LEFT_OVER: Final = (bytes([PROMPT]), WRITE_DONE.encode())
"""The end of an answer whose beginning was lost; and an answer to a write that has no frame."""
_NOT_PRINTED: Final = frozenset({NUL, DELETE, DC1, DC2, DC3, DC4, ACK, NAK, CAN, EOT})
"""Leader, flow control, what POPEN and PCLOS send, and what comes behind a file by XMODEM."""


@dataclass(frozen=True, slots=True)
class Frame:
    """A whole answer, without its signs."""

    text: str


@dataclass(frozen=True, slots=True)
class Broken:
    """What began like an answer and is none: damaged, cut short, too long, or with something else in it."""

    data: bytes


@dataclass(frozen=True, slots=True)
class Prompt:
    """The control is through with its answer."""


@dataclass(frozen=True, slots=True)
class Outside:
    """What belongs to no answer: printed text, a file, an echo."""

    data: bytes
    is_damaged: bool = False


Part = Frame | Broken | Prompt | Outside


class _State(Enum):
    OUTSIDE = "outside"
    INSIDE = "in an answer"
    TAIL = "behind an answer"


class FrameSplitter:
    """
    Takes answers out of what comes, in pieces of any size.

    Args:
        form: How answers are framed.
    """

    def __init__(self, form: Form = "rs-232") -> None:
        self._form = form
        self._state = _State.OUTSIDE
        self._held = bytearray()
        self._is_broken = False
        self._tail = b""
        """What may still come of CR LF and the prompt behind an answer."""
        self._owes_prompt = False
        """Whether something else came between an answer and its prompt."""
        self._is_line_start = True
        self._next_is_damaged = False

    @property
    def is_inside(self) -> bool:
        """Whether an answer has begun, and has not ended."""
        return self._state is _State.INSIDE

    @property
    def awaits_prompt(self) -> bool:
        """Whether an answer is complete, but for its prompt."""
        return self._state is _State.TAIL or self._owes_prompt

    def note_damage(self) -> None:
        """Take note that the byte that is fed next came damaged."""
        self._next_is_damaged = True

    def give_up(self) -> list[Part]:
        """Expect no more of an answer that has begun; return what had come of it."""
        parts: list[Part] = [Broken(bytes(self._held))] if self.is_inside else []
        self._owes_prompt = False
        self._leave()
        return parts

    def feed(self, data: bytes) -> list[Part]:
        """Return what *data* completes, in order; what is outside of answers, at once."""
        parts: list[Part] = []
        if self._next_is_damaged and data:
            self._next_is_damaged = False
            self._take_damaged(data[0], parts)
            data = data[1:]
        at = 0
        while at < len(data):
            if self._state is _State.OUTSIDE:
                end = self._next_start(data, at)
                if end > at:
                    self._put_outside(data[at:end], parts)
                    at = end
                    continue
            self._take(data[at], parts)
            at += 1
        return parts

    # Where an answer begins -----------------------------------------------------------------------------------------

    def _next_start(self, data: bytes, at: int) -> int:
        """Return where the next byte is that :meth:`_take` must see; up to there, all is outside."""
        if self._form == "rs-232" and not self._owes_prompt:
            found = data.find(STX, at)
            return len(data) if found < 0 else found
        for index in range(at, len(data)):
            is_line_start = self._is_line_start if index == at else data[index - 1] in _LINE_ENDS
            is_sign = data[index] == PROMPT and is_line_start
            if is_sign or (self._form == "rs-232" and data[index] == STX):
                return index
        return len(data)

    def _take(self, byte: int, parts: list[Part]) -> None:
        if self._state is _State.INSIDE:
            self._take_inside(byte, parts)
        elif self._form == "ethernet" or byte == STX:
            self._enter()
        elif self._state is _State.TAIL:
            self._take_tail(byte, parts)
        else:  # the prompt that was owed
            self._close(parts)

    def _enter(self) -> None:
        self._state = _State.INSIDE
        self._held.clear()
        self._is_broken = self._owes_prompt = False

    # In and behind an answer ----------------------------------------------------------------------------------------

    def _take_inside(self, byte: int, parts: list[Part]) -> None:
        held = self._held
        if self._form == "ethernet":
            self._take_inside_line(byte, parts)
        elif byte == STX:
            parts.append(Broken(bytes(held)))
            self._enter()
        elif byte == ETB:
            self._complete(parts)
            self._state, self._tail = _State.TAIL, _TAIL
        else:
            held.append(byte)
            self._is_broken |= not SPACE <= byte < DELETE
            if held.endswith(_TAIL):  # ETB was lost
                parts.append(Broken(bytes(held[: -len(_TAIL)])))
                self._close(parts)
            else:
                self._check_length(parts)

    def _take_inside_line(self, byte: int, parts: list[Part]) -> None:
        held = self._held
        if byte == LINE_FEED:
            if held.endswith(bytes([CARRIAGE_RETURN])):
                held.pop()
            if held:
                self._complete(parts)
            self._close(parts)
        elif byte != PROMPT or held:
            self._is_broken |= held.endswith(bytes([CARRIAGE_RETURN]))
            held.append(byte)
            self._is_broken |= byte != CARRIAGE_RETURN and not SPACE <= byte < DELETE
            self._check_length(parts)

    def _complete(self, parts: list[Part]) -> None:
        data = bytes(self._held)
        parts.append(Broken(data) if self._is_broken else Frame(data.decode("ascii")))
        self._held.clear()

    def _check_length(self, parts: list[Part]) -> None:
        if len(self._held) > _LONGEST_FRAME:
            parts.append(Broken(bytes(self._held)))
            self._leave()
            self._is_line_start = False

    def _take_tail(self, byte: int, parts: list[Part]) -> None:
        at = self._tail.find(byte)
        if at < 0:
            self._leave()
            self._owes_prompt = True
            self._put_outside(bytes([byte]), parts)
        elif byte == PROMPT:
            self._close(parts)
        else:
            self._tail = self._tail[at + 1 :]

    def _close(self, parts: list[Part]) -> None:
        parts.append(Prompt())
        self._owes_prompt = False
        self._leave()

    def _leave(self) -> None:
        self._state = _State.OUTSIDE
        self._held.clear()
        self._is_line_start = True

    # Outside --------------------------------------------------------------------------------------------------------

    def _put_outside(self, data: bytes, parts: list[Part], *, is_damaged: bool = False) -> None:
        self._is_line_start = data[-1] in _LINE_ENDS
        parts.append(Outside(data, is_damaged))

    def _take_damaged(self, byte: int, parts: list[Part]) -> None:
        if self._state is _State.INSIDE:
            self._is_broken = True
            self._take_inside(byte, parts)
        elif self._state is _State.TAIL:
            self._take_tail(byte, parts)
        else:
            self._put_outside(bytes([byte]), parts, is_damaged=True)


# Printed text --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Line:
    """A line that a program prints; a long one comes in several, and only the last of them is whole."""

    text: str
    is_damaged: bool = False
    is_whole: bool = True


@dataclass(frozen=True, slots=True)
class Echo:
    """What was asked, sent back (Setting 187)."""

    text: str


class PrintReader:
    """Makes lines of what stands outside of answers, and knows an echo when it comes."""

    def __init__(self) -> None:
        self._held = bytearray()
        self._is_damaged = False
        self._after_return = False
        self._requests: deque[bytes] = deque(maxlen=_MOST_ECHOES)

    @property
    def has_begun_line(self) -> bool:
        """Whether a part of a line has come."""
        return bool(self._held)

    def expect_echo(self, request: str, *, earlier_may_come: bool = False) -> None:
        """
        Take the next line that says no other than *request* for its echo; once.

        Args:
            request: What is asked.
            earlier_may_come: What was asked before is unanswered: its echo may come late as well.
        """
        if not earlier_may_come:
            self._requests.clear()
        self._requests.append(request.strip().encode("latin-1"))

    def feed(self, data: bytes, *, is_damaged: bool = False) -> list[Line | Echo]:
        """Return the lines that *data* completes."""
        found: list[Line | Echo] = []
        self._is_damaged |= is_damaged
        for byte in data:
            if byte == CARRIAGE_RETURN or (byte == LINE_FEED and self._held):
                found.append(self._finish())
            elif byte == LINE_FEED:
                if not self._after_return:  # nothing but LF ends lines here, and this one is empty
                    found.append(self._finish())
            elif byte not in _NOT_PRINTED:
                self._held.append(byte)
                if len(self._held) >= _LONGEST_LINE:
                    found.append(self._finish(is_whole=False))
            self._after_return = byte == CARRIAGE_RETURN
        return found

    def answer_begins(self) -> list[Line | Echo]:
        """Take note that an answer stands here: an echo in front of it may have no end of its own."""
        if self._is_echo:
            return [self._finish()]
        if self._held.strip() in _LEFT_OVER:
            self._held.clear()
        return []

    def give_up(self) -> list[Line | Echo]:
        """Expect no more of a line that has begun; return what had come of it."""
        return [self._finish(is_whole=False)] if self._held else []

    @property
    def _is_echo(self) -> bool:
        return bool(self._requests) and self._echoed in self._requests

    @property
    def _echoed(self) -> bytes:
        return bytes(self._held.strip().lstrip(bytes([PROMPT])).strip())

    def _finish(self, *, is_whole: bool = True) -> Line | Echo:
        text, is_damaged, is_echo, echoed = self._held.decode("latin-1"), self._is_damaged, self._is_echo, self._echoed
        self._held.clear()
        self._is_damaged = False
        if is_echo and not is_damaged:
            self._requests.remove(echoed)
            return Echo(text.strip())
        return Line(text, is_damaged, is_whole)
