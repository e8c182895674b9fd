"""
Handshakes, sans-IO: when the next whole instruction may go, so that the cutter's buffer never overflows.

Each is a :class:`Pacing` of one job. It counts positions in the job's bytes, and nothing else: how many were written,
up to where they are known to have arrived, and up to where the cutter has room for them. To keep the wire busy it asks
early: what an answer allows is counted from where the question stood in the stream, so that more goes out while the
next answer is on its way. Questions stand between instructions, never within one (a 7475A drew garbage otherwise).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import Enum
from math import inf
from typing import Final, Literal, get_args

from ..errors import InvalidCommandError
from .facts.line import DC1, DC3, ENQ, ESCAPE

__all__ = [
    "ACKNOWLEDGEMENT",
    "FLOW_SIGNS",
    "HANDSHAKES",
    "HEARD",
    "Doing",
    "EnqAck",
    "Handshake",
    "Hardwire",
    "Pacing",
    "Room",
    "SoftwareChecking",
    "XonXoff",
    "pacing_of",
    "reserve_of",
]

Handshake = Literal["software", "xonxoff", "enq1", "enq2", "hardwire"]

HANDSHAKES: Final[tuple[Handshake, ...]] = get_args(Handshake)

FREE_SPACE: Final = bytes((ESCAPE,)) + b".B"
FLOW_SIGNS: Final = bytes((DC1, DC3))
"""Nothing else that a cutter sends has these."""
ACKNOWLEDGEMENT: Final = b"<>"
"""Not 06: that is what the dummy handshake answers to every ENQ, however full the buffer is (HP7470 p. 10-30)."""
HEARD: Final = b"?"
"""The immediate response: ENQ was heard, whether there is room or not (HP7470 p. 10-16)."""

_LARGE_BYTES: Final = 512
_LARGE_RESERVE_BYTES: Final = 128
"""Filled to the brim, a 7475A has lost bytes; kept back so much, it has not (hpgl-buddy)."""
_SMALLEST_BUFFER_BYTES: Final = 32
_MOST_THRESHOLD_BYTES: Final = 384
_LEAST_SLACK_BYTES: Final = 8
_ONE_PAIR_BYTES: Final = 24
"""``PD-1234567,-1234567;`` and some blanks."""
_LOOK_EVERY_BYTES: Final = 2048
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


def reserve_of(capacity_bytes: int) -> int:
    """Return how much of a buffer stays free."""
    return _LARGE_RESERVE_BYTES if capacity_bytes >= _LARGE_BYTES else max(16, capacity_bytes // 8)


@dataclass(frozen=True, slots=True)
class Room:
    """
    What a job has to get through.

    Attributes:
        capacity_bytes: Of the cutter's buffer: the most that it has ever said to be free.
        reserve_bytes: So much of it stays free.
        window_bytes: No more than that may be on its way, written and not known to have arrived.

    Raises:
        InvalidCommandError: Nothing can be sent through that.
    """

    capacity_bytes: int
    reserve_bytes: int
    window_bytes: int = 240

    def __post_init__(self) -> None:
        if self.capacity_bytes < _SMALLEST_BUFFER_BYTES or self.usable_bytes < _SMALLEST_BUFFER_BYTES // 2:
            raise InvalidCommandError(
                f"a buffer of {self.capacity_bytes} bytes with {self.reserve_bytes} kept free is too small for a job",
                hint="a cutter that is idle says its buffer's size; is it, and has nobody set another with .@?",
            )

    @classmethod
    def of(cls, capacity_bytes: int, reserve_bytes: int | None = None, window_bytes: int = 240) -> Room:
        """Make one, with the reserve that is due to a buffer of that size unless it is given."""
        reserve = reserve_of(capacity_bytes) if reserve_bytes is None else reserve_bytes
        return cls(capacity_bytes, reserve, window_bytes)

    @property
    def usable_bytes(self) -> int:
        """What of the buffer may be filled."""
        return self.capacity_bytes - self.reserve_bytes

    @property
    def threshold_bytes(self) -> int:
        """When less is free the cutter shall say stop: early, for what is on its way still comes."""
        return min(self.capacity_bytes // 2, _MOST_THRESHOLD_BYTES)


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
        return _LOOK_EVERY_BYTES

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


class _Credit(Pacing):
    """What is common to those that the cutter gives credit, in answer to a question."""

    def __init__(self, room: Room) -> None:
        super().__init__(room)
        self._limit_bytes = 0

    def _interval_bytes(self) -> float:
        return max(1.0, min(self._limit_bytes - self.confirmed_bytes, self.room.window_bytes) / 2)

    def _is_time_to_ask(self, size: int, bar: Doing | None) -> bool:
        if super()._is_time_to_ask(size, bar):
            return True
        # The last instruction that there is room for goes behind the question, to have the wire busy meanwhile.
        is_last = self.written_bytes + 2 * size > min(self._limit_bytes, self.confirmed_bytes + self.room.window_bytes)
        return bar is None and is_last and self.written_bytes > self._asked_last


class SoftwareChecking(_Credit):
    """
    Free space is asked for with ``.B`` (DXY p. 5-10; HP7470 p. 10-26), and less than that is sent.

    When it rises by more than is kept free it is asked for twice, and the lesser answer counts: a digit damaged
    on the line would make the buffer overflow otherwise.
    """

    handshake: Handshake = "software"
    tells_free_space = True

    def __init__(self, room: Room) -> None:
        super().__init__(room)
        self._suspect: float | None = None
        self._believed_bytes = room.capacity_bytes

    @property
    def longest_bytes(self) -> int:
        """Lists of coordinates are cut into instructions of so many bytes at most."""
        return _two_of(min(self.room.window_bytes, self.room.usable_bytes))

    @property
    def most_bytes(self) -> int:
        """An instruction that is longer never gets through."""
        return self.room.usable_bytes

    def _note_free(self, free_bytes: int, asked_at: int) -> None:
        limit = asked_at + free_bytes - self.room.reserve_bytes
        if self._suspect is not None:
            self._limit_bytes, self._suspect = min(limit, self._suspect), None
        elif free_bytes - self._believed_bytes > self.room.reserve_bytes:
            self._suspect, self._wants_to_ask = limit, True
            return
        else:
            self._limit_bytes = limit
        self._believed_bytes = free_bytes


class EnqAck(_Credit):
    """
    ENQ asks whether there is room for a block, and is acknowledged as soon as there is (PNC-1610 p. 28-29).

    ENQ is sent one block ahead: what an acknowledgement allows is counted from where its ENQ stood.
    """

    question = bytes((ENQ,))
    acknowledgement = ACKNOWLEDGEMENT

    def __init__(self, room: Room, mode: Literal[1, 2]) -> None:
        super().__init__(room)
        self.mode = mode
        self.handshake: Handshake = "enq1" if mode == 1 else "enq2"
        self.block_bytes = min(room.capacity_bytes // 2, room.usable_bytes * 3 // 4, room.window_bytes)
        """Sent for one acknowledgement: so that the cutter has work while it travels, no more than half its buffer."""
        self._acknowledged_at: int | None = None

    @property
    def announced_bytes(self) -> int:
        """What the cutter is told to be a block: more than one, so that its buffer is never filled to the brim."""
        return self.block_bytes + self.room.reserve_bytes

    @property
    def longest_bytes(self) -> int:
        """Lists of coordinates are cut into instructions of so many bytes at most."""
        return _two_of(self.block_bytes)

    @property
    def most_bytes(self) -> int:
        """An instruction that is longer never gets through."""
        return self.block_bytes

    def acknowledged(self) -> None:
        """Take note that there is room for a block, from where it was asked."""
        if self.asked_at is not None:
            asked_at, self.asked_at = self.asked_at, None
            self._confirm(asked_at)
            self._limit_bytes = max(self._limit_bytes, asked_at + self.block_bytes)
            self._acknowledged_at = asked_at

    @property
    def taken_bytes(self) -> int | None:
        """How many bytes the cutter had taken when it acknowledged, or was asked, last: these at least."""
        told = super().taken_bytes
        if self._acknowledged_at is None:
            return told
        least = self._acknowledged_at - (self.room.capacity_bytes - self.announced_bytes)
        return max(0, least, told or 0)


class _Stopped(Pacing):
    """What is common to those that go on until the cutter says stop: little may wait to leave, for that still comes."""

    @property
    def longest_bytes(self) -> int:
        """Lists of coordinates are cut into instructions of so many bytes at most."""
        return min(_two_of(self.most_unsent_bytes), self.most_bytes)

    @property
    def most_bytes(self) -> int:
        """An instruction that is longer never gets through."""
        return self.room.threshold_bytes - _LEAST_SLACK_BYTES

    @property
    def most_unsent_bytes(self) -> int:
        """How much may wait to leave."""
        threshold = self.room.threshold_bytes
        return min(self.room.window_bytes, threshold - max(_LEAST_SLACK_BYTES, threshold // 8))

    # Where nobody knows what has left, answers tell what has arrived.

    def _window_bytes(self) -> int:
        return self.most_unsent_bytes if self._is_blind else 2 * _LOOK_EVERY_BYTES

    def _interval_bytes(self) -> float:
        return self.most_unsent_bytes / 2 if self._is_blind else _LOOK_EVERY_BYTES


class XonXoff(_Stopped):
    """
    Xoff stops, Xon lets go on (PNC-1610 p. 29); both are taken out of what comes, in the middle of replies as well.

    After Xon free space is asked for before more is sent, so that one that noise has made does no harm; and so it is
    when Xon does not come for long, for it may be lost. Going on without it, no more is sent than was said to be free,
    for a cutter that has not sent Xon yet sends no second Xoff.
    """

    handshake: Handshake = "xonxoff"

    def __init__(self, room: Room) -> None:
        super().__init__(room)
        self._has_xon_come = False
        self._is_careful = False
        """Whether it goes on without Xon."""

    def flow(self, sign: int) -> None:
        """Take note of Xon or Xoff."""
        self._is_careful = False
        self._limit_bytes = inf
        if sign == DC3:
            self.is_held, self._has_xon_come = True, False
        elif self.is_held:
            self._has_xon_come = self._wants_to_ask = True

    def _note_free(self, free_bytes: int, asked_at: int) -> None:
        if self.is_held and free_bytes - (self.written_bytes - asked_at) >= self.room.threshold_bytes:
            self.is_held = False
            self._is_careful = not self._has_xon_come
        if self._is_careful:
            self._limit_bytes = asked_at + free_bytes - self.room.reserve_bytes

    def _interval_bytes(self) -> float:
        usual = super()._interval_bytes()
        return min(usual, self.room.usable_bytes / 2) if self._is_careful else usual

    def next(self, size: int | None, unsent: int | None) -> Doing:
        """Say what is next; held, and asked just now, it is full."""
        doing = super().next(size, unsent)
        return Doing.FULL if doing is Doing.HELD and self._is_fresh else doing


class Hardwire(_Stopped):
    """A line of the cable stops whatever sends the bytes (DTR, PNC-900 p. 20); little is written beyond that."""

    handshake: Handshake = "hardwire"
    may_hold_line = True


def _two_of(size: int) -> int:
    """Return what two instructions may have that are on their way together; one pair of coordinates at least."""
    return min(size, max(size // 2, _ONE_PAIR_BYTES))


def pacing_of(handshake: Handshake, room: Room) -> Pacing:
    """
    Make the pacing of a job.

    Raises:
        InvalidCommandError: There is no such handshake.
    """
    if handshake == "software":
        return SoftwareChecking(room)
    if handshake == "xonxoff":
        return XonXoff(room)
    if handshake == "hardwire":
        return Hardwire(room)
    if handshake in {"enq1", "enq2"}:
        return EnqAck(room, 1 if handshake == "enq1" else 2)
    raise InvalidCommandError(f"handshake is 'auto' or one of {', '.join(map(repr, HANDSHAKES))}, not {handshake!r}")
