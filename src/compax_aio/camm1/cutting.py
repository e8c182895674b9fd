"""One job on its way: its handshake established, its bursts written as there is room, its end proved or told."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Final

from ..errors import (
    AnswerTimeoutError,
    CompaxError,
    ConnectionLostError,
    DriveFaultError,
    InvalidCommandError,
    MoveInDoubtError,
    MoveStoppedError,
    MoveTimeoutError,
)
from ..link.cancellation import despite_cancellation
from ..link.contract import TurnOver
from ..motion.events import DriveEvent, MoveOutcome
from ..severity import Severity
from .aborting import Aborting
from .checking import Checker, Problem, Sheet, raise_for_errors
from .cut import AnyHandshake, Cut, CutAccount, CutProgress, CutResult, CutState, OnCancel
from .events import CutBegun, CutEnded
from .feed import Feed, Source
from .finishing import Finishing
from .language.instruction import Instruction
from .language.job import tokeniser_for
from .ledger import CutLedger
from .line import CutterLine
from .pacing import Handshake, Pacing, pacing_of
from .protocol import Burst
from .protocol_events import BurstOver
from .reports import CutReports, with_account
from .watching import MachineWatch
from .words import handshake_words

__all__ = ["Cutting", "Order"]

_log = logging.getLogger("compax_aio.camm1")

_BURST_S: Final = 1.0
"""Other questions wait for no more of a job than what goes out in that time …"""
_LEAST_BURST_BYTES: Final = 512
_MOST_BURST_BYTES: Final = 4096
_WATCH_S: Final = 0.5
"""A burst under way is looked at so often."""
_MOST_WARNINGS: Final = 20

_OUTCOMES: Final[tuple[tuple[type[BaseException], MoveOutcome], ...]] = (
    (MoveStoppedError, "stopped"),
    (DriveFaultError, "fault"),
    (MoveTimeoutError, "out of time"),
    (MoveInDoubtError, "in doubt"),
    (InvalidCommandError, "refused"),
)


class _AbortAskedError(Exception):
    """The job shall not go on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """What a caller wants: a job, and how it is to be cut."""

    source: Source
    description: str
    handshake: AnyHandshake
    check: bool
    sheet: Sheet | None
    on_cancel: OnCancel


