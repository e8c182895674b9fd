"""A device that is served with faults: each does what it says, ends when it should, and comes again by its seed."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Literal

import pytest

from compax_aio.errors import InvalidCommandError, TransportError
from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive
from compax_aio.simulator.far_end import FarEnd
from compax_aio.simulator.faulty_cable import Noise
from compax_aio.simulator.outlet import Outlet, pty_outlet, tcp_outlet
from compax_aio.simulator.planned_faults import kind_named, read_faults
from compax_aio.simulator.server import serve_loopback, serve_pty
from compax_aio.simulator.smc import Knobs as SmcKnobs
from compax_aio.simulator.smc import SimulatedPartyLine
from compax_aio.transports.registry import open_transport

ANSWER = b"S001: 0.00\r\n>"


class Host(asyncio.Protocol):
    """Somebody who asks S1, and keeps what comes and when."""

    def __init__(self) -> None:
        self.received: list[tuple[float, bytes]] = []
        self.lost = False
        self.transport: asyncio.Transport

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport

    def data_received(self, data: bytes) -> None:
        self.received.append((asyncio.get_running_loop().time(), data))

    def connection_lost(self, exc: Exception | None) -> None:
        self.lost = True

    @property
    def heard(self) -> bytes:
        return b"".join(data for _, data in self.received)

    async def ask(self, for_s: float = 1.0) -> bytes:
        """Ask, and return what has come in so many seconds."""
        self.received.clear()
        self.transport.write(b"S1\r")
        await asyncio.sleep(for_s)
        return self.heard


class Stage:
    """A drive with faults, on a line in memory, and what was said of it."""

    def __init__(self, *faults: str, seed: int = 0, device: SimulatedDrive | SimulatedPartyLine | None = None) -> None:
        self.device = device or SimulatedDrive(name="x")
        self.said: list[str] = []
        self.outlet = Outlet(lambda _: serve_loopback(self.device, "far-end"))
        self.far_end = FarEnd(self.device, self.outlet, read_faults(faults), seed=seed, say=self.said.append)

    @asynccontextmanager
    async def connected(self) -> AsyncIterator[Host]:
        async with self.far_end.served() as url:
            self.far_end.start_timetable()
            host = await self.connect(url)
            yield host
            host.transport.abort()

    async def connect(self, url: str = "loop://far-end") -> Host:
        host = Host()
        await open_transport(url, lambda: host)
        return host

    def begin(self, name: str, lasts_s: float | None = None, amount_s: float | None = None) -> None:
        self.far_end.begin(kind_named(name), lasts_s, amount_s)

    def end(self, name: str) -> None:
        self.far_end.end(kind_named(name))


# At somebody's word


async def test_without_faults_a_drive_answers_as_ever() -> None:
    async with Stage().connected() as host:
        assert await host.ask() == ANSWER


async def test_a_silent_drive_goes_on_working() -> None:
    stage = Stage()
    async with stage.connected() as host:
        stage.begin("silent")
        assert await host.ask() == b""
        host.transport.write(b"PA 5\r")
        await asyncio.sleep(3)
        stage.end("silent")
        assert await host.ask() == b"S001: 5.00\r\n>"
        stage.end("silent")
    assert stage.said.count("it is heard again") == 1


async def test_a_drive_that_is_held_takes_what_was_written_later() -> None:
    stage = Stage()
    async with stage.connected() as host:
        stage.begin("held", 5)
        assert await host.ask(4) == b""
        await asyncio.sleep(2)
        assert host.heard == ANSWER


async def test_a_host_that_connects_to_a_held_drive_is_held_as_well() -> None:
    stage = Stage()
    async with stage.connected() as first:
        stage.begin("held")
        first.transport.abort()
        await asyncio.sleep(0.1)
        host = await stage.connect()
        assert await host.ask() == b""
        stage.end("held")
        await asyncio.sleep(1)
        assert host.heard == ANSWER
        host.transport.abort()


async def test_a_late_drive_answers_so_much_later() -> None:
    stage = Stage()
    async with stage.connected() as host:
        stage.begin("late", amount_s=0.3)
        asked_at = asyncio.get_running_loop().time()
        assert await host.ask() == ANSWER
        assert host.received[0][0] == pytest.approx(asked_at + 0.302)
        stage.end("late")
        asked_at = asyncio.get_running_loop().time()
        await host.ask()
        assert host.received[0][0] == pytest.approx(asked_at + 0.002)


async def test_a_split_answer_comes_byte_by_byte() -> None:
    stage = Stage()
    async with stage.connected() as host:
        stage.begin("split", amount_s=0.01)
        assert await host.ask() == ANSWER
        assert [data for _, data in host.received] == [bytes([each]) for each in ANSWER]
        gaps = [later - sooner for (sooner, _), (later, _) in zip(host.received, host.received[1:], strict=False)]
        assert gaps == pytest.approx([0.01] * (len(ANSWER) - 1))
        stage.end("split")
        await host.ask()
        assert len(host.received) == 1


async def test_a_drive_without_power_says_nothing_and_forgets() -> None:
    stage = Stage()
    async with stage.connected() as host:
        stage.begin("power", 2)
        assert await host.ask() == b""
        await asyncio.sleep(2)
        assert await host.ask() == ANSWER
        stage.end("power")
    assert isinstance(stage.device, SimulatedDrive)
    assert stage.device.log.texts(LogKind.POWER) == ["off", "on"]
    assert stage.said.count("the power is back") == 1


async def test_an_unplugged_cable_is_noticed_and_can_be_plugged_in_again() -> None:
    stage = Stage()
    async with stage.connected() as host:
        stage.begin("unplug")
        await asyncio.sleep(0.1)
        assert host.lost
        with pytest.raises(TransportError):
            await stage.connect()
        stage.end("unplug")
        await asyncio.sleep(0.1)
        again = await stage.connect()
        assert await again.ask() == ANSWER
        again.transport.abort()
    assert "plugged in: loop://far-end" in stage.said


async def test_a_cable_is_where_it_was_put_last_however_fast() -> None:
    stage = Stage()
    async with stage.connected() as host:
        for _ in range(3):
            stage.begin("unplug")
            stage.end("unplug")
        await asyncio.sleep(0.1)
        assert host.lost
        (await stage.connect()).transport.abort()
        stage.begin("unplug", lasts_s=0)
        await asyncio.sleep(0.1)
        (await stage.connect()).transport.abort()
        stage.begin("unplug")
        stage.end("unplug")
        stage.begin("unplug")
        await asyncio.sleep(0.1)
        assert not stage.outlet.is_plugged
        assert stage.said[-1] == "unplug"


async def test_a_cable_that_is_out_cannot_be_cut() -> None:
    stage = Stage()
    async with stage.connected():
        stage.begin("unplug")
        stage.begin("cut")
        await asyncio.sleep(0.1)
        assert not stage.outlet.is_plugged
        assert stage.said == ["unplug", "cut, but the cable is out"]
        stage.end("unplug")
        stage.begin("cut")
        stage.begin("unplug")
        await asyncio.sleep(0.1)
        assert not stage.outlet.is_plugged


async def test_what_is_no_trouble_is_not_said_to_end() -> None:
    stage = Stage()
    async with stage.connected():
        for name in ("silent", "held", "power", "unplug"):
            stage.end(name)
        assert stage.said == []
        stage.begin("power")
        stage.begin("power", 1)
        stage.begin("late", amount_s=0.3)
        await asyncio.sleep(2)
        assert stage.said == ["power", "power for 1 s", "late by 0.3 s", "the power is back"]
        assert isinstance(stage.device, SimulatedDrive)
        assert stage.device.log.texts(LogKind.POWER) == ["off", "on"]


async def test_silence_is_told_once_an_answer() -> None:
    stage = Stage(device=SimulatedDrive(Knobs(baudrate=9600), name="x"))
    async with stage.connected() as host:
        stage.begin("silent")
        for _ in range(2):
            assert await host.ask() == b""
        assert stage.said == ["silent", *["silent: what the device sends is kept from the host"] * 2]


async def test_a_cut_line_is_there_again_at_once() -> None:
    stage = Stage()
    async with stage.connected() as host:
        stage.begin("cut")
        await asyncio.sleep(0.1)
        assert host.lost
        (await stage.connect()).transport.abort()


async def test_a_cable_that_cannot_be_plugged_in_again_is_told() -> None:
    stage = Stage()
    async with stage.connected():
        stage.begin("unplug")
        await asyncio.sleep(0.1)
        async with serve_loopback(SimulatedDrive(), "far-end"):
            stage.end("unplug")
            await asyncio.sleep(0.1)
    assert stage.said[-1].startswith("it cannot be plugged in: ")


async def test_a_fault_stops_the_drive() -> None:
    stage = Stage()
    async with stage.connected() as host:
        host.transport.write(b"PA 500\r")
        await asyncio.sleep(1)
        stage.begin("E55")
        await asyncio.sleep(1)
    assert isinstance(stage.device, SimulatedDrive)
    assert stage.device.fault == 55
    assert len(stage.device.log.texts(LogKind.MOTION_FAULT)) == 1


async def test_noise_befalls_bytes_until_it_is_ended() -> None:
    stage = Stage()
    async with stage.connected() as host:
        stage.far_end.set_noise(kind_named("doubled"), 1.0)
        assert await host.ask() == bytes(each for byte in b"E90\r\n>\r\n>" for each in (byte, byte))
        stage.far_end.set_noise(kind_named("doubled"), 0.0)
        await host.ask()
        assert await host.ask() == ANSWER


async def test_healing_ends_everything_that_is_done_to_bytes() -> None:
    stage = Stage("lost=1", "late=1:5s")
    async with stage.connected() as host:
        assert await host.ask() == b""
        stage.far_end.heal()
        assert await host.ask() == ANSWER


async def test_what_has_its_time_later_comes_after_healing_too() -> None:
    stage = Stage("lost=1@5s", "late=1:5s@5s")
    async with stage.connected() as host:
        stage.far_end.heal()
        assert await host.ask() == ANSWER
        await asyncio.sleep(5)
        assert await host.ask() == b""
        stage.far_end.set_noise(kind_named("lost"), 0)
        assert await host.ask() == b""
        await asyncio.sleep(5)
        assert ANSWER in host.heard


@pytest.mark.parametrize("mode", ["party", "daisy", "single"])
async def test_commands_of_steppers_are_counted_by_what_ends_them(mode: Literal["party", "daisy", "single"]) -> None:
    stage = Stage("silent=1:9s", device=SimulatedPartyLine(SmcKnobs(mode=mode), name="bus"))
    async with stage.connected() as host:
        host.transport.write({"party": b"\nAZ 0\n", "daisy": b"AZ 0\n", "single": b"Z 0\r"}[mode])
        await asyncio.sleep(1)
    assert stage.said[0] == "silent for 9 s"


async def test_a_spell_of_no_time_by_chance_is_over_at_once() -> None:
    stage = Stage("unplug=1:0s@0s+1s")
    async with stage.connected() as host:
        await host.ask()
        await asyncio.sleep(2)
        assert host.lost
        assert stage.outlet.is_plugged


async def test_only_drives_have_faults_of_drives() -> None:
    with pytest.raises(InvalidCommandError, match="bus has no fault E55"):
        Stage("E55@1s", device=SimulatedPartyLine(SmcKnobs(), name="bus"))


async def test_a_line_of_steppers_is_unplugged_and_without_power_as_well() -> None:
    line = SimulatedPartyLine(SmcKnobs(), name="bus")
    stage = Stage(device=line)
    async with stage.connected() as host:
        line.axes["A"].jog(500)
        stage.begin("power", 1)
        await asyncio.sleep(2)
        stage.begin("unplug")
        await asyncio.sleep(0.1)
        assert host.lost
    assert line.log.texts(*[kind for kind in type(line.log[0].kind) if kind.value == "power"]) == ["off", "on"]


# On a timetable


async def test_a_spell_begins_and_ends_on_time() -> None:
    async with Stage("silent@10s+5s").connected() as host:
        assert await host.ask() == ANSWER
        await asyncio.sleep(10)
        assert await host.ask() == b""
        await asyncio.sleep(5)
        assert await host.ask() == ANSWER


async def test_a_spell_without_an_end_goes_on() -> None:
    async with Stage("silent@1s").connected() as host:
        await asyncio.sleep(600)
        assert await host.ask() == b""


async def test_noise_has_its_time() -> None:
    async with Stage("lost@10s+5s").connected() as host:
        assert await host.ask() == ANSWER
        await asyncio.sleep(10)
        assert await host.ask() == b""
        await asyncio.sleep(5)
        assert await host.ask() == ANSWER


async def test_what_befalls_answers_has_its_time() -> None:
    async with Stage("late:3s@10s+5s").connected() as host:
        assert await host.ask() == ANSWER
        await asyncio.sleep(10)
        assert await host.ask() == b""
        await asyncio.sleep(6)
        assert await host.ask() == ANSWER


async def test_a_moment_comes_once() -> None:
    stage = Stage("E55@10s")
    async with stage.connected():
        await asyncio.sleep(9)
        assert isinstance(stage.device, SimulatedDrive)
        assert stage.device.fault is None
        await asyncio.sleep(2)
        assert stage.device.fault == 55


async def test_the_end_of_service_ends_the_timetable() -> None:
    stage = Stage("E55@10s", "unplug=1:10s")
    async with stage.connected() as host:
        await host.ask()
    await asyncio.sleep(20)
    assert isinstance(stage.device, SimulatedDrive)
    assert stage.device.fault is None
    assert not stage.outlet.is_plugged


# By chance


async def answers(*faults: str, seed: int, pieces: bool = False) -> list[bytes]:
    """Return what a host hears of forty questions, each sent at once or byte by byte."""
    stage = Stage(*faults, seed=seed)
    heard = []
    async with stage.connected() as host:
        for _ in range(40):
            if pieces:
                host.received.clear()
                for byte in b"S1\r":
                    host.transport.write(bytes([byte]))
                    await asyncio.sleep(0.001)
                await asyncio.sleep(5)
                heard.append(host.heard)
            else:
                heard.append(await host.ask(5))
    return heard


@pytest.mark.parametrize("fault", ["garbled=0.02", "lost=0.02", "doubled=0.02", "silent=0.2:10ms"])
async def test_the_same_seed_has_the_same_faults(fault: str) -> None:
    first = await answers(fault, seed=7)
    assert first == await answers(fault, seed=7)
    assert ANSWER in first
    assert any(each != ANSWER for each in first)
    assert first != await answers(fault, seed=8)


@pytest.mark.parametrize("fault", ["garbled=0.02", "lost=0.02", "late=0.3:200ms", "silent=0.2:10ms"])
async def test_pieces_in_which_bytes_come_change_nothing(fault: str) -> None:
    assert await answers(fault, seed=3) == await answers(fault, seed=3, pieces=True)


async def test_some_answers_are_late_and_the_others_are_not() -> None:
    stage = Stage("late=0.3:200ms", seed=1)
    late = 0
    async with stage.connected() as host:
        for _ in range(100):
            asked_at = asyncio.get_running_loop().time()
            assert await host.ask() == ANSWER
            took = host.received[0][0] - asked_at
            assert took == pytest.approx(0.002) or took == pytest.approx(0.202)
            late += took > 0.1
    assert 15 <= late <= 45


async def test_a_cut_by_chance_comes_within_an_answer() -> None:
    stage = Stage("cut=1")
    async with stage.connected() as host:
        heard = await host.ask()
        assert host.lost
        assert len(heard) < len(ANSWER)
        await asyncio.sleep(0.1)
        (await stage.connect()).transport.abort()
    assert "the line is cut within the answer" in stage.said


async def test_an_unplugged_cable_by_chance_comes_back() -> None:
    stage = Stage("unplug=1:2s")
    async with stage.connected() as host:
        await host.ask()
        assert host.lost
        with pytest.raises(TransportError):
            await stage.connect()
        await asyncio.sleep(2)
        (await stage.connect()).transport.abort()
    assert "unplug for 2 s" in stage.said


def test_each_way_draws_by_itself() -> None:
    one, other = (Noise("garbled", 0.5, "seed") for _ in range(2))
    alone = [one.befall("to_host", 0x41) for _ in range(50)]
    mixed = [(other.befall("to_drive", 0x42), other.befall("to_host", 0x41))[1] for _ in range(50)]
    assert alone == mixed
    assert {len(each) for each in alone if each is not None} == {1}


# Outlets


async def test_a_port_on_tcp_stays_the_same() -> None:
    outlet = tcp_outlet(SimulatedDrive())
    await outlet.plug()
    await outlet.plug()
    url = outlet.url
    await outlet.unplug()
    await outlet.unplug()
    await outlet.plug()
    assert outlet.url == url
    await outlet.unplug()


async def test_a_link_leads_to_each_new_terminal(tmp_path: Path) -> None:
    outlet = pty_outlet(SimulatedDrive(), tmp_path / "x")
    await outlet.plug()
    async with serve_pty(SimulatedDrive()):  # takes the next number
        await outlet.unplug()
        assert not (tmp_path / "x").is_symlink()
        await outlet.plug()
        assert (tmp_path / "x").readlink().is_char_device()
    await outlet.unplug()
