"""The parity bit as the eighth bit of a byte, as it travels where both ends of the line are set to 8N1."""

from __future__ import annotations

import re
from typing import Final

from compax_aio.haas.facts.port_settings import Parity

__all__ = ["ByteForm"]

_SEVEN_BITS: Final = 0x7F
_HIGH: Final = 0x80
_WRONG: Final = re.compile(rb"[\x80-\xff]")


class ByteForm:
    """
    What the port makes of bytes.

    Args:
        data_bits: 7 or 8.
        parity: Of the eighth bit.
        in_bytes: Whether the eighth bit is the parity bit, both ways; otherwise, with 7 data bits, there is none.
    """

    def __init__(self, data_bits: int, parity: Parity, *, in_bytes: bool) -> None:
        self._out: bytes | None = None
        self._in: bytes | None = None
        self._checks = in_bytes
        if in_bytes:
            self._out = bytes(_with_parity(byte & _SEVEN_BITS, parity) for byte in range(256))
            right = set(self._out)
            self._in = bytes(byte & _SEVEN_BITS if byte in right else _HIGH | byte for byte in range(256))
        elif data_bits == 7:
            self._out = self._in = bytes(byte & _SEVEN_BITS for byte in range(256))

    def sent(self, data: bytes) -> bytes:
        """Return *data* as it is on the line."""
        return data if self._out is None else data.translate(self._out)

    def heard(self, data: bytes) -> tuple[bytes, int | None]:
        """Return what the port hands on, and the place of the first byte with the wrong parity, if one has."""
        if self._in is None:
            return data, None
        data = data.translate(self._in)
        if not self._checks or data.isascii():
            return data, None
        wrong = _WRONG.search(data)
        assert wrong is not None
        return data.translate(_PLAIN), wrong.start()


_PLAIN: Final = bytes(byte & _SEVEN_BITS for byte in range(256))


def _with_parity(byte: int, parity: Parity) -> int:
    ones = byte.bit_count() % 2
    match parity:
        case Parity.EVEN:
            return byte | ones << 7
        case Parity.ODD:
            return byte | (1 - ones) << 7
        case _:
            return byte