class Cutting:
    """
    Carries out one order.

    Args:
        line: Of the cutter.
        order: What is wanted.
        publish: Is told what happens.
        on_doubt: Is told why nobody knows what was cut.
        after: What must be over before.

    Attributes:
        cut: What the caller holds.
        task: Ends when the machine is left alone.
        is_under_way: Whether something of the job is sent, or will be.
    """

    def __init__(
        self,
        line: CutterLine,
        order: Order,
        *,
        publish: Callable[[DriveEvent], None],
        on_doubt: Callable[[str], None],
        after: Awaitable[object] | None,
    ) -> None:
        self.cut = Cut(self, order.description, order.on_cancel)
        self._line = line
        self._order = order
        self._publish = publish
        self._on_doubt = on_doubt
        self._after = after
        self._loop = asyncio.get_running_loop()
        self._reports = CutReports(line)
        self._ledger = CutLedger()
        self._ledger.total_bytes = order.source.total_bytes
        self._state: CutState = "starting"
        self._watch = MachineWatch(
            line,
            self._reports,
            account=self.account,
            publish=publish,
            set_state=self._set_state,
            check=self._check,
        )
        self._may_send = asyncio.Event()
        self._may_send.set()
        self._is_between_bursts = asyncio.Event()
        self._is_between_bursts.set()
        self._pacing: Pacing | None = None
        self._burst: Burst | None = None
        self._began_at = self._watched_at = self._loop.time()
        self._resets_before = line.resets_seen
        self._unread_before = 0
        self._is_begun = False
        self._loss: ConnectionLostError | None = None
        self._why_aborted: str | None = None
        self._aborting: Aborting | None = None
        self._stop_error: CompaxError | None = None
        self.is_under_way = True
        self.task = self._loop.create_task(self._run(), name=f"{line.name}: {order.description}")

    # What the caller's future asks ----------------------------------------------------------------------------------

    def account(self) -> CutAccount:
        """Say what is known of the job."""
        if self._pacing is not None:
            self._ledger.note_taken(self._pacing.taken_bytes)
        return self._ledger.account()

    def snapshot(self) -> CutProgress:
        """Say how far it is."""
        ledger = self._ledger
        return CutProgress(
            state=self._state,
            bytes_sent=ledger.job_bytes,
            bytes_total=ledger.total_bytes,
            instructions_sent=ledger.instructions_sent,
            instructions_total=ledger.total_instructions,
            position_steps=ledger.position_steps,
            free_bytes=None if self._pacing is None else self._pacing.free_bytes,
            elapsed_s=self._loop.time() - self._began_at,
        )

    def abandon(self) -> None:
        """Deal with a job that was cancelled."""
        if self._order.on_cancel == "abort":
            self.request_abort("cancelled")

    async def pause(self) -> None:
        """Send no more; return when no instruction is half sent."""
        if not self.is_under_way:
            return
        self._may_send.clear()
        if self._burst is not None:
            self._burst.is_given_up = True
        await self._is_between_bursts.wait()

    def resume(self) -> None:
        """Go on sending."""
        self._may_send.set()
        self._watch.restart()

    async def abort(self) -> None:
        """Stop it, and return when the machine can be used."""
        self.request_abort("aborted")
        await asyncio.wait([self.task])
        if self._stop_error is not None:
            raise self._stop_error

    async def end(self) -> None:
        """
        End it because its cutter is closed: abort it, or have it cut to its end if that is what it was made for.

        Raises:
            CompaxError: The machine may not have stopped.
        """
        is_told = self.cut.done() and not self.cut.cancelled()
        if self._order.on_cancel == "abort":
            self.request_abort("aborted, for its cutter was closed")
        self._may_send.set()
        await asyncio.wait([self.task])
        if self._stop_error is not None and not is_told:
            raise self._stop_error

    def note_lost(self, error: ConnectionLostError) -> None:
        """Take note that the line was lost: what is in the machine may be cut, and the rest is not sent."""
        if self._is_begun and self.is_under_way and self._loss is None:
            self._loss = error
            self._watch.wake.set()
            self._may_send.set()

    def note_reset(self) -> None:
        """Take note that the machine was seen to have been reset."""
        self._watch.wake.set()
        self._may_send.set()

    def request_abort(self, why: str) -> None:
        """Stop it: ``.K`` is written before this returns, if anything of the job may be in the machine."""
        if not self.is_under_way or self._why_aborted is not None:
            return
        self._why_aborted = why
        if self._burst is not None:
            self._burst.is_given_up = True
        if self._is_begun:
            self._set_state("aborting")
            self._aborting = Aborting(self._line)
            self._line.protocol.pacing = None
        self._may_send.set()
        self._watch.wake.set()

    # The job --------------------------------------------------------------------------------------------------------

    async def _run(self) -> None:
        failure: BaseException | None = None
        result: CutResult | None = None
        try:
            result = await self._carry_out()
        except _AbortAskedError:
            pass
        except asyncio.CancelledError:
            self._why_aborted = self._why_aborted or "cut short by the end of the program"
        except Exception as error:  # of whoever gives the job piece by piece, too: the machine must not go on
            failure = error
        await despite_cancellation(self._end(result, failure))

    async def _carry_out(self) -> CutResult:
        if self._after is not None:
            await self._after
        self._check()
        self._began_at = self._loop.time()
        await self._begin()
        assert self._pacing is not None
        await self._send_all()
        self._set_state("finishing")
        ledger = self._ledger
        await self._send(self._tail())
        finishing = Finishing(self._line, self._watch, self._reports, is_mode_1=ledger.ends_in_mode_1)
        proof = await finishing.prove(self.account())
        if self._line.unread_errors != self._unread_before:
            why = "an answer to ESC.E was lost, and with it an error perhaps, for reading clears it"
            raise self._reports.unproved(why, self.account())
        ledger.note_all_taken()
        return CutResult(
            cutter=self._line.name,
            bytes=ledger.job_bytes,
            instructions=ledger.instructions_sent,
            handshake=self._pacing.handshake,
            handshake_because=self._because,
            proved_by=proof,
            duration_s=self._loop.time() - self._began_at,
            warnings=tuple(self._watch.warnings),
        )

    async def _begin(self) -> None:
        """Look whether the machine is free, check the job, and establish the handshake."""
        status = await self._watch.until_not_held()
        if not status.buffer_is_empty and not (await self._watch.status()).buffer_is_empty:  # one look may be damaged
            raise self._reports.not_empty(self._order.description)
        capacity = await self._watch.free_space()
        self._watch.capacity_bytes = capacity
        handshake, self._because = self._choose()
        self._pacing = pacing = pacing_of(handshake, self._line.room_of(capacity))
        profile = self._line.profile
        words = handshake_words(pacing, profile)
        await self._examine(capacity)
        self._resets_before = self._line.resets_seen
        self._line.on_status = self._watch.note_status
        self._note_earlier_errors(await self._watch.ask(self._line.errors))
        await self._watch.ask(lambda: self._line.tell(words, what=f"the handshake {handshake!r}"))
        self._line.protocol.pacing = pacing
        self._unread_before = self._line.unread_errors
        self._publish(CutBegun(self._line.name, self._loop.time(), self._order.description, handshake))

    def _choose(self) -> tuple[Handshake, str]:
        if self._order.handshake != "auto":
            return self._order.handshake, "it was asked for"
        return "software", "the cutter answers, and says how much room there is (ESC.B)"

    def _note_earlier_errors(self, codes: tuple[int, ...]) -> None:
        for code in codes:
            self._watch.warnings.append(f"error {code} of the line was told before the job began, and is cleared")

    async def _examine(self, capacity: int) -> None:
        """
        Look through a job that is at hand as a whole, before anything of it is sent.

        Raises:
            InvalidCommandError: It has errors, or an instruction that gets through no buffer of that size.
        """
        if not self._order.source.is_whole:
            return
        problems: list[Problem] = []
        checker = Checker(self._line.profile, self._order.sheet, buffer_bytes=capacity) if self._order.check else None

        def examine(instruction: Instruction) -> None:
            if checker is not None:
                problems.extend(checker.take(instruction))

        feed = self._feed_of(examine)
        count = 0
        try:
            while taken := await feed.take(_MOST_BURST_BYTES):
                count += len(taken)
                await asyncio.sleep(0)  # a long job takes its time: others have theirs
                self._check()
        finally:
            await feed.close()
        if checker is not None:
            problems += checker.finish()
        raise_for_errors(problems)
        warned = [str(each) for each in problems if each.severity is Severity.WARNING]
        self._watch.warnings += warned[:_MOST_WARNINGS]
        self._ledger.total_bytes = self._order.source.total_bytes
        self._ledger.total_instructions = count

    def _feed_of(self, examine: Callable[[Instruction], None]) -> Feed:
        pacing = self._pacing
        assert pacing is not None
        return Feed(self._order.source, self._line.profile, pacing.longest_bytes, pacing.most_bytes, examine)

    def _examine_on_its_way(self) -> Callable[[Instruction], None]:
        """Return what looks at the instructions of a job that comes piece by piece."""
        if self._order.source.is_whole or not self._order.check:
            return lambda _: None
        checker = Checker(self._line.profile, self._order.sheet, buffer_bytes=self._watch.capacity_bytes)
        return lambda instruction: raise_for_errors(checker.take(instruction))

    # Sending --------------------------------------------------------------------------------------------------------

    @property
    def _burst_bytes(self) -> int:
        rate = self._line.link.bytes_per_s or _LEAST_BURST_BYTES
        return max(_LEAST_BURST_BYTES, min(int(rate * _BURST_S), _MOST_BURST_BYTES))

    async def _send_all(self) -> None:
        feed = self._feed_of(self._examine_on_its_way())
        size = self._burst_bytes
        self._watch.restart()
        self._watched_at = self._loop.time()
        try:
            while taken := await self._unless_aborted(feed.take(size)):
                await self._send(taken)
                if self._loop.time() - self._watched_at >= self._line.settings.watch_s:
                    self._watched_at = self._loop.time()
                    await self._watch.look_for_errors()
                    self._note_free(await self._watch.free_space())
        finally:
            await feed.close()
        self._ledger.note_all_sent()
        if feed.left_out:
            self._watch.warnings.append(
                f"left out: {feed.left_out} instructions with device control, or that have the cutter answer"
            )

    async def _unless_aborted(self, taking: Awaitable[list[Instruction]]) -> list[Instruction]:
        """Wait for more of the job, but not when it shall not go on."""
        task = asyncio.ensure_future(taking)
        try:
            while not task.done():
                self._watch.wake.clear()
                self._check()
                waking = self._loop.create_task(self._watch.wake.wait())
                try:
                    await asyncio.wait([task, waking], return_when=asyncio.FIRST_COMPLETED)
                finally:
                    waking.cancel()
            self._check()
            return task.result()
        finally:
            task.cancel()

    def _tail(self) -> list[Instruction]:
        """Return what lifts the tool behind the job, whatever stands at its end."""
        text = b";^PU;" if self._ledger.ends_in_mode_1 else b";PU;"
        return tokeniser_for(self._line.profile).feed(text)

    async def _send(self, instructions: list[Instruction]) -> None:
        """Write instructions as there is room, until all are written."""
        is_job = self._state != "finishing"
        while instructions:
            await self._until_not_paused()
            if is_job:
                self._set_state("cutting")
            written, is_full = await self._send_burst(instructions, is_job=is_job)
            instructions = instructions[written:]
            self._note_progress()
            self._check()
            if is_full is None:
                await self._watch.status()  # the line gets in step, or what has become of it is told
            elif is_full:
                self._set_state("buffer full" if is_job else "finishing")
                await self._watch.wait_for_room()
            elif is_job:
                assert self._pacing is not None
                await self._watch.look(self._pacing.free_bytes if self._pacing.tells_free_space else None)

    async def _send_burst(self, instructions: list[Instruction], *, is_job: bool) -> tuple[int, bool | None]:
        """Write one burst; return how many instructions were written, and whether the buffer is full; None: unknown."""
        first, last = instructions[0], instructions[-1]
        which = f"bytes {first.offset}-{last.offset + len(last.data) - 1}" if is_job else "end"
        label = f"{which} of {self._order.description}"
        self._burst = burst = Burst(label, [each.data for each in instructions])
        self._is_begun = True
        loss: ConnectionLostError | None = None
        self._is_between_bursts.clear()
        try:
            outcome = await self._watched(burst)
        except AnswerTimeoutError:
            return burst.written, None
        except ConnectionLostError as error:
            loss = error
        finally:
            if is_job:
                self._ledger.note_sent(instructions[: burst.written])
            self._burst = None
            self._is_between_bursts.set()
        if loss is not None:
            self._check()
            raise self._reports.lost(loss, self.account()) from loss
        return burst.written, outcome.is_full if isinstance(outcome, BurstOver) else None

    async def _watched(self, burst: Burst) -> TurnOver:
        """Await the end of a burst; one that cannot leave, because the cable holds the line, is told."""
        sending = asyncio.ensure_future(self._line.send_burst(burst))
        held_since = self._loop.time()
        seen = (0, 0)
        while not sending.done():
            await asyncio.wait([sending], timeout=_WATCH_S)
            now = (burst.written, self._line.link.unsent_bytes)
            if now != seen or self._why_aborted is not None:
                seen, held_since = now, self._loop.time()
            elif now[1] and not sending.done():
                self._set_state("line held")
                if self._loop.time() - held_since >= self._line.settings.held_timeout_s:
                    burst.is_given_up = True
                    await asyncio.wait([sending], timeout=_WATCH_S)
                    seconds = self._loop.time() - held_since
                    raise self._reports.stalled(seconds, self.account(), is_held=True)
        return sending.result()

    async def _until_not_paused(self) -> None:
        while not self._may_send.is_set():
            self._set_state("paused")
            await self._may_send.wait()
            self._check()
        self._check()

    def _note_free(self, free_bytes: int) -> None:
        if self._pacing is not None:
            self._pacing.told(free_bytes)
            self._note_progress()

    def _note_progress(self) -> None:
        pacing = self._pacing
        assert pacing is not None
        self._watch.note((pacing.written_bytes, pacing.taken_bytes))
        self.cut.note_change()

    def _set_state(self, state: CutState) -> None:
        if self._state not in {state, "aborting"}:
            self._state = state
            self.cut.note_change()

    def _check(self) -> None:
        """Raise if the job shall not go on."""
        if self._why_aborted is not None:
            raise _AbortAskedError
        if self._loss is not None:
            raise self._reports.lost(self._loss, self.account()) from self._loss
        if self._is_begun and self._line.resets_seen != self._resets_before:
            raise self._reports.forgotten(self.account())

    # The end --------------------------------------------------------------------------------------------------------

    async def _end(self, result: CutResult | None, failure: BaseException | None) -> None:
        if result is None and self._is_begun and not isinstance(failure, MoveInDoubtError):
            await self._stop_machine()
        error = self._final_error(failure) if result is None else None
        self._state = "over"
        self.is_under_way = False
        self._line.protocol.pacing = None
        self._line.on_status = lambda _: None
        await self._order.source.close()
        if self._stop_error is not None or isinstance(error, MoveInDoubtError):
            self._on_doubt(getattr(error, "what", str(error)))
        self._tell(result, error)
        if result is not None:
            self.cut.finish(result)
        elif error is not None:
            self.cut.fail(error)

    async def _stop_machine(self) -> None:
        self._set_state("aborting")
        self._line.protocol.pacing = None
        aborting = self._aborting or Aborting(self._line)
        try:
            await aborting.carry_through(lifts_with_call=self._ledger.ends_in_mode_1)
        except CompaxError as error:
            self._stop_error = error
            _log.warning("%s: the abort of %s was not confirmed: %s", self._line.name, self._order.description, error)

    def _final_error(self, failure: BaseException | None) -> BaseException:
        account = self.account()
        if failure is None:
            why = self._why_aborted or "aborted"
            if self._stop_error is not None:
                return self._reports.not_stopped(why, self._stop_error, account)
            return self._reports.aborted(why, account)
        if self._is_begun and not hasattr(failure, "job"):
            with_account(failure, account)
        if self._stop_error is not None:
            failure.add_note(f"the abort that followed was not confirmed: {self._stop_error}")
        return failure

    def _tell(self, result: CutResult | None, error: BaseException | None) -> None:
        outcome: MoveOutcome = "reached"
        if self.cut.cancelled():
            outcome = "cancelled" if result is None else "reached"
        elif result is None:
            outcome = next((each for kind, each in _OUTCOMES if isinstance(error, kind)), "failed")
        told = error if isinstance(error, CompaxError) and not self.cut.cancelled() else None
        if self._is_begun:
            description = self._order.description
            self._publish(CutEnded(self._line.name, self._loop.time(), description, outcome, self.account(), told))
