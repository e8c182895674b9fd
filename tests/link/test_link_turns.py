"""The link in step: one exchange at a time, lanes, sharing, cancelling."""

from __future__ import annotations

import asyncio
import itertools
import logging
from collections.abc import AsyncIterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.fakes.answers import PROMPT, answer_to, as_drive
from tests.fakes.scripted import ScriptedFarEnd
from tests.fakes.toy import Said, ToyProtocol, as_toy
from tests.fakes.transports import DeafTransport
from tests.link.lines import Line, connected, unique_name

from compax_aio.compax.protocol import Acknowledged, Answered, ComparatorReached, PositionReached, Rejected, Stray
from compax_aio.errors import AnswerTimeoutError, ConnectionLostError, TransportError
from compax_aio.link.contract import Event, Lane, TurnOver
from compax_aio.link.link import Link
from compax_aio.simulator.clock import VirtualClockLoop
from compax_aio.transports import registry
from compax_aio.transports.loopback import listen, open_loopback
from compax_aio.transports.registry import ProtocolFactory
from compax_aio.transports.url import TransportURL

ALL_LANES = list(Lane)


@pytest.fixture
async def line() -> AsyncIterator[Line]:
    """A line in step; its drive takes 20 ms for an answer."""
    line = await connected(ScriptedFarEnd(delay_s=0.02))
    yield line
    await line.link.close()


async def test_a_line_is_written_before_exchange_returns(line: Line) -> None:
    assert line.link.stats.bytes_sent == len(b"S17\rS99\r")
    waiter = line.ask("S1")
    assert line.link.stats.bytes_sent == len(b"S17\rS99\rS1\r")
    assert await waiter == Answered("S001: 1")


async def test_no_line_is_written_while_another_is_unanswered(line: Line) -> None:
    """P1: the far end answers each line 20 ms after it came; the next one never comes earlier."""
    waiters = [line.ask(f"S{number}", lane) for number in range(1, 6) for lane in ALL_LANES]
    await asyncio.gather(*waiters)
    assert len(line.far.lines) == 25
    assert line.far.writes == [f"{text}\r".encode() for text in line.far.lines]
    assert all(later - earlier >= 0.0199 for earlier, later in itertools.pairwise(line.far.times))


async def test_lanes_go_in_order_and_each_lane_is_first_come_first_served(line: Line) -> None:
    waiters = [line.ask("S99")]
    for lane in reversed(ALL_LANES):
        waiters += [line.ask(f"S{10 * lane + place}", lane) for place in (1, 2, 3)]
    await asyncio.gather(*waiters)
    assert line.far.lines == ["S99", *(f"S{10 * lane + place}" for lane in ALL_LANES for place in (1, 2, 3))]


async def test_a_stop_waits_for_nothing_but_the_exchange_in_flight(line: Line) -> None:
    """P6."""
    reads = [line.ask(f"P{number}") for number in range(1, 200)]
    await asyncio.sleep(0.01)
    assert isinstance(await line.ask("STOP", Lane.STOP), Acknowledged)
    assert line.far.lines[:2] == ["P1", "STOP"]
    assert line.far.times[1] - line.far.times[0] == pytest.approx(0.02)
    await asyncio.gather(*reads)


async def test_identical_reads_that_wait_together_share_one_exchange(line: Line) -> None:
    first = line.ask("S99")
    waiting = [line.ask("S1") for _ in range(10)]
    assert {await each for each in waiting} == {Answered("S001: 1")}
    assert line.far.lines == ["S99", "S1"]
    assert await first == Answered("S099: 99")


async def test_a_read_that_is_in_flight_is_not_shared(line: Line) -> None:
    """Its value may be older than the question."""
    await asyncio.gather(line.ask("S1"), line.ask("S1"), line.ask("S1"))
    assert line.far.lines == ["S1", "S1"]


@pytest.mark.parametrize("lane", [Lane.STOP, Lane.CONTROL, Lane.MOTION])
async def test_commands_are_never_shared(line: Line, lane: Lane) -> None:
    await asyncio.gather(*(line.ask("PR10", lane) for _ in range(3)))
    assert line.far.lines == ["PR10", "PR10", "PR10"]


