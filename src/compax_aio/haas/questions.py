"""The question of a line, and those before it that are unanswered: what an answer that comes is to."""

from __future__ import annotations

from typing import Final

from ..link.contract import Event, LateEnding
from .answers import Belongs, Request, belonging
from .owed import OwedAnswers
from .protocol_events import Answered, NobodyAnswers, Overheard, Unreadable

__all__ = ["Questions"]

_SHOWN: Final = 64


class Questions:
    """Knows what is asked, what is asked first because of what is owed, and whose answer comes."""

    def __init__(self) -> None:
        self._owed = OwedAnswers()
        self._request: Request | None = None
        """What is to be asked, or is."""
        self._probe: Request | None = None
        """What is asked first, because something is owed."""
        self._is_sent = False
        """Whether an answer is awaited: to the probe, if there is one."""

    @property
    def asked(self) -> str | None:
        """The question whose turn it is, sent or not; None: there is none."""
        return None if self._request is None else self._request.text

    @property
    def owes(self) -> bool:
        """Whether an answer may still come to a question that was given up."""
        return bool(self._owed)

    @property
    def is_probing(self) -> bool:
        """Whether something else is asked first."""
        return self._probe is not None

    def begin(self, text: str) -> None:
        """
        Take the next question.

        Raises:
            InvalidCommandError: It is none.
        """
        self._request = Request.sent_as(text)

    def next_text(self) -> str:
        """Return what is to be sent now: the question, or another one whose answer shows that nothing is owed."""
        assert self._request is not None  # it has begun
        self._probe = self._owed.probe() if self._owed.hides(self._request) else None
        self._is_sent = True
        return (self._probe or self._request).text

    def read(self, text: str) -> Event | None:
        """Say what an answer is; None: it was the one to what was asked first, and the question itself may be sent."""
        asked = (self._probe or self._request) if self._is_sent else None
        belongs = Belongs.NO if asked is None else belonging(asked, text)
        if belongs is Belongs.YES:
            return self._answered(text)
        if (late := self._owed.take(text)) is not None:
            return LateEnding(late.text, Answered(text))
        if self._probe is None and belongs is Belongs.PERHAPS:
            return self._answered(text)
        if self._probe is None and belongs is Belongs.UNKNOWN:
            return self.read_broken(text)
        return Overheard(text)

    def _answered(self, text: str) -> Event | None:
        self._owed.clear()  # a control answers in order
        if self._probe is not None:
            self._probe, self._is_sent = None, False
            return None
        self.drop()
        return Answered(text)

    def read_broken(self, text: str) -> Event:
        """Say what something is that began like an answer: the question has failed by it, if one is asked."""
        if not self._is_sent or self._probe is not None or self._request is None:
            return Overheard(text[:_SHOWN])
        sent = self._request.text
        self.give_up()
        return Unreadable(sent, text[:_SHOWN])

    def give_up(self) -> NobodyAnswers | None:
        """Await no answer any more, though it may come; say what was not sent, if something else was asked first."""
        told = None
        if self._is_sent and self._request is not None:
            self._owed.add(self._probe or self._request)
            if self._probe is not None:
                told = NobodyAnswers(self._request.text, self._probe.text)
        self.drop()
        return told

    def drop(self) -> None:
        """Have no question any more."""
        self._request = self._probe = None
        self._is_sent = False

    def line_is_new(self) -> None:
        """Take note of another line, over which an answer may still come: behind a server it is the same control."""
        self.give_up()
