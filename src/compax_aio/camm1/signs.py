"""The signs in front of replies, by which a reply is known to be late, and a cutter to have forgotten them."""

from __future__ import annotations

from typing import Final

from .facts.line import CARRIAGE_RETURN
from .instructions import ReplyFormat, encode

__all__ = ["SIGNS", "Signs"]

SIGNS: Final = "#$%&*=@~"
"""None of them stands in a reply, in an acknowledgement, or in a number of a parameter list."""


class Signs:
    """
    What sign the next reply must bear: another one after every doubt.

    Attributes:
        are_used: Whether the cutter is thought to put a sign in front; if it does not, that is found out.
    """

    def __init__(self, turnaround_ms: int) -> None:
        self.are_used = True
        self._turnaround_ms = turnaround_ms
        self._last = SIGNS[-1]
        self._said = ""
        """Until a reply bears the last one, the cutter may not have heard of it, and knows another one of these."""
        self._has_been_borne = False
        self._is_plain = False

    def change(self) -> None:
        """Take another one, which is about to be said."""
        self._is_plain = False
        if self.are_used:
            self._last = SIGNS[(SIGNS.index(self._last) + 1) % len(SIGNS)]
            self._said += self._last

    def form(self) -> str:
        """Say the form of replies (``ESC.M``): no trigger, no echo, CR at the end, and the sign in front."""
        sign = ord(self._last) if self.are_used else 0
        controls = ReplyFormat(turnaround_ms=self._turnaround_ms, terminator=CARRIAGE_RETURN, initiator=sign)
        return encode(controls, explicit=True).decode()

    def parted(self, text: str) -> tuple[str, str]:
        """Return the sign in front of *text*, empty if there is none, and the rest; noise in front is left out."""
        if not self.are_used:
            return "", text
        text = text[text.rfind(self._last) :] if self._last in text else text
        return (text[0], text[1:]) if text and text[0] in SIGNS else ("", text)

    def is_last(self, sign: str) -> bool:
        """Whether it was said last."""
        return sign == self._last

    def may_be_known(self, sign: str) -> bool:
        """Whether the cutter may have heard of no later one."""
        return sign in self._said

    def confirm(self) -> None:
        """Take note that a reply with the last one has come."""
        self._said = self._last
        self._has_been_borne = self._has_been_borne or self.are_used

    def note_plain(self) -> None:
        """Take note that a reply without came, where one with the last one was awaited."""
        self._is_plain = True

    def give_up(self) -> None:
        """Take note that none came in time with the last one: a cutter that never bore any puts none in front."""
        if self._is_plain and not self._has_been_borne:
            self.are_used = False
