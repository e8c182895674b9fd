"""Hands that press the keys of a simulated control by themselves, for demos and unattended tests."""

from __future__ import annotations

from math import inf
from typing import Final, Protocol

from compax_aio.haas.facts.port_settings import Synchronization

from .knobs import Knobs
from .presses import Press, presses_of

__all__ = ["Hands", "Panel"]

_WAITING: Final = frozenset({"recv", "dnc"})
_WITHOUT_SIGN: Final = frozenset({Synchronization.XON_XOFF, Synchronization.RTS_CTS})
"""With these a control does not say that it waits."""


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
        self._first_after_s = knobs.press_after_s
        self._pause_s = knobs.press_pause_s
        first = self._presses[0].key if self._presses else ""
        if first in _WAITING and knobs.mode in _WITHOUT_SIGN and not knobs.xon_at_start:
            self._first_after_s = 0.0  # whoever sends earlier than that sends to nobody
        self._again = knobs.press_again
        self._next = 0
        self._at = inf
        self._has_begun = False

    def begin(self, now: float) -> None:
        """Begin with the first key, if there is any."""
        self._next = 0
        self._at = now + self._first_after_s if self._presses else inf
        self._has_begun = True

    def somebody_came(self, now: float) -> None:
        """Take note of the first that is on the line: from then on time counts."""
        if not self._has_begun:
            self.begin(now)

    def over(self, now: float) -> None:
        """Take note that what a key has begun is over."""
        if self._next < len(self._presses):
            self._at = now + self._pause_s

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
