"""The two libraries that open a serial port: pyserial, and serialx where it is installed."""

from __future__ import annotations

import asyncio
import importlib
import importlib.util
import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from types import MappingProxyType, ModuleType
from typing import Any, Final, Protocol

import serial
import serial_asyncio

from compax_aio.errors import TransportError

from .line_settings import LineSettings
from .registry import ProtocolFactory

if os.name == "posix":
    import termios

__all__ = ["BACKENDS", "Port", "backend_to_use", "connect_on_pyserial", "connect_on_serialx", "open_port"]


class Port(Protocol):
    """What either library opens, as far as we need it on POSIX: bytes go past it (decision 4)."""

    def fileno(self) -> int:
        """Return the file descriptor."""

    def close(self) -> None:
        """Release the port."""


def backend_to_use(asked_for: str | None) -> str:
    """
    Return the name of the library that is to open the port: what is asked for, else serialx if it is installed.

    For use in a thread: it looks on disk, and imports.

    Raises:
        TransportError: serialx is asked for, but not installed; or it is installed, but cannot be imported.
    """
    if asked_for == "pyserial" or (asked_for is None and importlib.util.find_spec("serialx") is None):
        return "pyserial"
    _serialx()
    return "serialx"


def _serialx() -> ModuleType:
    try:
        return importlib.import_module("serialx")
    except ModuleNotFoundError as exc:
        raise TransportError(
            f"backend=serialx cannot be used: {exc}",
            hint="install it by `pip install 'compax-aio[serialx]'`, or leave backend= away",
        ) from exc
    except Exception as exc:  # importing it runs its code, which may raise anything
        raise TransportError(
            f"serialx is installed, but cannot be imported: {type(exc).__name__}: {exc}",
            hint="reinstall or uninstall it, or open the port with backend=pyserial",
        ) from exc


# --- POSIX: a port, opened in a thread


def open_port(backend: str, name: str, settings: LineSettings, *, dsrdtr: bool) -> Port:
    """Open *name* exclusively; for use in a thread. What the library raises, it raises."""
    try:
        return BACKENDS[backend](name, settings, dsrdtr)
    except Exception:
        if (settings.bytesize, settings.parity) == (8, "N") or not _is_pseudo_terminal(name):
            raise
    # It has no frame: the kernel keeps neither size nor parity, and libc refuses a change of nothing but these.
    return BACKENDS[backend](name, replace(settings, bytesize=8, parity="N"), dsrdtr)


def _is_pseudo_terminal(name: str) -> bool:
    return os.path.realpath(name).startswith("/dev/pts/")


def _open_with_pyserial(name: str, settings: LineSettings, dsrdtr: bool) -> Port:
    # On POSIX, 0 s between bytes asks for VMIN=1: a read of nothing then says that the port went away, and never that
    # it was empty after all.
    posix: Mapping[str, Any] = {"inter_byte_timeout": 0} if os.name == "posix" else {}
    return serial.Serial(
        name,
        baudrate=settings.baudrate,
        bytesize=settings.bytesize,
        parity=settings.parity,
        stopbits=settings.stopbits,
        rtscts=settings.rtscts,
        xonxoff=settings.xonxoff,
        dsrdtr=dsrdtr,
        exclusive=True,
        timeout=0,
        write_timeout=0,
        **posix,
    )


def _open_with_serialx(name: str, settings: LineSettings, dsrdtr: bool) -> Port:
    port = _serialx().Serial(
        name, **_settings_for_serialx(settings, dsrdtr), exclusive=True, min_read_size=1, inter_byte_timeout=0
    )
    try:
        port.open()
        _let_xon_alone_end_xoff(port.fileno())
    except BaseException:
        with suppress(OSError):
            port.close()
        raise
    opened: Port = port
    return opened


def _settings_for_serialx(settings: LineSettings, dsrdtr: bool) -> dict[str, Any]:
    return {
        "baudrate": settings.baudrate,
        "byte_size": settings.bytesize,
        "parity": settings.parity,
        "stopbits": settings.stopbits,
        "rtscts": settings.rtscts,
        "xonxoff": settings.xonxoff,
        "dsrdtr": dsrdtr,
    }


def _let_xon_alone_end_xoff(descriptor: int) -> None:
    # serialx asks for IXANY: any byte that the drive sends while it holds the line would let go of it.
    attributes = termios.tcgetattr(descriptor)
    if attributes[0] & termios.IXANY:
        attributes[0] &= ~termios.IXANY
        termios.tcsetattr(descriptor, termios.TCSANOW, attributes)


BACKENDS: Final[Mapping[str, Callable[[str, LineSettings, bool], Port]]] = MappingProxyType(
    {"pyserial": _open_with_pyserial, "serialx": _open_with_serialx}
)


# --- elsewhere: the library's own transport


async def connect_on_pyserial(port: Port, protocol_factory: ProtocolFactory) -> asyncio.Transport:
    """Connect *port* through pyserial-asyncio's own transport."""
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


async def connect_on_serialx(
    name: str, settings: LineSettings, protocol_factory: ProtocolFactory, *, dsrdtr: bool
) -> asyncio.Transport:
    """Open *name* through serialx's own transport. What the library raises, it raises."""
    connect = _serialx().create_serial_connection
    transport: asyncio.Transport
    transport, _ = await connect(
        asyncio.get_running_loop(),
        protocol_factory,
        name,
        **_settings_for_serialx(settings, dsrdtr),
        exclusive=True,
    )
    return transport
