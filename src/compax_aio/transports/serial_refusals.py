"""Why a serial port does not open, and what to do about it."""

from __future__ import annotations

import errno
import os
from pathlib import Path

from compax_aio.errors import TransportError

from .line_settings import LineSettings
from .serial_ports import list_ports_blocking

if os.name == "posix":
    import grp

__all__ = ["explained"]


def explained(name: str, settings: LineSettings, exc: Exception) -> TransportError:
    """Return what is to be raised for *exc*, with which a driver or a library did not open *name*; for a thread."""
    if isinstance(exc, OSError) and (number := _errno_of(exc)) != errno.EINVAL:
        return _does_not_open(name, number, str(exc))
    # Whatever the driver and the libraries say no with: termios.error, ValueError, OverflowError, UnsupportedSetting.
    return TransportError(
        f"the serial port {name} refuses {settings.baudrate} baud or the other settings: {exc}",
        hint="try a standard baud rate (COMPAX: 4800 or 9600) and no handshake",
    )


def _does_not_open(name: str, number: int | None, text: str) -> TransportError:
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
