"""
One motion carried out: said to the axis at most once, then polled until the axis stands (``^``, DCB p. 26).

The line feed that ends the command says that it was started, no more. Nothing says when it is over, so the status is
asked again and again; that the axis stands is believed when two readings in a row say so, and that it has arrived when
its position is the target.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import TypeVar

from ..errors import AnswerTimeoutError, CompaxError, ConnectionLostError, InvalidCommandError, MoveInDoubtError
from ..link.contract import Lane, TurnOver
from ..motion.one_move import Doubtful, MustStop
from ..motion.pace import Pace
from .codecs import decode_home
from .moves import AxisMove
from .observer import Look, Observer
from .protocol_events import Answered, EntryFailed, Unreadable
from .reports import AxisReports
from .vocabulary import MotionKind, home_query

__all__ = ["Pursuit"]

_Value = TypeVar("_Value")


class Pursuit:
    """
    Pursues one motion of one axis.

    Args:
        move: What its holder awaits; this ends it, one way or the other, unless it is cancelled first.
        observer: Of the axis.
        reports: Of the axis.
        memory: Of the axis.
        sets_origin: For a search for home: make its end the origin.
        patience_s: How long the axis may keep silent on the way before nobody knows what becomes of it.
    """

    def __init__(
        self,
        move: AxisMove,
        observer: Observer,
        reports: AxisReports,
        memory: Doubtful,
        *,
        sets_origin: bool,
        patience_s: float,
    ) -> None:
        self.move = move
        self.times_opened = observer.line.link.times_opened
        self._observer = observer
        self._line = observer.line
        self._settings = observer.line.settings
        self._profile = observer.line.settings.profile
        self._reports = reports
        self._memory = memory
        self._sets_origin = sets_origin
        self._patience_s = patience_s
        self._loop = asyncio.get_running_loop()
        self._wake = asyncio.Event()
        self._start = 0.0
        self._seen_at = 0.0
        """Where it was on the way, or before."""
        self._times_lost = 0

    async def carry_out(self) -> None:
        """
        Look, send, watch; returns when the motion has ended where it should.

        Raises:
            MustStop: Nobody can say what the axis has begun, or it gets nowhere.
            CompaxError: It has not ended there; the error says why.
        """
        await self._prepare()
        await self._send()
        look = await self._until_standing()
        if not self.move.done():
            await self._conclude(look)

    # Saying it ------------------------------------------------------------------------------------------------------

    async def _prepare(self) -> None:
        """Find out where the motion begins: an axis that moves already would hold it back, and the line with it."""
        plan = self.move.plan
        look = await self._observer.look(Lane.MOTION)
        if not look.status.is_settled:
            raise self._reports.moved_by_others(self.move, look)
        if plan.kind is MotionKind.MOVE_TO and (why := self._observer.lost_reference) is not None:
            raise self._reports.no_reference(plan.description, why)
        self._start = self._seen_at = look.position
        self._times_lost = self._observer.times_lost
        if plan.distance is not None:
            self.move.target = self._checked(round(look.position + plan.distance, self._profile.decimals))

    def _checked(self, target: float) -> float:
        if abs(target) > self._profile.max_position:
            raise InvalidCommandError(
                f"{self.move.description} would lead to {target:,.{self._profile.decimals}f}, beyond "
                f"±{self._profile.max_position:,.2f} (DCB p. 26); it was not sent",
                device=self._observer.name,
            )
        return target

    async def _send(self) -> None:
        """Put the motion on the wire, once, and return when it is known to have been started."""
        try:
            outcome = await self._say()
            if isinstance(outcome, EntryFailed) and not outcome.was_begun:
                outcome = await self._say_again()
        except (AnswerTimeoutError, ConnectionLostError) as error:
            if not self.move.is_on_wire or self._line.link.is_over:
                raise
            await self._find_out(error)
            return
        refusal = self._line.refusal(self._observer.axis, self.move.plan.text, outcome)
        if refusal is None:
            self.move.note_accepted()
        elif isinstance(outcome, Answered | Unreadable):
            await self._find_out(refusal)
        else:
            # Where the axis may execute a part of it, it is being stopped already, and this is not reached.
            refusal.hint = "the axis has not executed it; command it again if you want it"
            raise refusal

    async def _say_again(self) -> TurnOver:
        """Say it once more, for of the first attempt the axis has seen its name, if anything; look before, anew."""
        # It may have kept silent because it was reset, and count from elsewhere now.
        self._observer.note_standing(self._start)
        await self._prepare()
        return await self._say()

    def _say(self) -> asyncio.Future[TurnOver]:
        axis, text = self._observer.axis, self.move.plan.text

        def on_sent() -> None:
            self._observer.note_moving()
            self.move.note_sent(axis + text)

        return self._line.start(axis, text, Lane.MOTION, on_sent)

    async def _find_out(self, error: CompaxError) -> None:
        """
        Let the status decide whether a motion was started whose end did not come back; it is never sent again.

        Raises:
            The *error* it came with: the axis stands, and is not at its target.
            MoveInDoubtError: The status cannot tell, or is not to be had.
        """
        look = await self._learn(self._observer.look, error)
        if look.status.is_settled:
            if self.move.target is None:
                at = self._observer.written(look.position)
                raise self._doubt(f"the axis stands at {at}, as it may before and after it", error)
            if not self._is_at_target(look):
                self._note_count(look)
                error.hint = f"the axis stands at {self._observer.written(look.position)}: " + (
                    "it was not taken; command it again if you want it"
                    if self._counts_on and self._observer.is_near(look.position, self._start)
                    else "it ended before its target, or the position is lost; look at the machine"
                )
                raise error
        self.move.note_accepted()

    # Watching it ----------------------------------------------------------------------------------------------------

    def look_now(self) -> None:
        """Look at once: something has happened to the line."""
        self._wake.set()

    def line_restored(self, signs_of_restart: tuple[str, ...]) -> None:
        """Look at once, now that the line is back."""
        del signs_of_restart  # the observer knows
        self._wake.set()

    async def _until_standing(self) -> Look:
        """Look at the axis ever more rarely, until two looks in a row find it settled."""
        is_search = self.move.plan.kind is MotionKind.HOME
        await self._pause(self._profile.first_look_after_home_s if is_search else self._settings.poll_first_s)
        pace = Pace(self._settings.poll_first_s, self._settings.poll_slowest_s, self._loop.time())
        was_settled = False
        while True:
            look = await self._learn(self._observer.look, None)
            if look.status.is_settled and was_settled:
                return look
            was_settled = look.status.is_settled
            if not was_settled:
                self._seen_at = look.position
            pace.note(look.position, self._loop.time())
            self._refuse_without_progress(look, pace)
            pause_s = pace.pause_before_arrival_s(self.move.target)
            await self._pause(self._settings.poll_first_s if was_settled else pause_s)

    def _refuse_without_progress(self, look: Look, pace: Pace) -> None:
        """Give up an axis that is always at the same position, and is not settled there."""
        limit_s = self._settings.standstill_timeout_s if look.status.is_stopped else self._settings.stall_timeout_s
        if not look.status.is_settled and pace.stood_still_s(self._loop.time()) >= limit_s:
            report = self._reports.not_settled if look.status.is_stopped else self._reports.stalled
            raise MustStop(report(self.move, look, limit_s))

    async def _pause(self, at_most_s: float) -> None:
        with suppress(TimeoutError):
            async with asyncio.timeout(at_most_s):
                await self._wake.wait()
        self._wake.clear()

    async def _conclude(self, look: Look) -> None:
        """End the motion by how the axis stands."""
        if self.move.target is not None:
            if not self._is_at_target(look):
                self._note_count(look)
                raise self._reports.ended_elsewhere(self.move, look)
        elif self.move.plan.kind is MotionKind.RUN:
            raise self._reports.ended_elsewhere(self.move, look)
        elif self.move.plan.kind is MotionKind.HOME:
            look = await self._conclude_search(look)
        self._observer.note_standing(look.position)
        self.move.finish("status", look.position)

    async def _conclude_search(self, look: Look) -> Look:
        """Ask the home input, where it is known, and make this the origin, if that was wanted."""
        if self._profile.home_query is not None and self._profile.home_bit is not None:
            text = home_query(self._profile)
            is_home = await self._line.read(
                self._observer.axis, text, lambda body: decode_home(body, self._profile), Lane.CONTROL
            )
            if not is_home:
                raise self._reports.no_home(self.move, look)
        if self._sets_origin:
            look = Look(look.status, await self._observer.make_origin())
        return look

    def conclude_stopped(self, look: Look, reason: CompaxError | None) -> None:
        """End the motion by what was seen after a stop from here: it may have been there already."""
        if self.move.target is not None and self._is_at_target(look):
            self.move.finish("status", look.position)
            return
        self._note_count(look)
        if reason is None:
            reason = self._reports.stopped(self.move, look)
        else:
            reason.what += f"; {self.move.description} ended at {self._observer.written(look.position)}"
            reason.sent, reason.received = self.move.sent, look.as_sent
        self.move.fail(reason)

    # Small things ---------------------------------------------------------------------------------------------------

    @property
    def _counts_on(self) -> bool:
        """Whether the axis still counts from where it did when the motion was planned, as far as is known."""
        return self._observer.times_lost == self._times_lost

    def _is_at_target(self, look: Look) -> bool:
        target = self.move.target
        return target is not None and self._counts_on and self._observer.is_near(look.position, target)

    def _note_count(self, look: Look) -> None:
        """Take note of a position that is nowhere on the way: an axis that counts 0 there has been reset, it seems."""
        was_at_zero = self._observer.is_near(self._start, 0.0) and self._observer.is_near(self._seen_at, 0.0)
        if look.position == 0.0 and not was_at_zero:
            self._observer.find_reference_lost(f"it counts 0 after {self.move.description}, as after a reset")

    async def _learn(self, read: Callable[[], Awaitable[_Value]], cause: CompaxError | None) -> _Value:
        try:
            return await self._observer.patiently(read, self._patience_s)
        except CompaxError as error:
            if self._line.link.is_over:
                raise
            raise self._doubt("the axis does not say how it stands", cause or error) from error

    def _doubt(self, why: str, cause: CompaxError | None) -> MoveInDoubtError:
        self._memory.doubt = f"{self.move.description} is in doubt: {why}"
        return self._reports.in_doubt(self.move, why, cause)
