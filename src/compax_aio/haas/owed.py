"""Questions that were not answered in time: whose answer comes late, and what to ask to see that none will."""

from __future__ import annotations

from typing import Final

from .answers import Belongs, Request, belonging
from .facts.queries import QUERIES, AnswerKind

__all__ = ["OwedAnswers"]

_MOST_OWED: Final = 32

_NAMED: Final = tuple(
    row.command
    for row in QUERIES.values()
    if row.answer not in {AnswerKind.PROGRAM, AnswerKind.VARIABLE, AnswerKind.WRITTEN}
)
"""Their answers name what they answer, and are no other's."""


class OwedAnswers:
    """The questions whose time has run out, oldest first: a control answers in order, if it answers."""

    def __init__(self) -> None:
        self._requests: list[Request] = []

    def __len__(self) -> int:
        return len(self._requests)

    def add(self, request: Request) -> None:
        """Take note that *request* was not answered in time; the oldest are forgotten when there are very many."""
        self._requests.append(request)
        del self._requests[:-_MOST_OWED]

    def clear(self) -> None:
        """Take note that none of them will be answered any more: something newer was."""
        self._requests.clear()

    def take(self, answer: str) -> Request | None:
        """Return the question that *answer* comes late to, and forget it and all before it; None: it is to none."""
        for wanted in (Belongs.YES, Belongs.PERHAPS):
            for index, request in enumerate(self._requests):
                if belonging(request, answer) is wanted:
                    del self._requests[: index + 1]
                    return request
        return None

    def hides(self, request: Request) -> bool:
        """Whether a late answer to something that is owed could be taken for the answer to *request*."""
        return bool(self._requests) and (request.command not in _NAMED or request in self._requests)

    def probe(self) -> Request:
        """
        Return a question whose answer cannot be a late one to anything that is owed.

        If so many were asked in vain that each is owed, it is the one that was asked last the longest ago: all the
        others have had their time since, and nobody has said anything.
        """
        asked = [request.command for request in self._requests]
        for command in _NAMED:
            if command not in asked:
                return Request.of(command)
        oldest = max(_NAMED, key=asked[::-1].index)
        self._requests = [request for request in self._requests if request.command != oldest]
        return Request.of(oldest)
