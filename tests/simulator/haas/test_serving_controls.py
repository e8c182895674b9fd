"""A simulated control where programs find it: in process, on TCP, on a pty; and how its wires are seen there."""

from __future__ import annotations

import asyncio
import time

import pytest
from tests.simulator.near_end import opened, until

from compax_aio.errors import TransportError
from compax_aio.simulator.far_end import FarEnd
from compax_aio.simulator.haas import Knobs, LogKind, SimulatedControl
from compax_aio.simulator.outlet import tcp_outlet
from compax_aio.simulator.planned_faults import read_faults
from compax_aio.simulator.server import control_named, cutter_named, kept, serve_loopback, serve_pty, serve_tcp

_FILE = b"%\r\nO00077\r\nM30\r\n%\r\n"


async def test_a_named_control_lives_on_between_connections() -> None:
    transport, near = await opened("sim://haas?name=mill&synchronization=xon/xoff&baudrate=9600")
    control = control_named("mill")
    control.press_recv()
    transport.write(_FILE)
    await until(lambda: control.screen == "RS232 DONE")
    transport.close()
    await asyncio.sleep(1)
    transport, near = await opened("sim://haas?name=mill")
    control.press_send("O00077")
    assert await near.until_heard(b"\n%\r\n") == b"\r\n%\r\nO00077\r\nM30\r\n\r\n%\r\n"
    assert control.log.texts(LogKind.CONNECTED, LogKind.DISCONNECTED) == ["", "", ""]
    with pytest.raises(TransportError, match="other knobs"):
        control_named("mill", Knobs())
    with pytest.raises(TransportError, match="another kind"):
        cutter_named("mill")
    with pytest.raises(TransportError, match="no state to keep"), kept(control, "nowhere.json"):
        pass
    with pytest.raises(TransportError, match="no knob 'speed'"):
        await opened("sim://haas?speed=9600")
    transport.abort()


async def test_requests_are_answered_in_the_time_of_their_bytes() -> None:
    transport, near = await opened("sim://haas?profile=collection&baudrate=1200")
    began = asyncio.get_running_loop().time()
    transport.write(b"Q100\r\n")
    answer = await near.until_heard(b">")
    assert answer == b"\x02S/N, 1234567\x17\r\n>"
    assert asyncio.get_running_loop().time() - began == pytest.approx((5 + len(answer)) * 10 / 1200, abs=0.011)
    transport.abort()


async def test_keys_press_themselves() -> None:
    transport, near = await opened("sim://haas?profile=dc_codes&press=recv,send:last")
    assert await near.until_heard(b"\x11") == b"\x11"
    transport.write(_FILE)
    assert await near.until_heard(b"\x13") == b"\x13"
    assert b"O00077\r\nM30" in await near.until_heard(b"\x14")
    transport.abort()


async def test_codes_come_at_the_time_of_the_last_percent_though_it_is_written_at_once() -> None:
    transport, near = await opened("sim://haas?profile=dc_codes&baudrate=9600&press=recv&press_after_s=0")
    await near.until_heard(b"\x11")
    began = asyncio.get_running_loop().time()
    transport.write(b"%\r\nO00077\r\n" + b"G0 X1.\r\n" * 500 + b"%\r\n")
    await near.until_heard(b"\x13")
    assert asyncio.get_running_loop().time() - began == pytest.approx(4014 * 11 / 9600, abs=0.02)
    transport.abort()


async def test_pin_4_holds_back_what_a_host_writes() -> None:
    control = control_named("w", Knobs.named("rts/cts", take_bytes_s=300.0))
    control.press_recv()
    transport, near = await opened("sim://haas?name=w")
    transport.set_write_buffer_limits(high=256)
    transport.write(b"%\r\nO00077\r\n")
    for _ in range(40):
        transport.write(b"G0 X1.\r\n" * 10)
        await asyncio.sleep(0.05)
    transport.write(b"%\r\n")
    assert near.pauses[0] == "paused"
    assert transport.get_write_buffer_size() > 500
    await until(lambda: control.screen != "")
    assert control.screen == "RS232 DONE"
    assert near.pauses[-1] == "resumed"
    assert control.lost_bytes == 0
    assert control.memory.programs["O00077"].count("G0 X1.") == 400
    assert not control.alarms
    transport.abort()


