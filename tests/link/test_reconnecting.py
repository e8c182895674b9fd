"""What a line does while it is lost and when it is back, step by step, on fakes."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from random import Random
from types import SimpleNamespace
from typing import Any, cast

import pytest
from tests.fakes.answers import as_drive

from compax_aio.compax.protocol import Answered, CompaxProtocol, MessageForm
from compax_aio.errors import CompaxError, ConnectionLostError, TransportError, UnexpectedAnswerError
from compax_aio.link.contract import Lane, TurnOver
from compax_aio.link.exchanges import Exchange
from compax_aio.link.link import Link
from compax_aio.link.port import Port
from compax_aio.link.reconnecting import Backoff, Reconnecting, Restored
from compax_aio.link.seldom import Seldom
from compax_aio.link.stats import LinkStats
from compax_aio.link.telling import Telling
from compax_aio.link.wire import WireHistory
from compax_aio.transports import registry
from compax_aio.transports.registry import ProtocolFactory
from compax_aio.transports.url import TransportURL

FIRST_S, SLOWEST_S = 1.0, 8.0


class Wire(asyncio.Transport):
    """One connection; it answers as *script* says, and tells its end unless it is *deaf*."""

    def __init__(self, script: Callable[[str], bytes | None] = as_drive, *, deaf: bool = False) -> None:
        super().__init__()
        self.script = script
        self.deaf = deaf
        self.lines: list[str] = []
        self.is_ended = False
        self.protocol: asyncio.Protocol
        self._loop = asyncio.get_running_loop()

    def take(self, protocol: asyncio.Protocol) -> None:
        self.protocol = protocol
        protocol.connection_made(self)

    def get_write_buffer_size(self) -> int:
        return 0

    def write(self, data: bytes | bytearray | memoryview) -> None:
        for line in bytes(data).decode().split("\r")[:-1]:
            self.lines.append(line)
            if (answer := self.script(line)) is not None:
                self._loop.call_soon(self.protocol.data_received, answer)

    def close(self) -> None:
        self.abort()

    def abort(self) -> None:
        if not self.is_ended:
            self.is_ended = True
            if not self.deaf:
                self._loop.call_soon(self.protocol.connection_lost, None)


class Lines:
    """What ``odd://`` opens: what is planned, in order, then lines that are well; and a link that uses it."""

    def __init__(self) -> None:
        self.plans: list[Wire | Exception] = []
        self.opened: list[Wire] = []
        self.tried = 0
        self.told: list[Restored] = []
        self.downs: list[ConnectionLostError] = []
        self.greet: Callable[[], Awaitable[None]] | None = None
        self.link: Link

    async def open(self, _: TransportURL, factory: ProtocolFactory) -> asyncio.Transport:
        self.tried += 1
        plan = self.plans.pop(0) if self.plans else Wire()
        if isinstance(plan, Exception):
            raise plan
        self.opened.append(plan)
        plan.take(factory())
        return plan

    async def connect(self, *, patience_s: float = 100.0, answer_timeout_s: float = 1.0) -> Link:
        async def greet() -> None:
            if self.greet is not None:
                await self.greet()

        backoff = Backoff(first_s=FIRST_S, slowest_s=SLOWEST_S, attempts=None)
        self.link = Link(
            CompaxProtocol(MessageForm.PROMPT_FIRST),
            name="x",
            answer_timeout_s=answer_timeout_s,
            resync_attempts=3,
            on_event=lambda _: None,
            on_lost=lambda _: None,
            greet=greet,
            reconnecting=Reconnecting("x", backoff, patience_s, self.downs.append, self.told.append),
        )
        await self.link.open("odd://x")
        return self.link

    def ask(self, text: str = "S1", lane: Lane = Lane.READ) -> asyncio.Future[TurnOver]:
        return self.link.exchange(text, lane, survives_loss=True)

    async def back(self, wires: int) -> None:
        """Wait until the link uses the line that was opened as the *wires*-th."""
        await until(lambda: len(self.opened) >= wires and self.link.is_open)


