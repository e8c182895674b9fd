"""
One move carried out: said to the drive at most once, then watched until the drive says how it ended.

A move is confirmed by ``$``, or by its status when ``$`` does not come. A ``$`` counts only for the one command that
owes it: if an earlier command's is still owed (it was stopped, or its status was quicker), the status decides.
"""

from __future__ import annotations

import asyncio
import logging
from dataclasses import dataclass
from typing import Final

from ..errors import AnswerTimeoutError, CommandRejectedError, CompaxError, ConnectionLostError, MoveInDoubtError
from ..link.contract import Lane, TurnOver
from .facts.line import POSITION_REACHED_SIGN
from .moves import Move
from .observer import Look, Observer
from .protocol import Acknowledged, MessageForm
from .reports import Reports
from .settings import DriveSettings
from .verdict import Verdict, judge

__all__ = ["Memory", "Pursuit"]

_log = logging.getLogger(__name__)

_POLL_GROWTH: Final = 1.5
_LOOKS_UNTIL_UNCLEAR_COUNTS: Final = 3


@dataclass(slots=True)
class Memory:
    """What is remembered of a drive from one move to the next."""

    messages_owed: int = 0
    """Commands with ``$`` that were sent, less the ``$`` that came."""
    points_prepared: int = 0
    """Speed steps and comparators that the drive holds for a move that was not started."""
    doubt: str | None = None
    """Why the drive takes no motion until :meth:`Drive.reconcile`."""


