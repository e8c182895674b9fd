"""The paced far end never answers sooner than the wire would, and tells what it did by the clock that all share."""

from __future__ import annotations

import os
import select
import socket
import time
import tty
from collections.abc import Iterator

import pytest
from benchmarks.far_ends.paced import (
    ANSWER_TIME_S,
    BYTE_TIME_S,
    EXCHANGE_S,
    MODULE,
    POSITION,
    QUESTION,
    Lateness,
)
from benchmarks.measuring import FarEnd, far_end

from compax_aio.compax.codecs import decode_number

pytestmark = pytest.mark.real_time

MOST_S = 10.0
PROMPT = b"\r\n>"


class Line:
    """Talks to one line with calls that block."""

    def __init__(self, url: str) -> None:
        host, _, port = url.removeprefix("tcp://").rpartition(":")
        self._sock = socket.create_connection((host, int(port)), timeout=MOST_S)

    def send(self, data: bytes) -> None:
        self._sock.sendall(data)

    def read(self, prompts: int = 1) -> bytes:
        """Read until so many prompts have come."""
        come = b""
        while come.count(b">") < prompts:
            come += self._sock.recv(4096)
        return come

    def ask(self, line: bytes) -> bytes:
        self.send(line + b"\r")
        return self.read()

    def has_come(self) -> bool:
        """Whether anything can be read now."""
        return bool(select.select([self._sock], [], [], 0)[0])

    def close(self) -> None:
        self._sock.close()


@pytest.fixture(scope="module")
def far() -> Iterator[FarEnd]:
    with far_end(MODULE, "3", "--ptys", "1") as running:
        yield running


@pytest.fixture
def line(far: FarEnd) -> Iterator[Line]:
    line = Line(far.where["tcp"][0])
    far.ask("happened")
    yield line
    line.close()


def test_a_reading_is_what_the_figures_of_the_design_count_with() -> None:
    assert 40.5 <= 1 / EXCHANGE_S <= 41.5
    assert len(QUESTION) + len(POSITION) == 20
    assert decode_number(POSITION.removesuffix(PROMPT).decode()) == -1234.5


def test_an_answer_comes_no_sooner_than_its_last_byte_would(line: Line) -> None:
    for _ in range(3):
        asked_at = time.monotonic()
        assert line.ask(b"S1") == POSITION
        assert time.monotonic() - asked_at >= EXCHANGE_S


def test_lines_that_come_together_are_heard_and_answered_one_after_the_other(line: Line) -> None:
    asked_at = time.monotonic()
    line.send(2 * QUESTION)
    assert line.read(prompts=2) == 2 * POSITION
    wire_s = len(QUESTION + POSITION) * BYTE_TIME_S
    assert time.monotonic() - asked_at >= ANSWER_TIME_S + wire_s + len(POSITION) * BYTE_TIME_S


def test_what_comes_while_the_wire_is_still_busy_is_heard_after_it(line: Line, far: FarEnd) -> None:
    sent_at = time.monotonic()
    line.send(b"A" * 28)
    far.ask("usage")  # it has read that
    line.send(b"\r")
    assert line.read() == PROMPT
    assert time.monotonic() - sent_at >= 29 * BYTE_TIME_S + ANSWER_TIME_S + len(PROMPT) * BYTE_TIME_S


def test_half_a_line_is_answered_when_the_rest_has_come(line: Line) -> None:
    line.send(b"S")
    line.send(b"1\r")
    assert line.read() == POSITION


def test_byte_by_byte_takes_no_longer_and_no_less() -> None:
    with far_end(MODULE, "1", "--by-byte") as far:
        line = Line(far.where["tcp"][0])
        asked_at = time.monotonic()
        assert line.ask(b"S1") == POSITION
        assert time.monotonic() - asked_at >= EXCHANGE_S
        assert far.ask("usage")["late_us"]["count"] == len(POSITION)
        line.close()


def test_a_pseudo_terminal_is_paced_too(far: FarEnd) -> None:
    port = os.open(far.where["pty"][0].removeprefix("serial://"), os.O_RDWR | os.O_NOCTTY)
    try:
        tty.setraw(port)
        asked_at = time.monotonic()
        os.write(port, QUESTION)
        come = b""
        while not come.endswith(b">"):
            come += os.read(port, 4096)
        assert come == POSITION
        assert time.monotonic() - asked_at >= EXCHANGE_S
    finally:
        os.close(port)


