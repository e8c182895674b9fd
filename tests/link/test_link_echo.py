"""The link with a protocol whose exchanges are made of steps and pauses, and whose line several parties share."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.link.lines import elapsed

from compax_aio.errors import AnswerTimeoutError, ConnectionLostError
from compax_aio.link.contract import Event, GoesOn, Hold, InStep, Lane, MarkerSpent, Stranger, TurnLost, TurnOver
from compax_aio.link.deadline import Deadline
from compax_aio.link.link import Link
from compax_aio.simulator.clock import VirtualClockLoop
from compax_aio.transports.loopback import create_pair

ECHO_S = 0.5
PAUSE_S = 0.2


class Echoed(TurnOver):
    """Every character came back."""


class Cut(TurnLost):
    """It was cut short by what went before everything."""


class WrongEcho(TurnLost):
    """Another character came back."""


class NoEcho(TurnLost):
    """No character came back."""


class EchoProtocol:
    """One character after the other; ``?`` after a pause brings it in step."""

    def __init__(self) -> None:
        self.in_doubt = True
        self.pausing = False
        self.held: Hold | None = None
        self.pauses = 1
        self._left = ""
        self._out = b""
        self._events: list[Event] = []
        self._pauses_left = 0
        self._ahead = ""

    @property
    def is_busy(self) -> bool:
        return bool(self._left) or self.pausing

    @property
    def patience_s(self) -> float | None:
        return PAUSE_S if self.pausing else ECHO_S

    def line_opened(self) -> None:
        self._give_up()

    def line_lost(self) -> None:
        self._give_up()

    def preempt(self, text: str) -> None:
        if self._left and not self.in_doubt:
            self._events.append(Cut())
        self._give_up()
        self._out += text.encode()
        self._pause("")

    def send(self, text: str) -> None:
        assert not self.in_doubt
        assert not self.is_busy
        self._type(text)

    def send_marker(self) -> None:
        assert self.in_doubt
        assert not self.is_busy
        self._pause("?")

    def send_ahead(self, text: str) -> None:
        assert self.in_doubt
        assert not self.is_busy
        self._pause(text)

    def time_ran_out(self) -> None:
        assert self.is_busy
        if not self.pausing:
            self._fail(NoEcho())
            return
        self._pauses_left -= 1
        if self._pauses_left <= 0:
            self.pausing = False
            self._type(self._ahead or "?")

    def resume(self) -> None:
        self.held = None

    def stranger(self, *, time_is_over: bool) -> Stranger | None:
        return None

    def bytes_to_send(self) -> bytes:
        out, self._out = self._out, b""
        return out

    def receive(self, data: bytes) -> None:
        for byte in data:
            if not self._left or self.pausing:
                continue
            if byte != ord(self._left[0]):
                self._fail(WrongEcho())
                continue
            self._left = self._left[1:]
            if self._left:
                self._out += self._left[0].encode()
                self._events.append(GoesOn())
            elif self.in_doubt:
                self.in_doubt = False
                self._events.append(InStep())
            else:
                self._events.append(Echoed())

    def events(self) -> list[Event]:
        events, self._events = self._events, []
        return events

    def _type(self, text: str) -> None:
        self._left = text
        self._out += text[0].encode()

    def _pause(self, then: str) -> None:
        self.pausing, self._pauses_left, self._ahead = True, self.pauses, then

    def _fail(self, outcome: TurnLost) -> None:
        was_doubt = self.in_doubt
        self._give_up()
        self._events.append(MarkerSpent() if was_doubt else outcome)

    def _give_up(self) -> None:
        self.in_doubt, self.pausing, self._left = True, False, ""


class EchoingEnd(asyncio.Protocol):
    """Sends each character back after *delay_s*, but for those that *swallow*."""

    def __init__(self) -> None:
        self.delay_s = 0.01
        self.heard = ""
        self.times: list[float] = []
        self.swallow = ""
        self.transport: asyncio.Transport

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport

    def data_received(self, data: bytes) -> None:
        loop = asyncio.get_running_loop()
        for character in data.decode():
            self.heard += character
            self.times.append(loop.time())
            if character in self.swallow:
                self.swallow = self.swallow.replace(character, "", 1)
            elif character != "!":
                loop.call_later(self.delay_s, self.transport.write, character.encode())


class EchoLine:
    """A link, the far end of its line, and what it has told."""

    def __init__(self, pauses: int = 1) -> None:
        self.far = EchoingEnd()
        self.protocol = EchoProtocol()
        self.protocol.pauses = pauses
        self.losses: list[ConnectionLostError] = []
        self.events: list[Event] = []
        self.link = Link(
            self.protocol,
            name="x",
            answer_timeout_s=99.0,
            resync_attempts=3,
            on_event=self.events.append,
            on_lost=self.losses.append,
        )
        create_pair(self.link, self.far, asyncio.get_running_loop())

    def tell(
        self, text: str, lane: Lane = Lane.CONTROL, party: str = "", *, settles_late: bool = False
    ) -> asyncio.Future[TurnOver]:
        return self.link.exchange(text, lane, party=party, settles_late=settles_late)


async def in_step() -> EchoLine:
    line = EchoLine()
    assert isinstance(await line.tell("0"), Echoed)
    line.far.heard = ""
    line.far.times.clear()
    return line


@pytest.fixture
async def line() -> AsyncIterator[EchoLine]:
    """A line in step whose far end takes 10 ms for an echo."""
    line = await in_step()
    yield line
    await line.link.close()


# Pauses and time -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("pauses", [1, 2, 5])
async def test_pauses_are_kept_before_the_first_character_that_is_answered(pauses: int) -> None:
    line = EchoLine(pauses)
    outcome, took_s = await elapsed(line.tell("ab"))
    assert isinstance(outcome, Echoed)
    assert took_s == pytest.approx(pauses * PAUSE_S + 0.03)
    assert line.far.heard == "?ab"
    assert line.far.times[0] == pytest.approx(pauses * PAUSE_S)
    assert line.link.stats.timeouts == 0, "a pause is none"
    await line.link.close()


async def test_each_echo_gives_the_rest_its_time_anew(line: EchoLine) -> None:
    line.far.delay_s = 0.9 * ECHO_S
    outcome, took_s = await elapsed(line.tell("abcdefgh"))
    assert isinstance(outcome, Echoed)
    assert took_s == pytest.approx(8 * 0.9 * ECHO_S)
    assert line.link.stats.timeouts == 0


@pytest.mark.parametrize("place", range(4))
async def test_an_echo_that_is_missing_is_waited_for_no_longer_than_one_takes(line: EchoLine, place: int) -> None:
    line.far.swallow = "abcd"[place]
    outcome, took_s = await elapsed(line.tell("abcd"))
    assert isinstance(outcome, NoEcho)
    assert took_s == pytest.approx(place * 0.01 + ECHO_S)
    assert line.link.stats.lost_turns == 1
    assert line.link.stats.timeouts == 0
    assert line.far.heard == "abcd"[: place + 1]
    assert isinstance(await line.tell("e"), Echoed)
    assert line.far.heard == "abcd"[: place + 1] + "?e"


async def test_the_time_of_an_answer_counts_from_the_first_character_to_the_last_echo(line: EchoLine) -> None:
    line.link.stats.answer_times_s.clear()
    await line.tell("abcde")
    assert list(line.link.stats.answer_times_s) == pytest.approx([0.05])
    line.far.swallow = "b"
    await line.tell("ab")
    assert len(line.link.stats.answer_times_s) == 1, "of a turn that was lost there is none"


async def test_the_history_joins_the_characters_of_a_command(line: EchoLine) -> None:
    await line.tell("first")
    await line.tell("second")
    sent = [each.partition(" → ")[2] for each in line.link.recent() if "→" in each]
    assert sent[-2:] == ["first", "second"]
    heard = [each.partition(" ← ")[2] for each in line.link.recent() if "←" in each]
    assert heard[-2:] == ["first", "second"]


async def test_a_far_end_that_is_silent_costs_bounded_time(line: EchoLine) -> None:
    line.far.swallow = "a???" * 9
    outcome, _ = await elapsed(line.tell("a"))
    assert isinstance(outcome, NoEcho)
    failure, took_s = await elapsed(line.tell("b"))
    assert isinstance(failure, AnswerTimeoutError)
    assert took_s <= 3 * (PAUSE_S + ECHO_S) + 0.01
    line.far.swallow = ""
    assert isinstance(await line.tell("c"), Echoed)


async def test_a_deadline_that_is_put_off_again_and_again_comes_once() -> None:
    times: list[float] = []
    loop = asyncio.get_running_loop()
    deadline = Deadline(lambda: times.append(loop.time()))
    deadline.put_off(1.0)
    for _ in range(5):
        await asyncio.sleep(0.9)
        deadline.put_off(1.0)
    assert times == []
    await asyncio.sleep(10)
    assert times == [pytest.approx(5.5)]


async def test_a_deadline_can_be_put_nearer_and_be_called_off() -> None:
    times: list[float] = []
    loop = asyncio.get_running_loop()
    deadline = Deadline(lambda: times.append(loop.time()))
    deadline.put_off(10.0)
    deadline.put_off(0.5)
    await asyncio.sleep(20)
    assert times == [pytest.approx(0.5)], "and not at the time that was given first"
    deadline.put_off(1.0)
    deadline.cancel()
    deadline.cancel()
    await asyncio.sleep(20)
    assert len(times) == 1
    deadline.put_off(1.0)
    await asyncio.sleep(20)
    assert times[1:] == [pytest.approx(41.0)]


# Parties -------------------------------------------------------------------------------------------------------------


async def test_parties_take_turns_in_a_lane_and_each_ones_exchanges_keep_their_order(line: EchoLine) -> None:
    waiters = [line.tell("0")]
    waiters += [line.tell(text, party="x") for text in "abcd"]
    waiters += [line.tell(text, party="y") for text in "kl"]
    waiters += [line.tell(text, party="z") for text in "s"]
    await asyncio.gather(*waiters)
    assert line.far.heard == "0" + "aks" + "bl" + "cd"


async def test_a_party_that_comes_again_stands_behind_the_others(line: EchoLine) -> None:
    line.tell("0")
    line.tell("a", party="x")
    last = line.tell("k", party="y")
    await asyncio.sleep(0.012)
    line.tell("b", party="x")
    await last
    await line.tell("z", party="z")
    assert line.far.heard == "0akbz"


async def test_a_lane_goes_before_a_turn(line: EchoLine) -> None:
    line.tell("0")
    line.tell("a", Lane.READ, party="x")
    line.tell("b", Lane.MOTION, party="x")
    await asyncio.gather(line.tell("c", Lane.CONTROL, party="x"), line.tell("d", Lane.STOP, party="y"))
    await line.tell("e", Lane.READ, party="z")
    assert line.far.heard == "0dcbae"


@pytest.mark.parametrize("lane", list(Lane))
async def test_a_party_that_is_held_waits_and_the_others_go_on(line: EchoLine, lane: Lane) -> None:
    line.link.hold("x")
    held = line.tell("a", lane, party="x")
    await line.tell("k", lane, party="y")
    await asyncio.sleep(100)
    assert not held.done()
    assert line.far.heard == "k"
    line.link.release("x")
    line.link.release("x")
    await held
    assert line.far.heard == "ka"


async def test_an_exchange_on_the_wire_goes_on_though_its_party_is_held(line: EchoLine) -> None:
    first, second = line.tell("ab", party="x"), line.tell("cd", party="x")
    await asyncio.sleep(0.005)
    line.link.hold("x")
    await first
    await asyncio.sleep(1)
    assert not second.done()
    assert line.far.heard == "ab"
    line.link.release("x")
    await second


async def test_a_held_party_does_not_keep_the_line_from_getting_in_step(line: EchoLine) -> None:
    line.link.hold("x")
    held = line.tell("@", Lane.STOP, party="x")
    line.far.swallow = "a"
    await line.tell("ab", party="y")
    await line.tell("c", party="y")
    assert line.far.heard == "a?c", "its stop does not go ahead, either"
    line.link.release("x")
    await held


async def test_what_a_held_party_has_to_say_fails_with_the_line(line: EchoLine) -> None:
    line.link.hold("x")
    held = line.tell("a", party="x")
    line.far.transport.abort()
    with pytest.raises(ConnectionLostError):
        await held
    line.link.release("x")
    assert line.far.heard == ""


# Stops and what goes before everything -------------------------------------------------------------------------------


async def test_a_stop_is_first_after_the_exchange_in_flight_whoever_asks(line: EchoLine) -> None:
    waiters = [line.tell("abc", party="x"), *(line.tell("d", party=party) for party in "xyz")]
    await asyncio.sleep(0.015)
    await line.tell("@", Lane.STOP, party="y")
    await asyncio.gather(*waiters)
    assert line.far.heard == "abc@ddd"


async def test_a_stop_goes_ahead_of_the_markers(line: EchoLine) -> None:
    line.far.swallow = "a"
    lost = line.tell("a")
    stop = line.tell("@", Lane.STOP)
    await lost
    await stop
    assert line.far.heard == "a@@", "once to get in step with, once in its turn"


@pytest.mark.parametrize("after_s", [0.0, 0.005, 0.015, 0.0301])
async def test_what_goes_before_everything_cuts_the_exchange_short(line: EchoLine, after_s: float) -> None:
    cut, waiting = line.tell("abcd"), line.tell("e")
    await asyncio.sleep(after_s)
    heard = line.far.heard
    line.link.preempt("!")
    assert isinstance(await cut, Cut)
    await waiting
    assert line.far.heard in {heard + "!?e", "a!?e"}
    assert line.link.stats.lost_turns == 1
    assert line.link.stats.timeouts == 0


async def test_a_preemption_gives_its_pause_and_no_more(line: EchoLine) -> None:
    line.link.preempt("!")
    outcome, took_s = await elapsed(line.tell("a"))
    assert isinstance(outcome, Echoed)
    assert took_s == pytest.approx(PAUSE_S + 0.02)


async def test_a_preemption_while_in_doubt_begins_the_doubt_anew(line: EchoLine) -> None:
    line.far.swallow = "a??"
    await line.tell("a")
    waiting = line.tell("b")
    await asyncio.sleep(2 * (PAUSE_S + ECHO_S) + 0.1)
    line.link.preempt("!")
    line.far.swallow = "??"
    assert isinstance(await waiting, Echoed), "it had all its attempts again"
    assert line.far.heard == "a??!???b"


async def test_preempting_twice_is_no_worse_than_once(line: EchoLine) -> None:
    waiting = line.tell("abc")
    line.link.preempt("!")
    line.link.preempt("!")
    assert isinstance(await waiting, Cut)
    assert isinstance(await line.tell("d"), Echoed)
    assert line.far.heard.endswith("!!?d")


async def test_nothing_can_preempt_on_a_line_that_is_not_there(line: EchoLine) -> None:
    line.far.transport.abort()
    await asyncio.sleep(0.01)
    with pytest.raises(ConnectionLostError):
        line.link.preempt("!")
    fresh = Link(EchoProtocol(), name="y", answer_timeout_s=1, resync_attempts=1, on_event=print, on_lost=print)
    with pytest.raises(ConnectionLostError):
        fresh.preempt("!")
    closed = await in_step()
    await closed.link.close()
    with pytest.raises(ConnectionLostError):
        closed.link.preempt("!")


# A loss --------------------------------------------------------------------------------------------------------------


class TellingProtocol(EchoProtocol):
    """One that has something to say of a line that is lost."""

    def line_lost(self) -> None:
        if self._left:
            self._events.append(Event())
        super().line_lost()


async def test_what_a_protocol_says_of_a_loss_is_heard_before_the_losers_are_told(line: EchoLine) -> None:
    line.protocol.__class__ = TellingProtocol
    seen: list[int] = []
    waiting = line.tell("abc")
    waiting.add_done_callback(lambda _: seen.append(len(line.events)))
    await asyncio.sleep(0.005)
    line.far.transport.abort()
    with pytest.raises(ConnectionLostError):
        await waiting
    assert seen == [1]


# Whatever comes ------------------------------------------------------------------------------------------------------


def _does(line: EchoLine, kind: str, argument: str, waiters: list[asyncio.Future[TurnOver]]) -> None:
    """Do one thing to a line that takes no time."""
    if kind == "swallow":
        line.far.swallow += argument
    elif kind == "noise":
        line.far.transport.write(argument.encode())
    elif kind == "preempt":
        line.link.preempt("!")
    elif kind == "hold":
        line.link.hold(argument)
    elif kind == "release":
        line.link.release(argument)
    elif waiters:
        waiters[len(waiters) // 2].cancel()


_TELLING = st.tuples(st.sampled_from(["a", "bc", "defg"]), st.sampled_from(list(Lane)), st.sampled_from("xyz"))
_DOING = st.one_of(
    st.tuples(st.just("swallow"), st.sampled_from("abcdefg?@")),
    st.tuples(st.just("noise"), st.sampled_from(["z", "a", "??"])),
    st.tuples(st.sampled_from(["preempt", "cancel"]), st.just("")),
    st.tuples(st.sampled_from(["hold", "release"]), st.sampled_from("xyz")),
)
_WAITING = st.sampled_from([0.0, 0.004, 0.01, 0.03, 0.2, 0.6])


@settings(max_examples=80, deadline=None)
@given(steps=st.lists(_TELLING | _DOING | _WAITING, max_size=25))
def test_whatever_happens_everything_settles_and_the_line_works_afterwards(
    steps: list[tuple[str, Lane, str] | tuple[str, str] | float],
) -> None:
    async def main() -> None:
        line = await in_step()
        waiters: list[asyncio.Future[TurnOver]] = []
        for step in steps:
            if isinstance(step, float):
                await asyncio.sleep(step)
            elif len(step) == 3:
                waiters.append(line.tell(*step))
            else:
                _does(line, *step, waiters)
        for party in "xyz":
            line.link.release(party)
        async with asyncio.timeout(200):
            outcomes = await asyncio.gather(*waiters, return_exceptions=True)
        kinds = (Echoed, Cut, WrongEcho, NoEcho, AnswerTimeoutError, asyncio.CancelledError)
        assert all(isinstance(outcome, kinds) for outcome in outcomes)
        line.far.swallow = ""
        for _ in range(3):  # what is left of noise may spoil the first
            await asyncio.sleep(1)
            last = await line.tell("g")
        assert isinstance(last, Echoed)
        assert not line.protocol.in_doubt
        await line.link.close()

    with asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
        runner.run(main())
