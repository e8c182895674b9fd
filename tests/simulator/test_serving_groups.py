"""Many simulated drives are served by one call, and keep their state from one time to the next."""

from __future__ import annotations

import json
import os
import socket
from collections.abc import Callable
from contextlib import AbstractAsyncContextManager
from pathlib import Path

import pytest
from tests.simulator.test_serving import PROMPT, Caller, calling

from compax_aio.errors import TransportError
from compax_aio.simulator.compax import Knobs, LogKind, SimulatedDrive
from compax_aio.simulator.compax.state import read_state_file, write_state_file
from compax_aio.simulator.line import Host
from compax_aio.simulator.server import serve_loopback, serve_pty, serve_tcp, serve_tcp_group
from compax_aio.transports.registry import open_transport


@pytest.fixture
def drives() -> dict[str, SimulatedDrive]:
    return {name: SimulatedDrive(Knobs(position=place), name=name) for place, name in enumerate("xyz")}


def free_ports(count: int) -> int:
    """Find the first of *count* ports that follow each other and are free."""
    for first in range(20_000 + os.getpid() % 20_000, 60_000, count):
        try:
            sockets = [socket.create_server(("127.0.0.1", first + place)) for place in range(count)]
        except OSError:
            continue
        for each in sockets:
            each.close()
        return first
    raise AssertionError("no free ports")


async def test_each_drive_of_a_group_has_a_port_of_its_own(drives: dict[str, SimulatedDrive]) -> None:
    async with serve_tcp_group(drives) as urls:
        assert list(urls) == ["x", "y", "z"]
        assert len(set(urls.values())) == 3
        for place, url in enumerate(urls.values()):
            async with calling(url) as caller:
                await caller.ask("S1", b"S001: %d.00\r\n>" % place)
    with pytest.raises(TransportError):
        await open_transport(urls["y"], Caller)


async def test_the_ports_follow_each_other(drives: dict[str, SimulatedDrive]) -> None:
    first = free_ports(3)
    async with serve_tcp_group(drives, port=first) as urls:
        assert urls == {name: f"tcp://127.0.0.1:{first + place}" for place, name in enumerate("xyz")}
        async with calling(urls["z"]) as caller:
            await caller.ask("S1", b"S001: 2.00\r\n>")


async def test_a_group_moves_at_the_same_time(drives: dict[str, SimulatedDrive]) -> None:
    async with serve_tcp_group(drives) as urls, calling(urls["x"]) as x, calling(urls["y"]) as y:
        await x.ask("PA 100")
        await y.ask("PA 100")
        assert drives["x"].moving
        assert drives["y"].moving
        assert not drives["z"].moving


async def test_a_port_that_is_taken_closes_all_again(drives: dict[str, SimulatedDrive], tmp_path: Path) -> None:
    first = free_ports(3)
    with socket.create_server(("127.0.0.1", first + 2)):
        with pytest.raises(TransportError, match=f"'z': .*'z' cannot be served on 127.0.0.1 port {first + 2}"):
            await serve_tcp_group(drives, port=first).__aenter__()
        for port in (first, first + 1):
            with pytest.raises(TransportError):
                await open_transport(f"tcp://127.0.0.1:{port}", Caller)
    async with serve_tcp_group(drives, port=first) as urls:
        assert len(urls) == 3


async def test_one_port_that_is_taken_is_named_too() -> None:
    with (
        socket.create_server(("127.0.0.1", 0)) as taken,
        pytest.raises(TransportError, match=r"'drive' cannot be served on 127.0.0.1 port .*; take another port"),
    ):
        await serve_tcp(SimulatedDrive(), port=taken.getsockname()[1]).__aenter__()


@pytest.mark.parametrize("port", [65_534, 65_536, -1])
async def test_ports_that_do_not_exist_are_refused(drives: dict[str, SimulatedDrive], port: int) -> None:
    with pytest.raises(TransportError, match=r"no 3 ports from|cannot be served"):
        await serve_tcp_group(drives, port=port).__aenter__()


async def test_one_drive_does_not_stand_under_two_names() -> None:
    with pytest.raises(TransportError, match="twice"):
        await serve_tcp_group(dict.fromkeys("xy", SimulatedDrive())).__aenter__()


async def test_a_group_of_none_is_served_too() -> None:
    async with serve_tcp_group({}, port=1) as urls:
        assert urls == {}


def in_memory(drive: SimulatedDrive, *, state: Path) -> AbstractAsyncContextManager[str]:
    return serve_loopback(drive, "axis", state=state)


