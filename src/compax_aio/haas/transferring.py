"""One transfer on its way: what it has in common both ways; its phases, its account, its end."""

from __future__ import annotations

import asyncio
import inspect
import logging
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Final, Generic, TypeVar

from ..errors import (
    AnswerTimeoutError,
    CommandRejectedError,
    CompaxError,
    ConnectionLostError,
    InvalidCommandError,
)
from ..escaping import escaped
from ..link.cancellation import despite_cancellation
from ..link.contract import Event
from ..motion.events import DriveEvent, MoveOutcome
from .archive import Archive
from .events import DripFeedHeld, TransferBegun, TransferEnded
from .line import ControlLine
from .manners import Manner
from .reports import TransferReports, operator_text, with_account
from .transfer import Kind, Transfer, TransferAccount, TransferPhase, TransferProgress, Way
from .transfers.account import Ending, LineAccount, Phase
from .transfers.notes import TransferBegan, TransferHeld, TransferStillHeld, TransferWentOn
from .transfers.strategy import Strategy

__all__ = ["Transferring"]

_log = logging.getLogger("compax_aio.haas")

_ResultT = TypeVar("_ResultT")

_PHASES: Final[dict[Phase, TransferPhase]] = {
    Phase.WAIT_START: "waiting for operator",
    Phase.BODY: "under way",
    Phase.TAIL: "ending",
}
_OUTCOMES: Final[tuple[tuple[type[BaseException], MoveOutcome], ...]] = (
    (AnswerTimeoutError, "out of time"),
    (CommandRejectedError, "refused"),
    (InvalidCommandError, "refused"),
)