class Pursuit:
    """
    Pursues one move.

    Args:
        move: What its holder awaits; this ends it, one way or the other, unless it is cancelled first.
        observer: Of the drive.
        settings: How patient to be.
        memory: Of the drive.
    """

    def __init__(self, move: Move, observer: Observer, settings: DriveSettings, memory: Memory) -> None:
        self.move = move
        self._observer = observer
        self._line = observer.line
        self._settings = settings
        self._memory = memory
        self._reports = Reports(observer.line.name, observer)
        self._loop = asyncio.get_running_loop()
        self._wake = asyncio.Event()
        self._message_came = False
        self._reply: asyncio.Future[TurnOver] | None = None

    async def carry_out(self) -> None:
        """
        Prepare, send, confirm; returns when the move has reached its target.

        Raises:
            CompaxError: It has not; the error says why.
        """
        await self._prepare()
        await self._send()
        await self._confirm()

    # Saying it ------------------------------------------------------------------------------------------------------

    async def _prepare(self) -> None:
        """Find out where the move begins, as far as it matters, and say everything but the motion itself."""
        plan = self.move.plan
        if plan.distance is not None:
            self.move.target = round(await self._observer.commanded_position() + plan.distance, self._settings.decimals)
        for text in plan.settings_lines:
            await self._line.command(text, Lane.MOTION)
        for text in plan.point_lines:
            self._memory.points_prepared += 1
            try:
                await self._line.command(text, Lane.MOTION)
            except CommandRejectedError:
                self._memory.points_prepared -= 1
                raise

    async def _send(self) -> None:
        """Put the motion on the wire, once, and return when it is known to be accepted."""
        plan = self.move.plan
        was_homed = plan.finds_machine_zero and (await self._observer.read_status()).machine_zero_approached
        owes_message = plan.may_ask_for_message and self._line.protocol.message_form is not MessageForm.FINAL_ONLY
        text = plan.motion + POSITION_REACHED_SIGN if owes_message else plan.motion

        def on_sent() -> None:
            self.move.note_sent(text)
            self._memory.points_prepared = 0
            self._memory.messages_owed += owes_message

        self._reply = self._line.exchange(text, Lane.MOTION, on_sent)
        try:
            outcome = await self._reply
        except AnswerTimeoutError as error:
            if not self.move.is_on_wire:
                raise
            await self._find_out(error, was_homed=was_homed)
            return
        if isinstance(outcome, Acknowledged):
            self.move.note_accepted()
            return
        refusal = self._line.error_of(text, outcome)
        if isinstance(refusal, CommandRejectedError):
            self._memory.messages_owed -= owes_message
            self._memory.points_prepared = len(plan.point_lines)
            raise refusal
        await self._find_out(refusal, was_homed=was_homed)

    async def _find_out(self, error: CompaxError, *, was_homed: bool) -> None:
        """
        Let the drive's status decide whether a motion arrived whose answer did not; it is never sent again.

        Raises:
            The *error* it came with: the status shows that the motion was not taken.
            MoveInDoubtError: The status cannot tell, or is not to be had.
        """
        look = await self._look(error)
        status = look.status
        if not status.no_fault:
            raise self._reports.fault(self.move, look, await self._observer.read_error())
        if not status.command_active and not self._message_came and not await self._was_taken(look, error, was_homed):
            self._memory.points_prepared = len(self.move.plan.point_lines)
            error.hint = (
                "the drive's status shows that it was not taken: it stands at "
                f"{self._observer.written(look.position)}; command it again if you want it"
            )
            raise error
        self.move.note_accepted()

    async def _was_taken(self, look: Look, error: CompaxError, was_homed: bool) -> bool:
        """Tell from a drive that stands still whether it has carried out the motion."""
        status = look.status
        if self.move.plan.finds_machine_zero:
            if status.machine_zero_approached and was_homed:
                raise self._doubt("machine zero had been approached before, so the status cannot tell", error)
            return status.machine_zero_approached
        commanded = await self._observer.commanded_position()
        if self._is_at_target(look.position) or self._is_at_target(commanded):
            return True
        if status.idle_after_stop or status.stopped_by_input:
            raise self._doubt(f"the drive was stopped at {self._observer.written(look.position)}", error)
        return False

    # Watching it ----------------------------------------------------------------------------------------------------

    def position_reached(self) -> None:
        """Take a ``$`` that was just read: it ends the move at once, if it can only be this move's."""
        owed, self._memory.messages_owed = self._memory.messages_owed, max(0, self._memory.messages_owed - 1)
        if not self.move.is_on_wire:
            return
        self._message_came = True
        if owed == 1 and self._was_acknowledged_by_prompt() and not self._settings.verify_messages:
            self.move.finish("message", self._line.last_position)
        self._wake.set()

    def look_now(self) -> None:
        """Look at once: something has happened to the line."""
        self._wake.set()

    def _was_acknowledged_by_prompt(self) -> bool:
        """Whether the motion's own prompt was read, if only in the same piece of bytes as its ``$``."""
        reply = self._reply
        if reply is None or not reply.done() or reply.cancelled() or reply.exception() is not None:
            return False
        outcome = reply.result()
        return isinstance(outcome, Acknowledged) and not outcome.by_message

    async def _confirm(self) -> None:
        """Look at the status ever more rarely, and at once when something hints at the end."""
        interval_s = self._settings.poll_first_s
        moved_at = self._loop.time()
        position: float | None = None
        unclear = 0
        while not self.move.done():
            await self._pause(interval_s)
            if self.move.done():
                return
            look = await self._look(None)
            if self.move.done():
                return
            verdict = self._judge(look)
            if verdict is Verdict.UNCLEAR:
                unclear += 1
                if unclear < _LOOKS_UNTIL_UNCLEAR_COUNTS:
                    continue  # its ramp has ended a moment ago, perhaps
                verdict = await self._second_opinion(look)
            if verdict is not Verdict.MOVING:
                await self._conclude(look, verdict)
                return
            unclear = 0
            if look.position != position:
                position, moved_at = look.position, self._loop.time()
            elif self._loop.time() - moved_at >= self._settings.stall_timeout_s:
                raise self._reports.stalled(self.move, look, self._settings.stall_timeout_s)
            interval_s = min(interval_s * _POLL_GROWTH, self._settings.poll_slowest_s)

    async def _pause(self, at_most_s: float) -> None:
        try:
            async with asyncio.timeout(at_most_s):
                await self._wake.wait()
        except TimeoutError:
            pass
        self._wake.clear()

    def _judge(self, look: Look) -> Verdict:
        return judge(
            look.status,
            is_at_target=self._is_at_target(look.position),
            finds_machine_zero=self.move.plan.finds_machine_zero,
        )

    async def _second_opinion(self, look: Look) -> Verdict:
        """Judge a drive that stands, and whose status and position do not both say that it has arrived."""
        if self.move.plan.finds_machine_zero:
            return Verdict.UNCLEAR
        if self._is_at_target(look.position):
            return Verdict.REACHED
        if look.status.position_reached and self._is_at_target(await self._observer.commanded_position()):
            return Verdict.REACHED  # within the drive's own positioning window (P14, UG p. 117)
        return Verdict.UNCLEAR

    async def _conclude(self, look: Look, verdict: Verdict) -> None:
        if verdict is Verdict.FAULT:
            raise self._reports.fault(self.move, look, await self._observer.read_error())
        if verdict is Verdict.STOPPED:
            raise self._reports.stopped_by_others(self.move, look)
        if verdict is Verdict.UNCLEAR:
            raise self._reports.not_arrived(self.move, look)
        self._learn_message_form()
        self.move.finish("status", look.position)

    def conclude_stopped(self, look: Look, fault: CompaxError | None, reason: CompaxError | None) -> None:
        """End the move by what was seen after a stop from here: it may have been there already."""
        verdict = self._judge(look)
        if verdict is Verdict.REACHED:
            self.move.finish("status", look.position)
        else:
            self.move.fail(fault or reason or self._reports.stopped(self.move, look))

    def _learn_message_form(self) -> None:
        """Do without ``$`` from now on if it was the drive's only answer: its line is blocked until then."""
        protocol = self._line.protocol
        if protocol.message_form is MessageForm.UNKNOWN and self._message_came:
            protocol.message_form = MessageForm.FINAL_ONLY
            _log.info("%s sends no prompt before '$': its moves are confirmed by status now", self._line.name)

    # Small things ---------------------------------------------------------------------------------------------------

    def _is_at_target(self, position: float | None) -> bool:
        return self._observer.is_near(position, self.move.target)

    async def _look(self, cause: CompaxError | None) -> Look:
        try:
            return await self._observer.look_patiently()
        except ConnectionLostError:
            raise
        except CompaxError as error:
            raise self._doubt("the drive does not say how it stands", cause or error) from error

    def _doubt(self, why: str, cause: CompaxError) -> MoveInDoubtError:
        self._memory.doubt = f"{self.move.plan.description} is in doubt: {why}"
        return self._reports.in_doubt(self.move, why, cause)