async def test_a_caller_that_is_cancelled_in_the_queue_has_sent_nothing(line: Line) -> None:
    first = line.ask("S99")
    queued = line.ask("PA100$", Lane.MOTION)
    queued.cancel()
    await first
    assert await line.answer("S1") == "S001: 1"
    assert line.far.lines == ["S99", "S1"]


async def test_a_caller_that_is_cancelled_in_flight_leaves_its_answer_to_nobody(line: Line) -> None:
    """P5: the next one asks the same, and gets the answer to its own question."""
    serials = itertools.count(1)
    line.far.script = lambda text: answer_to(text, next(serials))
    first = line.ask("S1")
    await asyncio.sleep(0.01)
    first.cancel()
    assert await line.answer("S1") == "S001: 2"
    assert line.events == []


async def test_of_several_that_share_one_may_be_cancelled(line: Line) -> None:
    line.ask("S99")
    sharers = [line.ask("S1") for _ in range(3)]
    sharers[0].cancel()
    assert [await each for each in sharers[1:]] == [Answered("S001: 1")] * 2
    assert line.far.lines == ["S99", "S1"]


async def test_a_read_whose_sharers_are_all_cancelled_is_not_sent(line: Line) -> None:
    first = line.ask("S99")
    for sharer in [line.ask("S1") for _ in range(3)]:
        sharer.cancel()
    await first
    await line.answer("S2")
    assert line.far.lines == ["S99", "S2"]


async def test_a_read_that_was_cancelled_in_the_queue_can_be_asked_again(line: Line) -> None:
    line.ask("S99")
    line.ask("S1").cancel()
    assert await line.answer("S1") == "S001: 1"
    assert line.far.lines == ["S99", "S1"]


async def test_one_refusal_reaches_every_sharer_and_the_line_stays_in_step(line: Line) -> None:
    line.far.script = lambda text: b"E90" + PROMPT if text == "S1" else as_drive(text)
    line.ask("S99")
    sharers = [line.ask("S1"), line.ask("S1")]
    assert [await each for each in sharers] == [Rejected(90, "E90")] * 2
    assert await line.answer("S2") == "S002: 2"
    assert line.far.lines == ["S99", "S1", "S2"], "no marker"


@settings(max_examples=60, deadline=None)
@given(
    calls=st.lists(
        st.tuples(
            st.sampled_from(["S1", "S2", "P1", "SD50"]),
            st.sampled_from(ALL_LANES),
            st.sampled_from([0.0, 0.01, 0.02, 0.021, 0.05]),
            st.none() | st.sampled_from([0.0, 0.005, 0.02, 0.03, 0.1]),
        ),
        max_size=12,
    )
)
def test_whoever_is_cancelled_whenever_the_others_get_their_own_answers(
    calls: list[tuple[str, Lane, float, float | None]],
) -> None:
    """P1, P4 and P5: the drive's answers carry serial numbers, and it notes when a line comes too early."""

    async def main() -> None:
        serials = itertools.count()
        sent: dict[int, str] = {}

        def script(text: str) -> bytes:
            sent[serial := next(serials)] = text
            return answer_to(text, serial) if text[0] in "SP" and text != "SD50" else PROMPT

        line = await connected(ScriptedFarEnd(script, delay_s=0.02))
        asked_at: dict[asyncio.Future[TurnOver], tuple[str, int]] = {}
        for text, lane, pause_s, cancel_after_s in calls:
            waiter = line.link.exchange(text, lane)
            asked_at[waiter] = (text, len(sent))
            if cancel_after_s is not None:
                asyncio.get_running_loop().call_later(cancel_after_s, waiter.cancel)
            await asyncio.sleep(pause_s)
        for waiter, (text, sent_before) in asked_at.items():
            (outcome,) = await asyncio.gather(waiter, return_exceptions=True)
            if isinstance(outcome, Answered):
                serial = int(outcome.text.partition(":")[2])
                assert sent[serial] == text
                assert serial >= sent_before - 1, "asked before this caller came"
            else:
                assert waiter.cancelled() or (outcome == Acknowledged() and text == "SD50")
        assert line.far.writes == [f"{text}\r".encode() for text in line.far.lines]
        assert all(later - earlier >= 0.0199 for earlier, later in itertools.pairwise(line.far.times))
        assert line.events == []
        await line.link.close()

    with asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
        runner.run(asyncio.wait_for(main(), 1000))


