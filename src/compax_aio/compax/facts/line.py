"""The RS-232 line: signs, lengths and speeds (UG p. 160)."""

from __future__ import annotations

from typing import Final

__all__ = [
    "BAUD_RATES",
    "COMMAND_END",
    "DEFAULT_BAUD_RATE",
    "ECHO_SIGN",
    "ERROR_PATTERN",
    "EXECUTE_SIGN",
    "MAX_LINE_LENGTH",
    "POSITION_REACHED_SIGN",
    "PROMPT",
    "STORE_SIGN",
    "XOFF",
    "XON",
]

PROMPT: Final = b"\r\n>"
"""Ends every answer and every message; the drive takes a new command only after it (UG p. 160)."""

COMMAND_END: Final = b"\r"
"""Ends a command; an LF after it has no meaning to the drive (UG p. 160)."""

MAX_LINE_LENGTH: Final = 30
"""Characters in the entry buffer and in the output buffer (UG p. 160); that CR is not counted is inferred."""

POSITION_REACHED_SIGN: Final = "$"
"""After POSA or POSR: the drive sends ``$`` and its prompt at position reached (UG p. 160)."""

STORE_SIGN: Final = ","
"""Interpret and keep in the intermediate memory, one instruction, without executing it (UG p. 160)."""

EXECUTE_SIGN: Final = "!"
"""Execute the instruction in the intermediate memory (UG p. 160)."""

ECHO_SIGN: Final = "?"
"""The drive sends back what it received (UG p. 160)."""

ERROR_PATTERN: Final = r"(?<![A-Z0-9.])E(\d{1,3})(?!\d|\.\d)"
"""An error in an answer: ``E`` and digits anywhere on the line, with or without text around them.

The page on it was not available; elsewhere the manual writes codes so (UG p. 209).
"""

XON: Final = 0x11
XOFF: Final = 0x13

DEFAULT_BAUD_RATE: Final = 9600
BAUD_RATES: Final = (9600, 4800)
"""Chosen with P19; 8 data bits, 1 stop bit, no parity (UG p. 160)."""
