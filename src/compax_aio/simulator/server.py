"""Simulated devices where programs find them: ``sim://``, ``loop://``, TCP and pseudo-terminals."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from typing import Final

from compax_aio.errors import TransportError
from compax_aio.transports.loopback import create_pair, listen
from compax_aio.transports.registry import ProtocolFactory
from compax_aio.transports.url import TransportURL

from .compax.drive import SimulatedDrive
from .compax.knobs import Knobs
from .line import Connection, DeviceLine, SimulatedDevice

__all__ = ["drive_named", "open_simulator", "serve_loopback", "serve_pty", "serve_tcp"]

_FORM: Final = "sim://compax?name=x&answer_time_s=0.005"
_NAME: Final = "name"


async def open_simulator(url: TransportURL, protocol_factory: ProtocolFactory) -> asyncio.Transport:
    """
    Open ``sim://compax?<knobs>``: a simulated drive in this process; each knob of the drive is an option.

    With ``name=`` all URLs of that name in one event loop are the same drive, which lives on between connections;
    without it each connection gets a new one.

    Raises:
        TransportError: No such kind of device, no such knob or value, or somebody else is connected to that drive.
    """
    url.expect(_FORM, host=True, query=tuple(url.query))
    if url.host not in _KINDS:
        raise TransportError(f"there is no simulated {url.host!r}", hint=f"kinds of device: {', '.join(_KINDS)}")
    line = DeviceLine.of(_KINDS[url.host](url.query))
    # A connection that has just been lost at this end is given back in the next turn of the loop.
    for _ in range(2):
        if line.occupied:
            await asyncio.sleep(0)
    if line.occupied:
        raise TransportError(
            f"somebody else is connected to {url}", hint="close that connection first; a serial line has two ends"
        )
    near, _ = create_pair(protocol_factory(), Connection(line, set()), asyncio.get_running_loop(), name=str(url))
    return near


def drive_named(name: str, knobs: Knobs | None = None) -> SimulatedDrive:
    """
    Return the drive that ``sim://compax?name=...`` opens in the running event loop; it is made if there is none.

    Args:
        name: Any text.
        knobs: What the drive must be like; None: the default for a new one, and anything for one that exists.

    Raises:
        TransportError: The drive exists and has other knobs.
    """
    loop = asyncio.get_running_loop()
    for other in [each for each in _named if each.is_closed()]:
        del _named[other]
    drives = _named.setdefault(loop, {})
    drive = drives.get(name)
    if drive is None:
        drive = drives[name] = SimulatedDrive(knobs, name=name)
    elif knobs not in {None, drive.knobs}:
        raise TransportError(
            f"a simulated drive named {name!r} exists and has other knobs",
            hint="give the knobs where it is opened first, and later its name alone",
        )
    return drive


@asynccontextmanager
async def serve_tcp(device: SimulatedDevice, host: str = "127.0.0.1", port: int = 0) -> AsyncIterator[str]:
    """
    Serve a device on TCP; gives its ``tcp://`` URL. One connection at a time; a second one is hung up at once.

    Args:
        device: What to serve.
        host: Address to listen on.
        port: Port number; 0 takes a free one.
    """
    line = DeviceLine.of(device)
    connections: set[Connection] = set()
    server = await asyncio.get_running_loop().create_server(lambda: Connection(line, connections), host, port)
    try:
        port = server.sockets[0].getsockname()[1]
        yield f"tcp://[{host}]:{port}" if ":" in host else f"tcp://{host}:{port}"
    finally:
        server.close()
        await _hang_up(connections)
        await server.wait_closed()


@asynccontextmanager
async def serve_pty(device: SimulatedDevice) -> AsyncIterator[str]:
    """
    Serve a device on a pseudo-terminal; gives its ``serial://`` URL. Linux and macOS.

    Raises:
        TransportError: Somebody else is connected to the device.
    """
    from .pseudo_terminal import PseudoTerminal  # noqa: PLC0415  # there are none on Windows

    terminal = PseudoTerminal(DeviceLine.of(device))
    try:
        yield f"serial://{terminal.path}"
    finally:
        terminal.close()


@asynccontextmanager
async def serve_loopback(device: SimulatedDevice, name: str) -> AsyncIterator[str]:
    """
    Serve a device in memory; gives its ``loop://`` URL. One connection at a time; a second one is hung up at once.

    Raises:
        TransportError: Another listener has that name.
    """
    line = DeviceLine.of(device)
    connections: set[Connection] = set()
    with await listen(name, lambda: Connection(line, connections)) as listener:
        try:
            yield listener.url
        finally:
            await _hang_up(connections)


async def _hang_up(connections: set[Connection]) -> None:
    for connection in tuple(connections):
        connection.abort()
    await asyncio.sleep(0)  # in which their connection_lost is called


def _compax(query: Mapping[str, str]) -> SimulatedDrive:
    name = query.get(_NAME)
    options = {key: value for key, value in query.items() if key != _NAME}
    knobs = Knobs.from_query(options)
    return SimulatedDrive(knobs) if name is None else drive_named(name, knobs if options else None)


_KINDS: Final[Mapping[str, Callable[[Mapping[str, str]], SimulatedDevice]]] = {"compax": _compax}

_named: dict[asyncio.AbstractEventLoop, dict[str, SimulatedDrive]] = {}
