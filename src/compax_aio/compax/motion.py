"""One drive's motion: at most one move, a stop that goes before everything, and what is remembered in between."""

from __future__ import annotations

import asyncio
import logging
from contextlib import suppress

from ..errors import (
    AnswerTimeoutError,
    CommandRejectedError,
    CompaxError,
    ConnectionLostError,
    MoveError,
    MoveInDoubtError,
    MoveTimeoutError,
    UnexpectedAnswerError,
)
from ..link.contract import Lane
from .codecs import DriveStatus
from .facts.device_errors import DeviceError
from .memory import Memory
from .moves import Move, OnCancel, PreparedMove, check_manner, fetch_error
from .observer import Observer
from .pursuit import Pursuit
from .reports import Reports
from .stopping import Stop
from .untracked import Untracked
from .vocabulary import MovePlan, change_of_speed

__all__ = ["Motion"]

_log = logging.getLogger("compax_aio.compax")


class Motion:
    """
    What moves one drive; :class:`~compax_aio.compax.drive.Drive` is the face it has for callers.

    Args:
        observer: Of the drive.
    """

    def __init__(self, observer: Observer) -> None:
        self.name = observer.line.name
        self._observer = observer
        self._reports = Reports(self.name, observer)
        self.untracked = Untracked(observer.line, self._reports)
        self._loop = asyncio.get_running_loop()
        self._memory = Memory()
        self._active: Pursuit | None = None
        self._stopped: Pursuit | None = None
        self._task: asyncio.Task[None] | None = None
        self._stopping: asyncio.Task[None] | None = None
        self.stops = 0
        """How many times a stop has been asked for."""
        self.restarts = 0
        """How many times the drive seemed to have been switched off and on while its line was lost."""
        self._timeout_s: float | None = None

    # Starting -------------------------------------------------------------------------------------------------------

    def check(self, plan: MovePlan) -> None:
        """Raise what :meth:`start` would raise."""
        self.refuse_second(plan.description)
        self._refuse_in_doubt(plan.description)
        if self._observer.line.transfer.speed_is_unknown and not plan.sets_speed and not plan.finds_machine_zero:
            raise self._reports.speed_unknown(plan)
        if self._memory.points_prepared and not plan.finds_machine_zero:
            raise self._reports.points_left(plan, self._memory.points_prepared)

    def start(self, plan: MovePlan, timeout_s: float | None, on_cancel: OnCancel) -> Move:
        """
        Send *plan* as soon as the line is free, after a stop that is under way.

        Raises:
            MoveActiveError: Another move runs.
            MoveInDoubtError: What became of the last one is unknown.
            MoveError: Points prepared for a move that never started would act on this one.
            InvalidCommandError: *timeout_s* or *on_cancel* means nothing.
        """
        check_manner(timeout_s, on_cancel)
        self.check(plan)
        move = Move(self, plan, on_cancel)
        self._begin(move)
        self._limit(move, timeout_s)
        return move

    def prepare(self, plan: MovePlan, timeout_s: float | None, on_cancel: OnCancel) -> PreparedMove:
        """Let the drive hold *plan* ready, and start it when triggered; *timeout_s* counts from then."""
        check_manner(timeout_s, on_cancel)
        self.check(plan)
        move = PreparedMove(self, plan, on_cancel)
        self._timeout_s = timeout_s
        self._begin(move)
        return move

    def trigger(self, move: PreparedMove) -> None:
        """Start *move*, which the drive must hold ready."""
        if not self._is_active(move) or not move.readiness.done() or move.triggered.is_set():
            raise self._reports.not_ready(move)
        move.triggered.set()
        self._limit(move, self._timeout_s)

    def _begin(self, move: Move) -> None:
        self._release()
        self._active = Pursuit(move, self._observer, self._memory)
        self._task = self._loop.create_task(self._pursue(self._active), name=f"{self.name}: {move.plan.description}")
        # Whatever ends the move, by whoever's hand: the drive is free for the next.
        move.add_done_callback(self._move_done)
        move.acceptance.add_done_callback(self._move_accepted)

    def _move_accepted(self, acceptance: asyncio.Future[None]) -> None:
        if not acceptance.cancelled() and acceptance.exception() is None:
            self.untracked.note_moves_over(self.untracked.mark())

    def _limit(self, move: Move, timeout_s: float | None) -> None:
        if timeout_s is not None:
            timer = self._loop.call_later(timeout_s, self._time_is_up, move, timeout_s)
            move.add_done_callback(lambda _: timer.cancel())

    async def change_speed(self, move: Move, speed_percent: int) -> None:
        """Let *move*, which must run, go on at another speed."""
        text = change_of_speed(speed_percent, self._observer.line.settings)
        if not self._is_active(move) or not move.is_on_wire:
            raise MoveError(
                f"{move.plan.description} does not run, so its speed cannot be changed",
                device=self.name,
                hint="give a move its speed with speed_percent=",
            )
        came_late = False

        def on_sent() -> None:
            nonlocal came_late
            came_late = move.done()

        await self.untracked.say(text, Lane.CONTROL, on_sent)
        if came_late:
            # Taken by a drive that stood, it may be a speed step at the beginning of the next move.
            self._memory.points_prepared += 1
            raise MoveError(
                f"{move.plan.description} ended before its new speed was sent, which may act on the next move",
                device=self.name,
                sent=text,
                hint="home() cancels it (UG p. 101)",
            )

    async def _pursue(self, pursuit: Pursuit) -> None:
        try:
            if self._stopping is not None:
                await self._until_stopped(pursuit.times_opened)
                self._refuse_in_doubt(pursuit.move.plan.description)
            await pursuit.carry_out()
        except MoveTimeoutError as error:
            # It stands still although its command is active, or stands elsewhere; it must not start later on.
            if self._is_active(pursuit.move):
                self.begin_stop(error)
        except CompaxError as error:
            # What is in doubt may be moving: leaving the block stops it.
            if isinstance(error, MoveInDoubtError) and pursuit.move.is_on_wire:
                self.untracked.note()
            pursuit.move.fail(error)
        except asyncio.CancelledError:
            # Either the move was taken from here, or the event loop is ending: then the drive must not go on alone.
            if self._is_active(pursuit.move):
                pursuit.move.cancel()
            # Also where somebody else was quicker to stop it: the loop must not end before that is over.
            if self._stopping is not None:
                await asyncio.wait([self._stopping])
            raise

    async def _until_stopped(self, times_opened: int) -> None:
        """Wait for a stop that is under way; what shall follow it is not said on a line that came back meanwhile."""
        assert self._stopping is not None
        link = self._observer.line.link
        link.check_not_lost(times_opened)
        await asyncio.wait([self._stopping])
        link.check_not_lost(times_opened)

    async def command(self, text: str) -> None:
        """Send *text* as :meth:`tell` does; where nobody can say what became of it, no motion is taken any more."""
        mark = self.untracked.mark()
        try:
            await self.tell(text)
        except (AnswerTimeoutError, ConnectionLostError, UnexpectedAnswerError) as error:
            if self.untracked.mark() != mark:
                self._memory.doubt = f"what became of {text!r} is unknown ({error.what})"
                error.hint = "look at the machine, then call reconcile(); this drive takes no motion until then"
            raise

    async def tell(self, text: str, *, unless_stopped_since: int | None = None) -> None:
        """
        Send *text*, which starts a motion that nobody watches, after a stop that is under way.

        Leaving the block stops it; a stop that comes before it is written takes it back.

        Args:
            text: One checked line.
            unless_stopped_since: What :attr:`stops` was when the caller began; a stop since then counts as well.

        Raises:
            MoveActiveError, MoveInDoubtError: Another move runs or is in doubt; nothing was sent.
            MoveStoppedError: A stop came before it was sent.
            CommandRejectedError, UnexpectedAnswerError, AnswerTimeoutError, ConnectionLostError: As for any line.
        """
        stops = self.stops if unless_stopped_since is None else unless_stopped_since
        if self._stopping is not None:
            await self._until_stopped(self._observer.line.link.times_opened)
        self.refuse_second(repr(text))
        self._refuse_in_doubt(repr(text))
        await self._observer.line.transfer.say_settings(())
        if self.stops != stops:
            raise self._reports.taken_back(text)
        self._observer.is_homed = False  # what nobody watches may be a search for machine zero
        await self.untracked.tell(text)

    def note_doubt(self, why: str) -> None:
        """Take no motion from here until :meth:`reconcile`; what may be moving is stopped when the block is left."""
        self._memory.doubt = why
        self.untracked.note()

    def refuse_second(self, what: str) -> None:
        """Raise MoveActiveError if a move runs: *what* was not sent."""
        if self._active is not None and not self._active.move.done():
            raise self._reports.running(self._active.move, what)

    def _refuse_in_doubt(self, what: str) -> None:
        if self._memory.doubt is not None:
            raise self._reports.refused_in_doubt(what, self._memory.doubt)

    def _time_is_up(self, move: Move, timeout_s: float) -> None:
        error = self._reports.out_of_time(move, timeout_s)
        if move.is_on_wire and self._is_active(move):
            self.begin_stop(error)
        else:
            self._withdraw(move, error)

    # Hearing --------------------------------------------------------------------------------------------------------

    def position_reached(self) -> None:
        """Take a ``$`` that was just read."""
        if self._active is not None:
            self._active.position_reached()
        else:
            self._memory.messages_owed = max(0, self._memory.messages_owed - 1)

    def forget_message(self) -> None:
        """Take a ``$`` that came before it was known from whom: it ends nothing, and is not owed any more."""
        self._memory.messages_owed = max(0, self._memory.messages_owed - 1)

    def comparator_reached(self, number: int) -> None:
        """Take a comparator's number that was just read."""
        # One that is passed on the ramp of a stop is not of the move that waits for it.
        if self._active is not None and self._active.move.is_on_wire:
            self._active.move.note_comparator(number)

    def line_lost(self, error: ConnectionLostError) -> None:
        """Let whoever watches a move find out at once; one that waits for its trigger will never be sent."""
        if self._active is None:
            return
        move = self._active.move
        if isinstance(move, PreparedMove) and not move.is_on_wire:
            self._withdraw(move, error)
        else:
            self._active.look_now()

    def line_restored(self, signs_of_restart: tuple[str, ...]) -> None:
        """Let a move that is under way find its fate; before the next, settings are said again."""
        self._observer.line.transfer.forget_taken()
        self.restarts += bool(signs_of_restart)
        for pursuit in (self._active, self._stopped):
            if pursuit is not None:
                pursuit.line_restored(signs_of_restart)

    @property
    def is_homing(self) -> bool:
        """Whether a search for machine zero may be under way from here."""
        return self._active is not None and self._active.move.is_on_wire and self._active.move.plan.finds_machine_zero

    async def read_position(self) -> float:
        """Read S1."""
        return await self._observer.line.position()

    async def look_around(self) -> DriveStatus | None:
        """
        Find out whether a motion runs: the ``$`` that ends somebody else's is not one of ours.

        On a line that came back: one that was sent before the answer to this came before it, or is lost.
        """
        try:
            status = await self._observer.read_status(Lane.GREETING)
        except (CommandRejectedError, UnexpectedAnswerError) as error:
            _log.warning("%s does not say how it stands: %s", self.name, error)
            return None
        self._memory.messages_owed = int(status.command_active)
        return status

    async def reconcile(self) -> DriveStatus:
        """Read status and position, and end the doubt; a line that is held goes on by the caller's word."""
        self._observer.line.link.resume()
        mark = self.untracked.mark()
        look = await self._observer.look()
        self._memory.doubt = None
        if not look.status.command_active and not look.status.program_running:
            self.untracked.note_over(mark)
        return look.status

    # Stopping -------------------------------------------------------------------------------------------------------

    def begin_stop(self, reason: MoveError | None = None) -> asyncio.Task[None]:
        """
        Write STOP, now or as soon as the exchange in flight is over; the task ends at standstill.

        Args:
            reason: What the move that is stopped shall raise, if not MoveStoppedError.
        """
        self.stops += 1
        self.untracked.take_back()
        pursuit = self._release()
        if pursuit is not None and reason is None:
            # Whoever stops a move from here knows; it is no news that nobody fetched.
            pursuit.move.add_done_callback(fetch_error)
        if pursuit is not None and not pursuit.move.is_on_wire:
            self._withdraw(pursuit.move, reason or self._reports.withdrawn(pursuit.move))
            pursuit = None
        if self._stopping is None:
            self.untracked.note_over(self.untracked.mark())
            stop = Stop(self._observer)
            self._stopped = pursuit
            self._stopping = self._loop.create_task(self._stop(stop, pursuit, reason), name=f"{self.name}: stop")
            self._stopping.add_done_callback(self._stop_done)
        return self._stopping

    async def _stop(self, stop: Stop, pursuit: Pursuit | None, reason: MoveError | None) -> None:
        try:
            look = await stop.carry_through()
            fault = None if look.status.no_fault else await self._read_fault()
        except CompaxError as error:
            self._memory.doubt = f"a stop failed ({error.what})"
            self.untracked.note()
            if pursuit is not None:
                pursuit.move.fail(self._reports.in_doubt(pursuit.move, "it may still be moving, a stop failed", error))
            raise
        if pursuit is not None:
            move = pursuit.move
            pursuit.conclude_stopped(
                look, None if look.status.no_fault else self._reports.fault(move, look, fault), reason
            )

    async def _read_fault(self) -> DeviceError | None:
        """Read S30 of a drive that stands; which fault it is does not hold up who waits for the stop."""
        with suppress(TimeoutError, ConnectionLostError):
            async with asyncio.timeout(self._observer.line.settings.answer_timeout_s):
                return await self._observer.read_error()
        return None

    async def stop(self) -> None:
        """Stop the drive and return at its standstill."""
        await asyncio.shield(self.begin_stop())

    async def stop_move(self, move: Move) -> None:
        """Stop the drive if *move* runs, or wait for the stop that its cancelling began."""
        if self._is_active(move):
            await self.stop()
        elif self._stopping is not None:
            await asyncio.shield(self._stopping)

    def _stop_done(self, task: asyncio.Task[None]) -> None:
        self._stopping = self._stopped = None
        if not task.cancelled() and (error := task.exception()) is not None:
            _log.error("%s", error)

    # Ending ---------------------------------------------------------------------------------------------------------

    def abandon(self, move: Move) -> None:
        """Deal with a move that its holder has cancelled."""
        if not self._is_active(move):
            return
        if move.is_on_wire and move.on_cancel == "stop":
            self.begin_stop()
        else:
            self._release()

    async def end(self) -> None:
        """Stop what was started here, unless it was to go on; raises what a stop raises."""
        move = self._active.move if self._active is not None else None
        self.untracked.take_back()
        if move is not None:
            move.add_done_callback(fetch_error)
        if move is not None and not move.is_on_wire:
            self._withdraw(move, self._reports.withdrawn(move))
            move = None
        if move is not None and move.on_cancel == "detach":
            self._withdraw(move, self._reports.unwatched(move))
        elif (hold := self._observer.line.link.held) is not None:
            # Nobody has asked for a stop, and its bytes could complete a motion that never began.
            raise MoveInDoubtError(
                f"the line was closed without a stop, for {hold.why}", device=self.name, hint=hold.remedy
            )
        elif move is not None or self.untracked.may_move:
            self.begin_stop()
        if self._stopping is not None:
            await asyncio.shield(self._stopping)

    def _is_active(self, move: Move) -> bool:
        return self._active is not None and self._active.move is move

    def _move_done(self, move: Move) -> None:
        if self._is_active(move):
            self._release()

    def _withdraw(self, move: Move, error: CompaxError) -> None:
        """End *move* from here; if its motion is not yet on the wire, it never will be."""
        if self._is_active(move):
            self._release()
        move.fail(error)

    def _release(self) -> Pursuit | None:
        """Let go of the active move: nobody watches it from now on."""
        pursuit, self._active = self._active, None
        task, self._task = self._task, None
        if task is not None and task is not asyncio.current_task():
            task.cancel()
        return pursuit