async def test_a_control_keeps_what_a_host_has_no_room_for_if_it_heeds_pin_5() -> None:
    for profile, is_kept in (("rts/cts", True), ("classic", False)):
        control = SimulatedControl(Knobs.named(profile, baudrate=115200, program_blocks=20_000))
        async with serve_loopback(control, profile.replace("/", "")) as url:
            transport, near = await opened(url)
            transport.pause_reading()
            control.press_send("O00010")
            await asyncio.sleep(100)
            assert (control.screen == "RS232 DONE") != is_kept
            transport.resume_reading()
            await asyncio.sleep(100)
            assert control.screen == "RS232 DONE"
            assert near.heard.endswith(b"M30\r\n\r\n%\r\n") == is_kept
            if is_kept:
                assert near.heard.count(b"\r\n") == 20_005
            transport.abort()
            await asyncio.sleep(0)


async def test_pin_5_is_let_go_with_the_connection() -> None:
    control = SimulatedControl(Knobs.named("rts/cts", baudrate=115200, program_blocks=20_000))
    async with serve_loopback(control, "gone") as url:
        transport, _ = await opened(url)
        transport.pause_reading()
        control.press_send("O00010")
        await asyncio.sleep(100)
        transport.abort()
        await asyncio.sleep(100)
        assert control.screen == "RS232 DONE"


async def test_the_driver_of_a_host_takes_no_more_than_it_can_hold() -> None:
    control = control_named("q", Knobs(baudrate=9600, host_queue=300, lost_on_close=True))
    transport, _ = await opened("sim://haas?name=q")
    for _ in range(100):
        transport.write(b"; " * 30)
    await asyncio.sleep(0.1)
    assert 5000 < transport.get_write_buffer_size() < 6000
    await asyncio.sleep(6000 * 11 / 9600)
    assert transport.get_write_buffer_size() == 0
    transport.write(b"; " * 30)
    await asyncio.sleep(0.001)
    transport.close()
    await asyncio.sleep(1)
    assert "bytes lost with the port" in control.log.texts(LogKind.TROUBLE)[0]


async def test_it_is_served_with_faults() -> None:
    control = SimulatedControl(Knobs())
    far_end = FarEnd(control, tcp_outlet(control), read_faults(["power@1s+2s"]))
    async with far_end.served() as url:
        far_end.start_timetable()
        transport, near = await opened(url)
        await asyncio.sleep(1.5)
        transport.write(b"Q100\r\n")
        await asyncio.sleep(2)
        assert near.heard == b""
        transport.write(b"Q100\r\n")
        await near.until_heard(b">")
        transport.abort()
    assert control.log.texts(LogKind.POWER) == ["off", "on"]


@pytest.mark.real_time
async def test_it_is_served_on_tcp_and_as_a_serial_port() -> None:
    control = SimulatedControl(Knobs(baudrate=115200))
    async with serve_tcp(control) as url:
        transport, near = await opened(url)
        transport.write(b"Q201\r\n")
        assert await near.until_heard(b">") == b"\x02USING TOOL, 4\x17\r\n>"
        transport.abort()
    async with serve_pty(control) as url:
        transport, near = await opened(url)
        control.press_recv()
        transport.write(_FILE)
        async with asyncio.timeout(30):
            await until(lambda: control.screen == "RS232 DONE")
        transport.abort()
    assert control.memory.programs["O00077"] == "O00077\nM30"


async def test_two_megabytes_pass_in_seconds_both_ways() -> None:
    control = control_named("m", Knobs(profile="xmodem", synchronization="xon/xoff", baudrate=115200))
    text = "".join(f"N{n}G01X{n % 97}.{n % 10}Y{n % 53}.5\n" for n in range(90_000))
    data = b"%\nO00077\n" + text.encode() + b"M30\n%\n"
    transport, near = await opened("sim://haas?name=m")
    began = time.process_time()
    control.press_recv()
    transport.write(data)
    await until(lambda: control.screen != "", 10.0)
    assert control.screen == "RS232 DONE"
    control.press_send("O00077")
    await until(lambda: control.screen != "", 10.0)
    assert time.process_time() - began < 30
    assert bytes(near.heard) == b"\n" + data[:-3] + b"\n\n%\n"
    transport.abort()
