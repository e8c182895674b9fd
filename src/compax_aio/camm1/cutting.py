"""One job on its way: its handshake established, its bursts written as there is room, its end proved or told."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable, Coroutine
from dataclasses import dataclass
from typing import Any, Final

from ..errors import (
    CompaxError,
    ConnectionLostError,
    DriveFaultError,
    InvalidCommandError,
    MoveInDoubtError,
    MoveStoppedError,
    MoveTimeoutError,
)
from ..link.cancellation import despite_cancellation
from ..motion.events import DriveEvent, MoveOutcome
from .aborting import Aborting
from .checking import Checker, Sheet
from .cut import AnyHandshake, Cut, CutAccount, CutProgress, CutResult, CutState, OnCancel
from .events import CutBegun, CutEnded
from .examining import examine, examiner
from .feed import Feed, Source
from .finishing import Finishing
from .handshakes import pacing_of
from .language.instruction import Instruction
from .language.job import tokeniser_for
from .ledger import CutLedger
from .line import CutterLine
from .pacing import Handshake, Pacing
from .reports import CutReports, with_account
from .sending import Sending, burst_bytes
from .watching import MachineWatch
from .words import handshake_words

__all__ = ["Cutting", "Order"]

_log = logging.getLogger("compax_aio.camm1")

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
        self._pacing: Pacing | None = None
        self._sending: Sending | None = None
        self._wants_pause = False
        self._began_at = self._loop.time()
        self._resets_before = line.resets_seen
        self._unread_before = 0
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
        self._wants_pause = self.is_under_way
        if self.is_under_way and self._sending is not None:
            await self._sending.pause()

    def resume(self) -> None:
        """Go on sending."""
        self._wants_pause = False
        if self._sending is not None:
            self._sending.resume()

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
        self.resume()
        await asyncio.wait([self.task])
        if self._stop_error is not None and not is_told:
            raise self._stop_error

    def note_lost(self, error: ConnectionLostError) -> None:
        """Take note that the line was lost: what is in the machine may be cut, and the rest is not sent."""
        if self._is_begun and self.is_under_way and self._loss is None:
            self._loss = error
            self._wake()

    def note_reset(self) -> None:
        """Take note that the machine was seen to have been reset."""
        self._wake()

    def _wake(self) -> None:
        """Have whoever waits find out that the job shall not go on."""
        self._watch.wake.set()
        self.resume()

    @property
    def _is_begun(self) -> bool:
        """Whether something of the job may be in the machine."""
        return self._sending is not None and self._sending.is_begun

    def request_abort(self, why: str) -> None:
        """Stop it: ``.K`` is written before this returns, if anything of the job may be in the machine."""
        if not self.is_under_way or self._why_aborted is not None:
            return
        self._why_aborted = why
        if self._sending is not None:
            self._sending.give_up_burst()
        if self._is_begun:
            self._set_state("aborting")
            self._aborting = Aborting(self._line)
            self._line.protocol.pacing = None
        self._wake()

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
        pacing, sending = await self._begin()
        await self._send_all(sending)
        self._set_state("finishing")
        ledger = self._ledger
        await sending.send(self._tail(), is_tail=True)
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
            handshake=pacing.handshake,
            handshake_because=self._because,
            proved_by=proof,
            duration_s=self._loop.time() - self._began_at,
            warnings=tuple(self._watch.warnings),
        )

    async def _begin(self) -> tuple[Pacing, Sending]:
        """Look whether the machine is free, check the job, and establish the handshake."""
        status = await self._watch.until_not_held()
        if not status.buffer_is_empty and not (await self._watch.status()).buffer_is_empty:  # one look may be damaged
            raise self._reports.not_empty(self._order.description)
        capacity = await self._watch.free_space()
        self._watch.capacity_bytes = capacity
        handshake, self._because = self._choose()
        self._pacing = pacing = pacing_of(handshake, self._line.room_of(capacity), self._line.free_space_query)
        profile = self._line.profile
        words = handshake_words(pacing, profile)
        await self._examine(capacity)
        self._resets_before = self._line.resets_seen
        self._line.on_status = self._watch.note_status
        self._note_earlier_errors(await self._watch.ask(self._line.errors))
        await self._watch.ask(lambda: self._line.tell(words, what=f"the handshake {handshake!r}"))
        self._line.protocol.pacing = pacing
        self._unread_before = self._line.unread_errors
        self._sending = sending = Sending(self._order.description, self._line, pacing, self._watch, self._ledger)
        if self._wants_pause:
            await sending.pause()
        self._publish(CutBegun(self._line.name, self._loop.time(), self._order.description, handshake))
        return pacing, sending

    def _choose(self) -> tuple[Handshake, str]:
        if self._order.handshake != "auto":
            return self._order.handshake, "it was asked for"
        return "software", "the cutter answers, and says how much room there is (ESC.B)"

    def _note_earlier_errors(self, codes: tuple[int, ...]) -> None:
        for code in codes:
            self._watch.warnings.append(f"error {code} of the line was told before the job began, and is cleared")

    def _checker(self, capacity_bytes: int) -> Checker | None:
        if not self._order.check:
            return None
        return Checker(self._line.profile, self._order.sheet, buffer_bytes=capacity_bytes)

    async def _examine(self, capacity_bytes: int) -> None:
        source = self._order.source
        if source.is_whole:
            examined = await examine(self._feed, self._checker(capacity_bytes), self._check)
            self._watch.warnings += examined.warnings
            self._ledger.total_bytes = source.total_bytes
            self._ledger.total_instructions = examined.instructions

    def _feed(self, look: Callable[[Instruction], None]) -> Feed:
        assert self._pacing is not None
        return Feed(self._order.source, self._line.profile, self._pacing.longest_bytes, self._pacing.most_bytes, look)

    async def _send_all(self, sending: Sending) -> None:
        is_examined = self._order.source.is_whole
        feed = self._feed(examiner(None if is_examined else self._checker(self._watch.capacity_bytes)))
        size = burst_bytes(self._line.link.bytes_per_s)
        self._watch.restart()
        looked_at = self._loop.time()
        try:
            while taken := await self._unless_aborted(feed.take(size)):
                await sending.send(taken)
                self.cut.note_change()
                if self._loop.time() - looked_at >= self._line.settings.watch_s:
                    looked_at = self._loop.time()
                    await sending.look_around()
        finally:
            await feed.close()
        self._ledger.note_all_sent()
        if feed.left_out:
            self._watch.warnings.append(
                f"left out: {feed.left_out} instructions with device control, or that have the cutter answer"
            )

    async def _unless_aborted(self, taking: Coroutine[Any, Any, list[Instruction]]) -> list[Instruction]:
        """Wait for more of the job, but not when it shall not go on."""
        task = self._loop.create_task(taking)
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
