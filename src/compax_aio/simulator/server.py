"""Simulated devices where programs find them: ``sim://``, ``loop://``, TCP and pseudo-terminals."""

from __future__ import annotations

import asyncio
import os
from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from contextlib import AsyncExitStack, asynccontextmanager, contextmanager
from pathlib import Path
from typing import Any, Final, Protocol, TypeVar, runtime_checkable

from compax_aio.errors import TransportError
from compax_aio.transports.loopback import create_pair, listen
from compax_aio.transports.registry import ProtocolFactory
from compax_aio.transports.url import TransportURL

from .camm1.cutter import SimulatedCutter
from .camm1.knobs import Knobs as CutterKnobs
from .compax.drive import SimulatedDrive
from .compax.knobs import Knobs
from .haas.control import SimulatedControl
from .haas.knobs import Knobs as ControlKnobs
from .knobs import DeviceKnobs
from .line import Connection, DeviceLine, SimulatedDevice
from .smc.knobs import Knobs as LineKnobs
from .smc.line import SimulatedPartyLine
from .state_file import write_state_file

__all__ = [
    "control_named",
    "cutter_named",
    "drive_named",
    "kept",
    "line_named",
    "open_simulator",
    "serve_loopback",
    "serve_pty",
    "serve_tcp",
    "serve_tcp_group",
    "state_files",
]

_FORM: Final = "sim://compax?name=x&answer_time_s=0.005"
_NAME: Final = "name"
_LAST_PORT: Final = 65_535

_File = str | os.PathLike[str]
_T = TypeVar("_T", bound=SimulatedDevice)


@runtime_checkable
class _Lasting(Protocol):
    """A device that has a state."""

    def save_state(self) -> dict[str, Any]:
        """Return what it keeps without power."""

    def load_state(self, state: Mapping[str, Any]) -> None:
        """Have kept that."""

    def read_state_file(self, path: _File) -> dict[str, Any]:
        """Read a file of a state."""


async def open_simulator(url: TransportURL, protocol_factory: ProtocolFactory) -> asyncio.Transport:
    """
    Open ``sim://compax?<knobs>``, ``sim://smc?…``, ``sim://camm1?…`` or ``sim://haas?…``: a simulated device.

    It lives in this process. Each knob is an option.

    With ``name=`` all URLs of that name in one event loop are the same device, which lives on between connections;
    without it each connection gets a new one.

    Raises:
        TransportError: No such kind of device, no such knob or value, or somebody else is connected to that device.
    """
    url.expect(_FORM, host=True, query=tuple(url.query))
    if url.host not in _KINDS:
        raise TransportError(f"there is no simulated {url.host!r}", hint=f"kinds of device: {', '.join(_KINDS)}")
    query = {key: value for key, value in url.query.items() if key != _NAME}
    line = DeviceLine.of(_device(url.host, query, url.query.get(_NAME)))
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
        TransportError: The drive exists and has other knobs, or a device of another kind has that name.
    """
    return _named(SimulatedDrive, name, knobs)


def line_named(name: str, knobs: LineKnobs | None = None) -> SimulatedPartyLine:
    """Return the line that ``sim://smc?name=...`` opens, like :func:`drive_named`; raises TransportError."""
    return _named(SimulatedPartyLine, name, knobs)


def cutter_named(name: str, knobs: CutterKnobs | None = None) -> SimulatedCutter:
    """Return the cutter that ``sim://camm1?name=...`` opens, like :func:`drive_named`; raises TransportError."""
    return _named(SimulatedCutter, name, knobs)


def control_named(name: str, knobs: ControlKnobs | None = None) -> SimulatedControl:
    """Return the control that ``sim://haas?name=...`` opens, like :func:`drive_named`; raises TransportError."""
    return _named(SimulatedControl, name, knobs)


