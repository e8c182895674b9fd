"""Telling taps what happens on one line; where nobody listens it costs one look."""

from __future__ import annotations

from asyncio import Future
from collections.abc import Callable, Mapping
from functools import partial

from .contract import TurnOver
from .exchanges import Exchange
from .taps import TAPS, Asked, Ended, Fact

__all__ = ["Telling"]


class Telling:
    """
    Tells those who listened when a line was made, each until it has heard enough.

    Args:
        name: Of the line.
        about: Says what is known about its device; asked only if somebody listens.
    """

    __slots__ = ("_asked", "_ears", "is_heard")

    def __init__(self, name: str, about: Callable[[], Mapping[str, object]] | None = None) -> None:
        taps = TAPS.get()
        said = about() if taps and about is not None else {}
        self._ears = [tap(name, said) for tap in taps]
        self._asked = 0
        self.is_heard = bool(self._ears)
        """Whether anybody listens: to be looked at before a fact is made."""

    def tell(self, fact: Fact) -> None:
        """Tell *fact* to all who listen."""
        enough = [ear for ear in self._ears if ear(fact) is False]
        if enough:
            self._ears = [ear for ear in self._ears if ear not in enough]
            self.is_heard = bool(self._ears)

    def asked(self, exchange: Exchange, waiter: Future[TurnOver]) -> None:
        """Give *exchange* a number; tell that it is asked for, and when *waiter* was told how it ended."""
        self._asked += 1
        exchange.number = self._asked
        self.tell(Asked(self._asked, exchange.text, exchange.lane, exchange.party))
        waiter.add_done_callback(partial(self._ended, self._asked))

    def _ended(self, number: int, told: Future[TurnOver]) -> None:
        if self.is_heard:
            self.tell(Ended.of(number, told))
