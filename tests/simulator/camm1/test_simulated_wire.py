"""Bytes between the host and a simulated cutter: when each arrives, and what a modem line stops."""

from __future__ import annotations

from math import inf

import pytest
from tests.simulator.camm1.host import Host

from compax_aio.simulator.camm1 import LogKind
from compax_aio.simulator.camm1.shapes import clipped
from compax_aio.simulator.wire import Wire


def _written(*pieces: bytes, overshoot: int = 0) -> Wire:
    wire = Wire(1.0, overshoot)
    for each in pieces:
        wire.write(each, 0.0)
    return wire


def test_bytes_go_back_to_back_however_they_are_written() -> None:
    wire = _written(b"abc", b"", b"de")
    assert [wire.at(count) for count in range(6)] == [1, 2, 3, 4, 5, inf]
    assert wire.arrived(2.5) == 2
    assert wire.take(2) == b"ab"
    assert len(wire) == 3
    assert (wire.next_at, wire.ends_at, wire.taken) == (3, 5, 2)
    assert _written().next_at == inf
    assert _written().arrived(1.0) == 0


@pytest.mark.parametrize(("overshoot", "still"), [(0, 2), (1, 3), (2, 4), (4, 6)])
def test_only_what_has_begun_and_the_overshoot_leaves_a_host_that_is_stopped(overshoot: int, still: int) -> None:
    wire = _written(b"abc", b"def", b"ghi", overshoot=overshoot)
    wire.stop(1.5)
    assert [wire.at(count) for count in range(still + 1)] == [*range(1, still + 1), inf]
    assert len(wire) == 9
    wire.write(b"jk", 2.0)
    wire.go_on(20.0)
    assert wire.at(still) == 21
    taken = b""
    while count := wire.arrived(100.0):
        taken += wire.take(count)
    assert taken == b"abcdefghijk"


def test_signs_are_found_wherever_they_are_and_once() -> None:
    wire = _written(b"ab!", b"c!d")
    wire.stop(1.5)
    assert wire.first(b"!") == 2
    assert wire.first(b"?") is None
    wire.write(b"?", 2.0)
    assert wire.first(b"?") == 6
    wire.go_on(3.0)
    assert wire.take(2) == b"ab"
    assert wire.first(b"!") == 0
    assert wire.before(b"!x") == 0
    wire.take(1)
    assert wire.first(b"!") == 1
    assert wire.before(b"!x") == 1


def test_what_has_not_begun_is_lost_with_the_port() -> None:
    wire = _written(b"abc!", b"def")
    assert wire.first(b"!") == 3
    assert wire.cut(1.5) == 5
    assert wire.first(b"!") is None
    wire.write(b"!", 5.0)
    assert wire.at(2) == 6
    assert wire.first(b"!") == 2


def test_an_instruction_that_its_follower_ends_is_read_when_that_begins() -> None:
    host = Host(baudrate=1200)
    byte_s = 10 / 1200
    host.send(b"PU1,1PD2,2;", 1.0)
    times = [entry.at for entry in host.cutter.log if entry.kind is LogKind.INSTRUCTION]
    assert times == pytest.approx([6 * byte_s, 11 * byte_s])


def test_a_line_beside_a_window_has_no_part_in_it() -> None:
    assert clipped((5, -1), (5, -1), (0, 0), (10, 10)) is None
    assert clipped((-1, 0), (-1, 10), (0, 0), (10, 10)) is None
    assert clipped((5, 5), (5, 5), (0, 0), (10, 10)) == ((5, 5), (5, 5))
