"""
One move carried out: said to the drive at most once, then watched until the drive says how it ended.

A move is confirmed by ``$``, or by its status when ``$`` does not come. A ``$`` counts only for the one command that
owes it: if an earlier command's is still owed (it was stopped, or its status was quicker), the status decides.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Final, TypeVar

from ..errors import (
    AnswerTimeoutError,
    CommandRejectedError,
    CompaxError,
    ConnectionLostError,
    MoveInDoubtError,
)
from ..link.contract import Lane, TurnOver
from ..motion.one_move import MustStop
from ..motion.pace import Pace
from .facts.device_errors import MOVE_ACTIVE_CODE
from .facts.line import EXECUTE_SIGN, POSITION_REACHED_SIGN, STORE_SIGN
from .memory import Memory
from .moves import Move, PreparedMove
from .observer import Look, Observer
from .protocol import Acknowledged, MessageForm
from .reports import Reports
from .verdict import Verdict, judge
from .vocabulary import check_travel

__all__ = ["Pursuit"]

_log = logging.getLogger("compax_aio.compax")

_Value = TypeVar("_Value")

_LOOKS_UNTIL_UNCLEAR_COUNTS: Final = 3
_SAMPLES: Final = 2


@dataclass(frozen=True, slots=True)
class _Stored:
    """A motion in the drive's intermediate memory."""

    lines_sent: int
    """As the link counted when it was written."""
    asks_for_message: bool


