"""The five handshakes of a cutter, interchangeable: free space asked for, Xon and Xoff, ENQ and ACK, a held line."""

from __future__ import annotations

from math import inf
from typing import Final, Literal

from ..errors import InvalidCommandError
from .facts.line import DC3, ENQ
from .pacing import FREE_SPACE, HANDSHAKES, LOOK_EVERY_BYTES, Doing, Handshake, Pacing
from .room import Room

__all__ = ["ACKNOWLEDGEMENT", "HEARD", "EnqAck", "Hardwire", "SoftwareChecking", "XonXoff", "pacing_of"]

ACKNOWLEDGEMENT: Final = b"<>"
"""Not 06: that is what the dummy handshake answers to every ENQ, however full the buffer is (HP7470 p. 10-30)."""
HEARD: Final = b"?"
"""The immediate response: ENQ was heard, whether there is room or not (HP7470 p. 10-16)."""

_LEAST_SLACK_BYTES: Final = 8
_ONE_PAIR_BYTES: Final = 24
"""``PD-1234567,-1234567;`` and some blanks."""


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
        return self.most_unsent_bytes if self._is_blind else 2 * LOOK_EVERY_BYTES

    def _interval_bytes(self) -> float:
        return self.most_unsent_bytes / 2 if self._is_blind else LOOK_EVERY_BYTES


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


def pacing_of(handshake: Handshake, room: Room, free_space_query: bytes = FREE_SPACE) -> Pacing:
    """
    Make the pacing of a job.

    Args:
        handshake: Which.
        room: What the job has to get through.
        free_space_query: What asks that machine for free space.

    Raises:
        InvalidCommandError: There is no such handshake.
    """
    pacing: Pacing
    if handshake in {"enq1", "enq2"}:
        return EnqAck(room, 1 if handshake == "enq1" else 2)
    if handshake == "software":
        pacing = SoftwareChecking(room)
    elif handshake == "xonxoff":
        pacing = XonXoff(room)
    elif handshake == "hardwire":
        pacing = Hardwire(room)
    else:
        raise InvalidCommandError(f"handshake is one of {', '.join(map(repr, HANDSHAKES))}, not {handshake!r}")
    pacing.question = free_space_query
    return pacing
