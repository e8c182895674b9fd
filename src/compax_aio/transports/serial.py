"""Open ``serial://`` lines: in a thread, exclusively, and saying what to do when it cannot be done."""

from __future__ import annotations

import asyncio
import os
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final

from compax_aio.errors import TransportError

from .line_settings import LINE_OPTIONS, LineSettings
from .registry import ProtocolFactory
from .serial_backends import Port, backend_to_use, connect_on_pyserial, connect_on_serialx, open_port
from .serial_ports import PortInfo, list_ports, port_with_serial_number
from .serial_refusals import explained
from .url import TransportURL

if os.name == "posix":
    from .serial_line import SerialLine

__all__ = ["PortInfo", "list_ports", "open_serial"]

_FORM: Final = "serial:///dev/ttyUSB0?baudrate=9600 or serial://COM3 or serial://?serial_number=A50285BI"
_BACKENDS: Final[Mapping[str, str]] = {"pyserial": "pyserial", "serialx": "serialx"}


@dataclass(frozen=True, slots=True, kw_only=True)
class _Request:
    """What a URL asks for."""

    name: str
    serial_number: str | None
    settings: LineSettings
    dsrdtr: bool
    backend: str | None

    @classmethod
    def of(cls, url: TransportURL) -> _Request:
        url.expect(_FORM, host=True, path=True, query=(*LINE_OPTIONS, "dsrdtr", "serial_number", "backend"))
        serial_number = url.query.get("serial_number") or None
        named = [each for each in (url.host, url.path, serial_number) if each]
        if len(named) != 1:
            what = "names no serial port" if not named else "names two ports"
            raise TransportError(
                f"the URL {str(url)!r} {what}", hint=f"write it as {_FORM}, with three slashes before a path"
            )
        return cls(
            name=url.host or url.path,
            serial_number=serial_number,
            settings=LineSettings.of(url),
            dsrdtr=url.flag("dsrdtr"),
            backend=url.choice("backend", None, _BACKENDS),
        )

    def find(self) -> str:
        """Return the name of the port; in a thread, and anew each time, for what is plugged in again gets another."""
        return self.name if self.serial_number is None else port_with_serial_number(self.serial_number)

    def open(self) -> tuple[str, Port]:
        """Open the port; in a thread."""
        backend, name = backend_to_use(self.backend), self.find()
        try:
            return name, open_port(backend, name, self.settings, dsrdtr=self.dsrdtr)
        except Exception as exc:
            raise explained(name, self.settings, exc) from exc


async def open_serial(url: TransportURL, protocol_factory: ProtocolFactory) -> asyncio.Transport:
    """
    Open ``serial:///dev/ttyUSB0`` or ``serial://COM3`` exclusively, with 9600 baud, 8N1 and no handshake by default.

    ``serial://?serial_number=A50285BI`` is the one port whose USB adapter has that serial number, wherever it is
    plugged in; it is looked for at every opening.

    Options: ``baudrate``, ``bytesize`` (5..8), ``parity`` (N, E, O, M, S), ``stopbits`` (1, 1.5, 2), and the
    handshakes ``rtscts``, ``xonxoff``, ``dsrdtr`` (1 or 0); ``backend`` (``pyserial`` or ``serialx``; without it,
    serialx if it is installed).

    Returns:
        The transport; its ``get_extra_info("serial")`` is the :class:`serial.Serial` or :class:`serialx.Serial`.

    Raises:
        TransportError: The port is missing, in use, not ours to open, no serial port, or refuses these settings;
            no port or several have that serial number; or serialx is asked for, but not installed.
    """
    request = _Request.of(url)
    if os.name != "posix":  # pragma: no cover
        return await _open_elsewhere(request, protocol_factory)
    name, port = await _open_in_thread(request.open)
    loop = asyncio.get_running_loop()
    try:
        line = SerialLine(loop, protocol_factory(), port, name)
    except BaseException:
        await loop.run_in_executor(None, port.close)
        raise
    line.connect()
    return line


async def _open_elsewhere(request: _Request, protocol_factory: ProtocolFactory) -> asyncio.Transport:
    """Open the port where there is no POSIX: through the library's own transport."""
    if await asyncio.to_thread(backend_to_use, request.backend) == "pyserial":
        _, port = await _open_in_thread(request.open)
        return await connect_on_pyserial(port, protocol_factory)
    name = await asyncio.to_thread(request.find)
    try:
        return await connect_on_serialx(name, request.settings, protocol_factory, dsrdtr=request.dsrdtr)
    except Exception as exc:
        raise await asyncio.to_thread(explained, name, request.settings, exc) from exc


async def _open_in_thread(open_named: Callable[[], tuple[str, Port]]) -> tuple[str, Port]:
    """Return what *open_named* opens; a port that opens after we were cancelled is closed by the thread."""
    handover = threading.Lock()
    opened: list[tuple[str, Port]] = []
    abandoned = False

    def work() -> None:
        name, port = open_named()
        with handover:
            if not abandoned:
                opened.append((name, port))
                return
        port.close()

    # Of its own: ports that hang in those of the loop would leave none for others.
    own_thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="opens a serial port")
    working = asyncio.get_running_loop().run_in_executor(own_thread, work)
    own_thread.shutdown(wait=False)
    try:
        # Shielded, so that a thread that cannot be stopped still counts as being at work.
        await asyncio.shield(working)
    except asyncio.CancelledError:
        with handover:
            abandoned = True
        for _, port in opened:
            asyncio.get_running_loop().run_in_executor(None, port.close)
        working.add_done_callback(lambda done: done.cancelled() or done.exception())  # nobody asks for it any more
        raise
    return opened.pop()