class Pursuit:
    """
    Pursues one move.

    Args:
        move: What its holder awaits; this ends it, one way or the other, unless it is cancelled first.
        observer: Of the drive.
        memory: Of the drive.
    """

    def __init__(self, move: Move, observer: Observer, memory: Memory) -> None:
        self.move = move
        self._observer = observer
        self._line = observer.line
        self.times_opened = observer.line.link.times_opened
        """When the move was commanded."""
        self._settings = observer.line.settings
        self._memory = memory
        self._reports = Reports(observer.line.name, observer)
        self._loop = asyncio.get_running_loop()
        self._wake = asyncio.Event()
        self._message_came = False
        self._owes_message = False
        self._was_seen_active = False
        self._homed_before: Look | None = None
        self._reply: asyncio.Future[TurnOver] | None = None
        self._stored: _Stored | None = None
        self._sent_as_frame = False
        self._signs_of_restart: tuple[str, ...] = ()
        self._line_was_lost = self._has_lost_line = False

    async def carry_out(self) -> None:
        """
        Prepare, send, confirm; returns when the move has reached its target.

        Raises:
            MustStop: It stands still although its command is active, or stands elsewhere.
            CompaxError: It has not reached it; the error says why.
        """
        try:
            if isinstance(self.move, PreparedMove):
                await self._look_before_preparing()
            await self._prepare()
            if isinstance(self.move, PreparedMove):
                await self._hold_ready(self.move)
            await self._send()
        finally:
            self._line.link.release_reads()
        await self._confirm()

    # Saying it ------------------------------------------------------------------------------------------------------

    async def _prepare(self) -> None:
        """Find out where the move begins, as far as it matters, and say everything but the motion itself."""
        plan = self.move.plan
        if plan.distance is not None:
            self._refuse_if_active(await self._observer.look(Lane.MOTION))
            target = round(await self._observer.standing_position(Lane.MOTION) + plan.distance, self._settings.decimals)
            self.move.target = check_travel(target, self._settings)
        await self._line.transfer.say_settings(plan.settings_lines)
        for text in plan.point_lines:
            try:
                await self._line.command(text, Lane.MOTION, self._note_point)
            except CommandRejectedError:
                self._memory.points_prepared -= 1
                raise
        if plan.finds_machine_zero:
            await self._look_before_homing()

    def _note_point(self) -> None:
        self._memory.points_prepared += 1

    async def _hold_ready(self, move: PreparedMove) -> None:
        """Let the drive store the motion, and wait until it is triggered."""
        # A drive that keeps quiet about errors may have refused it, and would execute what it had stored before.
        if self._line.transfer.tells_errors:
            asks = self._asks_for_message and self._settings.message_when_prepared
            text = move.plan.motion + (POSITION_REACHED_SIGN if asks else "") + STORE_SIGN
            link = self._line.link

            def on_sent() -> None:
                # An older one that was never triggered must not be executed in place of a store that got lost.
                self._stored = _Stored(link.lines_sent, asks) if self._memory.stored == 0 else None
                self._memory.stored += 1
                link.hold_reads(self._settings.answer_timeout_s)

            await self._line.command(text, Lane.MOTION, on_sent)
        move.note_ready()
        await move.triggered.wait()

    @property
    def _asks_for_message(self) -> bool:
        return self.move.plan.may_ask_for_message and self._line.protocol.message_form is not MessageForm.FINAL_ONLY

    def _starting_line(self) -> tuple[str, bool]:
        """Return what starts the motion when it is written now, and whether ``$`` is owed for it."""
        link = self._line.link
        if self._stored is not None and self._stored.lines_sent == link.lines_sent and link.is_free:
            return EXECUTE_SIGN, self._stored.asks_for_message
        motion = self.move.plan.motion
        if self._asks_for_message and not self._line.transfer.is_motion_frame(motion):
            return motion + POSITION_REACHED_SIGN, True
        return motion, False  # a frame takes no sign (UG p. 166)

    async def _send(self) -> None:
        """Put the motion on the wire, once, and return when it is known to be accepted."""
        plan = self.move.plan
        text, owes_message = self._starting_line()
        self._sent_as_frame = self._line.transfer.is_motion_frame(text)

        def on_sent() -> None:
            self.move.note_sent(text)
            self._memory.points_prepared = 0
            self._memory.messages_owed += owes_message
            self._owes_message = owes_message

        self._reply = self._line.exchange(text, Lane.MOTION, on_sent)
        self._line.link.release_reads()
        try:
            outcome = await self._reply
        except (AnswerTimeoutError, ConnectionLostError) as error:
            if not self.move.is_on_wire or self._line.link.is_over:
                raise
            await self._find_out(error)
            return
        if isinstance(outcome, Acknowledged):
            self._memory.stored -= text == EXECUTE_SIGN
            self.move.note_accepted()
            return
        refusal = self._line.error_of(text, outcome)
        if isinstance(refusal, CommandRejectedError):
            self._memory.messages_owed -= owes_message
            self._owes_message = False
            self._memory.points_prepared = len(plan.point_lines)
            await self._look_whether_refused(refusal)
            return
        await self._find_out(refusal)

    async def _look_whether_refused(self, refusal: CommandRejectedError) -> None:
        """Raise *refusal*, unless the drive moves all the same: an error that came twice may be another line's."""
        if refusal.code == MOVE_ACTIVE_CODE:
            raise refusal  # and somebody else's motion runs
        try:
            moves = (await self._observer.read_status()).command_active
        except CompaxError:
            raise refusal from None
        if not moves:
            raise refusal
        await self._find_out(refusal)

    async def _look_before_homing(self) -> None:
        """Take note of what could be mistaken for its success: machine zero had been approached before."""
        look = await self._observer.look(Lane.MOTION)
        self._refuse_if_active(look)
        if look.status.machine_zero_approached:
            self._homed_before = look

    async def _look_before_preparing(self) -> None:
        """Find out now what would keep the motion from starting when the others start."""
        look = await self._observer.look(Lane.MOTION)
        self._refuse_if_active(look)
        if not look.status.no_fault:
            raise self._reports.fault(self.move, look, await self._observer.read_error())

    def _refuse_if_active(self, look: Look) -> None:
        if look.status.command_active:
            raise self._reports.moved_by_others(self.move, look)

    async def _find_out(self, error: CompaxError) -> None:
        """
        Let the drive's status decide whether a motion arrived whose answer did not; it is never sent again.

        Raises:
            The *error* it came with: the status shows that the motion was not taken.
            MoveInDoubtError: The status cannot tell, or is not to be had.
        """
        if self._sent_as_frame:
            self._line.transfer.motion_was_lost(self.move.plan.motion)
            raise self._doubt("it went in binary, and may have arrived cut", error)
        look = await self._look(error)
        status = look.status
        self._was_seen_active |= status.command_active
        self._refuse_after_restart(error)
        if not status.no_fault:
            self._points_may_be_left()
            raise self._reports.fault(self.move, look, await self._observer.read_error())
        if not status.command_active and not self._message_came and not await self._was_taken(look, error):
            if self._line.active_seen_at > (self.move.started_at or 0.0):
                raise self._doubt("it had begun, and the drive does not say how it ended", error)
            self._memory.points_prepared = len(self.move.plan.point_lines)
            error.hint = (
                "the drive's status shows that it was not taken: it stands at "
                f"{self._observer.written(look.position)}; command it again if you want it"
            )
            raise error
        self.move.note_accepted()

    async def _was_taken(self, look: Look, error: CompaxError) -> bool:
        """Tell from a drive that stands still whether it has carried out the motion."""
        status = look.status
        if self.move.plan.finds_machine_zero:
            if status.machine_zero_approached and self._homed_before:
                raise self._doubt("machine zero had been approached before, so the status cannot tell", error)
            return status.machine_zero_approached
        if self._is_at_target(look.position):
            return True
        if status.shows_stop:
            # The stop may be that of an earlier move, even of one to the same target.
            raise self._doubt(f"the drive was stopped at {self._observer.written(look.position)}", error)
        return self._is_at_target(await self._learn(self._observer.commanded_position, error))

    # Watching it ----------------------------------------------------------------------------------------------------

    def position_reached(self) -> None:
        """Take a ``$`` that was just read: it ends the move at once, if it can only be this move's."""
        owed, self._memory.messages_owed = self._memory.messages_owed, max(0, self._memory.messages_owed - 1)
        if not self.move.is_on_wire:
            return
        self._message_came = True
        # A late one of an earlier move must not end a move that asked for none, as the search for machine zero.
        if (
            owed == 1
            and self._owes_message
            and self._was_acknowledged_by_prompt()
            and not self._settings.verify_messages
        ):
            self.move.finish("message", self._line.last_position)
        self._wake.set()

    def look_now(self) -> None:
        """Look at once: something has happened to the line."""
        self._wake.set()

    def line_restored(self, signs_of_restart: tuple[str, ...]) -> None:
        """Look at once, now that the line is back; a drive that was switched off cannot say how the move ended."""
        self._signs_of_restart += signs_of_restart
        self._line_was_lost = self._has_lost_line = True
        self._wake.set()

    def _refuse_after_restart(self, cause: CompaxError | None) -> None:
        if self._signs_of_restart:
            raise self._restart(cause)

    def _restart(self, cause: CompaxError | None = None) -> MoveInDoubtError:
        signs = " and ".join(self._signs_of_restart)
        return self._doubt(f"the drive seems to have been switched off and on: {signs}", cause)

    def _was_acknowledged_by_prompt(self) -> bool:
        """Whether the motion's own prompt was read, if only in the same piece of bytes as its ``$``."""
        reply = self._reply
        if reply is None or not reply.done() or reply.cancelled() or reply.exception() is not None:
            return False
        outcome = reply.result()
        return isinstance(outcome, Acknowledged) and not outcome.by_message

    async def _confirm(self) -> None:
        """Look at the status ever more rarely, and at once when something hints at the end."""
        pace = self._pace()
        unclear = 0
        while not self.move.done():
            # Where the drive sends a message there is no hurry to look.
            await self._pause(pace.pause_s if self._owes_message else pace.pause_before_arrival_s(self.move.target))
            if self.move.done():
                return
            look = await self._look(None)
            if self.move.done():
                return
            self._was_seen_active |= look.status.command_active
            self._refuse_after_restart(None)
            if self._line_was_lost:
                self._line_was_lost = False
                pace = self._pace()  # nobody knows for how long it has stood still
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
            pace.note(look.position, self._loop.time())
            if pace.stood_still_s(self._loop.time()) >= self._settings.stall_timeout_s:
                # Its command is active: it must not start later on.
                raise MustStop(self._reports.stalled(self.move, look, self._settings.stall_timeout_s))

    def _pace(self) -> Pace:
        return Pace(self._settings.poll_first_s, self._settings.poll_slowest_s, self._loop.time())

    async def _pause(self, at_most_s: float) -> None:
        try:
            async with asyncio.timeout(at_most_s):
                await self._wake.wait()
        except TimeoutError:
            pass
        self._wake.clear()

    def _judge(self, look: Look) -> Verdict:
        verdict = judge(
            look.status,
            is_at_target=self._is_at_target(look.position),
            finds_machine_zero=self.move.plan.finds_machine_zero,
        )
        if verdict is Verdict.REACHED and self._may_be_of_an_earlier_search(look):
            return Verdict.UNCLEAR
        return verdict

    async def _second_opinion(self, look: Look) -> Verdict:
        """Judge a drive that stands, and whose status and position do not both say that it has arrived."""
        if self.move.plan.finds_machine_zero:
            return Verdict.UNCLEAR
        if self._is_at_target(look.position):
            if self._has_lost_line and not look.status.position_reached:
                # As after power-on, when an axis without machine zero counts from 0 again.
                raise self._doubt("it stands at its target, and the drive does not say that it has reached it", None)
            return Verdict.REACHED
        if not look.status.position_reached:
            return Verdict.UNCLEAR
        if self._is_at_target(await self._learn(self._observer.commanded_position, None)):
            return Verdict.REACHED  # within the drive's own positioning window (P14, UG p. 117)
        return Verdict.UNCLEAR

    def _may_be_of_an_earlier_search(self, look: Look) -> bool:
        """Whether nothing shows that this search for machine zero began: "approached" may be of an earlier one."""
        before = self._homed_before
        return (
            before is not None
            and not self._was_seen_active
            and self._observer.is_near(look.position, before.position)
            and not self._observer.is_near(look.position, 0.0)
        )

    def _points_may_be_left(self) -> None:
        """Take note that a motion of which nothing was seen may not have used up its points."""
        if not self._was_seen_active:
            self._memory.points_prepared = len(self.move.plan.point_lines)

    async def _conclude(self, look: Look, verdict: Verdict) -> None:
        if verdict is not Verdict.REACHED:
            self._points_may_be_left()
        if verdict is Verdict.FAULT:
            raise self._reports.fault(self.move, look, await self._observer.read_error())
        if verdict is Verdict.STOPPED:
            raise self._reports.stopped_by_others(self.move, look)
        if verdict is Verdict.UNCLEAR:
            raise MustStop(self._reports.not_arrived(self.move, look))
        self._learn_message_form()
        self.move.finish("status", look.position)

    def conclude_stopped(self, look: Look, fault: CompaxError | None, reason: CompaxError | None) -> None:
        """End the move by what was seen after a stop from here: it may have been there already."""
        verdict = self._judge(look)
        if self._signs_of_restart:
            self.move.fail(self._restart())
        elif verdict is Verdict.REACHED:
            self.move.finish("status", look.position)
        else:
            self.move.fail(fault or reason or self._reports.stopped(self.move, look))

    def _learn_message_form(self) -> None:
        """Do without ``$`` from now on if it is the drive's only answer: its line is blocked until then."""
        protocol = self._line.protocol
        if protocol.message_form is not MessageForm.UNKNOWN or not self._message_came:
            return
        self._memory.messages_without_prompt += 1
        if self._memory.messages_without_prompt >= _SAMPLES:  # one alone may have lost its prompt
            protocol.message_form = MessageForm.FINAL_ONLY
            _log.info("%s sends no prompt before '$': its moves are confirmed by status now", self._line.name)

    # Small things ---------------------------------------------------------------------------------------------------

    def _is_at_target(self, position: float | None) -> bool:
        return self._observer.is_near(position, self.move.target)

    async def _look(self, cause: CompaxError | None) -> Look:
        return await self._learn(self._observer.look, cause)

    async def _learn(self, read: Callable[[], Awaitable[_Value]], cause: CompaxError | None) -> _Value:
        try:
            return await self._observer.patiently(read)
        except CompaxError as error:
            if self._line.link.is_over:
                raise
            raise self._doubt("the drive does not say how it stands", cause or error) from error

    def _doubt(self, why: str, cause: CompaxError | None) -> MoveInDoubtError:
        self._memory.doubt = f"{self.move.plan.description} is in doubt: {why}"
        return self._reports.in_doubt(self.move, why, cause)