# Held-back reads ------------------------------------------------------------------------------------------------------


async def test_reads_that_are_held_back_wait_and_all_else_goes_on(line: Line) -> None:
    line.link.hold_reads(5)
    reads = [line.ask("S1"), line.ask("S1"), line.ask("S2")]
    for lane in (Lane.STOP, Lane.CONTROL, Lane.MOTION):
        await line.ask(f"SD{lane + 1}", lane)
    await asyncio.sleep(4)
    assert line.far.lines == ["SD1", "SD3", "SD4"]
    assert not any(read.done() for read in reads)
    line.link.release_reads()
    assert [await read for read in reads] == [Answered("S001: 1"), Answered("S001: 1"), Answered("S002: 2")]
    assert line.far.lines[3:] == ["S1", "S2"], "those that wait together still share"


async def test_reads_are_held_back_no_longer_than_was_said(line: Line) -> None:
    now = asyncio.get_running_loop().time
    before = now()
    line.link.hold_reads(2)
    await line.answer("S1")
    assert now() - before == pytest.approx(2.02)
    line.link.hold_reads(2)
    await asyncio.sleep(1)
    line.link.hold_reads(2)
    before = now()
    await line.answer("S1")
    assert now() - before == pytest.approx(2.02), "the last word counts"
    await line.answer("S2")
    assert now() - before == pytest.approx(2.04)


async def test_releasing_reads_that_are_not_held_back_changes_nothing(line: Line) -> None:
    line.link.release_reads()
    line.link.hold_reads(5)
    line.link.release_reads()
    line.link.release_reads()
    before = asyncio.get_running_loop().time()
    await line.answer("S1")
    assert asyncio.get_running_loop().time() - before < 0.1
    await asyncio.sleep(10)


async def test_reads_may_be_held_back_when_a_line_is_sent(line: Line) -> None:
    """Nothing else goes out between a line that is stored and what executes it."""
    stored = line.link.exchange("PA100,", Lane.MOTION, on_sent=lambda: line.link.hold_reads(5))
    read = line.ask("S1")
    await stored
    sent = line.link.lines_sent
    await asyncio.sleep(1)
    assert line.link.lines_sent == sent
    assert line.link.is_free
    executed = line.ask("!", Lane.MOTION)
    line.link.release_reads()
    assert await executed == Acknowledged()
    assert await read == Answered("S001: 1")
    assert line.far.lines == ["PA100,", "!", "S1"]


async def test_a_read_on_the_wire_is_not_held_back(line: Line) -> None:
    read = line.ask("S1")
    line.link.hold_reads(5)
    assert await asyncio.wait_for(read, 0.1) == Answered("S001: 1")


async def test_held_back_reads_end_with_their_line_and_with_a_silent_drive(line: Line) -> None:
    line.link.hold_reads(1000)
    read = line.ask("S1")
    line.far.script = lambda text: None
    line.ask("SD5", Lane.CONTROL)
    with pytest.raises(AnswerTimeoutError):
        await asyncio.wait_for(read, 10)
    line.far.script = as_drive
    read = line.ask("S1")
    await asyncio.sleep(1)
    await line.link.close()
    with pytest.raises(ConnectionLostError):
        await read
    line.link.release_reads()


# What has gone out ----------------------------------------------------------------------------------------------------


async def test_every_line_that_goes_out_is_counted_markers_too(line: Line) -> None:
    link = line.link
    before = link.lines_sent
    counted: list[int] = []
    waiter = link.exchange("SD50", Lane.CONTROL, on_sent=lambda: counted.append(link.lines_sent - before))
    assert counted == [1], "its own line is counted when it is told that it is sent"
    await waiter
    assert link.lines_sent == before + 1
    line.far.say(b"noise" + PROMPT)
    await asyncio.sleep(0.1)
    assert link.lines_sent == before + 2, "a marker"


