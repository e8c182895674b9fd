"""
One drive's motion: at most one move, sent at most once, watched until the drive says how it ended.

A move is confirmed by ``$``, or by its status when ``$`` does not come. A ``$`` counts only for the one command that
owes it: if an earlier command's is still owed (it was stopped, or its status was quicker), the status decides.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from typing import Final, Literal

from ..errors import (
    AnswerTimeoutError,
    CommandRejectedError,
    CompaxError,
    ConnectionLostError,
    DriveFaultError,
    MoveActiveError,
    MoveError,
    MoveInDoubtError,
    MoveStoppedError,
    MoveTimeoutError,
    UnexpectedAnswerError,
)
from ..link.contract import Lane, TurnOver
from .codecs import DriveStatus, decode_error
from .facts.device_errors import DeviceError
from .facts.line import POSITION_REACHED_SIGN
from .line import DriveLine
from .moves import Move, OnCancel
from .protocol import Acknowledged, MessageForm
from .settings import DriveSettings
from .verdict import Look, Verdict, judge
from .vocabulary import MovePlan

__all__ = ["Motion"]

_log = logging.getLogger(__name__)

_POLL_GROWTH: Final = 1.5
_LOOKS_UNTIL_UNCLEAR_COUNTS: Final = 3
_STOP_PAUSE_S: Final = 0.1


class Motion:
    """
    What moves one drive; :class:`~compax_aio.compax.drive.Drive` is the face it has for callers.

    Args:
        line: The drive's line.
        settings: How patient to be.
        on_fault: Called when a status that was read shows a fault.
    """

    def __init__(
        self, line: DriveLine, settings: DriveSettings, on_fault: Callable[[DeviceError | None], None]
    ) -> None:
        self.name = line.name
        self._line = line
        self._settings = settings
        self._on_fault = on_fault
        self._loop = asyncio.get_running_loop()
        self._tolerance = 5 * 10.0**-settings.decimals
        self._active: Move | None = None
        self._reply: asyncio.Future[TurnOver] | None = None
        self._stopping: asyncio.Task[None] | None = None
        self._tasks: dict[Move, asyncio.Task[None]] = {}
        self._wake = asyncio.Event()
        self._messages_owed = 0
        self._message_came = False
        self._resting_position: float | None = None
        self._points_prepared = 0
        self._doubt: str | None = None
        self._faulted = False
        self.has_untracked_motion = False

    # Starting -------------------------------------------------------------------------------------------------------

    def start(self, plan: MovePlan, timeout_s: float | None, on_cancel: OnCancel) -> Move:
        """
        Send *plan* as soon as the line is free, after a stop that is under way.

        Raises:
            MoveActiveError: Another move runs.
            MoveInDoubtError: What became of the last one is unknown.
            MoveError: Points prepared for a move that never started would act on this one.
        """
        self.check(plan)
        move = Move(self, plan, on_cancel, sum(" OT " in line for line in plan.point_lines))
        self._active = move
        self._tasks[move] = self._loop.create_task(self._carry_out(move), name=f"{self.name}: {plan.description}")
        if timeout_s is not None:
            timer = self._loop.call_later(timeout_s, self._time_is_up, move, timeout_s)
            move.add_done_callback(lambda _: timer.cancel())
        return move

    def check(self, plan: MovePlan) -> None:
        """Raise what :meth:`start` would raise."""
        if self._active is not None:
            raise MoveActiveError(
                f"{self._active.plan.description} is running, so {plan.description} was not sent",
                device=self.name,
                hint="await it or stop it first; the drive would answer E92 (UG p. 162, 209)",
            )
        if self._doubt is not None:
            raise MoveInDoubtError(
                f"{plan.description} was not sent, for {self._doubt}",
                device=self.name,
                hint="look at the machine, then call reconcile()",
            )
        if self._points_prepared and not plan.finds_machine_zero:
            raise MoveError(
                f"{plan.description} was not sent: the drive still holds {self._points_prepared} speed steps or "
                "comparators of a move that was not started, and they would act on this one",
                device=self.name,
                hint="home() cancels them (UG p. 101)",
            )

    # Carrying out ---------------------------------------------------------------------------------------------------

    async def _carry_out(self, move: Move) -> None:
        try:
            if self._stopping is not None:
                await asyncio.wait([self._stopping])
                if self._doubt is not None:
                    raise MoveInDoubtError(f"{move.plan.description} was not sent, for {self._doubt}", device=self.name)
            await self._prepare(move)
            await self._send(move)
            await self._confirm(move)
        except CompaxError as error:
            self._settle(move, error)
        except asyncio.CancelledError:
            # Either the move was taken from here, or the event loop is ending: then the drive must not go on alone.
            if self._active is move:
                move.cancel()
                if self._stopping is not None:
                    await asyncio.wait([self._stopping])
            raise

    async def _prepare(self, move: Move) -> None:
        """Find out where the move begins, as far as it matters, and say everything but the motion itself."""
        plan = move.plan
        if plan.distance is not None:
            self._resting_position = await self._commanded_position()
            move.target = round(self._resting_position + plan.distance, self._settings.decimals)
        for text in plan.settings_lines:
            await self._line.command(text, Lane.MOTION)
        for text in plan.point_lines:
            self._points_prepared += 1
            try:
                await self._line.command(text, Lane.MOTION)
            except CommandRejectedError:
                self._points_prepared -= 1
                raise

    async def _commanded_position(self) -> float:
        """Read S2, the target position (IBS p. 12), or S1 from a drive that has none to give."""
        try:
            return await self._line.number(2)
        except (CommandRejectedError, UnexpectedAnswerError):
            return await self._line.position()

    async def _send(self, move: Move) -> None:
        """Put the motion on the wire, once, and return when it is known to be accepted."""
        plan = move.plan
        was_homed = plan.finds_machine_zero and (await self._look()).status.machine_zero_approached
        owes_message = plan.may_ask_for_message and self._line.protocol.message_form is not MessageForm.FINAL_ONLY
        text = plan.motion + POSITION_REACHED_SIGN if owes_message else plan.motion

        def on_sent() -> None:
            move.started_at = self._loop.time()
            self._points_prepared = 0
            self._messages_owed += owes_message

        self._message_came = False
        self._wake.clear()
        self._reply = self._line.exchange(text, Lane.MOTION, on_sent)
        try:
            outcome = await self._reply
        except AnswerTimeoutError as error:
            await self._find_out(move, error, was_homed)
            return
        if isinstance(outcome, Acknowledged):
            move.note_accepted()
            return
        refusal = self._line.error_of(text, outcome)
        if isinstance(refusal, CommandRejectedError):
            self._messages_owed -= owes_message
            self._points_prepared = len(plan.point_lines)
            raise refusal
        await self._find_out(move, refusal, was_homed)

    async def _find_out(self, move: Move, error: CompaxError, was_homed: bool) -> None:
        """
        Let the drive's status decide whether a motion arrived whose answer did not; it is never sent again.

        Raises:
            The *error* it came with: the status shows that the motion was not taken.
            MoveInDoubtError: The status cannot tell, or is not to be had.
        """
        plan = move.plan
        look = await self._look_patiently(move, error)
        if not look.status.no_fault:
            raise await self._fault_error(move, look)
        if look.status.command_active or self._message_came:
            move.note_accepted()
            return
        if plan.finds_machine_zero:
            if look.status.machine_zero_approached and was_homed:
                raise self._begin_doubt(move, "whether machine zero was sought cannot be told from the status", error)
            taken = look.status.machine_zero_approached
        else:
            commanded = await self._commanded_position()
            taken = self._is_near(look.position, move.target) or self._is_near(commanded, move.target)
            if not taken and (look.status.idle_after_stop or look.status.stopped_by_input):
                raise self._begin_doubt(move, f"it was stopped at {self._at(look.position)}", error)
        if taken:
            move.note_accepted()
            return
        self._points_prepared = len(plan.point_lines)
        error.hint = f"its status shows that the drive did not take it: it stands at {self._at(look.position)}"
        raise error

    async def _look_patiently(self, move: Move, error: CompaxError) -> Look:
        """Look as soon as the drive can be asked; raise MoveInDoubtError when it could not be for too long."""
        give_up_at = self._loop.time() + self._settings.in_doubt_after_s
        while True:
            try:
                return await self._look()
            except ConnectionLostError:
                raise
            except CompaxError as latest:
                if self._loop.time() >= give_up_at:
                    raise self._begin_doubt(move, "the drive does not say how it stands", latest) from error
            await self._pause(self._settings.poll_first_s)

    # Confirming -----------------------------------------------------------------------------------------------------

    def position_reached(self) -> None:
        """Take a ``$`` that was just read: it ends the move at once, if it can only be that move's."""
        owed, self._messages_owed = self._messages_owed, max(0, self._messages_owed - 1)
        move = self._active
        if move is None or not move.is_on_wire:
            return
        self._message_came = True
        if owed == 1 and self._was_acknowledged() and not self._settings.verify_messages:
            self._finish(move, "message")
        else:
            self._wake.set()

    def _was_acknowledged(self) -> bool:
        """Whether the active move's own prompt was read, if only in the same piece of bytes."""
        reply = self._reply
        if reply is None or not reply.done() or reply.cancelled() or reply.exception() is not None:
            return False
        outcome = reply.result()
        return isinstance(outcome, Acknowledged) and not outcome.by_message

    def comparator_reached(self, number: int) -> None:
        """Take a comparator's number that was just read."""
        if self._active is not None:
            self._active.note_comparator(number)

    def line_lost(self) -> None:
        """Let whoever watches a move find out at once."""
        self._wake.set()

    async def _confirm(self, move: Move) -> None:
        """Look at the status ever more rarely, and at once when something hints at the end."""
        interval_s = self._settings.poll_first_s
        moved_at = self._loop.time()
        position: float | None = None
        unclear = 0
        while not move.done():
            await self._pause(interval_s)
            look = await self._look_patiently(move, MoveError(f"{move.plan.description} is pending"))
            if move.done():
                return
            verdict = judge(look, move.plan, move.target, self._tolerance)
            if verdict is Verdict.UNCLEAR:
                # Its ramp has ended a moment ago, perhaps; or it never moved.
                unclear += 1
                if unclear < _LOOKS_UNTIL_UNCLEAR_COUNTS:
                    continue
                verdict = await self._second_opinion(move, look)
            if verdict is not Verdict.MOVING:
                await self._conclude(move, look, verdict)
                return
            unclear = 0
            if look.position != position:
                position, moved_at = look.position, self._loop.time()
            elif self._loop.time() - moved_at >= self._settings.stall_timeout_s:
                self.begin_stop(self._stall_error(move, position))
                return
            interval_s = min(interval_s * _POLL_GROWTH, self._settings.poll_slowest_s)

    async def _second_opinion(self, move: Move, look: Look) -> Verdict:
        """Judge a drive that stands, and whose status and position do not both say that it has arrived."""
        if move.plan.finds_machine_zero:
            return Verdict.UNCLEAR
        if self._is_near(look.position, move.target):
            return Verdict.REACHED
        if look.status.position_reached and self._is_near(await self._commanded_position(), move.target):
            return Verdict.REACHED  # within the drive's own positioning window (P14, UG p. 117)
        return Verdict.UNCLEAR

    async def _conclude(self, move: Move, look: Look, verdict: Verdict) -> None:
        self._resting_position = look.position
        at = self._at(look.position)
        if verdict is Verdict.REACHED:
            self._learn_message_form()
            self._finish(move, "status")
        elif verdict is Verdict.FAULT:
            raise await self._fault_error(move, look)
        elif verdict is Verdict.STOPPED:
            by = "by input I6" if look.status.stopped_by_input else "by somebody else"
            raise MoveStoppedError(
                f"{move.plan.description} was stopped {by} at {at}",
                device=self.name,
                sent=move.plan.motion,
                received=f"S16 {look.status.s16}, S17 {look.status.s17}",
                hint="find out who stopped it before you command it again",
            )
        else:
            raise MoveTimeoutError(
                f"{move.plan.description} ended at {at}, not at its target",
                device=self.name,
                sent=move.plan.motion,
                received=f"S16 {look.status.s16}, S17 {look.status.s17}",
                hint="the drive acknowledged it and stands still; does P20 make it keep quiet about errors?",
            )

    def _learn_message_form(self) -> None:
        """Do without ``$`` from now on if it was the drive's only answer: its line is blocked until then."""
        protocol = self._line.protocol
        reply = self._reply
        if protocol.message_form is not MessageForm.UNKNOWN or not self._message_came or reply is None:
            return
        if not self._was_acknowledged():
            protocol.message_form = MessageForm.FINAL_ONLY
            _log.info("%s: sends no prompt before '$'; its moves are confirmed by status from now on", self.name)

    # Stopping -------------------------------------------------------------------------------------------------------

    def begin_stop(self, reason: MoveError | None = None) -> asyncio.Task[None]:
        """
        Write STOP, now or as soon as the exchange in flight is over; the task ends at standstill.

        Args:
            reason: What the move that is stopped shall raise, if not MoveStoppedError.
        """
        move = self._active
        if move is not None:
            self._release(move)
            if not move.is_on_wire:
                self._fail_unsent(move)
                move = None
        if self._stopping is None:
            self.has_untracked_motion = False
            reply = self._line.exchange(self._settings.dialect.stop, Lane.STOP)
            self._stopping = self._loop.create_task(self._stop(reply, move, reason), name=f"{self.name}: stop")
            self._stopping.add_done_callback(self._stop_done)
        return self._stopping

    def abandon(self, move: Move) -> None:
        """Deal with a move that its holder has cancelled."""
        if move is not self._active:
            return
        if move.is_on_wire and move.on_cancel == "stop":
            self.begin_stop()
        else:
            self._release(move)

    async def stop(self) -> None:
        """Stop the drive and return at its standstill."""
        await asyncio.shield(self.begin_stop())

    async def stop_move(self, move: Move) -> None:
        """Stop the drive if *move* runs, or wait for the stop that its cancelling began."""
        if move is self._active:
            await self.stop()
        elif self._stopping is not None:
            await asyncio.shield(self._stopping)

    async def _stop(self, reply: asyncio.Future[TurnOver], move: Move | None, reason: MoveError | None) -> None:
        """Stop, whatever happens around it: an event loop that ends cancels every task, and this one all the more."""
        cancelled = False
        while True:
            try:
                await self._stop_once(reply, move, reason)
                break
            except asyncio.CancelledError:
                cancelled = True
                reply = self._line.exchange(self._settings.dialect.stop, Lane.STOP)
        if cancelled:
            raise asyncio.CancelledError

    async def _stop_once(self, reply: asyncio.Future[TurnOver], move: Move | None, reason: MoveError | None) -> None:
        try:
            await self._until_acknowledged(reply)
            look = await self._until_standstill()
        except CompaxError as error:
            self._doubt = f"a stop failed ({error.what})"
            if move is not None:
                in_doubt = self._in_doubt_error(move, "it may still be moving, for a stop failed", error)
                move.fail(lambda: in_doubt)
            raise
        self._resting_position = look.position
        if move is None or move.done():
            return
        verdict = judge(look, move.plan, move.target, self._tolerance)
        if verdict is Verdict.REACHED:
            move.finish("status", look.position)
        elif verdict is Verdict.FAULT:
            fault = await self._fault_error(move, look)
            move.fail(lambda: fault)
        else:
            stopped = reason or MoveStoppedError(
                f"{move.plan.description} was stopped at {self._at(look.position)}",
                device=self.name,
                sent=move.plan.motion,
                hint="command a new move when you want to go on",
            )
            move.fail(lambda: stopped)

    async def _until_acknowledged(self, reply: asyncio.Future[TurnOver]) -> None:
        """Repeat STOP until the drive acknowledges it: it does no harm when it comes twice."""
        stop = self._settings.dialect.stop
        give_up_at = self._loop.time() + self._settings.stop_timeout_s
        while True:
            try:
                outcome = await reply
            except AnswerTimeoutError as error:
                failure: CompaxError = error
            else:
                if isinstance(outcome, Acknowledged):
                    return
                failure = self._line.error_of(stop, outcome)
                if isinstance(failure, CommandRejectedError) and not (await self._look()).status.command_active:
                    return
            if self._loop.time() >= give_up_at:
                failure.what = f"STOP was not acknowledged: {failure.what}"
                failure.hint = (
                    "the axis may be moving: use the emergency stop; the RS-232 word of STOP is on no page that was "
                    "available (DriveSettings.dialect), so try it on a bench first"
                )
                raise failure
            await asyncio.sleep(_STOP_PAUSE_S)
            reply = self._line.exchange(stop, Lane.STOP)

    async def _until_standstill(self) -> Look:
        give_up_at = self._loop.time() + self._settings.standstill_timeout_s
        while True:
            look = await self._look()
            status = look.status
            if not status.command_active or status.idle_after_stop or not status.no_fault:
                return look
            if self._loop.time() >= give_up_at:
                raise MoveTimeoutError(
                    f"STOP was acknowledged, but {self._settings.standstill_timeout_s:g} s later the drive's command "
                    f"is still active, at {self._at(look.position)}",
                    device=self.name,
                    sent=self._settings.dialect.stop,
                    received=f"S16 {status.s16}, S17 {status.s17}",
                    hint="use the emergency stop if it moves; a long stop ramp (P10) wants more standstill_timeout_s",
                )
            await asyncio.sleep(_STOP_PAUSE_S)

    def _stop_done(self, task: asyncio.Task[None]) -> None:
        self._stopping = None
        if not task.cancelled() and (error := task.exception()) is not None:
            _log.error("%s: %s", self.name, error)

    def _time_is_up(self, move: Move, timeout_s: float) -> None:
        if move is not self._active:
            return
        error = MoveTimeoutError(
            f"{move.plan.description} was not at its target within {timeout_s:g} s and was stopped",
            device=self.name,
            sent=move.plan.motion if move.is_on_wire else None,
            hint="give it more time, or find out what holds it",
        )
        if move.is_on_wire:
            self.begin_stop(error)
        else:
            self._settle(move, error)

    # Looking --------------------------------------------------------------------------------------------------------

    async def read_position(self) -> float:
        """Read S1."""
        return await self._line.position()

    async def read_status(self, lane: Lane = Lane.READ) -> DriveStatus:
        """Read S16 and S17; a fault they show is told to whoever follows the drive's events."""
        status = await self._line.status(lane)
        if status.no_fault:
            self._faulted = False
        elif not self._faulted:
            self._faulted = True
            self._on_fault(await self._read_error())
        return status

    async def _read_error(self) -> DeviceError | None:
        try:
            return decode_error(await self._line.query("S30", Lane.CONTROL))
        except (CommandRejectedError, UnexpectedAnswerError):
            return None

    async def _look(self) -> Look:
        status = await self.read_status(Lane.CONTROL)
        try:
            position: float | None = await self._line.position(Lane.CONTROL)
        except (CommandRejectedError, UnexpectedAnswerError):
            position = None
        return Look(status, position)

    async def reconcile(self) -> DriveStatus:
        """Read status and position, and end the doubt."""
        look = await self._look()
        self._doubt = None
        self._resting_position = look.position
        return look.status

    # Ending ---------------------------------------------------------------------------------------------------------

    async def end(self) -> None:
        """Stop what was started here, unless it was to go on; raises what a stop raises."""
        move = self._active
        if move is not None and not move.is_on_wire:
            self._release(move)
            self._fail_unsent(move)
        elif move is not None and move.on_cancel == "detach":
            self._settle(move, ConnectionLostError(f"the line was closed, {move.plan.description} goes on unwatched"))
        elif move is not None or self.has_untracked_motion:
            self.begin_stop()
        if self._stopping is not None:
            await asyncio.shield(self._stopping)

    def _finish(self, move: Move, confirmed_by: Literal["message", "status"]) -> None:
        self._release(move)
        if move.target is not None:
            self._resting_position = move.target
        move.finish(confirmed_by, self._line.last_position)

    def _settle(self, move: Move, error: CompaxError) -> None:
        self._release(move)
        move.fail(lambda: error)

    def _fail_unsent(self, move: Move) -> None:
        move.fail(lambda: MoveStoppedError(f"{move.plan.description} was stopped before it was sent", device=self.name))

    def _release(self, move: Move) -> None:
        """Let go of *move*: nobody watches it from now on."""
        if self._active is move:
            self._active = None
        task = self._tasks.pop(move, None)
        if task is not None and task is not asyncio.current_task():
            task.cancel()

    async def _pause(self, at_most_s: float) -> None:
        """Wait *at_most_s*, less if something hints at the end of the move."""
        try:
            async with asyncio.timeout(at_most_s):
                await self._wake.wait()
        except TimeoutError:
            pass
        self._wake.clear()

    def _is_near(self, position: float | None, target: float | None) -> bool:
        return position is not None and target is not None and abs(position - target) <= self._tolerance

    def _at(self, position: float | None) -> str:
        return "an unknown position" if position is None else f"{position:.{self._settings.decimals}f}"

    # Errors ---------------------------------------------------------------------------------------------------------

    def _begin_doubt(self, move: Move, why: str, cause: CompaxError) -> MoveInDoubtError:
        self._doubt = f"{move.plan.description} is in doubt: {why}"
        return self._in_doubt_error(move, why, cause)

    def _in_doubt_error(self, move: Move, why: str, cause: CompaxError) -> MoveInDoubtError:
        error = MoveInDoubtError(
            f"what became of {move.plan.description} is in doubt: {why}",
            device=self.name,
            sent=move.plan.motion,
            received=cause.received,
            hint="look at the machine, then call reconcile(); until then this drive takes no motion from here",
            exchanges=self._line.link.recent(),
        )
        error.__cause__ = cause
        return error

    async def _fault_error(self, move: Move, look: Look) -> DriveFaultError:
        fault = await self._read_error()
        return DriveFaultError(
            f"a fault ended {move.plan.description} at {self._at(look.position)}: "
            f"{f'E{fault.code}, {fault.meaning}' if fault else 'the drive does not say which'}",
            device=self.name,
            sent=move.plan.motion,
            received=f"S16 {look.status.s16}, S17 {look.status.s17}",
            hint=fault.remedy if fault else "read error_history(), mend the cause, then quit()",
            code=fault.code if fault else None,
            exchanges=self._line.link.recent(),
        )

    def _stall_error(self, move: Move, position: float | None) -> MoveTimeoutError:
        return MoveTimeoutError(
            f"{move.plan.description} stood still at {self._at(position)} for {self._settings.stall_timeout_s:g} s "
            "with its command active, and was stopped",
            device=self.name,
            sent=move.plan.motion,
            hint="find out what holds the axis; a longer stall_timeout_s waits longer",
        )
