"""Trouble with a simulated device, by chance from one seed or when a test says so; above all with its replies."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from random import Random
from typing import Protocol

__all__ = ["Chance", "ReplyKnobs", "ReplyTrouble"]


class Chance(Random):
    """All chance of one device, from one seed."""

    def happens(self, probability: float) -> bool:
        """Draw whether something happens; what never does leaves other chance as it is."""
        return probability > 0 and self.random() < probability


class ReplyKnobs(Protocol):
    """Chances that befall replies."""

    @property
    def lose_reply(self) -> float:
        """It does not come."""

    @property
    def garble_reply(self) -> float:
        """One character of it is another."""

    @property
    def late_reply(self) -> float:
        """It comes later."""

    @property
    def late_s(self) -> float:
        """How much later."""


class ReplyTrouble:
    """
    What goes wrong with replies, and when.

    Args:
        knobs: Chances.
        chance: Of the device.
        note: Called with what was done, in words.
        reply: What a reply is called in these words.

    Attributes:
        replies_to_lose: So many replies are not sent.
        replies_to_garble: So many get another character somewhere.
        replies_to_delay_s: By how much each of the next ones is late.
    """

    def __init__(self, knobs: ReplyKnobs, chance: Chance, note: Callable[[str], None], reply: str = "reply") -> None:
        self._knobs = knobs
        self._chance = chance
        self._note = note
        self._reply = reply
        self.end()

    def end(self) -> None:
        """Forget what was asked for."""
        self.replies_to_lose = self.replies_to_garble = 0
        self.replies_to_delay_s: deque[float] = deque()

    def _loses_reply(self, text: str) -> bool:
        """Whether this one does not come."""
        if self.replies_to_lose <= 0 and not self._chance.happens(self._knobs.lose_reply):
            return False
        self.replies_to_lose = max(0, self.replies_to_lose - 1)
        self._note(f"{self._reply} {text} lost")
        return True

    def _garbled_reply(self, text: str) -> str:
        """Return what becomes of it."""
        if not text or (self.replies_to_garble <= 0 and not self._chance.happens(self._knobs.garble_reply)):
            return text
        self.replies_to_garble = max(0, self.replies_to_garble - 1)
        at = self._chance.randrange(len(text))
        other = text[:at] + chr(ord(text[at]) ^ 1 << self._chance.randrange(7)) + text[at + 1 :]
        self._note(f"{self._reply} {text} became {other!r}")
        return other

    def _reply_late_s(self, text: str) -> float:
        """Return by how much it is late."""
        late_s = 0.0
        if self.replies_to_delay_s:
            late_s = self.replies_to_delay_s.popleft()
        elif self._chance.happens(self._knobs.late_reply):
            late_s = self._knobs.late_s
        if late_s:
            self._note(f"{self._reply} {text} {late_s:g} s late")
        return late_s
