"""P7 and P8: four drives in trouble on one event loop, and the fifth has its answers when an undisturbed one has."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import os
import threading
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from enum import Enum
from types import SimpleNamespace
from typing import Any

import pytest
from tests.promises.bench import ScriptedDrive, bench, now
from tests.promises.test_own_lines import times_of

import compax_aio
from compax_aio import CompaxError, Drive, DriveSettings, MoveInDoubtError, TransportError
from compax_aio.simulator.compax import SimulatedDrive
from compax_aio.simulator.server import serve_pty, serve_tcp
from compax_aio.transports import serial as serial_opener
from compax_aio.transports import serial_backends, serial_line, serial_ports
from compax_aio.transports.loopback import LoopbackListener, listen

left_clean = pytest.mark.usefixtures("nothing_left_behind")

DAY_S = 24 * 3600.0
MOST_UNSENT_BYTES = 64 * 1024
"""What a transport takes before it says that it is full."""
NOISE = (b"x" * 400, b"\r\n>" * 20, b"S001: 1.00\r\n>" * 5, b"E92\r\n>" * 9, b"$\r\n>" * 9, bytes(range(256)))


class Trouble(Enum):
    FLOODS = "sends without end"
    SILENT = "takes everything and says nothing"
    HELD = "takes nothing: what is sent stays with us"
    HANGS_UP = "takes every connection, and hangs up"


class TroubledDrive:
    """Behaves until its trouble begins; then it never does again, on this connection and on those to come."""

    def __init__(self, trouble: Trouble, name: str = "troubled") -> None:
        self.name = name
        self.begun_at: float | None = None
        self.end: _End | None = None
        self.drive: Drive
        self._trouble = trouble

    def begin(self) -> None:
        self.begun_at = now()
        assert self.end is not None
        self.end.suffer(self._trouble)

    def connected(self) -> _End:
        self.end = _End(self._trouble if self.begun_at is not None else None)
        return self.end

    async def listen(self) -> LoopbackListener:
        return await listen(self.name, self.connected)

    @property
    def unsent_bytes(self) -> int:
        """What the client's transport keeps now."""
        assert self.end is not None
        return self.end.transport._peer.get_write_buffer_size()  # type: ignore[attr-defined,no-any-return]


class _End(ScriptedDrive):
    def __init__(self, trouble: Trouble | None) -> None:
        super().__init__()
        self._trouble = trouble

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        super().connection_made(transport)
        if self._trouble is not None:
            self.suffer(self._trouble)

    def suffer(self, trouble: Trouble) -> None:
        self._trouble = trouble
        if trouble is Trouble.HELD:
            self.transport.pause_reading()
        elif trouble is Trouble.HANGS_UP:
            self.transport.abort()
        elif trouble is Trouble.FLOODS:
            self._flood(0)

    def _flood(self, count: int) -> None:
        if not self.transport.is_closing():
            self.transport.write(NOISE[count % len(NOISE)])
            asyncio.get_running_loop().call_later(0.003, self._flood, count + 1)

    def data_received(self, data: bytes) -> None:
        if self._trouble is not Trouble.SILENT:
            super().data_received(data)


@asynccontextmanager
async def troubled(trouble: Trouble, settings: DriveSettings | None = None) -> AsyncIterator[TroubledDrive]:
    far = TroubledDrive(trouble, trouble.name.lower())
    with await far.listen() as listener:
        far.drive = await compax_aio.connect(listener.url, name=far.name, settings=settings)
        try:
            yield far
        finally:
            with contextlib.suppress(CompaxError):  # it could not be stopped
                await far.drive.close()


async def keep_asking(drive: Drive) -> None:
    while True:
        await asyncio.gather(drive.position(), drive.command("SD50"), drive.query("P1"), return_exceptions=True)
        await asyncio.sleep(0.01)


@contextmanager
def in_the_background(*work: Any) -> Iterator[None]:
    tasks = [asyncio.ensure_future(each) for each in work]
    try:
        yield
    finally:
        for task in tasks:
            task.cancel()


# On the virtual clock, exactly ----------------------------------------------------------------------------------------


async def undisturbed() -> tuple[list[float], list[float]]:
    async with bench("undisturbed") as (drive, _):
        return await times_of(drive), answer_times(drive)


def answer_times(drive: Drive) -> list[float]:
    return [round(each, 9) for each in drive.stats.answer_times_s]


