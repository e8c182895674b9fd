"""Simulated drives are found under sim://, on TCP, on a pty and in memory, and live on between connections."""

from __future__ import annotations

import asyncio
import os
import termios
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager

import pytest

from compax_aio.errors import TransportError
from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive
from compax_aio.simulator.line import DeviceLine
from compax_aio.simulator.server import drive_named, serve_loopback, serve_pty, serve_tcp
from compax_aio.transports.registry import open_transport

PROMPT = b"\r\n>"


class Caller(asyncio.Protocol):
    """Somebody who calls a drive: remembers what came, and waits for what must come."""

    def __init__(self) -> None:
        self.received = b""
        self.lost = asyncio.Event()
        self._more = asyncio.Event()
        self.transport: asyncio.Transport

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport

    def data_received(self, data: bytes) -> None:
        self.received += data
        self._more.set()

    def connection_lost(self, exc: Exception | None) -> None:
        self.lost.set()

    async def expect(self, wanted: bytes) -> None:
        """Wait until exactly *wanted* has come."""
        async with asyncio.timeout(60):
            while len(self.received) < len(wanted):
                self._more.clear()
                await self._more.wait()
        assert self.received == wanted
        self.received = b""

    async def ask(self, line: str, wanted: bytes = PROMPT) -> None:
        self.transport.write(line.encode() + b"\r")
        await self.expect(wanted)

    async def hang_up(self) -> None:
        self.transport.abort()
        await self.lost.wait()


@asynccontextmanager
async def calling(url: str) -> AsyncIterator[Caller]:
    caller = Caller()
    await open_transport(url, lambda: caller)
    try:
        yield caller
    finally:
        await caller.hang_up()


Serve = Callable[[SimulatedDrive], AbstractAsyncContextManager[str]]


def serve_in_memory(drive: SimulatedDrive) -> AbstractAsyncContextManager[str]:
    return serve_loopback(drive, "axis")


@pytest.fixture
def drive() -> SimulatedDrive:
    return SimulatedDrive()


@pytest.mark.parametrize("serve", [serve_tcp, serve_in_memory, serve_pty])
async def test_a_served_drive_moves_and_reports(serve: Serve, drive: SimulatedDrive) -> None:
    async with serve(drive) as url, calling(url) as caller:
        await caller.ask("PR 50 OT O1=1")
        await caller.ask("PA 100$", PROMPT + b"1\r\n>$\r\n>")
        await caller.ask("S1", b"S001: 100.00\r\n>")
    assert drive.log[0].kind is LogKind.CONNECTED
    assert drive.log[-1].kind is LogKind.DISCONNECTED


@pytest.mark.parametrize("serve", [serve_tcp, serve_in_memory, serve_pty])
async def test_a_drive_lives_on_between_connections(serve: Serve, drive: SimulatedDrive) -> None:
    async with serve(drive) as url:
        async with calling(url) as caller:
            await caller.ask("PA 100")
            caller.transport.write(b"PA")
            await asyncio.sleep(0.1)
        await asyncio.sleep(10)
        assert drive.log.texts(LogKind.MOTION_REACHED) == ["100.00"]
        async with calling(url) as caller:
            await caller.ask("S1", b"E90\r\n>")
            await caller.ask("S1", b"S001: 100.00\r\n>")


@pytest.mark.parametrize("serve", [serve_tcp, serve_in_memory])
async def test_a_second_caller_is_hung_up_at_once(serve: Serve, drive: SimulatedDrive) -> None:
    async with serve(drive) as url, calling(url) as first:
        second = Caller()
        await open_transport(url, lambda: second)
        second.transport.write(b"PA 5\r")
        async with asyncio.timeout(10):
            await second.lost.wait()
        await first.ask("S2", b"S002: 0.00\r\n>")
        assert drive.log.texts(LogKind.MOTION_STARTED) == []


@pytest.mark.parametrize("serve", [serve_tcp, serve_in_memory])
async def test_the_end_of_serving_hangs_up(serve: Serve, drive: SimulatedDrive) -> None:
    async with serve(drive) as url:
        caller = Caller()
        await open_transport(url, lambda: caller)
        await caller.ask("S2", b"S002: 0.00\r\n>")
    async with asyncio.timeout(10):
        await caller.lost.wait()
    assert drive.log[-1].kind is LogKind.DISCONNECTED
    with pytest.raises(TransportError):
        await open_transport(url, Caller)


async def test_drives_are_served_side_by_side() -> None:
    one, two = SimulatedDrive(Knobs(position=1)), SimulatedDrive(Knobs(position=2))
    async with (
        serve_tcp(one) as url_one,
        serve_tcp(two, host="::1") as url_two,
        calling(url_one) as caller_one,
        calling(url_two) as caller_two,
    ):
        await caller_one.ask("S1", b"S001: 1.00\r\n>")
        await caller_two.ask("S1", b"S001: 2.00\r\n>")


async def test_a_drive_on_two_lines_has_one_caller(drive: SimulatedDrive) -> None:
    async with serve_tcp(drive), serve_loopback(drive, "x") as url, calling(url):
        with pytest.raises(TransportError, match="somebody else"):
            await serve_pty(drive).__aenter__()


