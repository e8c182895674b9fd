"""Open ``serial://`` lines: in a thread, exclusively, and saying what to do when it cannot be done."""

from __future__ import annotations

import asyncio
import errno
import os
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

import serial
import serial_asyncio

from compax_aio.errors import TransportError

from .registry import ProtocolFactory
from .serial_ports import PortInfo, list_ports, list_ports_blocking
from .url import TransportURL

if os.name == "posix":
    import grp

    from .serial_line import SerialLine

__all__ = ["PortInfo", "connect_on_base", "list_ports", "open_serial"]

_FORM: Final = "serial:///dev/ttyUSB0?baudrate=9600 or serial://COM3"
_OPTIONS: Final = ("baudrate", "bytesize", "parity", "stopbits", "rtscts", "xonxoff", "dsrdtr")
_BYTESIZES: Final[Mapping[str, int]] = {str(size): size for size in serial.Serial.BYTESIZES}
_PARITIES: Final[Mapping[str, str]] = {parity: parity for parity in serial.Serial.PARITIES}
_STOPBITS: Final[Mapping[str, float]] = {str(count): count for count in serial.Serial.STOPBITS}


async def open_serial(url: TransportURL, protocol_factory: ProtocolFactory) -> asyncio.Transport:
    """
    Open ``serial:///dev/ttyUSB0`` or ``serial://COM3`` exclusively, with 9600 baud, 8N1 and no handshake by default.

    Options: ``baudrate``, ``bytesize`` (5..8), ``parity`` (N, E, O, M, S), ``stopbits`` (1, 1.5, 2), and the
    handshakes ``rtscts``, ``xonxoff``, ``dsrdtr`` (1 or 0).

    Returns:
        The transport; its ``get_extra_info("serial")`` is the :class:`serial.Serial`.

    Raises:
        TransportError: The port is missing, in use, not ours to open, no serial port, or refuses these settings.
    """
    url.expect(_FORM, host=True, path=True, query=_OPTIONS)
    if bool(url.host) == bool(url.path):
        raise TransportError(
            f"the URL {str(url)!r} names no serial port" if not url.host else f"the URL {str(url)!r} names two ports",
            hint=f"write it as {_FORM}, with three slashes before a path",
        )
    name = url.host or url.path
    settings: dict[str, Any] = {
        "baudrate": url.integer("baudrate", 9600, minimum=1, maximum=12_000_000),
        "bytesize": url.choice("bytesize", 8, _BYTESIZES),
        "parity": url.choice("parity", "N", _PARITIES),
        "stopbits": url.choice("stopbits", 1, _STOPBITS),
        "rtscts": url.flag("rtscts"),
        "xonxoff": url.flag("xonxoff"),
        "dsrdtr": url.flag("dsrdtr"),
    }
    port = await _open_in_thread(lambda: _open_port(name, settings))
    if os.name != "posix":  # pragma: no cover
        return await connect_on_base(port, protocol_factory)
    loop = asyncio.get_running_loop()
    try:
        line = SerialLine(loop, protocol_factory(), port)
    except BaseException:
        await loop.run_in_executor(None, port.close)
        raise
    line.connect()
    return line


async def connect_on_base(port: serial.Serial, protocol_factory: ProtocolFactory) -> asyncio.Transport:
    """Connect *port* through pyserial-asyncio's own transport, which is what there is outside POSIX."""
    loop = asyncio.get_running_loop()
    transport: asyncio.Transport = serial_asyncio.SerialTransport(loop, protocol_factory(), port)
    connected = asyncio.Event()
    loop.call_soon(connected.set)  # comes after connection_made, which the transport has scheduled
    try:
        await connected.wait()
    except asyncio.CancelledError:
        transport.abort()
        raise
    return transport


async def _open_in_thread(open_port: Callable[[], serial.Serial]) -> serial.Serial:
    """Return what *open_port* opens; a port that opens after we were cancelled is closed by the thread."""
    handover = threading.Lock()
    opened: list[serial.Serial] = []
    abandoned = False

    def work() -> None:
        port = open_port()
        with handover:
            if not abandoned:
                opened.append(port)
                return
        port.close()

    working = asyncio.get_running_loop().run_in_executor(None, work)
    try:
        # Shielded, so that a thread that cannot be stopped still counts as being at work.
        await asyncio.shield(working)
    except asyncio.CancelledError:
        with handover:
            abandoned = True
        for port in opened:
            asyncio.get_running_loop().run_in_executor(None, port.close)
        working.add_done_callback(lambda done: done.cancelled() or done.exception())  # nobody asks for it any more
        raise
    return opened.pop()


def _open_port(name: str, settings: Mapping[str, Any]) -> serial.Serial:
    # On POSIX, 0 s between bytes asks for VMIN=1: a read of nothing then says that the port went away, and never that
    # it was empty after all.
    posix: Mapping[str, Any] = {"inter_byte_timeout": 0} if os.name == "posix" else {}
    try:
        return serial.Serial(name, exclusive=True, timeout=0, write_timeout=0, **settings, **posix)
    except OSError as exc:
        raise _explained(name, exc) from exc
    except Exception as exc:  # termios.error, ValueError, OverflowError: whatever the driver and pyserial say no with
        raise TransportError(
            f"the serial port {name} refuses {settings['baudrate']} baud or the other settings: {exc}",
            hint="try a standard baud rate (COMPAX: 4800 or 9600) and no handshake",
        ) from exc


def _explained(name: str, exc: OSError) -> TransportError:
    number, text = _errno_of(exc), str(exc)
    if number in {errno.ENOENT, errno.ENODEV, errno.ENXIO, errno.EIO} or "FileNotFoundError" in text:
        ports = ", ".join(port.device for port in list_ports_blocking())
        return TransportError(
            f"there is no serial port {name}",
            hint=f"ports of this computer: {ports}" if ports else "this computer has no serial port; is it plugged in?",
        )
    if number in {errno.EAGAIN, errno.EBUSY} or "PermissionError" in text:
        return TransportError(
            f"the serial port {name} is in use",
            hint="end the program that has it open (on Linux, `fuser -v` and its path name it)",
        )
    if number in {errno.EACCES, errno.EPERM}:
        return TransportError(f"no permission to open the serial port {name}", hint=_how_to_get_permission(name))
    if number in {errno.ENOTTY, errno.EISDIR}:
        return TransportError(f"{name} is not a serial port", hint="give the path of a device, like /dev/ttyUSB0")
    return TransportError(f"the serial port {name} could not be opened: {text}")


def _errno_of(exc: OSError) -> int | None:
    # pyserial passes no number on when a port cannot be configured; it is in the termios.error that it stands for.
    if exc.errno is None and exc.__context__ is not None and exc.__context__.args:
        number = exc.__context__.args[0]
        return number if isinstance(number, int) else None
    return exc.errno


def _how_to_get_permission(name: str) -> str:
    try:
        status = Path(name).stat()
        group = grp.getgrgid(status.st_gid).gr_name
    except (OSError, KeyError):
        return "ask who administers this computer"
    if group == "root" or status.st_mode & 0o060 != 0o060:
        return f"its group {group} gives no access: ask for a udev rule that gives it to a group of yours"
    return f"it belongs to the group {group}: run `sudo usermod -aG {group} $USER`, then log in again"