@left_clean
@pytest.mark.parametrize(
    "troubles",
    [*((each,) for each in Trouble), tuple(Trouble)],
    ids=["floods", "silent", "held", "hangs up", "all four"],
)
async def test_drives_in_trouble_delay_no_other(troubles: tuple[Trouble, ...]) -> None:
    expected = await undisturbed()
    async with contextlib.AsyncExitStack() as stack:
        settings = DriveSettings(stop_timeout_s=1, reconnect_first_s=0.01, reconnect_slowest_s=0.01)
        far_ends = [await stack.enter_async_context(troubled(each, settings)) for each in troubles]
        quiet, _ = await stack.enter_async_context(bench("quiet"))
        with in_the_background(*(keep_asking(far.drive) for far in far_ends)):
            for far in far_ends:
                far.begin()
            await asyncio.sleep(2.5)
            assert (await times_of(quiet), answer_times(quiet)) == expected
            assert all(far.drive.stats.exchanges > 0 for far in far_ends)
            assert all(_has_suffered(far) for far in far_ends)
        await asyncio.sleep(0)


def _has_suffered(far: TroubledDrive) -> bool:
    stats = far.drive.stats
    return stats.timeouts > 0 or stats.strays > 100 or not far.drive._line.link.is_open


@left_clean
@pytest.mark.parametrize("trouble", Trouble)
async def test_closing_and_stopping_a_drive_in_trouble_delay_no_other(trouble: Trouble) -> None:
    expected = await undisturbed()
    async with troubled(trouble, DriveSettings(stop_timeout_s=1)) as far, bench("quiet") as (quiet, _):
        move = far.drive.move_to(100)
        await move.accepted
        far.begin()

        async def stop_and_close() -> None:
            with contextlib.suppress(CompaxError):
                await far.drive.stop()
            with contextlib.suppress(CompaxError):
                await far.drive.close()

        ending = asyncio.ensure_future(stop_and_close())
        assert (await times_of(quiet), answer_times(quiet)) == expected
        async with asyncio.timeout(60):
            await asyncio.gather(ending, move, return_exceptions=True)


# Memory ---------------------------------------------------------------------------------------------------------------


async def poll(drive: Drive, *, slow: bool = False) -> None:
    async for _ in drive.watch("position", "status", interval_s=10 if slow else 0.2):
        pass


@pytest.mark.parametrize("reconnect", [True, False])
async def test_a_line_held_for_a_day_keeps_little_and_the_move_on_it_is_told(reconnect: bool) -> None:
    settings = DriveSettings(reconnect=reconnect, reconnect_slowest_s=600, stop_timeout_s=1)
    async with troubled(Trouble.HELD, settings) as far:
        move = far.drive.move_to(100)
        far.begin()
        begun_at = now()
        with in_the_background(poll(far.drive, slow=True)):
            most = 0
            while now() < begun_at + DAY_S:
                await asyncio.sleep(60)
                most = max(most, far.unsent_bytes)
                assert most <= MOST_UNSENT_BYTES
                assert len(far.drive._line.protocol._ledger) <= 16_384
        assert isinstance(move.exception(), MoveInDoubtError | compax_aio.ConnectionLostError)
        assert far.drive.stats.bytes_sent > 100


@left_clean
@pytest.mark.parametrize("noise", [b"E92\r\n>", b"\r\n>", b"x\r\n>", b"S001: 1.00\r\n>"])
async def test_a_line_that_is_held_and_floods_keeps_little(noise: bytes) -> None:
    """Whatever asks for another marker comes without end, and none of them is taken."""
    settings = DriveSettings(stop_timeout_s=1)
    async with troubled(Trouble.HELD, settings) as far:
        far.begin()
        with in_the_background(poll(far.drive)):
            for _ in range(6000):
                await asyncio.sleep(0.01)
                assert far.end is not None
                if not far.end.transport.is_closing():
                    far.end.transport.write(noise)
                assert far.unsent_bytes <= 2048