async def test_bytes_that_nobody_reads_from_a_pty_are_lost(drive: SimulatedDrive) -> None:
    async with serve_pty(drive):
        for _ in range(20):
            drive.inject(b"x" * 4096)
        drive.raise_fault(5)
    assert drive.fault == 5


async def test_the_pty_is_raw(drive: SimulatedDrive) -> None:
    async with serve_pty(drive) as url:
        port = os.open(url.removeprefix("serial://"), os.O_RDWR | os.O_NOCTTY)
        try:
            assert not termios.tcgetattr(port)[3] & (termios.ECHO | termios.ICANON)
            os.write(port, b"S1\r\n")
            await asyncio.sleep(1)
            assert os.read(port, 100) == b"S001: 0.00\r\n>"
        finally:
            os.close(port)


async def test_sim_gives_a_fresh_drive_each_time() -> None:
    for _ in range(2):
        async with calling("sim://compax?position=3&decimals=3") as caller:
            await caller.ask("S1", b"S001: 3.000\r\n>")
            await caller.ask("PA 5$", PROMPT + b"$\r\n>")


async def test_sim_keeps_a_drive_that_has_a_name() -> None:
    for position in (b"3.00", b"5.00", b"5.00"):
        async with calling("sim://compax?name=x&position=3") as caller:
            await caller.ask("S1", b"S001: " + position + PROMPT)
            caller.transport.write(b"PA 5\r")
            await asyncio.sleep(0.001)
        await asyncio.sleep(5)
    drive = drive_named("x")
    assert drive.position == 5
    assert len(drive.log.texts(LogKind.MOTION_STARTED)) == 3
    assert drive_named("y").position == 0
    with pytest.raises(TransportError, match="has other knobs"):
        await open_transport("sim://compax?name=x&position=4", Caller)


async def test_sim_takes_a_drive_that_a_test_has_made() -> None:
    drive = drive_named("z", Knobs(position=8))
    async with calling("sim://compax?name=z") as caller:
        await caller.ask("S1", b"S001: 8.00\r\n>")
        with pytest.raises(TransportError, match="somebody else"):
            await open_transport("sim://compax?name=z", Caller)
    # The moment the line is free, it can be taken again.
    async with calling("sim://compax?name=z") as caller:
        drive.raise_fault(55)
        await caller.ask("PA 5", b"E94\r\n>")


def test_named_drives_belong_to_their_event_loop() -> None:
    async def name_one() -> SimulatedDrive:
        return drive_named("x")

    assert asyncio.run(name_one()) is not asyncio.run(name_one())


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("sim://compaks", "no simulated 'compaks'; kinds of device: compax"),
        ("sim://compax:1", "no port number"),
        ("sim://compax/x", "no path"),
        ("sim://compax?ecko=1", "no knob 'ecko'"),
        ("sim://compax?echo=2", "echo='2'; allowed: 0, 1"),
    ],
)
async def test_sim_says_what_it_cannot_do(url: str, message: str) -> None:
    with pytest.raises(TransportError, match=message):
        await open_transport(url, Caller)


async def test_bytes_come_one_by_one_at_9600_baud() -> None:
    async with calling("sim://compax?baudrate=9600&answer_time_s=0") as caller:
        await caller.ask("S1", b"S001: 0.00\r\n>")
        assert asyncio.get_running_loop().time() == pytest.approx((3 + 13) * 10 / 9600)


async def test_fault_hooks_work_while_the_drive_is_served() -> None:
    async with calling("sim://compax?name=h&power_on_text=prompt") as caller:
        drive = drive_named("h")
        drive.extra_answer_delay_s = 1000
        caller.transport.write(b"S2\r")
        await asyncio.sleep(2)
        drive.extra_answer_delay_s = 0
        await caller.expect(b"S002: 0.00\r\n>")
        drive.inject(b"noise")
        await caller.expect(b"noise")
        await caller.ask("PA 1000")
        await asyncio.sleep(1)
        drive.raise_fault(55)
        await asyncio.sleep(0.2)
        assert not drive.moving
        drive.power_off()
        await asyncio.sleep(1)
        drive.power_on()
        await caller.expect(PROMPT)


async def test_a_caller_that_reads_nothing_loses_bytes_and_holds_up_nobody(drive: SimulatedDrive) -> None:
    async with serve_loopback(drive, "axis") as url, calling(url) as caller:
        caller.transport.pause_reading()
        for _ in range(10):
            drive.inject(b"x" * 60_000)
            await asyncio.sleep(0.1)
        caller.transport.resume_reading()
        await asyncio.sleep(1)
        assert 60_000 <= len(caller.received) < 200_000
        caller.received = b""
        await caller.ask("S2", b"S002: 0.00\r\n>")


def test_a_drive_whose_event_loop_is_closed_can_still_be_looked_at(drive: SimulatedDrive) -> None:
    async def serve() -> None:
        async with serve_loopback(drive, "x") as url, calling(url) as caller:
            await caller.ask("PA 100000")

    asyncio.run(serve())
    assert isinstance(drive.served_by, DeviceLine)
    drive.raise_fault(55)
    assert drive.moving
    assert drive.log.texts(LogKind.FAULT) == ["E55"]