@pytest.fixture
def lines(monkeypatch: pytest.MonkeyPatch) -> Lines:
    lines = Lines()
    monkeypatch.setitem(registry._openers, "odd", lines.open)
    return lines


async def failing_greeting() -> None:
    raise UnexpectedAnswerError("another drive", device="x")


def now() -> float:
    return asyncio.get_running_loop().time()


async def until(condition: Callable[[], bool]) -> None:
    while not condition():  # noqa: ASYNC110  # what is waited for has no event
        await asyncio.sleep(0.001)


# The link -------------------------------------------------------------------------------------------------------------


async def test_a_line_that_is_refused_is_closed_before_the_next_attempt(lines: Lines) -> None:
    link = await lines.connect()
    lines.greet = failing_greeting
    lines.opened[0].abort()
    await until(lambda: len(lines.opened) == 2)
    await asyncio.sleep(0.05)
    assert len(lines.opened) == 2
    assert lines.opened[1].is_ended
    await link.close()


async def test_what_was_asked_after_patience_was_lost_fails_with_the_next_attempt(lines: Lines) -> None:
    link = await lines.connect(patience_s=20.0)
    lines.plans += [TransportError("no such port", device="x") for _ in range(50)]
    lines.opened[0].abort()
    await asyncio.sleep(25)
    tried, reading = lines.tried, lines.ask()
    await until(lambda: reading.done() or lines.tried == tried + 3)
    assert lines.tried == tried + 1
    assert isinstance(reading.exception(), ConnectionLostError)
    await link.close()


async def test_nothing_of_the_greeting_waits_for_another_line(lines: Lines) -> None:
    link = await lines.connect()
    lines.opened[0].script = lambda _: None
    outstanding = lines.ask("S31", Lane.GREETING)
    lines.opened[0].abort()
    await asyncio.sleep(0.01)
    assert isinstance(outstanding.exception(), ConnectionLostError)
    assert isinstance(lines.ask("S32", Lane.GREETING).exception(), ConnectionLostError)
    await lines.back(2)
    assert not {"S31", "S32"} & set(lines.opened[1].lines)
    await link.close()


async def test_a_line_that_is_there_only_after_the_link_was_closed_is_hung_up(
    lines: Lines, monkeypatch: pytest.MonkeyPatch
) -> None:
    link = await lines.connect()
    late = Wire()

    async def open_in_a_thread(_: TransportURL, protocol_factory: ProtocolFactory) -> asyncio.Transport:
        asyncio.get_running_loop().call_later(5.0, late.take, protocol_factory())
        await asyncio.sleep(100)
        return late

    monkeypatch.setitem(registry._openers, "odd", open_in_a_thread)
    lines.opened[0].abort()
    await asyncio.sleep(FIRST_S + 1)
    await link.close()
    await asyncio.sleep(10)
    assert late.is_ended
    assert late.lines == []


async def test_reads_that_were_held_back_on_a_lost_line_go_at_once_on_the_next(lines: Lines) -> None:
    link = await lines.connect()
    link.hold_reads(50.0)
    reading = lines.ask()
    lines.opened[0].abort()
    await lines.back(2)
    await asyncio.sleep(0.01)
    assert reading.done()
    await link.close()


async def test_a_line_that_keeps_silent_while_it_is_opened_is_not_opened_twice_at_once(lines: Lines) -> None:
    link = await lines.connect(patience_s=20.0, answer_timeout_s=5.0)
    lines.plans.append(Wire(lambda _: None))
    lines.opened[0].abort()
    await until(lambda: len(lines.opened) == 2)
    asked: list[asyncio.Future[TurnOver]] = []
    telling = link.exchange("V1=3", Lane.CONTROL)
    telling.add_done_callback(lambda _: asked.append(lines.ask()))
    await lines.back(3)
    await asyncio.sleep(30)
    assert isinstance(telling.exception(), CompaxError)
    assert isinstance(asked[0].result(), Answered)
    assert len(lines.opened) == 3
    assert len(lines.downs) == len(lines.told) == 1
    await link.close()