@asynccontextmanager
async def serve_tcp(
    device: SimulatedDevice, host: str = "127.0.0.1", port: int = 0, *, state: _File | None = None
) -> AsyncIterator[str]:
    """
    Serve a device on TCP; gives its ``tcp://`` URL. One connection at a time; a second one is hung up at once.

    Args:
        device: What to serve.
        host: Address to listen on.
        port: Port number; 0 takes a free one.
        state: File of what the device keeps without power: loaded first if it is there, saved when serving ends.

    Raises:
        TransportError: The port cannot be had, or the file cannot be used.
    """
    line = DeviceLine.of(device)
    connections: set[Connection] = set()
    try:
        server = await asyncio.get_running_loop().create_server(lambda: Connection(line, connections), host, port)
    except (OSError, OverflowError) as error:
        raise TransportError(
            f"the simulated device {device.name!r} cannot be served on {host} port {port}: {error}",
            hint="take another port, or 0 for a free one",
        ) from error
    try:
        with kept(device, state):
            port = server.sockets[0].getsockname()[1]
            yield f"tcp://[{host}]:{port}" if ":" in host else f"tcp://{host}:{port}"
    finally:
        server.close()
        await _hang_up(connections)
        await server.wait_closed()


@asynccontextmanager
async def serve_tcp_group(
    devices: Mapping[str, SimulatedDevice], host: str = "127.0.0.1", port: int = 0, *, state: _File | None = None
) -> AsyncIterator[Mapping[str, str]]:
    """
    Serve several devices on TCP, each on a port of its own, like :func:`serve_tcp`; gives their URLs by name.

    Args:
        devices: What to serve, by name.
        host: Address to listen on.
        port: Port number of the first; the others take those that follow, in the order of *devices*. 0: free ones.
        state: Folder of what they keep without power, a file ``<name>.json`` each; it is made if it is not there.

    Raises:
        TransportError: A port cannot be had, or a file cannot be used; says which. Then nothing is served.
    """
    if len({id(device) for device in devices.values()}) < len(devices):
        raise TransportError("a simulated device is there twice", hint="make one for each name")
    if port and port + len(devices) - 1 > _LAST_PORT:
        raise TransportError(f"there are no {len(devices)} ports from {port} on", hint="begin with a smaller one")
    files = state_files(state, devices)
    async with AsyncExitStack() as stack:
        urls: dict[str, str] = {}
        for place, (name, device) in enumerate(devices.items()):
            try:
                served = serve_tcp(device, host, port + place if port else 0, state=files.get(name))
                urls[name] = await stack.enter_async_context(served)
            except TransportError as error:
                raise TransportError(f"{name!r}: {error.what}", hint=error.hint) from error
        yield urls


@asynccontextmanager
async def serve_pty(
    device: SimulatedDevice, *, state: _File | None = None, link: _File | None = None
) -> AsyncIterator[str]:
    """
    Serve a device on a pseudo-terminal; gives its ``serial://`` URL. Linux and macOS.

    A device with a baud rate hears and says garbage if a program sets the port to another one
    (:class:`.PseudoTerminal`); then the URL names the right one.

    Args:
        device: What to serve.
        link: A symbolic link to make to the terminal, for the URL; it is taken away when serving ends.
        state: File of what the device keeps without power: loaded first if it is there, saved when serving ends.

    Raises:
        TransportError: Somebody else is connected to the device, or the file or the link cannot be used.
    """
    from .pseudo_terminal import PseudoTerminal  # noqa: PLC0415  # there are none on Windows

    terminal = PseudoTerminal(DeviceLine.of(device), link)
    try:
        with kept(device, state):
            yield terminal.url
    finally:
        terminal.close()


@asynccontextmanager
async def serve_loopback(device: SimulatedDevice, name: str, *, state: _File | None = None) -> AsyncIterator[str]:
    """
    Serve a device in memory; gives its ``loop://`` URL. One connection at a time; a second one is hung up at once.

    Args:
        device: What to serve.
        name: Of the line: ``loop://name``.
        state: File of what the device keeps without power: loaded first if it is there, saved when serving ends.

    Raises:
        TransportError: Another listener has that name, or the file cannot be used.
    """
    line = DeviceLine.of(device)
    connections: set[Connection] = set()
    with await listen(name, lambda: Connection(line, connections)) as listener:
        try:
            with kept(device, state):
                yield listener.url
        finally:
            await _hang_up(connections)


