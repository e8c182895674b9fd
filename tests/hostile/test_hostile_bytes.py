"""Whatever comes: it is read in little time and memory, and a line works again when sense returns."""

from __future__ import annotations

import asyncio
import re
import time
import tracemalloc
from collections.abc import Callable, Coroutine
from contextlib import suppress
from decimal import Decimal
from functools import partial
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from tests.hostile.garbage import WORST, chunks, garbage
from tests.hostile.wicked import refusal
from tests.promises.bench import watch_what_is_left_behind

import compax_aio
from compax_aio import Drive, DriveSettings
from compax_aio.compax import codecs
from compax_aio.compax.facts.line import ERROR_PATTERN
from compax_aio.compax.ledger import Ledger
from compax_aio.compax.program import check, normalise, parse, parse_record
from compax_aio.compax.program.records import End
from compax_aio.compax.program.shown import compare, may_be_cut, read_shown
from compax_aio.compax.protocol import CompaxProtocol
from compax_aio.errors import CompaxError, InvalidCommandError, LinkProtocolError, TransportError, UnexpectedAnswerError
from compax_aio.link.wire import WireHistory
from compax_aio.simulator.clock import VirtualClockLoop
from compax_aio.simulator.compax import Knobs, SimulatedDrive
from compax_aio.simulator.line import Connection, DeviceLine
from compax_aio.transports.loopback import listen
from compax_aio.transports.url import TransportURL

KIB = 1024


def cpu_s(work: Callable[[], object], times: int = 3) -> float:
    """Return the processor time of *work*, the shortest of several."""

    def once() -> float:
        begun_at = time.process_time()
        work()
        return time.process_time() - begun_at

    return min(once() for _ in range(times))


# The protocol ---------------------------------------------------------------------------------------------------------

DOORS: dict[str, Callable[[CompaxProtocol], object]] = {
    "send S1": lambda protocol: protocol.send("S1"),
    "send PA": lambda protocol: protocol.send("PA5$"),
    "send AL": lambda protocol: protocol.send("AL 100"),
    "marker": CompaxProtocol.send_marker,
    "ahead": lambda protocol: protocol.send_ahead("STOP"),
    "time": CompaxProtocol.time_ran_out,
    "opened": CompaxProtocol.line_opened,
    "resume": CompaxProtocol.resume,
}
doings = st.lists(st.sampled_from(sorted(DOORS)) | garbage, max_size=25)


@given(doings=doings)
@settings(max_examples=500)
def test_a_protocol_bears_whatever_comes_whenever_it_comes(doings: list[str | bytes]) -> None:
    protocol = CompaxProtocol()
    protocol.line_opened()
    for doing in doings:
        if isinstance(doing, bytes):
            protocol.receive(doing)
        else:
            said = refusal(lambda doing=doing: DOORS[doing](protocol), LinkProtocolError)  # type: ignore[misc]
            assert said is None or "not possible while" in said
        sent = protocol.bytes_to_send()
        assert re.fullmatch(rb"((S[0-9]+|PA5\$|AL 100|STOP)\r)*", sent), sent
        assert all(repr(event).isprintable() for event in protocol.events())


@given(data=garbage, cuts=st.lists(st.integers(1, 60), min_size=1, max_size=20))
@settings(max_examples=200)
def test_a_protocol_in_doubt_survives_every_cut_and_gets_in_step_by_its_marker(data: bytes, cuts: list[int]) -> None:
    protocol = CompaxProtocol()
    protocol.line_opened()
    for cut in cuts:
        protocol.receive(data[:cut])
        data = data[cut:]
    protocol.receive(data)
    for _ in range(3):  # noise before the answer may spoil one
        protocol.send_marker()
        marker = protocol.bytes_to_send().rstrip(b"\r")
        protocol.receive(b"\r\n" + marker + b": 1\r\n>")
        if not protocol.in_doubt:
            break
        if protocol.is_busy:
            protocol.time_ran_out()
    assert not protocol.in_doubt


