"""What a UART hears of one that sends at another baud rate, bit by bit, and at which rate a terminal is set."""

from __future__ import annotations

import re
import struct
import sys
import termios
from collections.abc import Iterator
from typing import Final

__all__ = ["heard", "rate_of", "set_rate"]

_FRAME_BITS: Final = 10
"""Start bit, eight data bits from the lowest on, stop bit; no parity (UG p. 160)."""

_BY_CODE: Final = {getattr(termios, name): int(name[1:]) for name in dir(termios) if re.fullmatch(r"B[1-9]\d*", name)}
_CODES: Final = {rate: code for code, rate in _BY_CODE.items()}
_INPUT, _OUTPUT = 4, 5
_GET_ANY_RATE: Final = 0x802C542A
"""TCGETS2 of Linux: tells rates that have no code of their own, too."""
_ANY_RATE_FORM: Final = "4IB19s2I"


def heard(data: bytes, sent_at: int, heard_at: int) -> bytes:
    """
    Return what a UART at *heard_at* baud makes of *data* that was sent at *sent_at*, back to back on a line at rest.

    It takes each bit in the middle of its own bit times, from the edge of a start bit on. A frame whose stop bit is
    none is handed on all the same, as serial ports do when nobody asks them to check; the next one begins at the
    next edge. At the same rate it is *data*.
    """
    return data if sent_at == heard_at else bytes(_frames(_levels(data), sent_at, heard_at))


def _levels(data: bytes) -> list[int]:
    """List the levels of the line, one for each bit time of the sender."""
    return [level for byte in data for level in (0, *(byte >> bit & 1 for bit in range(8)), 1)]


def _frames(levels: list[int], sent_at: int, heard_at: int) -> Iterator[int]:
    # Time is counted in whole numbers: a bit of the sender lasts 2 * heard_at, one of the receiver 2 * sent_at.
    def level(time: int) -> int:
        place = time // (2 * heard_at)
        return levels[place] if place < len(levels) else 1  # at rest

    def next_edge(place: int) -> int | None:
        return next(
            (each for each in range(place, len(levels)) if not levels[each] and (not each or levels[each - 1])), None
        )

    edge = next_edge(0)
    while edge is not None:
        begin = edge * 2 * heard_at
        yield sum(level(begin + (2 * bit + 3) * sent_at) << bit for bit in range(8))
        stop_bit = begin + (2 * _FRAME_BITS - 1) * sent_at
        edge = next_edge(stop_bit // (2 * heard_at) + 1)


def rate_of(terminal: int) -> int | None:
    """Return the baud rate that a terminal is set to; None: the system does not tell it."""
    code = termios.tcgetattr(terminal)[_OUTPUT]
    if code in _BY_CODE:
        return _BY_CODE[code]
    return _any_rate_of(terminal) if sys.platform == "linux" else code or None


def _any_rate_of(terminal: int) -> int | None:
    import fcntl  # noqa: PLC0415  # rates without a code are rare

    try:
        told = fcntl.ioctl(terminal, _GET_ANY_RATE, bytes(struct.calcsize(_ANY_RATE_FORM)))
    except OSError:  # an architecture that numbers it otherwise
        return None
    return int(struct.unpack(_ANY_RATE_FORM, told)[-1]) or None


def set_rate(terminal: int, baudrate: int) -> None:
    """Set a terminal to a baud rate that has a code, both ways."""
    attributes = termios.tcgetattr(terminal)
    attributes[_INPUT] = attributes[_OUTPUT] = _CODES[baudrate]
    termios.tcsetattr(terminal, termios.TCSANOW, attributes)
