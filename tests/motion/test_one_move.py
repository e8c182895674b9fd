"""At most one move of a device that is none: what holds for the moves of any."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import cast

import pytest

from compax_aio.errors import (
    AnswerTimeoutError,
    CompaxError,
    ConnectionLostError,
    MoveActiveError,
    MoveError,
    MoveInDoubtError,
    MoveStoppedError,
    MoveTimeoutError,
)
from compax_aio.link.contract import Hold, Lane
from compax_aio.link.link import Link
from compax_aio.motion.events import DriveEvent
from compax_aio.motion.moves import MoveFuture, OnCancel
from compax_aio.motion.one_move import MustStop, OneMove
from compax_aio.motion.reports import MoveReports
from compax_aio.motion.untracked import Untracked


class FakeLink:
    """What a motion asks of its line."""

    def __init__(self) -> None:
        self.times_opened = 1
        self.held: Hold | None = None

    def check_not_lost(self, since: int) -> None:
        if since != self.times_opened:
            raise ConnectionLostError("the line was lost", device="x")

    def recent(self) -> tuple[str, ...]:
        return ("the last exchange",)


@dataclass(slots=True)
class Memory:
    doubt: str | None = None


class Pursuit:
    """Sends its move when the test says so, and then ends as the test says."""

    def __init__(self, motion: Motion, move: MoveFuture) -> None:
        self.move = move
        self.times_opened = motion.link.times_opened
        self.may_send = asyncio.Event()
        self.ending: asyncio.Future[float] = asyncio.get_running_loop().create_future()
        self.looks = 0
        self._wire = motion.wire

    async def carry_out(self) -> None:
        await self.may_send.wait()
        self._wire.append(self.move.description)
        self.move.note_sent(self.move.description)
        self.move.note_accepted()
        try:
            async with asyncio.timeout(1000):  # a test that fails must not wait for ever
                self.move.finish("status", await self.ending)
        except TimeoutError:
            raise MoveTimeoutError("the test gave it no end") from None

    def look_now(self) -> None:
        self.looks += 1

    def line_restored(self, signs_of_restart: tuple[str, ...]) -> None:
        self.looks += 1 + len(signs_of_restart)


class Motion(OneMove[Pursuit, float, None]):
    """Moves nothing; what it would have said is in *wire*."""

    def __init__(self) -> None:
        self.link = FakeLink()
        self.wire: list[str] = []
        self.events: list[DriveEvent] = []
        self.pursuits: list[Pursuit] = []
        self.standstill: asyncio.Future[float] = asyncio.get_running_loop().create_future()
        self.readiness = asyncio.Event()
        self.readiness.set()
        self.answer: CompaxError | None = None
        self.may_write = asyncio.Event()
        self.may_write.set()
        link = cast("Link", self.link)
        reports = MoveReports("x", link, noun="axis", while_running="wait for it")
        super().__init__(
            "x",
            link,
            reports=reports,
            untracked=Untracked(self._write, reports),
            memory=Memory(),
            log=logging.getLogger("compax_aio.toy"),
            publish=self.events.append,
        )

    def move(
        self, target: float, *, timeout_s: float | None = None, on_cancel: OnCancel = "stop"
    ) -> tuple[MoveFuture, Pursuit]:
        self.check_free(f"move_to({target:g})")
        move = MoveFuture(self, f"move_to({target:g})", target, on_cancel)
        pursuit = Pursuit(self, move)
        self._begin(pursuit)
        self._limit(move, timeout_s)
        return move, pursuit

    async def sent(self, target: float, **manner: float) -> tuple[MoveFuture, Pursuit]:
        """Begin a move, and return when it is on the wire."""
        move, pursuit = self.move(target, timeout_s=manner.get("timeout_s"))
        pursuit.may_send.set()
        await move.acceptance
        return move, pursuit

    @property
    def doubt(self) -> str | None:
        return self._memory.doubt

    async def read_position(self) -> float:
        return 1.0

    async def _write(self, text: str, lane: Lane, on_sent: Callable[[], None]) -> None:
        await self.may_write.wait()
        self.wire.append(text)
        on_sent()
        assert lane is Lane.MOTION
        if self.answer is not None:
            raise self.answer

    async def _make_ready(self, text: str) -> None:
        await self.readiness.wait()

    def _send_stop(self) -> Callable[[], Awaitable[float]]:
        self.wire.append("STOP")

        async def until_standstill() -> float:
            try:
                async with asyncio.timeout(60):
                    return await asyncio.shield(self.standstill)
            except TimeoutError:
                raise AnswerTimeoutError("nobody has said that it stands") from None

        return until_standstill

    def _conclude_stopped(self, pursuit: Pursuit, standstill: float, reason: MoveError | None) -> None:
        if standstill == pursuit.move.target:
            pursuit.move.finish("status", standstill)
        else:
            pursuit.move.fail(reason or MoveStoppedError(f"stopped at {standstill:g}"))


@pytest.fixture
async def motion() -> Motion:
    return Motion()


# One at a time --------------------------------------------------------------------------------------------------------


async def test_a_second_move_is_refused_until_the_first_has_ended(motion: Motion) -> None:
    first, pursuit = await motion.sent(1)
    with pytest.raises(MoveActiveError, match=r"move_to\(1\) is running, so move_to\(2\) was not sent; wait for it"):
        motion.move(2)
    pursuit.ending.set_result(1.0)
    assert (await first).last_position == 1.0
    second, pursuit = await motion.sent(2)
    pursuit.ending.set_result(2.0)
    await second
    assert motion.wire == ["move_to(1)", "move_to(2)"]


async def test_while_something_is_in_doubt_no_motion_begins(motion: Motion) -> None:
    motion.note_doubt("somebody pulled the plug")
    with pytest.raises(MoveInDoubtError, match="for somebody pulled the plug"):
        motion.move(1)
    with pytest.raises(MoveInDoubtError):
        await motion.tell("R1")
    assert motion.wire == []
    motion.standstill.set_result(0.0)
    await motion.end()
    assert motion.wire == ["STOP"], "it may be moving"


async def test_a_move_in_doubt_that_was_sent_is_stopped_when_the_block_is_left(motion: Motion) -> None:
    move, pursuit = await motion.sent(1)
    pursuit.ending.set_exception(MoveInDoubtError("nobody knows"))
    with pytest.raises(MoveInDoubtError, match="nobody knows"):
        await move
    motion.standstill.set_result(0.5)
    await motion.end()
    assert motion.wire == ["move_to(1)", "STOP"]


# Stopping -------------------------------------------------------------------------------------------------------------


async def test_a_stop_is_sent_before_anybody_waits_and_once_for_all_who_ask(motion: Motion) -> None:
    move, _ = await motion.sent(1)
    first, second = motion.begin_stop(), motion.begin_stop()
    assert motion.wire == ["move_to(1)", "STOP"]
    assert first is second
    assert motion.stops == 2
    motion.standstill.set_result(0.5)
    with pytest.raises(MoveStoppedError, match=r"stopped at 0\.5"):
        await move


async def test_a_move_that_was_at_its_target_when_it_was_stopped_has_reached_it(motion: Motion) -> None:
    move, _ = await motion.sent(1)
    motion.standstill.set_result(1.0)
    await move.stop()
    assert move.result().target == 1.0


async def test_a_move_that_is_stopped_before_it_was_sent_never_is(motion: Motion) -> None:
    move, pursuit = motion.move(1)
    motion.begin_stop()
    pursuit.may_send.set()
    with pytest.raises(MoveStoppedError, match="before it was sent"):
        await move
    motion.standstill.set_result(0.0)
    await motion.stop()
    assert motion.wire == ["STOP"]


async def test_a_move_waits_for_a_stop_that_is_under_way(motion: Motion) -> None:
    motion.begin_stop()
    move, pursuit = motion.move(1)
    pursuit.may_send.set()
    await asyncio.sleep(5)
    assert motion.wire == ["STOP"]
    motion.standstill.set_result(0.0)
    await move.accepted
    assert motion.wire == ["STOP", "move_to(1)"]
    pursuit.ending.set_result(1.0)
    await move


async def test_after_a_stop_that_failed_what_waited_for_it_is_not_sent(
    motion: Motion, caplog: pytest.LogCaptureFixture
) -> None:
    stopped, _ = await motion.sent(1)
    motion.begin_stop()
    move, pursuit = motion.move(2)
    pursuit.may_send.set()
    motion.standstill.set_exception(AnswerTimeoutError("no answer"))
    with pytest.raises(MoveInDoubtError, match=r"it may still be moving.*this axis takes no motion") as told:
        await stopped
    assert told.value.exchanges == ("the last exchange",)
    with pytest.raises(MoveInDoubtError, match="a stop failed"):
        await move
    assert motion.wire == ["move_to(1)", "STOP"]
    assert [record.name for record in caplog.records] == ["compax_aio.toy"]


async def test_what_waited_for_a_stop_is_not_said_on_a_line_that_came_back_meanwhile(motion: Motion) -> None:
    motion.begin_stop()
    move, pursuit = motion.move(1)
    pursuit.may_send.set()
    await asyncio.sleep(1)
    motion.link.times_opened += 1
    motion.standstill.set_result(0.0)
    with pytest.raises(ConnectionLostError):
        await move
    assert motion.wire == ["STOP"]


async def test_what_waits_for_a_stop_on_a_line_that_was_lost_before_does_not_wait(motion: Motion) -> None:
    stopping = motion.begin_stop()
    move, _ = motion.move(1)
    motion.link.times_opened += 1
    with pytest.raises(ConnectionLostError):
        await move
    assert not stopping.done()
    motion.standstill.set_result(0.0)
    await stopping


async def test_a_move_that_must_be_stopped_is_and_raises_why(motion: Motion) -> None:
    move, pursuit = await motion.sent(1)
    pursuit.ending.set_exception(MustStop(MoveTimeoutError("it gets nowhere")))
    motion.standstill.set_result(0.5)
    with pytest.raises(MoveTimeoutError, match="it gets nowhere"):
        await move
    assert motion.wire == ["move_to(1)", "STOP"]


async def test_cancelling_stops_before_it_returns(motion: Motion) -> None:
    move, _ = await motion.sent(1)
    move.cancel()
    assert motion.wire == ["move_to(1)", "STOP"]
    motion.standstill.set_result(0.5)
    await move.stop()
    assert motion.wire == ["move_to(1)", "STOP"]


async def test_stopping_a_move_that_was_cancelled_waits_for_the_standstill(motion: Motion) -> None:
    move, _ = await motion.sent(1)
    move.cancel()
    stopping = asyncio.ensure_future(move.stop())
    await asyncio.sleep(1)
    assert not stopping.done()
    motion.standstill.set_result(0.5)
    await stopping


async def test_who_waits_for_the_acceptance_of_a_move_that_is_cancelled_is_cancelled_too(motion: Motion) -> None:
    move, _ = motion.move(1)
    move.cancel()
    with pytest.raises(asyncio.CancelledError):
        await asyncio.wait_for(move.accepted, 5)


async def test_cancelling_a_move_that_was_not_sent_sends_nothing(motion: Motion) -> None:
    move, pursuit = motion.move(1)
    await asyncio.sleep(1)
    move.cancel()
    pursuit.may_send.set()
    await motion.end()
    assert motion.wire == []


async def test_cancelling_a_move_that_may_go_on_stops_nothing(motion: Motion) -> None:
    move, pursuit = motion.move(1, on_cancel="detach")
    pursuit.may_send.set()
    await move.accepted
    move.cancel()
    await motion.end()
    assert motion.wire == ["move_to(1)"]


async def test_a_move_whose_time_is_up_is_stopped(motion: Motion) -> None:
    move, _ = await motion.sent(1, timeout_s=3)
    motion.standstill.set_result(0.5)
    with pytest.raises(MoveTimeoutError, match="within 3 s and was stopped"):
        await move
    assert motion.wire == ["move_to(1)", "STOP"]


async def test_a_move_whose_time_is_up_before_it_was_sent_never_is(motion: Motion) -> None:
    move, pursuit = motion.move(1, timeout_s=3)
    with pytest.raises(MoveTimeoutError, match="within 3 s and was not sent"):
        await move
    pursuit.may_send.set()
    await asyncio.sleep(1)
    assert motion.wire == []


# The line -------------------------------------------------------------------------------------------------------------


async def test_a_move_that_is_being_stopped_hears_of_the_line_too(motion: Motion) -> None:
    _, stopped = await motion.sent(1)
    motion.look_now()
    motion.begin_stop()
    _, waiting = motion.move(2)
    motion.line_restored(("a sign",))
    assert (stopped.looks, waiting.looks) == (3, 2)
    motion.standstill.set_result(0.0)
    waiting.may_send.set()
    await waiting.move.accepted
    await motion.end()


# What nobody watches --------------------------------------------------------------------------------------------------


async def test_what_nobody_watches_is_stopped_when_the_block_is_left(motion: Motion) -> None:
    await motion.tell("R1")
    motion.standstill.set_result(0.0)
    await motion.end()
    assert motion.wire == ["R1", "STOP"]


async def test_what_was_stopped_is_not_stopped_again_when_the_block_is_left(motion: Motion) -> None:
    await motion.tell("R1")
    motion.standstill.set_result(0.0)
    await motion.stop()
    await motion.end()
    assert motion.wire == ["R1", "STOP"]


async def test_a_stop_takes_back_what_is_getting_ready(motion: Motion) -> None:
    motion.readiness.clear()
    telling = asyncio.ensure_future(motion.tell("R1"))
    await asyncio.sleep(1)
    motion.standstill.set_result(0.0)
    await motion.stop()
    motion.readiness.set()
    with pytest.raises(MoveStoppedError, match="'R1' was stopped before it was sent"):
        await telling
    assert motion.wire == ["STOP"]


async def test_a_stop_takes_back_what_waits_for_its_turn(motion: Motion) -> None:
    motion.may_write.clear()
    telling = asyncio.ensure_future(motion.tell("R1"))
    await asyncio.sleep(1)
    motion.standstill.set_result(0.0)
    await motion.stop()
    motion.may_write.set()
    with pytest.raises(MoveStoppedError):
        await telling
    assert motion.wire == ["STOP"]


async def test_a_move_that_begins_while_another_motion_gets_ready_keeps_it_from_being_sent(motion: Motion) -> None:
    motion.readiness.clear()
    telling = asyncio.ensure_future(motion.tell("R1"))
    await asyncio.sleep(1)
    move, pursuit = await motion.sent(2)
    motion.readiness.set()
    with pytest.raises(MoveActiveError, match="'R1' was not sent"):
        await telling
    pursuit.ending.set_result(2.0)
    await move
    assert motion.wire == ["move_to(2)"]


async def test_a_command_that_nobody_answered_leaves_a_doubt_and_says_what_to_do(motion: Motion) -> None:
    motion.answer = AnswerTimeoutError("no answer")
    with pytest.raises(AnswerTimeoutError, match=r"call reconcile\(\); this axis takes no motion until then"):
        await motion.command("R1")
    assert motion.doubt == "what became of 'R1' is unknown (no answer)"


async def test_a_command_that_was_not_sent_leaves_no_doubt(motion: Motion) -> None:
    motion.begin_stop()
    commanding = asyncio.ensure_future(motion.command("R1"))
    await asyncio.sleep(1)
    motion.link.times_opened += 1
    motion.standstill.set_result(0.0)
    with pytest.raises(ConnectionLostError):
        await commanding
    assert motion.doubt is None


# Leaving the block ----------------------------------------------------------------------------------------------------


async def test_leaving_without_having_moved_sends_nothing(motion: Motion) -> None:
    await motion.end()
    assert motion.wire == []


async def test_a_move_that_has_ended_is_not_stopped_when_the_block_is_left(motion: Motion) -> None:
    move, pursuit = await motion.sent(1)
    pursuit.ending.set_result(1.0)
    await move
    await motion.end()
    assert motion.wire == ["move_to(1)"]


async def test_a_line_that_is_held_is_left_without_a_stop(motion: Motion) -> None:
    await motion.tell("R1")
    motion.link.held = Hold("half a motion was sent", "look at it")
    with pytest.raises(MoveInDoubtError, match="without a stop, for half a motion was sent; look at it"):
        await motion.end()
    assert motion.wire == ["R1"]


async def test_a_move_that_may_go_on_goes_on_and_its_holder_is_told(motion: Motion) -> None:
    move, pursuit = motion.move(1, on_cancel="detach")
    pursuit.may_send.set()
    await move.accepted
    await motion.end()
    with pytest.raises(ConnectionLostError, match=r"move_to\(1\) goes on unwatched"):
        await move
    assert motion.wire == ["move_to(1)"]


async def test_a_defect_in_watching_a_move_stops_the_device_and_ends_the_move() -> None:
    motion = Motion()
    move, pursuit = motion.move(5)
    pursuit.may_send.set()
    await move.accepted
    pursuit.ending.set_exception(ZeroDivisionError("not foreseen"))
    motion.standstill.set_result(3.0)
    with pytest.raises(MoveStoppedError, match="ZeroDivisionError: not foreseen"):
        await asyncio.wait_for(move, 10)
    assert motion.stops == 1
