"""XMODEM as the controls speak it: the original, with blocks of 128 bytes and a sum of one byte."""

from __future__ import annotations

from typing import Final

__all__ = [
    "BLOCK_BYTES",
    "CANCELS_TO_STOP",
    "FIRST_BLOCK",
    "FRAME_BYTES",
    "HIGHEST_BLOCK",
    "NAK_INTERVAL_S",
    "NAK_WAIT_S",
    "RETRIES",
    "checksum",
]

BLOCK_BYTES: Final = 128
"""Of data in a block (OpenDNC)."""
FRAME_BYTES: Final = 132
"""SOH, number, 255 - number, data, sum (OpenDNC)."""
FIRST_BLOCK: Final = 1
HIGHEST_BLOCK: Final = 255
"""0 follows."""
RETRIES: Final = 10
"""Of one block (inferred)."""
NAK_WAIT_S: Final = 10.0
"""A receiver says NAK again after so long (OpenDNC: seen of the PC; inferred as a rule)."""
NAK_INTERVAL_S: Final = 1.0
"""A control that receives says NAK about so often (OpenDNC: about two more in two seconds)."""
CANCELS_TO_STOP: Final = 2
"""So many CAN in a row stop it, anywhere but behind EOT (inferred)."""


def checksum(data: bytes) -> int:
    """Return the sum of *data* in one byte (OpenDNC)."""
    return sum(data) & 0xFF