async def test_a_line_is_free_when_what_is_queued_is_written_at_once(line: Line) -> None:
    def is_free() -> bool:
        return line.link.is_free

    assert is_free()
    waiter = line.ask("S1")
    assert not is_free()
    await waiter
    assert is_free()
    line.link.hold_reads(5)
    line.ask("S2").cancel()
    assert is_free(), "a read that is held back is in nobody's way"
    line.far.script = lambda text: None
    lost = line.ask("SD5", Lane.CONTROL)
    await asyncio.gather(lost, return_exceptions=True)
    assert not is_free(), "in doubt"
    await asyncio.sleep(10)
    assert not is_free(), "given up, and still in doubt"
    await line.link.close()
    assert not is_free()


async def test_a_line_is_not_free_while_events_are_handled() -> None:
    line = Line(ScriptedFarEnd())
    seen: list[bool] = []
    line.link._turns._on_event = lambda _: seen.append(line.link.is_free)
    line.connect()
    await line.answer("S1")
    line.far.say(b"$" + PROMPT)
    await asyncio.sleep(0.01)
    assert seen == [False]
    assert line.link.is_free
    await line.link.close()


# Events ---------------------------------------------------------------------------------------------------------------


async def test_messages_are_handed_on_as_they_are_read(line: Line) -> None:
    line.far.say(b"$\r\n>2\r\n>")
    await asyncio.sleep(0.01)
    assert line.events == [PositionReached(), ComparatorReached(2)]
    assert await line.answer("S1") == "S001: 1"
    assert line.far.lines == ["S1"]


async def test_noise_in_a_quiet_moment_is_followed_by_a_marker() -> None:
    line = await connected()
    line.far.say(b"noise" + PROMPT)
    await asyncio.sleep(0.01)
    assert line.events == [Stray("noise")]
    assert len(line.far.lines) == 1
    assert line.link.stats.resynchronisations == 2


@pytest.mark.parametrize(
    "piece",
    [PROMPT + b"$" + PROMPT, b"$" + PROMPT + PROMPT],
    ids=["acknowledgement first", "message first"],
)
@pytest.mark.parametrize("doubled", [b"", answer_to("S1", "stale")], ids=["", "and a doubled answer"])
async def test_an_exchange_begun_while_events_are_handled_gets_none_of_their_answers(
    piece: bytes, doubled: bytes
) -> None:
    """One piece holds an acknowledgement and a message; the handler of the message asks in between."""
    far = ScriptedFarEnd(delay_s=0.02)
    line = Line(far)
    asked: list[asyncio.Future[TurnOver]] = []

    def on_event(event: Event) -> None:
        line.events.append(event)
        if isinstance(event, PositionReached):
            asked.append(line.link.exchange("S1", Lane.READ))

    line.link = Link(
        line.protocol, name="x", answer_timeout_s=1, resync_attempts=3, on_event=on_event, on_lost=line.losses.append
    )
    line.connect()
    await line.answer("S99")
    far.script = lambda text: piece + doubled if text == "SD50" else as_drive(text)
    assert await line.ask("SD50") == Acknowledged()
    assert [await each for each in asked] == [Answered("S001: 1")]
    assert line.events == [PositionReached(), *([Stray("S001: stale")] if doubled else [])]
    await line.link.close()


async def test_a_caller_told_when_its_line_is_sent_may_ask_at_once(line: Line) -> None:
    more: list[asyncio.Future[TurnOver]] = []
    first = line.link.exchange("SD50", Lane.CONTROL, on_sent=lambda: more.append(line.link.exchange("S1", Lane.READ)))
    assert len(more) == 1, "the line was free"
    assert await first == Acknowledged()
    assert await more[0] == Answered("S001: 1")
    assert line.far.lines == ["SD50", "S1"]


async def test_a_caller_is_told_when_its_line_is_sent_and_not_before(line: Line) -> None:
    sent: list[float] = []
    now = asyncio.get_running_loop().time
    line.ask("S1")
    waiter = line.link.exchange("PA1", Lane.MOTION, on_sent=lambda: sent.append(now()))
    assert sent == []
    await waiter
    assert sent == [line.far.times[1]]


# Any device -----------------------------------------------------------------------------------------------------------


