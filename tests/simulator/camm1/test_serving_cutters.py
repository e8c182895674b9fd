"""A simulated cutter where programs find it: in process, on TCP, on a pty; and how DTR is seen there."""

from __future__ import annotations

import asyncio
import os
import time

import pytest
from tests.simulator.near_end import opened, until

from compax_aio.errors import TransportError
from compax_aio.simulator.camm1 import Knobs, LogKind, SimulatedCutter
from compax_aio.simulator.far_end import FarEnd
from compax_aio.simulator.outlet import tcp_outlet
from compax_aio.simulator.planned_faults import read_faults
from compax_aio.simulator.server import cutter_named, kept, line_named, serve_loopback, serve_pty, serve_tcp


async def test_a_named_cutter_lives_on_between_connections() -> None:
    transport, near = await opened("sim://camm1?name=c&model=PNC-900&baudrate=9600")
    transport.write(b"PD100,100;\x1b.B")
    assert await near.until_heard(b"\r") in {b"1024\r", b"1014\r"}
    transport.close()
    await asyncio.sleep(10)
    cutter = cutter_named("c")
    assert cutter.cuttings.vectors.total == 1
    assert cutter.log.texts(LogKind.CONNECTED, LogKind.DISCONNECTED) == ["", ""]
    with pytest.raises(TransportError, match="other knobs"):
        cutter_named("c", Knobs())
    with pytest.raises(TransportError, match="another kind"):
        line_named("c")
    other, _ = await opened("sim://camm1")
    other.abort()
    with pytest.raises(TransportError, match="no state to keep"), kept(cutter, "nowhere.json"):
        pass


async def test_answers_take_the_time_of_their_bytes() -> None:
    transport, near = await opened("sim://camm1?baudrate=1200")
    began = asyncio.get_running_loop().time()
    transport.write(b"\x1b.B")
    await until(lambda: bool(near.heard), 0.0001)
    assert near.heard == b"1024\r"
    assert asyncio.get_running_loop().time() - began == pytest.approx(8 * 10 / 1200, abs=0.001)
    transport.abort()


async def test_xon_is_told_as_soon_as_there_is_room() -> None:
    transport, near = await opened("sim://camm1?name=x&instruction_time_s=0.001")
    transport.write(b"\x1b.I80;;17:\x1b.N;19:" + b"PU;" * 330)
    loop = asyncio.get_running_loop()
    began = loop.time()
    assert await near.until_heard(b"\x13\x11") == b"\x13\x11"
    assert loop.time() - began == pytest.approx(0.16, abs=0.02)
    transport.write(b"OA;")
    assert await near.until_heard(b"\r") == b"0,0,0\r"
    transport.abort()


async def test_a_wired_dtr_holds_back_what_the_host_writes() -> None:
    cutter = cutter_named("d", Knobs(baudrate=9600, dtr_wired=True))
    cutter.press_pause()
    transport, near = await opened("sim://camm1?name=d")
    transport.set_write_buffer_limits(high=256)
    for _ in range(40):
        transport.write(b"PU1,1;" * 10)
        await asyncio.sleep(0.1)
    assert near.pauses == ["paused"]
    assert not cutter.is_dtr_high
    assert cutter.lost_bytes == 0
    assert transport.get_write_buffer_size() > 1000
    cutter.press_pause()
    await asyncio.sleep(100)
    assert near.pauses == ["paused", "resumed"]
    assert transport.get_write_buffer_size() == 0
    assert cutter.cuttings.vectors.total == 400
    transport.abort()


async def test_the_driver_of_a_host_takes_no_more_than_it_can_hold() -> None:
    cutter = cutter_named("q", Knobs(baudrate=9600, host_queue=300, time_factor=0))
    transport, _ = await opened("sim://camm1?name=q")
    for _ in range(100):
        transport.write(b"PU1,1;" * 10)
    await asyncio.sleep(0.1)
    assert 5000 < transport.get_write_buffer_size() < 6000
    await asyncio.sleep(6000 / 960 + 0.1)
    assert transport.get_write_buffer_size() == 0
    assert cutter.cuttings.vectors.total == 1000
    transport.abort()


@pytest.mark.parametrize(("knob", "lost"), [(True, True), (False, False)])
async def test_what_a_driver_has_not_sent_may_be_lost_with_the_port(knob: bool, lost: bool) -> None:
    cutter = cutter_named("p", Knobs(baudrate=9600, lost_on_close=knob, time_factor=0))
    transport, _ = await opened("sim://camm1?name=p")
    transport.write(b"PU1,1;" * 100)
    await asyncio.sleep(0.1)
    transport.close()
    await asyncio.sleep(1)
    assert (cutter.cuttings.vectors.total < 20) == lost
    assert bool(cutter.log.texts(LogKind.TROUBLE)) == lost


