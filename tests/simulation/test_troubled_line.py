"""The line between client and drive: what each trouble does to the bytes, and that both ends are noted."""

from __future__ import annotations

import asyncio

import pytest

from compax_aio.errors import TransportError
from compax_aio.simulator.cable import Tamper
from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive
from compax_aio.simulator.hunt.testimony import WireEntry, WireKind
from compax_aio.simulator.hunt.troubled_line import TroubledLine
from compax_aio.transports.registry import open_transport


class Host(asyncio.Protocol):
    """A client that only listens."""

    def __init__(self) -> None:
        self.received = b""
        self.is_lost = False
        self.transport: asyncio.Transport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport

    def data_received(self, data: bytes) -> None:
        self.received += data

    def connection_lost(self, exc: Exception | None) -> None:
        self.is_lost = True
        self.transport = None


class Bench:
    def __init__(self) -> None:
        self.drive = SimulatedDrive(Knobs())
        self.wire: list[WireEntry] = []
        self.line = TroubledLine("x", self.drive, self.wire)
        self.host = Host()

    async def say(self, data: bytes, for_s: float = 0.1) -> bytes:
        """Write, and return what has come by then."""
        if self.host.transport is None:
            await open_transport(self.line.url, lambda: self.host)
        assert self.host.transport is not None
        self.host.received = b""
        self.host.transport.write(data)
        await asyncio.sleep(for_s)
        return self.host.received

    def lines(self) -> list[str]:
        return self.drive.log.texts(LogKind.LINE)

    def noted(self, kind: WireKind) -> bytes:
        return b"".join(entry.data for entry in self.wire if entry.kind is kind)


@pytest.fixture
async def bench() -> Bench:
    return Bench()


async def test_a_line_without_trouble_hands_on_what_is_written_and_notes_both_ends(bench: Bench) -> None:
    assert await bench.say(b"S1\r") == b"S001: 0.00\r\n>"
    assert bench.noted(WireKind.WRITTEN) == bench.noted(WireKind.ARRIVED) == b"S1\r"
    assert bench.noted(WireKind.READ) == b"S001: 0.00\r\n>"


@pytest.mark.parametrize(
    ("tamper", "arrives"),
    [
        (Tamper("to_drive", "lose", skip=1), b"S\r"),
        (Tamper("to_drive", "garble", skip=1), b"S\xb1\r"),
        (Tamper("to_drive", "double", skip=0), b"SS1\r"),
        (Tamper("to_drive", "insert", skip=2, data=b"6"), b"S16\r"),
    ],
)
async def test_bytes_to_the_drive_are_lost_garbled_doubled_and_put_between(
    bench: Bench, tamper: Tamper, arrives: bytes
) -> None:
    bench.line.add(tamper)
    await bench.say(b"S1\r")
    assert bench.noted(WireKind.ARRIVED) == arrives
    await bench.say(b"S1\r")
    assert bench.noted(WireKind.ARRIVED) == arrives + b"S1\r"  # only once


async def test_bytes_to_the_host_are_tampered_with_as_well(bench: Bench) -> None:
    bench.line.add(Tamper("to_host", "lose", skip=4, count=2))
    assert await bench.say(b"S1\r") == b"S0010.00\r\n>"


async def test_precisely_the_end_of_a_motion_is_lost_and_of_nothing_else(bench: Bench) -> None:
    bench.line.add(Tamper("to_drive", "lose_end"))
    await bench.say(b"S1\r")
    await bench.say(b"PA5$\r")
    await bench.say(b"S17\r")
    assert bench.lines() == ["S1", "PA5$S17"]
    assert not bench.drive.moving


async def test_a_connection_is_cut_at_the_byte(bench: Bench) -> None:
    bench.line.add(Tamper("to_drive", "cut", skip=3))
    await bench.say(b"PA5$\r")
    assert bench.noted(WireKind.ARRIVED) == b"PA5"
    assert bench.host.is_lost


async def test_what_is_late_stays_in_order(bench: Bench) -> None:
    bench.line.delay_s["to_host"] = 0.5
    assert await bench.say(b"S1\r") == b""
    bench.line.delay_s["to_host"] = 0.0
    assert await bench.say(b"S2\r", 1.0) == b"S001: 0.00\r\n>S002: 0.00\r\n>"


async def test_pieces_arrive_one_after_the_other(bench: Bench) -> None:
    bench.line.piece = 1
    assert await bench.say(b"S1\r") == b"S001: 0.00\r\n>"
    assert [entry.data for entry in bench.wire if entry.kind is WireKind.ARRIVED] == [b"S", b"1", b"\r"]


async def test_while_the_line_is_held_the_client_keeps_what_it_wrote(bench: Bench) -> None:
    await bench.say(b"S1\r")
    bench.line.hold(held=True)
    assert await bench.say(b"S2\r") == b""
    assert bench.host.transport is not None
    assert bench.host.transport.get_write_buffer_size() == 3
    bench.line.hold(held=False)
    assert await bench.say(b"") == b"S002: 0.00\r\n>"


async def test_half_open_bytes_vanish_and_nobody_is_told(bench: Bench) -> None:
    await bench.say(b"S1\r")
    bench.line.vanishing = True
    assert await bench.say(b"S2\r") == b""
    assert not bench.host.is_lost
    assert bench.lines() == ["S1"]


async def test_an_answer_comes_a_second_time(bench: Bench) -> None:
    await bench.say(b"S1\r")
    bench.line.repeat()
    assert await bench.say(b"") == b"S001: 0.00\r\n>"


async def test_half_a_line_of_another_host_stands_in_the_drive(bench: Bench) -> None:
    await bench.say(b"")
    bench.line.from_elsewhere(b"PA5")
    await bench.say(b"S17\r")
    assert bench.lines() == ["PA5S17"]


async def test_a_line_that_refuses_cannot_be_opened_until_it_is_healed(bench: Bench) -> None:
    bench.line.refused = True
    with pytest.raises(TransportError, match="refuses"):
        await bench.say(b"S1\r")
    bench.line.heal()
    assert await bench.say(b"S1\r") == b"S001: 0.00\r\n>"


async def test_after_a_cut_another_device_may_be_at_the_far_end(bench: Bench) -> None:
    await bench.say(b"S1\r")
    bench.line.exchange_device(SimulatedDrive(Knobs(position=4321.0), name="stranger"))
    bench.line.cut()
    await asyncio.sleep(0)
    assert bench.host.is_lost
    assert await bench.say(b"S1\r") == b"S001: 4321.00\r\n>"


async def test_a_flipped_byte_is_another_digit(bench: Bench) -> None:
    bench.line.add(Tamper("to_drive", "flip", skip=1, count=1))
    assert await bench.say(b"S4\r") == b"S005: 0.00\r\n>"


async def test_a_device_server_that_keeps_what_nobody_has_heard_tells_it_to_who_connects_next(bench: Bench) -> None:
    await bench.say(b"S1\r")
    bench.line.keeps = True
    bench.line.cut()
    bench.drive.inject(b"$\r\n>")
    await asyncio.sleep(0.1)
    assert await bench.say(b"S1\r") == b"$\r\n>S001: 0.00\r\n>"