async def test_the_link_runs_a_protocol_of_another_device() -> None:
    far = ScriptedFarEnd(as_toy, end=b"\n", delay_s=0.01)
    line = Line(far, ToyProtocol())
    line.connect()
    answers = await asyncio.gather(*(line.ask(text, lane) for lane in reversed(ALL_LANES) for text in ("a", "b")))
    assert answers == [Said("ok a"), Said("ok b")] * len(ALL_LANES)
    far.script = lambda text: None if text == "lost" else as_toy(text)
    with pytest.raises(AnswerTimeoutError):
        await line.ask("lost")
    assert await line.ask("c") == Said("ok c")
    assert far.lines == ["?", *["a", "b"] * len(ALL_LANES), "lost", "?", "c"]
    await line.link.close()


# Opening and the end --------------------------------------------------------------------------------------------------


async def test_open_returns_when_the_line_is_in_step() -> None:
    name = unique_name()
    line = Line(ScriptedFarEnd(delay_s=0.3))
    with await listen(name, lambda: line.far):
        await line.link.open(f"loop://{name}")
    assert line.far.lines == ["S17"]
    assert line.link.is_open
    assert line.link.stats.resynchronisations == 1
    await line.link.close()
    assert not line.link.is_open


async def test_a_line_that_cannot_be_opened_says_so() -> None:
    line = Line(ScriptedFarEnd())
    with pytest.raises(TransportError, match="nobody listens"):
        await line.link.open("loop://nobody-is-here")
    assert not line.link.is_open


async def test_opening_a_silent_line_fails_in_bounded_time_and_closes_it() -> None:
    name = unique_name()
    line = Line(ScriptedFarEnd(lambda text: None))
    loop = asyncio.get_running_loop()
    with await listen(name, lambda: line.far):
        before = loop.time()
        with pytest.raises(AnswerTimeoutError, match="3 queries") as caught:
            await line.link.open(f"loop://{name}")
    assert loop.time() - before <= 3.5
    assert "power" in (caught.value.hint or "")
    assert len(set(line.far.lines)) == 3, "three markers that differ"
    assert not line.link.is_open
    await asyncio.sleep(0)
    assert line.far.is_lost


async def test_opening_a_line_of_an_unknown_device_says_that_it_is_another() -> None:
    name = unique_name()
    line = Line(ScriptedFarEnd(lambda text: b"pardon?\r\n"))
    with await listen(name, lambda: line.far), pytest.raises(AnswerTimeoutError) as caught:
        await line.link.open(f"loop://{name}")
    assert "pardon" in (caught.value.received or "")
    assert "baud" in (caught.value.hint or "")


async def test_a_line_that_is_lost_while_it_is_opened_fails_the_opening() -> None:
    name = unique_name()
    line = Line(ScriptedFarEnd(lambda text: None))
    with await listen(name, lambda: line.far):
        opening = asyncio.ensure_future(line.link.open(f"loop://{name}"))
        await asyncio.sleep(0.5)
        line.far.transport.abort()
        with pytest.raises(ConnectionLostError):
            await opening


async def test_opening_can_be_cancelled_and_leaves_nothing_open() -> None:
    name = unique_name()
    line = Line(ScriptedFarEnd(lambda text: None))
    with await listen(name, lambda: line.far), pytest.raises(TimeoutError):
        async with asyncio.timeout(0.5):
            await line.link.open(f"loop://{name}")
    await asyncio.sleep(0)
    assert line.far.is_lost
    assert not line.link.is_open


async def test_a_lost_line_fails_everything_that_waits_and_tells_it_once(line: Line) -> None:
    line.far.script = lambda text: None
    waiters = [line.ask("S1"), line.ask("S1"), line.ask("PA1", Lane.MOTION), line.ask("STOP", Lane.STOP)]
    await asyncio.sleep(0.1)
    line.far.transport.abort()
    failures = await asyncio.gather(*waiters, return_exceptions=True)
    assert all(isinstance(failure, ConnectionLostError) for failure in failures)
    assert [failure.sent for failure in failures if isinstance(failure, ConnectionLostError)] == [
        *("S1", None, None, None)
    ], "what was not sent is not said to be"
    assert len({id(failure) for failure in failures}) == 4, "each caller gets an error of its own"
    assert len(line.losses) == 1
    assert not line.link.is_open


async def test_a_lost_line_takes_no_exchange(line: Line) -> None:
    line.far.transport.abort()
    await asyncio.sleep(0.01)
    with pytest.raises(ConnectionLostError) as caught:
        await line.ask("PA100", Lane.MOTION)
    assert caught.value.sent is None
    assert "'PA100' was not sent" in str(caught.value)
    assert caught.value.device == "x"


