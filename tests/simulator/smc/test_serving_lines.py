"""A simulated line is found by its URL, by its name, on TCP, and keeps its state in a file."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from compax_aio.errors import TransportError
from compax_aio.simulator.compax import SimulatedDrive
from compax_aio.simulator.server import drive_named, line_named, serve_loopback, serve_tcp_group
from compax_aio.simulator.smc import Knobs, SimulatedPartyLine
from compax_aio.transports.registry import open_transport


class Caller(asyncio.Protocol):
    """Sends, and keeps what comes."""

    def __init__(self) -> None:
        self.received = b""

    def data_received(self, data: bytes) -> None:
        self.received += data


async def told(url: str, data: bytes) -> bytes:
    """Connect, send characters one by one, and return what came."""
    caller = Caller()
    transport = await open_transport(url, lambda: caller)
    for byte in data:
        transport.write(bytes([byte]))
        await asyncio.sleep(0.1)
    transport.abort()
    await asyncio.sleep(0)
    return caller.received


async def test_a_line_is_opened_by_its_url() -> None:
    assert await told("sim://smc?axes=XY&width=0", b"\nX^\nY^\n") == b"X^0\nY^0\n"


async def test_a_line_that_has_a_name_lives_on() -> None:
    assert await told("sim://smc?name=l&axes=XY", b"\nXR500\n") == b"XR500\n"
    await asyncio.sleep(5)
    assert line_named("l").axes["X"].position == 500
    assert await told("sim://smc?name=l", b"\nXZ\n") == b"XZ       500\n"
    with pytest.raises(TransportError, match="exists and has other knobs"):
        await told("sim://smc?name=l&axes=X", b"")
    with pytest.raises(TransportError, match="exists and has other knobs"):
        line_named("l", Knobs())


async def test_a_name_belongs_to_one_kind() -> None:
    drive_named("x")
    with pytest.raises(TransportError, match="another kind is named 'x'"):
        line_named("x")
    with pytest.raises(TransportError, match="another kind is named 'x'"):
        await told("sim://smc?name=x", b"")


async def test_a_line_tells_which_knobs_it_has() -> None:
    with pytest.raises(TransportError, match="a simulated SMC line has no knob 'unit'"):
        await told("sim://smc?unit=mm", b"")


async def test_a_test_that_lays_hands_on_an_axis_is_seen_at_once() -> None:
    line = SimulatedPartyLine(Knobs(stream_interval_s=0.2))
    async with serve_loopback(line, "bus") as url:
        caller = Caller()
        transport = await open_transport(url, lambda: caller)
        await asyncio.sleep(1)
        line.inject(b"noise")
        line.axes["A"].jog(500)
        await asyncio.sleep(0)
        assert line.axes["A"].moving
        await asyncio.sleep(5)
        assert line.axes["A"].position == 500
        assert caller.received == b"noise"
        transport.abort()


async def test_drives_and_lines_keep_their_states_side_by_side(tmp_path: Path) -> None:
    async with serve_tcp_group({"drive": SimulatedDrive(), "line": SimulatedPartyLine()}, state=tmp_path) as urls:
        assert await told(urls["line"], b"\nAV700\nAS\n") == b"AV700\nAS\n"
    line = SimulatedPartyLine()
    async with serve_tcp_group({"drive": SimulatedDrive(), "line": line}, state=tmp_path):
        assert line.axes["A"].parameters.slew_speed == 700


async def test_the_state_of_another_kind_or_of_other_axes_is_refused(tmp_path: Path) -> None:
    async with serve_loopback(SimulatedPartyLine(), "x", state=tmp_path / "x.json"):
        pass
    with pytest.raises(TransportError, match="is no state of a simulated drive"):
        await serve_loopback(SimulatedDrive(), "x", state=tmp_path / "x.json").__aenter__()
    with pytest.raises(TransportError, match=r"x.json holds no state of 'line': it is of the axes A, not B"):
        await serve_loopback(SimulatedPartyLine(Knobs(axes="B")), "x", state=tmp_path / "x.json").__aenter__()
