"""What waits for its turn on a line: who shares it in turn, exchanges in lanes, reads shared and held back."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Final

from ..errors import CompaxError
from .contract import Lane, TurnOver

__all__ = ["Exchange", "ExchangeQueue"]

_CROWD: Final = 16

_AHEAD_OF_ALL: Final = (Lane.STOP, Lane.GREETING)
_IN_TURN: Final = (Lane.CONTROL, Lane.MOTION, Lane.READ)
_ALL_BUT_READS: Final = (Lane.CONTROL, Lane.MOTION)


@dataclass(slots=True, eq=False)
class Exchange:
    """One line to be sent, and who waits for its answer."""

    text: str
    lane: Lane
    settles_late: bool = False
    """Whether those who wait do so, after a time-out, until the line is in step: the answer may come late."""
    survives_loss: bool = False
    """Whether it waits for a line that is lost, and may be sent again on it: it asks something, or stops."""
    attempt: int = 0
    """How often the line had been opened when it was queued."""
    queued_at: float = 0.0
    """Loop time."""
    on_sent: Callable[[], None] | None = None
    party: str = ""
    """Whose it is, of those who share the line."""
    waiters: list[asyncio.Future[TurnOver]] = field(default_factory=list)
    times_ahead: int = 0
    """How often it was sent although in doubt."""
    is_late: bool = False
    """Whether it was sent in its turn, and its time has run out."""
    is_on_wire: bool = False
    """Whether it was sent in its turn, on this line or an earlier one."""
    received: str | None = None
    """What had come until then."""
    patience_s: float | None = None
    """For how long it was, if it was given up."""
    number: int | None = None
    """By which taps know it."""
    _crowded_at: int = _CROWD

    @property
    def is_wanted(self) -> bool:
        """Whether anybody waits for it."""
        return any(not waiter.done() for waiter in self.waiters)

    def add_waiters(self, waiters: list[asyncio.Future[TurnOver]]) -> None:
        """Let others wait for the same answer; those that have given up are forgotten from time to time."""
        if len(self.waiters) >= self._crowded_at:
            self.waiters = [waiter for waiter in self.waiters if not waiter.done()]
            self._crowded_at = 2 * len(self.waiters) + _CROWD
        self.waiters += waiters

    def begin_anew(self) -> None:
        """Wait for another line, for the one on which it was is lost."""
        self.is_late = False
        self.received = None

    def end(self, outcome: TurnOver) -> None:
        """Give *outcome* to all who wait."""
        for waiter in self.waiters:
            if not waiter.done():
                waiter.set_result(outcome)

    def fail(self, make_error: Callable[[Exchange], CompaxError]) -> None:
        """Give an error to each who waits, one of its own."""
        for waiter in self.waiters:
            if not waiter.done():
                waiter.set_exception(make_error(self))


class ExchangeQueue:
    """
    Everybody who shares the line in turn, and of each the most urgent exchange, first come, first served.

    Stops go before everything, and so does the look at who is there, whosoever they are.
    """

    __slots__ = ("_parties", "_reads", "held", "is_admitted", "reads_are_held")

    def __init__(self) -> None:
        self.reads_are_held = False
        """While set, reads stay where they are; everything else goes on."""
        self.held: set[str] = set()
        """Of those who share the line, whose exchanges stay where they are."""
        self.is_admitted = True
        """Unless set, nothing goes that is less urgent than the look at who is there."""
        self._parties: dict[str, dict[Lane, deque[Exchange]]] = {}
        """By party, whose turn it is first: a queue for each lane in which something waits."""
        self._reads: dict[str, Exchange] = {}

    def put(self, exchange: Exchange) -> None:
        """Queue *exchange*; a read joins another of the same text that waits already."""
        if exchange.lane is Lane.READ:
            if (shared := self._reads.get(exchange.text)) is not None:
                shared.add_waiters(exchange.waiters)
                return
            self._reads[exchange.text] = exchange
        waiting = self._parties.setdefault(exchange.party, {})
        if exchange.lane not in waiting:
            waiting[exchange.lane] = deque()
        waiting[exchange.lane].append(exchange)

    @property
    def lets_pass(self) -> bool:
        """Whether what is asked now is what is sent next, whatever it is: nothing waits, and nothing is held back."""
        return not (self._parties or self.held or self.reads_are_held) and self.is_admitted

    def take_next(self) -> Exchange | None:
        """Take out what is to be sent next; what nobody waits for any more is dropped."""
        if not self._parties:
            return None
        for lane in _AHEAD_OF_ALL:
            if (exchange := self._take((lane,))) is not None:
                return exchange
        if not self.is_admitted:
            return None
        return self._take(_ALL_BUT_READS if self.reads_are_held else _IN_TURN)

    def _take(self, lanes: Sequence[Lane]) -> Exchange | None:
        for party, waiting in self._parties.items():
            if party in self.held:
                continue
            for lane in lanes:
                if lane in waiting and (exchange := self._take_wanted(waiting, lane)) is not None:
                    self._end_turn(party)
                    return exchange
        return None

    def _take_wanted(self, waiting: dict[Lane, deque[Exchange]], lane: Lane) -> Exchange | None:
        queued, wanted = waiting[lane], None
        while queued and wanted is None:
            exchange = queued.popleft()
            if lane is Lane.READ:
                del self._reads[exchange.text]
            wanted = exchange if exchange.is_wanted else None
        if not queued:
            del waiting[lane]
        return wanted

    def _end_turn(self, party: str) -> None:
        waiting = self._parties.pop(party)
        if waiting:
            self._parties[party] = waiting  # behind the others

    def first_stop(self) -> Exchange | None:
        """Find the stop that goes first, and leave it where it is."""
        stops = (
            each
            for party, lanes in self._parties.items()
            if party not in self.held
            for each in lanes.get(Lane.STOP, ())
        )
        return next((stop for stop in stops if stop.is_wanted), None)

    def take_all(self) -> list[Exchange]:
        """Take out everything, the most urgent first."""
        waiting = [exchange for lane in Lane for lanes in self._parties.values() for exchange in lanes.get(lane, ())]
        self._parties.clear()
        self._reads.clear()
        return waiting
