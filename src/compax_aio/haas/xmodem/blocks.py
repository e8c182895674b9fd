"""The blocks of XMODEM: SOH, number, its complement, 128 bytes of data, and their sum."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from ...errors import InvalidCommandError
from ..facts.characters import CAN, LINE_FEED, SOH, SUB
from ..facts.xmodem import BLOCK_BYTES, FRAME_BYTES, checksum

__all__ = [
    "CANCEL",
    "CRC_REQUEST",
    "FRAME_BYTES",
    "block",
    "block_count",
    "has_header",
    "sums_with_eob_as_line_feed",
]

CRC_REQUEST: Final = ord("C")
"""What a receiver sends that wants a CRC in place of the sum; no Haas control is known to."""
CANCEL: Final = bytes([CAN] * 3)
"""Two are heeded; a control sends three."""

_HEADER_BYTES: Final = 3


def block_count(size_bytes: int) -> int:
    """Return in how many blocks so many bytes go."""
    return -(-size_bytes // BLOCK_BYTES)


def block(data: bytes, index: int) -> bytes:
    """
    Return the block that has the part of *data* that is number *index*, counted from 1; the last one is filled up.

    Raises:
        InvalidCommandError: There is no such part.
    """
    part = data[(index - 1) * BLOCK_BYTES : index * BLOCK_BYTES] if index > 0 else b""
    if not part:
        raise InvalidCommandError(f"there is no block {index} of {len(data)} bytes")
    part = part.ljust(BLOCK_BYTES, bytes([SUB]))
    number = index & 0xFF
    return bytes([SOH, number, 0xFF - number]) + part + bytes([checksum(part)])


def has_header(data: bytes | bytearray) -> bool:
    """Whether *data* begins like a block, as far as it goes."""
    return data[:1] == bytes([SOH]) and (len(data) < _HEADER_BYTES or data[1] + data[2] == 0xFF)


def sums_with_eob_as_line_feed(data: bytes, eob: bytes, *, is_half_before: bool = False) -> Iterator[int]:
    """
    Yield the sums that a control may have computed over *data* as if each end of block, *eob*, were one LF.

    So it is said of controls whose Setting 25 is not LF only, though other bytes travel. What it does with an end of
    block that two blocks share is not known, so each possibility is yielded.

    Args:
        data: The 128 bytes.
        eob: What travels: CR LF, CR, CR CR or LF LF.
        is_half_before: Whether the block before ended with the first half of an end of block.
    """
    first, whole = eob[:1], len(eob) == 2
    heads = [data]
    if whole and is_half_before and data[:1] == eob[1:]:
        heads += [data[1:], bytes([LINE_FEED]) + data[1:]]
    for head in heads:
        told = head.replace(eob, bytes([LINE_FEED]))
        yield checksum(told)
        if whole and told[-1:] == first and data[-1:] == first:
            yield checksum(told[:-1])
            yield checksum(told[:-1] + bytes([LINE_FEED]))