async def test_a_line_that_led_nowhere_is_opened_anew_at_once_and_told_as_lost_once(lines: Lines) -> None:
    link = await lines.connect(patience_s=20.0)
    lines.opened[0].script = lambda _: None
    while link._silence.error is None:
        assert isinstance(await failure_of(lines.ask()), CompaxError)
    begun_at = now()
    reading = lines.ask()
    assert isinstance(await reading, Answered)
    assert now() - begun_at < 0.1
    assert len(lines.downs) == len(lines.told) == link.stats.reconnects == 1
    await link.close()


async def test_a_transport_that_never_reports_its_end_is_waited_for_once(
    lines: Lines, caplog: pytest.LogCaptureFixture
) -> None:
    link = await lines.connect(answer_timeout_s=10.0)
    lines.plans.append(Wire(lambda line: None if line == "S31" else as_drive(line), deaf=True))

    async def greet() -> None:
        if len(lines.opened) == 2:
            link.exchange("S31", Lane.GREETING).add_done_callback(lambda each: each.cancelled() or each.exception())
            await asyncio.sleep(0.01)
            raise UnexpectedAnswerError("another drive", device="x")

    lines.greet = greet
    lines.opened[0].abort()
    lost_at = now()
    await lines.back(3)
    assert now() - lost_at < 10
    assert link.stats.timeouts == 0
    assert caplog.text.count("did not report its end") == 1
    await link.close()


async def failure_of(work: Awaitable[Any]) -> BaseException | None:
    return (await asyncio.gather(work, return_exceptions=True))[0]


# What waits -----------------------------------------------------------------------------------------------------------


def test_what_was_on_a_line_that_is_lost_is_still_said_to_have_been_sent() -> None:
    exchange = Exchange("STOP", Lane.STOP, is_on_wire=True, is_late=True, received="half")
    exchange.begin_anew()
    assert (exchange.is_on_wire, exchange.is_late, exchange.received) == (True, False, None)


async def test_those_that_have_given_up_are_forgotten_and_nobody_else() -> None:
    loop = asyncio.get_running_loop()
    waiting = loop.create_future()
    exchange = Exchange("S1", Lane.READ, waiters=[waiting])
    for _ in range(1000):
        given_up = loop.create_future()
        given_up.cancel()
        exchange.add_waiters([given_up])
        assert len(exchange.waiters) < 50
    exchange.end(TurnOver())
    assert waiting.done()


# Attempts -------------------------------------------------------------------------------------------------------------


class FakeLine:
    """A lost line that is back when *failures* attempts have failed; it keeps what is done to it, and when."""

    def __init__(self, failures: int = 0) -> None:
        self.failures = failures
        self.done: list[str] = []
        self.times: list[float] = []
        self.takes_s = 0.0
        self.tidies_s = 0.0

    async def reopen(self) -> None:
        self.times.append(now())
        try:
            await asyncio.sleep(self.takes_s)
        finally:
            await asyncio.sleep(self.tidies_s)
            self.done.append("reopened")
        if self.failures:
            self.failures -= 1
            raise TransportError("no such port", device="x")

    def admit(self) -> None:
        self.done.append("admitted")

    def lose_patience(self) -> None:
        self.done.append("patience lost")

    def give_up(self, error: CompaxError) -> None:
        self.done.append("given up")


def reconnecting_of(line: FakeLine, *, patience_s: float = 1000.0, attempts: int | None = None) -> Reconnecting:
    return Reconnecting(
        "x",
        Backoff(first_s=FIRST_S, slowest_s=SLOWEST_S, attempts=attempts),
        patience_s,
        lambda _: line.done.append("down"),
        lambda _: line.done.append("restored"),
    )


LOSS = ConnectionLostError("the line was lost", device="x")


async def pause_after(reconnecting: Reconnecting, line: FakeLine, *, at_once: bool = False) -> float:
    """Lose the line; return when the first attempt came."""
    begun_at, before = now(), len(line.times)
    reconnecting.begin(line, LOSS, at_once=at_once)
    await until(lambda: "admitted" in line.done)
    line.done.clear()
    return line.times[before] - begun_at