async def test_who_wants_to_know_is_told_in_time() -> None:
    cutter = cutter_named("w")
    seen: list[tuple[float, str]] = []
    loop = asyncio.get_running_loop()
    cutter.log.on_entry = lambda entry: seen.append((loop.time(), entry.text))
    transport, _ = await opened("sim://camm1?name=w")
    transport.write(b"PU400,0;PD0,0;PU;")
    await asyncio.sleep(10)
    told = {text: at for at, text in seen}
    assert told["PU"] == pytest.approx(0.03, abs=0.001)
    transport.abort()


async def test_a_cutter_that_nobody_watches_is_looked_at_now_and_then() -> None:
    cutter = cutter_named("n")
    transport, _ = await opened("sim://camm1?name=n")
    transport.write(b"PD4000,0;" * 3)
    await asyncio.sleep(2.5)
    assert len(cutter.log.texts(LogKind.INSTRUCTION)) == 3
    transport.abort()


async def test_it_is_served_in_memory_and_with_faults() -> None:
    cutter = SimulatedCutter(Knobs(time_factor=0))
    async with serve_loopback(cutter, "cutter") as url:
        transport, near = await opened(url)
        transport.write(b"\x1b.A:")
        assert await near.until_heard(b"\r") == b"1610\r"
        transport.abort()
        await asyncio.sleep(0)
    far_end = FarEnd(cutter, tcp_outlet(cutter), read_faults(["power@1s+2s"]))
    async with far_end.served() as url:
        far_end.start_timetable()
        transport, near = await opened(url)
        await asyncio.sleep(1.5)
        transport.write(b"\x1b.B")
        await asyncio.sleep(2)
        assert near.heard == b""
        transport.write(b"\x1b.B")
        await near.until_heard(b"\r")
        transport.abort()
    assert cutter.log.texts(LogKind.POWER) == ["off", "on"]


@pytest.mark.real_time
async def test_it_is_served_on_tcp_and_as_a_serial_port() -> None:
    cutter = SimulatedCutter(Knobs(baudrate=115200, time_factor=0))
    async with serve_tcp(cutter) as url:
        transport, near = await opened(url)
        transport.write(b"PD10,10;\x1b.A:")
        assert await near.until_heard(b"\r") == b"1610\r"
        transport.abort()
    async with serve_pty(cutter) as url:
        transport, near = await opened(url)
        transport.write(b"PD20,20;\x1b.A:")
        assert await near.until_heard(b"\r") == b"1610\r"
        transport.abort()
    cutter.advance()
    assert [each.x1 for each in cutter.cuttings.cut] == [10, 20]


@pytest.mark.real_time
async def test_a_wired_dtr_leaves_bytes_in_the_pty() -> None:
    cutter = SimulatedCutter(Knobs(dtr_wired=True, time_factor=0))
    cutter.press_pause(0.0)
    async with serve_pty(cutter) as url:
        port = os.open(url.removeprefix("serial://").partition("?")[0], os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            written = 0
            async with asyncio.timeout(30):
                while True:
                    try:
                        written += os.write(port, b"PU;" * 20)
                    except BlockingIOError:
                        if cutter.holds_host:
                            break
                    await asyncio.sleep(0)
            assert cutter.lost_bytes == 0
            assert written > 1024
            cutter.press_pause()
            async with asyncio.timeout(30):
                await until(lambda: len(cutter.log.texts(LogKind.INSTRUCTION)) >= written // 3)
            assert cutter.lost_bytes == 0
        finally:
            os.close(port)


async def test_a_long_job_is_taken_in_seconds_and_to_the_byte() -> None:
    cutter = cutter_named("m", Knobs(baudrate=115200, physical_size=256, dtr_wired=True, time_factor=0.01))
    transport, _ = await opened("sim://camm1?name=m")
    places = [(n * 37 % 1100, n * 91 % 1100) for n in range(30_000)]
    began = time.process_time()
    transport.write("".join(f"PD{x},{y};" for x, y in places).encode())
    await asyncio.sleep(1)
    while not cutter.is_idle:
        await asyncio.sleep(1)
        cutter.advance()
    assert time.process_time() - began < 30
    assert cutter.lost_bytes == 0
    assert [(each.x1, each.y1) for each in cutter.cuttings.vectors] == places
    transport.abort()
