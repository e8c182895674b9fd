"""The settings of a serial port, as the options of a URL name them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from .url import TransportURL

__all__ = ["LINE_OPTIONS", "LineSettings"]

LINE_OPTIONS: Final = ("baudrate", "bytesize", "parity", "stopbits", "rtscts", "xonxoff")

_BYTESIZES: Final[Mapping[str, int]] = MappingProxyType({"5": 5, "6": 6, "7": 7, "8": 8})
_PARITIES: Final[Mapping[str, str]] = MappingProxyType({parity: parity for parity in "NEOMS"})
_STOPBITS: Final[Mapping[str, float]] = MappingProxyType({"1": 1, "1.5": 1.5, "2": 2})


@dataclass(frozen=True, slots=True, kw_only=True)
class LineSettings:
    """
    What both ends of a serial line have to agree on; by default what a COMPAX has (9600 baud, 8N1).

    Attributes:
        baudrate: Bits per second.
        bytesize: Data bits, 5 to 8.
        parity: None, even, odd, mark or space: ``N``, ``E``, ``O``, ``M``, ``S``.
        stopbits: 1, 1.5 or 2.
        rtscts: Whether RTS and CTS hold the line.
        xonxoff: Whether Xon and Xoff hold the line.
    """

    baudrate: int = 9600
    bytesize: int = 8
    parity: str = "N"
    stopbits: float = 1
    rtscts: bool = False
    xonxoff: bool = False

    @classmethod
    def of(cls, url: TransportURL) -> LineSettings:
        """
        Read the options of *url*.

        Raises:
            TransportError: One of them is not allowed; the message says what is.
        """
        return cls(
            baudrate=url.integer("baudrate", 9600, minimum=1, maximum=12_000_000),
            bytesize=url.choice("bytesize", 8, _BYTESIZES),
            parity=url.choice("parity", "N", _PARITIES),
            stopbits=url.choice("stopbits", 1, _STOPBITS),
            rtscts=url.flag("rtscts"),
            xonxoff=url.flag("xonxoff"),
        )

    @property
    def handshake(self) -> str:
        """What holds the line: ``xonxoff``, ``rtscts``, or ``none``."""
        return "xonxoff" if self.xonxoff else "rtscts" if self.rtscts else "none"