async def test_the_return_is_told_before_what_waits_goes() -> None:
    line = FakeLine()
    reconnecting_of(line).begin(line, LOSS, at_once=True)
    await asyncio.sleep(1)
    assert line.done == ["down", "reopened", "restored", "admitted"]


async def test_a_line_that_was_well_for_long_is_tried_soon_and_one_that_flaps_ever_more_rarely() -> None:
    line = FakeLine()
    reconnecting = reconnecting_of(line)
    await asyncio.sleep(SLOWEST_S)
    for at_most_s in (1.0, 2.0, 4.0, 8.0, 8.0):
        assert at_most_s / 2 <= await pause_after(reconnecting, line) <= at_most_s + 0.01
    await asyncio.sleep(SLOWEST_S)
    assert await pause_after(reconnecting, line) <= FIRST_S + 0.01


async def test_a_line_that_is_to_be_tried_at_once_is() -> None:
    line = FakeLine()
    assert await pause_after(reconnecting_of(line), line, at_once=True) == 0
    assert await pause_after(reconnecting_of(line), line) >= FIRST_S / 2


async def test_only_the_first_attempt_comes_at_once() -> None:
    line = FakeLine(failures=1)
    await pause_after(reconnecting_of(line), line, at_once=True)
    assert line.times[1] - line.times[0] >= 1.0


async def test_patience_is_lost_once_while_the_line_is_lost_and_begins_anew_when_it_is_back() -> None:
    line = FakeLine(failures=4)
    reconnecting = reconnecting_of(line, patience_s=2.0)
    await pause_after(reconnecting, line)
    patient = [reconnecting.is_patient]
    await asyncio.sleep(10)
    assert line.done == []
    line.failures = 4
    reconnecting.begin(line, LOSS, at_once=True)
    await asyncio.sleep(2.5)
    patient.append(reconnecting.is_patient)
    assert patient == [True, False]
    assert line.done.count("patience lost") == 1
    await reconnecting.end()


async def test_a_line_that_is_back_in_time_costs_no_patience_later() -> None:
    line = FakeLine()
    reconnecting = reconnecting_of(line, patience_s=2.0)
    await pause_after(reconnecting, line)
    await asyncio.sleep(10)
    assert line.done == []
    assert reconnecting.is_patient


async def test_no_patience_is_lost_with_a_line_that_was_given_up() -> None:
    line = FakeLine(failures=5)
    reconnecting_of(line, patience_s=50.0, attempts=2).begin(line, LOSS, at_once=True)
    await asyncio.sleep(100)
    assert line.done == ["down", "reopened", "reopened", "given up"]


async def test_the_end_waits_until_the_attempt_has_tidied_up_and_nothing_comes_after_it() -> None:
    line = FakeLine()
    line.takes_s, line.tidies_s = 5.0, 0.5
    reconnecting = reconnecting_of(line, patience_s=2.0)
    reconnecting.begin(line, LOSS, at_once=True)
    await asyncio.sleep(1)
    await reconnecting.end()
    assert line.done == ["down", "reopened"]
    await asyncio.sleep(100)
    assert line.done == ["down", "reopened"]


def test_a_first_pause_that_is_longer_than_the_slowest_is_cut() -> None:
    pauses_s = Backoff(first_s=9.0, slowest_s=3.0, attempts=None).pauses_s(Random(1))
    assert all(1.5 <= next(pauses_s) <= 3.0 for _ in range(20))


# Logging --------------------------------------------------------------------------------------------------------------


