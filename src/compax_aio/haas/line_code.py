"""How characters stand in the bytes of a line: with a parity bit that is made and checked here, or without."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from .profiles import Profile

__all__ = ["LineCode"]

_SEVEN_BITS: Final = bytes(range(0x80))
_ALL: Final = bytes(range(0x100))


class LineCode:
    """
    How characters stand in the bytes of a line.

    With ``profile.parity_in="bytes"`` bit 7 is the parity bit: added to what is sent, checked and taken off what comes,
    so damage is found at its place over any line. Otherwise bytes are what they are; with 7 data bits one above 7F is
    damage, whoever has looked at its parity.

    Args:
        profile: How the control is set up.

    Attributes:
        finds_damage: Whether a byte can be found to be damaged.
    """

    def __init__(self, profile: Profile) -> None:
        is_here = profile.parity_in == "bytes"
        self._encoding = _encoding(profile.parity) if is_here else None
        self._decoding = bytes(byte & 0x7F for byte in _ALL) if is_here else None
        if self._encoding is not None:
            self._right = self._encoding[:0x80]
        else:
            self._right = _SEVEN_BITS if profile.data_bits == 7 else _ALL
        self.finds_damage = len(self._right) < len(_ALL)

    def encode(self, data: bytes) -> bytes:
        """Return *data* as it is written; bit 7 of it, which is none of a character of 7 bits, is lost."""
        return data if self._encoding is None else data.translate(self._encoding)

    def decode(self, data: bytes) -> Iterator[tuple[bytes, bool]]:
        """Take what came apart: pieces in order, and whether the first byte of each is damaged."""
        text = data if self._decoding is None else data.translate(self._decoding)
        if not self.finds_damage or not data.translate(None, self._right):
            yield text, False
            return
        begin, is_damaged = 0, False
        for at, byte in enumerate(data):
            if byte not in self._right:
                if at > begin:
                    yield text[begin:at], is_damaged
                begin, is_damaged = at, True
        yield text[begin:], is_damaged


def _encoding(parity: str | None) -> bytes:
    """Return, by byte, what is written for it: bit 7 makes the number of ones even, or odd, or is 0."""
    odd = parity == "odd"
    if parity == "zero":
        return bytes(byte & 0x7F for byte in _ALL)
    return bytes((byte & 0x7F) | (((byte & 0x7F).bit_count() & 1) ^ odd) << 7 for byte in _ALL)
