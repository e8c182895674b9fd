"""What was sent on a line and is not answered yet, oldest first, and how an answer to it begins."""

from __future__ import annotations

import re
from collections import deque
from dataclasses import dataclass
from typing import Final

from .binary import is_frame
from .facts.line import POSITION_REACHED_SIGN
from .facts.status import MARKERS

__all__ = ["Ledger", "Sent"]

_MAX_LEDGER: Final = 16_384
"""Lines remembered as unanswered: as markers, 64 KiB, which is what a transport takes before it says it is full."""

_QUERY: Final = re.compile(r"([SPVN])0*(\d{1,3})")


@dataclass(frozen=True, slots=True, eq=False)
class Sent:
    """A line that was sent, and what its answer looks like."""

    text: str
    wire: bytes
    """As it went out."""
    key: tuple[str, str] | None
    """Letter and number that a query's answer begins with; None for a command."""

    @classmethod
    def of(cls, text: str, wire: bytes) -> Sent:
        """Take note of *text*, which went out as *wire*."""
        query = _QUERY.fullmatch(text.replace(" ", ""))
        return cls(text, wire, (query[1], query[2]) if query else None)

    @property
    def wants_message(self) -> bool:
        """Whether ``$`` is asked for."""
        return self.text.endswith(POSITION_REACHED_SIGN)

    @property
    def is_frame(self) -> bool:
        """Whether it went out in binary, without an end sign (UG p. 166)."""
        return is_frame(self.wire)


class Ledger:
    """Unanswered lines; the oldest is forgotten when there are very many."""

    def __init__(self) -> None:
        self._lines: deque[Sent] = deque(maxlen=_MAX_LEDGER)
        self._next_marker = 0

    def __len__(self) -> int:
        return len(self._lines)

    @property
    def last(self) -> Sent | None:
        """What was sent last, if it is unanswered."""
        return self._lines[-1] if self._lines else None

    @property
    def only_command(self) -> Sent | None:
        """The command that a bare prompt belongs to; None if there is none, or several."""
        commands = [sent for sent in self._lines if sent.key is None]
        return commands[0] if len(commands) == 1 else None

    def asked(self, key: tuple[str, str]) -> Sent | None:
        """Find the oldest query that an answer beginning with *key* can belong to."""
        return next((sent for sent in self._lines if sent.key == key), None)

    def owed_message(self) -> Sent | None:
        """Find the oldest command whose ``$`` was asked for."""
        return next((sent for sent in self._lines if sent.wants_message), None)

    def note(self, text: str, wire: bytes) -> None:
        """Take note of a line that was sent."""
        self._lines.append(Sent.of(text, wire))

    def settle(self) -> None:
        """Forget all: it is answered, refused or lost."""
        self._lines.clear()

    def settle_up_to(self, sent: Sent) -> None:
        """Forget *sent* and all that is older."""
        while self._lines.popleft() is not sent:
            pass

    def forget_commands(self) -> None:
        """Forget what a bare prompt could be credited to; queries are known by their answers."""
        self._lines = deque((sent for sent in self._lines if sent.key), maxlen=_MAX_LEDGER)

    def choose_marker(self) -> str:
        """Return a status query whose number no unanswered line bears, as long as there is one."""
        unanswered = {sent.key for sent in self._lines}
        for _ in MARKERS:
            number = MARKERS[self._next_marker % len(MARKERS)]
            self._next_marker += 1
            if ("S", str(number)) not in unanswered:
                break
        return f"S{number}"
