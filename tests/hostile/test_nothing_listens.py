"""Nothing listens where others could reach it, unless it was told to."""

from __future__ import annotations

import ast
import asyncio
import inspect
import ipaddress
from pathlib import Path
from typing import Any

import pytest

import compax_aio
from compax_aio.simulator import server
from compax_aio.simulator.compax import SimulatedDrive
from compax_aio.simulator.server import serve_loopback, serve_tcp, serve_tcp_group

LISTENING = frozenset({"create_server", "create_unix_server", "start_server", "start_unix_server", "bind", "listen"})


def listeners_of_linux() -> set[tuple[str, int]]:
    """List the addresses and ports on which this machine listens, as the kernel tells them."""
    found = set()
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/net/{table}").read_text(encoding="ascii").splitlines()[1:]:
            _, local, _, state, *_ = line.split()
            if state == "0A":
                address, port = local.split(":")
                words = [bytes.fromhex(address[at : at + 8])[::-1] for at in range(0, len(address), 8)]
                found.add((str(ipaddress.ip_address(b"".join(words))), int(port, 16)))
    return found


@pytest.mark.real_time
@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="only Linux tells it so")
async def test_a_simulated_drive_is_served_to_this_computer_alone() -> None:
    async with (
        serve_tcp(SimulatedDrive()) as url,
        serve_tcp_group({"y": SimulatedDrive(), "z": SimulatedDrive()}) as urls,
    ):
        ports = {int(each.rpartition(":")[2]) for each in (url, *urls.values())}
        ours = {(address, port) for address, port in listeners_of_linux() if port in ports}
        assert {port for _, port in ours} == ports
        assert {address for address, _ in ours} == {"127.0.0.1"}


@pytest.mark.parametrize("serve", [serve_tcp, serve_tcp_group])
def test_the_address_that_is_listened_on_is_loopback_unless_it_is_given(serve: Any) -> None:
    default = inspect.signature(serve).parameters["host"].default
    assert ipaddress.ip_address(default).is_loopback


async def test_simulation_and_loopback_open_no_socket(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: Any, **__: Any) -> None:
        raise AssertionError("something listens")

    loop = asyncio.get_running_loop()
    for name in ("create_server", "create_unix_server", "create_connection", "create_datagram_endpoint"):
        monkeypatch.setattr(type(loop), name, refuse)
    async with serve_loopback(SimulatedDrive(), "x") as url, compax_aio.connect(url) as drive:
        assert await drive.position() == 0
    async with compax_aio.connect("sim://compax") as drive:
        assert await drive.position() == 0
    with pytest.raises(AssertionError, match="listens"):
        async with serve_tcp(SimulatedDrive()):
            pass


def test_one_place_alone_listens_on_a_network() -> None:
    package = Path(compax_aio.__file__).parent
    places = {
        f"{path.relative_to(package).as_posix()}: {node.func.attr}"
        for path in package.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in LISTENING
    }
    assert places == {"simulator/server.py: create_server"}
    assert Path(server.__file__).name == "server.py"