class Transferring(ABC, Generic[_ResultT]):
    """
    Carries out one transfer.

    Args:
        line: Of the control.
        kind: What goes over it.
        way: Which way.
        manner: How it is wanted.
        publish: Is told what happens.
        after: A transfer that was given up, and has not let go of everything yet.

    Attributes:
        transfer: What the caller holds.
        task: Ends when the line is left alone.
    """

    def __init__(
        self,
        line: ControlLine,
        kind: Kind,
        way: Way,
        manner: Manner,
        *,
        publish: Callable[[DriveEvent], None],
        after: asyncio.Task[None] | None,
    ) -> None:
        self.kind = kind
        self.way = way
        self._line = line
        self._manner = manner
        self._patience = line.patience(manner.operator_timeout_s, manner.silence_timeout_s)
        self._publish = publish
        self._after = after
        self._loop = asyncio.get_running_loop()
        self._reports = TransferReports(line.name, line.profile, line.link)
        self._archive: Archive | None = None
        self._strategy: Strategy | None = None
        self._on_line: LineAccount | None = None
        """Of the transfer proper, once it is over: a second look has another one."""
        self._total_bytes: int | None = None
        self._is_verifying = False
        self._operator: str | None = None
        self._operators: set[asyncio.Future[object]] = set()
        self._held_s = 0.0
        self._held_since: float | None = None
        self._began_at = self._loop.time()
        self._has_begun = self._is_over = False
        self.transfer: Transfer[_ResultT] = Transfer(self, f"{way} {kind}")
        self.task = self._loop.create_task(self._run(), name=f"{line.name}: {way} {kind}")

    # What differs ---------------------------------------------------------------------------------------------------

    @abstractmethod
    async def _carry_out(self) -> _ResultT:
        """Do it, and return the result."""

    def _came(self) -> bytes:
        """Return what has come until now; of what is sent, nothing does."""
        return b""

    # What the caller's future asks ----------------------------------------------------------------------------------

    @property
    def _phase(self) -> TransferPhase:
        if self._is_over:
            return "over"
        if self._operator is not None:
            return "waiting for operator"
        if self._is_verifying:
            return "verifying"
        if self._strategy is None:
            return "starting"
        if self._held_since is not None:
            return "held"
        return _PHASES[self._strategy.account().phase]  # of one that is over, that in which it ended

    def _on_the_line(self) -> LineAccount | None:
        if self._on_line is not None:
            return self._on_line
        return None if self._strategy is None else self._strategy.account()

    def account(self) -> TransferAccount:
        """Say what is known of it."""
        archive = None if self._archive is None else self._archive.place
        found = self._on_the_line()
        if found is None:
            return TransferAccount(
                kind=self.kind, way=self.way, phase=self._phase, total_bytes=self._total_bytes, archive=archive
            )
        return TransferAccount(
            kind=self.kind,
            way=self.way,
            phase=self._phase,
            bytes=found.bytes,
            total_bytes=found.total_bytes,
            blocks=found.blocks,
            repeated_blocks=found.repeated_blocks,
            lines=found.lines,
            bytes_after_xoff=found.held_bytes,
            hold_offsets=found.hold_offsets,
            damage_offsets=found.damage_offsets,
            archive=archive,
        )

    def snapshot(self) -> TransferProgress:
        """Say how far it is."""
        found = self._strategy.account() if self._strategy is not None else None
        held_s = self._held_s
        if self._held_since is not None:
            held_s += self._loop.time() - self._held_since
        return TransferProgress(
            phase=self._phase,
            bytes=0 if found is None else found.bytes,
            total_bytes=self._total_bytes if found is None else found.total_bytes,
            blocks=0 if found is None else found.blocks,
            lines=0 if found is None else found.lines,
            held_s=held_s,
            operator=self._operator,
            elapsed_s=self._loop.time() - self._began_at,
        )

    def abandon(self) -> None:
        """Deal with a transfer that was cancelled: nothing more of it is written from now on."""
        if self._strategy is not None:
            self._line.give_up(self._strategy)
        if self._has_begun:  # else it finds out when it does
            self.task.cancel()

    async def end(self) -> None:
        """End it because its control is closed."""
        self.transfer.cancel()
        await asyncio.wait([self.task])

    # What the line tells --------------------------------------------------------------------------------------------

    def note(self, event: Event) -> bool:
        """Take note of an event of the line; return whether it is one of a transfer."""
        if isinstance(event, TransferBegan):
            self._ask_nothing()
            if not self._is_verifying:
                self._publish(TransferBegun(self._line.name, self._loop.time(), self.kind, self.way))
        elif isinstance(event, TransferHeld):
            self._held_since = self._loop.time()
        elif isinstance(event, TransferWentOn):
            self._note_not_held()
        elif isinstance(event, TransferStillHeld):
            self._publish(DripFeedHeld(self._line.name, self._loop.time(), event.offset, event.held_s))
        else:
            return False
        self.transfer.note_change()
        return True

    def _note_not_held(self) -> None:
        if self._held_since is not None:
            self._held_s += self._loop.time() - self._held_since
            self._held_since = None

    # Carrying out ---------------------------------------------------------------------------------------------------

    async def _run(self) -> None:
        result, failure = None, None
        self._has_begun = True
        try:
            await self._until_it_may_begin()
            result = await self._carry_out()
        except asyncio.CancelledError:
            self.transfer.note_cancelled()  # it may be this task that was cancelled, by a loop that ends
        except CompaxError as error:
            failure = error
        except Exception as error:  # of the caller's, or a defect: who awaits it learns of it, the line is let go of
            self.transfer.fail(error)
        finally:
            await despite_cancellation(self._end(result, failure))

    async def _until_it_may_begin(self) -> None:
        if self.transfer.done():  # cancelled already
            raise asyncio.CancelledError
        if self._after is not None:
            await asyncio.wait([self._after])

    async def _end(self, result: _ResultT | None, failure: CompaxError | None) -> None:
        self._ask_nothing()
        self._note_not_held()
        if self._archive is not None and result is None:
            await self._leave_archive(self._archive)
        account = self.account()
        self._is_over = True
        if failure is not None:
            with_account(failure, account)  # again, for its archive is where it stays now
            self._tell_place(failure, account)
        self._tell(result, failure, account)
        if result is not None:
            self.transfer.finish(result)
        elif failure is not None:
            self.transfer.fail(failure)
        self.transfer.note_change()

    async def _leave_archive(self, archive: Archive) -> None:
        """Leave what came where it is; no file where nothing came."""
        account = self._on_the_line()
        try:
            if account is None or not account.bytes:
                await archive.discard()
            else:
                await archive.leave()
        except OSError as error:
            _log.warning("%s: the incomplete archive could not be closed: %s", self._line.name, error)

    def _tell_place(self, failure: CompaxError, account: TransferAccount) -> None:
        """Have *failure* tell where the bytes are."""
        if account.archive is None or self._archive is None:
            return
        where = escaped(str(account.archive))
        if (cause := self._archive.failure) is None:
            failure.add_note(f"what came is in {where}")
        else:
            failure.data = self._came()  # type: ignore[attr-defined]
            failure.add_note(f"not all that came is in {where} ({cause}): error.data has it")

    def _tell(self, result: _ResultT | None, failure: CompaxError | None, account: TransferAccount) -> None:
        outcome: MoveOutcome = "reached"
        if result is None:
            outcome = next((each for kind, each in _OUTCOMES if isinstance(failure, kind)), "failed")
            if failure is None:
                outcome = "cancelled"
        self._publish(TransferEnded(self._line.name, self._loop.time(), self.kind, self.way, outcome, account, failure))

    async def _transfer(self, strategy: Strategy) -> LineAccount:
        """
        Have a file go over the line.

        Raises:
            CompaxError: It has not.
        """
        self._strategy = strategy
        try:
            account = await self._line.transfer(strategy)
        except ConnectionLostError as error:
            self._ask_nothing()  # so that the phase is that of the file
            raise self._reports.lost(self.account(), error) from error
        finally:
            self._ask_nothing()
        if account.ending is not Ending.COMPLETE:
            assert account.ending is not None
            raise self._reports.of_ending(account.ending, self.account(), account.detail)
        return account

    # The operator ---------------------------------------------------------------------------------------------------

    def _ask_operator(self, *, sends: bool, why: str = "") -> asyncio.Future[object] | None:
        """Tell what has to be done at the control; return what says that it was done, if the caller gives that."""
        self._operator = operator_text(self.kind, sends=sends) + why
        self.transfer.note_change()
        if self._manner.on_operator is None:
            return None
        answer = self._manner.on_operator(self._operator)
        if not inspect.isawaitable(answer):
            return None
        future: asyncio.Future[object] = asyncio.ensure_future(answer)
        self._operators.add(future)
        future.add_done_callback(self._operator_is_through)
        return future

    def _operator_is_through(self, future: asyncio.Future[object]) -> None:
        self._operators.discard(future)
        if not future.cancelled() and (error := future.exception()) is not None:
            _log.warning("%s: on_operator has failed: %r", self._line.name, error)

    async def _until_done_there(self, answer: asyncio.Future[object]) -> None:
        """Wait until the operator has said that it is done."""
        try:
            async with asyncio.timeout(self._patience.start_s):
                await answer
        except TimeoutError:
            raise self._reports.of_ending(Ending.NOT_STARTED, self.account()) from None
        self._operator = None
        self.transfer.note_change()

    def _ask_nothing(self) -> None:
        """Take note that nothing has to be done at the control any more."""
        self._operator = None
        for each in tuple(self._operators):
            each.cancel()