@left_clean
@pytest.mark.parametrize("noise", [b"\r\n>", b"x\r\n>", b"E92\r\n>"])
async def test_what_comes_at_once_is_read_in_pieces_and_others_have_their_turns_in_between(noise: bytes) -> None:
    async with troubled(Trouble.SILENT) as far, bench("quiet") as (quiet, _):
        assert far.end is not None
        events = far.drive.events()
        far.end.transport.write(noise * (100_000 // len(noise)))
        most = strays = 0
        for _ in range(2000):
            await asyncio.sleep(0)
            most, strays = max(most, far.drive.stats.strays - strays), far.drive.stats.strays
        assert strays >= 1
        assert most <= 512, "a millisecond's work, or some"
        await quiet.position()
        assert events.lost <= strays


# What works in threads ------------------------------------------------------------------------------------------------


class Hanging:
    """Something that blocks in its thread until it is let go."""

    def __init__(self) -> None:
        self.begun = threading.Semaphore(0)
        self._let_go = threading.Event()

    def __call__(self, *_: Any, **__: Any) -> Any:
        self.begun.release()
        assert self._let_go.wait(10)
        raise OSError(errno.ENOENT, "it took too long")

    def let_go(self) -> None:
        self._let_go.set()


@pytest.fixture
def hanging() -> Iterator[Hanging]:
    it = Hanging()
    yield it
    it.let_go()


@asynccontextmanager
async def on_tcp() -> AsyncIterator[Drive]:
    async with serve_tcp(SimulatedDrive(name="quiet")) as url, compax_aio.connect(url, name="quiet") as drive:
        yield drive


async def works(drive: Drive, exchanges: int = 20) -> None:
    async with asyncio.timeout(10):
        for _ in range(exchanges):
            await drive.position()


async def begun(hanging: Hanging) -> None:
    async with asyncio.timeout(10):
        while not hanging.begun.acquire(blocking=False):  # noqa: ASYNC110  # in another thread
            await asyncio.sleep(0.001)


@left_clean
@pytest.mark.real_time
async def test_a_port_that_hangs_while_it_is_opened_delays_no_other(
    hanging: Hanging, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(serial_opener, "open_port", hanging)
    async with on_tcp() as drive:
        opening = asyncio.ensure_future(compax_aio.connect("serial:///dev/ttyHangs")._open())
        await begun(hanging)
        await works(drive)
        assert not opening.done()
        hanging.let_go()
        with pytest.raises(TransportError):
            await opening


@left_clean
@pytest.mark.real_time
async def test_many_ports_that_hang_while_they_are_opened_delay_no_other_that_is_opened(
    hanging: Hanging, monkeypatch: pytest.MonkeyPatch
) -> None:
    open_port = serial_backends.open_port
    count = (os.cpu_count() or 1) + 8

    def open_or_hang(backend: str, name: str, *rest: Any, **options: Any) -> Any:
        return hanging() if "Hangs" in name else open_port(backend, name, *rest, **options)

    monkeypatch.setattr(serial_opener, "open_port", open_or_hang)
    async with serve_pty(SimulatedDrive(name="good")) as url:
        opening = [asyncio.ensure_future(compax_aio.connect("serial:///dev/ttyHangs")._open()) for _ in range(count)]
        await begun(hanging)
        try:
            async with asyncio.timeout(2), compax_aio.connect(url, name="good") as drive:
                await works(drive)
        finally:
            hanging.let_go()
            await asyncio.wait(opening)
        assert all(isinstance(each.exception(), TransportError) for each in opening)


@left_clean
@pytest.mark.real_time
async def test_a_slow_search_for_ports_delays_no_line(hanging: Hanging, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serial_ports, "pyserial_list_ports", SimpleNamespace(comports=hanging))
    async with on_tcp() as drive:
        search = asyncio.ensure_future(serial_opener.list_ports())
        await begun(hanging)
        await works(drive)
        assert not search.done()
        hanging.let_go()
        with pytest.raises(OSError, match="too long"):
            await search


@left_clean
@pytest.mark.real_time
async def test_a_driver_that_hangs_while_a_port_is_released_delays_neither_closing_nor_another_line(
    hanging: Hanging, monkeypatch: pytest.MonkeyPatch
) -> None:
    release: Callable[..., None] = serial_line._release_port

    def hang_first(*port: Any, **options: Any) -> None:
        with contextlib.suppress(OSError):
            hanging()
        release(*port, **options)

    async with on_tcp() as quiet, serve_pty(SimulatedDrive(name="x")) as url:
        drive = await compax_aio.connect(url, name="x")
        monkeypatch.setattr(serial_line, "_release_port", hang_first)
        closing = asyncio.ensure_future(drive.close())
        await begun(hanging)
        await works(quiet)
        async with asyncio.timeout(5):
            await closing  # though the driver still hangs
        await works(quiet)
        hanging.let_go()
