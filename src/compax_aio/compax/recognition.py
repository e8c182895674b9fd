"""What is at the far end, if it is no COMPAX: told by the first that comes of a line, until a prompt has come."""

from __future__ import annotations

from typing import Final

from ..link.contract import Stranger
from .facts.line import PROMPT
from .facts.strangers import ECHO, STRANGERS, StrangerFact

__all__ = ["Recognition"]

_MAX_BYTES: Final = 512
"""Looked at, either way: more than all that is said while a line is opened."""


class Recognition:
    """Compares what comes at first with what strangers say; with the first prompt (CR LF >) that is over for good."""

    def __init__(self) -> None:
        self._sent = bytearray()
        self._received = bytearray()

    def line_opened(self) -> None:
        """Begin anew: it may lead to another far end."""
        self._sent.clear()
        self._received.clear()

    def sent(self, data: bytes) -> None:
        """Take note of what goes out."""
        self._sent += data[: _MAX_BYTES - len(self._sent)]

    def received(self, data: bytes) -> bool:
        """Read what came in; say whether a stranger has ended an answer with it."""
        before = self._answers()
        self._received += data[: _MAX_BYTES - len(self._received)]
        return self._answers() > before

    def stranger(self, *, time_is_over: bool) -> Stranger | None:
        """Say what it is; unless *time_is_over*, only what is certain."""
        found = next((row for row in STRANGERS if self._is_certain(row)), None)
        if found is None and time_is_over:
            found = next((row for row in STRANGERS if row.answers is None and self._count(row)), None)
            if found is None and self._is_all_echo():
                found = ECHO
        return Stranger(found.name, found.remedy) if found else None

    def _is_certain(self, row: StrangerFact) -> bool:
        return row.answers is not None and self._count(row) >= row.answers

    def _answers(self) -> int:
        return max(self._count(row) for row in STRANGERS if row.answers is not None)

    def _count(self, row: StrangerFact) -> int:
        if row.pattern is None:
            return 0
        # With the CR of a prompt: whether its rest has come yet must make no difference.
        end = self._received.find(PROMPT)
        return len(row.pattern.findall(self._received if end < 0 else self._received[: end + 1]))

    def _is_all_echo(self) -> bool:
        """Whether all that came is what was sent; a terminal may have made CR LF of CR."""
        return bool(self._received) and self._received.replace(b"\n", b"") == self._sent
