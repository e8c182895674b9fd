"""What waits for its turn on a line: exchanges in lanes, who shares the line in turn, reads shared and held back."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Container, Iterator
from dataclasses import dataclass, field
from typing import Final

from ..errors import CompaxError
from .contract import Lane, TurnOver

__all__ = ["Exchange", "ExchangeQueue"]

_CROWD: Final = 16


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


class _Waiting:
    """One lane: those who share the line take turns, and each one's exchanges go in the order in which they came."""

    def __init__(self) -> None:
        self._of: dict[str, deque[Exchange]] = {}

    def __iter__(self) -> Iterator[Exchange]:
        return (exchange for waiting in self._of.values() for exchange in waiting)

    def append(self, exchange: Exchange) -> None:
        self._of.setdefault(exchange.party, deque()).append(exchange)

    def popleft(self, held: Container[str]) -> Exchange | None:
        party = next((party for party in self._of if party not in held), None)
        if party is None:
            return None
        waiting = self._of.pop(party)
        exchange = waiting.popleft()
        if waiting:
            self._of[party] = waiting  # behind the others
        return exchange

    def clear(self) -> None:
        self._of.clear()


class ExchangeQueue:
    """Lanes, the most urgent first; inside a lane everybody on the line in turn, and first come, first served."""

    def __init__(self) -> None:
        self.reads_are_held = False
        """While set, reads stay where they are; everything else goes on."""
        self.held: set[str] = set()
        """Of those who share the line, whose exchanges stay where they are."""
        self.is_admitted = True
        """Unless set, nothing goes that is less urgent than the look at who is there."""
        self._lanes: tuple[_Waiting, ...] = tuple(_Waiting() for _ in Lane)
        self._reads: dict[str, Exchange] = {}

    def put(self, exchange: Exchange) -> None:
        """Queue *exchange*; a read joins another of the same text that waits already."""
        if exchange.lane is Lane.READ:
            if (shared := self._reads.get(exchange.text)) is not None:
                shared.add_waiters(exchange.waiters)
                return
            self._reads[exchange.text] = exchange
        self._lanes[exchange.lane].append(exchange)

    def take_next(self) -> Exchange | None:
        """Take out what is to be sent next; what nobody waits for any more is dropped."""
        for lane in Lane:
            if (lane is Lane.READ and self.reads_are_held) or (lane > Lane.GREETING and not self.is_admitted):
                return None
            waiting = self._lanes[lane]
            while (exchange := waiting.popleft(self.held)) is not None:
                if lane is Lane.READ:
                    del self._reads[exchange.text]
                if exchange.is_wanted:
                    return exchange
        return None

    def first_stop(self) -> Exchange | None:
        """Find the stop that goes first, and leave it where it is."""
        stops = self._lanes[Lane.STOP]
        return next((exchange for exchange in stops if exchange.is_wanted and exchange.party not in self.held), None)

    def take_all(self) -> list[Exchange]:
        """Take out everything, the most urgent first."""
        waiting = [exchange for lane in self._lanes for exchange in lane]
        for lane in self._lanes:
            lane.clear()
        self._reads.clear()
        return waiting
