"""What a serial port shows of its handshake lines, without touching them."""

from __future__ import annotations

import os
import struct
from typing import Final, Protocol

if os.name == "posix":
    import fcntl
    import termios

__all__ = ["cts_level"]

_INT: Final = struct.Struct("i")


class _Port(Protocol):
    def fileno(self) -> int:
        """Return the file descriptor."""


def cts_level(port: _Port) -> bool | None:
    """
    Return whether CTS is on at *port*, as ``get_extra_info("serial")`` gives it; for use in a thread.

    None where nobody can say: a pseudo-terminal has no such line, an adapter may not tell it.
    """
    if os.name != "posix":  # pragma: no cover
        return bool(getattr(port, "cts", False)) if hasattr(port, "cts") else None
    try:
        told = fcntl.ioctl(port.fileno(), termios.TIOCMGET, bytes(_INT.size))
    except (OSError, ValueError):
        return None
    return bool(_INT.unpack(told)[0] & termios.TIOCM_CTS)