@pytest.mark.parametrize("serve", [serve_tcp, serve_pty, in_memory])
async def test_a_served_drive_goes_on_where_it_was(
    serve: Callable[..., AbstractAsyncContextManager[str]], tmp_path: Path
) -> None:
    path = tmp_path / "x.json"
    async with serve(SimulatedDrive(), state=path) as url, calling(url) as caller:
        assert not path.exists()
        await caller.ask("V1=7")
        await caller.ask("PA 12.5$", PROMPT + b"$\r\n>")
    assert read_state_file(path)["axis"]["position"] == 12.5
    drive = SimulatedDrive()
    async with serve(drive, state=str(path)) as url, calling(url) as caller:
        await caller.ask("S1", b"S001: 12.50\r\n>")
        await caller.ask("V1", b"V001: 7\r\n>")
    assert drive.log.texts(LogKind.POWER) == ["off", "on"]


async def test_the_state_is_saved_also_when_serving_ends_by_an_error(tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    drive = SimulatedDrive(Knobs(position=4))
    with pytest.raises(RuntimeError, match="of mine"):
        async with serve_tcp(drive, state=path):
            raise RuntimeError("an error of mine")
    assert read_state_file(path)["axis"]["position"] == 4


async def test_a_group_keeps_a_file_for_each_name(drives: dict[str, SimulatedDrive], tmp_path: Path) -> None:
    folder = tmp_path / "new" / "cell"
    async with serve_tcp_group(drives, state=folder) as urls, calling(urls["y"]) as caller:
        await caller.ask("PA 50$", PROMPT + b"$\r\n>")
    assert sorted(each.name for each in folder.iterdir()) == ["x.json", "y.json", "z.json"]
    again = {name: SimulatedDrive(name=name) for name in "zy"}
    async with serve_tcp_group(again, state=folder):
        assert (again["y"].position, again["z"].position) == (50, 2)


async def test_a_file_that_cannot_be_loaded_stops_all_before_anything_has_changed(
    drives: dict[str, SimulatedDrive], tmp_path: Path
) -> None:
    state = SimulatedDrive(Knobs(position=9)).save_state()
    write_state_file(tmp_path / "x.json", state)
    (tmp_path / "z.json").write_text(json.dumps({**state, "cycles": "many"}))
    before = (tmp_path / "x.json").stat().st_mtime_ns
    with pytest.raises(
        TransportError, match=r"z.json is no state of a simulated drive: cycles = 'many'.*mend the file"
    ):
        await serve_tcp_group(drives, state=tmp_path).__aenter__()
    assert drives["x"].position == 0
    assert (tmp_path / "x.json").stat().st_mtime_ns == before
    assert not (tmp_path / "y.json").exists()
    with pytest.raises(TransportError, match=r"z\.json"):
        await serve_tcp(drives["z"], state=tmp_path / "z.json").__aenter__()
    assert (tmp_path / "z.json").read_text().endswith('"many", "operating_time_s": 0.0}')


async def test_a_state_wants_a_folder_that_is_there(drives: dict[str, SimulatedDrive], tmp_path: Path) -> None:
    with pytest.raises(TransportError, match="there is no folder"):
        await serve_tcp(drives["x"], state=tmp_path / "none" / "x.json").__aenter__()
    (tmp_path / "file").touch()
    with pytest.raises(TransportError, match="cannot be used"):
        await serve_tcp_group(drives, state=tmp_path / "file").__aenter__()


@pytest.mark.parametrize("name", ["", "a/b", ".x", ".."])
async def test_a_name_that_is_no_file_keeps_no_state(name: str, tmp_path: Path) -> None:
    with pytest.raises(TransportError, match="can be no file name"):
        await serve_tcp_group({name: SimulatedDrive()}, state=tmp_path).__aenter__()
    async with serve_tcp_group({name: SimulatedDrive()}) as urls:
        assert list(urls) == [name]


async def test_a_state_that_cannot_be_saved_is_told(tmp_path: Path) -> None:
    folder = tmp_path / "cell"
    folder.mkdir()
    with pytest.raises(TransportError, match="the state of 'drive' cannot be saved"):
        async with serve_tcp(SimulatedDrive(), state=folder / "x.json") as url:
            folder.rmdir()
    with pytest.raises(TransportError):
        await open_transport(url, Caller)


class Stateless:
    """A device that is served, and keeps nothing."""

    name = "lamp"
    baudrate = 0
    served_by: Host | None = None

    def receive(self, data: bytes, now: float) -> None: ...

    def take_output(self, now: float) -> bytes:
        return b""

    def next_event_at(self) -> float | None:
        return None

    def connect(self, now: float | None = None) -> None: ...

    def disconnect(self, now: float | None = None) -> None: ...


async def test_a_device_without_a_state_keeps_none(tmp_path: Path) -> None:
    async with serve_tcp(Stateless()):
        pass
    with pytest.raises(TransportError, match="'lamp' has no state"):
        await serve_tcp(Stateless(), state=tmp_path / "x.json").__aenter__()
    assert not (tmp_path / "x.json").exists()