@pytest.mark.parametrize(
    ("asked", "answered"),
    [
        (b"S31", b"S031: 0.00"),
        (b"P7", b"P007: 0"),
        (b"V39", b"V039: 0"),
        (b"N12", b"N012: END"),
        (b"SD50", b""),
        (b"VP", b""),
    ],
)
def test_it_answers_as_a_drive_at_rest(line: Line, asked: bytes, answered: bytes) -> None:
    assert line.ask(asked) == answered + PROMPT


def test_a_move_ends_with_its_message_and_the_time_of_it_is_told(line: Line, far: FarEnd) -> None:
    begun_at = time.monotonic()
    assert line.ask(b"PA10$") == PROMPT
    assert line.read() == b"$" + PROMPT
    ended_at = time.monotonic()
    ((number, sent_at),) = far.ask("happened")["messages"]
    assert number == 0
    assert begun_at < sent_at < ended_at
    assert far.ask("happened") == {"messages": [], "stops": []}


def test_while_it_moves_its_status_says_so(line: Line) -> None:
    line.send(b"PA10$\rS17\r")
    answered = line.read(prompts=3)
    assert sorted(answered.split(PROMPT)) == [b"", b"", b"$", b"S017: 00100010"]
    assert line.ask(b"S17") == b"S017: 00000010" + PROMPT


def test_a_stop_ends_a_move_without_a_message_and_is_told_with_the_answer_before_it(line: Line, far: FarEnd) -> None:
    begun_at = time.monotonic()
    line.send(b"PA10$\rSTOP\r")
    assert line.read(prompts=2) == 2 * PROMPT
    for _ in range(5):  # longer than any move takes
        assert line.ask(b"S1") == POSITION
    happened = far.ask("happened")
    assert happened["messages"] == []
    ((number, came_at, *answered_at),) = happened["stops"]
    assert number == 0
    assert answered_at == [0.0, 0.0]  # nothing had been said on that line
    assert begun_at - 0.001 < came_at < time.monotonic()  # the kernel's time is that of another clock


def test_a_stop_is_told_with_when_the_two_answers_before_it_were_released(line: Line, far: FarEnd) -> None:
    line.ask(b"S1")
    between = time.monotonic()
    line.ask(b"S1")
    line.ask(b"STOP")
    ((_, came_at, *answered_at),) = far.ask("happened")["stops"]
    assert answered_at[0] < between < answered_at[1] < came_at + 0.001


def test_a_line_that_stalls_says_nothing_until_it_is_mended_and_the_others_go_on(line: Line, far: FarEnd) -> None:
    stalled = Line(far.where["tcp"][2])
    assert stalled.ask(b"S1") == POSITION
    stalled.send(QUESTION)
    assert far.ask("stall 2")
    stalled.send(QUESTION)
    for _ in range(3):
        assert line.ask(b"S1") == POSITION
    assert not stalled.has_come()
    stalled.close()
    again = Line(far.where["tcp"][2])
    again.send(QUESTION)
    assert line.ask(b"S1") == POSITION
    assert not again.has_come()
    again.close()
    assert far.ask("mend 2")
    well = Line(far.where["tcp"][2])
    assert well.ask(b"S1") == POSITION
    well.close()


def test_it_tells_how_much_of_the_time_it_worked(line: Line, far: FarEnd) -> None:
    before = far.ask("usage")
    line.ask(b"S1")
    after = far.ask("usage")
    assert after["late_us"]["count"] == 1
    assert after["cpu_s"] > before["cpu_s"]
    assert 0 < after["idle_s"] - before["idle_s"] <= after["at_s"] - before["at_s"]


def test_lateness_is_told_in_percentiles() -> None:
    lateness = Lateness()
    for number in range(1000):
        lateness.note((number // 100) * 1e-4 + 1e-6)
    lateness.note(5.0)
    assert lateness.take() == {"count": 1001, "p50": 500.0, "p99": 900.0, "max": 20_000.0}
    assert lateness.take()["count"] == 0
