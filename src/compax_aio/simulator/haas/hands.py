"""Hands that press the keys of a simulated control by themselves, for demos and unattended tests."""

from __future__ import annotations

from math import inf
from typing import Protocol

from .knobs import Knobs
from .presses import Press, presses_of

__all__ = ["Hands", "Panel"]


class Panel(Protocol):
    """Where they press."""

    def press(self, press: Press, now: float) -> None:
        """Press a key."""


class Hands:
    """
    Presses keys, one after the other.

    Args:
        knobs: Which, and when.
        panel: Where.
    """

    def __init__(self, knobs: Knobs, panel: Panel) -> None:
        self._panel = panel
        self._presses = presses_of(knobs.press)
        self._after_s = knobs.press_after_s
        self._again = knobs.press_again
        self._next = 0
        self._at = inf
        self._has_begun = False

    def begin(self, now: float) -> None:
        """Begin with the first key, if there is any."""
        self._next = 0
        self._at = now + self._after_s if self._presses else inf
        self._has_begun = True

    def somebody_came(self, now: float) -> None:
        """Take note of the first that is on the line: from then on time counts."""
        if not self._has_begun:
            self.begin(now)

    def over(self, now: float) -> None:
        """Take note that what a key has begun is over."""
        if self._next < len(self._presses):
            self._at = now + self._after_s

    def next_at(self) -> float:
        """When the next key is pressed."""
        return self._at

    def run(self, now: float) -> None:
        """Press the key that is due."""
        press = self._presses[self._next]
        self._next += 1
        if self._again:
            self._next %= len(self._presses)
        self._at = inf
        self._panel.press(press, now)
