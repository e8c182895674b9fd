"""
What a serial port has counted of damage on its line: characters with a wrong parity or frame, and lost ones.

The driver counts them from its start, so a count says nothing by itself; the difference of two is what happened
between. The Linux call is ``TIOCGICOUNT``; it reads numbers that the driver holds, and never waits for the line. A
pseudo-terminal, a socket and other systems have none; and some drivers of USB adapters count nothing, although they
answer: no errors counted is a good sign, and no proof.
"""

from __future__ import annotations

import struct
import sys
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, Final

if sys.platform == "linux":
    import fcntl
    import termios

    _ASK: Callable[[int, int, bytes], bytes] | None = fcntl.ioctl
    _COUNTERS: int | None = getattr(termios, "TIOCGICOUNT", None)
else:  # pragma: no cover
    _ASK, _COUNTERS = None, None

__all__ = ["LineErrors", "line_errors_of"]

_STRUCT: Final = struct.Struct("20i")
"""``struct serial_icounter_struct``: cts, dsr, rng, dcd, rx, tx, frame, overrun, parity, brk, buf_overrun, 9 spare."""
_FRAME: Final = 6
_WRAP: Final = 1 << 32


@dataclass(frozen=True, slots=True, kw_only=True)
class LineErrors:
    """Characters, or moments, that a port has counted as damaged."""

    parity: int = 0
    """Characters with the wrong parity."""
    frame: int = 0
    """Characters without a stop bit: a wrong baud rate or number of data bits, or a disturbed line."""
    overrun: int = 0
    """Characters lost in the port, whose receiver was not read in time."""
    breaks: int = 0
    """Times that the line was held low."""
    buffer_overrun: int = 0
    """Characters lost in the system, whose buffer was not read in time."""

    def since(self, before: LineErrors) -> LineErrors:
        """Return what was counted since *before*; counters of 32 bits may have begun anew meanwhile."""
        counts = {each.name: (getattr(self, each.name) - getattr(before, each.name)) % _WRAP for each in fields(self)}
        return LineErrors(**counts)

    @property
    def total(self) -> int:
        """How many there are of all kinds."""
        return sum(getattr(self, each.name) for each in fields(self))

    def __bool__(self) -> bool:
        return self.total > 0

    def __str__(self) -> str:
        """Say which there are: ``2 parity errors and 1 break``."""
        counts = [(getattr(self, name), words) for name, words in _WORDS.items()]
        said = [f"{count} {words[count != 1]}" for count, words in counts if count]
        return " and ".join(said) or "no errors"


_WORDS: Final = {
    "parity": ("parity error", "parity errors"),
    "frame": ("framing error", "framing errors"),
    "overrun": ("overrun of the port", "overruns of the port"),
    "breaks": ("break", "breaks"),
    "buffer_overrun": ("overrun of the system's buffer", "overruns of the system's buffer"),
}


def line_errors_of(port: Any) -> LineErrors | None:
    """
    Read the counters of a serial port; it takes microseconds, whatever the line does.

    Args:
        port: What a transport names ``serial``: anything that has a file descriptor; or None.

    Returns:
        The counts since the driver's start; None where nobody counts, or the port went away.
    """
    if port is None or _ASK is None or _COUNTERS is None:
        return None
    try:
        data = _ASK(port.fileno(), _COUNTERS, bytes(_STRUCT.size))
    except (OSError, ValueError, AttributeError, TypeError, AssertionError):  # none, closed (serialx asserts), no port
        return None
    frame, overrun, parity, breaks, buffer_overrun = _STRUCT.unpack(data)[_FRAME : _FRAME + 5]
    return LineErrors(parity=parity, frame=frame, overrun=overrun, breaks=breaks, buffer_overrun=buffer_overrun)