async def test_the_same_kind_of_thing_is_told_once_until_it_was_quiet_for_an_hour(
    caplog: pytest.LogCaptureFixture,
) -> None:
    seldom = Seldom(logging.getLogger("compax_aio.link"), "x")

    def level_of(level: int, message: str, *args: object) -> tuple[int, str]:
        caplog.clear()
        seldom.tell(level, message, *args)
        (record,) = caplog.records
        return record.levelno, record.getMessage()

    with caplog.at_level(logging.DEBUG, "compax_aio.link"):
        assert level_of(logging.WARNING, "no answer to %r", "S1") == (logging.WARNING, "x: no answer to 'S1'")
        assert level_of(logging.WARNING, "no answer to %r", "S2") == (logging.DEBUG, "x: no answer to 'S2'")
        assert level_of(logging.INFO, "back")[0] == logging.INFO
        await asyncio.sleep(3599)
        assert level_of(logging.WARNING, "no answer to %r", "S1")[0] == logging.DEBUG
        await asyncio.sleep(1800)
        assert level_of(logging.WARNING, "no answer to %r", "S1")[0] == logging.DEBUG, "it was not quiet in between"
        await asyncio.sleep(3600)
        assert level_of(logging.WARNING, "no answer to %r", "S1")[0] == logging.WARNING


# Pieces ---------------------------------------------------------------------------------------------------------------


class Tap:
    """A transport of which only reading counts."""

    def __init__(self) -> None:
        self.calls: list[str] = []

    def pause_reading(self) -> None:
        self.calls.append("pause")

    def resume_reading(self) -> None:
        self.calls.append("resume")


@pytest.fixture
def flood() -> SimpleNamespace:
    """Give a port whose transport pauses and resumes, and what was read, with the time."""
    return SimpleNamespace(tap=Tap(), read=[], data=bytes(range(200)))


def port_of(tap: Tap) -> Port:
    port = Port("x", LinkStats(), WireHistory(), Telling("x"))
    port.opened(cast("asyncio.Transport", tap))
    return port


async def test_much_at_once_is_read_in_order_and_in_pieces_while_nothing_more_is_taken(flood: SimpleNamespace) -> None:
    port = port_of(flood.tap)
    begun_at = now()
    port.received(flood.data, lambda piece, at: flood.read.append((piece, at - begun_at)))
    assert flood.tap.calls == ["pause"]
    port.received(b"more", lambda piece, at: flood.read.append((piece, at - begun_at)))
    assert len(flood.read) == 1
    await asyncio.sleep(1)
    assert b"".join(piece for piece, _ in flood.read) == flood.data + b"more"
    assert [len(piece) for piece, _ in flood.read] == [64, 64, 64, 12]
    assert [at for _, at in flood.read] == pytest.approx([0, 0.001, 0.002, 0.003])
    assert flood.tap.calls == ["pause", "resume"]


async def test_little_is_read_at_once_without_a_pause(flood: SimpleNamespace) -> None:
    port = port_of(flood.tap)
    port.received(flood.data[:64], lambda piece, _: flood.read.append(piece))
    assert flood.read == [flood.data[:64]]
    assert flood.tap.calls == []


async def test_what_is_not_read_yet_is_not_read_on_the_next_line(flood: SimpleNamespace) -> None:
    port = port_of(flood.tap)
    port.received(flood.data, lambda piece, _: flood.read.append(piece))
    port.ended()
    await asyncio.sleep(0.0005)
    other = Tap()
    port.opened(cast("asyncio.Transport", other))
    port.received(b"new", lambda piece, _: flood.read.append(piece))
    await asyncio.sleep(1)
    assert flood.read == [flood.data[:64], b"new"]
    assert flood.tap.calls == ["pause"]
    assert other.calls == []


@pytest.mark.parametrize("pieces", [1, 2])
async def test_a_line_that_is_lost_by_what_is_read_is_not_read_on(pieces: int, flood: SimpleNamespace) -> None:
    port = port_of(flood.tap)

    def read(piece: bytes, _: float) -> None:
        flood.read.append(piece)
        if len(flood.read) == pieces:
            port.ended()

    port.received(flood.data[:128], read)
    await asyncio.sleep(1)
    assert flood.read == [flood.data[:64], flood.data[64:128]][:pieces]
    assert flood.tap.calls == ["pause"]
