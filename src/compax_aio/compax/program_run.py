"""A drive's program at work: started at most once, stopped, broken off, waited for."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from typing import Final

from ..checked_numbers import check_number
from ..errors import (
    AnswerTimeoutError,
    CompaxError,
    ConnectionLostError,
    DriveFaultError,
    InvalidCommandError,
    MoveActiveError,
    MoveError,
    MoveInDoubtError,
    MoveStoppedError,
    MoveTimeoutError,
    UnexpectedAnswerError,
)
from ..escaping import shown
from ..link.contract import Lane
from .codecs import DriveStatus
from .facts.program_commands import RECORD_NUMBERS
from .motion import Motion
from .observer import Observer
from .plain_line import as_index, check_line

__all__ = ["ProgramRun", "check_record_number"]

_POLL_GROWTH: Final = 1.5


def check_record_number(number: object) -> int:
    """
    Return *number* if a record has it.

    Raises:
        InvalidCommandError: Records are 1 to 250 (UG p. 95).
    """
    index = as_index(number)
    if index is None or index not in RECORD_NUMBERS:
        raise InvalidCommandError(f"there is no record {shown(number)}", hint="records are 1 to 250 (UG p. 95)")
    return index


class ProgramRun:
    """
    Runs what stands in the program memory; :class:`~compax_aio.compax.program_memory.ProgramMemory` has its methods.

    A program counts as motion, whatever its records do: leaving the block stops it.

    Args:
        observer: Of the drive.
        motion: Of the same drive.
    """

    def __init__(self, observer: Observer, motion: Motion) -> None:
        self._observer = observer
        self._line = observer.line
        self._motion = motion
        self._showed_stop = False

    async def start(self, record: int | None = None) -> None:
        """
        Start the program (``START``, UG p. 101), and return when the drive has accepted it; it is sent once.

        Without *record* it begins where the record pointer stands (CAN p. 69), continues what STOP has stopped, a
        move included, or goes on behind a ``WAIT START``. With *record*, what STOP has stopped is broken off first, and
        the pointer set; the word for that is ``Dialect.set_pointer``, which is inferred.

        With an empty memory let N001 be ``END``, so that START has a defined effect (UG p. 162).

        Args:
            record: 1-250.

        Raises:
            InvalidCommandError: There is no such record; nothing was sent.
            MoveActiveError: A move or a program runs; START was not sent.
            DriveFaultError: The drive reports a fault; START was not sent.
            CommandRejectedError: The drive refused it.
            AnswerTimeoutError: No answer came, and the status shows no program running.
            MoveStoppedError: A stop came before START was sent.
            MoveInDoubtError: What became of the last move is unknown, and START was not sent; or nobody can say whether
                it was accepted.
        """
        dialect = self._line.settings.dialect
        if record is not None:
            record = check_record_number(record)
        stops = self._motion.stops
        before = await self._look_before(dialect.start, goes_on=record is None)
        if record is not None:
            if before.idle_after_stop:
                await self._line.command(dialect.break_off)  # START would continue what was stopped
            await self._line.command(check_line(dialect.set_pointer.format(n=record)))
        await self._set_going(dialect.start, before, stops)

    async def run_record(self, record: int) -> None:
        """
        Run one record alone (CAN p. 69), as :meth:`start` does; how it ends says :meth:`wait_finished`.

        Args:
            record: 1-250.

        Raises:
            InvalidCommandError: There is no such record, or the dialect has no word for it; nothing was sent.
        """
        word = self._line.settings.dialect.single_record
        record = check_record_number(record)
        if word is None:
            raise InvalidCommandError(
                "the word that runs a single record stands on no page that was available",
                device=self._line.name,
                hint="give it as Dialect(single_record=…) in the drive's settings, with {n} for the record",
            )
        text, stops = check_line(word.format(n=record)), self._motion.stops
        await self._set_going(text, await self._look_before(text, goes_on=False), stops)

    def let_go_on(self) -> None:
        """
        Let what was started here and is not watched go on, a program above all, when the block is left.

        Nothing here stops it any more but a stop that somebody asks for. Does nothing for a move: that has
        ``on_cancel="detach"``.
        """
        self._motion.untracked.note_over(self._motion.untracked.mark())

    async def stop(self) -> None:
        """
        Stop program and axis as :meth:`Drive.stop` does, ahead of everything; :meth:`start` continues them.

        Raises:
            AnswerTimeoutError, CommandRejectedError, ConnectionLostError: STOP was not acknowledged; the axis may move.
            MoveTimeoutError: It was acknowledged, and a command or the program is still active: an ``IF STOP`` in the
                program may have taken it over (CAN p. 59); see :meth:`break_off`.
        """
        await self._motion.stop()
        await self._until_quiet(self._line.settings.dialect.stop)

    async def break_off(self) -> None:
        """
        Stop program and axis, then end them for good (``Dialect.break_off``, CAN p. 32): START begins anew.

        Raises:
            AnswerTimeoutError, CommandRejectedError, ConnectionLostError: One of both was not acknowledged.
            MoveTimeoutError: Both were acknowledged, and a command or the program is still active.
        """
        with suppress(MoveTimeoutError):  # the handler of an IF STOP may move: that is to be ended, too
            await self._motion.stop()
        break_off = self._line.settings.dialect.break_off
        await self._line.command(break_off)
        await self._until_quiet(break_off)

    async def running(self) -> bool:
        """Read whether the program runs (S17 bit 4, UG p. 209); also while it waits, not after STOP."""
        return (await self._observer.read_status(Lane.READ)).program_running

    async def wait_finished(self, timeout_s: float | None = None) -> None:
        """
        Return when no program runs any more, and the axis stands.

        The status is asked ever more rarely. A program may run for ever, and then this waits for ever; but not longer
        than ``in_doubt_after_s`` for a drive that does not answer.

        Args:
            timeout_s: How long to wait; the program itself is not stopped when that is over.

        Raises:
            DriveFaultError: The drive reports a fault.
            MoveStoppedError: The program was stopped (S16 bit 6, S17 bit 5), from here or by somebody else.
            MoveTimeoutError: It runs longer than *timeout_s*.
            MoveInDoubtError: It does not run any more, but a stop was shown before it ended: it may have been stopped;
                or the drive seems to have been switched off and on.
            AnswerTimeoutError, ConnectionLostError: The drive does not say how it stands; the program may run.
        """
        if timeout_s is not None and not check_number("timeout_s", timeout_s) > 0:
            raise InvalidCommandError(f"timeout_s must be above 0, not {timeout_s!r}")
        loop, mark = asyncio.get_running_loop(), self._motion.untracked.mark()
        give_up_at = None if timeout_s is None else loop.time() + timeout_s
        restarts = self._motion.restarts
        showed_stop, interval_s = self._showed_stop, self._line.settings.poll_first_s
        while _is_at_work(status := await self._observer.patiently(self._observer.read_status)):
            await self._refuse_fault(status, "a fault has come while the program runs")
            showed_stop = status.shows_stop
            pause_s = interval_s if give_up_at is None else min(interval_s, give_up_at - loop.time())
            if pause_s <= 0:
                raise MoveTimeoutError(
                    f"the program still runs after {timeout_s:g} s",
                    device=self._line.name,
                    received=status.as_sent,
                    hint="wait longer, or stop() it",
                )
            await asyncio.sleep(pause_s)
            interval_s = min(interval_s * _POLL_GROWTH, self._line.settings.poll_slowest_s)
        self._motion.untracked.note_over(mark)
        await self._refuse_fault(status, "a fault ended the program")
        if self._motion.restarts != restarts:
            raise self._doubt(
                "the drive seems to have been switched off and on: nobody can say how the program ended", None
            )
        if status.shows_stop:
            raise self._ended_by_stop(status, showed_before=showed_stop)

    # Before ---------------------------------------------------------------------------------------------------------

    async def _refuse_while_busy(self, what: str) -> None:
        """Raise MoveActiveError while a program runs or the axis moves; whether drives take records then is unknown."""
        self._motion.refuse_second(what)
        status = await self._observer.read_status()
        if status.program_running or status.command_active:
            raise self._busy(what, status)

    async def _look_before(self, text: str, *, goes_on: bool) -> DriveStatus:
        """Return the status if START may be sent: *goes_on* if a program may be waiting for it."""
        self._motion.refuse_second(repr(text))
        status = await self._observer.read_status(Lane.MOTION)
        await self._refuse_fault(status, f"{text!r} was not sent, for the drive reports a fault")
        is_waiting = goes_on and status.ready_for_start
        if (status.program_running and not is_waiting) or (status.command_active and not status.shows_stop):
            raise self._busy(repr(text), status)
        self._showed_stop = status.shows_stop
        return status

    def _busy(self, what: str, status: DriveStatus) -> MoveActiveError:
        return MoveActiveError(
            f"{'a program runs' if status.program_running else 'the axis moves'}, so {what} was not sent",
            device=self._line.name,
            received=status.as_sent,
            hint="wait_finished(), or break_off() what runs",
        )

    async def _refuse_fault(self, status: DriveStatus, what: str) -> None:
        if status.no_fault:
            return
        error = await self._observer.read_error()
        raise DriveFaultError(
            f"{what}: {f'E{error.code}, {error.meaning}' if error else 'the drive does not say which'}",
            device=self._line.name,
            received=status.as_sent,
            hint=error.remedy if error else "read error_history(), mend the cause, then quit()",
            code=error.code if error else None,
            exchanges=self._line.link.recent(),
        )

    # Afterwards -----------------------------------------------------------------------------------------------------

    async def _set_going(self, text: str, before: DriveStatus, stops: int) -> None:
        """Send what starts a program, once; where the answer proves nothing, the status decides."""
        try:
            await self._motion.tell(text, unless_stopped_since=stops)
        except (AnswerTimeoutError, ConnectionLostError, UnexpectedAnswerError) as error:
            if self._line.link.is_over:
                raise
            if not await self._has_begun(before, error):
                error.hint = (
                    "the status shows no program running: it was not taken, or what it started is over already; "
                    "look at the machine before you start it again"
                )
                raise
            return
        if not self._line.transfer.tells_errors and not await self._has_begun(before, None):
            raise self._doubt(
                f"{text!r} got a prompt, which proves nothing on a drive that keeps quiet about errors (P20), and no "
                "program is running",
                None,
            )

    async def _has_begun(self, before: DriveStatus, cause: CompaxError | None) -> bool:
        try:
            status = await self._observer.patiently(self._observer.read_status)
        except CompaxError as error:
            if self._line.link.is_over:
                raise
            self._motion.note_doubt("nobody can say whether its program runs")
            raise self._doubt("the drive does not say whether its program runs", cause or error) from error
        waits_as_before = before.program_running and status.ready_for_start
        return (status.program_running and not waits_as_before) or (status.command_active and not status.shows_stop)

    async def _until_quiet(self, sent: str) -> None:
        loop = asyncio.get_running_loop()
        give_up_at = loop.time() + self._line.settings.standstill_timeout_s
        while _is_at_work(status := await self._observer.patiently(self._observer.read_status)):
            if loop.time() >= give_up_at:
                self._motion.untracked.note()  # leaving the block tries again
                raise MoveTimeoutError(
                    f"{sent} was acknowledged, but {self._line.settings.standstill_timeout_s:g} s later "
                    f"{'the program runs' if status.program_running else 'a command is active'}",
                    device=self._line.name,
                    sent=sent,
                    received=status.as_sent,
                    hint="an IF STOP in the program may have taken over (CAN p. 59): break_off() it, or use the "
                    "emergency stop",
                )
            await asyncio.sleep(self._line.settings.poll_first_s)

    def _ended_by_stop(self, status: DriveStatus, *, showed_before: bool) -> MoveError:
        if showed_before:
            return self._doubt(
                f"the program ended, and whether by a stop cannot be told (S16 {status.s16}): the status has shown one "
                "since before",
                None,
            )
        by = "by input I6" if status.stopped_by_input else "before its end"
        return MoveStoppedError(
            f"the program was stopped {by}",
            device=self._line.name,
            received=status.as_sent,
            hint="start() continues it, break_off() ends it for good",
        )

    def _doubt(self, what: str, cause: CompaxError | None) -> MoveInDoubtError:
        error = MoveInDoubtError(
            what,
            device=self._line.name,
            sent=cause.sent if cause else None,
            received=cause.received if cause else None,
            hint="look at the machine, then call reconcile()",
            exchanges=self._line.link.recent(),
        )
        error.__cause__ = cause
        return error


def _is_at_work(status: DriveStatus) -> bool:
    return status.program_running or (status.command_active and not status.shows_stop)
