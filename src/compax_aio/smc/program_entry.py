"""
One entry into the program memory of an axis: begun, typed instruction by instruction, ended for certain or in doubt.

From ``P`` to ``P0`` (DCB p. 24) the axis stores what it is told instead of obeying, a stop as well; outside of it an
instruction would be executed, and ``P0`` would begin an entry. So whether the axis is inside must be known before each
line, and no line is ever repeated on a guess.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum, IntEnum
from functools import partial
from typing import Final

from ..errors import (
    AnswerTimeoutError,
    CommandRejectedError,
    CompaxError,
    ConnectionLostError,
    UnexpectedAnswerError,
)
from ..link.contract import Lane, TurnOver
from .codecs import AxisStatus, Listed, decode_status
from .facts import ESCAPE
from .observer import Observer
from .protocol_events import Answered, CutShort, EntryFailed
from .vocabulary import program_begin, program_end, status_query

__all__ = ["EntryLine", "ProgramEntry"]

_ATTEMPTS: Final = 2

_IN_DOUBT: Final = (
    "the axis may still be in program entry, where a stop would be stored and not obeyed; abort_all() ends that for "
    "certain (ESC, AMS p. 25), and stops every axis of the line"
)


@dataclass(frozen=True, slots=True)
class EntryLine:
    """One instruction that is to be stored."""

    address: int | None
    """None where it is not known: an instruction before it takes nobody knows how much."""
    text: str
    """As a listing has it, tidied."""
    sent: str
    old: str | None = None
    """What began there before; None where nothing did, or where that is not known."""

    def __str__(self) -> str:
        return self.text if self.address is None else f"{self.text} at {self.address}"

    def is_shown_by(self, listed: Listed) -> bool:
        """Whether a listing shows it there."""
        return listed.text == self.text and self.address in {None, listed.address}


class _Where(Enum):
    """What is known of the axis."""

    OUTSIDE = "outside"
    INSIDE = "inside"
    UNKNOWN = "unknown"


class _UntilSent(IntEnum):
    """What takes a line back that has not had its turn yet."""

    STOP = 0
    """A stop, or anything below."""
    LEFT = 1
    """That the axis has left program entry, or may have."""
    NOTHING = 2


class ProgramEntry:
    """
    Enters instructions into one axis; made for one time.

    Args:
        observer: Of the axis.

    Attributes:
        taken: What was acknowledged, in order.
        uncertain: What was sent, and may be stored, in part, or not; None if there is no such thing.
        status: What the axis has said of its motion when it was out again; None as long as it has not.
        was_aborted: Whether ESC or ^C was sent in the middle.
    """

    def __init__(self, observer: Observer) -> None:
        self._line = observer.line
        self._link = observer.line.link
        self._axis = observer.axis
        self._party = f"{observer.axis} program"
        self._profile = observer.line.settings.profile
        self.taken: list[EntryLine] = []
        self.uncertain: EntryLine | None = None
        self.status: AxisStatus | None = None
        self.was_aborted = False
        self._where = _Where.OUTSIDE
        self._is_wanted = True
        self._has_left = False
        """Whether somebody else has ended it, or may have."""
        self._reply: asyncio.Future[TurnOver] | None = None
        self._until_sent = _UntilSent.NOTHING
        self._was_sent = False
        self._times_opened = observer.line.link.times_opened

    # What is asked of it meanwhile ----------------------------------------------------------------------------------

    @property
    def doubt(self) -> str | None:
        """Why nobody knows whether the axis is in program entry; None if it is not."""
        return None if self._where is _Where.OUTSIDE else _IN_DOUBT

    @property
    def is_inside(self) -> bool:
        """Whether the axis stores what it is told, for certain."""
        return self._where is _Where.INSIDE

    @property
    def moves(self) -> bool:
        """Whether the axis was found moving when it was out again."""
        return self.status is not None and not self.status.is_settled

    @property
    def may_have_executed(self) -> bool:
        """Whether the axis may have executed what it was to store."""
        return self.moves or self.doubt is not None or self.was_aborted

    @property
    def is_untouched(self) -> bool:
        """Whether nothing was stored for certain, and the axis is as it was."""
        return not self.taken and self.uncertain is None and self.doubt is None

    @property
    def is_interrupted(self) -> bool:
        """Whether somebody wants it to end."""
        return not self._is_wanted

    def interrupt(self) -> None:
        """End it between two instructions: a stop waits for that, or nobody wants it any more."""
        self._is_wanted = False
        self._take_back(_UntilSent.STOP)

    def note_left(self, *, certainly: bool) -> None:
        """Take note that the axis is not in program entry any more, by ESC or ^C; or may not be, by a reset."""
        self._is_wanted = False
        self._has_left = True
        self.was_aborted |= certainly
        if certainly:
            self._where = _Where.OUTSIDE
        elif self._where is _Where.INSIDE:
            self._where = _Where.UNKNOWN
        self._take_back(_UntilSent.LEFT)

    def _take_back(self, by: _UntilSent) -> None:
        if self._reply is not None and not self._was_sent and self._until_sent <= by:
            self._reply.cancel()

    # From beginning to end ------------------------------------------------------------------------------------------

    async def carry_out(
        self,
        address: int,
        lines: Sequence[EntryLine],
        *,
        by_escape: bool,
        on_taken: Callable[[], None],
    ) -> Exception | None:
        """
        Enter *lines* from *address* on, and end the entry, whatever happens; a cancellation is an interruption.

        Args:
            address: Where to begin.
            lines: What to store.
            by_escape: End it by ESC, which is for single mode alone: on a party line it aborts all axes.
            on_taken: Called with each that was acknowledged.

        Returns:
            What went wrong; None as well if it was interrupted. The attributes say how far it got.
        """
        failure: Exception | None = None
        self._times_opened = self._link.times_opened
        self._link.hold(self._axis)
        try:
            try:
                await self._begin(program_begin(address, self._profile))
                await self._enter(lines, on_taken)
            except Exception as error:  # a caller's own, from on_taken: the entry is ended all the same
                failure = error
            try:
                await self._leave(by_escape=by_escape or failure is not None)
            except CompaxError as error:
                failure = failure or error
        finally:
            self._link.release(self._axis)
        return failure

    async def _begin(self, text: str) -> None:
        """Begin the entry; a damaged beginning is left alone, for the axis may be in it, or execute what follows."""
        outcome: TurnOver | None = None
        for _ in range(_ATTEMPTS):
            outcome = await self._say(text, _UntilSent.STOP, on_sent=self._note_begun)
            if not isinstance(outcome, EntryFailed) or outcome.was_begun:
                break
            self._where = _Where.OUTSIDE
        if outcome is None or self._was_cut(outcome):
            return
        failure = self._line.refusal(self._axis, text, outcome)
        if failure is None:
            self._note_inside()
            return
        if isinstance(failure, CommandRejectedError):
            self._where = _Where.OUTSIDE
        raise failure

    def _note_begun(self) -> None:
        self._where = _Where.UNKNOWN

    def _note_inside(self) -> None:
        if not self._has_left:  # in the same breath
            self._where = _Where.INSIDE

    def _is(self, where: _Where) -> bool:
        return self._where is where

    async def _enter(self, lines: Sequence[EntryLine], on_taken: Callable[[], None]) -> None:
        for line in lines:
            if self._where is not _Where.INSIDE or not self._is_wanted:
                return
            outcome = await self._say(line.sent, _UntilSent.STOP, on_sent=partial(self._note_uncertain, line))
            if outcome is None or self._was_cut(outcome):
                return
            failure = self._line.refusal(self._axis, line.sent, outcome)
            # A name that is lost is not repeated: the axis may have been reset, and would execute what comes now.
            if isinstance(failure, CommandRejectedError) or (
                isinstance(outcome, EntryFailed) and not self._may_be_stored(outcome)
            ):
                self.uncertain = None
            if failure is not None:
                raise failure
            self.uncertain = None
            self.taken.append(line)
            on_taken()

    def _note_uncertain(self, line: EntryLine) -> None:
        self.uncertain = line

    def _may_be_stored(self, failed: EntryFailed) -> bool:
        if failed.was_begun and self._line.settings.cancel_with == "escape":
            self._where = _Where.OUTSIDE  # that has cleared it, and ends the entry as well (DCB p. 26-27)
            return False
        return failed.was_begun

    def _was_cut(self, outcome: TurnOver) -> bool:
        """Whether ESC or ^C came in the middle, and ended the entry."""
        if not isinstance(outcome, CutShort):
            return False
        self.note_left(certainly=True)
        if not outcome.was_complete:
            self.uncertain = None
        return True

    # Ending ---------------------------------------------------------------------------------------------------------

    async def _leave(self, *, by_escape: bool) -> None:
        """End the entry, and ask for the motion status, which an axis that is still in it does not tell."""
        if self._is(_Where.OUTSIDE) or self._has_left:
            return
        self._link.check_not_lost(self._times_opened)
        is_alone = not self._line.mode.has_names
        if is_alone and (by_escape or self._is(_Where.UNKNOWN)):
            self._where = _Where.UNKNOWN
            self._link.preempt(chr(ESCAPE))
        elif self._is(_Where.INSIDE):
            await self._say_end()
        else:
            return
        await self._confirm()

    async def _say_end(self) -> None:
        text = program_end(self._profile)
        for _ in range(_ATTEMPTS):
            if not self._is(_Where.INSIDE):
                return
            try:
                outcome = await self._say(text, _UntilSent.LEFT, on_sent=self._note_begun)
            except AnswerTimeoutError:
                if self._is(_Where.INSIDE):  # it had no turn: the line was silent for somebody else
                    continue
                return
            if outcome is None or self._was_cut(outcome):
                return
            if not isinstance(outcome, EntryFailed) or outcome.was_begun:
                return
            self._note_inside()  # it has seen its name, if anything

    async def _confirm(self) -> None:
        text = status_query(self._profile)
        for _ in range(_ATTEMPTS):
            if not self._is(_Where.UNKNOWN):
                return
            try:
                outcome = await self._say(text, _UntilSent.NOTHING)
            except AnswerTimeoutError:
                continue
            if outcome is None or self._was_cut(outcome):
                return
            if isinstance(outcome, Answered):
                self._take_status(outcome.text)
                return

    def _take_status(self, answer: str) -> None:
        try:
            self.status = decode_status(answer)
        except UnexpectedAnswerError:
            return  # as inside an entry: there is nothing to tell when an instruction is stored
        self._where = _Where.OUTSIDE

    # One line -------------------------------------------------------------------------------------------------------

    async def _say(
        self, text: str, until_sent: _UntilSent, on_sent: Callable[[], None] = lambda: None
    ) -> TurnOver | None:
        """
        Send one line, at most once; None: it was taken back before its turn.

        Raises:
            AnswerTimeoutError, ConnectionLostError: What became of it is unknown, if it was sent.
        """

        def sent() -> None:
            self._was_sent = True
            on_sent()

        if until_sent is _UntilSent.STOP and not self._is_wanted:
            return None
        self._link.check_not_lost(self._times_opened)
        self._was_sent, self._until_sent = False, until_sent
        self._reply = reply = self._link.exchange(
            self._axis + text, Lane.CONTROL, party=self._party, settles_late=True, on_sent=sent
        )
        while not reply.done():
            try:
                await asyncio.wait([reply])
            except asyncio.CancelledError:  # an event loop that ends cancels every task
                self.interrupt()
        self._reply = None
        if reply.cancelled():
            return None
        try:
            return reply.result()
        except ConnectionLostError:
            if self._where is _Where.INSIDE:
                self._where = _Where.UNKNOWN
            raise
