"""
The pacing of a job, sans-IO: when the next whole instruction may go, so that the cutter's buffer never overflows.

Each handshake is a :class:`Pacing` of one job. It counts positions in the job's bytes, and nothing else: how many were
written, up to where they are known to have arrived, and up to where the cutter has room for them. To keep the wire busy
it asks early: what an answer allows is counted from where the question stood in the stream, so that more goes out while
the next answer is on its way. Questions stand between instructions, never within one (a 7475A drew garbage otherwise).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from enum import Enum
from math import inf
from typing import Final, Literal, get_args

from .facts.line import DC1, DC3, ESCAPE
from .room import Room

__all__ = ["FLOW_SIGNS", "FREE_SPACE", "HANDSHAKES", "LOOK_EVERY_BYTES", "Doing", "Handshake", "Pacing"]

Handshake = Literal["software", "xonxoff", "enq1", "enq2", "hardwire"]

HANDSHAKES: Final[tuple[Handshake, ...]] = get_args(Handshake)

FREE_SPACE: Final = bytes((ESCAPE,)) + b".B"
FLOW_SIGNS: Final = bytes((DC1, DC3))
"""Nothing else that a cutter sends has these."""
LOOK_EVERY_BYTES: Final = 2048
"""Where no answer is needed to go on, it is asked so often whether all has arrived."""


class Doing(Enum):
    """What is next."""

    WRITE = "write"
    """The next instruction."""
    ASK = "ask"
    """The question of this handshake."""
    AWAIT = "await"
    """Nothing before the answer."""
    PAUSE = "pause"
    """Nothing before less of what was written waits to leave."""
    HELD = "held"
    """Nothing before the cutter says so: it has sent Xoff."""
    FULL = "full"
    """Nothing for a while: the cutter has said just now that there is no room."""
    DONE = "done"


class Pacing(ABC):
    """
    How the instructions of one job go through the buffer.

    Attributes:
        handshake: Its name.
        question: What is written to ask.
        acknowledgement: The answer, where it is no reply but a string of its own.
        written_bytes: Of the job, until now.
        confirmed_bytes: Of these, known to have arrived.
        asked_at: Where the question stood that is not answered yet.
        free_bytes: What the cutter has said last; None if it never has.
        is_held: Whether it has told to stop.
    """

    handshake: Handshake
    tells_free_space = False
    """Whether *free_bytes* is asked for again and again."""
    may_hold_line = False
    """Whether the cable holds back what is written, questions too, while the buffer is full."""
    question = FREE_SPACE
    acknowledgement = b""

    def __init__(self, room: Room) -> None:
        self.room = room
        self.written_bytes = self.confirmed_bytes = 0
        self.asked_at: int | None = None
        self.free_bytes: int | None = None
        self.is_held = False
        self._limit_bytes: float = inf
        """Up to there the cutter has room."""
        self._asked_last = 0
        self._is_fresh = False
        """Whether it has answered since something was written, or a burst begun."""
        self._wants_to_ask = False
        self._is_blind = False
        """Whether nobody knows what has left."""

    # What differs ---------------------------------------------------------------------------------------------------

    @property
    @abstractmethod
    def longest_bytes(self) -> int:
        """Lists of coordinates are cut into instructions of so many bytes at most: two of them are on their way."""

    @property
    @abstractmethod
    def most_bytes(self) -> int:
        """An instruction that is longer never gets through."""

    @property
    def most_unsent_bytes(self) -> int | None:
        """How much may wait to leave, where that is known; None: no matter, for answers tell."""
        return None

    @property
    def low_unsent_bytes(self) -> int:
        """After a pause more is written when no more than that waits."""
        return (self.most_unsent_bytes or 0) // 2

    def _interval_bytes(self) -> float:
        """After so many bytes it is asked anew."""
        return LOOK_EVERY_BYTES

    def _note_free(self, free_bytes: int, asked_at: int) -> None:  # noqa: B027  # not all reckon with it
        """Reckon with the answer."""

    # What the protocol asks -----------------------------------------------------------------------------------------

    def begin(self) -> None:
        """Take note that a burst begins; nothing is outstanding, whatever was before."""
        self.asked_at = None
        self._is_fresh = False

    def next(self, size: int | None, unsent: int | None) -> Doing:
        """
        Say what is next.

        Args:
            size: Bytes of the next instruction; None: there is none.
            unsent: How many bytes that were written have not left; None: nobody knows.
        """
        self._is_blind = unsent is None
        if size is None:
            return Doing.DONE if self.asked_at is None else Doing.AWAIT
        bar = self._bar(size, unsent)
        if self.asked_at is None and self._is_time_to_ask(size, bar):
            return Doing.ASK
        if bar is None:
            return Doing.WRITE
        return Doing.AWAIT if self.asked_at is not None and bar is not Doing.PAUSE else bar

    def _bar(self, size: int, unsent: int | None) -> Doing | None:
        """Return what keeps the next instruction back; None: nothing."""
        if self.is_held:
            return Doing.HELD
        is_all_there = self.confirmed_bytes == self.written_bytes
        end = self.written_bytes + size
        if end > self._limit_bytes or (end > self.confirmed_bytes + self._window_bytes() and not is_all_there):
            return Doing.FULL
        most = self.most_unsent_bytes
        if most is not None and unsent and unsent + size > max(most, size):
            return Doing.PAUSE
        return None

    def _window_bytes(self) -> int:
        return self.room.window_bytes

    def _is_time_to_ask(self, size: int, bar: Doing | None) -> bool:  # noqa: ARG002  # of those that are given credit
        if bar is Doing.HELD or self._wants_to_ask:
            return self._wants_to_ask
        if bar is Doing.FULL:
            return not self._is_fresh
        return self.written_bytes - self._asked_last >= self._interval_bytes()

    def asked(self) -> None:
        """Take note that the question was written."""
        self.asked_at = self._asked_last = self.written_bytes
        self._wants_to_ask = False

    def wrote(self, size: int) -> None:
        """Take note that an instruction was written."""
        self.written_bytes += size
        self._is_fresh = False

    def answered(self, free_bytes: int) -> bool:
        """Take note of the free space that the cutter has told; False if that cannot be."""
        asked_at, self.asked_at = self.asked_at, None
        if asked_at is None or free_bytes > self.room.capacity_bytes:
            return False
        self._confirm(asked_at)
        self.free_bytes = free_bytes
        self._note_free(free_bytes, asked_at)
        return True

    def acknowledged(self) -> None:  # noqa: B027  # of those that have none
        """Take note that the acknowledgement came."""

    def heard(self) -> None:
        """Take note that the immediate response came: what was asked has arrived."""
        if self.asked_at is not None:
            self.confirmed_bytes = max(self.confirmed_bytes, self.asked_at)

    def flow(self, sign: int) -> None:  # noqa: B027  # noise, to most
        """Take note of Xon or Xoff, which may stand anywhere in what comes."""

    def look(self) -> None:
        """Take note that it was held for long: it shall ask."""
        self._wants_to_ask = True

    def told(self, free_bytes: int) -> None:
        """Take note of free space that was asked for while nothing was outstanding: all is counted that was written."""
        if free_bytes <= self.room.capacity_bytes:
            self.confirmed_bytes = self.written_bytes
            self.free_bytes = free_bytes

    def _confirm(self, asked_at: int) -> None:
        self.confirmed_bytes = max(self.confirmed_bytes, asked_at)
        self._is_fresh = asked_at == self.written_bytes

    @property
    def taken_bytes(self) -> int | None:
        """How many bytes of the job the cutter had taken out of its buffer when it was last asked; None: never was."""
        if self.free_bytes is None:
            return None
        return max(0, self.confirmed_bytes - (self.room.capacity_bytes - self.free_bytes))
