"""What was sent on a line and is not answered yet, oldest first, and how an answer to it begins."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

from .binary import is_frame
from .facts.line import POSITION_REACHED_SIGN
from .facts.status import MARKERS

__all__ = ["Ledger", "Sent"]

_MAX_LEDGER: Final = 16_384
"""Lines remembered as unanswered: as markers, 64 KiB, which is what a transport takes before it says it is full."""

_TEXTS_KNOWN: Final = 1024
"""For all drives together: they are asked the same few things again and again."""

_QUERY: Final = re.compile(r"([SPVN])0*(\d{1,3})")


@dataclass(slots=True, eq=False)
class Sent:
    """A line that was sent, and what its answer looks like."""

    text: str
    wire: bytes
    """As it went out."""
    key: tuple[str, str] | None
    """Letter and number that a query's answer begins with; None for a command."""

    @property
    def wants_message(self) -> bool:
        """Whether ``$`` is asked for."""
        return self.text.endswith(POSITION_REACHED_SIGN)

    @property
    def is_frame(self) -> bool:
        """Whether it went out in binary, without an end sign (UG p. 166)."""
        return is_frame(self.wire)


@lru_cache(maxsize=_TEXTS_KNOWN)
def _key(text: str) -> tuple[str, str] | None:
    query = _QUERY.fullmatch(text.replace(" ", ""))
    return (query[1], query[2]) if query else None


class Ledger:
    """Unanswered lines; the oldest is forgotten when there are very many, and looking for one takes no longer then."""

    __slots__ = ("_asked", "_commands", "_lines", "_next_marker", "_owed", "_unlisted", "last")

    def __init__(self) -> None:
        self.last: Sent | None = None
        """What was sent last, if it is unanswered."""
        self._unlisted: Sent | None = None
        """The same, as long as nobody has looked for it among the others: most lines are answered before."""
        self._next_marker = 0
        self._lines: list[Sent] = []
        self._commands: list[Sent] = []
        """Those of them that a bare prompt may belong to."""
        self._owed: list[Sent] = []
        """Those whose ``$`` was asked for."""
        self._asked: dict[tuple[str, str], int] = {}
        """How many queries bear each name."""

    def __len__(self) -> int:
        self._list_last()
        return len(self._lines)

    @property
    def only_command(self) -> Sent | None:
        """The command that a bare prompt belongs to; None if there is none, or several."""
        self._list_last()
        return self._commands[0] if len(self._commands) == 1 else None

    def asked(self, key: tuple[str, str]) -> Sent | None:
        """Find the oldest query that an answer beginning with *key* can belong to."""
        self._list_last()
        return next((sent for sent in self._lines if sent.key == key), None) if self._asked.get(key) else None

    def owed_message(self) -> Sent | None:
        """Find the oldest command whose ``$`` was asked for."""
        self._list_last()
        return self._owed[0] if self._owed else None

    def note(self, text: str, wire: bytes) -> None:
        """Take note of a line that was sent."""
        self._list_last()
        self.last = self._unlisted = Sent(text, wire, _key(text))

    def settle(self) -> None:
        """Forget all: it is answered, refused or lost."""
        self.last = self._unlisted = None
        if self._lines:
            self._lines.clear()
            self._commands.clear()
            self._owed.clear()
            self._asked.clear()

    def settle_up_to(self, sent: Sent) -> None:
        """Forget *sent* and all that is older."""
        self._list_last()
        while self._forget_oldest() is not sent:
            pass

    def forget_commands(self) -> None:
        """Forget what a bare prompt could be credited to; queries are known by their answers."""
        self._list_last()
        queries = [sent for sent in self._lines if sent.key]
        self.settle()
        for sent in queries:
            self._list_last()
            self.last = self._unlisted = sent

    def _list_last(self) -> None:
        if self._unlisted is None:
            return
        sent, self._unlisted = self._unlisted, None
        if len(self._lines) >= _MAX_LEDGER:
            self._forget_oldest()
        self._lines.append(sent)
        if sent.key is not None:
            self._asked[sent.key] = self._asked.get(sent.key, 0) + 1
            return
        self._commands.append(sent)
        if sent.wants_message:
            self._owed.append(sent)

    def _forget_oldest(self) -> Sent:
        sent = self._lines.pop(0)
        if sent is self.last:
            self.last = None
        if sent.key is not None:
            self._asked[sent.key] -= 1
            return sent
        self._commands.pop(0)
        if sent.wants_message:
            self._owed.pop(0)
        return sent

    def choose_marker(self) -> str:
        """Return a status query whose number no unanswered line bears, as long as there is one."""
        self._list_last()
        for _ in MARKERS:
            number = MARKERS[self._next_marker % len(MARKERS)]
            self._next_marker += 1
            if not self._asked.get(("S", str(number))):
                break
        # Are all unanswered, it is the last one, again and again: the first answer to it makes the others free.
        return f"S{number}"