async def test_closing_fails_everything_that_waits_and_is_no_loss(line: Line) -> None:
    line.far.script = lambda text: None
    waiters = [line.ask("S1"), line.ask("S2")]
    await asyncio.sleep(0.1)
    await line.link.close()
    failures = await asyncio.gather(*waiters, return_exceptions=True)
    assert [str(failure) for failure in failures] == [
        "x: the line is closed; sent 'S1'",
        "x: the line is closed, and 'S2' was not sent",
    ]
    assert line.losses == []
    assert line.far.is_lost


async def test_closing_twice_and_closing_what_was_never_open_is_harmless(line: Line) -> None:
    await asyncio.gather(line.link.close(), line.link.close())
    await line.link.close()
    await Line(ScriptedFarEnd()).link.close()


async def test_a_closed_line_leaves_no_timer_behind(line: Line) -> None:
    line.far.script = lambda text: None
    waiter = line.ask("S1")
    await line.link.close()
    await asyncio.gather(waiter, return_exceptions=True)
    before = line.link.stats.timeouts
    await asyncio.sleep(100)
    assert line.link.stats.timeouts == before
    assert line.far.lines == ["S1"], "and no marker"


async def test_counters_count(line: Line) -> None:
    await line.answer("S1")
    await line.answer("SD50", Lane.CONTROL)
    stats = line.link.stats
    assert (stats.exchanges, stats.timeouts, stats.resynchronisations, stats.late_answers) == (3, 0, 1, 0)
    assert stats.bytes_sent == len(b"S17\rS99\rS1\rSD50\r")
    assert stats.bytes_received == len(answer_to("S17", 17) + answer_to("S99", 99) + answer_to("S1", 1) + PROMPT)


async def test_the_last_exchanges_can_be_read(line: Line) -> None:
    await line.answer("S1")
    assert [entry.partition(" ")[2] for entry in line.link.recent()][-2:] == ["→ S1␍", "← S001: 1␍␊>"]
    for _ in range(100):
        await line.answer("S2")
    assert len(line.link.recent()) <= 24


async def test_every_byte_is_logged_where_that_is_wanted(line: Line, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.DEBUG, "compax_aio.link.wire"):
        await line.answer("S1")
    assert [record.getMessage() for record in caplog.records] == ["x → S1␍", "x ← S001: 1␍␊>"]


async def test_closing_is_bounded_though_the_transport_never_reports_its_end() -> None:
    line = Line(ScriptedFarEnd())
    DeafTransport(line.link)
    waiting = line.ask("S1")
    async with asyncio.timeout(5):
        await line.link.close()
    with pytest.raises(ConnectionLostError):
        await waiting


async def test_a_line_closed_while_it_is_opened_does_not_stay_open(monkeypatch: pytest.MonkeyPatch) -> None:
    name = unique_name()
    line = Line(ScriptedFarEnd())

    async def open_slowly(_: TransportURL, protocol_factory: ProtocolFactory) -> asyncio.Transport:
        await asyncio.sleep(1)
        return await open_loopback(TransportURL.parse(f"loop://{name}"), protocol_factory)

    monkeypatch.setitem(registry._openers, "slow", open_slowly)
    with await listen(name, lambda: line.far):
        opening = asyncio.ensure_future(line.link.open("slow://x"))
        await asyncio.sleep(0.5)
        await line.link.close()
        with pytest.raises(ConnectionLostError):
            await opening
    await asyncio.sleep(0.1)
    assert line.far.is_lost


async def test_a_transport_that_is_no_subclass_of_asyncios_serves_as_well() -> None:
    class ForeignTransport:
        """As those of other event loops are."""

        def __init__(self, protocol: asyncio.Protocol) -> None:
            self.protocol = protocol
            protocol.connection_made(self)  # type: ignore[arg-type]

        def write(self, data: bytes) -> None:
            self.written = data

        def get_write_buffer_size(self) -> int:
            return 0

        def close(self) -> None:
            self.protocol.connection_lost(None)

        abort = close

    line = Line(ScriptedFarEnd())
    assert ForeignTransport(line.link).written == b"S17\r"
    await line.link.close()