@pytest.mark.parametrize("unit", WORST, ids=lambda unit: repr(unit[:12]))
@pytest.mark.parametrize("unanswered", [0, 2000])
def test_reading_takes_no_longer_a_byte_if_there_is_more(unit: bytes, unanswered: int) -> None:
    def read(size: int) -> Callable[[], object]:
        protocol = CompaxProtocol()
        protocol.line_opened()
        for _ in range(unanswered):
            protocol.send_marker()
            protocol.time_ran_out()
        protocol.send_ahead("PA5$")
        protocol.time_ran_out()
        data = unit * (size // len(unit))

        def work() -> None:
            protocol.receive(data)
            protocol.events()

        return work

    small, large = cpu_s(read(4 * KIB)), cpu_s(read(16 * KIB))
    assert large < max(10 * small, 0.2), "four times as much: 4 if it is linear, 16 if it is quadratic"
    assert large < 2.0


def test_many_unanswered_lines_are_searched_no_longer_than_few() -> None:
    def searching(count: int) -> Callable[[], object]:
        ledger = Ledger()
        for number in range(count):
            ledger.note(f"S{number % 250}", b"")
        ledger.note("PA5$", b"")
        ledger.note("PA6$", b"")
        return lambda: [(ledger.asked(("S", "251")), ledger.owed_message(), ledger.only_command) for _ in range(500)]

    assert cpu_s(searching(16_000)) < 20 * cpu_s(searching(16)) + 0.01


@pytest.mark.parametrize(
    ("unit", "size"),
    [
        (b"U" * 64 * KIB, 50 * KIB * KIB),
        (b"$\r\n>" * 64, 200 * KIB),
        (b"S77: 1\r\n>" * 64, 200 * KIB),
        (b"a\r" * KIB, KIB * KIB),
    ],
    ids=["noise", "messages", "answers", "lines"],
)
def test_memory_is_bounded_whatever_comes(unit: bytes, size: int) -> None:
    protocol, history = CompaxProtocol(), WireHistory()
    protocol.line_opened()
    tracemalloc.start()
    try:
        for _ in range(size // len(unit)):
            protocol.receive(unit)
            history.received(0.0, unit)
            protocol.events()
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 2_000_000


@pytest.mark.parametrize("error_pattern", [ERROR_PATTERN, r"ERR\s*:?\s*(\d{1,3})"])
def test_looking_for_an_error_takes_little_time(error_pattern: str) -> None:
    pattern = re.compile(error_pattern)
    for unit in ("E", "E1", "E ", "ERR ", "ERR:   ", "1", " "):
        text = (unit * 256)[:256]
        assert cpu_s(lambda text=text: pattern.search(text)) < 0.1  # type: ignore[misc]


# Answers into values --------------------------------------------------------------------------------------------------

DECODERS: dict[str, Callable[[str], object]] = {
    "number": codecs.decode_number,
    "history": codecs.decode_history,
    "error": codecs.decode_error,
    "interface": codecs.decode_interface,
    "status": lambda answer: codecs.DriveStatus.decode(answer, answer),
    "monitor": lambda answer: codecs.decode_monitor_value(13, answer, answer, "mm"),
    **{f"S{n}": partial(codecs.decode_status_value, n, axis_unit="mm") for n in (1, 16, 18, 19, 30, 250)},
}
answers = st.builds(
    "".join, st.lists(st.sampled_from(["S001:", " ", "1", "0", ".", "-", "E", "a", "\xa0", "²", "٣", "mm/s2"]))
)


@given(answer=answers | st.text(max_size=256) | garbage.map(lambda data: data[:256].decode("latin-1")))
@settings(max_examples=300)
def test_an_answer_is_a_value_or_is_refused(answer: str) -> None:
    for decode in DECODERS.values():
        refusal(lambda decode=decode: decode(answer), UnexpectedAnswerError)  # type: ignore[misc]


@pytest.mark.parametrize("decode", DECODERS.values(), ids=DECODERS)
@pytest.mark.parametrize(
    "unit", ["a", "a ", " a", "a1", "-", "1", "1 ", ".", "mm/", "/", "(", " ", "E1", "\xa0", ":", "="]
)
def test_no_answer_takes_long_to_decode(decode: Callable[[str], object], unit: str) -> None:
    """Sixty letters between a number and a digit took longer than the universe has."""

    def work() -> None:
        for head in ("S001: 1 ", "S001: 1", "S001: ", "S001: 1/"):
            for tail in (" 5", "5", "", ",", " ."):
                answer = head + (unit * 250)[:240] + tail
                refusal(lambda answer=answer: decode(answer), UnexpectedAnswerError)  # type: ignore[misc]

    assert cpu_s(work) < 0.3


@pytest.mark.parametrize(
    "answer",
    [
        "S001: 1x2.50",
        "S001: 12x.50",
        "S001: #02.50",
        "S001: 1\x002.50",
        "S001: 7S001: 0.00",
        "S001: x 5",
        "S001: ٣",
        "S001: 1_0",
    ],
)
def test_a_number_that_was_spoilt_on_the_line_is_not_read_as_another_one(answer: str) -> None:
    with pytest.raises(UnexpectedAnswerError):
        codecs.decode_number(answer)


@given(number=st.decimals(-4_000_000, 4_000_000, places=2), at=st.integers(0, 9), byte=st.integers(0x80, 0xFF))
@example(number=Decimal("12.50"), at=0, byte=0xA0)
def test_a_number_with_a_spoilt_character_in_it_is_refused(number: Decimal, at: int, byte: int) -> None:
    text = str(number)
    at %= len(text) - 1  # behind the last digit it may be a unit
    with pytest.raises(UnexpectedAnswerError):
        codecs.decode_number(f"S001: {text[:at]}{chr(byte)}{text[at + 1 :]}")


# Programs and URLs ----------------------------------------------------------------------------------------------------

PARTS = (
    "N001",
    ":",
    "N2",
    " POSA",
    "POSR",
    "PA",
    " 5",
    ".V1",
    "V1=",
    "P40",
    "<",
    "IF",
    "E",
    "GOTO",
    "END",
    ";",
    "\n",
    "\r",
    "$",
    "٣",
    "\x00",
    "9" * 50,
)
listings = st.builds("".join, st.lists(st.sampled_from(PARTS), max_size=30)) | st.text(max_size=200)


@given(text=listings)
@settings(max_examples=300)
def test_a_listing_is_a_program_or_has_errors(text: str) -> None:
    assert all(str(problem) for problem in check(text))
    normalise(text)
    may_be_cut(text, decimals=2)
    read_shown(text, decimals=2)
    compare(text, End(), decimals=2)
    for read in (parse, parse_record):
        said = refusal(lambda read=read: read(text), InvalidCommandError)  # type: ignore[misc]
        assert all(line.isprintable() for line in (said or "").splitlines())


@pytest.mark.parametrize(
    "unit", ["N001: END\n", "N1 ", "9", "V1=", "\n", "N001: POSR 10 SPEED 50\n", ";", " ", "N999: X\n", "\t", "Ä"]
)
def test_reading_a_listing_takes_no_longer_a_character_if_there_are_more(unit: str) -> None:
    def read(size: int) -> Callable[[], object]:
        text = unit * (size // len(unit))
        return lambda: (check(text), normalise(text[:4000]))

    small, large = cpu_s(read(32 * KIB), 1), cpu_s(read(128 * KIB), 1)
    assert large < max(10 * small, 1.0)


@given(
    text=st.text(max_size=60)
    | st.builds(
        "".join,
        st.lists(
            st.sampled_from(
                ["tcp", "://", "a", ":", "@", "[", "]", "?", "&", "=", "%", "%00", "9", "/", "#", "\n", "٣", "\ud800"]
            )
        ),
    )
)
@settings(max_examples=300)
def test_an_url_is_read_or_is_refused(text: str) -> None:
    said = refusal(lambda: TransportURL.parse(text), TransportError)
    assert (said or "").isprintable()
    if said is None:
        port = TransportURL.parse(text).port
        assert port is None or 1 <= port <= 65535


# A whole client -------------------------------------------------------------------------------------------------------

QUICK = DriveSettings(answer_timeout_s=0.2, in_doubt_after_s=1.0, stop_timeout_s=1.0, stall_timeout_s=1.0)
CALLS: tuple[Callable[[Drive], Coroutine[Any, Any, object]], ...] = (
    lambda drive: drive.position(),
    lambda drive: drive.status(),
    lambda drive: drive.command("AL 100"),
    lambda drive: drive.error_history(),
    lambda drive: drive.parameters.read(40),
    lambda drive: drive.parameters.write(40, 1),
    lambda drive: drive.program.read(1),
    lambda drive: drive.program.write(1, "END"),
    lambda drive: drive.variables.read_all(),
    lambda drive: drive.query("XYZ"),
    lambda drive: drive.read_axis(),
    lambda drive: drive.stop(),
)


class Babble(Connection):
    """A line to a drive on which, for a while, something else comes than the drive says."""

    def __init__(self, line: DeviceLine, chunks: list[bytes]) -> None:
        super().__init__(line, set())
        self.chunks = chunks

    def data_received(self, data: bytes) -> None:
        if self.chunks:
            self.speak()
        else:
            super().data_received(data)

    def speak(self) -> None:
        if self._transport is not None and self.chunks:
            self._transport.write(self.chunks.pop())


async def through_babble(chunks: list[bytes], calls: list[int]) -> None:
    far = SimulatedDrive(Knobs(position=12.5))
    line = DeviceLine.of(far)
    near: list[Babble] = []

    def connect() -> Babble:
        near.append(Babble(line, []))
        return near[-1]

    async with watch_what_is_left_behind():
        with await listen("babble", connect) as listener:
            async with compax_aio.connect(listener.url, name="x", settings=QUICK) as drive:
                near[0].chunks += chunks
                for number in calls:
                    (outcome,) = await asyncio.gather(CALLS[number](drive), return_exceptions=True)
                    if isinstance(outcome, BaseException):
                        assert isinstance(outcome, CompaxError), repr(outcome)
                        assert all(text.isprintable() for text in (str(outcome), *outcome.exchanges))
                    near[0].speak()
                near[0].chunks.clear()
                assert await right_again(drive) == 12.5


async def right_again(drive: Drive) -> float:
    """Ask where it is; half an answer that came before may spoil one or two of the drive's own."""
    for _ in range(2):
        try:
            return await drive.position()
        except CompaxError:
            await asyncio.sleep(1)
    return await drive.position()


@given(chunks=chunks, calls=st.lists(st.integers(0, len(CALLS) - 1), min_size=1, max_size=6))
@settings(max_examples=120)
def test_a_client_bears_what_a_line_babbles_and_is_right_when_sense_returns(
    chunks: list[bytes], calls: list[int]
) -> None:
    with asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
        runner.run(through_babble(chunks, calls))


@given(chunks=chunks)
@settings(max_examples=100)
def test_connecting_to_babble_ends_in_an_error_of_ours_or_in_a_drive(chunks: list[bytes]) -> None:
    async def connect() -> None:
        line = DeviceLine.of(SimulatedDrive(Knobs(position=12.5)))
        async with watch_what_is_left_behind():
            with await listen("babble", lambda: Babble(line, chunks)) as listener, suppress(CompaxError):
                async with compax_aio.connect(listener.url, settings=QUICK) as drive:
                    chunks.clear()
                    assert await right_again(drive) == 12.5

    with asyncio.Runner(loop_factory=VirtualClockLoop) as runner:
        runner.run(connect())


async def test_a_flood_leaves_no_more_than_a_little_memory_in_a_client() -> None:
    line = DeviceLine.of(SimulatedDrive(Knobs(position=12.5)))
    far: list[Babble] = []
    with await listen("flood", lambda: far.append(Babble(line, [])) or far[-1]) as listener:  # type: ignore[func-returns-value]
        async with compax_aio.connect(listener.url, name="x", settings=QUICK) as drive:
            stream = drive.events()
            assert far[0]._transport is not None
            tracemalloc.start()
            try:
                for unit in (b"U" * 64 * KIB, b"$\r\n>" * 64, b"S77: 1\r\n>" * 32, b"\x11\x13" * KIB):
                    for _ in range(30):
                        far[0]._transport.write(unit)
                        await asyncio.sleep(0.001)
                    await asyncio.sleep(60)  # it is read in pieces
                _, peak = tracemalloc.get_traced_memory()
            finally:
                tracemalloc.stop()
            assert peak < 4_000_000
            assert stream.lost > 0
            assert await right_again(drive) == 12.5


# The simulated drive --------------------------------------------------------------------------------------------------


@given(
    pieces=st.lists(
        garbage
        | st.sampled_from(
            [
                b"PA 50\r",
                b"V1=V1*V1\r",
                b"V1=9999999\r",
                b"N1 GOTO 1\r",
                b"START\r",
                b"STOP\r",
                b"P20=17\r",
                b"GOTO 302\r",
                b"VP\r",
            ]
        ),
        max_size=15,
    ),
    binary=st.booleans(),
)
@settings(max_examples=200)
def test_a_simulated_drive_bears_whatever_comes(pieces: list[bytes], binary: bool) -> None:
    far, now = SimulatedDrive(Knobs(p20=16 if binary else 0)), 0.0
    far.connect(now)
    for piece in pieces:
        far.receive(piece, now)
        now += 0.5
        far.take_output(now)
    far.receive(b"\r" * 40, now)  # more than the longest frame
    far.take_output(now + 1)
    far.receive(b"S1\r", now + 1)
    assert b"S001:" in far.take_output(now + 2)


def test_the_memory_of_a_simulated_drive_is_bounded() -> None:
    far = SimulatedDrive(Knobs())
    far.connect(0.0)
    tracemalloc.start()
    try:
        for unit in (b"U" * 64 * KIB, b"\r" * 4 * KIB, b"\n" * 64 * KIB):
            for _ in range(16):
                far.receive(unit, 0.0)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 16_000_000