@contextmanager
def kept(device: SimulatedDevice, file: _File | None) -> Iterator[None]:
    """
    Load the state of *device* if there is a file, and save it at the end of the block.

    Raises:
        TransportError: The file cannot be used.
    """
    if file is None:
        yield
        return
    if not isinstance(device, _Lasting):
        raise TransportError(f"the simulated device {device.name!r} has no state to keep")
    path = Path(file)
    if (state := _state_in(path, device)) is not None:
        try:
            device.load_state(state)
        except ValueError as error:
            raise TransportError(f"{path} holds no state of {device.name!r}: {error}") from error
    try:
        yield
    finally:
        try:
            write_state_file(path, device.save_state())
        except OSError as error:
            raise TransportError(f"the state of {device.name!r} cannot be saved: {error}") from error


def _state_in(path: Path, device: _Lasting) -> dict[str, Any] | None:
    """Read a state of *device*; None if there is no file yet, and one can be made."""
    if not path.parent.is_dir():
        raise TransportError(f"no state can be kept in {path}", hint=f"there is no folder {path.parent}")
    if not path.exists():
        return None
    try:
        return device.read_state_file(path)
    except (OSError, ValueError) as error:
        raise TransportError(f"no state can be loaded: {error}", hint="mend the file, or take it away") from error


def state_files(folder: _File | None, devices: Mapping[str, SimulatedDevice]) -> Mapping[str, Path]:
    """
    Return the file of each name, in a folder that is made if it is not there; those that exist can be loaded.

    Raises:
        TransportError: A name can be no file, or a file or the folder cannot be used.
    """
    if folder is None:
        return {}
    for name in devices:
        if not name or name.startswith(".") or Path(name).name != name:
            raise TransportError(f"{name!r} can be no file name", hint="name the device otherwise, or keep no state")
    try:
        Path(folder).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise TransportError(f"the folder {folder} cannot be used: {error}") from error
    files = {name: Path(folder) / f"{name}.json" for name in devices}
    for name, device in devices.items():
        if isinstance(device, _Lasting):
            _state_in(files[name], device)
    return files


async def _hang_up(connections: set[Connection]) -> None:
    for connection in tuple(connections):
        connection.abort()
    await asyncio.sleep(0)  # in which their connection_lost is called


def _device(host: str, query: Mapping[str, str], name: str | None) -> SimulatedDevice:
    """Return the device of a URL, of the kind that its host says; one without a name is a new one."""
    kind, knobs_kind = _KINDS[host]
    knobs = knobs_kind.from_query(query)
    return kind(knobs) if name is None else _named(kind, name, knobs if query else None)


def _named(kind: Callable[..., _T], name: str, knobs: Any) -> _T:
    """Return the device of that name in the running event loop, of that kind; it is made if there is none."""
    loop = asyncio.get_running_loop()
    for other in [each for each in _devices if each.is_closed()]:
        del _devices[other]
    devices = _devices.setdefault(loop, {})
    device = devices.get(name)
    if device is None:
        device = devices[name] = kind(knobs, name=name)
    elif type(device) is not kind:
        raise TransportError(f"a simulated device of another kind is named {name!r}", hint="take another name")
    elif knobs not in {None, device.knobs}:
        raise TransportError(
            f"a simulated device named {name!r} exists and has other knobs",
            hint="give the knobs where it is opened first, and later its name alone",
        )
    return device


_KINDS: Final[Mapping[str, tuple[Callable[..., SimulatedDevice], type[DeviceKnobs]]]] = {
    "compax": (SimulatedDrive, Knobs),
    "smc": (SimulatedPartyLine, LineKnobs),
    "camm1": (SimulatedCutter, CutterKnobs),
    "haas": (SimulatedControl, ControlKnobs),
}

_devices: dict[asyncio.AbstractEventLoop, dict[str, Any]] = {}
